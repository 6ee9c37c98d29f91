"""The variables of the FMU, the same in FMI 2.0 and 3.0.

Value references and states are those of sources/memory.h.
"""

from collections.abc import Mapping
from typing import Literal, NamedTuple

from identifier.export.fold import FoldedStep

# What a unit is made of in SI, as attributes of BaseUnit; a radian counts as one of its own.
UNITS: Mapping[str, Mapping[str, int]] = {
    "s": {"s": 1},
    "m/s": {"m": 1, "s": -1},
    "rad": {"rad": 1},
    "rad/s": {"rad": 1, "s": -1},
    "N": {"kg": 1, "m": 1, "s": -2},
}
DEGREES = 57.29577951308232  # of a radian: display units of angles

Kind = Literal["real", "integer", "boolean"]
Causality = Literal["input", "output", "parameter", "local"]


class Variable(NamedTuple):
    """One variable of modelDescription.xml.

    reference : value reference.   start : as text, empty where it is calculated.
    """

    reference: int
    name: str
    kind: Kind
    causality: Causality
    variability: Literal["continuous", "discrete", "tunable", "constant"]
    start: str
    unit: str
    description: str


def variables(folded: FoldedStep) -> tuple[Variable, ...]:
    """Return the variables of a step.

    Parameters
    ----------
    folded : the step.
    """
    inputs = (
        Variable(1 + i, port.name, "real", "input", "continuous", "0", port.unit, port.description)
        for i, port in enumerate(folded.inputs)
    )
    side = "left positive, frame of the body"
    learnt = ", ".join(folded.learnt) or "nothing: this method has no memory of the tire"
    return (
        *inputs,
        _output(6, "F_yf", "real", "N", f"lateral force of the front axle, {side}"),
        _output(7, "F_yr", "real", "N", f"lateral force of the rear axle, {side}"),
        _output(
            8,
            "status",
            "integer",
            "",
            "of the last sample: 0 taken; 1 below the minimum speed, forces are zero; 2 it is one "
            "that no car can be in, not learnt from; 3 an input or 4 a result is not finite or "
            "beyond what any car reaches, nothing is learnt; 6 that for half a second or more, "
            "forces are zero",
        ),
        _output(9, "samples", "integer", "", "number of samples taken, those ignored included"),
        Variable(
            10,
            "adaptation",
            "boolean",
            "parameter",
            "tunable",
            "true",
            "",
            f"whether it learns; false holds {learnt}",
        ),
        _constant(11, "sample_time", "s", folded.dt, "sampling interval, inside and fixed"),
        _constant(
            12, "min_speed", "m/s", folded.min_speed, "below it forces are zero, learning rests"
        ),
    )


def _output(reference: int, name: str, kind: Kind, unit: str, description: str) -> Variable:
    return Variable(reference, name, kind, "output", "discrete", "", unit, description)


def _constant(reference: int, name: str, unit: str, value: float, description: str) -> Variable:
    return Variable(
        reference, name, "real", "local", "constant", repr(float(value)), unit, description
    )
