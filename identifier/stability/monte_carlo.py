"""The proven bounds of a design against drives: how far does the identifier really go?

Each drive has its own road, steering and initial weights; the identifier runs over all of them at
once, one in each lane, and keeps nothing but the largest norms. Drives beyond what the certificate
was given (slip, residual) are drawn anew, so that a bound that is passed is wrong.
"""

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from codegen import BatchScan
from identifier.design import Design
from identifier.stability.operation import Operation
from identifier.stability.random_drives import Drives, random_drives, residuals, slips
from identifier.step import CARRY, GAINS, OVER, Structure, build_step
from models.vehicle import Vehicle

Array = NDArray[np.float64]
PEAKS = ("peak_xi_tilde", "peak_W", "peak_V")
DURATION = 15.0  # s
FEWEST = 256  # drives that are drawn at a time
TRIES = 20  # drives that are drawn for each that is wanted, before it is given up


class Observed(NamedTuple):
    """What happened on N drives.

    xi_tilde, W, V : largest norm on each drive (N,) [U s], [U], [-]; not finite: diverged.
    residual : sup|f| of each drive (N,) [U].   outside : drives that were left out.
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


def monte_carlo(
    design: Design,
    vehicle: Vehicle,
    operation: Operation,
    count: int,
    *,
    v_x: float,
    slip: float,
    friction: float,
    bandwidth: float,
    rng: np.random.Generator,
    progress: Callable[[int], None] = lambda _: None,
) -> Observed:
    """Run the identifier over random drives that are no harder than its certificate was given.

    Parameters
    ----------
    design : the design.
    vehicle : the car as the identifier is told of it, and as it drives.
    operation : what the certificate knows, among it the largest residual.
    count : number of drives N.
    v_x : speed [m/s].
    slip : largest slip angle [rad].
    friction : largest of the road.
    bandwidth : highest frequency of steering [Hz].
    rng : source of roads, steering and initial weights.
    progress : told after each part how many drives are done.

    Raises
    ------
    ValueError
        Where hardly a drive keeps to what was judged.
    """
    size = max(FEWEST, count // 10)
    found: list[tuple[Array, ...]] = []
    done = outside = 0
    while done < count:
        drawn = random_drives(
            vehicle,
            rng,
            size,
            v_x=v_x,
            friction=friction,
            bandwidth=bandwidth,
            duration=DURATION,
            dt=design.dt,
        )
        residual = np.linalg.norm(residuals(vehicle, drawn, design.dt), axis=2).max(axis=1)
        residual = residual / design.force_unit
        within = residual <= operation.residual_bound
        within &= (np.abs(slips(vehicle, drawn)) <= slip).all(axis=(1, 2))
        chosen = np.flatnonzero(within)[: count - done]
        outside += int(np.count_nonzero(~within[: chosen[-1] + 1 if chosen.size else None]))
        done += chosen.size
        if outside > TRIES * max(count, size):
            raise ValueError(
                f"of {done + outside} drives only {done} kept to a slip of {slip:.3g} rad and "
                f"{operation.residual_bound:.3g} U beyond the linear tire: judge harder driving"
            )
        if chosen.size:
            kept = Drives(*(values[chosen] for values in drawn))
            found.append((*_largest(design, vehicle, kept, rng), residual[chosen]))
            progress(done)
    xi_tilde, W, V, residual = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return Observed(xi_tilde, W, V, residual, outside)


def _largest(
    design: Design, vehicle: Vehicle, drives: Drives, rng: np.random.Generator
) -> tuple[Array, ...]:
    """Return the largest norms of ξ̃, W and V on each drive; every drive begins with its own V."""
    count, n = drives.v_x.shape
    start = [design.network.initial_weights(rng) for _ in range(count)]
    record = _batch(design.structure)(
        n,
        {
            "xi_hat": np.zeros(2),
            "z": np.zeros(2),
            "W": start[0].W,
            "V": np.stack([weights.V for weights in start]),
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
    return tuple(record[f"{name}_final"].reshape(count) for name in PEAKS)


@cache
def _batch(structure: Structure) -> BatchScan:
    step = with_peaks(build_step(structure))
    return BatchScan(step, carry=(*CARRY, *PEAKS), over=OVER, lanes_over=("V", *OVER))


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
