"""The step of a method with every number of it put in: what is exported.

Gains, T_s, vehicle and K⁻¹ become literals, so that only signals and the state are left:
(state, x = [v_y, r], u = [δ_f, δ_r], v_x) -> (state next, axle_force [N], other outputs), SI.
Last of them is a_y, for a method that needs it; one that can use it takes it where it is asked to,
and else goes without, as where none is logged.
"""

from collections.abc import Mapping
from itertools import takewhile
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from codegen.arrays import Array
from codegen.tuned import Tuned, tuned
from identifier.method import Method
from identifier.refused import GATE, SampleLimits, judges_samples
from identifier.setup import AXLE_FORCE, HALF_BAND, Range, Setup
from identifier.tire_model import TireModel
from models.vehicle import Vehicle


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
ACCELERATION = Signal(
    "a_y",
    "m/s^2",
    "lateral acceleration that an accelerometer shows, left positive; NaN where there is none",
)
SIDE_SLIP = ("v_y", "v_y_sd", "side_slip_observable")
SAMPLED = ("x", "u", "v_x", "a_y")
_ROUNDING = 1e-6  # of sums in float, as a share


class SpecializedStep(NamedTuple):
    """A step without constants, where it starts, and what its ports mean.
    function : SX function of the carried ports, then x (2,), u (2,), v_x, and a_y where it is an
        input; returns `p_next` of each carried port `p`, then the outputs, axle_force (2,) [N]
        first.
    parts : the same function in the parts that C is written from.
    carry : value of each carried port at the start, in the port's matrix shape.
    learnt : carried ports that hold their values while adaptation is off; empty: it cannot be.
    inputs : the scalars v_x, v_y, r, delta_f, delta_r, and a_y where it is one.
    state : units of the carried ports.   dt : sampling interval [s].
    min_speed : [m/s], below it forces read zero.
    rests_first : whether a run begins with one step at v_x = 0 of its first sample, in which the
        observer takes the measurement.
    believed : carried port whose first five entries are the inputs that the step went on with,
        older ones where a sample was not believed; None where the method has no such port.
    band : numbers of the calibration of its band, None where there is none.
    ranges : where what is learnt must lie to be taken over.
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
    band: Mapping[str, Any] | None
    ranges: tuple[Range, ...]

    @property
    def tells_band(self) -> bool:
        """Whether half the width of the band around the forces is an output."""
        return any(port.name == HALF_BAND.name for port in self.outputs)

    @property
    def reads_a_y(self) -> bool:
        return ACCELERATION in self.inputs

    @property
    def tells_v_y(self) -> bool:
        """Whether v_y is an output, so that it may be NaN as an input."""
        return "v_y" not in self.method.needs

    @property
    def side_slip(self) -> tuple[str, ...]:
        """Outputs that tell v_y: the first one, two or all of `SIDE_SLIP`, or none of them."""
        given = {port.name for port in self.outputs} if self.tells_v_y else set()
        return tuple(takewhile(given.__contains__, SIDE_SLIP))


def specialize(
    method: Method,
    vehicle: Vehicle,
    start: TireModel | None = None,
    name: str = "tireid",
    *,
    with_a_y: bool = False,
    with_band: bool = False,
) -> SpecializedStep:
    """Return the step of a method for a car, ready to be exported.
    start : weights to begin with; None begins with those of the method.
    with_a_y : whether a_y is an input of a method that goes without it as well.
    with_band : whether half the width of the band is an output, calibrated as `start` is.
    """
    making = method.setup_with_band if with_band else method.setup
    if making is None:
        raise ValueError(f"{type(method).__name__} cannot tell how sure it is: it has no band")
    setup = making(vehicle, start)
    if not setup.scan.step.is_a("SXFunction"):
        raise ValueError(
            f"{type(method).__name__} cannot be exported: its step solves a problem by many calls, "
            "and is not the straight-line code of a controller"
        )
    if with_a_y and "a_y" not in setup.scan.over:
        raise ValueError(f"{type(method).__name__} has no use for a_y")
    with_a_y = with_a_y or "a_y" in method.needs
    step, left_out = setup.scan.step, () if with_a_y else setup.only_with_a_y
    carry = {port: one for port, one in setup.carry.items() if port not in left_out}
    outputs = sorted(setup.scan.outputs, key=lambda port: port != AXLE_FORCE.name)
    parts = _specialized(setup, list(carry), outputs, name, with_a_y=with_a_y)
    inputs = list(INPUTS)
    if "v_y" not in method.needs:
        missing = f"{INPUTS[1].description}; NaN where there is none"
        inputs[1] = INPUTS[1]._replace(description=missing)

    def described(name: str, size: int) -> Signal:
        port = method.port(name)
        return Signal(port.name, port.unit, port.words, size, port.rule)

    return SpecializedStep(
        name=name,
        method=method,
        vehicle=vehicle,
        function=parts.function,
        parts=parts,
        carry={port: _matrix(value, step.size_in(port)) for port, value in carry.items()},
        learnt=tuple(port for port in carry if method.port(port).learnt),
        inputs=(*inputs, *[ACCELERATION] * with_a_y),
        outputs=tuple(described(port, step.numel_out(port)) for port in outputs),
        state=tuple(described(port, value.size) for port, value in carry.items()),
        dt=method.dt,
        min_speed=method.min_speed,
        rests_first=setup.observe is not None,
        believed=GATE if judges_samples(carry) else None,
        limits=SampleLimits.of(vehicle),
        band=start.to_dict().get("band") if with_band and start is not None else None,
        ranges=tuple(_reaching(one, carry[one.port]) for one in setup.ranges),
    )


def _reaching(kept: Range, start: Array) -> Range:
    """Return a range that reaches to where a run begins, which may lie outside.
    start : value of the port.
    """
    numbers = np.ravel(start)[kept.first : kept.first + len(kept.shares)] * kept.shares
    value, rounding = numbers.sum(), _ROUNDING * np.abs(numbers).sum()
    return kept._replace(
        low=kept.low if value >= kept.low else float(value - rounding),
        high=kept.high if value <= kept.high else float(value + rounding),
    )


def _specialized(
    setup: Setup, carry: list[str], outputs: list[str], name: str, *, with_a_y: bool
) -> Tuned:
    step = setup.scan.step
    sampled_ports = SAMPLED if with_a_y else SAMPLED[:-1]
    ports = {port: ca.SX.sym(port, *step.size_in(port)) for port in carry}
    ports |= {port: ca.SX.sym(port, 2 if port in ("x", "u") else 1) for port in sampled_ports}
    signals = {"a_y": ca.SX(np.nan), **ports}
    sampled = {port: signals[port] for port in (*carry, *setup.scan.over)}
    rest = {port: value for port, value in setup.carry.items() if port not in carry}
    constants = {
        port: ca.DM(_matrix(value, step.size_in(port)))
        for port, value in (*setup.constants.items(), *rest.items())
    }
    results = step(**sampled, **constants)
    wanted = [*(f"{port}_next" for port in carry), *outputs]
    literal = ca.Function(
        name,
        list(ports.values()),
        [ca.densify(results[port]) for port in wanted],
        list(ports),
        wanted,
        {"cse": True},
    )
    return tuned(literal, sampled=sampled_ports)


def _matrix(value: Array, size: tuple[int, int]) -> Array:
    array = np.asarray(value, dtype=np.float64)
    return array if array.shape == tuple(size) else array.reshape(size)
