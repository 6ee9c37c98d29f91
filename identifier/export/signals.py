"""What the ports of a step mean: a unit and a few words on every field of an exported structure."""

from collections.abc import Mapping
from typing import NamedTuple

from identifier.axle import AxleDesign
from identifier.method import Method

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
    curves = isinstance(method, AxleDesign)
    known = {**PORTS, **AXLE_PORTS} if curves else PORTS
    unit, description = known.get(port, ("-", "state of the method"))
    rule = (AXLE_RULES if curves else RULES).get(port, "")
    return Signal(port, unit.replace("U", force_unit_text(method)), description, size, rule)
