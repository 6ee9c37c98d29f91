"""Load of an axle that the air presses on the road, over the static one, for compiled equations.

λ = 1 + κ v_x², with κ = ½ ρ A/F_z [s²/m²] of `Vehicle.downforce`; an axle that lifts keeps a fifth.
`Vehicle.load_ratio` is the same of numbers.
"""

from typing import Any

import casadi as ca

from models.vehicle import LIGHTEST


def load_ratio(downforce: Any, v_x: Any) -> Any:
    """Return λ [-] as a CasADi expression, of the shape of κ.

    Parameters
    ----------
    downforce : κ of both axles (2,), or of one [s²/m²].
    v_x : longitudinal speed [m/s].
    """
    pressed = 1 + downforce * v_x**2
    return ca.if_else(pressed > LIGHTEST, pressed, LIGHTEST)
