"""Planted faults are found with their sizes, none on a clean drive; the rest is listed."""

import math
from dataclasses import replace

import numpy as np
import pytest

import tireid as ti
from benchmarks.doctor_cases import planted
from benchmarks.everyday_drives import drawn_everyday
from benchmarks.faults import Late, Misaligned
from identifier.doctor import Finding, diagnose, examine
from identifier.doctor.accelerometer import descended
from identifier.doctor.faults import RULES, Candidate, Search, _of_one_device, prepared
from identifier.doctor.suspects import NOTES, SUSPECTS
from identifier.estimate.drive import Drive
from identifier.estimate.solve import descend
from identifier.motion.parameters import INDEX
from models.recordings import Repair
from models.vehicle import GRAVITY
from tests.identifier.conftest import areas_of, codes_of, pressed

# Kinds whose sizes this drive tells well, and how well: of the size, or where "" absolutely.
SIZED = {
    "offset v_y": 0.008, "offset r": 0.0015, "offset a_y": 0.01, "offset delta_f": 0.0008,
    "factor v_x": 0.025, "factor delta_f": 0.02, "delay r": 0.003, "delay delta_f": 0.003,
    "delay a_y": 0.004, "misaligned": 0.0006, "velocity sensor": 0.06, "accelerometer": 0.04,
    "bank": 0.003,
}  # fmt: skip


def found_in(log, car):
    """Findings of a log."""
    return examine(log, car).findings


def suspect_of(code, channel):
    return next(one for one in SUSPECTS if (one.code, one.channel) == (code, channel))


def faulty(driven, kind):
    """A fault of a kind, the log with it, and the car as it is told then."""
    car, log, _ = driven
    fault = planted(kind, car, np.random.default_rng(5))
    return fault, fault.case.log(log), fault.case.car(car)


@pytest.fixture(scope="module")
def driven():
    """A minute of a sedan with a slalom in it: the car as told, a log, and the exact drive."""
    drive = drawn_everyday("sedan", "slalom", 1)
    log = drive.log(np.random.default_rng([1, 1]))
    return drive.car.declared, replace(log, axle_force=None), drive.exact


def test_nothing_is_found_on_a_clean_drive_and_little_is_unseen(driven):
    car, log, _ = driven
    said = examine(log, car)
    assert said.findings == ()
    assert all("is not observable" in line for line in said.unobservable)
    assert len(said.unobservable) < 3


@pytest.mark.parametrize(("scale", "found"), [(1.0, []), (0.87, [("factor", "v_x")])])
def test_a_scale_of_v_x_without_a_y_is_found_where_roll_does_not_explain_it(scale, found):
    log = ti.sample_recording(seed=2)
    said = examine(replace(log, v_x=scale * log.v_x, a_y=None, axle_force=None), ti.sedan())
    assert [(one.code, one.channel) for one in said.findings] == found
    for one in said.findings:
        assert abs(one.size - scale) < 2.0 * one.deviation < 0.1 and not one.sure


@pytest.mark.sweep("offset v_y")
@pytest.mark.parametrize("kind", SIZED)
def test_a_planted_fault_is_named_first_or_second_with_its_size(driven, kind):
    fault, *logged = faulty(driven, kind)
    found = found_in(*logged)[:2]
    right = [
        one for one in found if one.code == fault.code and fault.channel in one.channel.split("+")
    ]
    assert right, f"{fault.case}: {[one.text for one in found]}"
    assert abs(right[0].size - fault.size) < SIZED[kind]
    assert right[0].confidence > 0.2
    assert (right[0].repair is None) == (kind == "bank")


def roll_of(exact, degrees_per_g):
    """The roll of a body, a mass on spring and damper: its angle, and how fast it turns."""
    omega, damping, gain = 2.0 * math.pi * 1.6, 0.35, math.radians(degrees_per_g) / GRAVITY
    roll = rate = 0.0
    angle, rates = np.empty((2, len(exact)))
    for k, a_y in enumerate(exact.a_y):
        angle[k], rates[k] = roll, rate
        rate += exact.dt * (omega**2 * (gain * a_y - roll) - 2.0 * damping * omega * rate)
        roll += exact.dt * rate
    return angle, rates


def rolling(exact, log, degrees_per_g):
    """The log of an accelerometer that rolls with the body."""
    angle, _ = roll_of(exact, degrees_per_g)
    shown = exact.a_y * np.cos(angle) + GRAVITY * np.sin(angle)
    return replace(log, a_y=shown + log.a_y - exact.a_y)


@pytest.mark.sweep("0.0", "6.0")
@pytest.mark.parametrize("degrees_per_g", [0.0, 2.0, 4.0, 6.0])
def test_an_accelerometer_on_a_body_that_rolls_has_no_fault(driven, degrees_per_g):
    car, log, exact = driven
    assert examine(rolling(exact, log, degrees_per_g), car).findings == ()


def test_downforce_is_a_note_and_none_is_missing_where_it_is_told():
    log, car = pressed(0.3, np.random.default_rng(3))
    found = found_in(log, car)
    assert codes_of(found) == ["downforce"]
    assert found[0].note and not found[0].matters and not found[0].sure
    assert found[0].size * (100.0 / 3.6) ** 2 == pytest.approx(0.3, rel=0.4)
    assert found_in(log, replace(car, **areas_of(car, 0.3))) == ()
    assert found_in(*pressed(0.0, np.random.default_rng(3))) == ()


@pytest.mark.parametrize("kind", ["misaligned", "offset delta_f"])
def test_a_diagnosis_mends_the_log_and_nothing_is_found_in_it_then(driven, kind):
    (fault, logged, car), log = faulty(driven, kind), driven[1]
    said = diagnose(logged, car)
    assert codes_of(one for one in said.findings if one.sure) == codes_of([fault])
    mended, same = said.repair.apply(logged, car)
    wrong, left = (
        max(np.abs(getattr(x, name) - getattr(log, name)).max() for name in ("v_y", "delta_f"))
        for x in (logged, mended)
    )
    assert left <= 0.2 * wrong
    assert same == car and not [one for one in found_in(mended, car) if one.matters]


@pytest.mark.heavy
def test_what_is_alike_at_constant_speed_is_named_beside_it(driven):
    """v_y off by 3 % of the speed: a sensor that is turned, or what looks so."""
    car, log, _ = driven
    slow = replace(log, v_x=np.full(len(log), float(np.median(log.v_x))))
    turned = Misaligned(angle=0.03).apply(replace(log, v_x=slow.v_x, a_y=None))
    first, second = found_in(turned, car)[:2]
    assert "velocity_sensor_angle v_y" in codes_of([first, second])
    assert not first.sure and not second.sure


def test_a_number_of_the_car_is_a_note_and_neither_an_alarm_nor_sure(driven):
    car = driven[0]
    _, log, inertia = faulty(driven, "yaw inertia")
    (found, *_) = found_in(log, replace(inertia, estimated=("yaw_inertia",)))
    assert found.code == "yaw_inertia" and found.code in NOTES
    assert found.note and not found.sure and not found.matters
    right = found.repair.on(inertia)
    assert right.yaw_inertia == pytest.approx(car.yaw_inertia, rel=0.25)
    assert found.to_dict()["note"] is True


def test_swapped_lengths_are_a_note_that_names_the_swap():
    drive = drawn_everyday("sedan", "lane change", 7000)
    log, car = drive.log(np.random.default_rng([7000, 1])), drive.car.declared
    assert abs(car.l_f - car.l_r) > 0.5
    swapped = replace(car, l_f=car.l_r, l_r=car.l_f)
    (found, *_) = found_in(replace(log, axle_force=None), swapped)
    assert found.code == "center_of_gravity" and found.note and not found.matters
    assert "as if they were swapped" in found.text
    shift = suspect_of("center_of_gravity", "")
    assert "swapped" not in shift.words(2.0 * (car.l_f - car.l_r), 0.05, car)


def test_a_move_to_where_a_y_fits_stays_within_bounds(driven):
    car, log, _ = driven
    search = prepared(Late(channels=("v_y",), delay=0.1).apply(log), car)
    wide = suspect_of("delay", "v_y")
    problem = search.problem.under(search.priors(search.widened(wide)))
    post = descend(problem, search.nominal().p, iterations=2)
    along = post.covariance.copy()
    k, low = INDEX["v_y_delay"], INDEX["compliance_f"]
    along[k, low] = along[low, k] = -1e3 * along[k, k]
    moved, *_ = search.both(replace(post, covariance=along), "v_y_delay")
    assert moved["v_y_delay"] != post["v_y_delay"]
    assert (moved.p >= problem.priors.low).all() and (moved.p <= problem.priors.high).all()


# When a repair is sure.


def searched(log, car):
    """The search of a log, and the estimate that it ends with."""
    search = prepared(log, car)
    return search, search.run()


def test_a_model_of_the_repaired_log_explains_the_half_that_did_not_teach_it(driven):
    """The force missed of each half: without the fault, with it, and with another in its place."""
    car, log, _ = driven
    late = Late(channels=("r",), delay=0.08).apply(log)
    search, post = searched(late, car)
    first = search.found[0].first
    assert first.suspect.parameter == "r_delay" and search.found[0].sure
    parts = search.problem.halves()
    outcome = search.left_out(post, search.wide, parts)
    plain = Search(problem=search.problem, accelerometer=None)
    without = plain.left_out(plain.nominal(), {}, parts)
    assert (outcome < without).all()


def test_what_does_not_help_the_other_half_is_not_sure(driven, monkeypatch):
    car, log, _ = driven
    late = Late(channels=("r",), delay=0.08).apply(log)
    monkeypatch.setattr(Search, "left_out", lambda *_, **__: np.array([0.1, 0.1]))
    found = found_in(late, car)[0]
    assert (found.code, found.channel, found.sure) == ("delay", "r", False)


@pytest.mark.sweep("3")
@pytest.mark.parametrize("between", [2, 3])
def test_nothing_is_found_in_a_right_log_that_was_drawn_from_a_slower_clock(driven, between):
    car, log, _ = driven
    t = np.linspace(log.t[0], log.t[-1], between * (len(log) - 1) + 1)
    names = ("v_x", "v_y", "r", "delta_f", "delta_r", "a_y")
    signals = {name: np.interp(t, log.t, getattr(log, name)) for name in names}
    assert found_in(replace(log, t=t, **signals), car) == ()


def test_a_log_that_no_fault_explains_is_found_to_be_one(driven):
    """The steering is what a servo was told, which went another way."""
    car, log, _ = driven
    said = examine(replace(log, delta_f=log.delta_f[::-1].copy()), car)
    (found,) = said.findings
    assert found.matters and found.code == "no_tire" and found.channel == "delta_f"
    assert "front axle" in found.text and "commanded" in found.text
    assert said.unobservable == ("sizes of faults: no tire explains the log",)


def test_a_drive_that_never_drives_is_not_asked(driven):
    car, log, _ = driven
    said = examine(replace(log, v_x=0.01 * log.v_x), car)
    assert said.findings == ()
    assert "hardly drives" in said.unobservable[0]


def test_a_late_signal_is_read_on_time_within_each_segment(driven):
    car, log, exact = driven
    n = len(log)
    late = Late(channels=("v_y", "r"), delay=0.1).apply(exact)
    kept = np.r_[0 : n // 2, n // 2 + 50 : n]
    drive = Drive.of(late.taken(kept), car)
    right = Drive.of(exact.taken(kept), car)
    assert drive.begins == (0, n // 2)
    read = drive.on_time(np.array([0.1, 0.1, 0.0]))
    inside = np.r_[100 : n // 2 - 100, n // 2 + 100 : n - 200]
    for signals in ("signals", "rates"):
        columns = slice(1, 3) if signals == "signals" else slice(0, 2)
        one, other = (getattr(x, signals)[inside, columns] for x in (read, right))
        np.testing.assert_allclose(one, other, atol=0.02 * np.abs(other).max())
    np.testing.assert_array_equal(read.signals[:, 0], drive.signals[:, 0])
    np.testing.assert_array_equal(read.signals[:, 3], drive.signals[:, 3])


def test_a_finding_that_is_sure_has_a_repair():
    with pytest.raises(ValueError, match="must have a repair"):
        Finding(code="delay", confidence=1.0, sure=True)
    with pytest.raises(ValueError, match="between 0 and 1"):
        Finding(code="delay", confidence=1.2)


@pytest.mark.parametrize(("ahead", "sure"), [(1.0, True), (4.0, False)])
def test_a_sensor_that_no_car_carries_is_never_sure(driven, ahead, sure):
    car, log, _ = driven
    search = prepared(log, car)
    suspect = suspect_of("velocity_sensor_x", "v_y")
    one = Candidate(suspect, ahead, 0.1, 50.0, 50.0, 0.0, None)
    assert search.finding(one, (0.9, 0.9), (), sure=True).sure is sure
    doubtful = one._replace(value=search.deviation(one))  # of a Gaussian 68 % lie within one
    found = search.finding(doubtful, (0.9, 0.5), (one,), sure=False)
    assert (found.confidence, found.group) == pytest.approx((0.6827 * 0.9, 0.6827 * 0.5), abs=1e-3)
    assert found.text.endswith("this drive cannot separate it from: velocity sensor x v_y")


@pytest.mark.parametrize(("factor", "offered"), [(2.0, True), (3.5, False)])
def test_a_declared_yaw_inertia_is_not_replaced_by_one_far_from_it(driven, factor, offered):
    car, log, _ = driven
    suspect = suspect_of("yaw_inertia", "")
    one = Candidate(suspect, np.log(factor), 0.05, 50.0, 50.0, 0.0, None)
    found = prepared(log, car).finding(one, (0.9, 0.9), (), sure=False)
    assert (found.repair is not None) is offered
    assert found.text.endswith("; try another channel of r, if the log has one")
    guessed = replace(car, estimated=("yaw_inertia",))
    assert prepared(log, guessed).finding(one, (0.9, 0.9), (), sure=False).repair is not None


def test_a_size_is_believed_that_stands_out_and_that_devices_have(driven):
    """Of a delay: beyond 2.5 deviations, within 3.5 widths, not against the accelerometer."""
    car, log, _ = driven
    search = prepared(log, car)
    delay, lag = suspect_of("delay", "v_y"), suspect_of("lag", "v_y")

    def fitted(value, suspect=delay, felt=0.0, sd=0.003):  # with the least size 0.005
        return Candidate(suspect, value, sd, 20.0, 20.0, felt, None)

    assert search.deviation(fitted(0.1)) == pytest.approx(0.005)
    for value, outcome in (
        (0.012, False),
        (0.013, True),
        (-0.013, True),
        (0.41, True),
        (0.43, False),
    ):
        assert search.believed(fitted(value)) is outcome
    assert search.believed(fitted(0.1, felt=-3.9)) and not search.believed(fitted(0.1, felt=-4.1))
    assert search.believed(fitted(0.1, lag)) and not search.believed(fitted(-0.1, lag))
    assert fitted(0.1).is_late_as(fitted(0.1, lag)) and not fitted(0.1).is_late_as(fitted(0.2))
    assert not fitted(0.1).is_late_as(fitted(0.1, suspect_of("lag", "r")))


# How well the accelerometer alone says where to begin; of what it says nothing the search begins
# at zero.
BEGIN = {"bank": 0.003, "delay v_y": 0.02, "factor v_x": 0.01, "offset v_y": None}


@pytest.mark.parametrize("kind", BEGIN)
def test_a_step_of_all_ranks_the_fault_first_and_begins_where_a_y_asks(driven, kind):
    fault, *logged = faulty(driven, kind)
    search = prepared(*logged)
    gain, suspect, begin = search.promised(search.nominal())[0]
    assert codes_of([suspect]) == codes_of([fault])
    assert gain > RULES.gain
    if BEGIN[kind] is None:
        assert begin == 0.0
    else:
        assert suspect.size(begin) == pytest.approx(fault.size, abs=BEGIN[kind])


def test_a_clean_drive_promises_no_gain_and_a_fault_without_its_number_is_missed(driven):
    car, log, _ = driven
    search = prepared(log, car)
    assert all(gain < RULES.gain for gain, *_ in search.promised(search.nominal()))
    fault, *logged = faulty(driven, "offset v_y")
    search, suspect = prepared(*logged), suspect_of("offset", "v_y")
    wide, parts = search.widened(suspect), search.problem.halves()
    post = descend(search.problem.under(search.priors(wide)), search.nominal().p)
    assert post["v_y_bias"] == pytest.approx(fault.size, abs=0.01)
    outcome = search.left_out(post, wide, parts)
    without = search.left_out(post, wide, parts, zero=suspect)
    assert (outcome < without).all()
    p = post.p.copy()
    p[INDEX["v_y_bias"]] *= 0.5  # held there it is zero from wherever the step began
    again = search.left_out(replace(post, p=p), wide, parts, zero=suspect)
    np.testing.assert_allclose(again, without, rtol=0.3)


OF_A_Y = {
    "offset a_y": 0.01, "factor a_y": 0.01, "delay a_y": 0.005, "lag a_y": 0.02,
    "accelerometer": 0.05,
}  # fmt: skip


@pytest.mark.parametrize("kind", OF_A_Y)
def test_an_accelerometer_tells_its_faults_without_a_fit(driven, kind):
    fault, *logged = faulty(driven, kind)
    search = prepared(*logged)
    suspect = suspect_of(fault.code, fault.channel)
    line = search.line(search.problem.priors.mean, search.widened(suspect))
    value, deviation = line.of(suspect.parameter)
    assert suspect.size(value) == pytest.approx(fault.size, abs=OF_A_Y[kind])
    assert 0.0 < deviation < OF_A_Y[kind]
    assert line.cost < search.line(search.problem.priors.mean, {}).cost - 10.0


def test_a_valley_of_one_number_is_found_within_steps_of_three_widths():
    for at, width in ((0.02, 0.01), (-0.5, 0.4)):
        for sharp in (0.1 * width, width):

            def cost(x, at=at, sharp=sharp, width=width):
                return 7.0 + 0.5 * (x / width) ** 2 + 0.5 * ((x - at) / sharp) ** 2

            curvature = width**-2 + sharp**-2
            best = at / sharp**2 / curvature
            found = descended(cost, width)
            assert found == pytest.approx((best, curvature, cost(best)), rel=1e-3)
        for sign in (-1.0, 1.0):
            far, curvature, _ = descended(lambda x, s=sign: -1e9 * s * x, width)
            assert (far, curvature) == pytest.approx((sign * 12.0 * width, width**-2))
    assert descended(lambda x: abs(x), 1.0)[0] == 0.0, "what is least at once stays"


@pytest.mark.parametrize(("names", "sign"), [(("r", "a_y"), 1.0), (("v_y", "delta_f"), -1.0)])
def test_two_channels_that_are_late_alike_are_one_device(names, sign):
    """Where v_y and the steering are early by as much, the others are late."""
    car = drawn_everyday("sedan", "slalom", 1).car.declared

    def late(channel, size, **other):
        return Finding(code="delay", channel=channel, size=size, deviation=0.002, **other)

    repair = Repair(delay={names[0]: 0.05})
    first = late(names[0], 0.05, confidence=0.9, group=0.5, repair=repair, sure=True)
    beside = Finding(code="offset", channel="r", size=0.1)
    for size, sure in ((0.06, True), (0.06, False)):
        second = late(names[1], size, confidence=0.8, group=0.7, repair=repair, sure=sure)
        both, left = _of_one_device([first, beside, second], car)
        assert left is beside and (both.channel, both.sure) == ("r+a_y", sure)
        assert (both.size, both.confidence, both.group) == (sign * 0.055, 0.8, 0.7)
        assert both.repair.delay == {"r": both.size, "a_y": both.size}
        words = "late against" if sign > 0.0 else "early against"
        assert both.text.startswith("the yaw rate and the lateral acceleration, of one device")
        assert "55" in both.text and words in both.text
    apart = late(names[1], 0.08, confidence=0.8, repair=repair)
    listed = [first, apart]
    assert _of_one_device(listed, car) is listed and _of_one_device([first], car) == [first]
    all_four = [late("r", 0.1), late("a_y", 0.2), late("v_y", 0.05), late("delta_f", 0.05)]
    assert [one.channel for one in _of_one_device(all_four, car)] == ["r", "a_y", "r+a_y"]
