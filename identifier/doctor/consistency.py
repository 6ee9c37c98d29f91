"""How well a log reads as the motion of one car: what two tire curves leave unexplained.

φ = F/F_z [static axle loads], α [rad] its slip angle, rows front and rear. φ follows from v_x, v_y
and r without any tire, and α from these, the steering and the lengths of the car: so whatever the
tires are, φ must be a curve of α that rises and saturates, c α / sqrt(1 + (c α/μ)^2) + const. A
reading of the log (its units, its signs, the size of the car) is as good as little is left of φ;
with an accelerometer also of a_y = dv_y/dt + v_x r. Means over windows are compared, so that
nothing is differentiated, and shares of each equation's own variance, so that no unit favors
itself.
"""

import math
from typing import NamedTuple

import numpy as np

from codegen.arrays import Array
from identifier.doctor.chosen import CHOSEN
from identifier.doctor.pieces import driven_windows, looked_at, usual_speed
from models.recordings import Recording
from models.sensors import white_noise
from models.vehicle import GRAVITY, Vehicle

STIFFNESS = CHOSEN.fineness ** np.arange(CHOSEN.stiffnesses)  # c [1/rad], 1 to 100
FRICTION = 0.3 * CHOSEN.fineness ** np.arange(CHOSEN.frictions)[:, None]  # μ [-], 0.3 to 3.3
# c/μ [1/rad], and which of them is that of μ and c.
RATIOS = CHOSEN.fineness ** np.arange(1 - CHOSEN.frictions, CHOSEN.stiffnesses)[:, None] / 0.3
_RATIO_OF = (
    np.arange(CHOSEN.stiffnesses) - np.arange(CHOSEN.frictions)[:, None] + CHOSEN.frictions - 1
)


class Reading(NamedTuple):
    """What logged values must be multiplied by to be SI and ISO, and the size of the car.

    sideslip: v_y is the sideslip angle, its factor makes it rad.   size: lengths of the car over
    the declared ones, and so the root of its yaw inertia over its mass.   inertia: yaw inertia over
    what it then is.   arm: how far ahead of the center of gravity v_y is measured [m].
    """

    v_x: float = 1.0
    v_y: float = 1.0
    r: float = 1.0
    delta: float = 1.0
    a_y: float = 1.0
    sideslip: bool = False
    size: float = 1.0
    inertia: float = 1.0
    arm: float = 0.0


class Motion(NamedTuple):
    """Means of a log as it is written over the windows in which the car drives, each (m,).

    v_y, delta_f, delta_r, v_x_r = v_x r, turn = r/v_x, sideslip = v_y/v_x; rates of change v_y_dot,
    r_dot, and that of v_x v_y; a_y or None; speed: 95th percentile of |v_x|, one number; hidden:
    channels whose swings do not stand out of their noise.
    """

    v_y: Array
    delta_f: Array
    delta_r: Array
    v_x_r: Array
    turn: Array
    sideslip: Array
    v_y_dot: Array
    r_dot: Array
    v_x_v_y_dot: Array
    a_y: Array | None
    speed: float
    hidden: frozenset[str] = frozenset()

    @classmethod
    def of(cls, recording: Recording) -> "Motion | None":
        """Return that of a recording, None where too little of it is driven."""
        pieces = looked_at(recording)
        speed = usual_speed(pieces)
        if speed == 0.0:
            return None
        rows = np.concatenate([_rows(one, CHOSEN.slowest * speed) for one in pieces], axis=1)
        m = rows.shape[1]
        if m < CHOSEN.fewest_windows:
            return None
        *means, a_y = (
            rows
            if m <= CHOSEN.most_windows
            else rows[:, np.linspace(0, m - 1, CHOSEN.most_windows).astype(int)]
        )
        felt = None if recording.a_y is None else a_y
        return cls._make((*means, felt, speed, _hidden(pieces, CHOSEN.slowest * speed)))


def _rows(recording: Recording, fast: float) -> Array:
    """Return means and rates in the order of `Motion`, and means of a_y, a column each window."""
    v_x, v_y, r, a_y = recording.v_x, recording.needed("v_y"), recording.r, recording.a_y
    windows = driven_windows(recording, fast)
    over = np.where(np.abs(v_x) < fast, fast, v_x)
    signals = np.column_stack([v_y, recording.u, v_x * r, r / over, v_y / over])
    rates = windows.rate(np.column_stack([v_y, r, v_x * v_y]))
    felt = windows.mean(np.zeros_like(r) if a_y is None else a_y)
    return np.vstack([windows.mean(signals).T, rates.T, felt])


def _hidden(pieces: tuple[Recording, ...], fast: float) -> frozenset[str]:
    """Return the channels whose means over driven windows swing little more than their noise."""
    found = set()
    for name in ("v_y", "r", "delta_f", "a_y"):
        if getattr(pieces[0], name) is None:
            continue
        means = [driven_windows(one, fast).mean(getattr(one, name)) for one in pieces]
        noise = float(np.median([white_noise(getattr(one, name)) for one in pieces]))
        if float(np.std(np.concatenate(means))) < CHOSEN.clear * noise:
            found.add(name)
    return frozenset(found)


class _AxleMotion(NamedTuple):
    """φ and α, rows front and rear (2, m); dv_y/dt + v_x r [m/s^2] (m,)."""

    force: Array
    slip: Array
    acceleration: Array


def unexplained(motion: Motion, vehicle: Vehicle, reading: Reading) -> float:
    """Return what a reading leaves unexplained: the sum of the logarithms of each equation's
    share.
    """
    one = forces_and_slips(motion, vehicle, reading)
    return front_leaves(one, vehicle) + but_front_leaves(one, motion, vehicle, reading)


def front_leaves(one: _AxleMotion, vehicle: Vehicle) -> float:
    """Return what is left of the front axle, the only equation that the steering is in."""
    declared = vehicle.cornering_stiffness_front / vehicle.axle_loads[0]
    return _curve_leaves(one.force[0], one.slip[0], declared)


def but_front_leaves(one: _AxleMotion, motion: Motion, vehicle: Vehicle, reading: Reading) -> float:
    """Return what is left of all other equations."""
    froude = abs(reading.v_x) * motion.speed / (math.sqrt(reading.size) * vehicle.froude_speed)
    declared = vehicle.cornering_stiffness_rear / vehicle.axle_loads[1]
    total = max(math.log(froude / CHOSEN.fast), 0.0) ** 2
    total += _curve_leaves(one.force[1], one.slip[1], declared)
    if motion.a_y is not None:
        total += _accelerometer_leaves(reading.a_y * motion.a_y, one.acceleration)
    return total


def forces_and_slips(motion: Motion, vehicle: Vehicle, reading: Reading) -> _AxleMotion:
    """Return forces over loads and slip angles of the axles as a reading has them."""
    k_x, k_y, k_r = reading.v_x, reading.v_y, reading.r
    l_f, l_r = reading.size * vehicle.l_f, reading.size * vehicle.l_r
    inertia = reading.inertia * reading.size**2 * vehicle.yaw_inertia / vehicle.mass  # [m^2]
    if reading.sideslip:
        v_y_dot, sideslip = k_y * k_x * motion.v_x_v_y_dot, k_y * motion.v_y
    else:
        v_y_dot, sideslip = k_y * motion.v_y_dot, k_y / k_x * motion.sideslip
    turn = k_r / k_x * motion.turn
    v_y_dot, sideslip = v_y_dot - reading.arm * k_r * motion.r_dot, sideslip - reading.arm * turn
    acceleration = v_y_dot + k_x * k_r * motion.v_x_r
    yaw = inertia * k_r * motion.r_dot
    force = np.stack([acceleration + yaw / l_r, acceleration - yaw / l_f]) / GRAVITY
    front = reading.delta * motion.delta_f - sideslip - l_f * turn
    rear = motion.delta_r - sideslip + l_r * turn
    return _AxleMotion(force, np.stack([front, rear]), acceleration)


def _curve_leaves(force: Array, slip: Array, declared: float) -> float:
    disbelief = CHOSEN.disbelief * np.log(STIFFNESS / declared) ** 2
    force = force - force.mean()
    size = float(force @ force) + 1e-12
    bent = RATIOS * slip
    bent /= np.sqrt(1.0 + bent * bent)
    bent -= bent.mean(axis=1, keepdims=True)
    along, power = bent @ force, np.einsum("ij,ij->i", bent, bent)
    left = size - 2.0 * FRICTION * along[_RATIO_OF] + FRICTION**2 * power[_RATIO_OF]
    return float(np.min(np.log(np.clip(left / size, 0.0, 1.0) + CHOSEN.exact) + disbelief))


def _accelerometer_leaves(a_y: Array, acceleration: Array) -> float:
    """Return the logarithm of the share of a_y that the motion does not explain."""
    measured, moved = a_y - a_y.mean(), acceleration - acceleration.mean()
    slope = float(np.clip(measured @ moved / (moved @ moved + 1e-12), *CHOSEN.rolling))
    left = float(np.sum((measured - slope * moved) ** 2)) / (float(measured @ measured) + 1e-12)
    return math.log(min(left, 1.0) + CHOSEN.exact)
