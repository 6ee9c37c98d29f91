"""Limits of acceleration over speed (g-g-v) as raceline planners read them.

Planners take a_x/a_x,max + a_y/a_y,max <= 1. a_y,max is that of steady turning, and a_x,max is the
largest for which that diamond lies within the limits: min over q of a_x(q)/(1 - q), a_x(q) what
is left lengthwise at a_y = q a_y,max.
"""

import numpy as np

from codegen.arrays import Array
from codegen.escape import visible
from identifier.speed_limits import SHARES, Sides, speed_limits
from identifier.tire_model import TireModel


def diamond(side: Sides) -> Array:
    """Return the largest a_x of the diamond on one side, (n,) [m/s²]."""
    return (side.most[:, :-1] / (1.0 - SHARES[:-1])).min(axis=1)


def ggv_text(model: TireModel) -> str:
    """Return the table as planners read it: rows of v, a_x,max, a_y,max behind comments."""
    found = speed_limits(model)
    braking, driving = diamond(found.brake), diamond(found.push)
    table = np.column_stack([found.v, np.minimum(braking, driving), found.a_y])
    rows = [", ".join(f"{value:.3f}" for value in row) for row in table]
    return f"""\
# g-g-v of {visible(model.vehicle.name)}, by tireid from a driving log; friction as on that road.
# Lower end of a band of 90 % within twice the known slip: the force is lower in 5 % of cases.
# Tires are taken to grip lengthwise as sideways. Neither drag nor the engine is in it:
# ax_max_machines has that.
# ax_max is the smaller of braking ({braking.min():.2f} or more) and driving ({driving.min():.2f}),
# for dyn_model_exp = 1.0 (a diamond); with a larger one planners take more than the tires have.
# Ends at the fastest speed that was driven.
# v_mps, ax_max_mps2, ay_max_mps2
""" + "".join(f"{row}\n" for row in rows)
