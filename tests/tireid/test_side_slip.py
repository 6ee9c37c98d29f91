"""Side slip that methods tell: its error by another road, in tables, files, reports and figures."""

from dataclasses import replace

import numpy as np
import pytest

from identifier.compare.course import Course, SideSlip, cross_replay, side_slip
from identifier.methods import make_method
from identifier.run import identify
from models.recordings import read_recording
from models.vehicle import sedan
from tests.rivals import INSTALLED
from tireid.figures.side_slip import side_slip_figure

CAR = sedan()
TOLD = (*("linear_kf", "joint_ekf") * INSTALLED, "inertial")


@pytest.fixture(scope="module")
def slalom(logs):
    return read_recording(logs / "slalom.csv")


def test_a_sample_too_slow_does_not_count_and_one_that_is_off_does(slalom):
    history = identify(slalom, CAR, make_method("inertial", CAR))
    found = side_slip(history, 1.0, slalom.v_y)
    moved = slalom.v_y.copy()
    moved[100] += 9.0
    assert side_slip(history, 1.0, moved).rms > found.rms + 0.2
    v_x = slalom.v_x.copy()
    v_x[100] = 0.5
    slow = replace(history, recording=replace(slalom, v_x=v_x))
    assert side_slip(slow, 1.0, moved).rms == pytest.approx(found.rms, rel=0.01)
    linear = identify(slalom, CAR, make_method("linear", CAR))
    assert side_slip(linear, 1.0, slalom.v_y) is None


def test_a_method_that_has_diverged_has_an_infinite_error(slalom):
    history = identify(slalom, CAR, make_method("inertial", CAR))
    outputs = {port: np.full_like(value, np.nan) for port, value in history.outputs.items()}
    found = side_slip(replace(history, outputs=outputs), 1.0, slalom.v_y)
    assert found.rms == np.inf and found.within == 0.0


@pytest.mark.parametrize("name", [*TOLD, "axle"])
def test_a_comparison_shows_no_lateral_velocity_to_a_method_that_tells_it(name, slalom, rng):
    wrong = replace(slalom, v_y=rng.permutation(slalom.v_y))
    method = make_method(name, CAR)
    found, other = (
        cross_replay(method, Course(vehicle=CAR, recordings=(one,), min_speed=1.0)).online
        for one in (slalom, wrong)
    )
    assert (found == other) == (name != "axle")


def made_up(recording, scale, sd=None):
    return SideSlip(
        v_y=scale * recording.v_y,
        v_y_sd=None if sd is None else np.full(len(recording), sd),
        rms=abs(scale - 1.0),
        within=None if sd is None else 90.0,
    )


def band_of(axes):
    (band,) = axes.collections
    return np.ptp(band.get_paths()[0].vertices[:, 1])


def test_the_figure_has_truth_band_and_estimates(slalom):
    name = slalom.name
    slow, fast = made_up(slalom, 0.5, sd=0.01), made_up(slalom, 1.2, sd=0.3)
    told = {"linear_kf": {name: slow}, "inertial": {name: fast}, "axle": {}}
    (axes,) = side_slip_figure([slalom], told).axes
    assert axes.get_ylabel() == "side slip [deg]"
    labels = axes.get_legend_handles_labels()[1]
    assert set(labels) == {"within 2 standard deviations", "recorded", "linear kf", "inertial"}
    lines = {line.get_label(): line.get_ydata() for line in axes.lines}
    exact = np.degrees(np.arctan(slalom.v_y / slalom.v_x))
    np.testing.assert_allclose(lines["recorded"], exact, atol=1e-9)
    for label, scale in (("linear kf", 0.5), ("inertial", 1.2)):
        drawn = np.degrees(np.arctan(scale * slalom.v_y / slalom.v_x))
        np.testing.assert_allclose(lines[label], drawn, atol=1e-9)
    reach = np.degrees(np.arctan(0.6 / 20.0))  # two standard deviations, both sides of the largest
    assert band_of(axes) > 2.0 * reach
    without = side_slip_figure([slalom], {"linear_kf": {name: slow}}).axes[0]
    assert band_of(without) < band_of(axes)
