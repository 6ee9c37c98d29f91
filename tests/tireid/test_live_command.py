"""`tireid live` and `tireid sample --udp`: what a person types, and what comes of it."""

import json
import math
import os
import re
import signal
import socket
import struct
import subprocess
import sys
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path

import pytest

import tireid as ti
from models.recordings import LogMap, write_recording
from tests.tireid.conftest import refusal, typed
from tireid.commands import live as command
from tireid.commands import sample as sending
from tireid.live.live import Live
from tireid.live.samples import Packets, Sample
from tireid.live.sources import Source
from tireid.live.state import Counts, State

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    """A folder with ten seconds of the sample drive, log.csv, and its car.toml."""
    folder = tmp_path_factory.mktemp("live")
    write_recording(ti.sample_recording().between(0.0, 10.0), folder / "log.csv")
    ti.sedan().to_toml(folder / "car.toml")
    return folder


def words(folder, *more, source=None):
    return ["live", source or folder / "log.csv", "--vehicle", folder / "car.toml", *more]


def test_a_log_is_replayed_to_its_end_and_the_last_line_says_what_is_known(drive, capsys):
    assert typed(*words(drive, "--speed", "inf")) == 0
    said = capsys.readouterr()
    assert re.search(r"t = [\d.]+ s, (valid|not valid: .*); stiffness .* kN/rad", said.err)
    known = re.fullmatch(
        r"1001 samples; .*stiffness (.+) ± (.+) / (.+) ± (.+) kN/rad.*\n", said.out
    )
    front, front_sd, rear, rear_sd = map(float, known.groups())
    car = ti.sedan()
    assert front == pytest.approx(1e-3 * car.cornering_stiffness_front, rel=0.3)
    assert rear == pytest.approx(1e-3 * car.cornering_stiffness_rear, rel=0.3)
    assert 0.0 < front_sd < front and 0.0 < rear_sd < rear


def test_a_clock_since_1970_is_printed_since_the_first_sample(drive, tmp_path, capsys):
    log = ti.sample_recording().between(0.0, 2.0)
    write_recording(replace(log, t=log.t + 1.7e9), tmp_path / "log.csv")
    assert typed(*words(drive, "--speed", "inf", source=tmp_path / "log.csv")) == 0
    said = capsys.readouterr()
    assert "2 s as fast as possible" in said.err
    assert re.match(r"201 samples; t = 1\.\d s, ", said.out)


def test_what_is_recorded_is_every_state_of_the_drive(drive, tmp_path, capsys):
    reader = pytest.importorskip("mcap.reader", reason="needs the package mcap")
    file = tmp_path / "drive.mcap"
    assert typed(*words(drive, "--speed", "inf", "--record", file)) == 0
    with file.open("rb") as stream:
        messages = [m for _, _, m in reader.make_reader(stream).iter_messages()]
    states = [json.loads(message.data) for message in messages]
    assert set(states[0]) == set(State.schema()["properties"])
    assert all(0.15 < b["t"] - a["t"] < 0.25 for a, b in pairwise(states))
    assert states[-1]["t"] > 9.7 and states[-1]["counts"]["samples"] > 970
    assert "drive.mcap: name a new file, one that ends in .mcap" in refusal(
        capsys, words(drive, "--record", file)
    )


def test_the_next_drive_goes_on_from_the_store(drive, tmp_path, capsys):
    first_lines = []
    for _ in range(2):
        assert typed(*words(drive, "--speed", "inf", "--store", tmp_path / "store")) == 0
        first_lines += re.findall(r"stiffness .+ ± (.+) / .+ ± (.+) kN", capsys.readouterr().err)[
            :1
        ]
    fresh, resumed = (list(map(float, both)) for both in first_lines)
    assert all(after < 0.2 * before for before, after in zip(fresh, resumed, strict=True))
    assert ti.sedan().moves_as(ti.TireModel.load(tmp_path / "store" / "tires.json").vehicle)


@pytest.mark.parametrize(
    ("source", "more", "line"),
    [
        ("nowhere.csv", [], "nowhere.csv"),
        ("tcp://:9000", [], "tcp://:9000"),
        ("udp://:many", [], "many"),
        (None, ["--speed", "0"], "--speed must be positive, it is 0"),
        (None, ["--speed", "nan"], "--speed must be positive, it is nan"),
        (None, ["--serve", "here"], "--serve wants HOST:PORT, a port of 0 to 65535, not 'here'"),
        (None, ["--serve", "127.0.0.1:99999"], "--serve wants HOST:PORT"),
        (None, ["--record", "states.csv"], "one that ends in .mcap"),
        (None, ["--weights", "none.json"], "none.json"),
    ],
)
def test_what_cannot_be_done_is_one_line(drive, capsys, monkeypatch, source, more, line):
    monkeypatch.chdir(drive)
    assert line in refusal(capsys, words(drive, *more, source=source))


@pytest.mark.parametrize(
    ("source", "more", "module"),
    [
        (None, ["--record", "new.mcap"], "foxglove"),
        (None, ["--serve", "127.0.0.1:0"], "foxglove"),
        ("can:virtual", ["--dbc", "car.dbc"], "can"),
        ("zenoh:car", [], "zenoh"),
    ],
)
def test_without_the_extra_one_line_says_what_to_install(
    drive, capsys, monkeypatch, source, more, module
):
    monkeypatch.chdir(drive)
    (drive / "car.dbc").write_text('VERSION ""\n\nBU_: Car\n')
    for name in (module, module.split(".")[0]):
        monkeypatch.setitem(sys.modules, name, None)
    line = refusal(capsys, words(drive, *more, source=source))
    assert "pip install '.[live]'" in line or "pip install '.[can]'" in line
    assert not (drive / "new.mcap").exists()


def started(*given):
    line = [sys.executable, "-m", "tireid", *map(str, given)]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    # A test in the background of a shell would hand on that SIGINT is ignored.
    interruptible = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    return subprocess.Popen(line, cwd=ROOT, preexec_fn=interruptible, **pipes)


def until(text, process):
    """Read what a process says up to a line with a text."""
    said = []
    for line in process.stderr:
        said.append(line)
        if text in line:
            return
    pytest.fail(f"no {text!r} in {''.join(said)!r}")


@pytest.mark.parametrize("first", [0, 30])
def test_times_that_stand_still_are_said_again_and_states_grow_old(
    first, capsys, monkeypatch, tmp_path
):
    now, sent = iter(range(10**6)), []
    monkeypatch.setattr(command.time, "monotonic", lambda: 0.05 * next(now))
    times = [0.01 * min(k, first) for k in range(2000)]
    steps = (Sample(t, 20.0, 0.0, 0.0, math.nan, 0.0) for t in times)
    outputs = type("", (), {"send": staticmethod(sent.append)})
    live = Live(ti.sedan())
    command._follow(live, Source("", steps, lambda: True), outputs, None)
    said = capsys.readouterr().err
    assert said.count("doubled") >= 3
    assert ("nothing is known yet: 1" in said) != bool(first)
    if first:
        assert sent[-1].age > 20.0 and "nothing came" in sent[-1].reason


@pytest.mark.skipif(os.name == "nt", reason="sends signals of POSIX")
def test_a_termination_ends_it_with_a_file_that_is_whole(drive, tmp_path):
    reader = pytest.importorskip("mcap.reader", reason="needs the package mcap")
    with started(*words(drive, "--record", tmp_path / "drive.mcap")) as process:
        until("t = ", process)
        process.send_signal(signal.SIGTERM)
        out, err = process.communicate(timeout=60)
    assert process.returncode == 0, err
    assert re.match(r"\d+ samples; t = ", out)
    with (tmp_path / "drive.mcap").open("rb") as file:
        assert reader.make_reader(file).get_summary().statistics.message_count >= 1


def test_a_second_interrupt_cuts_no_end_short(drive, capsys, monkeypatch, tmp_path):
    class Ending(command.Outputs):
        def __exit__(self, *why):
            signal.raise_signal(signal.SIGINT)
            return super().__exit__(*why)

    monkeypatch.setattr(command, "Outputs", Ending)
    assert typed(*words(drive, "--speed", "inf", "--store", tmp_path)) == 0
    assert "1001 samples" in capsys.readouterr().out and (tmp_path / "tires.json").exists()


def test_the_sample_drive_is_sent_in_its_own_time_and_again(monkeypatch, capsys, tmp_path):
    short = ti.sample_recording().between(0.0, 0.1)
    monkeypatch.setattr(sending, "sample_recording", lambda vehicle, seed: short)
    monkeypatch.setattr(sending, "_PAUSE", 0.1)
    slept = []

    def sleep(seconds):
        slept.append(seconds)
        if len(slept) > 24:
            raise KeyboardInterrupt

    monkeypatch.setattr(sending.time, "sleep", sleep)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as here:
        here.bind(("127.0.0.1", 0))
        here.settimeout(10.0)
        port = here.getsockname()[1]
        given = ["sample", "--udp", f"127.0.0.1:{port}", "--car", tmp_path / "car.toml"]
        assert typed(*given) == 0
        packets = [json.loads(here.recv(4096)) for _ in range(24)]
    command = f"tireid live udp://:{port} --vehicle {tmp_path / 'car.toml'} --serve 127.0.0.1:8765"
    assert command in capsys.readouterr().err
    assert ti.Vehicle.from_toml(tmp_path / "car.toml") == ti.sedan()
    assert set(packets[0]) == {"t", "vx", "vy", "r", "delta_f", "ay"}
    assert [one["vy"] for one in packets[11:22]] == [one["vy"] for one in packets[:11]]
    times = [one["t"] for one in packets]
    assert times[:11] == pytest.approx([0.01 * k for k in range(11)])
    assert times[11] == pytest.approx(0.2) and all(a < b for a, b in pairwise(times))
    assert all(wait <= t for wait, t in zip(slept, times, strict=False))  # no packet early


@pytest.mark.parametrize(
    ("more", "line"),
    [
        ([], "give either LOG"),
        (["log.csv", "--udp", "127.0.0.1:9000"], "give either LOG"),
        (["--udp", "127.0.0.1"], "--udp wants HOST:PORT"),
        (["--udp", "127.0.0.1:-1"], "--udp wants HOST:PORT"),
        (["--udp", "a b:9"], "--udp a b:9: nothing can be sent there"),
    ],
)
def test_a_drive_is_either_written_or_sent(more, line, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert line in refusal(capsys, ["sample", *more])
    assert not (tmp_path / "log.csv").exists()


@pytest.mark.skipif(os.name == "nt", reason="sends signals of POSIX")
def test_what_sample_sends_in_one_terminal_live_reads_in_another(drive):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with started("sample", "--udp", f"127.0.0.1:{port}") as sender:
        with started(*words(drive, source=f"udp://127.0.0.1:{port}")) as process:
            until("t = ", process)
            process.send_signal(signal.SIGINT)
            out, err = process.communicate(timeout=60)
        sender.send_signal(signal.SIGINT)
        assert sender.wait(60) == 0
    assert process.returncode == 0, err
    assert re.match(r"\d+ samples; t = ", out)


def test_every_log_toml_on_the_page_reads_what_the_page_says(tmp_path):
    page = (ROOT / "docs" / "live.md").read_text(encoding="utf-8")
    named, packed, bus = re.findall(r"^```toml\n(.*?)^```$", page, re.M | re.S)
    (plain,) = re.findall(r'^\{"t": .*\}$', page, re.M)
    sent = {"stamp": 1500, "twist": {"vx": 20.0, "vy": -0.1}, "gyro_z": 9.0, "hand_wheel": 14.6}
    counts = Counts()
    for text, packet in (
        ("", plain.encode()),
        (named, json.dumps(sent).encode()),
        (packed, struct.pack("<d5f", 1.5, 20.0, -0.125, 0.25, 0.0625, 6.25)),
    ):
        (tmp_path / "log.toml").write_text(text)
        reader = Packets("udp", LogMap.from_toml(tmp_path / "log.toml"), counts)
        ((t, v_x, r, delta_f, a_y, v_y),) = reader.take(packet)
        assert t in (12.34, 1.5) and 19.0 < v_x < 21.0 and -0.2 < v_y < 0.0, text
        assert 0.1 < r < 0.4 and 0.01 < delta_f < 0.1 and (text == named or a_y > 6.0), text
    assert counts.unreadable == 0
    (tmp_path / "log.toml").write_text(bus)
    signals = LogMap.from_toml(tmp_path / "log.toml").signals
    assert signals["delta_f"].ratio == 14.6 and len(signals) == 4


def test_the_schema_on_the_page_is_that_of_a_state():
    page = (ROOT / "docs" / "live.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"^```json\n(.*?)^```$", page, re.M | re.S)[-1:]
    assert json.loads(block) == State.schema()
