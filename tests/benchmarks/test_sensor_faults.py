"""Sensors fail in compiled code as beside a car, and forces that stay wrong are told."""

import math
from dataclasses import replace

import numpy as np
import pytest

from benchmarks import sensor_faults
from benchmarks.fault_cases import Scale
from benchmarks.random_cars import CLASSES
from benchmarks.recorded_cars import DART
from benchmarks.sensor_faults import RIGHT, Result, random_fault, shown
from benchmarks.targets import Targets
from identifier.methods import LIVE, make_method
from identifier.run import OnlineIdentifier, identify
from models.faults import KINDS, SensorFault
from models.vehicle import sedan


@pytest.fixture(scope="module")
def drive():
    return sensor_faults.drive_of("sedan", 0)[0]


FAULTS = {
    "lost": SensorFault(channel="r", kind="lost", start=18.0, duration=1.5),
    "refused": SensorFault(channel="delta_f", kind="biased", start=18.0, duration=2.0, size=3.0),
    "biased": SensorFault(channel="v_y", kind="biased", start=18.0, duration=2.0, size=1.0),
}


@pytest.mark.sweep("biased", "refused")
@pytest.mark.parametrize("name", FAULTS)
def test_the_compiled_run_is_that_of_a_car_sample_by_sample(drive, name):
    """Beside a car samples that are no numbers are refused, and the forces go on, bit for bit."""
    fault, car = FAULTS[name], drive.car
    design, log = make_method(LIVE, car), drive.recording
    seen = shown(log, fault, car)
    history = identify(seen, car, design)
    online, broken = OnlineIdentifier(design, car, log.dt), fault.active(log.t)
    signals = {one: np.array(getattr(log, one)) for one in ("v_x", "v_y", "r", "delta_f")}
    good = signals[fault.channel]
    signals[fault.channel] = np.where(broken, fault.measured(log.t, good, math.nan, math.nan), good)
    first = None
    for k, t in enumerate(log.t):
        v_x, v_y, r, delta_f = (float(one[k]) for one in signals.values())
        force = online.update(np.array([v_y, r]), np.array([delta_f, 0.0]), v_x)
        if t > fault.start + fault.duration + 0.5:  # with a gap behind it
            np.testing.assert_array_equal(force, history.axle_force[k])
        if first is None and broken[k] and online.counts.refused:
            first = t - fault.start
    assert (online.counts.refused > 0) == (name != "biased")
    if first is not None:
        assert sensor_faults.noticed_after(history, fault) == pytest.approx(first)


def test_a_plain_fault_is_noticed_soon_and_harms_where_nobody_doubts(drive):
    fault = SensorFault(channel="v_y", kind="biased", start=18.0, duration=2.0, size=3.0)
    design = make_method(LIVE, drive.car)
    never = replace(design, change=replace(design.change, fast=sensor_faults.NEVER))
    seen = shown(drive.recording, fault, drive.car)
    watched, unwatched = (identify(seen, drive.car, one) for one in (design, never))
    errors = [
        sensor_faults.after_fault(drive, fault, one.axle_force) for one in (watched, unwatched)
    ]
    assert errors[0] < RIGHT < errors[1]
    assert sensor_faults.noticed_after(watched, fault) < 0.5


def test_faults_are_of_every_kind_and_of_the_size_of_the_car(drive):
    found = [random_fault(drive.car, np.random.default_rng(k)) for k in range(300)]
    assert {one.kind for one in found} == set(KINDS)
    assert {one.channel for one in found} == set(sensor_faults.SIZES)
    unit = {"v_x": Scale.of(DART).speed, "v_y": Scale.of(DART).speed, "delta_f": 1.0}
    unit["r"] = 1.0 / Scale.of(DART).time
    for k in range(100):
        large, little = (random_fault(car, np.random.default_rng(k)) for car in (sedan(), DART))
        factor = 1.0 if large.kind == "scaled" else unit[large.channel]
        assert little.size == pytest.approx(factor * large.size)
        assert large.start + large.duration + sensor_faults.AFTER + sensor_faults.LOOK <= 38.0


def test_forces_that_stay_wrong_and_faults_that_nobody_notices_miss_their_targets():
    fault = SensorFault(channel="v_y", kind="biased", start=18.0, duration=2.0, size=1.0)

    def missed(one, alarm=0.0):
        targets = Targets("sensor_faults")
        sensor_faults.report({kind: [one] * 4 for kind in CLASSES}, alarm, targets)
        return targets.missed

    good = Result(fault, 1.0, 50.0, 0.1)
    assert missed(good) == []
    for label, wrong, alarm in (
        ("forces right", good._replace(error=6.0), 0.0),
        ("harmful faults", good._replace(noticed=math.inf), 0.0),
        ("time in doubt", good, 0.02),
    ):
        (said,) = missed(wrong, alarm)
        assert said.startswith(label)
