"""The step of a method with every number of it folded in: what is exported.

Gains, T_s, vehicle and K⁻¹ become literals, so that only signals and carried values are left:
(carried, x = [v_y, r], u = [δ_f, δ_r], v_x) -> (carried next, axle_force [N], other outputs), SI.
"""

from collections.abc import Mapping
from typing import NamedTuple

import casadi as ca
import numpy as np

from codegen.arrays import Array
from codegen.tuned import Tuned, tuned
from identifier.axle import AxleIdentifier
from identifier.baselines import StiffnessRls
from identifier.method import Method, Setup
from identifier.paper.design import PaperIdentifier
from identifier.refused import GATE, SampleLimits, judges_samples
from identifier.regression import RegressionIdentifier
from identifier.tire_model import TireModel
from models.recordings import Recording
from models.vehicle import Vehicle

# What the ports of a step mean: a unit and a few words on every field of an exported structure.

LOAD = "static axle loads"
# Rules of weights that are taken over.
COVARIANCE, FACTORS, NOT_NEGATIVE = "covariance", "factors of a covariance", "not negative"
RULES: Mapping[str, str] = {"P": COVARIANCE, "Omega": COVARIANCE, "information": NOT_NEGATIVE}
AXLE_RULES: Mapping[str, str] = {
    "UD": FACTORS,
    "errors": NOT_NEGATIVE,
    "excitation": NOT_NEGATIVE,
    "watch": NOT_NEGATIVE,
}


class Signal(NamedTuple):
    """An input, output or carried value: its name in C, FMU and JSON, and what it is."""

    name: str
    unit: str
    description: str
    size: int = 1
    rule: str = ""


INPUTS = (
    Signal("v_x", "m/s", "longitudinal speed at the center of mass, forward positive"),
    Signal("v_y", "m/s", "lateral velocity at the center of mass, left positive"),
    Signal("r", "rad/s", "yaw rate, left positive"),
    Signal("delta_f", "rad", "road-wheel steering angle in front, left positive"),
    Signal("delta_r", "rad", "road-wheel steering angle at the rear, left positive"),
)
# U stands for the unit of forces inside the identifier.
PORTS: Mapping[str, tuple[str, str]] = {
    "axle_force": ("N", "lateral axle forces, front and rear, left positive, frame of the body"),
    "f_hat": ("U", "force of the network alone, front and rear"),
    "xi_tilde": ("U s", "error of the observed axle impulse, front and rear"),
    "residual": ("U", "error of the filtered regression, front and rear"),
    "W": ("U", "output weights, rows front and rear"),
    "V": ("-", "hidden weights, rows units, columns scaled inputs"),
    "xi_hat": ("U s", "observed axle impulse, front and rear"),
    "z": ("U s^2", "filtered error, front and rear"),
    "target_lag": ("U", "filter of the target, front and rear"),
    "regressor_lag": ("-", "filter of the hidden layer"),
    "fresh": ("-", "1 where the filters begin anew"),
    "P": ("1/s", "inverse of the information"),
    "Omega": ("s", "information"),
    "Y": ("U s", "information times target"),
    "S": ("-", "stored regressors"),
    "Z": ("U", "stored targets"),
}
AXLE_PORTS: Mapping[str, tuple[str, str]] = {
    "W": (LOAD, "weights of the units, rows front and rear"),
    "own": (
        "m per load; -; rad and m/s",
        "compliance, sway share, offset of steering (front) and of v_y (rear)",
    ),
    "UD": (
        "of W and own",
        "covariance U D U' of W and own: D, and U above it, by rows; front and rear",
    ),
    "gate": (
        "SI",
        "last good v_x, v_y, r, delta_f, delta_r; on; time of steady learning; bad and stuck "
        "samples in a row",
    ),
    "sway": ("m/s^2; m/s^3; rad", "roll: state, its rate, slip of the contact patch"),
    "slip": ("rad; rad; 1/rad; -", "lagged slip, slip, slope and force of the curve, per axle"),
    "sensitivity": ("rad; rad; 1/rad^2", "of slip to compliance and sway share, bend, per axle"),
    "filters": (LOAD, "filters of the regressors and of the target, per axle"),
    "errors": (f"-; -; {LOAD}", "fast and slow mean squared error, peak force, per axle"),
    "excitation": ("rad; s", "largest slip, then time of learning above each edge, per axle"),
    "watch": (
        "s; s; -",
        "time in doubt, and in which kept explained again; mean squared error of W and of kept, "
        "front and rear",
    ),
    "kept": ("of W and own", "W and own that are gone back to after a fault, front and rear"),
}


def force_unit_text(method: Method) -> str:
    """Return the name of the unit of forces inside a method.

    Parameters
    ----------
    method : the method.
    """
    unit = getattr(method, "force_unit", 1.0)
    return {1.0: "N", 1000.0: "kN"}.get(unit, f"{unit:g} N")


def describe(method: Method, port: str, size: int) -> Signal:
    """Return what a port of the step of a method means.

    Parameters
    ----------
    method : the method.
    port : name of an output or of a carried port.
    size : number of entries.
    """
    curves = isinstance(method, AxleIdentifier)
    known = {**PORTS, **AXLE_PORTS} if curves else PORTS
    unit, description = known.get(port, ("-", "state of the method"))
    rule = (AXLE_RULES if curves else RULES).get(port, "")
    return Signal(port, unit.replace("U", force_unit_text(method)), description, size, rule)


SAMPLED = ("x", "u", "v_x")


class SpecializedStep(NamedTuple):
    """A step without constants, where it starts, and what its ports mean.

    name : C identifier, prefix of everything that is exported.
    method, vehicle : what it was folded from.
    function : SX function of the carried ports, then x (2,), u (2,), v_x; returns `p_next` of each
        carried port `p`, then the outputs, axle_force (2,) [N] first.
    parts : the same function in the parts that C is written from.
    carry : value of each carried port at the start, in the port's matrix shape.
    learnt : carried ports that hold their values while adaptation is off; empty: it cannot be.
    inputs : the five scalars v_x, v_y, r, delta_f, delta_r.
    outputs : axle_force and what else the step tells.
    state : units of the carried ports.
    dt : sampling interval [s].   min_speed : [m/s], below it forces read zero.
    rests_first : whether a run begins with one step at v_x = 0 of its first sample, in which the
        observer takes the measurement.
    believed : carried port whose first five entries are the inputs that the step went on with,
        older ones where a sample was not believed; None where the method has no such port.
    limits : of inputs and forces.
    """

    name: str
    method: Method
    vehicle: Vehicle
    function: ca.Function
    parts: Tuned
    carry: Mapping[str, Array]
    learnt: tuple[str, ...]
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]
    state: tuple[Signal, ...]
    dt: float
    min_speed: float
    rests_first: bool
    believed: str | None
    limits: SampleLimits


def learnt_ports(method: Method, carry: Mapping[str, Array]) -> tuple[str, ...]:
    """Return the carried ports that adaptation moves; filters and observers are not among them.

    Parameters
    ----------
    method : the method.
    carry : its carried ports.
    """
    match method:
        case PaperIdentifier():
            moving = {"W", "V"}
        case AxleIdentifier():
            moving = {"W", "own", "UD", "errors", "excitation", "watch", "kept"}
        case RegressionIdentifier():
            moving = set(carry) - {"target_lag", "regressor_lag", "fresh"}
        case StiffnessRls():
            moving = {"stiffness", "information"}
        case _:
            moving = set()
    return tuple(port for port in carry if port in moving)


def specialize(
    method: Method, vehicle: Vehicle, start: TireModel | None = None, name: str = "tireid"
) -> SpecializedStep:
    """Return the step of a method for a car, ready to be exported.

    Parameters
    ----------
    method : the method, with its numbers.
    vehicle : the car.
    start : weights to begin with; None begins with those of the method.
    name : C identifier.

    Raises
    ------
    ValueError
        Where stored weights are those of another structure.
    """
    setup = method.setup(vehicle, _standing(method.dt), start)
    moved = method.setup(vehicle, _standing(method.dt, x=1.0), start)
    step = setup.scan.step
    parts = _specialized(setup, name)
    told = sorted(setup.scan.outputs, key=lambda port: port != "axle_force")
    return SpecializedStep(
        name=name,
        method=method,
        vehicle=vehicle,
        function=parts.function,
        parts=parts,
        carry={port: _matrix(value, step.size_in(port)) for port, value in setup.carry.items()},
        learnt=learnt_ports(method, setup.carry),
        inputs=INPUTS,
        outputs=tuple(describe(method, port, step.numel_out(port)) for port in told),
        state=tuple(describe(method, port, value.size) for port, value in setup.carry.items()),
        dt=method.dt,
        min_speed=method.min_speed,
        rests_first=any(
            not np.array_equal(setup.carry[port], moved.carry[port]) for port in setup.carry
        ),
        believed=GATE if judges_samples(setup.carry) else None,
        limits=SampleLimits.of(vehicle),
    )


def _specialized(setup: Setup, name: str) -> Tuned:
    step, carry = setup.scan.step, list(setup.carry)
    ports = {port: ca.SX.sym(port, *step.size_in(port)) for port in carry}
    ports |= {"x": ca.SX.sym("x", 2), "u": ca.SX.sym("u", 2), "v_x": ca.SX.sym("v_x")}
    sampled = {port: ports[port] for port in (*carry, *setup.scan.over)}
    constants = {
        port: ca.DM(_matrix(value, step.size_in(port))) for port, value in setup.constants.items()
    }
    results = step(**sampled, **constants)
    told = sorted(setup.scan.outputs, key=lambda port: port != "axle_force")
    wanted = [*(f"{port}_next" for port in carry), *told]
    literal = ca.Function(
        name,
        list(ports.values()),
        [ca.densify(results[port]) for port in wanted],
        list(ports),
        wanted,
        {"cse": True},
    )
    return tuned(literal, sampled=SAMPLED)


def _matrix(value: Array, size: tuple[int, int]) -> Array:
    array = np.asarray(value, dtype=np.float64)
    return array if array.shape == tuple(size) else array.reshape(size)


def _standing(dt: float, x: float = 0.0) -> Recording:
    """Return ten samples of a car that stands, or is said to slide sideways by x."""
    zero = np.zeros(10)
    return Recording(
        name="standing",
        t=dt * np.arange(10.0),
        v_x=zero,
        v_y=zero + x,
        r=zero + x,
        delta_f=zero,
        delta_r=zero,
    )
