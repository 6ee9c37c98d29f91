"""Each suspect: its repair takes out what was planted, and words and limits have a direction."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from benchmarks.doctor_cases import KINDS
from identifier.doctor.suspects import SUSPECTS, TURNING, usual_inertia
from identifier.estimate.drive import gradient
from identifier.measured import with_doubt
from identifier.motion.model import SENSORS, true_signals
from models.recordings.record import CHANNELS
from models.vehicle import sedan
from tests.made import made

CAR = sedan()
BY_NAME = {(one.code, one.channel): one for one in SUSPECTS}
SIZES = [
    (kind, sign) for kind, (*_, signed) in KINDS.items() for sign in ((-1.0, 1.0)[not signed :])
]


def swing(t, *frequencies):
    return sum(np.sin(2.0 * math.pi * f * t + k) for k, f in enumerate(frequencies, 1))


@pytest.fixture(scope="module")
def clean():
    t = 0.01 * np.arange(3000)
    r, v_x = 0.2 * swing(t, 0.23, 0.41), 20.0 + swing(t, 0.11)
    v_y, delta_f = 0.4 * swing(t, 0.31, 0.37), 0.03 * swing(t, 0.19, 0.47)
    return made(t, v_x=v_x, r=r, v_y=v_y, a_y=v_x * r, delta_f=delta_f)


def planted(kind, sign):
    """A fault of the largest size of its kind, and the suspect that it is."""
    plant, _, most, _ = KINDS[kind]
    fault = plant(CAR, sign * most)
    return fault, BY_NAME[fault.code, fault.channel]


def away(log, clean, names=CHANNELS):
    """How far each channel is from the clean one, the ends left out."""
    at = clean.t[100:-100]
    gone = [np.interp(at, log.t, getattr(log, n)) - getattr(clean, n)[100:-100] for n in names]
    return np.sqrt(np.mean(np.square(gone), axis=1))


@pytest.mark.parametrize(("kind", "sign"), SIZES)
def test_the_repair_takes_out_what_was_planted(clean, kind, sign):
    fault, suspect = planted(kind, sign)
    logged, declared_one = fault.case.log(clean), fault.case.car(CAR)
    repair = suspect.repair(fault.size, declared_one)
    assert suspect.plausible(fault.size, declared_one)
    if kind == "bank":
        assert repair is None
        return
    mended, car = repair.apply(logged, declared_one)
    assert [car.l_f, car.l_r, car.yaw_inertia] == pytest.approx([CAR.l_f, CAR.l_r, CAR.yaw_inertia])
    before = away(logged, clean)
    assert (away(mended, clean) <= 0.1 * before.max()).all()
    assert (before.max() > 0.0) == (declared_one == CAR)


OF_SENSORS = [each for each in SIZES if planted(*each)[1].parameter in SENSORS]


@pytest.mark.parametrize(("kind", "sign"), OF_SENSORS)
def test_the_number_of_the_model_that_tells_a_size_takes_it_out_too(clean, kind, sign):
    fault, suspect = planted(kind, sign)
    value = brentq(
        lambda x: suspect.size(x) - fault.size, -0.9 if suspect.code == "factor" else -2.0, 2.0
    )
    logged = fault.case.log(clean)
    names = ("v_x", "v_y", "r", "delta_f")
    rates = [gradient(getattr(logged, name), logged.dt) for name in names[1:]]
    p = [value if name == suspect.parameter else 0.0 for name in SENSORS]
    true = true_signals([*(getattr(logged, name) for name in names), *rates], p)
    mended = replace(logged, **dict(zip(names, true, strict=True)))
    # Of a delay and a low pass the model takes the slope alone.
    assert (away(mended, clean, names) <= 0.4 * away(logged, clean).max()).all()


def test_every_suspect_is_planted_here_but_downforce_and_play():
    found = {planted(*each)[1] for each in SIZES}
    assert found == set(SUSPECTS) - {BY_NAME["downforce", ""], BY_NAME["play", "delta_f"]}


def test_the_lateness_of_one_device_is_taken_off_both_channels():
    assert TURNING.repair(0.05, CAR).delay == {"r": 0.05, "a_y": 0.05}
    assert BY_NAME["lag", "r"].repair(0.0, CAR) is None
    assert BY_NAME["downforce", ""].repair(1e-4, CAR) is None


@pytest.mark.parametrize(
    ("name", "more", "less"),
    [
        (("offset", "r"), "the yaw rate reads {} rad/s too much", "too little"),
        (("delay", "v_y"), "v_y is {} ms late against", "early against"),
        (("velocity_sensor_x", "v_y"), "measured {} m ahead of", "behind the center"),
        (("velocity_sensor_angle", "v_y"), "turned by {}° to the left", "to the right"),
        (("center_of_gravity", ""), "declared {} m too far back", "too far forward"),
        (("bank", ""), "falls by {}° to the left", "to the right"),
        (("downforce", ""), "grow with speed, as by a downforce of {} %", "shrink with speed, as"),
    ],
)
def test_words_have_the_direction_of_a_size_and_its_deviation(name, more, less):
    suspect = BY_NAME[name]
    said, opposite = (suspect.words(size, -0.01, CAR) for size in (0.4, -0.4))
    number = with_doubt(0.4 * suspect.per_unit, 0.01 * suspect.per_unit)
    assert more.format(number) in said
    assert less in opposite and "-" not in opposite and number in opposite


def test_a_size_grows_with_the_car_as_lengths_and_speeds_do():
    long = replace(CAR, l_f=4.0 * CAR.l_f, l_r=4.0 * CAR.l_r)
    grows = {("velocity_sensor_x", "v_y"): 4.0, ("offset", "v_y"): 2.0, ("offset", "r"): 0.5}
    for name, suspect in BY_NAME.items():
        if suspect.code in ("offset", "velocity_sensor_x", "factor"):
            ratio = suspect.scaled(1.0, long) / suspect.scaled(1.0, CAR)
            assert ratio == pytest.approx(grows.get(name, 1.0))


def test_what_leaves_no_car_is_not_believed():
    center, inertia, lag = (
        BY_NAME[name] for name in (("center_of_gravity", ""), ("yaw_inertia", ""), ("lag", "r"))
    )
    assert center.plausible(0.1, CAR) and center.plausible(-0.1, CAR)
    assert not center.plausible(CAR.l_f - 0.2 * CAR.wheelbase, CAR)
    assert not center.plausible(CAR.l_f - 0.8 * CAR.wheelbase, CAR)
    small = replace(CAR, l_f=0.15, l_r=0.15, yaw_inertia=CAR.mass * 0.15**2)
    assert usual_inertia(small) == (0.3, 1.6) and usual_inertia(CAR) == (0.5, 1.6)
    for car, most in ((replace(CAR, yaw_inertia=CAR.mass * CAR.l_f * CAR.l_r), 2.0), (small, 3.3)):
        assert inertia.plausible(0.9 * most, car) and not inertia.plausible(1.1 * most, car)
        assert inertia.plausible(0.7, car) and not inertia.plausible(0.6, car)
    assert lag.plausible(0.1, CAR) and not lag.plausible(-0.1, CAR)
    for name, beyond in (
        (("velocity_sensor_x", "v_y"), 0.5 * CAR.wheelbase),
        (("acceleration_sensor_x", "a_y"), 0.2 * CAR.wheelbase),
    ):
        least, most = -CAR.l_r - beyond, CAR.l_f + beyond
        for x in (least, most):
            assert BY_NAME[name].plausible(0.99 * x, CAR)
            assert not BY_NAME[name].plausible(1.01 * x, CAR)
