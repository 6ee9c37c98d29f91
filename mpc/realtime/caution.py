"""How much of what is not known of the tires the tracker fears: the numbers that its C reads.

With caution c the tracker plans with a grip of 1 - c (1 - g), where g is the least friction over
that of the tire that motion does not refute, and c times the band of the forces tightens the limits
along the plan. A wide band alone lowers no grip: the speed stays, and a plan that gives up grip
which is there leaves the path. The equations are in `mpc/c/tireid_mpc_caution.c`.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from codegen.arrays import Array
from mpc.tires.tire import DOUBT_STEP, PredictionTire, curve_slopes

N_GRIPS = 9  # frictions that are possible
_LEAST_GRIP = 0.25  # of the friction that a tire was learnt on: ice, after a dry road
SURPRISE = 8.0  # -2 ln of how likely a road is to change, as a supervisor has it
_FORCE_ERROR = 0.045  # static axle loads, of 0.2 s of motion: noise, load transfer, transients

GRIPS: Array = _LEAST_GRIP ** (np.arange(N_GRIPS) / (N_GRIPS - 1.0))


def set_caution(params: NDArray[Any], tire: PredictionTire, caution: float) -> None:
    """Write what the tracker fears of a tire; `max_slip` must have been written.
    caution : from 0 to 1.
    """
    if caution > 0.0 and tire.vehicle.has_downforce:
        raise ValueError(
            f"caution must be 0 for a car with downforce, whose bands are of static loads, it is "
            f"{caution:g}"
        )
    can = tire.structure.at_friction(tire.weights, 1.0) is not None
    params["caution"] = caution
    params["grips"] = GRIPS if can else 1.0
    params["surprise"] = SURPRISE
    params["doubt"], params["doubt_step"] = tire.doubt_or_declared(), DOUBT_STEP
    params["force_error"] = _FORCE_ERROR * np.array(tire.vehicle.axle_loads)
    params["stiffness"] = np.maximum(curve_slopes(tire)[0, 0], 0.1 * params["force_error"][0])
    params["prior"] = np.where(GRIPS < 1.0, SURPRISE, 0.0) if can else 0.0
