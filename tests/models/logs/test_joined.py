"""Logs in pieces: a file a message, a row a value, a sign in another channel, structs of MATLAB."""

import datetime

import numpy as np
import pytest

from models.logs.door import open_log
from models.logs.log import RecordingError
from models.logs.names import propose
from models.recordings import LogMap, read_recording
from models.recordings.map import given_signals
from tests.models.logs.conftest import channel_of, refusal
from tests.models.logs.test_which_time import signals

T = 0.01 * np.arange(600)
SIGNALS = signals(T)


def table(path, names, *columns):
    text = [[x if isinstance(x, str) else f"{x:.6g}" for x in one] for one in columns]
    rows = zip(*text, strict=True)
    path.write_text("\n".join([",".join(names), *map(",".join, rows), ""]))


def at(t):
    return datetime.datetime(2025, 4, 4, 18) + datetime.timedelta(seconds=float(t))


CLOCKS = {
    "seconds": lambda t: [f"{100 + x:.3f}" for x in t],
    "microseconds": lambda t: [f"{1e6 * (100 + x):.0f}" for x in t],
    "instants": lambda t: [at(x).isoformat(timespec="milliseconds") for x in t],
}


@pytest.mark.parametrize("clock", CLOCKS)
def test_a_folder_with_a_file_for_each_message_is_one_log(tmp_path, clock):
    folder = tmp_path / "log"
    folder.mkdir()
    for k, (name, values) in enumerate(SIGNALS.items()):
        part = slice(k, None, 2)  # each begins later than the one before
        times = CLOCKS[clock](T[part])
        table(folder / f"{name}.csv", ["timestamp", name], times, values[part])
    (folder / "notes.txt").write_text("sunny\n")
    log = open_log(folder)
    assert [one.name for one in log.listed()] == sorted(SIGNALS)
    assert any("notes.txt" in note for note in log.notes)
    for channel in log.read(["vx", "delta_f"]):
        expected = np.interp(channel.t - channel_of(log, "vx").t[0], T, SIGNALS[channel.name])
        np.testing.assert_allclose(channel.values, expected, atol=2e-4)
    recording = read_recording(folder)
    assert recording.name == "log" and recording.duration == pytest.approx(5.96, abs=0.03)


def test_a_folder_of_drives_or_without_a_log_is_refused(tmp_path):
    assert "it is a folder without a log" in refusal(tmp_path)
    for name in ("one", "two"):
        table(tmp_path / f"{name}.csv", ["t", *SIGNALS], T, *SIGNALS.values())
    assert "a folder of logs with the same channels" in refusal(tmp_path)


@pytest.mark.parametrize("form", ["time name value", "_time _field _value", "Time Signal Value"])
def test_a_table_with_a_row_for_each_value_has_a_channel_for_each_name(tmp_path, form):
    path = tmp_path / "log.csv"
    rows = [(T[k], one, SIGNALS[one][k]) for k in range(T.size) for one in SIGNALS]
    table(path, form.split(), *map(list, zip(*rows, strict=True)))
    log = open_log(path)
    assert [one.name for one in log.listed()] == list(SIGNALS)
    assert log.listed()[0].rate == pytest.approx(100.0)
    np.testing.assert_allclose(read_recording(path).v_x, SIGNALS["vx"], atol=1e-4)


def test_a_row_of_a_long_table_without_a_time_is_named(tmp_path):
    path = tmp_path / "log.csv"
    stamps = [at(t).isoformat(timespec="milliseconds") for t in T for _ in SIGNALS]
    stamps[10] = ""
    names = list(SIGNALS) * T.size
    values = [SIGNALS[one][k] for k in range(T.size) for one in SIGNALS]
    table(path, ("time", "name", "value"), stamps, names, values)
    assert "must be a time in every row, line 12 has none" in refusal(path)


@pytest.mark.parametrize(
    "form",
    ["t channel value unit", "Zeit Signal Wert Einheit Bemerkung", "id t key reading UOM note"],
)
def test_units_of_a_long_table_stand_beside_its_names(tmp_path, form):
    path = tmp_path / "log.csv"
    told = {"Gyro Z": "deg/s", "Speed": "km/h"}
    rows = [(T[k], one, SIGNALS["r"][k], told[one], "ok") for k in range(300) for one in told]
    rows = [(k, *row) for k, row in enumerate(rows)] if "id" in form else rows
    cut = len(form.split())
    table(path, form.split(), *[list(one) for one in zip(*rows, strict=True)][:cut])
    assert {one.name: one.unit for one in open_log(path).listed()} == told
    lines = path.read_text().splitlines()
    lines[-1] = lines[-1].replace("km/h", "m/s")
    path.write_text("\n".join(lines))
    assert "Speed must have one unit, it has km/h, m/s" in refusal(path)


def test_a_table_with_words_and_a_value_that_is_no_long_one_stays_a_table(tmp_path):
    path = tmp_path / "log.csv"
    table(path, ("t", "name", "value"), T, [f"row {k}" for k in range(T.size)], T)
    assert [one.name for one in open_log(path).listed()] == ["value"]


def test_an_amount_has_the_sign_of_another_channel(tmp_path):
    path = tmp_path / "log.csv"
    steering = 15 * np.degrees(SIGNALS["delta_f"])
    names = ["t", "vx", "vy", "r", "LWI_Lenkradwinkel", "LWI_VZ_Lenkradwinkel"]
    columns = [T, *list(SIGNALS.values())[:3], np.abs(steering)]
    for negative in (steering < 0.0, np.sign(steering)):
        table(path, names, *columns, negative * 1.0)
        for word in ("LWI_Lenkradwinkel sign(LWI_VZ_Lenkradwinkel) [deg] /15",
                     "sign(LWI_VZ_Lenkradwinkel) * LWI_Lenkradwinkel [deg] /15",
                     "LWI_Lenkradwinkel * sign(LWI_VZ_Lenkradwinkel) [deg] /15"):  # fmt: skip
            (signal,) = given_signals([f"delta_f={word}"]).values()
            assert signal.sign == "LWI_VZ_Lenkradwinkel" and signal.channel == (
                "LWI_Lenkradwinkel",
            )
            assert signal.ratio == 15.0 and signal.unit == "deg"
            told = LogMap(signals={"delta_f": signal})
            told.to_toml(tmp_path / "log.toml")
            assert LogMap.from_toml(tmp_path / "log.toml") == told
            found = read_recording(path, log_map=told)
            np.testing.assert_allclose(found.delta_f, SIGNALS["delta_f"], atol=1e-5)
    log = open_log(path)
    guess = propose(log, log.headings()).guesses["delta_f"]
    assert guess.sign == "LWI_VZ_Lenkradwinkel" and guess.hand
    turned = LogMap(signals=given_signals([f"delta_f={word.replace('/15', '/-15')}"]))
    delta_f = read_recording(path, log_map=turned, check=False).delta_f
    np.testing.assert_allclose(delta_f, -SIGNALS["delta_f"], atol=1e-5)
    lost = LogMap(signals=given_signals(["delta_f=LWI_Lenkradwinkel sign(VZ) [deg] /15"]))
    with pytest.raises(RecordingError, match="no column 'VZ' to read as delta_f"):
        read_recording(path, log_map=lost)


@pytest.mark.parametrize("depth", [1, 2])
def test_a_struct_of_matlab_whose_fields_are_ours_is_read(tmp_path, depth):
    scipy = pytest.importorskip("scipy.io")
    path = tmp_path / "log.mat"
    ours = {"vx": "v_x", "vy": "v_y"} if depth == 1 else {}
    inner = {"t": T, **{ours.get(name, name): one for name, one in SIGNALS.items()}}
    slow = {"t": T[::10], "vx": T[::10]}
    tree = {"S": inner} if depth == 1 else {"data": {"car": inner, "gps": slow}}
    scipy.savemat(path, tree)
    np.testing.assert_array_equal(read_recording(path).v_x, SIGNALS["vx"])
    apart = {"t": T, "car": dict(list(SIGNALS.items())[:3]), "cmd": {"delta_f": SIGNALS["delta_f"]}}
    scipy.savemat(path, {"log": apart})
    np.testing.assert_array_equal(read_recording(path).delta_f, SIGNALS["delta_f"])
    scipy.savemat(path, {"a": inner, "b": inner})
    with pytest.raises(RecordingError, match="is missing"):
        read_recording(path)
