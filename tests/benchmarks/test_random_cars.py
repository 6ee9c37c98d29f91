"""Random cars are cars of their class, their drives excite both axles, beginnings are as said."""

import math
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.fault_cases import random_case
from benchmarks.random_cars import (
    BEGINNINGS,
    CLASSES,
    REACHED,
    SPIN,
    Beginning,
    is_good,
    random_beginning,
    random_car,
    random_drive,
)
from models.maneuvers import StepSteer
from models.tires import DugoffTire, FialaTire, MagicFormula
from models.vehicle import GRAVITY


def generator(*seed):
    return np.random.default_rng([77, *seed])


@pytest.fixture(scope="module")
def car():
    return random_car("sedan", generator(0))


@pytest.mark.parametrize("kind", CLASSES)
def test_cars_are_of_their_class_and_drive(kind):
    drawn = [random_car(kind, generator(k)) for k in range(40)]
    for one in drawn:
        vehicle, declared = one.vehicle, one.declared
        assert CLASSES[kind].mass[0] <= vehicle.mass <= CLASSES[kind].mass[1]
        assert CLASSES[kind].wheelbase[0] <= vehicle.wheelbase <= CLASSES[kind].wheelbase[1]
        assert declared.chassis is None
        assert (declared.mass, declared.l_f, declared.yaw_inertia) == (
            vehicle.mass,
            vehicle.l_f,
            vehicle.yaw_inertia,
        )
        share = declared.cornering_stiffness_rear / vehicle.cornering_stiffness_rear
        assert 0.7 <= share <= 1.4
        assert one.tires[0] != one.tires[1]
    assert {type(one.tires[0]) for one in drawn} == {FialaTire, DugoffTire, MagicFormula}


@pytest.mark.sweep("[03]")
@pytest.mark.parametrize("seed", range(6))
def test_the_stiffness_of_a_car_is_that_of_its_tires(seed):
    """Axle force over slip on a gentle circle, against the number the car carries."""
    one = random_car("sedan", generator(seed))
    vehicle = one.vehicle
    gentle = StepSteer(amplitude=0.002, onset=0.5, rate_limit=0.1, duration=12.0)
    run = one.plant.simulate(gentle, speed=12.0)
    alpha = run.alpha[-1].reshape(2, 2).mean(axis=1)
    measured = run.axle_force[-1] / alpha
    stiffness = [vehicle.cornering_stiffness_front, vehicle.cornering_stiffness_rear]
    np.testing.assert_allclose(measured, stiffness, rtol=0.02)


def test_the_stiffness_of_the_magic_formula_falls_with_load_and_that_of_the_others_does_not():
    for seed in range(12):
        tire = random_car("race", generator(seed)).tires[0]
        ratio = float(tire.cornering_stiffness(6000.0)) / float(tire.cornering_stiffness(1500.0))
        assert (ratio < 0.75 * 4.0) if isinstance(tire, MagicFormula) else (ratio == 1.0)


@pytest.mark.parametrize("kind", CLASSES)
def test_a_drive_excites_both_axles_and_does_not_spin(kind):
    one = random_car(kind, generator(1))
    drive = random_drive(one, generator(2))
    exact = drive.exact
    assert np.abs(exact.v_y / exact.v_x).max() <= SPIN
    loads = one.vehicle.weight * np.array([one.vehicle.l_r, one.vehicle.l_f])
    share = np.abs(exact.axle_force).max(axis=0) / (loads / one.vehicle.wheelbase)
    assert (share >= REACHED * np.array(one.friction)).all()
    assert (share <= 1.05 * np.array(one.friction)).all()
    straight = exact.t < drive.beginning.lead
    assert np.abs(exact.r[straight]).max() < 1e-9


def test_a_drive_without_corners_and_one_that_spins_are_no_good(car):
    begin, speed = Beginning(lead=1.0), 20.0
    weak, wild = (
        car.plant.simulate(
            StepSteer(amplitude=amplitude, onset=1.0, rate_limit=1.0, duration=8.0), speed=speed
        )
        for amplitude in (0.002, 0.05)
    )
    assert not is_good(car, weak, begin, speed)
    spun = replace(wild, v_y=-0.6 * wild.v_x)
    assert not is_good(car, spun, begin, speed)


@pytest.mark.heavy
def test_the_same_seed_is_the_same_drive_and_noise(car):
    one, two = (random_drive(car, generator(4)).log(generator(5)) for _ in range(2))
    other = random_drive(car, generator(6)).log(generator(5))
    np.testing.assert_array_equal(one.v_y, two.v_y)
    assert np.abs(one.v_y[:3000] - other.v_y[:3000]).max() > 0.1


def test_rest_and_reverse_come_before_the_car_pulls_away(car):
    for speed in ("standing", "reversing"):
        begin = Beginning(kind=speed, lead=6.0, speed=speed, rest=2.0)
        drive = random_drive(car, generator(7), begin)
        before = drive.exact.t < 2.0 - 1e-9
        v_x = drive.exact.v_x
        assert v_x[before].max() <= 0.05 * drive.speed
        assert v_x[0] == 0.0 if speed == "standing" else v_x[0] < -2.0
        assert not drive.exact.axle_force[before].any()
        assert v_x[drive.exact.t > 12.0].mean() == pytest.approx(drive.speed, rel=0.1)
        assert np.diff(v_x).max() <= 0.01 * 3.1
        after = drive.cornering(drive.exact)
        assert after.t[0] == pytest.approx(8.5)


def test_a_bank_pulls_the_car_until_it_levels_out(car):
    drive = random_drive(car, generator(9), Beginning(kind="banked", lead=5.0, bank=0.05))
    exact = drive.exact
    inertial = np.gradient(exact.v_y, exact.dt) + exact.v_x * exact.r - exact.a_y
    np.testing.assert_allclose(inertial[10:390], GRAVITY * math.sin(0.05), rtol=0.01)
    assert np.abs(inertial[exact.t > 5.1]).max() < 0.05


def test_biases_stay_or_fade_and_roughness_ends_with_the_straight(car):
    begin = Beginning(
        kind="mixed",
        lead=6.0,
        rough=5.0,
        constant=(("v_y", 0.2),),
        fading=(("delta_f", 0.01),),
    )
    drive = random_drive(car, generator(10), begin)
    shown = drive.log(generator(11))
    off, t = shown.v_y - drive.exact.v_y, drive.exact.t
    rough, calm = np.std(off[t < 6.0]), np.std(off[t >= 6.0])
    assert rough / calm == pytest.approx(5.0, rel=0.1)
    assert np.mean(off) == pytest.approx(0.2, abs=0.03)
    steering = shown.delta_f - drive.exact.delta_f
    assert np.mean(steering[t < 3.0]) == pytest.approx(0.01, abs=2e-4)
    assert np.mean(steering[t > 5.5]) == pytest.approx(0.0, abs=2e-4)


@pytest.mark.parametrize("kind", BEGINNINGS)
def test_every_kind_of_beginning_is_drawn_and_is_of_its_kind(car, kind):
    drawn = [random_beginning(kind, car.vehicle, generator(k)) for k in range(30)]
    has = {
        "biased": lambda one: one.constant,
        "fading": lambda one: one.fading,
        "banked": lambda one: one.bank != 0.0,
        "rough": lambda one: one.rough > 1.0,
        "standing": lambda one: one.speed == "standing" and one.rest > 0.0,
        "reversing": lambda one: one.speed == "reversing" and one.rest > 0.0,
        "braking": lambda one: one.speed == "braking",
    }
    for name, holds in has.items():
        if kind == name:
            assert all(map(holds, drawn))
        elif kind != "mixed":
            assert not any(map(holds, drawn))
        else:
            assert 0 < sum(map(bool, map(holds, drawn))) < 30
    assert len({one.lead for one in drawn}) == 30


@pytest.mark.parametrize("kind", ["sedan", "tenth"])
def test_every_case_at_random_makes_a_log_and_a_car(kind):
    one = random_car(kind, generator(13))
    exact = random_drive(one, generator(14)).exact
    chance = [random_case(one.declared, generator(15, k)) for k in range(150)]
    for case in chance:
        log, declared = case.log(exact), case.car(one.declared)
        assert len(log) > 1000
        assert (log is exact) == (case.fault is None)
        assert (declared is one.declared) == (case.told is None)
    kinds = {type(case.fault) for case in chance} | {type(case.told) for case in chance}
    assert len(kinds) >= 16
