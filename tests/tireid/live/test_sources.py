"""Live sources: the samples of a file of the same numbers; bad input is counted."""

import csv
import json
import math
import re
import socket
import struct
import sys
import threading
import time
from dataclasses import replace

import numpy as np
import pytest

from models.logs.log import RecordingError
from models.logs.signals import Signal
from models.recordings import read_recording, read_repaired
from models.recordings.map import LogMap
from models.recordings.repair import Repair
from models.vehicle import sedan
from tireid.live.samples import Frames, Packets, Sample
from tireid.live.sources import FORMS, open_source
from tireid.live.state import Counts

RNG = np.random.default_rng(52)
N = 130
NAMES = ("ms", "speed", "beta", "imu.r", "fl", "fr", "ay")
ROWS = [
    [10 * k, 60.0 + value, *others]
    for k, (value, *others) in enumerate(RNG.normal(0.0, 3.0, (N, 6)).tolist())
]
MAP = LogMap(
    axes="SAE",
    clock="ms",
    clock_unit="ms",
    signals={
        "v_x": Signal(channel=("speed",), unit="km/h", factor=1.01),
        "beta": Signal(channel=("beta",), unit="deg"),
        "r": Signal(channel=("imu.r",), unit="deg/s", offset=0.004),
        "delta_f": Signal(
            channel=("fl", "fr"), unit="deg", table=((-1.0, -0.07), (0.0, 0.0), (1.0, 0.06))
        ),
        "a_y": Signal(channel=("ay",), factor=-1.0),
    },
    repair=Repair(
        factor={"r": 1.02, "v_y": 0.9},
        offset={"a_y": 0.1, "v_y": 0.01},
        velocity_sensor_x=0.7,
        velocity_sensor_angle=0.02,
    ),
)
PLAIN = {"t": 0.0, "vx": 20.0, "vy": 0.1, "r": 0.2, "delta_f": 0.03, "ay": 4.0}


def opened(text, log_map=None, counts=None, **more):
    return open_source(text, log_map or LogMap(), counts or Counts(), vehicle=sedan(), **more)


def first(source, count):
    """Return so many samples, and fail after 20 s."""
    found, end = [], time.monotonic() + 20.0
    for sample in source:
        found += [sample] if sample is not None else []
        if len(found) >= count:
            return found
        assert time.monotonic() < end, f"{len(found)} of {count} samples came"
    return found


def address_of(source):
    host, port = re.search(r"UDP at (\S+):(\d+)", source.words).groups()
    return host, int(port)


def sent(packets, log_map=None, counts=None):
    """Return the samples of packets that are sent by UDP, one when the one before was read."""
    found = []
    with (
        opened("udp://:0", log_map, counts) as source,
        socket.socket(type=socket.SOCK_DGRAM) as out,
    ):
        for packet in packets:
            out.sendto(packet, address_of(source))
            found += first(source, 1)
        assert source.v_y is not None
    return found


def assert_same(samples, recording):
    """The very numbers of a recording; NaN where it has none."""
    assert len(samples) >= 100
    for name in Sample._fields:
        logged = getattr(recording, name)
        ours = np.array([getattr(one, name) for one in samples])
        there = np.full(len(samples), math.nan) if logged is None else logged[: len(samples)]
        assert np.array_equal(ours, there, equal_nan=True), name


def as_json(row):
    values = dict(zip(NAMES, row, strict=True))
    imu = {"r": values.pop("imu.r"), "frame": "base"}
    return json.dumps(values | {"imu": imu}).encode()


@pytest.mark.parametrize("packed", [False, True])
def test_packets_give_the_numbers_of_a_csv(packed, tmp_path):
    log = tmp_path / "log.csv"
    with log.open("w", newline="") as file:
        csv.writer(file).writerows([NAMES, *ROWS])
    expected, _ = read_repaired(log, sedan(), log_map=MAP, check=False)
    log_map = replace(MAP, packet="<7d", fields=NAMES) if packed else MAP
    packets = [struct.pack("<7d", *row) if packed else as_json(row) for row in ROWS]
    assert_same(sent(packets, log_map), expected)


def test_standard_names_need_no_map_and_arrival_is_the_time_without_a_clock():
    (sample,) = sent([json.dumps(PLAIN).encode()])
    assert sample == Sample(0.0, 20.0, 0.2, 0.03, 4.0, 0.1)
    timeless = {name: one for name, one in PLAIN.items() if name not in ("t", "vy")}
    one, two = sent([json.dumps(timeless).encode()] * 2)
    assert 0.0 <= one.t < two.t < 20.0 and math.isnan(two.v_y)


def test_packets_without_a_signal_do_not_say_what_the_others_have():
    counts = Counts()
    reader = Packets("udp", LogMap(), counts)
    parts = {"hello": 1}, {"t": 0.0, "r": 0.2, "ay": 4.0}, PLAIN
    samples = [one for part in parts for one in reader.take(json.dumps(part).encode())]
    assert counts.unreadable == 1 and len(samples) == 2 and reader.v_y is True
    alone, plain = Packets("udp", LogMap(), counts), {**PLAIN, "v": PLAIN["vy"]}
    del plain["vy"]
    list(alone.take(json.dumps(plain).encode()))
    assert alone.v_y is False


@pytest.mark.parametrize("packed", [False, True])
def test_a_packet_that_cannot_be_read_is_counted_and_the_next_one_is_read(packed):
    log_map = LogMap(packet="<6f", fields=tuple(PLAIN)) if packed else LogMap()
    good = struct.pack("<6f", *PLAIN.values()) if packed else json.dumps(PLAIN).encode()
    bad = [
        b"", b"{", b"\xff\xfe\x00", b"[1, 2]", b"3", b"null", good[:-1], good + b"}", b"[" * 50_000,
        b'{"vx": "20"}', b'{"vx": true}', b'{"vx": {}}', b'{"vx": 1' + b"0" * 400 + b"}",
        b"9" * 5000, good.ljust(70_000),
    ]  # fmt: skip
    counts = Counts()
    packets = Packets("udp://:0", log_map, counts)
    for k, one in enumerate(bad, start=1):
        assert not list(packets.take(one)) and counts.unreadable == k
    (sample,) = packets.take(good)
    assert sample.v_x == 20.0


def test_a_name_that_is_missing_once_is_nan_and_one_that_never_comes_ends_the_source():
    packets = Packets("udp://:0", LogMap(), Counts())
    for _ in range(60):
        (sample,) = packets.take(json.dumps(PLAIN).encode())
    (sample,) = packets.take(b'{"t": 1, "vx": null, "r": NaN}')
    assert sample.t == 1.0 and all(map(math.isnan, sample[1:]))
    lacking = json.dumps({"t": 0.0, "vx": 1.0, "vy": 0.0, "imu": {"wz": 1.0}}).encode()
    packets = Packets("udp://:9", LogMap(), Counts())
    with pytest.raises(RecordingError, match=r"udp://:9: no packet has delta_f, r; .*imu, t"):
        for _ in range(50):
            list(packets.take(lacking))
    with pytest.raises(RecordingError, match="no packet has r; they have"):
        Packets("udp://:9", LogMap(packet="<3d", fields=("vx", "vy", "delta_f")), Counts())


@pytest.mark.parametrize(
    ("declared", "key"),
    [
        (LogMap(low_pass=10.0), "filters.low_pass"),
        (LogMap(run="2"), "file.run"),
        (LogMap(rate=100.0), "clock.rate"),
        (LogMap(clock="t", clock_unit="m"), "clock.unit"),
        (LogMap(repair=Repair(lag={"r": 0.1})), "repair.lag"),
        (LogMap(repair=Repair(acceleration_sensor_x=0.1)), "repair.acceleration_sensor_x"),
        (LogMap(signals={"delta_r": Signal(channel=("w",))}), "signals.delta_r"),
        (LogMap(signals={"wheel_rl": Signal(channel=("w",))}), "signals.wheel_rl"),
        (LogMap(signals={"r": Signal(channel=("w",), sign="s")}), "signals.r.sign"),
    ],
)
def test_what_only_a_whole_log_allows_is_refused_by_name(declared, key):
    with pytest.raises(RecordingError, match=re.escape(key)):
        opened("udp://:0", declared)


@pytest.mark.parametrize(
    ("text", "rule"),
    [
        ("log_that_is_not.csv", re.escape(FORMS)),
        ("udp://:", "PORT"),
        ("udp://:70000", "PORT"),
        ("udp:9000", "PORT"),
        ("udp://no.such.host.invalid:9000", "cannot be opened"),
    ],
)
def test_a_source_that_is_none_is_refused_in_one_line(text, rule):
    with pytest.raises(RecordingError, match=rule) as refused:
        opened(text)
    assert "\n" not in str(refused.value)


def test_a_port_in_use_is_refused_and_silence_gives_none_until_it_is_closed():
    with opened("udp://:0") as source:
        port = address_of(source)[1]
        with pytest.raises(RecordingError, match=f"port {port} of 127.0.0.1 cannot be opened"):
            opened(f"udp://:{port}")
        assert next(iter(source)) is None
        closing = threading.Timer(0.3, source.close)
        closing.start()
        assert set(source) <= {None}  # and ends
        closing.join()


def test_without_its_library_a_source_says_what_to_install(monkeypatch):
    for text, module in (("zenoh:car", "zenoh"), ("can:can0", "can")):
        monkeypatch.setitem(sys.modules, module, None)
        with pytest.raises(RecordingError, match=f"{text}.* needs {module}: pip install "):
            opened(text)


def test_a_log_is_replayed_in_its_time_and_its_gaps_stay(tmp_path):
    t = np.concatenate([0.01 * np.arange(150), 3.0 + 0.01 * np.arange(150)])
    log = tmp_path / "log.csv"
    columns = {"t": t, "vx": 20.0 + np.sin(t), "r": 0.1 * np.sin(t), "delta_f": 0.01 * np.sin(t)}
    columns["ay"] = columns["vx"] * columns["r"]
    rows = np.column_stack(list(columns.values())).tolist()
    with log.open("w", newline="") as file:
        csv.writer(file).writerows([columns, *rows])
    with opened(str(log), speed=math.inf) as source:
        assert source.v_y is False
        assert_same([one for one in source if one is not None], read_recording(log))
    begin = time.monotonic()
    with opened(str(log), speed=10.0) as source:
        assert first(source, 300)[-1].t == t[-1]
    assert time.monotonic() - begin > 0.449


# A bus.

DBC = """VERSION ""

BU_: Car

BO_ 100 Motion: 8 Car
 SG_ Speed : 0|16@1+ (0.01,0) [0|655] "km/h" Car
 SG_ Yaw : 23|16@0- (0.0005,0.01) [0|0] "rad/s" Car
 SG_ Lateral : 32|32@1- (1,0) [0|0] "m/s^2" Car

BO_ 2566852862 Wheel: 4 Car
 SG_ Angle : 0|16@1- (0.1,0) [-780|780] "deg" Car

BO_ 200 Muxed: 8 Car
 SG_ Page M : 0|8@1+ (1,0) [0|0] "" Car
 SG_ Side m1 : 8|16@1- (0.001,0.5) [0|0] "m/s" Car

SIG_VALTYPE_ 100 Lateral : 1;
"""


def bus_map(folder, dbc=DBC):
    path = folder / "car.dbc"
    path.write_text(dbc)
    signals = {
        "v_x": "Motion.Speed", "v_y": "Muxed.Side", "r": "Motion.Yaw", "delta_f": "Wheel.Angle",
        "a_y": "Motion.Lateral",
    }  # fmt: skip
    found = {name: Signal(channel=(one,)) for name, one in signals.items()}
    found["delta_f"] = replace(found["delta_f"], ratio=14.6, offset=0.01)
    return LogMap(axes="SAE", dbc=str(path), signals=found)


def messages(can, steering):
    """Frames of the car at 100 Hz, of one instant each; the steering some time after, at a rate."""
    begin, found = 1_700_000_000.25, []

    def add(t, identifier, data):
        stamp = float(f"{t:.6f}")  # as candump writes it
        extended = identifier > 0x7FF
        found.append(can.Message(stamp, identifier, extended, data=data, channel="test"))

    for k in range(160):
        t = begin + 0.01 * k
        speed, yaw, side = (int(one) for one in RNG.integers(-900, 900, 3))
        lateral = struct.pack("<f", 0.01 * yaw)
        add(t, 100, struct.pack("<H", 8000 + speed) + struct.pack(">h", yaw) + lateral)
        for page in (0, 1):
            add(t, 200, struct.pack("<Bh5x", page, side))
        add(t, 300, b"\1\2")
    late = 0.003 if steering < 100 else 0.0
    for k in range(int(1.6 * steering)):
        angle = int(RNG.integers(-900, 900))
        # Of J1939, from 0x23; the DBC has 0xFE, which stands for any.
        add(begin + late + k / steering, 0x18FF1023, struct.pack("<hh", angle, 0))
    return sorted(found, key=lambda one: one.timestamp)


@pytest.mark.parametrize("steering", [100, 50, 500])
def test_a_bus_gives_the_numbers_of_its_candump(steering, tmp_path):
    can = pytest.importorskip("can")
    pytest.importorskip("cantools")
    dbc = DBC if steering == 100 else DBC.replace("2566852862", str(0x98FF1023))  # from one alone
    log_map, counts, frames = bus_map(tmp_path, dbc), Counts(), messages(can, steering)
    with can.Logger(str(tmp_path / "bus.log")) as log:
        for one in frames:
            log.on_message_received(one)
    expected = read_recording(tmp_path / "bus.log", log_map=log_map, check=False)
    with (
        opened(f"can:virtual:{tmp_path}", log_map, counts) as source,
        can.Bus(interface="virtual", channel=str(tmp_path), preserve_timestamps=True) as bus,
    ):
        assert source.v_y
        bus.send(can.Message(frames[0].timestamp, 100, False, data=b"\1\2"))  # too short
        bus.send(can.Message(frames[0].timestamp, 100, False, is_remote_frame=True, dlc=8))
        for one in frames:
            bus.send(one)
        samples = first(source, 150)
    assert counts.unreadable == 1
    if steering > 100:  # its mean, of sums that begin elsewhere
        angles = [one.delta_f for one in samples]
        np.testing.assert_allclose(angles, expected.delta_f[:150], rtol=0.0, atol=1e-12)
        samples = [
            one._replace(delta_f=value)
            for one, value in zip(samples, expected.delta_f, strict=False)
        ]
    assert_same(samples, expected)


def test_a_bus_whose_clock_jumps_back_or_whose_signal_pauses_goes_on(tmp_path):
    can = pytest.importorskip("can")
    pytest.importorskip("cantools")
    log_map, frames = bus_map(tmp_path), messages(can, 100)
    joined = Frames("can:a", log_map, Counts())

    def taken(some, by):
        return [sample for one in some for sample in by.take(one)]

    taken(messages(can, 100), joined)
    again = taken(frames, joined)  # other values, 1.6 s earlier
    assert again[-158:] == taken(frames, Frames("can:a", log_map, Counts()))[-158:]
    timeless = can.Message(math.inf, 100, False, data=bytes(8))
    assert not taken([timeless], joined)
    without = [one for one in frames if one.arbitration_id != 0x18FF1023]
    for one in without:
        one.timestamp += 1.6
    paused = [math.isnan(one.delta_f) for one in taken(without, joined)]
    assert not any(paused[:9]) and all(paused[12:]) and len(paused) > 150


def test_a_dbc_without_the_signal_and_an_interface_that_is_none_are_refused(tmp_path):
    pytest.importorskip("can")
    pytest.importorskip("cantools")
    log_map = bus_map(tmp_path)
    other = log_map.with_signals({"r": Signal(channel=("Motion.Yow",))})
    with pytest.raises(RecordingError, match=r"no channel 'Motion\.Yow'; did you mean 'Motion\.Y"):
        opened("can:virtual:a", other)
    with pytest.raises(RecordingError, match=r"file\.dbc of log\.toml must be declared"):
        opened("can:virtual:a", replace(log_map, dbc=""))
    with pytest.raises(RecordingError, match=r"v_y \(or a_y\), signals\.r, .*delta_f of"):
        opened("can:virtual:a", replace(log_map, signals={"v_x": log_map.signals["v_x"]}))
    with pytest.raises(RecordingError, match="can:nothing:a: cannot be opened"):
        opened("can:nothing:a", log_map)


def test_a_signal_that_does_not_come_on_the_bus_is_named(tmp_path):
    can = pytest.importorskip("can")
    pytest.importorskip("cantools")
    with (
        opened(f"can:virtual:{tmp_path}", bus_map(tmp_path)) as source,
        can.Bus(interface="virtual", channel=str(tmp_path), preserve_timestamps=True) as bus,
    ):
        for k in range(60):
            bus.send(can.Message(0.1 * k, 100, False, data=bytes(8)))
        with pytest.raises(RecordingError, match=r"no Muxed\.Side, Wheel\.Angle; is it another"):
            first(source, 1)


def test_zenoh_gives_the_packets_that_are_put(zenoh_peer):
    counts = Counts()
    with pytest.raises(RecordingError, match="cannot be opened"):
        opened("zenoh:/not a key//")
    with (
        opened("zenoh:car/state", counts=counts) as source,
        zenoh_peer() as session,
    ):
        found, end = [], time.monotonic() + 20.0
        while not found and time.monotonic() < end:  # until both know of one another
            for payload in (b"no JSON", b" " * 70_000, json.dumps(PLAIN).encode()):
                session.put("car/state", payload)
            found = [one for _, one in zip(range(3), source, strict=False) if one]
    assert found[0] == Sample(0.0, 20.0, 0.2, 0.03, 4.0, 0.1) and counts.unreadable >= 2
