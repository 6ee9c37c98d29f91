"""Planted faults are found with their sizes, none on a clean drive, and what is unseen is said."""

import math
import sys
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.doctor import drawn
from benchmarks.doctor_cases import KINDS, planted
from benchmarks.everyday_drives import drawn_everyday
from identifier.doctor import Finding, estimate, examine
from identifier.doctor.balance import Balance, cubic, thinned, window_length
from identifier.doctor.estimate import Candidate, Search
from identifier.doctor.fit import Fitter
from identifier.doctor.pieces import stretches_of
from identifier.doctor.suspects import SUSPECTS
from identifier.methods import make_method
from identifier.run import identify
from identifier.verdict.motion import evidence
from models.faults import Late, Misaligned, SensorFault, Together
from models.recordings import Repair
from models.vehicle import GRAVITY, sedan
from tests.identifier.conftest import areas_of, pressed
from tireid.diagnoses import NAMES

# Kinds whose sizes this drive tells well, and how well: of the size, or where "" absolutely.
SIZED = {
    "offset v_y": 0.02,
    "offset r": 0.002,
    "offset a_y": 0.05,
    "offset delta_f": 0.001,
    "factor v_x": 0.01,
    "factor r": 0.01,
    "factor delta_f": 0.05,
    "delay r": 0.002,
    "delay delta_f": 0.012,
    "delay a_y": 0.002,
    "misaligned": 0.0017,
    "velocity sensor": 0.1,
    "accelerometer": 0.1,
    "bank": 0.005,
}


@pytest.fixture(scope="module")
def driven():
    """A minute of a sedan with a slalom in it: the car as told, a log, and the exact drive."""
    drive = drawn_everyday("sedan", "slalom", 1)
    log = drive.log(np.random.default_rng([1, 1]))
    return drive.car.told, replace(log, axle_force=None), drive.exact


def test_nothing_is_found_on_a_clean_drive_and_little_is_unseen(driven):
    car, log, _ = driven
    said = examine(log, car)
    assert said.findings == ()
    assert said.unseen == ()


@pytest.mark.parametrize("kind", SIZED)
def test_a_planted_fault_is_named_first_or_second_with_its_size(driven, kind):
    car, log, _ = driven
    fault = planted(kind, car, np.random.default_rng(5))
    found = estimate(fault.case.log(log), fault.case.car(car))[:2]
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


@pytest.mark.parametrize("degrees_per_g", [0.0, 2.0, 4.0, 6.0])
def test_an_accelerometer_on_a_body_that_rolls_has_no_fault(driven, degrees_per_g):
    car, log, exact = driven
    assert examine(rolling(exact, log, degrees_per_g), car).findings == ()


@pytest.mark.parametrize("height", [0.8, 1.4])
def test_a_v_y_from_the_roof_is_named_and_nothing_in_its_place(driven, height):
    car, log, exact = driven
    _, rates = roll_of(exact, 4.5)
    found = estimate(replace(log, v_y=log.v_y - height * rates), car)
    assert [one.code for one in found] == ["velocity_sensor_z"]
    assert found[0].size == pytest.approx(height * math.radians(4.5) / GRAVITY, rel=0.3)
    assert found[0].repair is None, "it takes the rate at which the body rolls"


@pytest.mark.parametrize("factor", [0.8, 1.28, 1.4])
def test_a_scale_that_no_roll_explains_is_named_beside_it(driven, factor):
    car, log, exact = driven
    shown = rolling(exact, log, 4.0)
    found = estimate(replace(shown, a_y=factor * shown.a_y), car)
    assert (found[0].code, found[0].channel) == ("factor", "a_y")
    assert found[0].size == pytest.approx(factor, rel=0.1)


@pytest.mark.parametrize("lift", [0.12, 0.3])
def test_downforce_is_named_and_nothing_in_its_place(lift):
    log, car = pressed(lift, np.random.default_rng(3))
    found = estimate(log, car)
    assert [one.code for one in found] == ["downforce"]
    assert found[0].size * (100.0 / 3.6) ** 2 == pytest.approx(lift, rel=0.2)
    assert found[0].confidence > 0.9
    assert not found[0].sure, "whether tires gain as the load does, who knows the car must say"
    told = found[0].repair.on(car)
    for name, area in areas_of(car, lift).items():
        assert getattr(told, name) == pytest.approx(area, rel=0.25)
        assert f"{name} = {getattr(told, name):.2g}" in found[0].text
    alike = {one: missed_by(log, two) for one, two in (("told", told), ("untold", car))}
    assert (alike["told"] < 0.6 * alike["untold"]).all()


def missed_by(log, car):
    """Share of the force that the tires learnt of a log miss of its motion, (2,)."""
    tires = identify(log, car, make_method("axle", car)).freeze()
    return evidence(tires, log).missed


def test_downforce_that_is_told_rightly_is_none_that_is_missing():
    log, car = pressed(0.3, np.random.default_rng(3))
    assert estimate(log, replace(car, **areas_of(car, 0.3))) == ()


@pytest.mark.parametrize("told", [0.12, 0.5])
def test_downforce_that_is_told_is_judged_and_never_overruled(told):
    log, car = pressed(0.3, np.random.default_rng(3))
    (found,) = estimate(log, replace(car, **areas_of(car, told)))
    assert found.code == "downforce" and not found.sure
    assert found.size * (100.0 / 3.6) ** 2 == pytest.approx(0.3 - told, rel=0.35)
    assert ("push less at speed" in found.text) == (told > 0.3)
    for name, area in areas_of(car, 0.3).items():
        assert found.repair.vehicle[name] == pytest.approx(area, rel=0.25)


def test_where_there_is_none_no_downforce_is_named():
    assert estimate(*pressed(0.0, np.random.default_rng(3))) == ()


def test_every_kind_of_fault_has_a_suspect():
    codes = {(one.code, one.channel) for one in SUSPECTS}
    car = drawn_everyday("sedan", "slalom", 1).car.told
    for kind in KINDS:
        fault = planted(kind, car, np.random.default_rng(0))
        assert (fault.code, fault.channel) in codes


def test_a_repair_of_what_was_found_leaves_a_log_in_which_nothing_is_found(driven):
    car, log, _ = driven
    late = Late(channels=("r",), delay=0.08).apply(log)
    (found, *_) = estimate(late, car)
    assert (found.code, found.channel) == ("delay", "r")
    repaired, same = found.repair.apply(late, car)
    assert not [one for one in estimate(repaired, same) if one.confidence > 0.5]


def test_two_faults_at_once_are_both_found(driven):
    car, log, _ = driven
    faults = Together(
        faults=(
            Late(channels=("a_y",), delay=0.06),
            SensorFault(channel="delta_f", kind="biased", size=0.02),
        )
    )
    codes = {(one.code, one.channel): one.size for one in estimate(faults.apply(log), car)}
    assert codes["delay", "a_y"] == pytest.approx(0.06, abs=0.003)
    assert codes["offset", "delta_f"] == pytest.approx(0.02, abs=0.002)


def test_an_inertial_unit_that_is_late_is_one_fault(driven):
    car, log, _ = driven
    found = estimate(Late(channels=("r", "a_y"), delay=0.09).apply(log), car)
    one = next(one for one in found if one.code == "delay")
    assert one.channel == "r+a_y"
    assert one.size == pytest.approx(0.09, abs=0.005)
    assert one.repair == Repair(delay={"r": one.size, "a_y": one.size})


def test_what_is_alike_at_constant_speed_is_named_beside_it(driven):
    """v_y off by 1.7 % of the speed: a bias, or a sensor that is turned."""
    car, log, _ = driven
    slow = replace(log, v_x=np.full(len(log), float(np.median(log.v_x))))
    turned = Misaligned(angle=0.03).apply(replace(log, v_x=slow.v_x, a_y=None))
    codes = [(one.code, one.channel) for one in estimate(turned, car)[:2]]
    assert set(codes) == {("velocity_sensor_angle", "v_y"), ("offset", "v_y")}
    first = estimate(turned, car)[0]
    assert not first.sure
    assert "cannot tell it from" in first.text


def test_a_size_that_rests_on_a_number_of_the_car_is_not_sure(driven):
    """Without the center of gravity, which nobody takes out, the steering's factor is another."""
    car, log, _ = driven
    rng = np.random.default_rng(5)
    center = planted("center of gravity", car, rng)
    steering = planted("factor delta_f", car, np.random.default_rng(6))
    bad, told = steering.case.log(log), center.case.car(car)
    found = {one.code: one for one in estimate(bad, told)}
    assert found["factor"].confidence > 0.95
    assert not found["factor"].sure and not found["center_of_gravity"].sure
    balance = Balance((bad,), told)
    alone = Fitter(balance).fit(["factor.delta_f"], {})
    moved = abs(alone.sizes["factor.delta_f"] - math.log(found["factor"].size))
    assert moved > 2.0 * alone.deviation("factor.delta_f")
    assert estimate(bad, car)[0].sure


def test_a_size_that_stands_on_its_own_is_sure_beside_a_number_of_the_car(driven):
    car, log, _ = driven
    inertia = planted("yaw inertia", car, np.random.default_rng(5))
    late = Late(channels=("r",), delay=0.08).apply(log)
    found = {one.code: one for one in estimate(late, inertia.case.car(car))}
    assert found["delay"].sure and not found["yaw_inertia"].sure


def test_a_yaw_inertia_that_nobody_measured_is_taken_out_where_the_drive_tells_it(driven):
    car, log, _ = driven
    inertia = planted("yaw inertia", car, np.random.default_rng(5)).case.car(car)
    guessed = replace(inertia, estimated=("yaw_inertia",))
    (measured, *_), (found, *_) = estimate(log, inertia), estimate(log, guessed)
    assert found.code == measured.code == "yaw_inertia"
    assert found.sure and not measured.sure
    right = found.repair.on(guessed)
    assert right.yaw_inertia == pytest.approx(car.yaw_inertia, rel=0.15)
    assert right.estimated == ()


def test_what_leaves_no_car_is_not_believed_and_what_is_named_for_it_is_in_doubt(driven):
    """The log of a car that is told so that its center of gravity seems to be on the front axle."""
    car, log, _ = driven
    center = next(one for one in SUSPECTS if one.code == "center_of_gravity")
    inertia = next(one for one in SUSPECTS if one.code == "yaw_inertia")
    assert center.leaves_a_car(0.1, car) and not center.leaves_a_car(0.9 * car.l_f, car)
    assert inertia.leaves_a_car(0.3, car) and not inertia.leaves_a_car(2.0, car)
    search = Search(Balance((log,), car))
    far, small = (
        {**search.fit.sizes, key: size}
        for key, size in (("center_of_gravity", 0.9 * car.l_f), ("center_of_gravity", 0.01))
    )
    likely = Candidate(inertia, replace(search.fit, sizes={"yaw_inertia": 0.3}), 10.0)
    other = Candidate(center, replace(search.fit, sizes=small), 30.0)
    search._believed = lambda suspect, *_: suspect is inertia
    for one in (other, other._replace(fit=replace(search.fit, sizes=far), gain=12.0)):
        assert search._ranked([likely, one]) == [likely]
        assert not search.in_doubt
    assert search._ranked([likely, one._replace(gain=30.0)]) == [likely]
    assert search.in_doubt


def test_where_more_is_wrong_at_once_than_is_believed_nothing_is_sure(driven, monkeypatch):
    car, log, _ = driven
    late = Late(channels=("a_y",), delay=0.1)
    bias = SensorFault(channel="delta_f", kind="biased", size=0.03)
    bad = Together(faults=(late, bias)).apply(log)
    assert [one.sure for one in estimate(bad, car)] == [True, True]
    monkeypatch.setattr(sys.modules[Search.__module__], "SEVERAL", 1)
    assert [one.sure for one in estimate(bad, car)] == [False, False]


@pytest.mark.parametrize("between", [2, 3])
def test_nothing_is_found_in_a_right_log_that_was_drawn_from_a_slower_clock(driven, between):
    car, log, _ = driven
    t = np.linspace(log.t[0], log.t[-1], between * (len(log) - 1) + 1)
    names = ("v_x", "v_y", "r", "delta_f", "delta_r", "a_y")
    signals = {name: np.interp(t, log.t, getattr(log, name)) for name in names}
    assert estimate(replace(log, t=t, **signals), car) == ()


@pytest.mark.parametrize(
    ("key", "word"),
    [("delay.r", "early"), ("offset.r", "too little"), ("velocity_sensor_x", "behind"),
     ("center_of_gravity", "too far forward"), ("bank", "to the right")],
)  # fmt: skip
def test_what_is_negative_is_said_the_other_way_round(key, word):
    suspect = next(one for one in SUSPECTS if one.key == key)
    assert word not in suspect.words(0.1, 0.01, sedan())
    said = suspect.words(-0.1, 0.01, sedan())
    assert word in said and "-" not in said


def test_a_yaw_inertia_that_the_file_leaves_out_was_estimated_and_not_told():
    suspect = next(one for one in SUSPECTS if one.key == "yaw_inertia")
    assert suspect.words(0.3, 0.1, sedan()).startswith("the told yaw inertia is 1.35")
    left_out = replace(sedan(), estimated=("yaw_inertia",))
    assert suspect.words(0.3, 0.1, left_out).startswith("the estimated yaw inertia is 1.35")


def test_what_nobody_believes_is_not_sure_nor_what_rests_on_it(monkeypatch):
    """A lag of a small car that the drive hardly tells: several sizes drift off together."""
    log, car, _ = drawn("tenth", 620)
    fault = planted("lag v_y", car, np.random.default_rng([620, 13, 7]))
    bad = fault.case.log(log)
    monkeypatch.setattr(sys.modules[Search.__module__], "SURE", 0.8)
    monkeypatch.setattr(sys.modules[Search.__module__], "STANDS", 0.0)
    found = estimate(bad, car)
    scaled = next(one for one in found if (one.code, one.channel) == ("factor", "v_y"))
    assert math.log(scaled.size) > 3.5 * 0.2
    assert scaled.confidence > 0.8
    assert not any(one.sure for one in found)


def test_the_confidence_counts_how_far_a_size_is_from_nothing(driven, monkeypatch):
    car, log, _ = driven
    bad = SensorFault(channel="r", kind="scaled", size=1.1).apply(log)
    (found, *_) = estimate(bad, car)
    away = math.log(found.size) / (found.deviation / found.size)
    monkeypatch.setattr(Search, "real_deviation", lambda *_: math.log(found.size))
    (doubted, *_) = estimate(bad, car)
    assert found.confidence > 0.95 * math.erf(away / math.sqrt(2.0))
    assert doubted.confidence == pytest.approx(0.683, abs=0.02)
    assert doubted.group == pytest.approx(0.683, abs=0.02)


def test_what_else_is_a_little_off_moves_a_size_as_far_as_is_told(driven):
    """A factor of r beside a small delay that is not estimated, and beside one of v_y."""
    car, log, _ = driven
    bad = replace(log, r=1.1 * log.r)
    fitter = Fitter(Balance((bad,), car))
    fit, least = fitter.fit(["factor.r"], {}), 0.004
    for key, channel in (("delay.a_y", "a_y"), ("delay.v_y", "v_y")):
        told = fitter.moved(fit, {key: least})["factor.r"]
        late = Late(channels=(channel,), delay=least).apply(bad)
        there = Fitter(Balance((late,), car)).fit(["factor.r"], {})
        assert abs(there.sizes["factor.r"] - fit.sizes["factor.r"]) == pytest.approx(told, rel=0.35)
    both = fitter.moved(fit, {"delay.a_y": least, "delay.v_y": least})["factor.r"]
    assert both > told


def test_what_small_faults_could_make_is_not_sure_and_its_deviation_says_so(driven, monkeypatch):
    car, log, _ = driven
    bad = SensorFault(channel="r", kind="scaled", size=1.1).apply(log)
    (found, *_) = estimate(bad, car)
    search = Search(Balance((bad,), car))
    search.run()
    alone = search.deviation(search.found[0].suspect, search.fit)
    assert found.deviation > 1.1 * found.size * alone
    assert found.sure
    monkeypatch.setattr(sys.modules[Search.__module__], "STANDS", 20.0)
    assert not estimate(bad, car)[0].sure


def test_a_log_that_no_fault_explains_has_none_and_says_so(driven):
    """The steering is what a servo was told, which went another way."""
    car, log, _ = driven
    said = examine(replace(log, delta_f=log.delta_f[::-1].copy()), car)
    assert said.findings == ()
    assert "front axle" in said.unseen[0] and "commanded" in said.unseen[0]


def test_what_a_straight_drive_cannot_tell_is_said(driven):
    car, log, _ = driven
    names = ("v_y", "r", "delta_f", "a_y")
    straight = replace(log, **{name: 0.003 * getattr(log, name) for name in names})
    said = examine(straight, car)
    assert said.findings == ()
    assert any(line.startswith("yaw inertia") for line in said.unseen)
    assert any(line.startswith("center of gravity") for line in said.unseen)


def test_a_drive_that_never_drives_is_not_asked(driven):
    car, log, _ = driven
    said = examine(replace(log, v_x=0.01 * log.v_x), car)
    assert said.findings == ()
    assert "hardly drives" in said.unseen[0]


# The equations, by other roads.


def test_kinematics_hold_exactly_on_an_exact_drive(driven):
    car, _, exact = driven
    balance = Balance((exact,), car)
    x = balance.channels({})
    missed = balance._kinematics(x, np.zeros(x["v_y"].size), {}) * GRAVITY
    assert np.sqrt(np.mean(missed**2)) < 2e-3 * np.sqrt(np.mean(exact.a_y**2))
    wrong = balance._kinematics(x, np.zeros(x["v_y"].size), {"acceleration_sensor_x": 0.5})
    assert np.sqrt(np.mean((wrong * GRAVITY) ** 2)) > 0.02


def test_windows_differentiate_without_a_bias(driven):
    car, log, _ = driven
    balance = Balance((log,), car)
    t = balance.dt * np.arange(balance.at.size)
    line = balance.rate @ (3.0 + 2.0 * t)
    np.testing.assert_allclose(line, 2.0, rtol=1e-9)
    np.testing.assert_allclose(balance.mean @ np.full(t.size, 5.0), 5.0, rtol=1e-9)


def test_noise_is_what_noise_alone_leaves(driven):
    """Monte Carlo: a straight drive of noise alone, its windows' variance beside the formula."""
    car, log, _ = driven
    rng = np.random.default_rng(3)
    n = len(log)
    noise = {"v_y": 0.03, "r": 0.003, "a_y": 0.02}
    alone = replace(
        log,
        v_x=np.full(n, 20.0),
        delta_f=np.zeros(n),
        **{name: rng.normal(0.0, size, n) for name, size in noise.items()},
    )
    balance = Balance((alone,), car)
    x = balance.channels({})
    missed = balance._kinematics(x, np.zeros(balance.at.size), {})
    speed = np.full(len(balance), 20.0)
    told = balance._noise(2, {}, None, speed, speed)
    assert np.var(missed) == pytest.approx(np.mean(told), rel=0.25)


def test_a_factor_that_only_shrinks_the_noise_gains_nothing(driven):
    car, log, _ = driven
    fitter = Fitter(Balance((log,), car))
    clean = fitter.fit((), {})
    for key in ("factor.v_y", "factor.r", "delay.v_y"):
        assert clean.J - fitter.fit((key,), clean.sizes).J < 3.0


def test_a_channel_is_read_between_its_samples():
    dt = 0.02
    t = dt * np.arange(200)
    smooth = thinned(np.sin(3.0 * t), 1, dt, 1)
    a, b = slice(50, 100), slice(51, 101)
    between = cubic(smooth.value[a], smooth.value[b], smooth.slope[a], smooth.slope[b], 0.3, dt)
    np.testing.assert_allclose(between, np.sin(3.0 * (t[a] + 0.3 * dt)), atol=2e-3)


def test_windows_are_longer_where_there_is_more_noise(driven):
    car, log, exact = driven
    quiet = Balance((exact,), car).white
    loud = {name: 3.0 * size for name, size in Balance((log,), car).white.items()}
    assert window_length((exact,), car, quiet) < window_length((log,), car, loud)


def test_a_long_log_is_looked_at_where_it_is_lively(driven):
    car, log, _ = driven
    n = 10 * len(log)
    longer = replace(
        log,
        t=log.dt * np.arange(n),
        **{
            name: np.tile(getattr(log, name), 10)
            for name in ("v_x", "v_y", "r", "delta_f", "delta_r", "a_y")
        },
    )
    parts = stretches_of(longer, car, longest=60.0, pieces=4)
    assert len(parts) == 4
    assert sum(part.duration for part in parts) == pytest.approx(60.0, abs=0.1)
    turning = math.sqrt(sum(np.mean(part.r**2) for part in parts) / 4.0)
    assert turning > math.sqrt(np.mean(log.r**2))
    assert stretches_of(log, car, longest=61.0, pieces=4) == (log,)


@pytest.mark.parametrize("n", range(6000, 6006))
def test_a_log_that_is_hardly_longer_than_what_is_looked_at_is_cut_all_the_same(driven, n):
    """A minute at 100 Hz and some samples: parts then are as long as what is taken of them."""
    car, log, _ = driven
    fine = np.linspace(0.0, 59.0, n)
    names = ("v_x", "v_y", "r", "delta_f", "delta_r", "a_y")
    signals = {name: np.interp(fine, log.t, getattr(log, name)) for name in names}
    minute = replace(log, t=0.01 * np.arange(n), **signals)
    parts = stretches_of(minute, car, longest=60.0, pieces=4)
    if minute.duration <= 60.0:
        assert parts == (minute,)
    else:
        assert [len(part) for part in parts] == [1500] * 4


def test_nothing_is_made_of_the_jump_over_a_gap(driven):
    car, log, _ = driven
    n = len(log)
    kept = np.r_[0 : n // 3, n // 3 + 700 : n // 3 + 750, n // 2 : n]
    broken = log.taken(kept)
    assert len(broken.breaks) == 2
    parts = stretches_of(broken, car, longest=61.0, pieces=4)
    assert [len(part) for part in parts] == [n // 3, n - n // 2]  # half a second is left out
    assert not any(part.breaks for part in parts)
    assert estimate(broken, car) == ()
    late = Late(channels=("r",), delay=0.08).apply(log).taken(kept)
    assert estimate(late, car)[0].size == pytest.approx(0.08, abs=0.003)


@pytest.mark.parametrize("suspect", SUSPECTS, ids=lambda one: one.key)
def test_a_suspect_repairs_what_it_says(suspect, driven):
    car, log, _ = driven
    size = 0.5 * suspect.plausible
    repair = suspect.repair(size, car)
    without = ("bank", "downforce", "velocity_sensor_z")
    assert (repair is None) == (suspect.code in without)
    if repair is not None:
        assert repair
        repair.apply(log, car)
    assert "±" in suspect.words(size, 0.1 * size, car)


def test_a_finding_that_is_sure_has_a_repair():
    with pytest.raises(ValueError, match="must have a repair"):
        Finding(code="delay", confidence=1.0, sure=True)
    with pytest.raises(ValueError, match="between 0 and 1"):
        Finding(code="delay", confidence=1.2)


def test_every_suspect_has_a_name_in_words():
    assert {one.code for one in SUSPECTS if "_" in one.code} <= set(NAMES)
