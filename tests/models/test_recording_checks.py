"""Physics: right recordings of many cars pass, and every planted error rings its own alarm."""

from collections import namedtuple
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from models.recordings import (
    Recording,
    RecordingError,
    check_against_vehicle,
    check_physics,
    read_recording,
    runs,
)
from tests.made import made
from tests.refused import line_about

DEGREES = 180.0 / np.pi

# name -> m [kg], I_z [kg m^2], l_f, l_r [m], C_f, C_r [N/rad]
CARS = {
    "sedan": (1600.0, 2600.0, 1.25, 1.45, 90e3, 110e3),
    "truck": (12000.0, 60e3, 2.4, 2.6, 300e3, 420e3),
    "formula": (800.0, 1000.0, 1.9, 1.7, 180e3, 240e3),
    "tenth": (1.6, 0.005, 0.08, 0.09, 20.0, 25.0),
    "forty-third": (0.041, 28e-6, 0.029, 0.033, 1.2, 1.6),
}
Axles = namedtuple("Axles", "l_f l_r mass")
SEDAN_AXLES = Axles(1.25, 1.45, 1600.0)
SPEEDS = {"sedan": 20.0, "truck": 12.0, "formula": 45.0, "tenth": 2.2, "forty-third": 1.5}


def drive(car="sedan", peak=3.0, speed=None, grip=0.9, steering=None, duration=12.0, every=10):
    """Single-track car, tires saturate as tanh; `peak` [m/s^2] scales its multi-sine steering.

    Sampled `every` so many milliseconds.
    """
    made = finely(car, peak, speed, grip, steering, duration)
    return Recording(name="made", **{one: values[::every].copy() for one, values in made.items()})


@cache
def finely(car, peak, speed, grip, steering, duration):
    """`drive` every millisecond; many tests ask for the same."""
    m, I_z, l_f, l_r, C_f, C_r = CARS[car]
    L, v = l_f + l_r, SPEEDS[car] if speed is None else speed
    dt, t = 1e-3, np.arange(0.0, duration, 1e-3)
    if steering is None:
        shape = 0.6 * np.sin(2 * np.pi * 0.35 * t) + 0.4 * np.sin(2 * np.pi * 0.8 * t + 1.0)
        delta = (L / v**2 + 0.002 * (v > 5.0)) * peak * shape
    else:
        delta = steering(t)
    F_f_max, F_r_max = (grip * m * 9.81 * share / L for share in (l_r, l_f))
    v_y, r = np.zeros(t.size + 1), np.zeros(t.size + 1)
    F, v_y_dot = np.zeros((t.size, 2)), np.zeros(t.size)
    for k in range(t.size):
        alpha_f = delta[k] - np.arctan2(v_y[k] + l_f * r[k], v)
        alpha_r = -np.arctan2(v_y[k] - l_r * r[k], v)
        F[k] = (
            F_f_max * np.tanh(C_f * alpha_f / F_f_max),
            F_r_max * np.tanh(C_r * alpha_r / F_r_max),
        )
        v_y_dot[k] = F[k].sum() / m - v * r[k]
        v_y[k + 1] = v_y[k] + dt * v_y_dot[k]
        r[k + 1] = r[k] + dt * (l_f * F[k, 0] - l_r * F[k, 1]) / I_z
    return {
        "t": t, "v_x": np.full(t.size, v), "v_y": v_y[:-1], "r": r[:-1], "delta_f": delta,
        "delta_r": 0.0 * t, "a_y": v_y_dot + v * r[:-1], "axle_force": F,
    }  # fmt: skip


@pytest.fixture(scope="module")
def driven():
    return {car: drive(car) for car in CARS}


def refusal(recording):
    return line_about(f"{recording.name}: ", RecordingError, lambda _: check_physics(recording))


def scaled(**factors):
    """Multiply signals; `bare=1` takes a_y and forces away, `silent=1` only a_y."""
    bare, silent = factors.pop("bare", 0), factors.pop("silent", 0)

    def plant(recording):
        change = {k: getattr(recording, k) * f for k, f in factors.items()}
        if bare or silent:
            change["a_y"] = None
        if bare:
            change["axle_force"] = None
        return replace(recording, **change)

    return plant


def forces(front, rear, order=1):
    def plant(recording):
        assert recording.axle_force is not None
        return replace(recording, axle_force=recording.axle_force[:, ::order] * [front, rear])

    return plant


# error -> how to plant it, how the message starts, what it asks for
ON_MOTION = {
    "r in degrees": (scaled(r=DEGREES), "r must be in rad/s", "pi/180"),
    "r in degrees, bare": (scaled(r=DEGREES, bare=1), "r must be in rad/s", "pi/180"),
    "delta in degrees": (scaled(delta_f=DEGREES), "delta_f must be", "pi/180"),
    "delta in degrees, bare": (scaled(delta_f=DEGREES, bare=1), "delta_f must be", "pi/180"),
    "both in degrees": (scaled(delta_f=DEGREES, r=DEGREES), ("delta_f", "r must"), "pi/180"),
    "v_x in km/h": (scaled(v_x=3.6), "vx must be in m/s", "3.6"),
    "all speeds in km/h": (scaled(v_x=3.6, v_y=3.6), "vx must be in m/s", "3.6"),
    "v_x backward": (scaled(v_x=-1.0), "vx must point forward", "sign of vx"),
    "delta to the right": (scaled(delta_f=-1.0), "delta_f must turn", "sign of delta_f"),
    "r to the right, bare": (scaled(r=-1.0, bare=1), "delta_f must turn", "(or of r)"),
    "a_y in g": (scaled(a_y=1 / 9.81), "ay must be", "9.81"),
    "a_y to the right": (scaled(a_y=-1.0), "ay must be", "sign of ay"),
    "a_y empty": (scaled(a_y=0.0), "ay must be", "leave the column ay out"),
    "r to the right": (scaled(r=-1.0), "r contradicts ay", "change the sign of r"),
}
ON_V_Y = {"v_y to the right": (scaled(v_y=-1.0), "vy contradicts ay", "change the sign of vy")}
ON_FORCE = {
    "forces to the right": (forces(-1, -1), "Fyf must push", "sign of Fyf"),
    "front force to the right": (forces(-1, 1), "Fyf must push", "sign of Fyf"),
    "rear force to the right": (forces(1, -1), "Fyr must push", "sign of Fyr"),
    "forces swapped": (forces(1, 1, -1), "Fyf must turn", "swap"),
    "forces in kN": (forces(1e-3, 1e-3), "Fyf and Fyr must be in N", "1000"),
    "v_y to the right, no a_y": (
        scaled(v_y=-1.0, silent=1),
        "vy contradicts Fyf + Fyr",
        "sign of vy",
    ),
}
ALL = ON_MOTION | ON_V_Y | ON_FORCE


@pytest.mark.parametrize("error", ALL)
@pytest.mark.parametrize("car", CARS)
def test_every_planted_error_rings_its_own_alarm(driven, car, error):
    plant, start, remedy = ALL[error]
    if car == "formula" and "km/h" in error:
        start = ("vx must be in m/s",)  # 162 km/h: refused by its peak already
    message = refusal(plant(driven[car]))
    assert message.startswith(start)
    assert remedy in message


@pytest.mark.sweep("1.0-sedan", "3.0-tenth", "6.0-forty-third", "3.0-truck", "6.0-formula")
@pytest.mark.parametrize("car", CARS)
@pytest.mark.parametrize("peak", [1.0, 3.0, 6.0])
def test_a_right_recording_passes(car, peak):
    made = drive(car, peak)
    check_physics(made)
    check_physics(replace(made, a_y=None, axle_force=None))
    mass, _, l_f, l_r, *_ = CARS[car]
    axles = Axles(l_f, l_r, mass)
    check_against_vehicle(made, axles)
    check_against_vehicle(replace(made, axle_force=None), axles)


@pytest.mark.sweep("2", "50")
@pytest.mark.parametrize("every", [2, 20, 50, 90])
def test_at_every_rate_above_ten_hertz_a_right_recording_passes_and_errors_ring(every):
    made = drive(every=every)
    check_physics(made)
    check_against_vehicle(made, SEDAN_AXLES)
    for error, (plant, start, remedy) in ALL.items():
        message = refusal(plant(made))
        assert message.startswith(start), error
        assert remedy in message, error


@pytest.mark.sweep("8.0-0.1", "15.0-0.8", "25.0-0.3")
@pytest.mark.parametrize("grip", [0.1, 0.3, 0.8])
@pytest.mark.parametrize("speed", [8.0, 15.0, 25.0])
def test_a_car_that_plows_over_its_front_wheels_passes(grip, speed):
    """0.3 rad of steering on ice: the effective wheelbase is tens of meters, and true."""
    check_physics(
        drive(grip=grip, speed=speed, steering=lambda t: np.clip(0.1 * (t - 1.0), 0.0, 0.3))
    )
    check_physics(drive(grip=grip, speed=speed, steering=lambda t: 0.2 * np.sin(0.8 * t)))


def test_a_drift_with_opposite_lock_passes():
    """Steady: r > 0, sideslip -0.5 rad, wheels turned 0.2 rad to the right."""
    t, v, r, beta = 0.01 * np.arange(1200), 12.0, 0.5, -0.5
    wobble = 1.0 + 0.05 * np.sin(2.0 * t)
    v_y = v * np.sin(beta) * wobble
    v_x = np.full(t.size, v * np.cos(beta))
    a_y = np.gradient(v_y, t) + v_x * r * wobble
    check_physics(made(t, v_x=v_x, v_y=v_y, r=r * wobble, delta_f=-0.2 * wobble, a_y=a_y))


def test_noise_bias_bank_and_roll_do_not_ring(rng):
    made = drive(peak=4.0)
    n = len(made)
    assert made.a_y is not None
    for _ in range(5):
        noisy = replace(
            made,
            v_x=made.v_x + 0.1 * rng.normal(size=n),
            v_y=made.v_y + 0.05 * rng.normal(size=n) + rng.uniform(-0.1, 0.1),
            r=made.r + 0.01 * rng.normal(size=n) + rng.uniform(-0.01, 0.01),
            delta_f=made.delta_f + 0.002 * rng.normal(size=n) + rng.uniform(-0.01, 0.01),
            a_y=1.1 * made.a_y + 0.5 * rng.normal(size=n) + rng.uniform(-0.5, 0.5),
        )
        check_physics(noisy)
        check_physics(replace(noisy, a_y=None))


def test_a_vibrating_sensor_on_a_steady_circle_does_not_ring(rng):
    made = drive("tenth", steering=lambda t: 0.15 + 0.002 * np.sin(t))
    part = made.between(4.0, 8.0)
    assert part.a_y is not None
    for _ in range(20):
        slow = np.interp(part.t, np.arange(4.0, 9.0), rng.normal(size=5))
        check_physics(replace(part, a_y=part.a_y + slow + rng.normal(size=len(part))))
    assert "sign of ay" in refusal(replace(part, a_y=-part.a_y))


def test_straight_short_and_standing_runs_pass_even_with_wrong_signs(rng):
    straight = drive(peak=0.0)
    noise = {k: 0.002 * rng.normal(size=len(straight)) for k in ("r", "delta_f", "v_y", "a_y")}
    check_physics(replace(straight, **noise))
    check_physics(scaled(delta_f=-1.0)(drive(duration=1.0)))
    check_physics(replace(straight, v_x=0.01 * rng.normal(size=len(straight)), **noise))
    with pytest.raises(RecordingError, match=r"delta_r must be .* below 1\.2, its peak is 3"):
        check_physics(replace(straight, delta_r=np.full(len(straight), 3.0)))


def test_a_mirrored_log_cannot_be_told_from_a_right_one():
    """SAE or NED axes (y to the right, all signs turned) obey the same laws; documented."""
    names = dict.fromkeys(("v_y", "r", "delta_f", "a_y", "axle_force"), -1.0)
    check_physics(scaled(**names)(drive()))


@pytest.mark.parametrize(
    ("plant", "start"),
    [
        (scaled(r=DEGREES), ("vy and r must", "delta_f, r and vx")),
        (scaled(delta_f=DEGREES), "delta_f, r and vx must fit the wheelbase"),
        (scaled(delta_f=-1.0), "Fyf must rise with its slip angle"),
        (forces(1, -1), "Fyr must rise"),
        (forces(-1, 1), "Fyf must rise"),
    ],
)
def test_the_vehicle_tells_slip_and_force_signs(plant, start):
    wrong = plant(drive())
    told = line_about("made: ", RecordingError, lambda _: check_against_vehicle(wrong, SEDAN_AXLES))
    assert told.startswith(start)


def test_a_mass_in_another_unit_is_told_by_the_forces():
    for factor in (1e-3, 1e3):
        wrong = Axles(1.25, 1.45, factor * 1600.0)
        with pytest.raises(RecordingError, match="check the unit of mass"):
            check_against_vehicle(drive(), wrong)
    nearly = Axles(1.25, 1.45, 1.085 * 1600.0)
    check_against_vehicle(drive(), nearly)


def test_the_vehicle_of_another_scale_is_refused():
    with pytest.raises(RecordingError, match=r"wheelbase 0\.17 m"):
        check_against_vehicle(drive(speed=6.0), Axles(0.08, 0.09, 1.5))


@pytest.mark.sweep("carmaker*")
@pytest.mark.parametrize("file", ["carmaker.csv.gz", "dart.csv.gz"])
def test_real_runs_pass_and_their_corruptions_ring(shared_data, file):
    path = shared_data / file
    l_f, l_r, mass = (0.924, 1.626, 2027.0) if file.startswith("car") else (0.0805, 0.093, 1.58)
    axles = Axles(l_f, l_r, mass)
    for run in runs(path):
        real = read_recording(path, run)
        assert real.name == f"{file.removesuffix('.csv.gz')}:{run}"
        check_against_vehicle(real, axles)
        errors = ALL if real.axle_force is not None else ON_MOTION | ON_V_Y
        for part in (real, real.between(real.t[0] + 0.5 * real.duration, real.t[-1])):
            check_physics(part)
            for error, (plant, start, remedy) in errors.items():
                if part is real or "v_y" not in error:
                    message = refusal(plant(part))
                    assert message.startswith(start), (run, error, message)
                    assert remedy in message


def test_of_the_wrong_car_it_is_not_the_sign_of_v_y_that_is_to_blame():
    """At low speed v_y is l_r r: with a shorter l_r the rear slips the other way, with -v_y too."""
    slow, short = drive(speed=8.0), Axles(0.8, 0.2, 1600.0)
    check_against_vehicle(slow, SEDAN_AXLES)
    told = replace(slow, axle_force=None)
    with pytest.raises(RecordingError, match=r"vy has the sign of ay: name the right vehicle"):
        check_against_vehicle(told, short)
    with pytest.raises(RecordingError, match=r"sign of vy, or name the right .* or move vy to"):
        check_against_vehicle(replace(told, a_y=None), short)
    with pytest.raises(RecordingError, match=r"change the sign of vy; tireid doctor"):
        fast = replace(drive(speed=20.0), axle_force=None)
        check_against_vehicle(replace(fast, v_y=-fast.v_y), short)


@pytest.mark.parametrize("column", ["r", "delta_f"])
def test_an_amount_whose_sign_is_elsewhere_is_refused(column):
    made = drive()
    amount = replace(made, **{column: np.abs(getattr(made, column))})
    with pytest.raises(RecordingError, match=f"{column} must be negative to the right, it never"):
        check_physics(amount)
    if column == "delta_f":
        with pytest.raises(RecordingError, match="an amount with its sign"):
            check_physics(replace(amount, a_y=None))


def test_a_car_that_turns_to_one_side_alone_has_no_amounts():
    left = drive(steering=lambda t: 0.02 + 0.01 * np.sin(2.0 * t))
    check_physics(left)
    noise = 4.0 * np.random.default_rng(3).standard_normal(left.t.size)
    assert left.a_y is not None
    check_physics(replace(left, a_y=left.a_y + noise))


# Everyday driving: long straights, few and gentle bends, sensors with noise.

EVERYDAY_SPEEDS = {"sedan": 20.0, "truck": 16.0, "formula": 30.0, "tenth": 2.0}
BEND = 3.0  # s
NOISE = {"v_x": 0.03, "v_y": 0.02, "r": 0.002, "delta_f": 0.0005, "a_y": 0.05}


def everyday(car, seed, *, noisy=1.0):
    """A bend to either side in turn, of 1 m/s², with rest between them; noise in proportion."""
    l_f, l_r = CARS[car][2:4]
    v, L = EVERYDAY_SPEEDS[car], l_f + l_r
    size = (L / v**2 + 0.002 * (v > 5.0)) * 1.0

    def steering(t):
        k, s = np.divmod(t - 2.0, 15.0)
        bend = np.sin(np.pi * np.clip(s / BEND, 0.0, 1.0)) * ((s < BEND) & (k >= 0))
        return size * bend * np.where(k % 2 == 0, 1.0, -1.0)

    made = drive(car, speed=v, steering=steering, duration=62.0)
    rng, scale = np.random.default_rng(seed), noisy * min(L / 2.7, 1.0)
    changed = {}
    for name, sd in NOISE.items():
        angle = name in ("r", "delta_f")
        noise = sd * (noisy if angle else scale) * rng.standard_normal(len(made))
        changed[name] = getattr(made, name) + noise
    return replace(made, axle_force=None, **changed)


WITHOUT = {"all": {}, "no v_y": {"v_y": None}, "no a_y": {"a_y": None}}
EVERYDAY = {
    **{error: ON_MOTION[error] for error in (
        "delta to the right", "r to the right", "a_y to the right", "delta in degrees",
        "r in degrees", "a_y in g",
    )},
    "a hand wheel": (scaled(delta_f=15.0), "delta_f must be", "steering wheel"),
    "rad/s read as deg/s": (scaled(r=1.0 / DEGREES), "r must be in rad/s", "180/pi"),
}  # fmt: skip


@pytest.mark.parametrize("car", EVERYDAY_SPEEDS)
@pytest.mark.parametrize("lack", WITHOUT)
def test_a_right_everyday_drive_passes(car, lack):
    for seed, noisy in ((0, 1.0), (1, 1.0), (2, 0.0)):
        made = replace(everyday(car, seed, noisy=noisy), **WITHOUT[lack])
        check_physics(made)
        written = {
            name: np.round(value, 4).astype(np.float32).astype(float)
            for name in NOISE
            if (value := getattr(made, name)) is not None
        }
        check_physics(replace(made, **written))


@pytest.mark.parametrize(
    ("car", "error"),
    [
        (car, error)
        for car in ("sedan", "truck", "tenth")
        for error in EVERYDAY
        if (car, error) != ("tenth", "a hand wheel")  # it has none
    ],
)
def test_an_error_of_an_everyday_drive_rings(car, error):
    plant, start, remedy = EVERYDAY[error]
    for v_y in (True, False):
        made = everyday(car, 3)
        message = refusal(plant(made if v_y else replace(made, v_y=None)))
        assert message.startswith(start), message
        assert remedy in message


def test_a_gyro_that_holds_noise_is_named(rng):
    made = everyday("sedan", 5)
    noise = 0.002 * rng.standard_normal(len(made))
    assert refusal(replace(made, r=noise)).startswith("r must be the yaw rate")


def test_an_a_y_without_v_x_r_is_not_turned():
    made = drive(peak=5.0)
    lacking = np.gradient(made.v_y, made.t)
    for part in (replace(made, a_y=lacking), replace(made, a_y=lacking, v_y=None)):
        message = refusal(replace(part, axle_force=None))
        assert message.startswith("ay must be")
        assert "change the sign" not in message


def test_an_a_y_that_is_the_yaw_rate_is_named():
    made = replace(drive(peak=1.0), axle_force=None)
    for factor in (1.0, 57.3, -1.0):
        assert "a copy of the yaw rate? leave it out" in refusal(replace(made, a_y=factor * made.r))


@pytest.mark.parametrize("axes", ["east-north", "north-east", "begun at 120 degrees"])
@pytest.mark.parametrize("peak", [1.5, 5.0])
def test_velocities_of_the_world_are_named(axes, peak):
    made = drive(peak=peak, duration=30.0)
    begin = np.radians(120.0) if axes.startswith("begun") else 0.0
    heading = begin + np.concatenate([[0.0], np.cumsum(made.r[:-1])]) * made.dt
    velocity = (made.v_x + 1j * made.v_y) * np.exp(1j * heading)
    if axes == "north-east":  # as NED: y to the right, r and steering with it
        velocity = np.conj(velocity)
        made = replace(made, r=-made.r, delta_f=-made.delta_f)
    world = replace(made, v_x=velocity.real, v_y=velocity.imag, a_y=None, axle_force=None)
    assert "of the world's axes" in refusal(world)


def test_a_log_without_any_motion_sideways_is_judged_without_a_warning():
    made, nothing = drive(peak=0.0), np.zeros(1200)
    names = ("v_y", "r", "delta_f", "a_y")
    check_physics(replace(made, axle_force=None, **dict.fromkeys(names, nothing)))


def test_of_two_velocities_that_of_the_car_is_read_by_their_directions():
    made = drive()
    world = (made.v_x + 1j * made.v_y) * np.exp(1j * np.cumsum(made.r) * made.dt)
    velocities = {"v_x": world.real, "v_y": world.imag, "v_long": made.v_x, "v_tran": made.v_y}
    rest = {"t": made.t, "r": made.r, "delta_f": made.delta_f}
    read = read_recording({**rest, **velocities})
    np.testing.assert_array_equal(read.v_x, made.v_x)
    np.testing.assert_array_equal(read.v_y, made.v_y)
    assert any("v_x and v_y are of the world's axes" in note for note in read.notes)


@pytest.mark.parametrize(
    ("name", "factor", "offered"),
    [("ax", 1.0, "ax"), ("acc_2", -1.0 / 9.81, "acc_2 [g] *-1")],
)
def test_the_channel_that_is_the_lateral_acceleration_is_offered(rng, name, factor, offered):
    made = drive()
    other = 0.5 * np.sin(made.t) + 0.05 * rng.normal(size=made.t.size)
    rest = {"t": made.t, "r": made.r, "delta_f": made.delta_f, "vx": made.v_x}
    with pytest.raises(RecordingError, match="its slope on v_x r") as refused:
        read_recording({**rest, "ay": other, name: factor * made.a_y})
    assert f'columns={{"ay": "{offered}"}}' in str(refused.value)
