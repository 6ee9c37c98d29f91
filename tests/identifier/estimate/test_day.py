"""Sensors of a log are found anew for each, the tires held: zeros do not travel with tires."""

from dataclasses import replace

import numpy as np
import pytest

from identifier.compare.zeros import replayed, zeros
from identifier.day import NUMBERS, Day, sideways
from identifier.doctor import diagnose
from identifier.estimate.day import steering_zeros
from identifier.estimate.fit import fit
from identifier.measured import with_doubt
from identifier.methods import make_method
from identifier.motion.parameters import INDEX, NAMES
from identifier.prediction import predict
from identifier.reproducibility import beyond_known
from identifier.run import identify
from models.maneuvers import SampledSteer
from models.plant import Plant
from models.recordings import joined
from models.recordings.portion import Portion
from models.vehicle import Vehicle, sedan
from mpc.tires import prediction_tire
from tests.identifier.conftest import missed
from tests.identifier.estimate.conftest import NOISE, driven

ZERO, BIAS = 0.02, 0.3  # rad, m/s


def of_another_day(drive, sign=1.0):
    return replace(drive, delta_f=drive.delta_f - sign * ZERO, v_y=drive.v_y + sign * BIAS)


def smooth(signal):
    return np.convolve(signal, np.full(15, 1.0 / 15.0), mode="same")


@pytest.fixture(scope="module")
def tire(learnt):
    return learnt.model


def test_zeros_of_another_day_are_found_and_do_not_reach_the_forces(tire):
    clean, other = driven(5), of_another_day(driven(5))
    day = tire.on(other)
    assert day.anew
    assert day["steering_zero"] == pytest.approx(ZERO, rel=0.2)
    assert day["v_y_bias"] + day.speed * day["v_y_angle"] == pytest.approx(BIAS, rel=0.1)
    assert missed(tire, other).max() < missed(tire, clean).max() + 0.02
    assert beyond_known(tire, other) == pytest.approx(beyond_known(tire, clean), abs=0.01)
    held = tire.of_day(tire.on(clean))
    assert missed(held, other).max() > 0.2  # as the sensors of a day without them read it


def test_a_verdict_names_zeros_that_are_large_and_stays_valid(tire):
    found = predict(tire, of_another_day(driven(5)))
    codes = {one.code for one in found.verdict.findings}
    assert found.verdict.valid
    assert codes & {"v_y_reads", "v_y_bias"} and "steering_zero" not in codes  # 1.1 deg: usual
    assert not {"v_y_reads", "v_y_bias"} & {
        one.code for one in predict(tire, driven(5)).verdict.findings
    }


def test_what_is_too_short_to_tell_keeps_the_zeros_that_were_identified(tire):
    short = driven(5)[0.0:10.0]
    assert not tire.on(short).anew
    np.testing.assert_array_equal(tire.on(short).on(tire.p), tire.p)


def test_logs_of_different_days_have_zeros_of_their_own():
    logs = [of_another_day(driven(3)), of_another_day(driven(4), -1.0)]
    apart, one = (fit(logs, sedan(), days=days).model for days in ("found", "one"))
    clean = fit([driven(3), driven(4)], sedan()).model
    slip = np.linspace(0.005, 0.05, 10)
    away = [np.abs(each.force(slip) / clean.force(slip) - 1.0).max() for each in (apart, one)]
    assert away[0] < 0.08 < away[1]
    assert (apart.reach.unexplained < 1.5).all()  # the second taught, too
    together = joined(logs)
    assert len(apart.days(together)) == 2 and apart.days(logs[0])[0][0] == 0
    held = apart.held_on(together)
    np.testing.assert_array_equal(held.predict(together), apart.predict(together))
    forces = apart.predict(together)
    error = np.sqrt(np.mean((forces - together.axle_force) ** 2, axis=0))
    assert (error < 0.08 * np.sqrt(np.mean(together.axle_force**2, axis=0))).all()


def test_zeros_that_differ_on_gentle_bends_are_no_play_and_no_ratio():
    t = np.arange(0.0, 90.0, 0.5)
    bends = np.where(t % 15.0 < 3.0, np.sin(np.pi / 3.0 * (t % 15.0)), 0.0) * (-1.0) ** (t // 15.0)
    steering = SampledSteer(
        times=tuple(t), angles=tuple(0.02 * bends), rate_limit=1.0, duration=90.0
    )
    drive = Plant(sedan()).simulate(steering, speed=20.0).recording()
    logs = [NOISE.apply(drive, np.random.default_rng(seed)) for seed in (0, 1)]
    logs = [
        replace(one, delta_f=one.delta_f + z) for one, z in zip(logs, (0.01, -0.01), strict=True)
    ]
    found = fit(logs, sedan()).model
    assert found["steering_play"] == 0.0
    assert abs(found["steering_gain"]) < 0.1


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_each_log_without_v_y_has_a_zero_of_its_own_and_no_error_of_v_y(tire, sign):
    logs = []
    for seed, of in ((5, 1.0), (6, sign)):
        shown = of_another_day(driven(seed), of)
        a_y = smooth(np.gradient(driven(seed).v_y, shown.dt) + shown.v_x * shown.r)
        logs.append(replace(shown, v_y=None, a_y=a_y))
    found, blind = fit(logs, sedan()).model, joined(logs)
    assert abs(found["steering_gain"]) < 0.1
    np.testing.assert_allclose(found.stiffness, tire.stiffness, rtol=0.15)
    model = replace(tire, p=replace(tire.on(driven(5)), value=np.full(5, 0.01)).on(tire.p))
    blind = replace(blind, v_y=model.estimated_v_y(blind).v_y, estimated=("v_y",))
    (_, day), *_ = days = model.days(blind)
    assert day["v_y_bias"] == day["v_y_angle"] == day["v_y_lever"] == 0.0
    expected = [(0, ZERO), (len(logs[0]), -ZERO)][: len({1.0, sign})]
    np.testing.assert_allclose(
        [(at, one["steering_zero"]) for at, one in days], expected, atol=0.006
    )
    assert missed(model, blind).max() < 0.1


def test_a_zero_is_another_only_where_turns_to_both_sides_tell_it():
    one, still = driven(5), np.ones(len(driven(5)))
    ring = replace(one, v_x=10.0 * still, r=0.15 * still, delta_f=0.055 * still)
    assert not steering_zeros(joined([one, ring, one]), sedan()).any()


def test_parts_of_a_long_log_are_read_with_the_zeros_of_the_whole(tire, monkeypatch):
    days = joined([of_another_day(driven(5)), of_another_day(driven(6), -1.0)])
    part = Portion(days.taken(np.r_[500:1900, 2500:3900]), np.r_[500:1900, 2500:3900])
    (a, _), (b, other) = tire.held_on(days, part).days(part.recording)
    assert (a, b) == (0, part.place(tire.days(days)[1][0])) and other is tire.days(days)[1][1]
    held = tire.held_on(days, part)
    monkeypatch.setattr("identifier.estimate.model.days_of", None)  # asked no more
    assert missed(held, part.recording).max() < 0.1


def test_the_tracker_reads_the_sensors_of_a_day(tire):
    day = tire.on(of_another_day(driven(5)))
    weights = prediction_tire(tire.of_day(day)).weights
    np.testing.assert_allclose(weights[[0, 2]], [day["steering_zero"], day["v_y_bias"]])
    np.testing.assert_array_equal(weights[4:], prediction_tire(tire).weights[4:])
    assert tire.of_day(day).at_friction(0.5).on(driven(5)) is day


def test_a_rival_gets_the_same_step():
    drive, car = driven(3), sedan()
    rival = identify(drive, car, make_method("lagged_ekf", car)).freeze()
    other = of_another_day(driven(5))
    assert zeros(rival, other)["steering_zero"] == pytest.approx(ZERO, rel=0.3)
    raw, given = (
        np.sqrt(np.mean((force - other.axle_force) ** 2))
        for force in (rival.predict(other), replayed(rival, other))
    )
    assert given < 0.7 * raw


def test_the_band_on_a_log_is_as_wide_as_what_is_missed_of_it(tire):
    clean = driven(5)
    other = tire.at_friction(0.6)
    narrow, wide = (np.mean(one.band.over(clean), axis=0) for one in (tire, other))
    assert (wide > 1.5 * narrow).any()
    missed = np.abs(tire.predict(clean) - clean.axle_force)
    assert np.mean(missed <= tire.band.over(clean)) > 0.8


@pytest.mark.parametrize("errors", [(0.3, 0.0), (0.0, np.radians(1.0))])
def test_at_one_speed_the_doctor_names_the_sum(errors):
    bias, angle = errors
    drive = driven(6, swing=0.0)
    v_y = drive.v_y + bias + angle * drive.v_x
    said = [one for one in diagnose(replace(drive, v_y=v_y), sedan()).findings]
    assert any(one.channel == "v_y" for one in said)
    assert not any(one.channel == "v_y" for one in diagnose(drive, sedan()).findings)


def test_the_doctor_looks_at_one_log_where_days_differ():
    logs = [of_another_day(driven(3)), of_another_day(driven(4), -1.0)]
    found = diagnose(joined(logs), sedan())
    assert "no_tire" not in {one.code for one in found.findings}
    assert any("longest segment" in line for line in found.unobservable)


def test_a_fit_is_mounted_on_a_model_car(tire):
    small = Vehicle(
        mass=1.6, yaw_inertia=0.005, l_f=0.08, l_r=0.09, cornering_stiffness_front=30.0,
        cornering_stiffness_rear=30.0,
    )  # fmt: skip
    assert np.isfinite(tire.mounted_on(small).stiffness).all()


# A day in numbers and words.

TITLES = (
    "zero of the steering",
    "bias of v_y",
    "mounting angle of the v_y sensor",
    "place of the v_y sensor ahead of the center of gravity",
    "correction of the steering angle",
)


def a_day(value, sd=1e-4, **other):
    """A day at 20 m/s, of sensors of which 1 is usual."""
    given = {"expected": np.zeros(5), "usual": np.full(5, 0.01), "speed": 20.0, "anew": True}
    covariance = np.diag(np.broadcast_to(sd, 5) ** 2)
    return Day(value=np.array(value), covariance=covariance, **given | other)


def test_the_errors_of_a_day_are_taken_out_of_a_log():
    clean = driven(5)
    value = np.array([0.01, 0.2, -0.02, 0.3, 0.1])
    zero, bias, angle, lever, gain = value
    logged = replace(
        clean,
        delta_f=(clean.delta_f - zero) / (1.0 + gain),
        v_y=clean.v_y + bias + angle * clean.v_x + lever * clean.r,
    )
    back = a_day(value).corrected(logged)
    np.testing.assert_allclose(back.v_y, clean.v_y, atol=1e-12)
    np.testing.assert_allclose(back.delta_f, clean.delta_f, atol=1e-12)
    assert a_day(value).corrected(replace(logged, v_y=None)).v_y is None
    p = a_day(value).on(np.full(len(NAMES), 7.0))
    assert [p[INDEX[name]] for name in NUMBERS] == value.tolist() and (p == 7.0).sum() == p.size - 5


def test_the_numbers_of_a_day_are_told_in_units_that_people_read():
    day = a_day([np.radians(2.0), 0.3, np.radians(-1.0), 0.5, 0.1], [1e-3, 0.01, 1e-3, 0.02, 0.0])
    units = ("°", " m/s", "°", " m", " %")
    factors = (np.degrees(1.0), 1.0, np.degrees(1.0), 1.0, 100.0)
    words = {
        title: f"{with_doubt(k * value, k * sd)}{unit}"
        for title, value, sd, unit, k in zip(TITLES, day.value, day.sd, units, factors, strict=True)
        if sd > 0.0
    }
    assert day.words == words and len(words) == 4
    assert day.line == ", ".join(f"{title} {said}" for title, said in words.items())
    assert replace(day, anew=False).line.endswith("(of the identification drive)")
    written = day.to_dict()
    assert written["anew"] and written["v_y_bias"] == {"value": 0.3, "sd": pytest.approx(0.01)}


def test_what_is_far_from_what_is_usual_is_noted():
    codes = [[code for code, _ in a_day([x, 0, 0, 0.05, 0]).notes] for x in (0.029, 0.031, -0.031)]
    assert codes == [["v_y_lever"], ["steering_zero", "v_y_lever"], ["steering_zero", "v_y_lever"]]
    assert a_day([0.05, 0.3, 0, 0, 0], anew=False).notes == ()
    assert a_day([0.05, 0, 0, 0, 0], [0.014, 0, 0, 0, 0]).notes == (), "within its own doubt"
    assert a_day([0, 0, 0, 0.05, 0], expected=np.array([0, 0, 0, 0.04, 0])).notes == ()
    (zero, lever) = (text for _, text in a_day([0.05, 0, 0, 0.05, 0]).notes)
    assert with_doubt(np.degrees(0.05), np.degrees(1e-4)) in zero
    assert a_day([0.05, 0, 0, 0, 0], usual=np.zeros(5)).notes == (), "nothing is believed of it"
    assert "from that of a good sensor" in zero and "of the identification drive" in lever


def test_at_one_speed_bias_and_angle_are_one_error_and_told_apart_where_they_differ():
    usual = np.array([0.01, 0.1, 0.01, 0.01, 0.01])
    for value in ([0, 0.2, 0, 0, 0], [0, 0, 0.01, 0, 0], [0, 0.4, -0.01, 0, 0]):
        ((code, text),) = a_day(value, usual=usual).notes
        assert (
            code == "v_y_reads"
            and "0.20" in text
            and "too much at the median speed of 20 m/s" in text
        )
        assert "bias of v_y" in text and "the forces allow for it" in text
    assert "too little" in a_day([0, -0.2, 0, 0, 0], usual=usual).notes[0][1]
    assert a_day([0, 0.25, -0.0125, 0, 0], usual=usual).notes == ()
    unclear = a_day([0, 0.4, 0, 0, 0], [1e-4, 0.03, 1e-4, 1e-4, 1e-4], usual=usual)
    assert "bias of v_y" in unclear.notes[0][1]
    worse = replace(unclear, usual=0.8 * usual)
    assert "this log cannot separate them" in worse.notes[0][1]
    halves = np.zeros((5, 5))  # the sum is known, and that each is half of it is believed
    halves[1:3, 1:3] = [[9.76e-4, -4.877e-5], [-4.877e-5, 2.44e-6]]
    believed = replace(worse, covariance=halves, usual=usual)
    assert (believed.sd[1:3] < 0.4 * usual[1:3]).all()
    assert "this log cannot separate them" in believed.notes[0][1]
    of_two = np.array([[0.04, -0.00199], [-0.00199, 1e-4]])  # bias and angle make up for each other
    assert sideways(np.array([0.2, 0.0]), of_two, 20.0)[0] == pytest.approx(0.2)
    assert sideways(np.array([-0.2, 0.0]), of_two, 20.0)[0] == pytest.approx(-0.2)
    assert not sideways(np.array([0.2, 0.0]), np.diag(np.diag(of_two)), 20.0)
    still = np.zeros(5), np.zeros((5, 5)), (np.zeros(5), np.zeros(5))
    assert Day.of(*still, np.array([1.0, 30.0, 20.0]), anew=True).speed == 20.0
    assert Day.of(*still, np.zeros(0), anew=True).speed == 1.0
