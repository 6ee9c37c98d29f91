"""A drive over UDP, zenoh and a bus identifies the very tires of its log."""

import json
import re
import socket
import struct
import time

import numpy as np
import pytest

import tireid as ti
from models.logs.signals import Signal
from models.recordings import write_recording
from models.recordings.map import LogMap
from tireid.live.live import Live
from tireid.live.sources import open_source

N = 1200  # samples, of which tires are identified
DBC = """VERSION ""

BU_: Car

BO_ 100 Motion: 8 Car
 SG_ Speed : 0|32@1- (1,0) [0|0] "m/s" Car
 SG_ Side : 32|32@1- (1,0) [0|0] "m/s" Car

BO_ 200 Turn: 8 Car
 SG_ Yaw : 0|32@1- (1,0) [0|0] "rad/s" Car
 SG_ Angle : 32|32@1- (1,0) [0|0] "rad" Car

SIG_VALTYPE_ 100 Speed : 1;
SIG_VALTYPE_ 100 Side : 1;
SIG_VALTYPE_ 200 Yaw : 1;
SIG_VALTYPE_ 200 Angle : 1;
"""
CHANNELS = {
    "v_x": "Motion.Speed", "v_y": "Motion.Side", "r": "Turn.Yaw", "delta_f": "Turn.Angle"
}  # fmt: skip


@pytest.fixture(scope="module")
def drive():
    return ti.sample_recording(seed=4).taken(slice(0, N))


def identified(source, live, count=N):
    """Feed the samples of a source until so many were fed."""
    end = time.monotonic() + 60.0
    for sample in source:
        if sample is not None:
            live.feed(*sample[:5], v_y=sample.v_y if source.v_y else None)
            count -= 1
        if not count:
            return live.identifier.model()
        assert time.monotonic() < end, f"{count} samples did not come"
    return None


def assert_same_tires(found, path, log_map=None):
    log = ti.read_recording(path, log_map=log_map).taken(slice(0, N - 1))
    offline = ti.identify(log, ti.sedan(), method="axle").freeze()
    for name in ("W", "compliance", "offset", "covariance"):
        np.testing.assert_array_equal(getattr(found, name), getattr(offline, name), name)


def packets(drive):
    names = {"t": "t", "vx": "v_x", "vy": "v_y", "r": "r", "delta_f": "delta_f", "ay": "a_y"}
    rows = np.column_stack([getattr(drive, name) for name in names.values()]).tolist()
    return [json.dumps(dict(zip(names, row, strict=True))).encode() for row in rows]


def carried(carrier, packets, request, live):
    """Return the tires that are identified of packets."""
    if carrier == "udp":
        with (
            open_source("udp://:0", LogMap(), live.counts, vehicle=ti.sedan()) as source,
            socket.socket(type=socket.SOCK_DGRAM) as out,
        ):
            port = int(re.search(r":(\d+)", source.words)[1])
            for first in range(0, N, 100):  # no more than a buffer has room for
                for one in packets[first : first + 100]:
                    out.sendto(one, ("127.0.0.1", port))
                found = identified(source, live, min(100, N - 1 - first))
            return found
    peer = request.getfixturevalue("zenoh_peer")
    with (
        open_source("zenoh:car", LogMap(), live.counts, vehicle=ti.sedan()) as source,
        peer() as session,
    ):
        while not live.counts.unreadable:  # until both know of one another
            session.put("car", b"no sample")
            next(iter(source), None)
        for first in range(0, N, 100):
            for one in packets[first : first + 100]:
                session.put("car", one)
            found = identified(source, live, min(100, N - 1 - first))
        return found


@pytest.mark.parametrize("carrier", ["udp", "zenoh"])
def test_packets_identify_the_tires_of_their_log(carrier, drive, tmp_path, request):
    live = Live(ti.sedan())
    write_recording(drive, tmp_path / "log.csv")
    found = carried(carrier, packets(drive), request, live)
    assert_same_tires(found, tmp_path / "log.csv")
    assert live.counts.lost == live.counts.late == live.counts.refused == 0


def test_a_bus_identifies_the_tires_of_its_candump(drive, tmp_path):
    can = pytest.importorskip("can")
    pytest.importorskip("cantools")
    (tmp_path / "car.dbc").write_text(DBC)
    signals = {name: Signal(channel=(one,)) for name, one in CHANNELS.items()}
    log_map = LogMap(dbc=str(tmp_path / "car.dbc"), signals=signals)
    frames = []
    for t, v_x, v_y, r, delta in zip(
        drive.t.tolist(), drive.v_x, drive.v_y, drive.r, drive.delta_f, strict=True
    ):
        stamp = round(t + 100.0, 6)
        for identifier, pair in ((100, (v_x, v_y)), (200, (r, delta))):
            data = struct.pack("<ff", *pair)
            frames.append(can.Message(stamp, identifier, False, data=data, channel="test"))
    with can.Logger(str(tmp_path / "bus.log")) as log:
        for one in frames:
            log.on_message_received(one)
    live = Live(ti.sedan())
    with (
        open_source(f"can:virtual:{tmp_path}", log_map, live.counts, vehicle=ti.sedan()) as source,
        can.Bus(interface="virtual", channel=str(tmp_path), preserve_timestamps=True) as bus,
    ):
        for one in frames:
            bus.send(one)
        found = identified(source, live, N - 1)
    assert_same_tires(found, tmp_path / "bus.log", log_map)
    assert live.counts.lost == live.counts.refused == 0
