"""Pictures of a drive: units on every axis, nothing cut off, one scale for maps, a moving film."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image, ImageSequence

from models.faults import SensorFault
from models.vehicle import Vehicle, sedan
from mpc.loop.record import Drive, Plan
from mpc.path import Path
from mpc.tires import prediction_tire
from mpc.tires.tire import curves_at
from tests.tireid.test_drive_setup import COURSE
from tireid.driving.runs import Known
from tireid.figures import film
from tireid.figures.drive import (
    car_shape,
    drive_errors_figure,
    drive_path_figure,
    drive_solve_figure,
    drive_steering_figure,
)
from tireid.figures.tires import TireCurve, axle_slip, drive_tires_figure

CAR = sedan()
SPEED, PERIOD = 16.0, 0.02
LANE_X = np.linspace(0.0, 120.0, 81)
LANE = Path.from_waypoints(
    LANE_X, 1.75 * (np.tanh((LANE_X - 40) / 6) - np.tanh((LANE_X - 90) / 6)), name="lane"
)
LANE = replace(LANE, cones=np.array([[20.0, 1.2], [20.0, -1.2], [65.0, 4.8], [65.0, 2.2]]))


def made_up(path, off):
    """A drive with invented signals that is `off` [m] to the left of its path on the average."""
    t = np.arange(0.0, path.length / SPEED, PERIOD)
    s, wave, none = SPEED * t, np.sin(2.0 * t), np.zeros_like(t)
    X, Y, psi = path.pose(s)
    e_y = off * (1.0 + 0.2 * wave)
    kappa = path.curvature(s)
    force = CAR.mass * SPEED**2 * kappa
    share = np.array(CAR.axle_loads) / CAR.weight
    plans = tuple(
        Plan(k, s[k] + 0.8 * np.arange(41), np.full((41, 5), e_y[k]), np.zeros(40))
        for k in range(0, t.size, 4)
    )
    status = np.zeros(t.size, dtype=np.int64)
    status[7] = 2
    return Drive(
        name=path.name,
        vehicle=CAR,
        path=path,
        period=PERIOD,
        t=t,
        X=X - e_y * np.sin(psi),
        Y=Y + e_y * np.cos(psi),
        psi=psi,
        v_x=np.full(t.size, SPEED),
        v_y=none,
        r=SPEED * kappa,
        a_x=none,
        a_y=SPEED**2 * kappa,
        delta=CAR.wheelbase * kappa,
        axle_force=force[:, None] * share,
        s=s,
        e_y=e_y,
        e_y_seen=e_y,
        e_psi=none,
        kappa=kappa,
        v_ref=np.full(t.size, SPEED),
        command=CAR.wheelbase * kappa,
        measured={},
        status=status,
        solve_time=1e-4 * (1.0 + 0.1 * wave),
        plans=plans,
        notes=(),
        completed=True,
        ending="reached the end",
    )


ON_LANE = {"frozen": made_up(LANE, 0.1), "linear": made_up(LANE, 1.9)}
ON_COURSE = {"frozen": made_up(COURSE, 0.1), "linear": made_up(COURSE, -0.8)}
ALPHA = np.linspace(-0.3, 0.3, 31)
SLIP = axle_slip(ON_LANE["frozen"])
CURVES = [
    TireCurve(label=label, alpha=ALPHA, force=np.column_stack([1e5 * ALPHA, 8e4 * ALPHA]))
    for label in ("frozen", "linear", "oracle")
]
FIGURES = {
    "lane": lambda: drive_path_figure(ON_LANE),
    "course": lambda: drive_path_figure(ON_COURSE),
    "errors": lambda: drive_errors_figure(ON_LANE, off_path=2.0, drops=[(60.0, 0.5)]),
    "steering": lambda: drive_steering_figure(ON_LANE, angle_limit=0.5, rate_limit=0.01),
    "tires": lambda: drive_tires_figure(ON_LANE["frozen"], CURVES),
    "solve times": lambda: drive_solve_figure(ON_LANE["frozen"]),
}


def test_every_axle_has_its_own_curves_and_cloud():
    drive, figure = ON_LANE["frozen"], FIGURES["tires"]()
    slip = [
        drive.delta - np.arctan((drive.v_y + CAR.l_f * drive.r) / drive.v_x),
        -np.arctan((drive.v_y - CAR.l_r * drive.r) / drive.v_x),
    ]
    for axle, axes in enumerate(figure.axes[:2]):
        cloud, *curves = axes.lines
        np.testing.assert_allclose(np.radians(cloud.get_xdata()), slip[axle], atol=1e-12)
        np.testing.assert_allclose(1e3 * cloud.get_ydata(), drive.axle_force[:, axle], atol=1e-6)
        assert [line.get_label() for line in curves] == ["frozen", "linear", "oracle"]
        for line in curves:
            stiffness = 1e3 * np.diff(line.get_ydata()) / np.diff(np.radians(line.get_xdata()))
            np.testing.assert_allclose(stiffness, (1e5, 8e4)[axle])


@pytest.mark.parametrize("drives", [ON_LANE, ON_COURSE], ids=["lane", "course"])
def test_maps_have_one_scale_and_show_the_whole_path(drives):
    figure = drive_path_figure(drives)
    figure.canvas.draw()
    assert all(axes.get_aspect() == 1.0 for axes in figure.axes)
    rows = [axes for axes in figure.axes if not axes.get_title()]
    path = drives["frozen"].path
    shown = path.cones[:, 0] if len(path.cones) else path.X
    assert min(axes.get_xlim()[0] for axes in rows) < shown.min()
    assert max(axes.get_xlim()[1] for axes in rows) > shown.max()


def test_a_car_turned_left_has_its_nose_up_and_its_wheels_turned_further():
    shape = car_shape(CAR, 10.0, 5.0, np.radians(90.0), np.radians(20.0))
    assert shape.body[:, 1].max() - 5.0 > CAR.l_f > 5.0 - 5.0
    assert np.ptp(shape.body[:, 0]) == pytest.approx(1.82, abs=0.02)
    front, rear = shape.wheels[0], shape.wheels[2]
    along = (front[0] - front[1], rear[0] - rear[1])
    angles = [np.degrees(np.arctan2(y, x)) for x, y in along]
    assert angles == pytest.approx([110.0, 90.0])
    assert shape.wheels[0][:, 0].mean() < 10.0 < shape.wheels[1][:, 0].mean()  # left, right


def test_the_camera_sees_what_is_ahead_to_the_right_and_left_above():
    for path, s in ((LANE, 30.0), (COURSE, 200.0)):
        X, Y, psi = (float(value) for value in path.pose(s))
        drive = made_up(path, 0.0)
        view = film.camera(drive, int(np.searchsorted(drive.s, s)))
        here = view.transform((X, Y))
        ahead = view.transform((X + np.cos(psi), Y + np.sin(psi))) - here
        left = view.transform((X - np.sin(psi), Y + np.cos(psi))) - here
        assert ahead[0] > 0.9 and left[1] > 0.9
        assert abs(here[0]) < 0.5


def test_of_a_model_car_the_picture_has_less_ground():
    small = Vehicle(mass=1.6, l_f=0.08, l_r=0.09).with_chassis()
    wide = []
    for car in (CAR, small):
        figure = Figure(figsize=film.SIZE)
        film.draw(
            figure,
            film.Film("made up", {"frozen": replace(made_up(LANE, 0.0), vehicle=car)}, CURVES),
            1.0,
        )
        wide.append(np.ptp(figure.axes[0].get_xlim()))
    assert wide[0] == film.BEHIND + film.AHEAD
    assert wide[1] / wide[0] == pytest.approx(small.wheelbase / CAR.wheelbase, rel=0.1)


@pytest.mark.parametrize(("drives", "kind"), [(ON_LANE, "webp"), (ON_COURSE, "gif")])
def test_the_film_is_small_and_moves_and_holds_its_end(drives, kind, tmp_path, monkeypatch):
    monkeypatch.setattr(film, "MOST", 4)
    file = tmp_path / f"drive.{kind}"
    film.write_film(file, film.Film("made up", drives, CURVES))
    with Image.open(file) as shown:
        frames = [
            (np.array(frame.convert("RGB")), frame.info["duration"])
            for frame in ImageSequence.Iterator(shown)
        ]
        assert shown.info["loop"] == 0 and shown.size == (960, 600)
    assert file.stat().st_size < 5e4 * 4
    for (before, _), (after, _) in pairwise(frames[:4]):
        assert (before != after).any()
    assert sum(duration for _, duration in frames[3:]) >= 100 * film.HOLD


def ends_of(axes):
    """Where what is shaded begins and ends, and by which label."""
    turn = axes.transData.inverted()
    boxes = [(one.get_extents().transformed(turn), one.get_label()) for one in axes.patches]
    return [(box.x0, box.x1, label) for box, label in boxes]


def picture(t, *parts):
    """The panels of the axles in a picture of a film."""
    figure = Figure()
    film.draw(figure, film.Film("made up", *parts), t)
    return figure.axes[1:3]


TIRE = prediction_tire(CAR)
GROWN = np.linspace(0.2, 1.0, 11)
KNOWN = [
    Known(0.5 * k, 0.5 * g * TIRE.weights, g * TIRE.weights, np.radians([g, 2.0 * g]) / 10.0)
    for k, g in enumerate(GROWN)
]


@pytest.mark.parametrize("t", [0.0, 2.3, 4.7])
def test_the_film_shows_the_curves_as_they_were_known_then(t):
    known = KNOWN[int(t / 0.5)]
    for axle, axes in enumerate(picture(t, ON_LANE, CURVES, (), KNOWN, TIRE)):
        drawn = curves(axes)
        for label, weights in (
            ("identified so far", known.learnt),
            ("used by the tracker", known.steering),
        ):
            slip, force = drawn[label].T
            expected = curves_at(TIRE._replace(weights=weights), np.radians(slip))[axle]
            np.testing.assert_allclose(1e3 * force, expected, atol=1e-6)
        edges = sorted(end for *ends, _ in ends_of(axes) for end in ends)
        known_to = np.degrees(known.slip[axle])
        reach = axes.get_xlim()[1]
        assert edges == pytest.approx([-reach, -known_to, known_to, reach], abs=1e-6)


def test_the_film_shows_force_over_slip_up_to_now_of_each_axle():
    drive = ON_LANE["frozen"]
    for axle, axes in enumerate(picture(3.0, ON_LANE, CURVES)):
        (x,), (y,) = axes.lines[-1].get_data()
        k = int(np.searchsorted(drive.t, 3.0))
        assert (1e3 * y, np.radians(x)) == pytest.approx((drive.axle_force[k, axle], SLIP[k, axle]))


def test_the_true_curve_of_a_film_is_that_of_the_road_that_the_car_is_on():
    later = CURVES[2]._replace(label="oracle at the end", force=0.5 * CURVES[2].force)
    hindsight = CURVES[0]._replace(label="frozen at the end", force=9.0 * CURVES[0].force)
    for t, share in ((1.0, 1.0), (5.0, 0.5)):
        axes = picture(t, ON_LANE, [*CURVES, later, hindsight], [(60.0, 0.5)])[0]
        stiffest = [np.ptp(line.get_ydata()) for line in axes.lines]
        np.testing.assert_allclose(
            curves(axes)["true tire"][:, 1], share * CURVES[2].force[:, 0] / 1e3
        )
        assert max(stiffest) <= np.ptp(CURVES[0].force[:, 0]) / 1e3, "what was known at the end"


def test_the_panels_of_a_film_show_the_true_curve_as_far_as_the_car_slips():
    grippy = CURVES[2]._replace(force=3.0 * CURVES[2].force)
    free, tall = (picture(0.0, ON_LANE, some)[0] for some in (CURVES[:1], [CURVES[0], grippy]))
    inside = np.abs(np.rad2deg(grippy.alpha)) <= tall.get_xlim()[1]
    largest = 1e-3 * np.abs(grippy.force[inside]).max()
    assert free.get_ylim()[1] < largest < tall.get_ylim()[1]


FAULT = SensorFault(channel="v_y", kind="biased", start=2.0, duration=1.5, size=0.3)


def test_a_broken_sensor_is_shaded_and_where_it_was_noticed_is_marked():
    noticed = replace(
        ON_LANE["frozen"], notes=((2.5, "sensor fault: v_y and a_y"), (3.0, "learnt tire: x"))
    )
    for figure in (
        drive_errors_figure({"frozen": noticed}, off_path=2.0, faults=[FAULT]),
        drive_steering_figure({"frozen": noticed}, angle_limit=0.5, rate_limit=0.5, faults=[FAULT]),
    ):
        labels = [text.get_text() for text in figure.legends[0].get_texts()]
        assert {"v_y biased", "sensor fault noticed"} <= set(labels)
        for axes in figure.axes:
            (shade,) = [ends for *ends, label in ends_of(axes) if label == "v_y biased"]
            assert shade == pytest.approx([2.0 * SPEED, 3.5 * SPEED], abs=0.1)
            (mark,) = [line for line in axes.lines if line.get_label() == "sensor fault noticed"]
            assert mark.get_xdata()[0] == pytest.approx(2.5 * SPEED)
    late = replace(FAULT, start=1e3)
    labels = drive_errors_figure({"frozen": noticed}, off_path=2.0, faults=[late]).legends[0]
    assert "v_y biased" not in [text.get_text() for text in labels.get_texts()]


def curves(axes):
    """Drawn data by label."""
    return {line.get_label(): np.column_stack(line.get_data()) for line in axes.get_lines()}


def test_errors_are_drawn_over_arc_length_in_the_units_of_their_axes():
    panels = drive_errors_figure(ON_LANE, off_path=2.0, drops=[(60.0, 0.5)]).axes
    for label, drive in ON_LANE.items():
        for axes, values in zip(
            panels, (drive.e_y, np.degrees(drive.e_psi), drive.a_y, drive.v_x), strict=True
        ):
            np.testing.assert_allclose(curves(axes)[label], np.column_stack([drive.s, values]))
    for axes in panels:
        np.testing.assert_allclose(curves(axes)["friction 0.5"][:, 0], 60.0)


def test_steering_is_drawn_in_degrees_between_its_limits():
    drives = {
        label: replace(
            drive,
            command=drive.delta + 0.18 * np.sin(3.0 * drive.t),
            delta=drive.delta + 0.17 * np.sin(3.0 * drive.t - 0.1),
        )
        for label, drive in ON_LANE.items()
    }
    figure = drive_steering_figure(drives, angle_limit=0.2, rate_limit=0.6)
    angle, rate = figure.axes[:2]
    for label, drive in drives.items():
        np.testing.assert_allclose(curves(angle)[label][:, 1], np.degrees(drive.command))
    first = drives["frozen"]
    np.testing.assert_allclose(
        curves(angle)["wheels of frozen"][:, 1], np.degrees(first.delta), atol=1e-12
    )
    swing = np.diff(np.degrees(first.command)) / PERIOD
    drawn = [line.get_ydata() for line in rate.get_lines() if np.size(line.get_ydata()) > 2]
    np.testing.assert_allclose(drawn, [swing], rtol=1e-6, atol=1e-6)
    for axes, limit in ((angle, np.degrees(0.2)), (rate, np.degrees(0.6))):
        level = [y[0] for y in (line.get_ydata() for line in axes.get_lines()) if np.ptp(y) == 0.0]
        for side in (-limit, limit):
            assert any(abs(y - side) < 1e-9 for y in level), (axes.get_ylabel(), level)


def test_solve_times_are_drawn_in_milliseconds():
    drive = ON_LANE["frozen"]
    drawn = [
        line.get_ydata() for axes in drive_solve_figure(drive).axes for line in axes.get_lines()
    ]
    longest = max(float(np.max(y)) for y in drawn if np.size(y) > 10)
    assert longest == pytest.approx(1e3 * drive.solve_time.max(), rel=1e-6)


def test_wheels_and_body_have_the_size_of_the_car():
    small = car_shape(CAR, 0.0, 0.0, 0.0)
    large = car_shape(replace(CAR, l_f=2 * CAR.l_f, l_r=2 * CAR.l_r, chassis=None), 0.0, 0.0, 0.0)
    for wheel in small.wheels:
        length, width = np.ptp(wheel, axis=0)
        assert 0.55 < length < 0.75 and 0.15 < width < 0.3
    np.testing.assert_allclose(
        np.ptp(large.wheels, axis=1), 2.0 * np.ptp(small.wheels, axis=1), rtol=1e-9
    )
    assert np.ptp(small.body[:, 0]) == pytest.approx(1.68 * CAR.wheelbase)
    front, rear = small.wheels[:2, :, 0].mean(), small.wheels[2:, :, 0].mean()
    assert (front, rear) == (pytest.approx(CAR.l_f), pytest.approx(-CAR.l_r))
