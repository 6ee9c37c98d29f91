"""A small car and a drive whose axle forces are known exactly."""

import json
import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from benchmarks.random_cars import random_car, random_drive
from identifier.axle import AxleIdentifier
from identifier.frozen import FrozenModelError
from identifier.paper.network import NetworkModel, Weights
from identifier.run import identify
from identifier.tire_model import load_model
from models.maneuvers import RandomSteer, Slalom
from models.plant import Plant
from models.recordings import Recording, read_recording
from models.vehicle import Vehicle, sedan
from tests.refused import line_about

CAR = Vehicle(
    mass=1500.0, yaw_inertia=2500.0, l_f=1.15, l_r=1.55, cornering_stiffness_front=1.4e5,
    cornering_stiffness_rear=1.2e5,
)  # fmt: skip


def network_model(car, network, rng):
    """A model of the paper with weights at random."""
    V = rng.normal(size=(network.hidden, len(network.inputs)))
    weights = Weights(W=rng.normal(size=(2, network.hidden)), V=V)
    return NetworkModel(
        vehicle=car, network=network, weights=weights, force_unit=1500.0, min_speed=1.0
    )


def drawn(kind, seed):
    """A random car of a class as it is told, and its drive by good sensors."""
    rng = np.random.default_rng(seed)
    drive = random_drive(random_car(kind, rng), rng)
    return drive.car.declared, drive.log(rng)


def codes_of(findings):
    return [f"{one.code} {one.channel}".strip() for one in findings]


def saturating(alpha, stiffness, peak):
    return peak * np.tanh(stiffness * alpha / peak)


def drive(n=1500, dt=0.01, speed=20.0, amplitude=0.06, scale=1.0):
    """A slalom of a bicycle on saturating tires, integrated finely; forces are known exactly."""
    t, v_y, r, delta, F_f, F_r = driven(n, dt, speed, amplitude).copy()
    return at_one_speed("drive", speed, t, v_y, r, delta, scale * np.column_stack([F_f, F_r]))


def at_one_speed(name, speed, t, v_y, r, delta_f, axle_force):
    """A recording of a car that steers its front wheels alone and keeps its speed."""
    return Recording(
        name=name,
        t=t,
        v_x=np.full(t.size, speed),
        v_y=v_y,
        r=r,
        delta_f=delta_f,
        delta_r=np.zeros(t.size),
        axle_force=axle_force,
    )


@cache
def driven(n, dt, speed, amplitude):
    """Time, lateral velocity, yaw rate, steering and forces of `drive`, (6, n); many ask for it."""
    p, fine = CAR.bicycle, 10
    v_y = r = 0.0
    rows = []
    for k in range(n * fine):
        t = k * dt / fine
        delta = amplitude * np.sin(2 * np.pi * 0.5 * t)
        alpha = delta - (v_y + p.l_f * r) / speed, -(v_y - p.l_r * r) / speed
        F = saturating(alpha[0], p.C_f, 5000.0), saturating(alpha[1], p.C_r, 4500.0)
        if k % fine == 0:
            rows.append((t, v_y, r, delta, *F))
        v_y += dt / fine * ((F[0] + F[1]) / p.m - speed * r)
        r += dt / fine * (p.l_f * F[0] - p.l_r * F[1]) / p.I_z
    return np.array(rows).T.copy()


def learnt(recording, car, start=None):
    """The model of the axle identifier after a recording."""
    return identify(recording, car, AxleIdentifier.for_vehicle(car), start=start).freeze()


def missed(model, recording, counted=slice(None)):
    """Rms error of a model's forces over the rms of the true ones, per axle (2,)."""
    force = recording.axle_force
    error = (model.predict(recording) - force)[counted]
    return np.sqrt(np.mean(error**2, axis=0) / np.mean(force[counted] ** 2, axis=0))


def outside_known(model, recording):
    """Where the slip of a drive leaves the range that a model was identified for, (n, 2)."""
    return model.setup(recording.dt).output(recording, "slip_size") > model.known_slip


def bicycle(car, t, v_x, delta, push, lag=None, fine=5):
    """Return v_y, r (n,) and the forces across (n, 2) of a bicycle, by midpoint steps.

    v_x(t), delta(t) [m/s, rad].   push(slip, v_x) : of the axles across their wheels [N], (2,).
    lag : of slip [m], (2,) or a number.
    """
    arm = np.array([car.l_f, -car.l_r])

    def rates(time, moved):
        v, steered = v_x(time), np.array([delta(time), 0.0])
        alpha = steered - np.arctan((moved[0] + arm * moved[1]) / v)
        slip = alpha if lag is None else moved[2:]
        force = push(slip, v) * np.cos(steered)
        follows = np.zeros(2) if lag is None else v / lag * (alpha - slip)
        turn = arm @ force / car.yaw_inertia
        return np.array([force.sum() / car.mass - v * moved[1], turn, *follows]), force

    moved, rows, h = np.zeros(4), [], (t[1] - t[0]) / fine
    for begin in t:
        rows.append((*moved[:2], *rates(begin, moved)[1]))
        for time in begin + h * np.arange(fine):
            half = moved + h / 2 * rates(time, moved)[0]
            moved = moved + h * rates(time + h / 2, half)[0]
    v_y, r, *force = np.array(rows).T
    return v_y, r, np.column_stack(force)


def steered(
    seed, duration, *, amplitude=0.08, frequency=0.5, onset=1.0, speed=20.0, car=None, **road
):
    """A run of the plant of a car, the sedan, that is steered at random."""
    maneuver = RandomSteer(
        amplitude=amplitude,
        frequency=frequency,
        seed=seed,
        onset=onset,
        rate_limit=1.0,
        duration=duration,
    )
    name = f"drive{seed}"
    return Plant(car or sedan()).simulate(maneuver, speed=speed, name=name, **road)


def slalom_of(duration):
    """A slalom of the sedan of some seconds, with its true forces."""
    maneuver = Slalom(
        amplitude=np.radians(4.0), frequency=0.5, onset=1.0, rate_limit=1.0, duration=duration
    )
    return Plant(sedan()).simulate(maneuver, speed=20.0).recording()


def felt(recording):
    """The drive with what an accelerometer feels of its forces."""
    return replace(recording, a_y=recording.axle_force.sum(axis=1) / CAR.mass)


@pytest.fixture(name="car")
def the_car():
    return CAR


@pytest.fixture
def model_car():
    """A car of 1:10."""
    return replace(
        CAR, mass=1.5, yaw_inertia=0.025, l_f=0.115, l_r=0.155, cornering_stiffness_front=140.0,
        cornering_stiffness_rear=120.0,
    )  # fmt: skip


@pytest.fixture
def refused_in_one_line(tmp_path):
    """A function that checks that a file of these numbers is refused with its name and a rule."""

    def check(data, said):
        path = tmp_path / "weights.json"
        path.write_text(json.dumps(data))
        assert re.search(said, line_about(path, FrozenModelError, load_model))

    return check


@pytest.fixture(name="drive")
def a_drive():
    """The function `drive(n, dt, speed, amplitude, scale)`, which makes a recording."""
    return drive


def pressed(lift, rng):
    """A minute of a race car whose axle loads grow by `lift` of the weight at 100 km/h, squared.

    One track, tires that follow slip at once, speeds from 18 to 45 m/s, steered by two sines.
    """
    t, v_x, delta, v_y, r, felt = pressed_down(lift)
    noise = rng.normal(size=(3, t.size)) * np.array([[0.02], [0.002], [0.05]])
    signals = {"v_y": v_y + noise[0], "r": r + noise[1], "a_y": felt + noise[2]}
    log = read_recording({"t": t, "vx": v_x, "vy": signals["v_y"], "r": signals["r"],
                                    "delta_f": delta, "ay": signals["a_y"]})  # fmt: skip
    return log, RACE


RACE = Vehicle(name="race", mass=1100.0, yaw_inertia=1600.0, l_f=1.45, l_r=1.35,
               cornering_stiffness_front=1e5, cornering_stiffness_rear=1e5)  # fmt: skip


@cache
def pressed_down(lift):
    """Time, speed, steering, lateral velocity, yaw rate, acceleration of `pressed`, (n,) each."""
    loads, kappa = np.array(RACE.axle_loads), lift / (100.0 / 3.6) ** 2
    t = np.arange(0.0, 60.0, 0.01)

    def v_x(t):
        return 31.5 + 13.5 * np.sin(0.35 * t)

    def delta(t):
        a_y = 7.0 * np.sin(2.0 * t) + 4.0 * np.sin(4.3 * t)  # that steering asks for, about
        return a_y * (RACE.wheelbase / v_x(t) ** 2 + 0.002)

    def push(slip, v_x):
        return loads * (1.0 + kappa * v_x**2) * 1.6 * np.tanh(16.0 * slip)

    v_y, r, force = bicycle(RACE, t, v_x, delta, push)
    return t, v_x(t), delta(t), v_y, r, force.sum(axis=1) / RACE.mass


def areas_of(car, lift):
    """Areas of the downforce of `pressed` [m²], by the physics: ½ ρ A v²."""
    pushes = 0.5 * 1.2 * (100.0 / 3.6) ** 2
    return {f"downforce_area_{axle}": lift * load / pushes
            for axle, load in zip(("front", "rear"), car.axle_loads, strict=True)}  # fmt: skip
