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
from mpc.realtime.chosen import CHOSEN
from mpc.tires.chosen import CHOSEN as TIRES_CHOSEN
from mpc.tires.tire import Car, Point, PredictionTire, curve_slopes

GRIPS: Array = CHOSEN.least_grip ** (np.arange(CHOSEN.n_grips) / (CHOSEN.n_grips - 1.0))


def set_caution(params: NDArray[Any], tire: PredictionTire, caution: float) -> None:
    """Write what the tracker fears of a tire; `max_slip` must have been written.
    caution : from 0 to 1.
    """
    if caution > 0.0 and tire.vehicle.has_downforce:
        raise ValueError(
            f"caution must be 0 for a car with downforce, whose bands are of static loads, it is "
            f"{caution:g}"
        )
    can = _offers_friction(tire)
    params["caution"] = caution
    params["grips"] = GRIPS if can else 1.0
    params["surprise"] = CHOSEN.surprise
    params["doubt"], params["doubt_step"] = tire.doubt_or_declared(), TIRES_CHOSEN.doubt_step
    params["force_error"] = CHOSEN.force_error * np.array(tire.vehicle.axle_loads)
    params["stiffness"] = np.maximum(curve_slopes(tire)[0, 0], 0.1 * params["force_error"][0])
    params["prior"] = np.where(GRIPS < 1.0, CHOSEN.surprise, 0.0) if can else 0.0


def _offers_friction(tire: PredictionTire) -> bool:
    numbers = Car(*tire.car)
    return tire.structure.similar(Point(0.0, 0.0, 0.0, 1.0, numbers, tire.weights), 1.0) is not None
