"""The benchmark of forgetting: its drives, what it calls an error, and that its alarm rings."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks import forgetting
from benchmarks.forgetting import (
    After,
    left_of,
    of_random_cars,
    of_the_sedan,
)
from benchmarks.targets import Targets
from identifier.methods import make_method
from identifier.stability.gain_design import KEEPINGS
from models.maneuvers import Slalom
from models.plant import Plant
from models.vehicle import sedan

CAR = sedan()


@pytest.fixture(name="slalom", scope="module")
def a_slalom():
    maneuver = Slalom(amplitude=0.05, frequency=0.5, onset=1.0, rate_limit=0.5, duration=10.0)
    return Plant(CAR).simulate(maneuver, speed=20.0).recording()


def test_the_error_is_the_share_of_the_force_that_is_missed(slalom):
    design = make_method("integral", CAR)
    model = design.frozen(CAR, design.setup(CAR).carry)  # W = 0: the linear tire
    C = [CAR.cornering_stiffness_front, CAR.cornering_stiffness_rear]
    speeds = np.column_stack([slalom.v_y + 1.15 * slalom.r, slalom.v_y - 1.55 * slalom.r])
    missed = (slalom.u - speeds / slalom.v_x[:, None]) * C - slalom.axle_force
    share = 100.0 * np.linalg.norm(missed) / np.linalg.norm(slalom.axle_force)
    left = left_of(model, [slalom, slalom])
    assert left.error == pytest.approx(share, rel=1e-9)
    assert left.W == 0.0 < left.V


@pytest.mark.parametrize(("error", "missed"), [(20.0, 0), (40.0, 1)])
def test_a_default_that_forgets_misses_its_target(error, missed):
    def car(default):
        rows = {name: {h: After(18.0, 1.0, 5.0) for h in ("3", "10")} for name in KEEPINGS}
        rows["linear"] = {h: After(45.0, 0.0, 5.0) for h in ("3", "10")}
        rows[forgetting.DEFAULT_KEEPING] = {h: After(default, 1.0, 5.0) for h in ("3", "10")}
        return rows

    targets = Targets("forgetting")
    of_the_sedan(targets, "ordinary", car(error))
    assert len(targets.missed) == missed
    targets = Targets("forgetting")
    of_random_cars(targets, "ordinary", [car(18.0 if error == 20.0 else 40.0)] * 3)
    assert len(targets.missed) == missed
    assert replace(targets).values["cars/ordinary/linear/median"] == 45.0
