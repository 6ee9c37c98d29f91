"""Moving-horizon estimation of v_y, yaw rate and, for each axle, stiffness and capacity of force.

z = [v_y, r, θ] and the tires are those of the joint filter, `tireid_rivals.slip_filter`. The
window holds r, a_y, v_x and steering of the last N samples; what came before them is in the arrival
cost, a mean and a covariance. Each sample a fixed number of Gauss-Newton steps minimizes

    |z_0 - z_a|²/P_a + Σ |z_k+1 - f(z_k)|²/Q + Σ |y_k - h(z_k)|²/R

from the last trajectory, shifted. A Gauss-Newton step on a chain is a Kalman filter forward and a
smoother backward (Bell, "The iterated Kalman smoother as a Gauss-Newton method", 1994), here that
of Bryson and Frazier, which inverts no covariance. Bounds of θ and of sliding are kept by
projection. The sample that leaves the window enters the arrival cost linearized where the window
saw it. The estimate is the end of the trajectory. After the description of arXiv 2609.10202
(an inertial unit, a horizon, the capacity of force of each axle as a parameter), without its data;
of one capacity alone, with the stiffness that a vehicle file states, it knew less.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, NamedTuple, Self

import casadi as ca
import numpy as np

from codegen import Scan
from codegen.arrays import Array
from identifier.baselines.curves import CurveModel
from identifier.baselines.kalman import corrected
from identifier.baselines.ports import WITH_A_Y, given_ports
from identifier.method import Method
from identifier.setup import COVARIANCE, Port, Setup
from identifier.tire_model import TireModel
from models.rules import require_positive, require_within
from models.vehicle import Vehicle
from tireid_rivals.slip_filter import LIMITS, PORTS, TIRES, Numbers, SlipFilter
from tireid_rivals.without_v_y import (
    MOST_SLIDING,
    axle_force,
    expected,
    predicted,
    steady_v_y,
)

TIRE = TIRES["dugoff"]
Z = 2 + TIRE.unknowns  # numbers of z
CARRY = ("estimate", "P", "arrival", "arrival_P", "trajectory", "window", "running")
_OWN_PORTS = (
    *(port for port in PORTS if port.name != "before"),
    Port("arrival", "of estimate", "what is known of z before the window"),
    Port("arrival_P", "of estimate", "covariance of arrival", rule=COVARIANCE),
    Port("trajectory", "of estimate", "z before and in the window, a column a sample"),
    Port("window", "SI", "whether it counts, whether a_y is there, delta, v_x, r, a_y; by column"),
)
LONGEST = 400  # samples of a window


class Sampled(NamedTuple):
    """A column of the window: 1 where it counts, 1 where a_y is there, then what was measured."""

    counts: Any
    has_a_y: Any
    delta_f: Any
    delta_r: Any
    v_x: Any
    r: Any
    a_y: Any


class Stage(NamedTuple):
    """What the forward pass leaves of a sample: filtered z and P, and what the way back needs."""

    z: Any
    P: Any
    ahead: Any
    ahead_P: Any
    pull: Any
    keep: Any
    F: Any


def build_stage() -> ca.Function:
    """Return one sample of the forward pass: `Stage` of z, P, where it is linearized, and columns.

    Inputs: z (6,) and P (6, 6) after the sample before; at_before and at (6,), the trajectory at
    both; before and now (7,), both columns; numbers, vehicle, sampling. A column that does not
    count leaves z and P as they are.
    """
    s = given_ports().sample
    z, at_before, at = (ca.SX.sym(name, Z) for name in ("z", "at_before", "at"))
    P = ca.SX.sym("P", Z, Z)
    before, now = (ca.SX.sym(name, len(Sampled._fields)) for name in ("before", "now"))
    numbers = ca.SX.sym("numbers", len(Numbers._fields))
    output, p, dt = Numbers(*ca.vertsplit(numbers)), s.parameters, s.sampling[0]
    last, here = Sampled(*ca.vertsplit(before)), Sampled(*ca.vertsplit(now))
    v_mean = ca.fmax((last.v_x + here.v_x) / 2, output.learning_speed)
    u_mean = ca.vertcat(last.delta_f + here.delta_f, last.delta_r + here.delta_r) / 2
    u, speed = ca.vertcat(here.delta_f, here.delta_r), ca.fmax(here.v_x, output.learning_speed)

    reached = predicted(TIRE, p, output.friction, at_before, v_mean, u_mean, dt)
    F = ca.jacobian(reached, at_before)
    disturbances = ca.vertcat(
        output.v_y_disturbance, output.r_disturbance, ca.repmat(output.walk, Z - 2, 1)
    )
    ahead = ca.if_else(here.counts, reached + F @ (z - at_before), z)
    F = ca.if_else(here.counts, F, ca.SX.eye(Z))
    ahead_P = F @ P @ F.T + here.counts * dt * ca.diag(disturbances**2)
    shows = expected(TIRE, p, output.friction, at, speed, u)
    measured = ca.vertcat(here.counts, here.counts * here.has_a_y)
    H = ca.diag(measured) @ ca.jacobian(shows, at)
    innovation = measured * (ca.vertcat(here.r, here.a_y) - shows) - H @ (ahead - at)
    R = ca.diag(ca.vertcat(output.r_noise, output.a_y_noise) ** 2)
    found = corrected(ahead_P, H, R, innovation, output.outlier)
    stage = Stage(ahead + found.move, found.P, ahead, ahead_P, found.pull, found.keep, F)
    return ca.Function(
        "horizon_stage",
        [z, P, at_before, at, before, now, s.vehicle, s.sampling, numbers],
        [ca.densify(one) for one in stage],
        ["z", "P", "at_before", "at", "before", "now", "vehicle", "sampling", "numbers"],
        [f"{name}_declared" for name in Stage._fields],
        {"cse": True},
    )


def smoothed(stages: list[Stage], z: Any, P: Any, limit: Any) -> list[Any]:
    """Return the trajectory after the way back, that of the arrival first."""
    adjoint, found = ca.MX.zeros(Z), []
    for stage in reversed(stages):
        adjoint = stage.keep.T @ adjoint - stage.pull
        found.append(limit(stage.ahead - stage.ahead_P @ adjoint))
        adjoint = stage.F.T @ adjoint
    return [limit(z - P @ adjoint), *reversed(found)]


class Begun(NamedTuple):
    """What a sample is before the window is looked at.

    going : 1 where the window goes on.   fast : 1 above the learning speed.   speed : v_x, held at
    that [m/s].   column : of the window.   start, start_P : z in a steady turn, and its covariance.
    ahead : where the last estimate leads, about which the sample is linearized first.
    """

    going: Any
    fast: Any
    speed: Any
    column: Any
    start: Any
    start_P: Any
    ahead: Any


def _build_beginning() -> ca.Function:
    """Return `Begun` of estimate, P, running, the last column, the sample and the constants."""
    given = given_ports()
    s, p = given.sample, given.sample.parameters
    estimate, P, running = ca.SX.sym("estimate", Z), ca.SX.sym("P", Z, Z), ca.SX.sym("running")
    last, numbers = (
        ca.SX.sym("last", len(Sampled._fields)),
        ca.SX.sym("numbers", len(Numbers._fields)),
    )
    output, before = Numbers(*ca.vertsplit(numbers)), Sampled(*ca.vertsplit(last))
    speed = ca.fmax(s.v_x, output.learning_speed)
    fast = s.v_x >= output.learning_speed
    going = ca.logic_and(fast, running > 0.5)
    v_mean = ca.fmax((before.v_x + s.v_x) / 2, output.learning_speed)
    u_mean = (ca.vertcat(before.delta_f, before.delta_r) + s.u) / 2
    column = Sampled(going, given.has_a_y, s.u[0], s.u[1], s.v_x, given.r, given.a_y)
    first = ca.diag(ca.vertcat(output.start_slip * s.speed, output.r_noise) ** 2)
    begun = Begun(
        going=going,
        fast=fast,
        speed=speed,
        column=ca.vertcat(*column),
        start=ca.vertcat(steady_v_y(p, s.speed, given.r, s.u), given.r, estimate[2:]),
        start_P=ca.diagcat(first, P[2:, 2:]),
        ahead=predicted(TIRE, p, output.friction, estimate, v_mean, u_mean, s.sampling[0]),
    )
    return ca.Function(
        "horizon_beginning",
        [estimate, P, running, last, *given.ports, numbers],
        [ca.densify(one) for one in begun],
    )


def _build_declared() -> ca.Function:
    """Return axle_force and v_y of the next estimate, of the θ carried into the sample."""
    s, numbers = given_ports().sample, ca.SX.sym("numbers", len(Numbers._fields))
    following, estimate = ca.SX.sym("following", Z), ca.SX.sym("estimate", Z)
    known, at = Numbers(*ca.vertsplit(numbers)).friction, ca.vertcat(following[:2], estimate[2:])
    force = axle_force(TIRE, s.parameters, known, at, s.speed, s.u)
    return ca.Function(
        "horizon_declared",
        [following, estimate, s.u, s.v_x, s.vehicle, s.sampling, numbers],
        [ca.if_else(s.moving, force, 0), ca.if_else(s.moving, following[0], 0)],
    )


def build_step(samples: int, iterations: int) -> ca.Function:
    """Return the step; all numbers stay inputs of it.

    Carried: estimate (6,) and P, arrival (6,) and arrival_P, trajectory (6, N + 1), that before the
    window first, window (7, N + 1), running. Below the learning speed, and after an estimate that
    slides by more than `MOST_SLIDING`, the window is empty, and x begins anew in a steady turn;
    θ and its covariance are kept.
    """
    stage, constants = build_stage(), ("vehicle", "sampling", "numbers")
    rows = {"trajectory": (Z, samples + 1), "window": (len(Sampled._fields), samples + 1)}
    rows |= {"P": (Z, Z), "arrival_P": (Z, Z), "estimate": (Z, 1), "arrival": (Z, 1)}
    rows |= {"x": (2, 1), "u": (2, 1), "vehicle": (6, 1), "sampling": (2, 1)}
    rows |= {"numbers": (len(Numbers._fields), 1)}
    names = [*CARRY, *WITH_A_Y, *constants]
    port = {name: ca.MX.sym(name, *rows.get(name, (1, 1))) for name in names}
    known = [port[name] for name in constants]
    old_at, old = ca.horzsplit(port["trajectory"]), ca.horzsplit(port["window"])
    first = [port["estimate"], port["P"], port["running"], old[-1]]
    begun = Begun(*_build_beginning()(*first, *(port[name] for name in WITH_A_Y), *known))

    def forward(at: list[Any], columns: list[Any], z: Any, P: Any) -> list[Stage]:
        found: list[Stage] = []
        for k in range(len(columns) - 1):
            found.append(Stage(*stage(z, P, *at[k : k + 2], *columns[k : k + 2], *known)))
            z, P = found[-1].z, found[-1].P
        return found

    def bounded(z: Any) -> Any:
        sliding = MOST_SLIDING * begun.speed
        v_y, theta = ca.fmin(ca.fmax(z[0], -sliding), sliding), z[2:]
        return ca.vertcat(v_y, z[1], ca.fmin(ca.fmax(theta, -ca.DM(LIMITS)), ca.DM(LIMITS)))

    left = forward(old_at[:2], old[:2], port["arrival"], port["arrival_P"])[0]
    z = ca.if_else(begun.going, left.z, begun.start)
    P = ca.if_else(begun.going, left.P, begun.start_P)
    columns = [*(begun.going * one for one in old[1:]), begun.column]
    at = [ca.if_else(begun.going, one, begun.start) for one in (*old_at[1:], begun.ahead)]
    stages: list[Stage] = []
    for _ in range(iterations):
        stages = forward(at, columns, z, P)
        at = smoothed(stages, z, P, bounded)
    estimate, now = bounded(stages[-1].z), stages[-1]
    sane = ca.fabs(now.z[0]) < MOST_SLIDING * begun.speed
    following = {
        "estimate": estimate,
        "P": now.P,
        "arrival": z,
        "arrival_P": P,
        "trajectory": ca.horzcat(*at),
        "window": ca.horzcat(*columns),
        "running": ca.logic_and(begun.fast, sane),
    }
    output = _build_declared()(estimate, port["estimate"], port["u"], port["v_x"], *known)
    return ca.Function(
        f"horizon_{samples}_{iterations}",
        list(port.values()),
        [*(ca.densify(following[name]) for name in CARRY), *output, ca.sqrt(now.P[0, 0])],
        names,
        [*(f"{name}_next" for name in CARRY), "axle_force", "v_y", "v_y_sd"],
    )


@cache
def _scan(samples: int, iterations: int) -> Scan:
    return Scan(build_step(samples, iterations), carry=CARRY, over=WITH_A_Y)


@dataclass(frozen=True, slots=True, kw_only=True)
class HorizonEstimator(Method):
    """Lateral velocity and two numbers per tire by moving-horizon estimation; v_y is not read.
    window : how long what was measured is looked at again [s].
    """

    ports = _OWN_PORTS
    needs = ("a_y",)  # it estimates v_y

    filter: SlipFilter
    window: float
    iterations: int = 1

    def __post_init__(self) -> None:
        if not self.filter.learns:
            raise ValueError(f"a horizon needs tires to learn, not {self.filter.tire!r} ones")
        require_positive(ValueError, window=self.window)
        require_within(ValueError, 1, LONGEST, samples=self.samples)
        require_within(ValueError, 1, 10, iterations=self.iterations)

    @property
    def dt(self) -> float:
        """Sampling interval [s]."""
        return self.filter.dt

    @property
    def min_speed(self) -> float:
        """Below this speed [m/s] forces and v_y read zero."""
        return self.filter.min_speed

    @property
    def samples(self) -> int:
        return round(self.window / self.dt)

    @classmethod
    def for_vehicle(cls, vehicle: Vehicle, *, dt: float = 0.01) -> Self:
        """Return the estimator for a car: a window of sqrt(L/g), half a second for a sedan.

        Numbers are those of the joint filter but for two, chosen on random drives of our plant as
        well. The trajectory that is likeliest together with its tires makes tires too stiff where
        much of the motion may be chance, so less of the yaw rate's is. A longer window, or more
        steps, errs no less there.
        """
        window = max(vehicle.froude_time, 2.0 * dt)
        joint = SlipFilter.for_vehicle(vehicle, tire="dugoff", dt=dt)
        return cls(
            filter=replace(
                joint, a_y_noise=1.3 * joint.a_y_noise, r_disturbance=0.36 * joint.r_disturbance
            ),
            window=window,
        )

    @property
    def remark(self) -> str:
        """Say which tires it stands on, and what it solves."""
        return f"{self.filter.remark}; solves for the last {self.samples} samples at each"

    def setup(self, vehicle: Vehicle, start: TireModel | None = None) -> Setup:
        """Return what a run needs; a frozen curve of its kind may begin it, else the prior does."""
        joint, N = self.filter.setup(vehicle, start), self.samples
        z, P = joint.carry["estimate"], joint.carry["P"]
        return Setup(
            scan=_scan(N, self.iterations),
            carry={
                "estimate": z,
                "P": P,
                "arrival": z,
                "arrival_P": P,
                "trajectory": np.tile(z[:, None], N + 1),
                "window": np.zeros((len(Sampled._fields), N + 1)),
                "running": np.zeros(1),
            },
            constants=joint.constants,
        )

    def frozen(self, vehicle: Vehicle, state: Mapping[str, Array]) -> CurveModel:
        return self.filter.frozen(vehicle, state)
