"""Outputs of a live run: clients that read and that do not, the page, a recording, the store."""

import http.client
import json
import re
import resource
import signal
import socket
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from threading import Thread

import numpy as np
import pytest

from identifier.baselines.linear import LinearModel
from identifier.frozen import FrozenModelError
from identifier.tire_model import TireModel
from models.logs.signals import Signal
from models.recordings import LogMap
from models.vehicle import sedan
from tireid.live.outputs import TOPIC, Outputs, Store, scale_of_steering
from tireid.live.state import REACH, SLIPS, Counts, Point, State
from tireid.output import OutputError

SLIP = np.linspace(0.0, REACH, SLIPS)
FREE = ("127.0.0.1", 0)


def made(t, **other):
    """A state at t [s], of two axles of 100 kN/rad that slide at 6 kN."""
    force = np.stack([6e3 * np.tanh(SLIP / 0.06)] * 2)
    both = np.ones(2)
    values = {
        "t": t, "age": 0.01, "valid": True, "reason": "", "origin": "live", "alarm": "",
        "slip": SLIP, "force": force, "force_sd": 0.05 * force, "known_slip": 0.07 * both,
        "stiffness": 1e5 * both, "stiffness_sd": 2e3 * both, "grip": both, "grip_sd": 0.03 * both,
        "understeer": 0.0031, "understeer_sd": np.nan, "a_y_limit": 9.1, "a_y_limit_sd": 0.3,
        "friction": 1.0, "friction_since": 0.0, "side_slip": 0.01, "side_slip_sd": 0.004,
        "steering_zero": -0.006, "steering_zero_sd": 0.0007, "v_y_bias": None, "v_y_bias_sd": None,
        "point": Point(np.array([0.03, -0.02]), np.array([2e3, -1e3])), "counts": Counts(lost=3),
    }  # fmt: skip
    return State(**(values | other))


def address(outputs, scheme):
    return re.search(rf"{scheme}://[^/\s]+", outputs.words)[0]


def subscribed(url):
    """A client of the topic, as Foxglove is one."""
    client = pytest.importorskip("websockets.sync.client", reason="needs websockets")
    link = client.connect(
        url, subprotocols=["foxglove.sdk.v1"], legacy=True, ping_interval=None, max_queue=2
    )
    channel = None
    while channel is None:
        said = json.loads(link.recv(timeout=10))
        channel = next((c for c in said.get("channels", []) if c["topic"] == TOPIC), None)
    link.send(
        json.dumps({"op": "subscribe", "subscriptions": [{"id": 1, "channelId": channel["id"]}]})
    )
    return link, json.loads(channel["schema"])


def received(link, timeout=10.0):
    data = link.recv(timeout=timeout)
    assert data[0] == 1  # a message of the topic
    return json.loads(data[13:])


def resident():
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()


def test_a_client_reads_every_state_while_another_reads_none():
    pytest.importorskip("foxglove")
    words = "x" * 50_000  # 20 MB in all: more than buffers of sockets and of the server hold
    with Outputs(FREE) as outputs:
        (reads, schema), (stuck, _) = (subscribed(address(outputs, "ws")) for _ in range(2))
        stuck.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        while True:  # until it has subscribed
            outputs.send(made(-1.0))
            with suppress(TimeoutError):
                first = received(reads, 0.05)
                break
        assert schema == State.schema() and set(first) == set(schema["required"])
        assert first["point"]["slip"] == [0.03, -0.02] and first["understeer_sd"] is None
        for k in range(400):
            outputs.send(made(float(k), reason=words))
            state = received(reads)
            while state["t"] < 0.0:
                state = received(reads)
            assert state["t"] == k
            if k == 100:
                before = resident()
        assert resident() - before < 8e6
        ending = Thread(target=outputs.close, daemon=True)
        ending.start()
        ending.join(10.0)
        assert not ending.is_alive()
    stuck.socket.shutdown(socket.SHUT_RDWR)


def ask(port, method, path):
    link = http.client.HTTPConnection("127.0.0.1", port, timeout=10)
    link.request(method, path)
    answer = link.getresponse()
    content = answer.read()
    link.close()
    return answer.status, content


def test_the_page_and_nothing_else_is_served_also_beside_a_silent_browser():
    pytest.importorskip("foxglove")
    with Outputs(FREE) as outputs:
        port, topic = (int(address(outputs, one).rpartition(":")[2]) for one in ("http", "ws"))
        with (
            socket.create_connection(("127.0.0.1", port)),
            socket.create_connection(("127.0.0.1", port)) as slow,
        ):
            slow.sendall(b"GET / HT")
            status, page = ask(port, "GET", "/")
            assert status == 200 and b":%d`" % topic in page
            assert not re.findall(rb'(?:src|href)="\w[^":]*"|%[./\w]+%', page)  # it is whole
            for path in ("/../state.py", "/live/", "//etc/passwd", "/page.html", "/?x"):
                assert ask(port, "GET", path)[0] == 404
            assert ask(port, "POST", "/")[0] == 501


@pytest.mark.parametrize("taken", [0, 1])
def test_ports_in_use_are_named_with_the_remedy(taken, tmp_path):
    pytest.importorskip("foxglove")
    with socket.create_server(FREE) as other:
        port = other.getsockname()[1] - taken
        with pytest.raises(
            OutputError, match=rf"--serve.*{port} .*in use.*; choose another, as"
        ) as said:
            Outputs(("127.0.0.1", port), tmp_path / "run.mcap")
    assert "\n" not in str(said.value) and not list(tmp_path.iterdir())
    with pytest.raises(OutputError, match="choose another"):
        Outputs(("127.0.0.1", 65535))


def recorded(path):
    reader = pytest.importorskip("mcap.reader")
    with path.open("rb") as file:
        found = list(reader.make_reader(file).iter_messages(topics=[TOPIC]))
    assert {schema.encoding for schema, _, _ in found} == {"jsonschema"}
    assert all(json.loads(schema.data) == State.schema() for schema, _, _ in found)
    return [json.loads(message.data) for _, _, message in found], [m.log_time for _, _, m in found]


def test_a_recording_holds_every_state_and_no_file_is_replaced(tmp_path):
    pytest.importorskip("mcap")
    path, states = tmp_path / "run.mcap", [made(0.2 * k) for k in range(100)]
    begin = time.time_ns()
    with pytest.raises(KeyboardInterrupt), Outputs(record=path) as outputs:
        for state in states:
            outputs.send(state)
        raise KeyboardInterrupt
    found, times = recorded(path)
    assert found == [state.to_dict() for state in states]
    assert begin <= times[0] and times == sorted(times) and times[-1] <= time.time_ns()
    content = path.read_bytes()
    with pytest.raises(FileExistsError, match=r"run\.mcap"):
        Outputs(record=path)
    assert path.read_bytes() == content


RECORDS = """
import sys
from pathlib import Path
from tests.tireid.live.test_outputs import made
from tireid.live.outputs import Outputs
outputs = Outputs(record=Path(sys.argv[1]))
for k in range(300):
    outputs.send(made(0.2 * k))
print("written", flush=True)
sys.stdin.read()
"""


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGKILL")
def test_most_of_a_recording_is_there_where_the_run_is_killed(tmp_path):
    reader, path = pytest.importorskip("mcap.reader"), tmp_path / "run.mcap"
    words, pipe = [sys.executable, "-c", RECORDS, str(path)], subprocess.PIPE
    with subprocess.Popen(words, stdin=pipe, stdout=pipe, text=True) as run:
        assert run.stdout.readline() == "written\n"
        run.send_signal(signal.SIGKILL)
    found = []
    with path.open("rb") as file, pytest.raises(reader.McapError):  # at what was being written
        for _, _, message in reader.NonSeekingReader(file).iter_messages(log_time_order=False):
            found.append(json.loads(message.data)["t"])
    assert len(found) > 250 and found == [0.2 * k for k in range(len(found))]


@pytest.mark.parametrize("states", [300, 5])  # 5: all of it is written at the end
def test_a_full_disk_ends_the_recording_alone_and_is_said_once(tmp_path, capfd, states):
    pytest.importorskip("mcap")
    path, limits = tmp_path / "run.mcap", resource.getrlimit(resource.RLIMIT_FSIZE)
    outputs = Outputs(record=path)
    resource.setrlimit(resource.RLIMIT_FSIZE, (5_000, limits[1]))
    try:
        for k in range(states):
            outputs.send(made(0.2 * k, force=np.random.default_rng(k).normal(size=(2, 41))))
        outputs.close()
        del outputs
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    said = capfd.readouterr().err
    assert said == f"  {path} ends here, all else goes on: File too large\n"


@pytest.fixture(scope="module")
def tires():
    return [LinearModel(vehicle=sedan(), min_speed=speed) for speed in (1.0, 2.0, 3.0)]


def test_the_store_holds_the_newest_tires_for_the_next_run(tmp_path, tires):
    folder = tmp_path / "new" / "store"
    store = Store(folder)
    assert store.stored() is None
    for tire in tires:
        store.offer(tire)
    assert not (folder / "tires.json").exists()  # until a minute is over
    store.close()
    assert Store(folder).stored().to_dict() == tires[-1].to_dict()
    assert {path.name for path in folder.iterdir()} == {"tires.json", "steering.txt"}
    other = LogMap(signals={"delta_f": Signal(channel=("steer",), factor=1.34)})
    with pytest.raises(
        FrozenModelError, match=r"delta_f 'as logged', --log has it 'factor = 1.34'"
    ):
        Store(folder, scale_of_steering(other))
    Store(
        folder, scale_of_steering(LogMap(signals={"delta_f": Signal(channel=("steer",))}))
    ).close()


def test_the_store_writes_by_itself(tmp_path, tires):
    store = Store(tmp_path, every=0.01)
    store.offer(tires[0])
    end = time.monotonic() + 10.0
    while not (tmp_path / "tires.json").exists():
        assert time.monotonic() < end
        time.sleep(0.01)
    store.close()


@pytest.mark.parametrize(
    "content", ["", "{}", '{"format": "tireid frozen model 1", "kind": "axle"}']
)
def test_what_is_no_tire_is_refused_and_stays(tmp_path, content):
    path = tmp_path / "tires.json"
    path.write_text(content)
    with pytest.raises(FrozenModelError, match=r"tires\.json.*; move it away") as said:
        Store(tmp_path)
    assert "\n" not in str(said.value) and path.read_text() == content


WRITES = """
import sys
from pathlib import Path
from identifier.tire_model import TireModel
from tireid.live.outputs import Store
store = Store(Path(sys.argv[1]), every=0.0)
print("runs", flush=True)
while True:
    store.offer(TireModel.load(Path(sys.argv[1], "tires.json")))
"""


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGKILL")
def test_a_run_that_is_killed_while_it_stores_leaves_whole_tires(tmp_path, tires):
    tires[0].save(tmp_path / "tires.json")
    first = (tmp_path / "tires.json").stat().st_ino
    with subprocess.Popen(
        [sys.executable, "-c", WRITES, str(tmp_path)], stdout=subprocess.PIPE, text=True
    ) as run:
        assert run.stdout.readline() == "runs\n"
        while (tmp_path / "tires.json").stat().st_ino == first:
            time.sleep(0.001)
        run.send_signal(signal.SIGKILL)
    assert TireModel.load(tmp_path / "tires.json").to_dict() == tires[0].to_dict()
    Store(tmp_path).close()
