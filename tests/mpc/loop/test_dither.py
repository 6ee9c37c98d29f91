"""The weave that teaches: a displaced path like any other, bounded, gone when it is not needed."""

import math

import numpy as np
import pytest

import tireid as ti
from codegen import find_compiler
from models.vehicle import sedan
from mpc.loop.dither import Dither
from mpc.realtime.instance import Measurement
from tireid.driving.runs import unknown_of

CAR, PERIOD = sedan(), 0.01
TIMES = np.linspace(0.0, 1.0, 21)


def told(kappa=0.0, e_y=0.0, e_psi=0.0):
    road = np.full(TIMES.size, kappa)
    return Measurement(
        e_y=e_y, e_psi=e_psi, v_y=0.0, r=0.0, kappa=road, v_x=np.full(TIMES.size, 20.0)
    )


def driven_for(dither, seconds, measurement):
    out = measurement
    for k in range(round(seconds / PERIOD)):
        out = dither.displaced(measurement, k * PERIOD, TIMES, PERIOD)
    return out


def test_a_car_on_the_displaced_path_is_told_that_it_is_right_and_stays_on_it():
    dither = Dither(vehicle=CAR, amplitude=0.1, grip=8.0, strength=1.0)
    # Follow the told curvature without a tracker: place and heading integrate what is told.
    v, t0 = 20.0, 0.3
    t = np.arange(0.0, 3.0, 1e-3)
    d, rate, acceleration = dither.displacement(t0 + t)
    y, psi = d[0], math.atan(rate[0] / v)
    for k in range(t.size - 1):
        seen = dither.displaced(told(e_y=y, e_psi=psi), t0 + float(t[k]), np.zeros(21), 1e-9)
        assert abs(seen.e_y) < 5e-3 and abs(seen.e_psi) < 2e-3
        assert seen.kappa[0] == pytest.approx(acceleration[k] / v**2)
        psi += 1e-3 * v * float(seen.kappa[0])
        y += 1e-3 * v * math.sin(psi)


def test_the_weave_never_passes_its_amplitude_nor_its_acceleration():
    dither = Dither(vehicle=CAR, amplitude=0.1, grip=8.0)
    t = np.linspace(0.0, 100.0, 200001)
    d, rate, acceleration = dither.displacement(t)
    assert 0.09 < np.abs(d).max() <= 0.1
    assert 0.95 * dither.acceleration < np.abs(acceleration).max() <= dither.acceleration
    np.testing.assert_allclose(np.gradient(d, t)[1:-1], rate[1:-1], atol=1e-6)
    np.testing.assert_allclose(np.gradient(rate, t)[1:-1], acceleration[1:-1], atol=1e-5)


def test_what_is_known_or_needs_the_grip_is_driven_without_a_weave():
    straight, bend = told(), told(kappa=8.0 / 20.0**2)
    teaches = Dither(vehicle=CAR, amplitude=0.1, grip=8.0)
    driven_for(teaches, 5.0, straight)
    assert teaches.strength > 0.99
    driven_for(teaches, 8.0, bend)
    assert teaches.strength < 0.01
    knows = Dither(vehicle=CAR, amplitude=0.1, grip=8.0, need=lambda: 0.0, strength=1.0)
    last = driven_for(knows, 12.0, told(e_y=0.02))
    assert last.e_y == pytest.approx(0.02, abs=1e-5)


@pytest.mark.parametrize("name", ["amplitude", "grip"])
def test_no_weave_is_negative_or_endless(name):
    for value in (0.0, -1.0, math.nan, math.inf):
        with pytest.raises(ValueError, match=name):
            Dither(vehicle=CAR, **{"amplitude": 0.1, "grip": 8.0, name: value})


def test_a_car_that_weaves_learns_more_and_keeps_within_it():
    if find_compiler() is None:
        pytest.skip("needs a C compiler")
    road = ti.paths.Path.from_waypoints(np.linspace(0.0, 160.0, 17), np.zeros(17), name="straight")
    log = ti.sample_recording(CAR)
    begun = ti.identify(log.between(0.0, 2.0), CAR, check=False).freeze()
    runs = [ti.drive(road, CAR, begun, speed=18.0, learning=True, dither=one) for one in (0.0, 0.3)]
    models = [one.learner.supervisor.identifier.model() for one in runs]
    unsure = [model.band.relative_sd(np.array([0.03])).max() for model in models]
    assert unsure[1] < 0.8 * unsure[0]
    off = [np.abs(one.drive.e_y).max() for one in runs]
    assert off[0] < 0.1 < off[1] < 0.3
    need = unknown_of(runs[0].learner)
    assert need is not None and need() == 1.0 and unknown_of(None) is None


@pytest.mark.parametrize("dither", [-0.1, 0.6, math.nan])
def test_a_weave_that_is_none_is_refused(dither):
    with pytest.raises(ValueError, match=r"dither in m must lie between 0 and 0\.5"):
        ti.drive(ti.paths.iso_3888_2(), CAR, speed=10.0, dither=dither)
