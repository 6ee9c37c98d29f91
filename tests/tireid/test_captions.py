"""Captions of figures: their numbers are those of the data that is drawn."""

from dataclasses import replace

import numpy as np
import pytest

import tireid as ti
from models.logs.signals import Signal
from models.recordings import LogMap, read_recording
from tireid.reports.captions import force_caption, slip_caption
from tireid.reports.identify import went_in


@pytest.fixture(scope="module")
def log(logs):
    return read_recording(logs / "slalom.csv")


@pytest.fixture(scope="module")
def run(log):
    return ti.identify(log, ti.sedan())


def test_an_error_that_was_planted_is_named_by_size_time_and_axle(log, run):
    force = 1.1 * log.axle_force
    assert "error 10.0 / 10.0 % of the true force" in force_caption(log, force, run.tire, None)
    force[500, 1] += 5000.0
    said = force_caption(log, force, run.tire, None)
    assert f"at {log.t[500]:.4g} s, rear" in said


def test_points_outside_the_band_are_counted_where_they_are(log, run):
    tire = run.tire
    slip = tire.lagged_slip(log)
    on_curve = np.stack([tire.force(slip[:, k])[:, k] for k in (0, 1)], axis=1)
    said = slip_caption(tire, replace(log, axle_force=on_curve))
    assert "0 / 0 % of the true forces" in said and "most" not in said
    far = np.abs(slip) > 0.8 * tire.known_slip
    said = slip_caption(tire, replace(log, axle_force=on_curve + 9e3 * far))
    front, rear = 100.0 * far.mean(axis=0)
    assert f"{front:.0f} / {rear:.0f} % of the true forces lie outside" in said
    assert "most near the end of the identified slip" in said


def test_a_report_lists_the_car_and_its_channels(run):
    car = replace(run.tire.vehicle, estimated=("cornering_stiffness_rear",))
    steering = Signal(channel=("Wheel",), unit="deg", ratio=15.0)
    given = LogMap(signals={"delta_f": steering})
    numbers, channels = went_in(replace(run.tire, vehicle=car), given)
    said = {name: row for name, *row in numbers.rows}
    assert said["l_f"] == [f"{car.l_f:.6g} m", "declared"]
    assert said["cornering_stiffness_rear"][-1] == "estimated, not used by this method"
    assert channels.rows == [["delta_f", "Wheel", "deg, ratio 15"]]
