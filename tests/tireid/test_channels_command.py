"""`tireid channels`: what a log holds, the map that it writes, and logs that are read by one."""

import csv
import re
import tomllib

import numpy as np
import pytest

import tireid as ti
from models.logs.log import some
from models.recordings import RecordingError, read_recording, write_recording
from tests.tireid.conftest import columns_of, json_of, learn_words, page_in, typed

CAR = ti.sedan()

pytestmark = pytest.mark.usefixtures("unmade")  # words and numbers are asked, not pictures


@pytest.fixture(scope="module")
def log():
    return ti.sample_recording(CAR)


@pytest.fixture(scope="module")
def folder(log, tmp_path_factory):
    """A car, a log in SI, and the same as a logger writes it: degrees, km/h, g, hand wheel."""
    folder = tmp_path_factory.mktemp("logs")
    CAR.to_toml(folder / "car.toml")
    write_recording(log, folder / "plain.csv")
    columns = {
        "Time": ("s", log.t),
        "Ground Speed": ("km/h", 3.6 * log.v_x),
        "Vel Lat": ("km/h", 3.6 * log.v_y),
        "Gyro Yaw Velocity": ("deg/s", np.degrees(log.r)),
        "Steered Angle": ("deg", 14.6 * np.degrees(log.delta_f)),
        "G Force Lat": ("G", log.a_y / 9.80665),
        "Engine RPM": ("rpm", 3000.0 + 0.0 * log.t),
    }
    with (folder / "motec.csv").open("w", encoding="latin-1", newline="") as file:
        table = csv.writer(file, quoting=csv.QUOTE_ALL)
        table.writerows([["Format", "MoTeC CSV File"], ["Sample Rate", "100.000", "Hz"], []])
        table.writerow(columns)
        table.writerow([unit for unit, _ in columns.values()])
        table.writerow([])
        table.writerows(np.column_stack([values for _, values in columns.values()]).tolist())
    return folder


RATIO = "delta_f=Steered Angle [deg] /14.6"


def test_it_lists_what_is_there_and_what_is_missing(folder, capsys):
    assert typed("channels", folder / "motec.csv") == 1
    said = capsys.readouterr().out
    assert "MoTeC" in said
    row = next(line for line in said.splitlines() if line.startswith("Vel Lat"))
    assert "km/h" in row and "vy: lateral velocity (95%)" in row and " 100 " in row
    row = next(line for line in said.splitlines() if line.startswith("Steered Angle"))
    assert "perhaps delta_f" in row and "give its ratio" in row
    assert '--columns "delta_f=Steered Angle [deg] /RATIO"' in said
    assert typed("channels", folder / "plain.csv") == 0
    assert "all that is needed is there" in capsys.readouterr().out


def test_what_is_there_of_a_log_without_lateral_velocity_is_what_stands_in_for_it(tmp_path, capsys):
    path = tmp_path / "imu.csv"
    rows = [f"{0.01 * k:.2f},20.0,0.{k % 10},{k % 7},0.0{k % 3}" for k in range(200)]
    path.write_text("\n".join(["t,vx,r,ay,delta_f", *rows]))
    assert typed("channels", path) == 0
    assert "all that is needed is there: vx, r, delta_f, ay\n" in capsys.readouterr().out


def test_beside_a_declared_pose_no_velocity_is_written_and_a_command_is_marked(
    log, tmp_path, capsys
):
    columns = {"x [m]": log.t, "y [m]": log.r, "yaw [rad]": log.r, "vx [m/s]": log.v_x}
    columns |= {"vy [m/s]": log.v_y, "yaw_rate [rad/s]": log.r, "gyro_z [rad/s]": 1.1 * log.r}
    columns |= {"steer_cmd [rad]": log.delta_f, "ay [m/s^2]": log.a_y}
    path, by = written(tmp_path / "log.csv", log, columns), tmp_path / "log.toml"
    words = ["vx=vx", "vy=vy", "x=x", "y=y", "heading=yaw", "delta_f=steer_cmd"]
    assert typed("channels", path, "--columns", *words, "--write", by) == 0
    assert set(tomllib.loads(by.read_text())["signals"]) == {"x", "y", "heading", "delta_f", "a_y"}
    said = capsys.readouterr().out
    assert "all that is needed is there: vx, vy, r, delta_f; vx, vy, r from the pose\n" in said
    for name, meant in (
        ("vx", "vx, not read: it is from the pose"),
        ("yaw_rate", "r, not read: it is from the pose"),
        ("steer_cmd", "delta_f: front steering angle, commanded and not measured"),
    ):
        assert next(line for line in said.splitlines() if line.startswith(name)).endswith(meant)


def test_names_in_a_message_are_whole():
    names = [f"/topic_{k}/pose.pose.orientation.x" for k in range(28)]
    listed, end = some(names).split(", ..."), " (28)"
    assert listed[1] == end and set(listed[0].split(", ")) <= set(names)
    assert some(names[:2]) == ", ".join(names[:2])


@pytest.mark.heavy
def test_a_log_of_a_logger_goes_to_the_verdict_of_the_same_in_si(folder, tmp_path, capsys):
    told = tmp_path / "log.toml"
    motec, car = str(folder / "motec.csv"), str(folder / "car.toml")
    assert typed("channels", motec, "--columns", RATIO, "--write", told) == 0
    data = tomllib.loads(told.read_text())
    assert data["signals"]["delta_f"] == {"channel": "Steered Angle", "unit": "deg", "ratio": 14.6}
    words = ["identify", motec, "--vehicle", car, "--out", tmp_path / "out"]
    assert typed(*words, "--log", told) == 0
    plain = ["identify", folder / "plain.csv", "--vehicle", car]
    assert typed(*plain, "--out", tmp_path / "plain") == 0
    found, same = (json_of(tmp_path / one / "weights.json") for one in ("out", "plain"))
    stiffness = [one["cornering_stiffness_N_rad"] for one in (found, same)]
    assert np.allclose(stiffness[0], stiffness[1], rtol=1e-6)


def test_what_is_taken_by_its_name_is_said_and_stands_in_the_report(folder, tmp_path, capsys):
    out = tmp_path / "out"
    words = learn_words(folder, "motec.csv")
    assert typed(*words, "--columns", RATIO, "--out", out) == 0
    said = capsys.readouterr().err
    assert "vy is taken from Vel Lat [km/h], by its name" in said
    assert "vy is taken from Vel Lat [km/h], by its name" in page_in(out)


def test_an_error_shows_the_word_that_mends_it(folder, capsys):
    words = learn_words(folder, "motec.csv")
    assert typed(*words) == 2
    said = capsys.readouterr().err
    assert "column delta_f is missing; did you mean 'Steered Angle' of the hand wheel" in said
    assert 'declare it by --columns "delta_f=Steered Angle [deg] /RATIO"' in said
    assert "delta_fr" not in said


def test_a_rear_or_right_wheel_is_not_taken_for_the_front_axle(log, tmp_path):
    columns = columns_of(log)
    columns["delta_fl"] = columns["delta_fr"] = columns.pop("delta_f")
    with pytest.raises(RecordingError) as caught:
        ti.read_recording(columns)
    most = f"goes to {np.abs(log.delta_f).max():.3g}"
    said = f"did you mean 'delta_fl + delta_fr' for delta_f ({most}; mean of two"
    assert said in str(caught.value)
    told = ti.read_recording(columns, columns={"delta_f": "delta_fl + delta_fr [rad]"})
    assert np.array_equal(told.delta_f, log.delta_f)


@pytest.mark.parametrize("cut_off", [1e-300, 1e-9, 0.0099, 50.0, 1e9])
def test_a_filter_that_lets_nothing_pass_or_cannot_be_is_refused(log, cut_off):
    columns = columns_of(log)
    said = "^mine: low_pass of the map must be at least 0.01 Hz and below half the sampling rate"
    with pytest.raises(RecordingError, match=said):
        ti.read_recording(columns, name="mine", log_map=ti.LogMap(low_pass=cut_off))
    slow = ti.LogMap(low_pass=0.01)
    least = ti.read_recording(columns, log_map=slow, check=False)
    assert np.ptp(least.v_x) < 0.5 * np.ptp(log.v_x)


def test_mirrored_axes_and_a_filter_are_told_by_the_map(log):
    columns = columns_of(log) | {"ay": log.a_y}
    columns |= {name: -columns[name] for name in ("vy", "r", "delta_f", "ay")}
    told = ti.read_recording(columns, log_map=ti.LogMap(axes="SAE"))
    for name in ("v_x", "v_y", "r", "delta_f", "a_y"):
        assert np.array_equal(getattr(told, name), getattr(log, name))
    smooth = ti.read_recording(columns, log_map=ti.LogMap(axes="SAE", low_pass=5.0))
    ahead = ti.read_recording(
        {name: np.where(log.t > 20.0, 0.0, value) if name == "vy" else value
         for name, value in columns.items()},
        log_map=ti.LogMap(axes="SAE", low_pass=5.0), check=False,
    )  # fmt: skip
    before = log.t < 20.0
    assert np.array_equal(ahead.v_y[before], smooth.v_y[before])  # no look at later samples
    assert np.std(np.diff(smooth.a_y, n=2)) < 0.2 * np.std(np.diff(log.a_y, n=2))


def test_several_logs_teach_one_model_with_errors_of_each(log, folder, tmp_path, capsys):
    write_recording(log.between(0.0, 22.0), tmp_path / "a.csv")
    write_recording(log.between(18.0, 39.0), tmp_path / "b.csv")
    out, car = tmp_path / "out", str(folder / "car.toml")
    logs = [str(tmp_path / "a.csv"), str(tmp_path / "b.csv")]
    assert typed("identify", *logs, "--vehicle", car, "--out", out) == 0
    said = capsys.readouterr()
    rows = [line.split() for line in said.out.splitlines()]
    assert any(row[2:3] == ["a"] for row in rows) and any(row[2:3] == ["b"] for row in rows)
    errors = json_of(out / "summary.json")["rmse_N"]
    assert {"a + b", "a", "b"} == set(errors["online"])
    frozen = next(iter(errors["frozen"].values()))
    whole, parts = frozen["a + b"]["front"], [frozen[one]["front"] for one in "ab"]
    n = [len(read_recording(path)) for path in logs]
    mean = np.sqrt(np.average(np.square(parts), weights=n))
    assert whole == pytest.approx(mean, rel=0.02)  # but for the first force after the joint


def test_a_repair_of_the_map_is_taken_out_of_log_and_car_and_said(log, folder, tmp_path, capsys):
    off = ti.read_recording(columns_of(log) | {"r": -log.r}, check=False)
    write_recording(off, tmp_path / "off.csv")
    (tmp_path / "log.toml").write_text("[repair.factor]\nr = -1.0\n[repair.vehicle]\nmass = 1400\n")
    words = learn_words(folder, tmp_path / "off.csv")
    assert typed(*words, "--out", tmp_path / "no") == 2
    capsys.readouterr()
    done = [*words, "--log", tmp_path / "log.toml", "--out", tmp_path / "out"]
    assert typed(*done) in (0, 3)
    said = capsys.readouterr().err
    assert "repairs the car: mass = 1400" in said and "factor.r = -1" in said
    summary = json_of(tmp_path / "out" / "summary.json")
    assert summary["vehicle"]["mass"] == 1400.0


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["nowhere.csv"], "no such file"),
        (["plain.csv", "--write", "log.json"], "must end in .toml"),
        (["plain.csv:lap"], "so no run 'lap'; leave it out"),
        (["plain.csv", "--columns", "speed=vx"], "'speed' is no column of ours"),
        (["plain.csv", "--log", "nowhere.toml"], "nowhere.toml"),
    ],
)
def test_words_that_are_wrong_are_told_in_one_line(folder, words, said, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    assert typed("channels", *words) == 2
    error = capsys.readouterr().err
    assert said in error and len(error.strip().splitlines()) == 1


def test_a_map_that_is_there_is_not_replaced(folder, tmp_path, capsys):
    (tmp_path / "log.toml").write_text("")
    words = ["channels", folder / "plain.csv", "--write", tmp_path / "log.toml"]
    assert typed(*words) == 2
    assert typed(*words, "--force") == 0
    assert "[signals.v_x]" in (tmp_path / "log.toml").read_text()


def test_a_unit_in_the_header_is_a_unit_and_need_not_be_told(log, tmp_path):
    header = "Time [s],Ground Speed [km/h],Vel Lat [km/h],Yaw Rate [deg/s],RoadWheelAngle [deg]"
    degrees = np.degrees([log.r, log.delta_f])
    table = np.column_stack([log.t, 3.6 * log.v_x, 3.6 * log.v_y, *degrees])
    path = tmp_path / "log.csv"
    np.savetxt(path, table, fmt="%.12g", delimiter=",", header=header, comments="")
    got = read_recording(path)
    for name in ("v_x", "v_y", "r", "delta_f"):
        assert np.allclose(getattr(got, name), getattr(log, name), atol=1e-9)
    assert "vy is taken from Vel Lat [km/h], by its name" in got.notes
    told = read_recording(path, columns={"vy": "Vel Lat [km/h] *1", "r": "Yaw Rate"})
    assert np.array_equal(told.v_y, got.v_y) and np.array_equal(told.r, got.r)
    in_ms = read_recording(path, columns={"vy": "Vel Lat [m/s]"}, check=False)
    assert np.allclose(in_ms.v_y, 3.6 * got.v_y)  # what is told holds
    with pytest.raises(RecordingError, match="must be in a unit of a speed"):
        read_recording(path, columns={"vy": "Yaw Rate"})
    assert typed("channels", path, "--columns", "vy=Yaw Rate *-1") == 2


def test_cells_without_a_value_are_told_and_cut_out_by_the_map_that_is_written(folder, log, capsys):
    lost, single = slice(1000, 1300), 2000  # three seconds without v_y, and one sample
    rows = (folder / "plain.csv").read_text(encoding="utf-8").splitlines()
    at = rows[0].split(",").index("vy")
    for k in (*range(lost.start, lost.stop), single):
        cells = rows[k + 1].split(",")
        cells[at] = "" if k % 2 else "nan"
        rows[k + 1] = ",".join(cells)
    path, by = folder / "holes.csv", folder / "holes.toml"
    path.write_text("\n".join([*rows, ""]), encoding="utf-8")
    with pytest.raises(RecordingError, match=r"vy must be finite, 301 of 4000 .*--cut-holes"):
        read_recording(path)
    assert typed("channels", path, "--write", by) == 0
    said = capsys.readouterr().out
    assert "vy has no value in 301 of 4000 cells of 'vy', the first in line 1002" in said
    assert "they are rejected without --cut-holes" in said
    read = read_recording(path, log_map=by)
    assert read.breaks == (1000,) and len(read) == 3700
    assert "cells without a value are cut out: 301 of vy" in read.notes
    assert any("gaps cut the log into 2 segments" in note for note in read.notes)
    kept = np.r_[0 : lost.start, lost.stop : len(log)]
    known = kept != single
    assert np.array_equal(read.v_y[known], log.v_y[kept][known])
    assert abs(read.v_y[~known] - log.v_y[single]) < 0.1, "v_y goes on as before for one sample"
    assert typed("channels", path, "--cut-holes") == 0
    assert "they are cut out, as given" in capsys.readouterr().out


def test_a_clock_is_mended_where_it_is_asked_for(folder, tmp_path, capsys):
    rows = (folder / "plain.csv").read_text(encoding="utf-8").splitlines()
    path, by = tmp_path / "twice.csv", tmp_path / "log.toml"
    mixed = [rows[0], *rows[1:2000], rows[1999], *rows[2001:], rows[2000]]
    path.write_text("\n".join([*mixed, ""]), encoding="utf-8")
    with pytest.raises(
        RecordingError, match=r"a sample is there twice: --mend-clock .* leaves one"
    ):
        read_recording(path)
    assert typed("channels", path, "--mend-clock", "--write", by) == 0
    assert 'order = "mend"' in by.read_text(encoding="utf-8")
    read, right = read_recording(path, log_map=by), read_recording(folder / "plain.csv")
    assert np.array_equal(read.t, right.t) and np.array_equal(read.r, right.r)
    assert "t: samples out of order are sorted: 1" in read.notes
    capsys.readouterr()


def test_a_clock_that_a_map_names_is_mended_too(folder, tmp_path):
    rows = (folder / "plain.csv").read_text(encoding="utf-8").splitlines()
    own = [row.split(",")[0] for row in rows]
    rows, own = [*rows, rows[-1]], ["own", *own[1:], own[-1]]
    count = ["t", *(repr(k / 100.0) for k in range(len(rows) - 1))]
    path = tmp_path / "own.csv"
    both = zip(count, own, (row.partition(",")[2] for row in rows), strict=True)
    path.write_text("\n".join([*map(",".join, both), ""]), encoding="utf-8")
    with pytest.raises(RecordingError, match="a sample is there twice"):
        read_recording(path, log_map=ti.LogMap(clock="own"))
    mended = read_recording(path, log_map=ti.LogMap(clock="own", order="mend"))
    right = read_recording(folder / "plain.csv")
    assert np.array_equal(mended.t, right.t) and np.array_equal(mended.v_y, right.v_y)
    assert any("left out: 1" in note for note in mended.notes)


def written(path, log, columns):
    """Write a CSV file whose header has units in brackets, and return its path."""
    table = np.column_stack([log.t, *columns.values()])
    header = ",".join(["Time [s]", *columns])
    np.savetxt(path, table, "%.9g", ",", header=header, comments="", encoding="utf-8")
    return path


def assert_read(got, log):
    for name in ("v_x", "v_y", "r", "delta_f", "a_y"):
        assert np.allclose(getattr(got, name), getattr(log, name), atol=1e-6)


def in_degrees(log):
    columns = {"Geschw [km/h]": 3.6 * log.v_x, "Gierrate [°/s]": np.degrees(log.r)}
    return columns | {"RoadWheelAngle [deg]": np.degrees(log.delta_f)}


def test_a_log_in_german_is_read_by_its_names(log, tmp_path):
    columns = in_degrees(log) | {"Quergeschw [km/h]": 3.6 * log.v_y, "Querbeschl [m/s²]": log.a_y}
    got = read_recording(written(tmp_path / "fahrt.csv", log, columns))
    assert_read(got, log)


def test_a_channel_that_may_be_v_y_is_named_where_the_log_is_read_without(log, tmp_path, capsys):
    columns = in_degrees(log) | {"Querbeschl [m/s²]": log.a_y, "Seitwärts [km/h]": 3.6 * log.v_y}
    path = written(tmp_path / "log.csv", log, columns)
    got = read_recording(path)
    assert got.v_y is None
    note = next(one for one in got.notes if one.startswith("no lateral velocity is read"))
    word = '--columns "vy=Seitwärts [km/h]"'
    assert "if 'Seitwärts [km/h]' for vy (by a word of its name and its unit) is one" in note
    assert note.endswith(f"declare it by {word}")
    assert typed("channels", path, "--write", tmp_path / "log.toml") == 0
    said = capsys.readouterr().out
    assert note in said and "perhaps vy (50%)" in said
    assert "# channel = 'Seitwärts [km/h]'" in (tmp_path / "log.toml").read_text(encoding="utf-8")
    told = read_recording(path, columns={"vy": "Seitwärts [km/h]"})
    assert np.allclose(told.v_y, log.v_y, atol=1e-6)


def test_two_channels_that_may_be_a_y_are_named_beside_a_v_y_that_is_read(log, tmp_path, capsys):
    lateral = {"INS_AccLateral [m/s^2]": log.a_y, "ESP_LatAcc [m/s^2]": log.a_y}
    columns = in_degrees(log) | {"VelTrans [km/h]": 3.6 * log.v_y} | lateral
    path = written(tmp_path / "log.csv", log, columns)
    got = read_recording(path)
    assert got.a_y is None and got.v_y is not None
    note = (
        "ay is left aside, as it is not sure: 'INS_AccLateral [m/s^2]' or 'ESP_LatAcc [m/s^2]' for "
        'ay, equally; declare it by --columns "ay=INS_AccLateral [m/s^2]"'
    )
    assert note in got.notes
    assert typed("channels", path) == 0
    assert note in capsys.readouterr().out
    told = read_recording(path, columns={"ay": "INS_AccLateral [m/s^2]"})
    assert not any("left aside" in one for one in told.notes)


def test_two_channels_that_may_be_a_y_are_named_where_no_v_y_is_there(log, tmp_path, capsys):
    lateral = {"INS_AccLateral [m/s^2]": log.a_y, "ESP_LatAcc [m/s^2]": log.a_y}
    path = written(tmp_path / "log.csv", log, in_degrees(log) | lateral)
    with pytest.raises(RecordingError) as caught:
        read_recording(path)
    said = str(caught.value)
    assert "column vy (or ay, from which it is estimated) is missing; did you mean 'INS_Acc" in said
    assert "'ESP_LatAcc [m/s^2]' for ay, equally?" in said
    assert 'declare it by --columns "ay=INS_AccLateral [m/s^2]"' in said
    assert typed("channels", path, "--write", tmp_path / "log.toml") == 1
    said = capsys.readouterr().out
    assert "vy (lateral velocity) is missing, ay can replace it: 'INS_AccLateral" in said
    assert '--columns "ay=INS_AccLateral [m/s^2]"\n' in said
    assert "# [signals.a_y]" in (tmp_path / "log.toml").read_text(encoding="utf-8")


def test_words_that_are_proposed_for_a_log_without_units_read_it(log, tmp_path, capsys):
    columns = {"velocity [km/h]": 3.6 * log.v_x, "YawRate": np.degrees(log.r)}
    columns |= {
        "Slip_Angle": np.degrees(np.arctan2(log.v_y, log.v_x)),
        "Lat_Acc": log.a_y / 9.80665,
    }
    columns |= {"Steering_Angle": 16.0 * np.degrees(log.delta_f)}
    path = written(tmp_path / "vbox.csv", log, columns)
    assert typed("channels", path, "--write", tmp_path / "log.toml") == 1
    said = capsys.readouterr().out
    assert "perhaps r in deg/s (70%)" in said
    words = re.findall(
        r'"([^"]+)"', next(x for x in said.splitlines() if x.startswith("declare it"))
    )
    assert words == [
        "beta=Slip_Angle [deg]",
        "ay=Lat_Acc [g]",
        "r=YawRate [deg/s]",
        "delta_f=Steering_Angle [deg] /RATIO",
    ]
    told = dict(word.replace("RATIO", "16").split("=", 1) for word in words)
    got = read_recording(path, columns=told)
    assert_read(got, log)
    text = (tmp_path / "log.toml").read_text(encoding="utf-8")
    completed = re.sub(r"^# (?=\[|channel|unit|ratio)", "", text, flags=re.M)
    completed = completed.replace("ratio =", "ratio = 16.0")
    (tmp_path / "log.toml").write_text(completed, encoding="utf-8")
    by_map = read_recording(path, log_map=tmp_path / "log.toml")
    assert np.array_equal(by_map.v_y, got.v_y) and np.array_equal(by_map.delta_f, got.delta_f)


def test_a_sideslip_beside_a_v_y_that_is_read_is_said_to_be_none(log, tmp_path, capsys):
    slip = {"sideSlip [deg]": np.degrees(np.arctan2(log.v_y, log.v_x)), "vyCG [m/s]": log.v_y}
    path = written(tmp_path / "log.csv", log, in_degrees(log) | slip)
    assert typed("channels", path) == 0
    assert "beta, not read beside vy" in capsys.readouterr().out
