"""Lap after lap: drive on the identified tires, learn from the lap, go again.

The share of the limits grows where the car's own sensors saw it stay near its path, and shrinks
where they did not; the limits themselves grow slowly, whatever was learnt.
"""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from identifier.speed_limits import SpeedLimits, speed_limits
from identifier.tire_model import TireModel
from models.vehicle import Vehicle
from mpc.cars import BRAKES
from mpc.path import Path, SpeedProfile, speed_profile
from mpc.path.speed import SHARE
from tireid.driving.runs import ClosedLoop, drive
from tireid.driving.setup import PERIOD, simulated
from tireid.learning import identify
from tireid.run import Run

_BEYOND_KNOWN = 1.1  # times the force within the known slip, on the first lap
_LIMITS_GROW = 1.03  # from lap to lap, at most
_GROWS, _SHRINKS = 1.03, 0.97  # of the share, from lap to lap
_MOST = 0.95  # of the limits
_NEAR = 0.10  # m from the path, as the car sees it, up to which it may go faster
_SEEN = 0.2  # s, over which what it sees is averaged


class Lap(NamedTuple):
    """A lap that was driven.

    tire : that it was planned and steered on.   share : of the limits.   seen : largest deviation
    from the path as the car saw it [m].   learnt : from the lap; None where it was not completed.
    """

    tire: TireModel
    limits: SpeedLimits
    share: float
    profile: SpeedProfile
    driven: ClosedLoop
    seen: float
    learnt: Run | None


def first_limits(tire: TireModel, confidence: float = 0.95) -> SpeedLimits:
    """Return the limits of a first lap: hardly beyond what the tires are known to give."""
    known = float(speed_limits(tire, confidence=confidence, beyond=1.0).a_y[0])
    return speed_limits(tire, confidence=confidence).at_most(_BEYOND_KNOWN * known)


def drive_laps(
    path: Path,
    vehicle: Vehicle,
    tire: TireModel,
    laps: int,
    *,
    share: float = SHARE,
    planned: Mapping[str, Any] | None = None,
    road: float = 1.0,
    confidence: float = 0.95,
    seed: int = 0,
    **driven: Any,
) -> Iterator[Lap]:
    """Yield lap after lap, until one is not completed.

    A lap that speaks against its tires teaches nothing.

    planned : engine, brakes and v_max, as of `speed_profile`.
    road : friction that the first lap is planned for, over that of the identified tires.
    confidence : as of `speed_limits`.   driven : as of `drive`.
    """
    if "tires" not in driven:  # the same on every lap
        vehicle, driven["tires"] = simulated(vehicle, tire)
    limits = first_limits(tire, confidence).scaled(road)
    for number in range(laps):
        profile = speed_profile(path, limits, share=share, **(planned or {"brakes": BRAKES}))
        loop = drive(path, vehicle, tire, speeds=profile, seed=seed + number, **driven)
        n = min(round(_SEEN / PERIOD), len(loop.drive))
        averaged = np.convolve(loop.drive.e_y_seen, np.full(n, 1.0 / n), mode="valid")
        learnt, seen = None, float(np.abs(averaged).max())
        if loop.scores.completed:
            learnt = identify(loop.drive.recording(), vehicle, start=tire, check=False)
        yield Lap(tire, limits, share, profile, loop, seen, learnt)
        if learnt is None:
            return
        share = min(_MOST, _GROWS * share) if seen <= _NEAR else _SHRINKS * share
        if learnt.verdict.valid:
            tire = learnt.tire
            limits = speed_limits(tire, confidence=confidence).at_most(
                _LIMITS_GROW * float(limits.a_y[0])
            )
