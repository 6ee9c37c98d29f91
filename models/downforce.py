"""Load of an axle that the air presses on the road, over the static one, for compiled equations.

λ = 1 + κ v_x², with κ = ½ ρ A/F_z [s²/m²] of `Vehicle.downforce`; an axle that lifts keeps a fifth.
`Vehicle.load_ratio` is the same of numbers.
"""

from typing import Any

import casadi as ca

from models.vehicle import LIGHTEST


def load_ratio(downforce: Any, v_x: Any) -> Any:
    """Return λ (2,) [-] as a CasADi expression.

    Parameters
    ----------
    downforce : κ (2,) [s²/m²].
    v_x : longitudinal speed [m/s].
    """
    pressed = 1 + downforce * v_x**2
    return ca.if_else(pressed > LIGHTEST, pressed, LIGHTEST)
