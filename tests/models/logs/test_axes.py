"""Which axis of a sensor is which of the car's, told by numbers where letters mislead."""

import itertools

import numpy as np
import pytest

from models.logs.axes import _GRAVITY, triads
from models.logs.names import _words_of
from tests.models.logs.test_names import proposed, taken

T = 0.01 * np.arange(3000)
V = 15.0 + 3.0 * np.sin(0.4 * T)
R = 0.3 * np.sin(1.3 * T) + 0.1 * np.sin(0.37 * T)
V_Y = 1.3 * R - 0.012 * V**2 * R
A_Y = np.gradient(V_Y, T) + V * R
A_X = np.gradient(V, T)
DELTA = 2.6 * R / V + 0.002 * V * R
CAR = {"forward": (V, A_X, 0.02 * R), "left": (V_Y, A_Y, 0.03 * R), "up": (0 * V, 0 * V, R)}


def noise(size, seed):
    return size * np.random.default_rng(seed).normal(size=T.size)


def box(axes, gravity=_GRAVITY, unit="m/s^2", rate="rad/s", names=("AccX", "GyroX"), seed=1):
    """The accelerations and rates of a box whose x, y and z are some axes of the car."""
    found = []
    for k, (letter, word) in enumerate(zip("XYZ", axes, strict=True)):
        sign, axis = (-1.0 if word.startswith("-") else 1.0), word.lstrip("-")
        _, a, w = CAR[axis]
        a = sign * (a + gravity * (axis == "up")) + noise(0.2, seed + k)
        w = np.degrees(sign * w) if rate == "deg/s" else sign * w
        a = a / _GRAVITY if unit in ("g", "") else a
        found += [(names[0].replace("X", letter), unit, a)]
        found += [(names[1].replace("X", letter), rate, w + noise(0.01, seed + 10 + k))]
    return found


SPEED, STEER = ("GPS Speed", "km/h", 3.6 * V), ("Steering Angle", "deg", 15 * np.degrees(DELTA))
AXES = ("forward", "left", "up")
ROTATIONS = [  # right-handed ones
    tuple(("-" if s < 0 else "") + AXES[k] for k, s in zip(order, signs, strict=True))
    for order in itertools.permutations(range(3))
    for signs in itertools.product((1, -1), repeat=3)
    if np.linalg.det(np.eye(3)[list(order)] * np.array(signs)[:, None]) > 0
]


def read(found, signal, channels):
    guess = found.guesses[signal]
    values = {name: (unit, values) for name, unit, values in channels}
    assert guess.unit in ("", values[guess.channel[0]][0])
    return guess.channel[0], guess.factor


@pytest.mark.parametrize("axes", ROTATIONS)
@pytest.mark.parametrize("steering", [True, False])
def test_a_box_is_read_however_it_lies(axes, steering):
    channels = box(axes)
    found = proposed(SPEED, *([STEER] if steering else []), *channels)
    place = {word.lstrip("-"): k for k, word in enumerate(axes)}
    sign = {word.lstrip("-"): -1.0 if word.startswith("-") else 1.0 for word in axes}
    assert read(found, "a_y", channels)[0] == "Acc" + "XYZ"[place["left"]]
    assert read(found, "r", channels)[0] == "Gyro" + "XYZ"[place["up"]]
    assert read(found, "a_y", channels)[1] == sign["left"]
    assert read(found, "r", channels)[1] == sign["up"]
    assert read(found, "a_x", channels) == ("Acc" + "XYZ"[place["forward"]], sign["forward"])
    assert found.is_sure("a_y") and found.is_sure("r")


@pytest.mark.parametrize("unit", ["g", ""])
@pytest.mark.parametrize("rate", ["deg/s", ""])
def test_units_of_a_box_are_told_by_the_file_or_by_turning(unit, rate):
    names = ("accelerometerAccelerationX", "gyroRotationX")  # of a phone
    axes = ("-left", "up", "-forward")
    found = proposed(SPEED, STEER, *box(axes, 9.81, unit, rate or "rad/s", names=names))
    assert taken(found, "a_y") == "accelerometerAccelerationX"
    assert found.guesses["a_y"].factor == -1.0 and found.guesses["a_y"].unit == "g"
    assert taken(found, "r") == "gyroRotationY"


def test_without_gravity_the_pair_tells():
    found = proposed(SPEED, STEER, *box(("left", "up", "forward"), gravity=0.0))
    assert taken(found, "r") == "GyroY" and taken(found, "a_y") == "AccX"


def test_a_box_that_lies_oblique_is_not_sure():
    channels = {name: (unit, x) for name, unit, x in box(AXES)}
    tilted = []
    for name, unit, x in box(AXES):
        other = channels[name.replace("Y", "#").replace("Z", "Y").replace("#", "Z")][1]
        side = {"Y": -0.7, "Z": 0.7}.get(name[-1], 0.0)
        tilted.append((name, unit, (0.7 * x if side else x) + side * other))
    found = proposed(SPEED, *tilted)
    assert not found.is_sure("a_y") and not found.is_sure("r")
    assert "oblique" in found.guesses["a_y"].why


def velocities(named, values, letters="XYZ", unit="m/s"):
    return [(named(x), unit, v) for x, v in zip(letters, values, strict=True)]


@pytest.mark.parametrize("name", ["VelocityX", "Chassis Velocity X", "/cam/twist.twist.linear.x"])
@pytest.mark.parametrize("right", [True, False])
def test_velocities_of_games_and_cameras_have_z_forward(name, right):
    def named(letter):
        return name.replace("X", letter) if "X" in name else name[:-1] + letter.lower()

    sign = -1.0 if right else 1.0
    found = proposed(
        *velocities(named, (sign * V_Y, noise(0.02, 3), V)),
        ("Yaw Rate", "rad/s", R),
        ("Lateral Acceleration", "g", A_Y / _GRAVITY + noise(0.01, 4)),
    )
    assert taken(found, "v_x") == named("Z") and found.is_sure("v_x")
    assert taken(found, "v_y") == named("X")
    assert found.guesses["v_y"].factor == sign and found.is_sure("v_y")
    assert found.signals()["v_y"].factor == sign


@pytest.mark.parametrize("level", [False, True])
@pytest.mark.parametrize("steering", [1.0, -1.0])
def test_a_game_whose_channels_all_have_letters_is_read_in_signs_that_agree(steering, level):
    """Forza: x to the right, y up, z forward, in a left-handed system; no gravity.
    level : only what lies in the plane of the ground, x and z.
    """
    channels = [
        *velocities("Velocity{}".format, (-V_Y, noise(0.02, 3), V)),
        *velocities("Acceleration{}".format, (-A_Y, noise(0.1, 4), A_X), unit="m/s^2"),
        *velocities("AngularVelocity{}".format, (0.1 * R * R, -R, 0.02 * R), unit="rad/s"),
        ("Speed", "m/s", V),
        ("Steer", "", steering * DELTA),
    ]
    out = "VelocityY AccelerationY AngularVelocityX AngularVelocityZ" if level else ""
    found = proposed(*(one for one in channels if one[0] not in out.split()))
    assert found.guesses["v_x"].channel[0] in ("VelocityZ", "Speed")
    for signal, name in (("v_y", "VelocityX"), ("a_y", "AccelerationX"), ("r", "AngularVelocityY")):
        assert taken(found, signal) == name
        assert found.guesses[signal].factor == -steering, signal
    assert taken(found, "a_x") == "AccelerationZ"


def test_velocities_of_games_without_turning_have_no_v_y():
    found = proposed(*velocities("Velocity{}".format, (V_Y, noise(0.02, 3), V)))
    assert taken(found, "v_x") == "VelocityZ" and "v_y" not in found.guesses


def test_axes_as_letters_have_them_and_velocities_of_the_world_are_left_alone():
    straight = proposed(*velocities("v{}".format, (V, V_Y, 0.01 * V_Y), "xyz"))
    assert taken(straight, "v_x") == "vx" and taken(straight, "v_y") == "vy"
    psi = np.cumsum(R) * 0.01
    world = (V * np.cos(psi + 2.0), V * np.sin(psi + 2.0), 0.01 * V)
    there = proposed(*velocities("v{}".format, world, "xyz"))
    assert taken(there, "v_x") == "vx"


def test_triads_are_channels_alike_but_for_a_letter():
    forms = ("Acc{}", "G({})", "/imu/angular_velocity.{}", "Mag{}")
    names = [one.format(x) for one in forms for x in "xyz"] + ["ax", "ay"]
    found = triads({one: _words_of(one) for one in names}, dict.fromkeys(names, ""))
    assert [one.quantity for one in found] == ["acceleration", "acceleration", "yaw rate"]
    assert found[0].names == {"x": "Accx", "y": "Accy", "z": "Accz"}
