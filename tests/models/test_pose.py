"""A pose as a source of v_x, v_y and r: its noise, delay, axes and units, in tables and bags."""

import re

import numpy as np
import pytest

from models.logs.clock import Raw
from models.logs.door import open_log
from models.logs.log import RecordingError
from models.logs.names import propose
from models.logs.signals import POSE, Signal
from models.recordings import LogMap, read_recording
from models.recordings.map import given_signals
from models.recordings.pose import _lateness, _motion_of, _smoothed

T = 0.01 * np.arange(3000)
V_X = 2.0 + 0.5 * np.sin(0.5 * T)
R = 1.5 * np.sin(1.7 * T) + 0.4 * np.sin(0.6 * T)
V_Y = 0.08 * R - 0.05 * V_X * R
DELTA = 0.17 * R / V_X


def integral(values):
    return np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(T))])


PSI = integral(R)
X = integral(V_X * np.cos(PSI) - V_Y * np.sin(PSI))
Y = integral(V_X * np.sin(PSI) + V_Y * np.cos(PSI))


def noisy(values, size, seed):
    return values + size * np.random.default_rng(seed).normal(size=values.size)


def raw(values, t=T):
    return Raw(t, np.asarray(values, dtype=float), "row", np.arange(t.size))


def posed(x=X, y=Y, psi=PSI, t=T):
    return {"x": raw(x, t), "y": raw(y, t), "heading": raw(psi, t)}


def motion_of(parts, declared=False):
    return _motion_of("log", parts, {n: Signal(channel=(n,)) for n in POSE}, declared)


def misses(motion, t=T):
    inner = slice(20, -20)
    return {
        name: float(np.sqrt(np.mean((raw.values - np.interp(raw.t, T, true))[inner] ** 2)))
        for name, raw, true in (
            ("v_x", motion.v_x, V_X),
            ("v_y", motion.v_y, V_Y),
            ("r", motion.r, R),
        )
    }


@pytest.mark.parametrize("seed", range(3))
def test_a_pose_with_noise_tells_the_motion_and_its_noise(seed):
    x, y = noisy(X, 0.005, seed), noisy(Y, 0.005, seed + 50)
    psi = noisy(PSI, np.radians(0.5), seed + 99)
    motion = motion_of(posed(x, y, psi))
    found = misses(motion)
    assert found["v_y"] < 0.035 and found["v_x"] < 0.035 and found["r"] < 0.03
    position, heading = re.findall(r"by ([\d.]+) (?:m|deg)", motion.said)
    assert float(position) == pytest.approx(0.005, rel=0.05)
    assert float(heading) == pytest.approx(0.5, rel=0.05)
    plain = np.gradient(x, T) * -np.sin(psi) + np.gradient(y, T) * np.cos(psi)
    assert found["v_y"] < 0.1 * np.std(plain - V_Y)


def test_smoothing_is_as_strong_as_the_noise_asks():
    wave = np.sin(0.1 * np.arange(800.0))[:, None]
    for size, left in ((0.01, 0.006), (0.3, 0.12)):
        values, noise = _smoothed(noisy(wave[:, 0], size, 1)[:, None])
        assert noise == pytest.approx(size, rel=0.1) and np.std(values - wave) < left


HEADINGS = {
    "wrapped": lambda psi: np.angle(np.exp(1j * psi)),
    "degrees": np.degrees,
    "degrees, wrapped": lambda psi: np.degrees(psi) % 360.0,
    "compass": lambda psi: (90.0 - np.degrees(psi)) % 360.0,
    "mounted across": lambda psi: psi - np.pi / 2.0,
}


@pytest.mark.parametrize("swing", [1.0, 0.08])  # to 80 deg, and a slalom within 6 deg
@pytest.mark.parametrize("kind", HEADINGS)
def test_a_heading_is_understood_however_it_counts(kind, swing):
    psi, q = swing * PSI, np.random.default_rng(8)
    x, y = (
        integral(V_X * one - swing * V_Y * other) + 5e-4 * q.normal(size=T.size)
        for one, other in ((np.cos(psi), np.sin(psi)), (np.sin(psi), -np.cos(psi)))
    )
    seen = psi + np.radians(0.05) * q.normal(size=T.size)
    motion = motion_of(posed(x, y, HEADINGS[kind](seen)))
    np.testing.assert_allclose(motion.r.values[30:-30], swing * R[30:-30], atol=0.04)
    assert np.std(motion.v_y.values - swing * V_Y) < 0.02
    assert float(re.findall(r"([\d.]+) deg$", motion.said)[0]) == pytest.approx(0.05, rel=0.1)


def test_where_the_drive_does_not_tell_how_a_heading_counts_it_is_asked_for():
    straight = posed(2.0 * T, noisy(0.0 * T, 1e-3, 1), np.radians(noisy(0.0 * T, 0.5, 2)))
    with pytest.raises(RecordingError, match=r'"x=x" "y=y" "heading=heading \[rad\]", with \*-1'):
        motion_of(straight)
    assert abs(motion_of(straight, declared=True).r.values).max() < 0.05


@pytest.mark.parametrize("turned", [0.0, 0.05, -0.08])
def test_how_the_frame_of_a_pose_is_turned_is_taken_off(turned):
    psi = noisy(PSI + turned, np.radians(0.3), 4)
    motion = motion_of(posed(noisy(X, 1e-3, 5), noisy(Y, 1e-3, 6), psi))
    assert np.mean((motion.v_y.values - V_Y) / V_X) == pytest.approx(0.0, abs=3e-3)
    assert ("deg off the travel" in motion.said) == (turned != 0.0)


def test_a_drive_to_one_side_does_not_tell_how_the_frame_is_turned():
    psi = integral(np.abs(R))
    x, y = integral(V_X * np.cos(psi)), integral(V_X * np.sin(psi))
    found = motion_of(posed(x, y, psi + 0.05))
    assert np.mean(found.v_y.values / V_X) == pytest.approx(-0.05, abs=3e-3)


def test_a_car_that_reverses_for_a_while_keeps_its_heading():
    back = np.where((T > 8.0) & (T < 14.0), -1.0, 1.0) * V_X
    x, y = integral(back * np.cos(PSI)), integral(back * np.sin(PSI))
    found = motion_of(posed(x, y, HEADINGS["compass"](PSI)))
    np.testing.assert_allclose(found.v_x.values[200:700], V_X[200:700], atol=5e-3)
    np.testing.assert_allclose(found.v_x.values[900:1300], -V_X[900:1300], atol=5e-3)


def test_gaps_of_a_pose_are_not_bridged():
    there = (T < 10.0) | (T > 11.0)
    motion = motion_of(posed(X[there], Y[there], PSI[there], T[there]))
    np.testing.assert_array_equal(motion.v_y.t, T[there])
    assert np.diff(motion.v_y.t).max() > 0.9
    with pytest.raises(RecordingError, match="at least 30 samples without a gap, it has 20"):
        motion_of(posed(X[:20], Y[:20], PSI[:20], T[:20]))


@pytest.mark.parametrize("late", [-0.04, 0.0, 0.013, 0.09])
def test_how_late_a_gyro_is_is_found_to_a_millisecond(late):
    gyro = raw(noisy(np.interp(T - late, T, 1.1 * R + 0.02), 0.05, 3))
    assert _lateness(gyro, raw(R)) == pytest.approx(late, abs=2e-3)
    assert _lateness(raw(noisy(0 * T, 0.1, 1)), raw(R)) is None


COLUMNS = {
    "x [m]": noisy(X, 0.003, 1), "y [m]": noisy(Y, 0.003, 2), "yaw [rad]": noisy(PSI, 0.004, 3),
    "imu_gyro_z [rad/s]": np.interp(T - 0.08, T, R),
    "imu_acc_y [m/s^2]": np.interp(T - 0.08, T, np.gradient(V_Y, T) + V_X * R),
    "drive.steering_angle [rad]": DELTA, "encoder_speed [m/s]": V_X,
}  # fmt: skip
TOLD = LogMap(signals=given_signals(["x=x [m]", "y=y [m]", "heading=yaw [rad]"]))


def table(path, columns):
    rows = [",".join(["t [s]", *columns])]
    rows += [",".join(f"{x:.6g}" for x in row) for row in np.column_stack([T, *columns.values()])]
    path.write_text("\n".join([*rows, ""]))
    return path


def judge(found, scatter=0.03):
    t = found.t
    for values, true in ((found.v_x, V_X), (found.v_y, V_Y), (found.r, R), (found.delta_f, DELTA)):
        size = scatter * (3.0 if true is R else 1.0)
        assert np.sqrt(np.mean((values - np.interp(t, T, true))[30:-30] ** 2)) < size
    a_y = np.interp(t, T, np.gradient(V_Y, T) + V_X * R)
    assert np.sqrt(np.mean((found.a_y - a_y)[30:-30] ** 2)) < 0.15


def test_columns_of_a_pose_are_a_source_of_v_y_and_tell_that_the_box_is_late(tmp_path):
    path = table(tmp_path / "log.csv", COLUMNS)
    found = read_recording(path)
    judge(found)
    said = "; ".join(found.notes)
    assert "taken from the pose; its position scatters by 0.003 m" in said
    assert "the gyro is 80 ms late against the pose: r, a_y are moved by it" in said
    log = open_log(path)
    proposal = propose(log, log.headings())
    assert {"x", "y", "heading"} <= set(proposal.signals())


@pytest.mark.parametrize("height", [True, False])
@pytest.mark.parametrize(
    ("axes", "turn"), [(((0, -1), (1, 0)), -1), (((0, -1), (-1, 0)), 1), (((1, 0), (0, -1)), 1)]
)  # x to the right and z forward, as Unity has it; z backward, as OpenGL; x forward
def test_a_pose_in_the_plane_of_x_and_z_is_read(tmp_path, axes, turn, height):
    x, z = np.array(axes) @ np.array([COLUMNS["x [m]"], COLUMNS["y [m]"]])
    up = {"y [m]": noisy(0 * T, 0.003, 4)} if height else {}
    rest = {key: one for key, one in COLUMNS.items() if key != "y [m]"}
    columns = {**rest, **up, "x [m]": x, "z [m]": z, "yaw [rad]": turn * COLUMNS["yaw [rad]"]}
    judge(read_recording(table(tmp_path / "log.csv", columns)))
    del columns["drive.steering_angle [rad]"]  # without which it may be seen from below
    log = open_log(table(tmp_path / "log.csv", columns))
    assert "*-1" in propose(log, log.headings()).guesses["y"].why


def test_a_measured_v_y_comes_before_a_pose(tmp_path):
    found = read_recording(table(tmp_path / "log.csv", {**COLUMNS, "vy [m/s]": V_Y}))
    np.testing.assert_allclose(found.v_y, V_Y, atol=1e-5)
    assert not any("pose" in note for note in found.notes)


def test_a_pose_can_be_told_and_wants_all_three(tmp_path):
    names = {"x [m]": "px", "y [m]": "py", "yaw [rad]": "rotation"}
    path = table(tmp_path / "log.csv", {names.get(k, k): v for k, v in COLUMNS.items()})
    told = LogMap(signals=given_signals(["x=px [m]", "y=py [m]", "heading=rotation [rad]"]))
    judge(read_recording(path, log_map=told))
    told.to_toml(tmp_path / "log.toml")
    assert LogMap.from_toml(tmp_path / "log.toml") == told
    with pytest.raises(
        RecordingError, match="x, y and heading are a pose together: give all three"
    ):
        given_signals(["x=px", "y=py"])


def test_a_pose_that_is_integrated_from_wheels_is_refused(tmp_path):
    x, y = integral(V_X * np.cos(PSI)), integral(V_X * np.sin(PSI))
    path = table(tmp_path / "log.csv", {**COLUMNS, "x [m]": x, "y [m]": y, "yaw [rad]": PSI})
    with pytest.raises(RecordingError, match=r"never leaves its heading, as one .* from wheels"):
        read_recording(path, log_map=TOLD)


def test_a_pose_that_nobody_told_and_that_is_none_is_left_aside_with_a_note(tmp_path):
    columns = {**COLUMNS, "yaw [rad]": 3.0 * np.sin(T)}
    found = read_recording(table(tmp_path / "log.csv", columns))
    assert found.v_y is None and found.a_y is not None
    assert any("x, y, heading is left aside" in note for note in found.notes)
    with pytest.raises(RecordingError, match="must go along with the direction of travel"):
        read_recording(tmp_path / "log.csv", log_map=TOLD)


@pytest.mark.parametrize("kind", ["PoseStamped", "Odometry", "TFMessage"])
def test_a_bag_with_pose_imu_and_command_is_read_as_it_is(tmp_path, kind):
    pytest.importorskip("rosbags")
    from tests.models.logs.drive_in_every_format import header
    from tests.models.logs.test_bag import STORE, write

    kinds = STORE.types
    make = {name.rpartition("/")[2]: kinds[name] for name in kinds}
    vector, none = make["Vector3"], np.zeros(36)
    box, command, tracked = [], [], []
    for k, t in enumerate(T[:2000]):
        ns = 10**18 + round(1e9 * t)
        psi = COLUMNS["yaw [rad]"][k]
        turn = make["Quaternion"](0.0, 0.0, np.sin(psi / 2.0), np.cos(psi / 2.0))
        at = make["Pose"](make["Point"](COLUMNS["x [m]"][k], COLUMNS["y [m]"][k], 0.1), turn)
        if kind == "Odometry":
            still = make["Twist"](vector(0.0, 0.0, 0.0), vector(0.0, 0.0, 0.0))
            message = make["Odometry"](
                header(STORE, ns, "map"), "base_link", make["PoseWithCovariance"](at, none),
                make["TwistWithCovariance"](still, none),
            )  # fmt: skip
        elif kind == "TFMessage":
            moved = make["Transform"](vector(at.position.x, at.position.y, 0.1), turn)
            still = make["Transform"](vector(0.1, 0.0, 0.0), make["Quaternion"](0.0, 0.0, 0.0, 1.0))
            message = make["TFMessage"]([
                make["TransformStamped"](header(STORE, ns, "map"), "base_link", moved),
                make["TransformStamped"](header(STORE, ns, "base_link"), "laser", still),
            ])  # fmt: skip
        else:
            message = make["PoseStamped"](header(STORE, ns, "map"), at)
        tracked.append((ns, message))
        rate, push = COLUMNS["imu_gyro_z [rad/s]"][k], COLUMNS["imu_acc_y [m/s^2]"][k]
        nine = np.zeros(9)
        box.append((ns, make["Imu"](
            header(STORE, ns), make["Quaternion"](0.0, 0.0, 0.0, 1.0), nine,
            vector(0.0, 0.0, rate), nine, vector(0.1, push, 9.81), nine,
        )))  # fmt: skip
        drive = make["AckermannDrive"](DELTA[k], 0.0, V_X[k], 0.0, 0.0)
        command.append((ns, make["AckermannDriveStamped"](header(STORE, ns), drive)))
    package = {"PoseStamped": "geometry_msgs", "Odometry": "nav_msgs", "TFMessage": "tf2_msgs"}
    topics = {
        "/tf" if kind == "TFMessage" else "/vicon/car": (f"{package[kind]}/msg/{kind}", tracked),
        "/imu": ("sensor_msgs/msg/Imu", box),
        "/ackermann_cmd": ("ackermann_msgs/msg/AckermannDriveStamped", command),
    }
    found = read_recording(write(tmp_path / "bag", topics))
    assert any("80 ms late" in note for note in found.notes), found.notes
    judge(found)


@pytest.mark.parametrize("place", [0.0, 12.3])
def test_a_pose_that_stands_is_refused(place):
    still = np.full(T.size, place)
    with pytest.raises(RecordingError, match="the pose must move"):
        motion_of(posed(x=still, y=still))
