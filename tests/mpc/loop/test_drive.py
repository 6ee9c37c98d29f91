"""The closed loop, with a driver of three lines in place of the tracker."""

import math

import numpy as np
import pytest

from models.friction import Friction
from models.sensors import Sensor
from models.vehicle import sedan
from mpc.cars import DoubleTrackCar
from mpc.loop.drive import COMPLETED, drive
from mpc.loop.guide import GUIDES
from mpc.loop.record import scores
from mpc.loop.sensing import CarSensors, Measured, inertial_unit
from mpc.path import Path, SpeedProfile
from mpc.realtime import Command

STRAIGHT = Path.from_waypoints([0, 20, 40, 60], [0, 0, 0, 0], name="straight")


class Driver:
    """Steers by the curvature ahead and the errors now."""

    period = 0.01
    times = np.array([0.1, 0.2])
    plan_times = np.array([0.0, 0.1, 0.2])

    def reset(self, steering=0.0):
        self.seen = []

    def step(self, m):
        self.seen.append(m)
        steering = 3.6 * m.kappa[0] - 0.05 * m.e_y - 0.4 * m.e_psi
        return Command(steering, len(self.seen) % 3 == 0, np.zeros((3, 5)), np.zeros(2), 1e-4, 1)


class Fixed(Driver):
    """Steers by the clock: straight, and from one period on an angle."""

    def __init__(self, angle=0.0, start=0):
        self.angle, self.start = angle, start

    def step(self, m):
        command = super().step(m)
        return command._replace(steering=self.angle if len(self.seen) > self.start else 0.0)


@pytest.fixture(scope="module")
def bump():
    return Path.from_waypoints([0, 30, 60, 90, 120], [0, 0, 2, 0, 0], name="bump")


@pytest.fixture(scope="module")
def ring():
    angle = np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
    return Path.from_waypoints(30.0 * np.sin(angle), 30.0 * (1.0 - np.cos(angle)), closed=True)


def car(**keys):
    return DoubleTrackCar(sedan(), **keys)


def test_a_lap_that_begins_in_a_turn_begins_turning(ring):
    driven = drive(ring, car(), Driver(), speed=8.0, delay=2, rng=np.random.default_rng(0))
    assert driven.r[0] == pytest.approx(8.0 / 30.0, rel=1e-2)
    assert driven.delta[0] == pytest.approx(sedan().wheelbase / 30.0, rel=1e-2)


def seeded(seed=1):
    return np.random.default_rng(seed)


def shaken(bump, seed):
    sensors, rng = inertial_unit(), seeded(seed)
    return drive(bump, car(), Driver(), speed=12.0, sensors=sensors, delay=2, rng=rng)


@pytest.fixture(scope="module")
def noisy(bump):
    return shaken(bump, 1)


def test_a_gentle_path_is_followed_to_its_end(noisy, bump):
    assert noisy.completed
    assert noisy.ending == COMPLETED
    assert np.abs(noisy.e_y).max() < 0.5
    assert noisy.s[-1] == pytest.approx(bump.length, abs=0.2)
    assert len(noisy) == pytest.approx(bump.length / 12.0 / 0.01, rel=0.02)


def test_the_tracker_sees_what_is_measured_and_not_the_truth():
    biased = CarSensors(Y=Sensor(bias=0.3), r=Sensor(resolution=0.5))
    tracker = Fixed()
    run = drive(STRAIGHT, car(), tracker, speed=15.0, sensors=biased, rng=seeded())
    assert max(abs(m.e_y - 0.3) for m in tracker.seen) < 1e-3
    assert np.abs(run.e_y).max() < 1e-3
    assert {m.r for m in tracker.seen} == {0.0}


@pytest.mark.parametrize("delay", [0, 1, 3])
def test_a_command_acts_as_many_periods_later_as_is_said(delay):
    run = drive(STRAIGHT, car(), Fixed(0.01, start=5), speed=15.0, delay=delay, rng=seeded())
    assert run.command[5] == 0.01
    assert run.command[4] == 0.0
    moved = np.flatnonzero(np.abs(run.delta) > 0.0)
    assert moved[0] == 5 + delay + 1  # the state at the end of the first period it acts in


def test_a_seed_decides_the_drive(bump, noisy):
    again, other = shaken(bump, 1), shaken(bump, 2)
    assert np.array_equal(again.X, noisy.X)
    assert not np.array_equal(other.Y[:500], noisy.Y[:500])


def test_laps_of_a_closed_path_are_counted(ring):
    run = drive(ring, car(), Driver(), speed=10.0, laps=2.0, rng=seeded())
    assert run.completed
    assert run.s[-1] == pytest.approx(2.0 * ring.length, abs=0.2)
    assert np.diff(run.s).min() > 0.0
    assert np.abs(run.e_psi).max() < 0.2


def test_a_drive_that_fails_says_how(ring, bump):
    off = drive(STRAIGHT, car(), Fixed(0.1), speed=15.0, rng=seeded())
    assert (off.completed, off.ending) == (False, "left the path by more than 2 m")
    ice = car(friction=Friction(scale=0.3))
    spun = drive(ring, ice, Fixed(-0.5), speed=20.0, widest=1e3, rng=seeded(), time_limit=3.0)
    assert not spun.completed
    late = drive(ring, car(), Driver(), speed=10.0, time_limit=1.0, rng=seeded())
    assert (late.completed, late.ending) == (False, "not there after 1 s")
    slow = SpeedProfile(bump, np.interp(bump.s, [0, 60, 70], [5.0, 5.0, 0.5]))
    assert drive(bump, car(), Driver(), speed=slow, rng=seeded()).ending == "slower than 1 m/s"


def test_a_learner_sees_every_sample_and_its_notes_are_kept(bump):
    class Learner:
        count = 0

        def observe(self, measured, tracker):
            assert isinstance(tracker, Driver)
            self.count += 1
            return "handed over" if measured.t == 0.5 else None

    learner, shares = Learner(), []
    run = drive(
        bump, car(), Driver(), speed=12.0, rng=seeded(), learner=learner, progress=shares.append
    )
    assert learner.count == len(run)
    assert run.notes == ((0.5, "handed over"),)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


def test_the_recording_is_what_an_identifier_reads(noisy):
    recording = noisy.recording()
    assert np.array_equal(recording.v_y, noisy.measured["v_y"])
    assert np.array_equal(recording.delta_f, noisy.measured["delta"])
    assert np.array_equal(recording.axle_force, noisy.axle_force)
    assert recording.dt == 0.01


def test_scores_are_those_of_the_signals(noisy):
    found = scores(noisy)
    assert found.rms_e_y_m == pytest.approx(math.sqrt(sum(noisy.e_y**2) / len(noisy)))
    assert found.peak_e_y_m == max(noisy.e_y.max(), -noisy.e_y.min())
    assert found.completed
    assert found.failures == {"ITERATION_LIMIT": len(noisy) // 3}
    assert found.solve_ms == pytest.approx({"median": 0.1, "p99": 0.1, "max": 0.1})


class Broken:
    """Sensors of which one channel shows something that is no number of a car, for some time."""

    def __init__(self, channel, value, duration=math.inf):
        self.channel, self.value, self.end = channel, value, 1.0 + duration

    def measure(self, state, rng):
        shown = inertial_unit().measure(state, rng)
        if not 1.0 <= state.t < self.end:
            return shown
        channels = Measured._fields[1:] if self.channel == "all" else (self.channel,)
        return shown._replace(**dict.fromkeys(channels, self.value))


def broken_drive(bump, tracker, sensors, **keys):
    return drive(bump, car(), tracker, speed=15.0, sensors=sensors, rng=seeded(0), **keys)


NO_NUMBERS = (math.nan, math.inf, -math.inf, 1e308, -1e308)


@pytest.mark.sweep("nan-all", "1e+308-v_x")
@pytest.mark.parametrize("channel", [*Measured._fields[1:], "all"])
@pytest.mark.parametrize("value", NO_NUMBERS)
def test_half_a_second_without_a_number_is_driven_through(channel, value, bump):
    run = broken_drive(bump, driver := Driver(), Broken(channel, value, duration=0.5))
    assert run.completed, run.ending
    assert np.isfinite([[m.e_y, m.e_psi, *m.kappa, *m.v_x] for m in driver.seen]).all()
    assert all(abs(m.v_y) < 300.0 or math.isnan(m.v_y) for m in driver.seen)
    assert all(abs(m.r) < 10.0 or math.isnan(m.r) for m in driver.seen)
    lost = [channel] if channel != "all" else list(GUIDES)
    noted = [(1.0, f"{one} is no number: dead reckoning") for one in lost if one in GUIDES]
    assert [(round(t, 6), text) for t, text in run.notes] == noted


@pytest.mark.sweep("nan-*", "-1e+308-psi", "1e+308-v_x", "inf-X", "-inf-Y")
@pytest.mark.parametrize("channel", GUIDES)
@pytest.mark.parametrize("value", NO_NUMBERS)
def test_a_car_that_stays_blind_ends_its_drive_and_says_why(channel, value, bump):
    run = broken_drive(bump, Driver(), Broken(channel, value), blind=1.5)
    assert (run.completed, run.ending) == (False, f"no number of {channel} for 1.5 s")
    assert run.t[-1] == pytest.approx(1.0 + 1.5, abs=0.011)
    assert np.abs(run.e_y).max() < 0.6
