"""The screen rings on each gross fault that is planted, and is silent on what is right."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks import doctor_cases
from benchmarks.everyday_drives import everyday_log
from benchmarks.fault_cases import StraightOnly
from benchmarks.faults import Held, SensorElsewhere, Together
from benchmarks.random_cars import CLASSES, good_sensors
from benchmarks.recorded_cars import CARMAKER, DART
from identifier.doctor import diagnose
from identifier.doctor.pieces import PIECE, PIECES, looked_at
from identifier.doctor.readings import (
    CHANGES,
    Change,
    Motion,
    Read,
    Reading,
    _Explanation,
    _least,
    forces_and_slips,
    unexplained,
)
from identifier.doctor.samples import sample_findings
from identifier.doctor.screen import _unlike, screen, steering_finding
from models.faults import SensorFault
from models.maneuvers import SampledSteer
from models.plant import Plant
from models.recordings import joined, read_recording, runs
from models.vehicle import sedan
from tests.identifier.conftest import codes_of, drawn, steered
from tireid.driving.learn import sample_recording

DEGREES = 180.0 / np.pi
RECORDED = {"carmaker.csv.gz": CARMAKER, "dart.csv.gz": DART, "dart_imu.csv.gz": DART}


def scaled(channel, size):
    return SensorFault(channel=channel, kind="scaled", size=size)


def in_sideslip(recording, per_rad=1.0):
    return replace(recording, v_y=per_rad * np.arctan(recording.v_y / recording.v_x))


@pytest.fixture(scope="module", params=CLASSES)
def driven(request):
    return drawn(request.param, 41)


@pytest.fixture(scope="module")
def one():
    return drawn("sedan", 42)


def named(recording, car):
    return codes_of(screen(recording, car).findings)


CHANNELS = ("v_x", "v_y", "r", "delta_f", "a_y")
NAMES = (
    *(f"{name} flipped" for name in CHANNELS),
    *("r and steering mirrored", "v_y and a_y mirrored", "r in degrees", "steering in degrees"),
    *("v_x in km/h", "a_y in g"),
)
GROSS = {"v_x in mph": (scaled("v_x", 1.0 / 0.44704), "unit v_x")}
for name in NAMES:
    case, right = doctor_cases.GROSS[name](sedan(), np.random.default_rng(0))
    GROSS[name] = case.fault, " ".join(right[0])


@pytest.mark.sweep("tenth", "compact")
def test_a_drive_that_is_right_is_left_alone(driven):
    car, log = driven
    found = screen(log, car)
    assert found.findings == ()
    assert not found.repair and not found.blind
    assert screen(replace(log, a_y=None), car).findings == ()


@pytest.mark.sweep("sedan-508-1")
@pytest.mark.parametrize(
    ("kind", "seed", "half"),
    [("compact", 502, 0), ("compact", 506, 0), ("sedan", 502, 0), ("sedan", 508, 1)],
)
def test_a_v_y_that_hardly_stands_out_of_its_noise_has_no_unit_of_its_own(kind, seed, half):
    """Half a minute of gentle bends: read in mm/s, or as an angle, v_y would be next to nothing."""
    log, car, _ = everyday_log(kind, seed)
    n = len(log) // 2
    calm = log.taken(slice(half * n, (half + 1) * n))
    found = screen(calm, car)
    assert found.findings == ()
    assert "v_y" in Motion.of(calm).hidden
    assert any(line.startswith("unit of v_y") for line in found.unobservable)
    lively = log.taken(slice((1 - half) * n, (2 - half) * n))
    assert Motion.of(lively).hidden == frozenset()
    assert screen(scaled("v_x", 3.6).apply(calm), car).findings[0].code == "unit"


@pytest.mark.sweep(
    "sedan-v_y flipped",
    "sedan-v_x in mph",
    "tenth-r and *",
    "race-a_y flipped",
    "compact-steering in degrees",
)
@pytest.mark.parametrize("case", GROSS)
def test_every_gross_fault_is_the_first_that_is_named_and_its_repair_gives_the_drive_back(
    driven, case
):
    car, log = driven
    fault, want = GROSS[case]
    broken = fault.apply(log)
    found = screen(broken, car)
    first = found.findings[0]
    assert codes_of([first]) == [want]
    if first.sure and not case.endswith("mirrored"):  # which mirrors the other channels, too
        mended, declared = found.repair.apply(broken, car)
        assert declared == car
        for name in CHANNELS:
            np.testing.assert_allclose(getattr(mended, name), getattr(log, name), atol=1e-9)


def test_speeds_in_mm_per_s_are_read_as_such():
    """Of a small car: those of others are beyond what a log may hold."""
    car, log = drawn("tenth", 41)
    millimeters = Together(faults=(scaled("v_x", 1e3), scaled("v_y", 1e3)))
    assert named(millimeters.apply(log), car) == ["unit v_x", "unit v_y"]


@pytest.mark.sweep("57*")
@pytest.mark.parametrize("per_rad", [1.0, DEGREES])
def test_sideslip_in_place_of_v_y_is_read_as_such(one, per_rad):
    """At nearly one speed km/h come to the same as degrees, which is as good a repair."""
    car, log = one
    log = replace(log, v_x=log.v_x * np.linspace(0.9, 1.1, len(log)))  # a speed that tells
    found = screen(in_sideslip(log, per_rad), car)
    assert found.findings[0].channel == "v_y"
    mended, _ = found.repair.apply(in_sideslip(log, per_rad), car)
    np.testing.assert_allclose(mended.v_y, log.v_y, atol=0.25 * np.std(log.v_y))


def elsewhere(log, x):
    return SensorElsewhere(sensor="velocity", x=x).apply(log)


@pytest.mark.sweep("1500-sedan", "1501-tenth")
@pytest.mark.parametrize("kind", CLASSES)
@pytest.mark.parametrize("seed", [1500, 1501])
def test_a_velocity_sensor_at_an_axle_is_no_gross_fault(kind, seed):
    """Gentle bends and one maneuver, with an accelerometer and without one."""
    log, car, _ = everyday_log(kind, seed)
    for x in (car.l_f, -car.l_r):
        assert screen(elsewhere(log, x), car).findings == ()


@pytest.mark.sweep("sedan-r flipped", "tenth-a_y in g", "race-v_x flipped", "compact-r in degrees")
@pytest.mark.parametrize("case", ["r flipped", "r in degrees", "v_x flipped", "a_y in g"])
def test_gross_faults_are_named_beside_a_sensor_at_the_rear_axle(driven, case):
    car, log = driven
    fault, want = GROSS[case]
    found = screen(fault.apply(elsewhere(log, -car.l_r)), car).findings
    assert codes_of(found) == [want]


@pytest.mark.sweep("tenth")
def test_another_car_and_its_size_are_told(driven):
    car, log = driven
    other = DART if car.mass > 100.0 else replace(sedan(), chassis=None)
    found = screen(log, other)
    assert found.findings[0].code == "other_car"
    declared = found.findings[0].size * car.wheelbase / other.wheelbase
    assert abs(np.log(declared)) < np.log(2.0)
    assert found.blind
    assert not found.findings[0].sure


def test_an_inertia_that_no_car_has_is_told_without_a_log(one):
    car, log = one
    for factor, declared in ((0.49, True), (0.51, False), (1.59, False), (1.61, True)):
        wrong = replace(car, yaw_inertia=factor * car.mass * car.l_f * car.l_r)
        found = _unlike(wrong)
        assert len(found) == declared
        for one in found:
            assert one.size == pytest.approx(factor) and f"is {factor:.2g} times" in one.text
            assert one.repair.on(wrong).yaw_inertia == pytest.approx(wrong.yaw_inertia / factor)
    assert "yaw_inertia" in named(log, replace(car, yaw_inertia=4.0 * car.yaw_inertia))


def test_a_factor_of_the_steering_is_what_it_most_likely_is():
    assert steering_finding(-1.1, 1.0).code == "sign"
    assert steering_finding(1.05 / DEGREES, 1.0).code == "unit"
    wheel = steering_finding(-1.0 / 14.6, 1.0)
    assert (wheel.code, wheel.size) == ("steering_ratio", pytest.approx(14.6))
    assert "positive to the right" in wheel.text
    wheel = steering_finding(1.0 / (14.6 * DEGREES), 1.0, deviation=0.01)
    assert (wheel.code, wheel.size) == ("steering_ratio", pytest.approx(14.6))
    assert wheel.deviation == pytest.approx(0.146)
    assert "degrees" in wheel.text
    for size, code in (
        (4.8, "factor"),
        (5.2, "steering_ratio"),
        (29.0, "steering_ratio"),
        (31.0, "factor"),
    ):
        assert steering_finding(1.0 / size, 1.0).code == code
        assert steering_finding(-1.0 / (size * DEGREES), 1.0).code == code
    other = steering_finding(0.5, 1.0)
    assert (other.code, other.sure) == ("factor", False)


@pytest.mark.parametrize("seed", range(3))
def test_a_turned_steering_angle_is_sure_whatever_ratio_might_stand_beside_it(seed):
    log = sample_recording(sedan(), seed=seed)
    found = diagnose(replace(log, delta_f=-log.delta_f), sedan())
    (one,) = found.findings
    assert (one.code, one.channel, one.sure) == ("sign", "delta_f", True)
    assert found.repair.factor == {"delta_f": -1.0}


def test_a_straight_drive_is_told_to_hold_nothing(one):
    car, log = one
    straight = StraightOnly(sensors=good_sensors(car)).apply(log)
    assert named(straight, car)[0] == "straight"
    assert "corners" in screen(straight, car).blind


@pytest.mark.parametrize("channel", ["v_y", "r", "delta_f"])
def test_a_channel_that_shows_nothing_is_named_and_ends_the_search(one, channel):
    car, log = one
    broken = SensorFault(channel=channel, kind="zero").apply(log)
    assert named(broken, car)[0] == f"frozen {channel}"
    assert channel in screen(broken, car).blind


def rounded_speed(one, lost):
    """The drive as it slows down and speeds up, v_x with two digits in km/h, some samples lost."""
    _, log = one
    rng = np.random.default_rng(5)
    v_x = 25.0 + 15.0 * np.sin(0.3 * log.t) + 0.03 * rng.standard_normal(len(log))
    v_x = np.round(3.6 * v_x, 2) / 3.6
    again = 1 + np.flatnonzero(rng.random(len(log) - 1) < lost)
    v_x[again] = v_x[again - 1]
    return [one for one in sample_findings(replace(log, v_x=v_x)) if one.channel == "v_x"]


def test_numbers_that_rounding_makes_alike_are_no_lost_samples(one):
    assert rounded_speed(one, lost=0.0) == []
    (held,) = rounded_speed(one, lost=0.04)
    assert held.code == "held"


def steered_by_hand(lost):
    """A sedan's drive, its wheel told in steps of 0.1 degrees by another clock, and held still."""
    rng, ratio, step = np.random.default_rng(7), 16.0, 0.1
    t = np.arange(0.0, 60.0, 0.1)
    swings = 0.05 * np.sin(0.9 * t) * np.maximum(np.sin(0.21 * t) - 0.1, 0.0)
    steering = SampledSteer(times=tuple(t), angles=tuple(swings), rate_limit=1.0, duration=60.0)
    log = Plant(sedan()).simulate(steering, speed=20.0, name="by hand").recording()
    log = good_sensors(sedan()).apply(log, rng)
    wheel = np.degrees(ratio * np.interp(log.t, t, swings))
    wheel += 0.02 * rng.standard_normal(len(log))
    wheel = np.radians(step * np.round(wheel / step)) / ratio
    for k in np.flatnonzero(lost * rng.random(len(log)) > 0.97):
        wheel[k + 1 : k + 5] = wheel[k]
    return replace(log, delta_f=np.interp(log.t, log.t - 0.37 * log.dt, wheel))


def test_a_coarse_steering_wheel_that_rests_has_lost_nothing():
    assert sample_findings(steered_by_hand(lost=False)) == []
    found = sample_findings(steered_by_hand(lost=True))
    assert codes_of(found) == ["held delta_f"]


def test_a_v_y_that_is_switched_off_when_slow_is_no_measurement(one):
    car, log = one
    slow = np.sin(1.3 * log.t) < -0.3
    log = replace(log, v_x=log.v_x * np.where(slow, 0.9, 1.1), v_y=np.where(slow, 0.0, log.v_y))
    found = screen(log, car)
    (off,) = (one for one in found.findings if one.channel == "v_y")
    assert off.code == "zero" and "exactly 0" in off.text
    assert off.size == pytest.approx(log.dt * np.count_nonzero(slow), rel=0.15)
    assert "v_y" in found.blind


def test_a_slow_sampling_interval_is_a_clock_in_ms_and_nothing_else_is_asked(one):
    car, log = one
    for broken in (log, replace(log, r=-log.r)):
        found = screen(replace(broken, t=1e3 * log.t), car)
        assert codes_of(found.findings) == ["clock_unit"]
        assert not found.repair
        assert "clock" in found.blind


def test_smooth_drives_without_noise_are_left_alone():
    """Of a simulator: channels that rest before the corners, no noise, a constant speed."""
    for seed in range(2):
        log = steered(seed, 24.0, amplitude=0.06, frequency=0.6, onset=5.0).recording()
        assert screen(log, sedan()).findings == ()


def test_gaps_are_no_jumps_and_of_a_long_log_some_pieces_are_looked_at(one, long):
    car, log = one
    late = replace(log, t=log.t + 100.0)
    two = joined([log, late])
    assert screen(two, car).findings == ()
    pieces = looked_at(long[1])
    assert sum(one.duration for one in pieces) <= PIECE * PIECES
    assert screen(long[1], car).findings == ()


def test_the_right_reading_leaves_least_and_a_standing_car_is_no_motion(one):
    car, log = one
    motion = Motion.of(log)
    right = unexplained(motion, car, Reading())
    for wrong in (Reading(r=-1.0), Reading(v_x=3.6), Reading(delta=15.0), Reading(size=8.0)):
        assert unexplained(motion, car, wrong) > right + 1.0
    assert Motion.of(replace(log, v_x=np.zeros(len(log)))) is None


READINGS = {
    "speeds in km/h": ({"v_x": 3.6, "v_y": 3.6}, Reading(v_x=1.0 / 3.6, v_y=1.0 / 3.6)),
    "v_x in km/h": ({"v_x": 3.6}, Reading(v_x=1.0 / 3.6)),
    "r turned, in degrees": ({"r": -DEGREES}, Reading(r=-1.0 / DEGREES)),
    "a steering wheel": ({"delta_f": 15.0}, Reading(delta=1.0 / 15.0)),
    "all of them": (
        {"v_x": 3.6, "v_y": 2.0, "r": 5.0, "delta_f": -3.0},
        Reading(v_x=1.0 / 3.6, v_y=0.5, r=0.2, delta=-1.0 / 3.0),
    ),
}


def same_motion(logged, declared, reading, right, car):
    """Forces and slips of a log as it is read are those of the right log."""
    found, expected = (
        forces_and_slips(Motion.of(log), each, one)
        for log, each, one in ((logged, declared, reading), (right, car, Reading()))
    )
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_allclose(one, other, atol=0.01 * np.abs(other).max())


@pytest.mark.parametrize("case", READINGS)
def test_a_reading_takes_out_what_was_planted(one, case):
    car, log = one
    factors, reading = READINGS[case]
    logged = replace(log, **{name: k * getattr(log, name) for name, k in factors.items()})
    same_motion(logged, car, reading, log, car)


def test_a_reading_of_angles_places_and_sizes_is_that_of_the_right_log_and_car(one):
    car, log = one
    for per_rad in (1.0, DEGREES):
        angle = replace(log, v_y=per_rad * log.v_y / log.v_x)
        same_motion(angle, car, Reading(sideslip=True, v_y=1.0 / per_rad), log, car)
    ahead = SensorElsewhere(sensor="velocity", x=1.2).apply(log)
    same_motion(ahead, car, Reading(arm=1.2), log, car)
    half = replace(car, l_f=0.5 * car.l_f, l_r=0.5 * car.l_r, yaw_inertia=0.25 * car.yaw_inertia)
    same_motion(log, half, Reading(size=2.0), log, car)
    light = replace(half, yaw_inertia=0.125 * car.yaw_inertia)
    same_motion(log, light, Reading(size=2.0, inertia=2.0), log, car)


def test_changes_say_the_same_within_a_small_factor_and_exclude_one_another():
    wheel = Change(code="steering", channels=("delta_f",), factors=(("delta", 0.1),))
    other, turned = (replace(wheel, factors=(("delta", k),)) for k in (0.11, -0.1))
    far = replace(wheel, factors=(("delta", 0.12),))
    assert wheel.is_like(other) and not wheel.is_like(far) and not wheel.is_like(turned)
    sign = next(one for one in CHANGES if (one.code, one.channels) == ("sign", ("delta_f",)))
    assert turned.turned == sign and turned.is_like(sign) and not wheel.is_like(sign)
    assert wheel.turned is wheel
    unit = next(one for one in CHANGES if (one.unit, one.channels) == ("deg", ("delta_f",)))
    both = unit.on(wheel.on(Reading(delta=2.0)))
    assert both.delta == pytest.approx(0.2 / DEGREES)
    assert not unit.fields & wheel.fields and not unit.is_like(wheel)
    assert unit.by_channel == {"delta_f": pytest.approx(1.0 / DEGREES)}
    speeds = next(one for one in CHANGES if one.channels == ("v_x", "v_y") and one.unit == "km/h")
    alone = next(one for one in CHANGES if one.channels == ("v_y",) and one.unit == "km/h")
    assert speeds.fields & alone.fields and alone.price > speeds.price
    motion = SimpleNamespace(hidden=frozenset({"v_y"}))
    assert speeds.shows_in(motion) and not alone.shows_in(motion)


def test_a_price_and_confidence_come_from_what_is_left():
    change = CHANGES[0]
    free = Change(code="yaw_inertia", factors=(("inertia", 3.0),))
    plain, one, two = (
        _Explanation(changes=changes, reading=Reading(), left=-2.0)
        for changes in ((), (change,), (change, free))
    )
    assert [x.cost for x in (plain, one, two)] == pytest.approx([-2.0, -0.9, 0.7])
    sure = Read(best=plain, other=one).confidence
    assert sure == pytest.approx(1.0 / (1.0 + np.exp(-3.3)))
    assert Read(best=plain, other=plain).confidence == 0.5
    arm = Change(code="velocity_sensor_x", channels=("v_y",), arm=1.0)
    assert replace(two, changes=(arm, change)).gross == (change,)
    assert _least(lambda x: (x - 0.3) ** 2, -1.0, 1.0, 20) == pytest.approx(0.3, abs=1e-3)


@pytest.mark.parametrize("axle", ["front", "rear"])
def test_a_stiffness_that_is_not_the_told_one_costs_on_either_side(one, axle):
    car, log = one
    motion, name = Motion.of(log), f"cornering_stiffness_{axle}"
    left = [
        unexplained(motion, replace(car, **{name: share * getattr(car, name)}), Reading())
        for share in (1.0, 0.2, 5.0)
    ]
    assert 0.3 < left[1] - left[0] < 1.0 and 0.3 < left[2] - left[0] < 1.0


@pytest.fixture(scope="module")
def long(one):
    """The same drive twenty times, with pauses between: more than is looked at."""
    car, log = one
    return car, joined([replace(log, t=log.t + 100.0 * k) for k in range(20)])


def part_of(recording, **signals):
    """The recording with other values in its first segment."""
    changed = {name: getattr(recording, name).copy() for name in signals}
    for name, value in signals.items():
        changed[name][recording.segments[0]] = value
    return replace(recording, **changed)


def test_a_channel_that_rests_for_a_while_is_told_and_the_rest_is_asked(long):
    car, log = long
    broken = part_of(log, v_y=0.0)
    found = screen(scaled("r", DEGREES).apply(broken), car)
    first, frozen = found.findings
    assert codes_of([first, frozen]) == ["unit r", "frozen v_y"]
    assert frozen.size == pytest.approx(np.ptp(log.t[log.segments[0]]), abs=0.05)
    assert "v_y does not change from 0 s on for" in frozen.text
    assert not found.blind


def test_what_is_late_by_its_samples_is_mended_first_and_no_number_of_the_car_is(one):
    car, log = one
    heavy = replace(car, yaw_inertia=4.0 * car.mass * car.l_f * car.l_r)
    found = screen(Held(channels=("v_y",), every=0.1, lasts=0.1).apply(log), heavy)
    assert found.repair.delay == {"v_y": pytest.approx(0.045)}
    assert any(one.repair.vehicle for one in found.findings if one.repair is not None)
    assert found.repair.vehicle == {}


def test_of_a_reading_nothing_is_sure_where_one_part_is_not(one):
    """Degrees in r, and three times the steering angle, of which no unit is."""
    car, log = one
    broken = Together(faults=(scaled("r", DEGREES), scaled("delta_f", 3.0))).apply(log)
    found = screen(broken, car).findings
    assert {"unit r", "factor delta_f"} == {*codes_of(found)}
    assert not any(one.sure for one in found)
    assert screen(scaled("r", DEGREES).apply(log), car).findings[0].sure


@pytest.mark.sweep("carmaker*")
@pytest.mark.parametrize("file", RECORDED)
def test_recorded_drives_are_left_alone(shared_data, file):
    for run in runs(shared_data / file):
        log = read_recording(shared_data / file, run)
        sure = [f.text for f in screen(log, RECORDED[file]).findings if f.sure]
        assert sure == [], run
