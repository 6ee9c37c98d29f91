"""The tires while the car drives: samples in, a state out every 0.2 s.

The recursion is that of `tireid.identify`, `axle` where v_y is measured and `inertial` where not,
and gives the same bits for the same samples. Beside it another friction of the road is looked for
(`mpc.handover.road`), against the reference: the stored tires, or those that were identified live.
"""

import math
from collections import deque
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from codegen.arrays import Array
from identifier.axle.car import car_numbers
from identifier.axle.model import AxleModel, begun, on_another_day
from identifier.inertial import InertialIdentifier
from identifier.methods import LIVE as BY_V_Y
from identifier.methods import make_method
from identifier.run import DivergedError, OnlineIdentifier
from identifier.tire_model import AXLES, GRIP, STIFFNESS, TireModel
from identifier.verdict.judging import RULES
from identifier.verdict.verdict import PERCENT
from models.rules import require_kind
from models.vehicle import GRAVITY, Vehicle
from mpc.handover.judge import Judge, Window
from mpc.handover.road import RoadWatch
from mpc.handover.rules import Rules, Verdict
from mpc.tires import prediction_tire
from tireid.live.clock import Clock, Instant
from tireid.live.state import LIVE, SLIP, STORED, Counts, Point, State

EVERY = 0.2  # s between two states
OLD = 1.0  # s, age from which a sample says nothing of now
_MEMORY = 30.0  # s, over which excitation and model error are remembered
_LOST = 0.9  # of the friction of the reference, below which the driver is alarmed
_NO_FORCE = np.zeros(2)


class _Means(NamedTuple):
    """Of the samples since the last state: sums, and the impulses at the first sample [s], (2,)."""

    n: int
    slip: Array
    force: Array
    turning: float
    begin: Array

# (continued)
