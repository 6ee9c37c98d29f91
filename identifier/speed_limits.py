"""How hard a car can turn, brake and drive at every speed, from identified tires and their doubt.

Steady turning loads both axles in proportion, so that the weaker one limits the car (Milliken,
Race Car Vehicle Dynamics, 1995, ch. 9). While tires push f weights forward,
A(f)/g = min_i φ_i λ_i sqrt(1 - (c_i f)²), λ_i = 1 + κ_i v_x² ∓ (h L/l_o) f, l_o the other arm,
φ_i the largest force of the axle over its slip, c_i of braking or driving. No push is larger than
1/c_i, and f² + (A/g)² <= (A(0)/g)²: tires grip lengthwise as sideways. An axle that drives the
share d_i of f, where the car tells it, has c_i >= d_i W/(φ_i λ_i F_z,i), W its weight.
φ_i is the lower end of the band within some times the slip that was identified, h and c_i are the
ends of theirs that leave less: each is right or too low in the stated share of cases.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from codegen.arrays import Array
from identifier.band import Band, normal_quantile
from identifier.estimate.priors import Priors
from identifier.estimate.solve import car_numbers
from identifier.motion.model import pushed_function
from identifier.motion.parameters import INDEX
from identifier.tire_model import AXLES, TireModel, brisk_speed, require_band
from models.rules import require_positive
from models.vehicle import GRAVITY, Vehicle

_SPEEDS = 13  # from standing to the fastest that was driven
_PUSHES = 200  # longitudinal forces of one side
_SLIPS = 200  # of a curve
SHARES = np.linspace(0.0, 1.0, 41)  # of a_y, at which it is kept what is left lengthwise

ELLIPSE = ("braking_f", "braking_r", "driving_f", "driving_r")


class Sides(NamedTuple):
    """What turning leaves of one longitudinal side: largest force of the tires over the mass.

    most : at the lateral accelerations `SHARES` a_y, (n, k) [m/s²], falling along k.
    axle : which one limits there, 0 front, 1 rear, (n, k).
    """

    most: Array
    axle: NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SpeedLimits:
    """What the tires of a car allow over its speed; between the speeds it is linear, beyond even.

    Parameters
    ----------
    v : speeds [m/s], rising from 0, (n,).
    a_y : largest lateral acceleration of steady turning [m/s²], (n,).
    push, brake : what turning leaves of driving and braking.
    drag : deceleration by the air over v² [1/m].
    known_slip : up to which the tires are known [rad], (2,); None where no tires were identified.
    """

    v: Array
    a_y: Array
    push: Sides
    brake: Sides
    drag: float = 0.0
    known_slip: Array | None = None

    @classmethod
    def ellipse(cls, a_y: float, push: float | None = None, brake: float | None = None) -> Self:
        """Return friction ellipses of given half axes [m/s²], at every speed; None takes a_y."""
        push, brake = a_y if push is None else push, a_y if brake is None else brake
        require_positive(ValueError, a_y=a_y, push=push, brake=brake)
        left, axle = np.sqrt(1.0 - SHARES**2)[None], np.zeros((1, SHARES.size), dtype=np.int64)
        return cls(
            v=np.zeros(1),
            a_y=np.array([a_y]),
            push=Sides(push * left, axle),
            brake=Sides(brake * left, axle),
        )

    def scaled(self, ratio: float) -> Self:
        """Return the limits on a road of another friction, or a share of these.

        ratio : of the friction there over that here [-], positive.
        """
        require_positive(ValueError, ratio=ratio)
        push, brake = (side._replace(most=ratio * side.most) for side in (self.push, self.brake))
        return replace(self, a_y=ratio * self.a_y, push=push, brake=brake)

    def at_most(self, a_y: float) -> Self:
        """Return the limits scaled so that a_y from standing does not exceed a bound [m/s²]."""
        return self.scaled(min(1.0, a_y / float(self.a_y[0])))

    def __repr__(self) -> str:
        push, brake = self.push.most[0, 0], self.brake.most[0, 0]
        return (
            f"<SpeedLimits a_y {self.a_y[0]:.2f} m/s², braking {brake:.2f}, driving {push:.2f} m/s²"
            f" from standing; given to {self.v[-1]:.1f} m/s>"
        )


def speed_limits(tire: TireModel, *, confidence: float = 0.95, beyond: float = 2.0) -> SpeedLimits:
    """Return what identified tires allow their car from standing to the fastest driven speed.

    Load transfer and ellipse of a model that has none are what is believed of its car.

    Parameters
    ----------
    tire : the identified tires.
    confidence : in which share of cases each number is right or too low, above 0.5, below 1 [-].
    beyond : up to how many times the known slip a curve is read, 1 or more [-].

    Raises
    ------
    ValueError
        Where the model cannot tell how sure it is, is sure at no slip of an axle, or a number is
        none of those.
    """
    if not 0.5 < confidence < 1.0:
        raise ValueError(f"confidence must be above 0.5 and below 1, it is {confidence:g}")
    if not 1.0 <= beyond < np.inf:
        raise ValueError(f"beyond must be 1 or more known slips, it is {beyond:g}")
    band, car, known, drives = require_band(tire), tire.vehicle, tire.known_slip, tire.drives
    assert known is not None
    level = 2.0 * confidence - 1.0
    grip = np.array([_lowest_grip(band, i, beyond * float(known[i]), level) for i in range(2)])
    priors, index = Priors.of(car), [INDEX[name] for name in ("load_transfer", *ELLIPSE)]
    mean, covariance = drives.lengthwise or (priors.mean, priors.covariance)
    sd = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    p = mean.copy()
    p[index] = (mean + normal_quantile(level) * sd)[index]
    top = brisk_speed(car, tire.min_speed) if drives.speeds is None else float(drives.speeds[1])
    v = np.linspace(0.0, top, _SPEEDS)
    a_y = (grip * car.load_ratio(v)).min(axis=1)
    at = list(zip(v, a_y, strict=True))
    push, brake = (_side(car, p, grip, at, sign) for sign in (1.0, -1.0))
    return SpeedLimits(
        v=v, a_y=GRAVITY * a_y, push=push, brake=brake, drag=car.drag, known_slip=known.copy()
    )


def _lowest_grip(band: Band, i: int, reach: float, level: float) -> float:
    """Return the largest force of the lower end of an axle's band, in static loads.

    reach : largest slip that is read [rad].
    """
    alpha = np.linspace(0.0, reach, _SLIPS + 1)[1:]
    model = band.model
    low = float((model.force(alpha) - band.half(alpha, level))[:, i].max())
    if reach <= 0.0 or low <= 0.0:
        raise ValueError(f"the force of the {AXLES[i]} axle is not known at any slip: drive harder")
    return low / float(model.vehicle.axle_loads[i])


def _side(
    car: Vehicle, p: Array, grip: Array, speeds: Sequence[tuple[float, float]], sign: float
) -> Sides:
    """Return what turning leaves of one side.

    p : numbers of the forward model.   grip : φ_i (2,).
    speeds : v_x [m/s], and a_y without a push [weights].
    sign : 1 where the tires drive, -1 where they brake.
    """
    found = [_left(car, p, grip, v_x, a_y, sign) for v_x, a_y in speeds]
    return Sides(np.array([most for most, _ in found]), np.array([axle for _, axle in found]))


def _left(
    car: Vehicle, p: Array, grip: Array, v_x: float, a_y: float, sign: float
) -> tuple[Array, NDArray[np.int64]]:
    use = p[[INDEX[f"{'driving' if sign > 0.0 else 'braking'}_{axle}"] for axle in "fr"]]
    front = car.lengthwise("drive_front_share") if sign > 0.0 else None
    carried = np.zeros(2) if front is None else np.array([front, 1.0 - front]) * car.weight
    top = min(a_y, 1.0 / max(float(use.max()), 1e-9))
    plain = p.copy()
    plain[[INDEX[name] for name in ELLIPSE]] = 0.0
    f = np.linspace(0.0, top, _PUSHES + 1)
    a_x = sign * GRAVITY * f[:2] - car.drag * v_x**2
    first, second = np.array(pushed_function()(plain, car_numbers(car), a_x[None], v_x)).T
    loads = first + (second - first) * np.arange(f.size)[:, None]
    most = grip * np.maximum(loads, 1e-9)
    used = f[:, None] * np.maximum(use, carried / car.axle_loads / most)
    pushed = most * np.sqrt(np.maximum(1.0 - used**2, 0.0))
    left = np.minimum(pushed.min(axis=1), np.sqrt(np.maximum(a_y**2 - f**2, 0.0)))
    left[0] = a_y
    left = np.minimum.accumulate(left) - 1e-12 * np.arange(f.size)  # falls: read it backwards
    at = np.interp(SHARES * a_y, left[::-1], f[::-1])
    return GRAVITY * at, pushed.argmin(axis=1)[np.searchsorted(f, at)]
