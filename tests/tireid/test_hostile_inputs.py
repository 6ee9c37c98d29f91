"""Hostile files and words end in one line and exit code 2, soon, with nothing written."""

import gzip
import json
import re
import subprocess
import sys
from dataclasses import replace

import pytest

from identifier.axle import AxleIdentifier
from identifier.paper.design import PaperIdentifier, design_text
from identifier.paper.network import Network
from models.recordings import RecordingError, read_recording
from models.vehicle import sedan
from tests.tireid.conftest import learn_words, typed
from tireid.output import MARKER, OutputError, output_folder

NINES = "9" * 5000
HEADER = "t,vx,vy,r,delta_f,Fyf,Fyr"


def refused(capsys, words, said):
    """The command refuses its input in one line that holds what is said, and prints no result."""
    assert typed(*words) == 2
    out, err = capsys.readouterr()
    assert out == ""
    lines = [line for line in err.splitlines() if "error:" in line]
    assert lines == err.splitlines()[-1:]
    assert said in lines[0]
    assert len(lines[0]) < 1200


def changed(text, key, value):
    """A TOML text with another value of one key."""
    new, count = re.subn(
        rf"^{key} = [^#\n]*", lambda _: f"{key} = {value} ", text, flags=re.MULTILINE
    )
    assert count == 1
    return new


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("hidden", "1e9", "network.hidden must be a whole number"),
        ("hidden", "1000000000", "units must be at most 128, here are 1000000000; TIREID_LIMITS="),
        ("hidden", NINES, "must be at most 4000"),
        ("hidden", "0x" + "f" * 3000, "network.hidden must be a whole number of 64 bits"),
        ("dt", "1e-6", "dt must lie between 0.0001 and 0.1, it is 1e-06"),
        ("dt", "true", "dt must be a number"),
        ("dt", "1" + "0" * 400, "dt must be a number, it is a whole number of 1329 bits"),
        ("dt", "[" * 3000, "too deep"),
        ("law", "[]", "law must be a text, it is a list of 0"),
        ("input_source", "[[1]]", "input_source must be a text"),
        ("inputs", '"v_y"', "network.inputs must be a list"),
        ("inputs", '[{a = 1}, "r"]', "network.inputs must be a text"),
        ("scale", '["1", "1", "1", "1"]', "network.scale must be a number"),
        ("A_d", "[[-1e308, 0.0], [0.0, -1e308]]", "|A_d| must lie between 0 and 1e+12"),
        ("A_d", "3", "gains.A_d must be a list"),
        ("A_d", "[[-1.0, 0.0], 3]", "gains.A_d must be a list"),
        ("eta_W", "1e308", "eta_W must lie between 1e-15 and 1e+12"),
        ("forgetting", "1e-300", "forgetting must lie between 1e-15 and 1e+12"),
        ("rho_W", "1e-300", "rho_W must lie between 1e-15 and 1e+12"),
        ("scale", "[1.0, 1e-300, 1.0, 1.0]", "scale must lie between 1e-06 and 1e+06"),
        ("seed", "-1", "seed must lie between 0 and"),
        ("force_unit", "1e-300", "force_unit must lie between"),
        ("min_speed", "2026-01-01", "min_speed must be a number"),
    ],
)
def test_a_hostile_design_is_refused_by_its_key(capsys, tmp_path, key, value, said):
    path = tmp_path / "design.toml"
    path.write_text(changed(design_text(PaperIdentifier.for_vehicle(sedan())), key, value))
    refused(capsys, ["check", "--design", path], said)
    assert list(tmp_path.iterdir()) == [path]


@pytest.fixture(scope="module")
def weights():
    """The axle model of the sedan before it has learnt, as it is stored."""
    car = sedan()
    design = AxleIdentifier.for_vehicle(car)
    return design.frozen(car, design.setup(car).carry).to_dict()


@pytest.mark.parametrize(
    ("keys", "value", "said"),
    [
        (["kind"], [], "kind must be a text, it is a list of 0"),
        (["kind"], "onnx", "kind is an ONNX network: make it a method"),
        (["format"], [[]], "not a frozen model"),
        (["vehicle"], [], "vehicle must be a table"),
        (["vehicle", "mass"], 10**400, "vehicle.mass must be a number"),
        (["vehicle", "name"], "half \ud800", "must be Unicode"),
        (["sway"], "a", "sway must be a table"),
        (["sway", "frequency"], "1.0", "sway.frequency must be a number"),
        (["plausibility", "hold"], None, "plausibility.hold must be a number"),
        (["W"], "a", "W must be a number"),
        (["W", 0, 0], "1.0", "W must be a number"),
        (["W", 0, 0], 1e308, "W must hold numbers below 1e+09, it reaches 1e+308"),
        (["W", 0, 0], float("inf"), "W holds a number that is not finite: inf"),
        (["W"], [[0.0] * 4, [0.0] * 4], "axle forces must rise with slip"),
        (["covariance", 0], 3, "covariance must be a number, it is a list"),
        (["excitation", 0, 0], 1e308, "excitation must hold numbers below"),
        (["ladder"], {}, "ladder must be a number"),
        (["tells_v_y"], "yes", "tells_v_y must be true or false"),
    ],
)
def test_hostile_weights_are_refused_by_their_key(capsys, tmp_path, weights, keys, value, said):
    data = json.loads(json.dumps(weights))
    place = data
    for key in keys[:-1]:
        place = place[key]
    place[keys[-1]] = value
    path = tmp_path / "weights.json"
    path.write_text(json.dumps(data))
    refused(capsys, ["export", "--out", tmp_path / "out", "--weights", path], said)
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("text", ["[" * 100_000, '{"format": ' + NINES + "}", "", "nul", "3"])
def test_weights_that_are_no_model_are_refused(capsys, tmp_path, text):
    path = tmp_path / "weights.json"
    path.write_text(text)
    refused(capsys, ["export", "--out", tmp_path / "out", "--weights", path], f"{path}: ")


def log(path, column, value, *, rows=300):
    """A log of a car that goes straight on, one column of which has another value throughout."""
    names = HEADER.split(",")
    lines = [HEADER]
    for k in range(rows):
        cells = [f"{0.01 * k:.2f}", "20", "0", "0", "0", "0", "0"]
        if column is not None:
            cells[names.index(column)] = value
        lines.append(",".join(cells))
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.parametrize(
    ("column", "value", "said"),
    [
        ("r", "-1e308", "r must be of a car, within +-10000, line 2 has -1e+308"),
        ("vy", "-1e308", "vy must be of a car"),
        ("delta_f", "1e300", "delta_f must be of a car"),
        ("Fyf", "1e30", "Fyf must be of a car, within +-1e+07, line 2 has 1e+30"),
        ("t", "1e308", "t must increase"),
        ("r", "1_0", "r must be numeric, line 2 has '1_0'"),
        ("r", "9" * 4000, "r must be finite"),
    ],
)
@pytest.mark.parametrize("unchecked", [[], ["--no-check"]])
def test_numbers_of_no_car_never_reach_linear_algebra(
    capsys, tmp_path, out, column, value, said, unchecked
):
    path = log(tmp_path / "log.csv", column, value)
    sedan().to_toml(tmp_path / "car.toml")
    words = [*learn_words(tmp_path, path), "--out", out]
    refused(capsys, [*words, *unchecked], said)
    assert not out.exists()


def test_a_gzip_bomb_and_too_many_rows_are_refused(capsys, tmp_path, monkeypatch):
    sedan().to_toml(tmp_path / "car.toml")
    rest = ["--vehicle", tmp_path / "car.toml", "--out", tmp_path / "out"]
    path = tmp_path / "bomb.csv.gz"
    with gzip.open(path, "wb") as file:
        file.write(f"{HEADER}\n".encode())
        for _ in range(9):
            file.write(b"0,0,0,0,0,0,0\n" * 70_000)
    assert path.stat().st_size < 20_000
    monkeypatch.setenv("TIREID_LIMITS", "megabytes=5")
    refused(capsys, ["identify", path, *rest], "megabytes must be at most 5, here are")
    monkeypatch.setenv("TIREID_LIMITS", "samples=250")
    path = log(tmp_path / "log.csv", None, "")
    refused(capsys, ["identify", path, *rest], "rows must be at most 250, here are 300")
    with pytest.raises(RecordingError, match=r"steps of 0\.001 s must be at most 250"):
        read_recording(log(tmp_path / "log.csv", None, "", rows=200), dt=0.001)


def test_a_log_without_end_is_refused(capsys, tmp_path):
    sedan().to_toml(tmp_path / "car.toml")
    (tmp_path / "log.csv").symlink_to("/dev/zero")
    words = learn_words(tmp_path, "log.csv")
    refused(capsys, [*words, "--out", tmp_path / "out"], "a device, pipe or socket")
    refused(capsys, ["check", "--design", "/dev/zero"], "a device, pipe or socket")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["check", "--paper", "--speed", "1e300"], "v_x must lie between"),
        (["check", "--paper", "--bandwidth", "1e300"], "bandwidth must lie between"),
        (["check", "--paper", "--bandwidth", "1e-300"], "bandwidth must lie between"),
        (["check", "--paper", "--friction", "nan"], "--friction must be positive"),
        (["check", "--paper", "--noise-r", "1e308"], "noise_r must lie between"),
        (["paper", "--seeds", "10000000000"], "--seeds: runs must be at most 100000"),
    ],
)
def test_numbers_of_the_command_line_are_bounded(capsys, tmp_path, words, said):
    out = [] if words[0] == "check" else ["--out", tmp_path / "out"]
    refused(capsys, [*words, *out], said)
    assert list(tmp_path.iterdir()) == []


def test_a_limit_that_is_raised_lets_the_file_in(tmp_path, monkeypatch):
    text = design_text(replace(PaperIdentifier.for_vehicle(sedan()), network=Network(hidden=128)))
    path = tmp_path / "design.toml"
    path.write_text(changed(text, "hidden", "129"))
    assert typed("check", "--design", path) == 2
    monkeypatch.setenv("TIREID_LIMITS", "hidden=129")
    assert typed("check", "--design", path) in (0, 1)


@pytest.mark.parametrize(
    "marker",
    [
        "[" * 100_000,
        NINES,
        '{"format": "tireid output 1", "files": {"a": [1e999, "b"]}, "folders": []}',
        '{"format": "tireid output 1", "files": {"a": 1}, "folders": []}',
        '{"format": "tireid output 1", "files": [], "folders": {}}',
        '{"format": "tireid output 1", "files": {}, "folders": 3}',
    ],
)
def test_a_hostile_marker_makes_a_folder_foreign(out, marker):
    target = out
    target.mkdir()
    (target / MARKER).write_text(marker)
    with (
        pytest.raises(OutputError, match="which no run of tireid wrote there"),
        output_folder(target, force=True),
    ):
        pass
    assert (target / MARKER).read_text() == marker


@pytest.mark.parametrize("redirection", [">&-", ">/dev/full", "| true", ">&- 2>&- <&-"])
def test_a_closed_standard_output_is_no_traceback(redirection):
    command = f"{sys.executable} -m tireid.cli --help {redirection}"
    ran = subprocess.run(["bash", "-c", command], capture_output=True, text=True)
    assert ran.returncode == (74 if "full" in redirection else 0)
    assert "Traceback" not in ran.stderr
