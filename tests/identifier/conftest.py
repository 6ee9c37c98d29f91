"""A small car and a drive whose axle forces are known exactly."""

import json
from dataclasses import replace

import numpy as np
import pytest

from identifier.frozen import FrozenModelError
from identifier.stored import load_model
from models.recordings import Recording
from models.vehicle import Vehicle

CAR = Vehicle(
    mass=1500.0,
    yaw_inertia=2500.0,
    l_f=1.15,
    l_r=1.55,
    cornering_stiffness_front=1.4e5,
    cornering_stiffness_rear=1.2e5,
)


def saturating(alpha, stiffness, peak):
    return peak * np.tanh(stiffness * alpha / peak)


def drive(n=1500, dt=0.01, speed=20.0, amplitude=0.06, scale=1.0):
    """A slalom of a bicycle on saturating tires, integrated finely; forces are known exactly."""
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
    t, v_y, r, delta, F_f, F_r = np.array(rows).T
    return Recording(
        name="drive",
        t=t,
        v_x=np.full(n, speed),
        v_y=v_y,
        r=r,
        delta_f=delta,
        delta_r=np.zeros(n),
        axle_force=np.column_stack([F_f, F_r]) * scale,
    )


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
        CAR,
        mass=1.5,
        yaw_inertia=0.025,
        l_f=0.115,
        l_r=0.155,
        cornering_stiffness_front=140.0,
        cornering_stiffness_rear=120.0,
    )


@pytest.fixture
def refused_in_one_line(tmp_path):
    """A function that checks that a file of these numbers is refused with its name and a rule."""

    def check(data, said):
        path = tmp_path / "weights.json"
        path.write_text(json.dumps(data))
        with pytest.raises(FrozenModelError, match=said) as error:
            load_model(path)
        assert str(error.value).startswith(str(path))
        assert "\n" not in str(error.value)

    return check


@pytest.fixture(name="drive")
def a_drive():
    """The function `drive(n, dt, speed, amplitude, scale)`, which makes a recording."""
    return drive
