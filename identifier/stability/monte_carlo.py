"""The proven bounds of a design against drives: how far does the identifier really go?

Each drive has its own road, steering and initial weights; the identifier runs over all of them at
once, one in each lane, and keeps nothing but the largest norms. Sensors err as much as is declared.
Only drives that break a declared condition (slip, speed, steering, yaw rate) are left out: a bound
that is passed is wrong.
"""

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from codegen import BatchScan
from identifier.design import Design
from identifier.driving import Driving
from identifier.network import Weights
from identifier.stability.random_drives import (
    Drives,
    measured,
    random_drives,
    residuals,
    within,
)
from identifier.step import CARRY, GAINS, OVER, Structure, build_step
from models.bicycle import bicycle
from models.vehicle import Vehicle

Array = NDArray[np.float64]
PEAKS = ("peak_xi_tilde", "peak_W", "peak_V")
DURATION = 15.0  # s
FEWEST = 256  # drives that are drawn at a time
TRIES = 20  # drives that are drawn for each that is wanted, before it is given up


class Observed(NamedTuple):
    """What happened on N drives.

    xi_tilde, W, V : largest norm on each drive (N,) [U s], [U], [-]; not finite: diverged.
    residual : sup|f| of each drive, without noise (N,) [U].
    outside : drives that were left out.
    """

    xi_tilde: Array
    W: Array
    V: Array
    residual: Array
    outside: int

    @property
    def diverged(self) -> int:
        """Drives on which the identifier diverged."""
        return int(np.count_nonzero(~np.isfinite(self.xi_tilde + self.W + self.V)))


class Beginning(NamedTuple):
    """Largest weights that a drive may begin with: |W_hat(0)| [U] and |V_hat(0)| [-]."""

    W: float
    V: float


def monte_carlo(
    design: Design,
    vehicle: Vehicle,
    driving: Driving,
    count: int,
    *,
    beginning: Beginning,
    rng: np.random.Generator,
    progress: Callable[[int], None] = lambda _: None,
) -> Observed:
    """Run the identifier over random drives that keep what was declared.

    Parameters
    ----------
    design : the design.
    vehicle : the car as the identifier is told of it, and as it drives.
    driving : the declared conditions.
    count : number of drives N.
    beginning : largest first weights; every second drive resumes with some W.
    rng : source of roads, steering, noise and initial weights.
    progress : told after each part how many drives are done.

    Raises
    ------
    ValueError
        Where hardly a drive keeps to what was declared.
    """
    size = max(FEWEST, count // 10)
    found: list[tuple[Array, ...]] = []
    done = outside = 0
    while done < count:
        drawn = random_drives(vehicle, rng, size, driving=driving, duration=DURATION, dt=design.dt)
        chosen = np.flatnonzero(within(vehicle, drawn, driving, design.dt))[: count - done]
        last = chosen[-1] + 1 if chosen.size else size
        outside += int(last - chosen.size)
        done += chosen.size
        if outside > TRIES * max(count, size):
            raise ValueError(
                f"of {done + outside} drives only {done} kept to a slip of {driving.slip:.3g} rad "
                f"at {driving.v_x:.3g} m/s and {driving.bandwidth:.3g} Hz: judge harder driving"
            )
        if chosen.size:
            kept = Drives(*(values[chosen] for values in drawn))
            residual = np.linalg.norm(residuals(vehicle, kept, design.dt), axis=2).max(axis=1)
            seen = measured(kept, driving, rng)
            peaks = largest_norms(
                design, vehicle, seen, first_weights(design, chosen.size, beginning, rng)
            )
            found.append((*peaks, residual / design.force_unit))
            progress(done)
    xi_tilde, W, V, residual = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return Observed(xi_tilde, W, V, residual, outside)


def first_weights(
    design: Design, count: int, beginning: Beginning, rng: np.random.Generator
) -> Weights:
    """Return first weights of N drives: W (N, 2, n_h), zero on every second, and V (N, n_h, n_in).

    Parameters
    ----------
    design : the design.
    count : number of drives N.
    beginning : largest weights.
    rng : source of randomness.
    """
    V = np.stack([design.network.initial_weights(rng).V for _ in range(count)])
    W = rng.standard_normal((count, 2, design.network.hidden))
    share = rng.random(count) * (np.arange(count) % 2)
    W *= (share * beginning.W / np.linalg.norm(W, axis=(1, 2)))[:, None, None]
    V *= np.minimum(1.0, beginning.V / np.linalg.norm(V, axis=(1, 2)))[:, None, None]
    return Weights(W=W, V=V)


def largest_norms(
    design: Design, vehicle: Vehicle, drives: Drives, weights: Weights
) -> tuple[Array, Array, Array]:
    """Return the largest norms of ξ̃, W and V on each drive, (N,) each.

    Parameters
    ----------
    design : the design.
    vehicle : the car.
    drives : as measured; the observer begins at the first sample.
    weights : of each drive to begin with.
    """
    count, n = drives.v_x.shape
    K_inv = np.array(ca.DM(bicycle(vehicle.bicycle, 1.0).K_inv)) / design.force_unit
    record = _batch(design.structure)(
        n,
        {
            "xi_hat": drives.x[:, 0] @ K_inv.T,
            "z": np.zeros(2),
            "W": weights.W,
            "V": weights.V,
            "x": drives.x,
            "u": drives.u,
            "v_x": drives.v_x[:, :, None],
            "vehicle": np.array(vehicle.bicycle),
            "A_d": design.gains.matrix,
            "gains": np.array([getattr(design.gains, name) for name in GAINS]),
            "sampling": np.array([design.dt, design.force_unit, design.min_speed]),
            **dict.fromkeys(PEAKS, np.zeros(())),
        },
    )
    xi_tilde, W, V = (record[f"{name}_final"].reshape(count) for name in PEAKS)
    return xi_tilde, W, V


@cache
def _batch(structure: Structure) -> BatchScan:
    step = with_peaks(build_step(structure))
    return BatchScan(
        step, carry=(*CARRY, *PEAKS), over=OVER, lanes_over=("xi_hat", "W", "V", *OVER)
    )


def with_peaks(step: ca.Function) -> ca.Function:
    """Return the step with further carried ports, the largest norms so far of ξ̃, W and V.

    What is not a number is taken over, so that it shows in the end.

    Parameters
    ----------
    step : of `identifier.step`.
    """
    inputs = [ca.SX.sym(step.name_in(i), step.sparsity_in(i)) for i in range(step.n_in())]
    outputs = dict(zip(step.name_out(), step.call(inputs), strict=True))
    peaks = [ca.SX.sym(name) for name in PEAKS]
    norms = [ca.norm_fro(outputs[port]) for port in ("xi_tilde", "W_next", "V_next")]
    following = [
        ca.if_else(norm <= peak, peak, norm) for norm, peak in zip(norms, peaks, strict=True)
    ]
    return ca.Function(
        f"{step.name()}_peaks",
        [*inputs, *peaks],
        [*outputs.values(), *following],
        [*step.name_in(), *PEAKS],
        [*outputs, *(f"{name}_next" for name in PEAKS)],
    )
