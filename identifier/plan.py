"""Which maneuver to drive: those of `models.maneuvers`, ranked by what they tell of this car.

A maneuver is steered as hard as a share of the grip of the likely tires allows. The car moves by
`motion.nodes` with nothing missed, so that each step solves

moves(z_k, z_k+1) = 0,   z = [v_y, r, x_f, x_r]

for z_k+1, without roll and bank. The log is read as by `estimate`; its covariance P at the true
parameters is what one drive leaves where the model misses `ERROR` for `LASTS`. The rank is the
error of the forces to be expected on another drive, random steering up to the same share of the
grip: sqrt(mean(J P J'))/rms(F), J the slopes of these forces over tires and body (I-optimal; V. V.
Fedorov, Theory of Optimal Experiments, 1972).
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import casadi as ca
import numpy as np

from codegen.arrays import Array, root_mean_square
from codegen.errors import TireidError
from identifier.estimate.drive import SLOW, Drive
from identifier.estimate.model import FittedModel
from identifier.estimate.posterior import Reach
from identifier.estimate.priors import SENSORS, Priors
from identifier.estimate.report import WIDEST
from identifier.estimate.solve import Problem, around_beliefs, car_numbers, normal
from identifier.motion.model import curve_function
from identifier.motion.nodes import GIVEN, node_scan
from identifier.motion.parameters import INDEX, NAMES, curve_index
from identifier.tire_model import TireModel
from models import maneuvers
from models.maneuvers import Maneuver
from models.recordings import Recording
from models.rules import require_within
from models.vehicle import Vehicle

SPEEDS = (2.5, 4.0)  # sqrt(g L), 13 and 21 m/s of a sedan
TIME = 12.0  # [s]
SHARE = 0.9  # of the grip of the likely tires
FREQUENCY = 0.27  # sqrt(g/L) of a slalom, 0.5 Hz for a sedan
STRAIGHT = 1.0  # [s] before the steering begins
DT = 0.01  # [s] of the simulation and of the log
UNDERSTEER = {"ln_stiffness": 1.2, "ln_grip": 1.05}  # rear over front per load, of cars sold
MOST_ANGLE = math.radians(30.0)  # of the front wheels
HALVINGS = 9  # of the search for the amplitude
ERROR = 0.5  # S of the estimate: what a model misses, over what a good one does
LASTS = 0.5  # T of the estimate [s], for which that is alike


class PlanError(TireidError, ValueError):
    """No maneuver is possible as asked; the message says what would be."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Planned:
    """A maneuver, and what one drive of it is expected to tell.
    speed : that is held [m/s].   log : of exact sensors.   X, Y : center of gravity [m], (n,).
    length, width : of the least rectangle around the way, with a wheelbase on each side [m].
    error : of the forces on another drive, over their rms, by which it is ranked [-].
    tire : the likely tires, as sure as they are after the drive.
    """

    name: str
    maneuver: Maneuver
    speed: float
    log: Recording
    X: Array
    Y: Array
    length: float
    width: float
    error: float
    tire: FittedModel


def plan(
    vehicle: Vehicle,
    *,
    speeds: Sequence[float] | None = None,
    time: float = TIME,
    start: TireModel | None = None,
    friction: float | None = None,
    share: float = SHARE,
    seed: int = 0,
) -> tuple[Planned, ...]:
    """Return maneuvers, best first.

    Parameters
    ----------
    vehicle : the car; its stiffnesses are not looked at.
    speeds : that are held [m/s]; None takes 2.5 and 4 sqrt(g L).
    time : length of all maneuvers but the double lane change [s].
    start : a fit whose doubts are to be narrowed; None begins with the priors.
    friction : of the road, a guess [-]; None takes that of the priors, or of `start`.
    share : of the grip that the likely tires use at most [-].
    seed : of random steering.

    Raises
    ------
    PlanError
        Where a number is not that of a maneuver, or `start` is no fit.

    Examples
    --------
    >>> import tireid as ti
    >>> best, *others = ti.plan(ti.sedan(), speeds=[12.0], time=4.0)
    >>> best.error < min(one.error for one in others)
    True
    """
    require_within(PlanError, 3.0, 120.0, time=time)
    require_within(PlanError, 0.2, 0.97, share=share)
    speeds = [k * vehicle.froude_speed for k in SPEEDS] if speeds is None else speeds
    for speed in speeds:
        require_within(PlanError, SLOW * vehicle.froude_speed, 100.0, speed=speed)
    if start is not None and not isinstance(start, FittedModel):
        raise PlanError(f"a plan goes on from a fit, this model is of kind {start.kind!r}")
    priors = Priors.of(vehicle)
    if start is not None:
        priors = priors.known(start.p, start.covariance)
    p = priors.mean.copy()
    if friction is not None:
        require_within(PlanError, 0.1, 3.0, friction=friction)
        p[[INDEX["ln_grip_f"], INDEX["ln_grip_r"]]] = math.log(friction)
    if start is None:
        for name, ratio in UNDERSTEER.items():
            p[INDEX[f"{name}_r"]] += math.log(ratio)
    p[[INDEX["sway_share_f"], INDEX["sway_share_r"]]] = 0.0  # the body does not roll here
    likely, middle = _Likely(vehicle, priors, p, share), float(np.mean(speeds))
    other = likely.hardest(_steerings(vehicle, time, seed + 1)["random steer"], middle)
    forces = likely.forces(other, middle)
    found = [
        likely.planned(name, of, speed, forces)
        for speed in speeds
        for name, of in _steerings(vehicle, time, seed).items()
    ]
    return tuple(sorted(found, key=lambda one: one.error))


Steering = Callable[[float], Maneuver]  # of an amplitude [rad]


def _steerings(vehicle: Vehicle, time: float, seed: int) -> dict[str, Steering]:
    """Return the maneuvers by their amplitude."""
    f, t = FREQUENCY / vehicle.froude_time, np.arange(0.0, time, DT)
    steering = time - STRAIGHT
    growing = np.maximum(t - STRAIGHT, 0.0) / steering * np.sin(2.0 * math.pi * f * (t - STRAIGHT))

    def sine(kind: type, frequency: float, duration: float = time, **more: float) -> Steering:
        return lambda amplitude: kind(
            amplitude=amplitude, frequency=frequency, onset=STRAIGHT, duration=duration,
            rate_limit=2.1 * math.pi * frequency * amplitude, **more,
        )  # fmt: skip

    def ramp(seconds: float) -> Steering:
        return lambda amplitude: maneuvers.StepSteer(
            amplitude=amplitude, onset=STRAIGHT, rate_limit=amplitude / seconds, duration=time
        )

    lanes = {"duration": 2.0 * STRAIGHT + 2.5 / f, "pause": 0.5 / f}
    return {
        "step steer": ramp(0.25 / f),
        "slow ramp": ramp(steering),
        "slalom": sine(maneuvers.Slalom, f),
        "fast slalom": sine(maneuvers.Slalom, 2.0 * f),
        "growing slalom": lambda amplitude: maneuvers.SampledSteer(
            times=tuple(t), angles=tuple(amplitude * growing), duration=time,
            rate_limit=(2.0 * math.pi * f + 1.0 / steering) * amplitude,
        ),
        "double lane change": sine(maneuvers.DoubleLaneChange, f, **lanes),
        "random steer": sine(maneuvers.RandomSteer, 1.5 * f, seed=seed),
    }  # fmt: skip


class _Likely(NamedTuple):
    """The car as it is believed: its priors, and the tires that it is taken to have, (p,)."""

    vehicle: Vehicle
    priors: Priors
    p: Array
    share: float

    def planned(self, name: str, of: Steering, speed: float, other: Array) -> Planned:
        """Return the hardest maneuver of a kind, and what it tells of another drive.
        other : slopes of the forces there, of `forces`, (k, p).
        """
        maneuver = self.hardest(of, speed)
        z = self.driven(maneuver, speed, DT)
        log, X, Y = self.log(maneuver, speed, z)
        length, width = (side + 2.0 * self.vehicle.wheelbase for side in _extent(X, Y))
        tire = self.after(log, np.abs(z[:, 2:]).max(axis=0))
        variance = np.einsum("ki,ij,kj->k", other, tire.covariance, other)
        return Planned(
            name=name, maneuver=maneuver, speed=speed, log=log, X=X, Y=Y, length=length,
            width=width, error=float(np.sqrt(np.mean(variance))), tire=tire,
        )  # fmt: skip

    def hardest(self, of: Steering, speed: float) -> Maneuver:
        """Return the hardest maneuver of a kind that keeps the share of the grip."""
        slips = np.linspace(0.0, WIDEST, 601)
        curves = [curve_function()(self.p[curve_index(axle)], slips[None])[0] for axle in "fr"]
        phi = np.column_stack([np.array(curve).ravel() for curve in curves])
        most = slips[np.argmax(phi >= self.share * phi.max(axis=0), axis=0)]
        low, high = 0.0, MOST_ANGLE
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            slip = np.abs(self.driven(of(middle), speed, 2.0 * DT)[:, 2:])
            low, high = (middle, high) if (slip <= most).all() else (low, middle)
        return of(low)

    def log(self, maneuver: Maneuver, speed: float, z: Array) -> tuple[Recording, Array, Array]:
        """Return what exact sensors show, and the way X, Y of the center of gravity [m], (n,)."""
        v_y, r = z[:, :2].T
        t, psi = DT * np.arange(r.size), np.cumsum(r) * DT
        log = Recording(
            name="plan", t=t, v_x=np.full(t.size, speed), v_y=v_y, r=r,
            delta_f=maneuver.steering(t)[:, 0], delta_r=np.zeros(t.size),
            a_y=np.gradient(v_y, DT) + speed * r,
        )  # fmt: skip
        X = np.cumsum(speed * np.cos(psi) - v_y * np.sin(psi)) * DT
        Y = np.cumsum(speed * np.sin(psi) + v_y * np.cos(psi)) * DT
        return log, X, Y

    def driven(self, maneuver: Maneuver, speed: float, dt: float) -> Array:
        """Return v_y, r and the lagged slips of both axles from step to step, (n, 4)."""
        t = np.arange(0.0, maneuver.duration, dt)
        given = np.zeros((t.size + 1, len(GIVEN)))
        given[:, 0] = speed
        given[1:, 1] = maneuver.steering(t)[:, 0]
        numbers = (self.p, car_numbers(self.vehicle), np.array([dt]))
        constant = [np.repeat(one[:, None], t.size, axis=1) for one in numbers]
        z = _step().mapaccum(t.size)(np.zeros(4), given[:-1].T, given[1:].T, *constant)
        return np.array(z).T

    def after(self, log: Recording, driven: Array) -> FittedModel:
        """Return the likely tires with the covariance that the log of a drive leaves.
        driven : largest slip of each axle [rad], (2,).
        """
        problem = Problem([Drive.of(log, self.vehicle)], self.vehicle, self.priors)
        now, both = problem.residuals(self.p), np.ones(2)
        H, _ = normal(problem, now, ERROR**2 * both, LASTS * both)
        covariance = np.zeros((len(NAMES), len(NAMES)))
        where = np.ix_(problem.index, problem.index)
        covariance[where] = np.linalg.inv(H + around_beliefs(self.priors, self.p)[1][where])
        return FittedModel(
            vehicle=self.vehicle, p=self.p, covariance=covariance,
            reach=Reach(driven, log.v_x[[0, 0]], np.zeros(2), (ERROR * both) ** 2, 1.0),
        )  # fmt: skip

    def forces(self, maneuver: Maneuver, speed: float) -> Array:
        """Return slopes of the forces of a drive over tires and body, over their rms, (k, p)."""
        log, _, _ = self.log(maneuver, speed, self.driven(maneuver, speed, DT))
        problem = Problem([Drive.of(log, self.vehicle)], self.vehicle, self.priors)
        slopes = np.zeros((problem.size.size, 2, len(NAMES)))
        slopes[:, :, problem.index] = problem.residuals(self.p).slopes
        slopes[:, :, [INDEX[name] for name in SENSORS]] = 0.0  # of that drive alone
        slopes *= problem.size[:, None, None] / root_mean_square(problem.force)
        return slopes.reshape(-1, len(NAMES))


@cache
def _step() -> ca.Function:
    """Return (z, given, given_next, parameters, car, dt) -> z_next (4,), by Newton's method."""
    nodes = node_scan().step
    names = ("given", "given_next", "parameters", "car", "dt")
    rest = [ca.SX.sym(name, *nodes.size_in(name)) for name in names]
    z, z_next = ca.SX.sym("z", 4), ca.SX.sym("z_next", 4)
    still = ca.SX.zeros(4)  # what curves miss, and the bank
    residual = nodes(
        z=ca.vertcat(z, still), z_next=ca.vertcat(z_next, still),
        **dict(zip(names, rest, strict=True)), times=1,
    )["moves"][:4]  # fmt: skip
    equations = ca.Function("residual", [z_next, z, *rest], [residual])
    newton = ca.rootfinder("newton", "newton", equations, {"abstol": 1e-9})
    given = [ca.MX.sym(f"given_{k}", one.numel()) for k, one in enumerate((z, *rest))]
    return ca.Function("step", given, [newton(given[0], *given)])


def _extent(X: Array, Y: Array) -> tuple[float, float]:
    """Return length and width [m] of the least rectangle, however turned, around a way (n,)."""
    angles = np.linspace(0.0, math.pi, 361)[:-1]
    c, s = np.cos(angles), np.sin(angles)
    along, across = (np.ptp(np.outer(a, X) + np.outer(b, Y), axis=1) for a, b in ((c, s), (-s, c)))
    k = int((along * across).argmin())
    return float(max(along[k], across[k])), float(min(along[k], across[k]))
