"""A drive as the latent estimate reads it: nodes of 25 to 50 Hz, means of the samples around.

Nothing is smoothed beyond that but what enters as a small correction: roll, sway and the rate of
a_y.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codegen.arrays import Array
from identifier.axle.slip import Sway
from identifier.estimate.drive import (
    ALONG,
    LONGITUDINAL,
    MOST_A_X,
    SLOW,
    SMOOTHED,
    box,
    gradient,
    slope_on,
)
from identifier.motion.model import DAMPING
from models.recordings import Recording, RecordingError
from models.recordings.record import ALL
from models.vehicle import Vehicle

_BETWEEN = 0.06  # sqrt(L/g) from a node to the next
_LEAST_BETWEEN = 0.02  # [s] that it is at least
_ROLLS = 5.0  # Hz of a sedan, below which a_y rolls the body
JERKS = 3.0  # Hz of a sedan, below which a_y is differentiated
_FEWEST_NODES = 3  # nodes of a segment


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Nodes:
    """Signals at n nodes.
    t : time in the recording's own clock [s], (n,).
    dt : from a node to the next [s].   given : columns as `motion.nodes.GIVEN`, (n, 8).
    measured : r [rad/s] and a_y [m/s²], (n, 2).   counts : where the car drives fast enough, (n,).
    goes : whether the motion goes on to the next node, (n,).
    """

    t: Array
    dt: float
    given: Array
    measured: Array
    counts: NDArray[np.bool_]
    goes: NDArray[np.bool_]

    @classmethod
    def of(
        cls,
        recording: Recording,
        vehicle: Vehicle,
        part: slice = ALL,
        a_y_late: float = 0.0,
        ln_sway: float = 0.0,
    ) -> "Nodes":
        """Return the nodes of a recording.
        a_y_late : by which a_y is late [s].   ln_sway : as of `motion.parameters`.

        Raises
        ------
        RecordingError
            Where there is no a_y, or too few samples.
        """
        between = max(_BETWEEN * vehicle.froude_time, _LEAST_BETWEEN)
        every = max(1, round(between / recording.dt))
        begin, end, _ = part.indices(len(recording))
        a_y = recording.needed("a_y")
        pieces = []
        for one in recording.segments:
            first, last = max(one.start, begin), min(one.stop, end)
            count = (last - first) // every
            if count >= _FEWEST_NODES:
                some = slice(first, first + count * every)
                felt = earlier(a_y[first:last], a_y_late / recording.dt)[: count * every]
                pieces.append(_piece(recording, some, vehicle, every, felt, ln_sway))
        if not pieces:
            raise RecordingError(f"{recording.name}: too short to learn from without v_y")
        t, given, measured, counts, goes = (
            np.concatenate(parts) for parts in zip(*pieces, strict=True)
        )
        return cls(
            t=t, dt=recording.dt * every, given=given, measured=measured, counts=counts, goes=goes
        )

    @property
    def begins(self) -> NDArray[np.bool_]:
        """At which nodes nothing is known of the one before, (n,)."""
        return self.counts & ~np.append(False, self.goes[:-1])


def earlier(signal: Array, samples: float) -> Array:
    if samples == 0.0:
        return signal
    at = np.arange(len(signal))
    return np.interp(at + samples, at, signal)


def _piece(
    recording: Recording, some: slice, vehicle: Vehicle, every: int, a_y: Array, ln_sway: float
) -> tuple[Array, Array, Array, NDArray[np.bool_], NDArray[np.bool_]]:
    """Return t, given, measured, counts and goes of a segment."""
    dt, scale = recording.dt, vehicle.scale
    slowest = SLOW * vehicle.froude_speed

    def mean(signal: Array) -> Array:
        return signal.reshape(-1, every).mean(axis=1)

    v_x, r = recording.v_x[some], recording.r[some]
    on, n3 = v_x > slowest, LONGITUDINAL / dt
    a_x = box(gradient(box(np.maximum(v_x, slowest), n3 / 2), dt), n3)
    turning = 1.0  # a_x = v_x' - v_y r
    if recording.a_x is not None:
        felt = box(recording.a_x[some], round(SMOOTHED * scale / dt) | 1)
        motion = gradient(box(v_x, n3 / 3), dt) - vehicle.l_r * r**2
        if slope_on(motion, felt, on, dt, ALONG) is not None:
            a_x, turning = felt, 0.0
    a_x = np.where(on, np.clip(a_x, -MOST_A_X, MOST_A_X), 0.0)
    omega = Sway.for_vehicle(vehicle).frequency * float(np.exp(ln_sway))
    rho, rate = _rolled(low_passed(a_y, _ROLLS / scale, dt), omega, dt)
    jerk = gradient(low_passed(a_y, JERKS / scale, dt), dt)
    speed = mean(v_x)
    signals = (recording.delta_f[some], recording.delta_r[some], a_x)
    given = np.column_stack(
        [
            np.maximum(speed, slowest),
            *(mean(one) for one in signals),
            np.full(speed.size, turning),
            *(mean(one) for one in (rho, rate, jerk)),
        ]
    )
    counts = np.asarray(on.reshape(-1, every).all(axis=1))
    goes = np.append(counts[:-1] & counts[1:], False)
    return mean(recording.t[some]), given, np.column_stack([mean(r), mean(a_y)]), counts, goes


def low_passed(signal: Array, hertz: float, dt: float) -> Array:
    """Return a signal through a zero-phase low pass, (n,), its gain 1/(1 + (ω/ω_c)⁴) as that of
    Butterworth's of second order there and back: the y of least Σ (y - x)² + λ (Δ² y)².
    """
    n = len(signal)
    if 2.0 * dt * hertz >= 0.9 or n < 20:  # of the highest frequency that samples show
        return np.array(signal, dtype=np.float64)
    from scipy.linalg import solveh_banded  # takes long to import

    band = np.outer([6.0, -4.0, 1.0], np.ones(n))  # of (Δ²)ᵀ Δ²
    band[0, [0, 1, -2, -1]], band[1, [0, -2]] = [1.0, 5.0, 5.0, 1.0], -2.0
    band *= (2.0 * np.sin(np.pi * hertz * dt)) ** -4
    band[0] += 1.0
    return solveh_banded(band, signal, lower=True, check_finite=False)


def _rolled(a: Array, omega: float, dt: float) -> tuple[Array, Array]:
    """Return ρ and ρ' of a body that sways under lateral accelerations, (n,), implicit in ρ'."""
    from scipy.linalg.blas import dtbsv  # takes long to import

    stiff = dt * omega**2
    eased = 1.0 + 2.0 * DAMPING * omega * dt + dt * stiff
    before = dt * stiff - eased - 1.0
    pushed = dt * stiff * a
    pushed[:2] -= a[0] * np.array([before + 1.0, 1.0])[: len(a)]
    band = np.outer([eased, before, 1.0], np.ones(len(a)))
    rho = dtbsv(2, np.asfortranarray(band), pushed, lower=1)
    return rho, np.diff(rho, prepend=a[0]) / dt
