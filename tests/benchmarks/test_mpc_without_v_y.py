"""The benchmark without v_y compares drives that differ in their sensors alone."""

from dataclasses import replace

import pytest

from benchmarks.mpc_without_v_y import (
    DROPS,
    FRICTIONS,
    PATHS,
    TIRES,
    Result,
    cases_of,
    report,
)
from benchmarks.mpc_without_v_y import conditions as conditions_of_case
from benchmarks.targets import Targets
from mpc.loop.record import EstimateScores
from tireid.driving.runs import FULL, IMU, SENSORS

TOLD = EstimateScores(0.02, 0.06, 0.9, 0.97, 0.03)


def result(case, **other):
    told = TOLD if case.sensors == IMU else None
    noticed = 0.3 if case.path in DROPS else None
    return Result(True, 0.01, 0.03, noticed, told, [])._replace(**other)


def judged(change):
    """Targets after a change of what became of some drives of two seeds."""
    targets = Targets("mpc_without_v_y")
    report({case: result(case, **change(case)) for case in cases_of(2)}, 2, targets)
    return targets


def test_every_drive_has_its_twin_with_the_other_sensors():
    cases = cases_of(3)
    assert len(set(cases)) == len(cases) == 3 * 2 * (len(PATHS) * len(FRICTIONS) * len(TIRES) + 2)
    for case in cases:
        assert case._replace(sensors=IMU) in cases and case._replace(sensors=FULL) in cases


@pytest.mark.sweep("*iso-3888-2*")
@pytest.mark.parametrize("case", [one for one in cases_of(1) if one.sensors == FULL], ids=str)
def test_twins_differ_in_their_sensors_alone(case):
    full, imu = (conditions_of_case(case._replace(sensors=kind)) for kind in SENSORS)
    assert (full.kind, imu.kind) == (FULL, IMU)
    assert replace(imu, kind=FULL, setup=full.setup) == full
    assert imu.setup.mu == full.setup.mu == case.mu
    assert imu.setup.drops == full.setup.drops
    assert imu.setup.wish == full.setup.wish and imu.setup.path.name == full.setup.path.name


def test_good_drives_meet_every_target():
    targets = judged(lambda case: {})
    assert targets.missed == [] and targets.values["iso-3888-2/1/learning/ratio"] == 1.0


@pytest.mark.parametrize(
    ("change", "missed"),
    [
        (lambda case: {"rms": 0.014}, "rms deviation without v_y"),
        (lambda case: {"completed": case.seed > 0}, "completed with v_y alone"),
        (lambda case: {"alarms": [2.0]}, "alarms without a fault"),
        (lambda case: {"noticed": 0.6} if case.path in DROPS else {}, "until the drop is noticed"),
        (lambda case: {"noticed": None} if case.seed else {}, "drops that were noticed"),
    ],
)
def test_a_car_that_drives_worse_without_v_y_misses_its_target(change, missed):
    targets = judged(lambda case: change(case) if case.sensors == IMU else {})
    assert targets.missed and all(missed in label for label in targets.missed)
    assert targets.finish(keep=False) == 1
