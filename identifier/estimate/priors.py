"""What is believed of a car before a log is read: one table, each number with its reason.

Beliefs are Gaussian and in static axle loads and wheelbases L, so that they serve a sedan and a
car of 1:10; a stiffness that a vehicle file gives does not enter. Chosen on random cars of the
plant and confirmed once on recordings.
"""

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from codegen.arrays import Array
from identifier.estimate.information import PLACE, Information
from identifier.motion.parameters import INDEX, NAMES, SLIPS
from models.vehicle import FULL_SIZE, Vehicle

LEAST_DOUBT = 1e-6  # of a prior, in variances of the usual one
_LESS_LOAD = 0.6  # of the geometric load transfer: tires gain less force than load
_LESS_USE = 0.65  # of the geometric use of the ellipse, measured on cars and the plant
_SURE_HEIGHT = 0.03  # sd of the load transfer of a car that tells its height
_SURE_SHARE = 0.5  # sd of the use of the ellipse of a given share, of that use
_LEAST_USE = 0.1  # least sd of that use
# At one speed a bias of v_y and a mounting angle are one: each takes half, unless speeds
# differ.
_SHARED_ERROR = 0.5
_SHARE = {"v_y_bias": 1.0, "v_y_angle": -1.0}
# sd of ln of a yaw inertia that nobody measured: m l_f l_r is within a tenth of those of cars;
# chosen on 16 random cars whose inertia was left out
_LEFT_OUT = 0.1
_LEFT_OUT_SMALL = 0.3  # the same of a model car
ANOTHER_ROAD = 0.5  # standard deviation of ln of its friction over that of the first
_PLAY = INDEX["steering_play"]
_PLAY_SD = 0.02  # [rad] of a play that a log asks for: servos of 1:10 cars have 1 to 1.5 degrees
_LARGEST_PLAY = 0.1  # [rad]
_TAILS = 1.0  # degrees of freedom of their priors


class _Belief(NamedTuple):
    """A prior: mean, standard deviation and bounds.
    per : what mean, sd and bounds are multiples of: "" for SI, "L" for the wheelbase, "v" for the
    speed sqrt(L/2.7 m).
    """

    mean: float
    sd: float
    low: float
    high: float
    per: str


INF = float("inf")
OF_AXLES: dict[str, _Belief] = {
    # road tires 8-25 loads/rad, 1:10 4-20
    "ln_stiffness": _Belief(np.log(14.0), 0.5, np.log(2.0), np.log(60.0), ""),
    "ln_grip": _Belief(np.log(0.85), 0.25, np.log(0.1), np.log(3.0), ""),  # wet asphalt to slicks
    "shape": _Belief(1.35, 0.15, 1.0, 1.9, ""),  # Magic Formula fits of lateral forces
    "curvature": _Belief(0.0, 0.6, -4.0, 0.95, ""),  # beyond 0.95 the curve has no peak
    **{
        f"residual{j}": _Belief(0.0, 0.08, -INF, INF, "")  # what tires of one formula differ by
        for j in range(len(SLIPS))
    },
    "compliance": _Belief(0.008, 0.008, 0.0, 0.1, "L"),  # relaxation of about a tenth wheelbase
    "sway_share": _Belief(0.2, 0.6, 0.0, 1.0, ""),  # roll center low to high; firmer, steps err
    "braking": _Belief(0.65, 0.3, 0.0, 2.0, ""),  # all four wheels brake
    "driving": _Belief(0.35, 0.4, 0.0, 3.0, ""),  # which axle drives is not known
}
OF_CAR: dict[str, _Belief] = {
    "load_transfer": _Belief(0.18, 0.08, 0.0, 0.5, ""),  # height 0.5 m, less what tires lose
    "ln_sway": _Belief(0.0, 0.25, -INF, INF, ""),  # 1.5 Hz for a sedan, 5 sqrt(g/L)
    "steering_zero": _Belief(0.0, 0.007, -0.2, 0.2, ""),  # a toe or a zero of 0.4 degrees
    "steering_gain": _Belief(0.0, 0.04, -0.6, 1.5, ""),  # a steering ratio that somebody typed
    "v_y_bias": _Belief(0.0, 0.07, -INF, INF, "v"),  # of optical and satellite sensors
    "v_y_angle": _Belief(0.0, 0.007, -INF, INF, ""),  # mounted to 0.4 degrees
    "v_y_lever": _Belief(0.0, 0.015, -INF, INF, "L"),  # place measured to 4 cm
}
# Standard deviations of a 1:10 car. That of the angle was chosen on 9 such random cars whose v_y
# was turned by 1.7 degrees and 15 mm off: all valid, the angle found to 0.15 degrees, with that
# above 8 of 9 and 0.55; as good where it was not.
OF_SMALL = {
    "v_y_angle": 0.03,  # the frame of a tracker is aligned by eye
    "steering_play": _PLAY_SD,
}
ALIKE = {  # standard deviation of front less rear
    "ln_stiffness": (0.35, ""),
    "ln_grip": (0.15, ""),
    "shape": (0.1, ""),
    "curvature": (0.5, ""),
    "compliance": (0.003, "L"),
    "sway_share": (0.1, ""),
}
SENSORS = tuple(name for name in OF_CAR if name.startswith(("v_y", "steering")))
TYPED = ("steering_gain",)


@dataclass(frozen=True, slots=True, kw_only=True)
class Priors:
    """The beliefs for a car, as numbers.
    mean, low, high : of all parameters, (p,).
    information : inverse covariance, (p, p); zero where a parameter does not move.
    moves : which are estimated, (p,).
    typed : which numbers somebody typed.   data : what drives add to it
    """

    mean: Array
    low: Array
    high: Array
    information: Array
    moves: NDArray[np.bool_]
    typed: tuple[int, ...] = ()
    data: Information | None = None

    def without(self, names: Collection[str]) -> "Priors":
        """Return the beliefs with some parameters held at zero."""
        mean, information, moves = self.mean.copy(), self.information.copy(), self.moves.copy()
        index = [INDEX[name] for name in names]
        mean[index], moves[index] = 0.0, False
        information[index], information[:, index] = 0.0, 0.0
        return replace(self, mean=mean, information=information, moves=moves)

    def with_play(self) -> "Priors":
        """Return the beliefs with a play of the steering, which else is held at zero."""
        information, moves = self.information.copy(), self.moves.copy()
        information[_PLAY, _PLAY], moves[_PLAY] = _PLAY_SD**-2.0, True
        return replace(self, information=information, moves=moves)

    @classmethod
    def of(
        cls,
        vehicle: Vehicle,
        *,
        wide: Mapping[str, float] = {},
        apart: bool = False,
    ) -> "Priors":
        """Return the beliefs for a car.
        wide : standard deviations in SI in place of those of the table, by parameter.
        apart : whether bias and angle of v_y are believed apart, without `_SHARED_ERROR`.
        """
        L = vehicle.wheelbase
        unit = {"": 1.0, "L": L, "v": vehicle.scale}
        p = len(NAMES)
        mean, sd, low, high = np.zeros(p), np.zeros(p), np.full(p, -INF), np.full(p, INF)
        table = {f"{name}_{axle}": one for name, one in OF_AXLES.items() for axle in "fr"} | OF_CAR
        for name, belief in table.items():
            k, size = INDEX[name], unit[belief.per]
            mean[k], sd[k] = size * belief.mean, size * belief.sd
            low[k], high[k] = size * belief.low, size * belief.high
        for name, (value, doubt) in _declared(vehicle).items():
            k = INDEX[name]
            mean[k], sd[k] = min(max(value, low[k]), high[k]), doubt
        small = vehicle.wheelbase < FULL_SIZE
        if vehicle.inertia_is_estimate:
            sd[INDEX["ln_inertia"]] = _LEFT_OUT_SMALL if small else _LEFT_OUT
        low[_PLAY], high[_PLAY] = 0.0, _LARGEST_PLAY
        for name, value in OF_SMALL.items():
            if small:
                sd[INDEX[name]] = value
        each = {name: way / sd[INDEX[name]] for name, way in _SHARE.items()}
        for name, value in wide.items():
            sd[INDEX[name]] = value
        information = np.zeros((p, p))
        moves = sd > 0.0
        information[moves, moves] = 1.0 / sd[moves] ** 2
        for name, (spread, per) in ALIKE.items():
            _couple(information, {f"{name}_f": 1.0, f"{name}_r": -1.0}, spread * unit[per])
        if not apart and moves[INDEX["v_y_bias"]] and moves[INDEX["v_y_angle"]]:
            _couple(information, each, _SHARED_ERROR)
        typed = tuple(INDEX[name] for name in TYPED if moves[INDEX[name]])
        return cls(mean=mean, low=low, high=high, information=information, moves=moves, typed=typed)

    @property
    def covariance(self) -> Array:
        """Covariance of the parameters, zero of what does not move (p, p)."""
        found, where = np.zeros_like(self.information), np.ix_(self.moves, self.moves)
        found[where] = np.linalg.inv(self.information[where])
        return found

    @property
    def sd(self) -> Array:
        """Standard deviations of the parameters, each apart; 0 where it does not move, (p,)."""
        diagonal = np.diag(self.information)
        return np.sqrt(np.divide(1.0, diagonal, out=np.zeros_like(diagonal), where=self.moves))

    def with_roads(self, count: int) -> "Priors":
        """Return the beliefs with ln of the friction of other roads behind, (p + count,)."""
        low, high = np.full(count, np.log(0.2)), np.full(count, np.log(2.2))
        n = len(self.mean) + count
        information = np.zeros((n, n))
        information[: len(self.mean), : len(self.mean)] = self.information
        extra = np.arange(len(self.mean), n)
        information[extra, extra] = 1.0 / ANOTHER_ROAD**2
        return replace(
            self,
            mean=np.concatenate([self.mean, np.zeros(count)]),
            low=np.concatenate([self.low, low]),
            high=np.concatenate([self.high, high]),
            information=information,
            moves=np.concatenate([self.moves, np.ones(count, dtype=bool)]),
        )

    def cost(self, p: Array) -> float:
        """Return -ln of the prior's density over that at its mean [nats].

        A number that somebody typed may be off by much more than its doubt: its prior is Student's.
        """
        away = p - self.mean
        cost = 0.5 * float(away @ self.information @ away)
        for k in self.typed:
            z2 = float(self.information[k, k] * away[k] ** 2)
            cost += 0.5 * ((_TAILS + 1.0) * math.log1p(z2 / (_TAILS + 1.0)) - z2)
        return cost if self.data is None else cost + self.data.around(p[: len(NAMES)])[0]

    def around(self, p: Array) -> tuple[Array, Array]:
        """Return gradient (p,) and positive curvature (p, p) of the cost at parameters `p` (p,)."""
        away, curvature = p - self.mean, self.information.copy()
        for k in self.typed:
            z2 = self.information[k, k] * away[k] ** 2
            curvature[k, k] *= (_TAILS + 1.0) / (_TAILS + 1.0 + z2)
        gradient = curvature @ away
        if self.data is not None:
            n = len(NAMES)  # of other roads no drive before tells
            _, slope, bend = self.data.around(p[:n])
            gradient[:n] += slope
            curvature[:n, :n] += bend
        return gradient, curvature

    def known(self, p: Array, covariance: Array) -> "Priors":
        """Return what a fit leaves to believe of the car: its numbers, as sure as they are.
        p, covariance : parameters and their covariance (p,), (p, p).
        """
        where = np.ix_(self.moves, self.moves)
        information = np.zeros_like(self.information)
        sure = covariance + LEAST_DOUBT * np.diag(self.sd**2)
        information[where] = np.linalg.inv(sure[where])
        return replace(self, mean=p, information=information, typed=())

    def after(self, data: Information) -> "Priors":
        """Return the beliefs with what drives add, of a play where one of them had it."""
        k = PLACE["steering_play"]
        loose = data.matrix[k, k] > 0.0 and not self.moves[_PLAY]
        return replace(self.with_play() if loose else self, data=data)


def _declared(vehicle: Vehicle) -> dict[str, tuple[float, float]]:
    """Return mean and standard deviation of what follows from numbers that a car tells, by name.

    An axle of share s that pushes f weights uses s W f/μ of its grip, W weights per static load.
    """
    L, grip = vehicle.wheelbase, np.exp(OF_AXLES["ln_grip"].mean)
    declared: dict[str, tuple[float, float]] = {}
    if (height := vehicle.lengthwise("cg_height")) is not None:
        declared["load_transfer"] = _LESS_LOAD * height / L, _SURE_HEIGHT
    for name, share in (("driving", "drive_front_share"), ("braking", "brake_front_share")):
        if (front := vehicle.lengthwise(share)) is not None:
            for axle, part, W in (
                ("f", front, L / vehicle.l_r),
                ("r", 1.0 - front, L / vehicle.l_f),
            ):
                use = float(_LESS_USE * part * W / grip)
                declared[f"{name}_{axle}"] = use, max(_SURE_SHARE * use, _LEAST_USE)
    return declared


def _couple(information: Array, of: Mapping[str, float], sd: float) -> None:
    """Add that a sum of parameters is zero within a standard deviation."""
    v = np.zeros(len(information))
    for name, factor in of.items():
        v[INDEX[name]] = factor
    information += np.outer(v, v) / sd**2
