"""The benchmark of forgetting: its drives, what it calls an error, and that its alarm rings."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks import forgetting
from benchmarks.forgetting import (
    SCENARIOS,
    After,
    Minutes,
    designs,
    drive,
    hours,
    left_of,
    of_random_cars,
    of_the_sedan,
    random_car,
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


def test_minutes_follow_each_other_without_a_jump():
    parts = tuple(
        forgetting.RandomSteer(
            amplitude=0.05, frequency=0.3, seed=k, onset=0.0, rate_limit=0.5, duration=60.0
        )
        for k in range(3)
    )
    found = Minutes(parts=parts)
    assert found.duration == 180.0
    angles = found.steering(np.arange(0.0, 180.0, 1e-3))
    assert np.abs(np.diff(angles, axis=0)).max() < 1e-3 * 0.2
    assert np.abs(angles[::60000]).max() == 0.0
    halves = [np.abs(angles[60000 * k : 60000 * (k + 1)]).max() for k in range(3)]
    assert min(halves) > 0.02


def test_calm_minutes_are_calm_and_brisk_ones_are_not():
    plant, sizes = Plant(CAR), {}
    for share in (0.0, 1.0):
        recording = drive(plant, np.random.default_rng(0), share, 1.0)
        sizes[share] = np.abs(recording.delta_f).max()
        assert recording.t[-1] == pytest.approx(360.0)
    assert sizes[1.0] <= np.radians(1.01) < np.radians(2.0) < sizes[0.0]


def test_an_hour_is_driven_again_with_other_noise(monkeypatch):
    monkeypatch.setattr(forgetting, "MINUTES", 1)
    monkeypatch.setattr(forgetting, "PER_HOUR", 2)
    counts = {}
    for scenario in SCENARIOS:
        rng = np.random.default_rng(1)
        found = list(hours(Plant(CAR), rng, scenario, mu=1.0, drives=4))
        counts[scenario] = len(found)
        first, again = found[-4], found[-2]
        np.testing.assert_array_equal(first.axle_force, again.axle_force)
        assert (first.v_y != again.v_y).any()
        assert (first.axle_force != found[-3].axle_force).any()
    assert counts == {"ordinary": 4, "calm": 5}


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


def test_the_leakage_is_that_of_the_paper_and_random_cars_are_told_wrong():
    chosen = designs(CAR)
    assert chosen["leakage"] == make_method("integral", CAR)
    assert list(chosen) == list(KEEPINGS)
    cars = [random_car(np.random.default_rng(k))[0] for k in range(5)]
    per_load = [car.cornering_stiffness_front / car.axle_loads[0] for car in cars]
    assert np.ptp(per_load) > 1.0


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
