"""The car in units of its static axle loads, where mass drops out of the equations.

Rows are axles, front and rear.   F_z = m g l_o/L: static load [N], l_o distance to the other axle.
φ = F_y/F_z [-].   ξ_i = v_y/g ± I_z r/(L F_z,i) [s], the axle impulse of (7) over F_z, obeys
dξ_i/dt = φ_i cos δ_i - v_x r/g exactly: one axle, one equation, no stiffness in it.
"""

from dataclasses import is_dataclass
from types import SimpleNamespace
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from codegen.arrays import Array
from models.vehicle import GRAVITY, Vehicle


class Car(NamedTuple):
    """Columns (2, 1), numbers or symbols: front and rear.
    arm : l_f and -l_r [m].   share : of the weight on the axle [-].
    inertia : ±I_z/(L F_z) [s²/rad].   load : F_z [N].
    """

    arm: Any
    share: Any
    inertia: Any
    load: Any


def car_numbers(vehicle: Vehicle) -> Array:
    """Return the columns of `Car` (2, 4)."""
    load = np.array(vehicle.axle_loads)
    yaw = np.array([1.0, -1.0]) * vehicle.yaw_inertia / (vehicle.wheelbase * load)
    arm = np.array([vehicle.l_f, -vehicle.l_r])
    columns = Car(arm=arm, share=load / vehicle.weight, inertia=yaw, load=load)
    return np.column_stack(columns)


def axle_impulse(car: Car, v_y: Any, r: Any) -> Any:
    """Return ξ [s], (2,).
    v_y : lateral velocity [m/s].   r : yaw rate [rad/s].
    """
    return v_y / GRAVITY + car.inertia * r


# Downforce: an axle of κ pushes as one of λ = 1 + κ v_x² static loads, F = F_z λ φ(α); λ is
# `models.vehicle.load_ratio`. Steps of cars without have neither the port nor the product.


def downforce_numbers(vehicle: Vehicle) -> dict[str, Array]:
    """Return the constant that a step of a car with downforce has beside; {} of one without.
    vehicle : the car; `downforce` holds its κ (2,) [s²/m²].
    """
    return {"downforce": np.array(vehicle.downforce)} if vehicle.has_downforce else {}


# Ports of a compiled step whose numbers have names: a NamedTuple says what is in a vector.
#
# Numbers are computed once in Python and read by name in the equations, where they are symbols.


def symbols(**shapes: Any) -> tuple[dict[str, Any], SimpleNamespace]:
    """Return the symbols of a step by port, in order, and its numbers by the name of the port.
    shapes : of each port its rows, or (rows, columns); a NamedTuple or dataclass in place of a
        length says what is in the vector, or in the columns: these are the numbers of the port.
    """
    ports: dict[str, Any] = {}
    numbers: dict[str, Any] = {}
    for name, shape in shapes.items():
        rows, last = shape if isinstance(shape, tuple) else (None, shape)
        fields: tuple[str, ...] = ()
        if not isinstance(last, int):
            fields = tuple(last.__dataclass_fields__) if is_dataclass(last) else last._fields
        k = len(fields) or last
        port = ca.SX.sym(name, k) if rows is None else ca.SX.sym(name, rows, k)
        ports[name] = numbers[name] = port
        if fields:
            split = ca.vertsplit(port) if rows is None else ca.horzsplit(port)
            named = dict(zip(fields, split, strict=True))
            numbers[name] = SimpleNamespace(**named) if is_dataclass(last) else last(**named)
    return ports, SimpleNamespace(**numbers)


def step_function(
    name: str, ports: dict[str, Any], carried: dict[str, Any], outputs: dict[str, Any]
) -> ca.Function:
    """Return a step: what it carries comes out as `port_next`, before its outputs."""
    out = {f"{port}_next": value for port, value in carried.items()} | outputs
    given, found = list(ports.values()), list(out.values())
    return ca.Function(name, given, found, list(ports), list(out), {"cse": True})


# Larger, smaller, within: as comparisons, since fmin and fmax of C are calls that cost more.
#
# And one division for many quotients: CasADi writes x (1/y) as x/y, once for each x.


def larger(a: Any, b: Any) -> Any:
    """Return the larger of two, where neither is NaN.
    b : expression of the same shape, or a number.
    """
    return ca.if_else(a > b, a, b)


def smaller(a: Any, b: Any) -> Any:
    """Return the smaller of two, where neither is NaN.
    b : expression of the same shape, or a number.
    """
    return ca.if_else(a < b, a, b)


def within(a: Any, least: Any, most: Any) -> Any:
    """Return a number clipped to a range."""
    return smaller(larger(a, least), most)


def reciprocal(x: Any) -> Any:
    """Return 1/x, rounded once, as a number that products share; 1 where x is 1."""
    return 2 / (x + x)
