"""How fast, how light and how watchful is `tireid live`?

    python -m benchmarks.live [--quick] [--record]

Served: ten minutes of packets at 100 Hz to `tireid live udp://`, with a client that reads each
state and one that never does. Three of them come as from a car: time from a packet to its state at
the client, processor time, states that came. The others come five times as fast: memory alone is
compared, from the first minute of packets to the tenth.
Roads: random cars, seeds that no number was chosen on, swing at random up to the grip; each once on
a dry road and once on one that loses half of its friction at 30 s. An alarm there is in time within
1 s of the moment from which an axle has 85 % of the grip that is left.
Floors: a real car of 1:10 learns on one floor and from one sample to the next is on tape and tiles.
"""

import json
import math
import os
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager, suppress
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks import random_cars
from benchmarks.recorded_cars import DART, DATA, FERRARI, GTI
from benchmarks.targets import Table, Targets, Values, parse, show
from codegen.arrays import Array
from models.friction import Friction, FrictionChange
from models.plant import PlantError
from models.recordings import Recording, read_recording
from models.vehicle import Vehicle, sedan
from tireid.driving.learn import sample_recording
from tireid.live.live import Live
from tireid.live.state import State

DT = 0.01  # s between packets
LASTS, TIMED, FASTER = 600.0, 180.0, 5.0  # s of packets, those in real time, pace of the others
WARM = 60.0  # s, from which memory is compared
CARS = 12  # of each class
CHANGE, SCALE = 30.0, 0.5  # s, and of the friction
USED = 0.85  # of the grip that is left, from which a loss can show
IN_TIME = 1.0  # s
TRIED = 60  # drives of a car
FLOORS = ("free_10_12_05", "free_10_02_28")
TAPE, TAPES = "tape_tiles_steer_neg03", (2800, 3000, 3500, 4000, 4500, 5000)  # first samples
LEARNING, AFTER = 3000, 400  # samples before and after
CLEAN = ((FERRARI, "ferrari.csv.gz", None), (GTI, "gti.csv.gz", "exp8"),
         (GTI, "gti.csv.gz", "exp12"))  # fmt: skip


class Served(NamedTuple):
    """Times from packet to state [s]; share of a core; growth of memory [MB]; states read, sent."""

    times: Array
    processor: float
    growth: float
    read: int
    due: int


def served(seconds: float, timed: float) -> Served:
    """Send packets to `tireid live`, and read its states.

    Parameters
    ----------
    seconds : of packets.
    timed : of these in real time, the first ones, which all numbers but memory are of [s].
    """
    log = sample_recording(seed=1)
    n, first = round(seconds / DT), round(timed / DT)
    sent = np.full(n, np.nan)
    arrived: dict[int, float] = {}
    with (
        tempfile.TemporaryDirectory() as folder,
        _process(Path(folder)) as (process, port, topic),
        _subscribed(topic),  # and never reads
    ):
        threading.Thread(target=_read, args=(topic, arrived), daemon=True).start()
        out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        begin, busy = time.perf_counter(), _processor(process.pid)
        memory = spent = math.nan
        for k in range(n):
            at = k % len(log)
            values = {
                "vx": log.v_x[at], "vy": log.needed("v_y")[at], "r": log.r[at],
                "delta_f": log.delta_f[at], "t": DT * k,
            }  # fmt: skip
            packet = json.dumps({name: float(value) for name, value in values.items()}).encode()
            due = min(DT * k, timed) + max(DT * k - timed, 0.0) / FASTER
            left = begin + due - time.perf_counter()
            if left > 0.0:
                time.sleep(left)
            sent[k] = time.perf_counter()
            out.sendto(packet, ("127.0.0.1", port))
            if k == round(min(WARM, 0.5 * timed) / DT):
                memory = _memory(process.pid)
            if k == first:
                spent = _processor(process.pid) - busy
        growth = _memory(process.pid) - memory
        time.sleep(0.5)
    times = [arrived[k] - sent[k] for k in arrived if k < first]
    return Served(np.array(times), spent / timed, growth, len(times), first // 20)


@contextmanager
def _process(folder: Path) -> Iterator[tuple[subprocess.Popen[bytes], int, int]]:
    """Yield a running `tireid live`, the port of its packets and that of its topic."""
    sedan().to_toml(folder / "car.toml")
    packets, page = _free_port(socket.SOCK_DGRAM), _free_port(socket.SOCK_STREAM)
    command = [
        sys.executable, "-m", "tireid", "live", f"udp://127.0.0.1:{packets}",
        "--vehicle", str(folder / "car.toml"), "--serve", f"127.0.0.1:{page}",
    ]  # fmt: skip
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        for _ in range(600):
            with suppress(OSError), socket.create_connection(("127.0.0.1", page + 1), 0.1):
                break
            time.sleep(0.1)
        yield process, packets, page + 1
    finally:
        process.terminate()
        process.wait(20.0)


def _free_port(kind: int) -> int:
    with socket.socket(socket.AF_INET, kind) as tried:
        tried.bind(("127.0.0.1", 0))
        return int(tried.getsockname()[1])


@contextmanager
def _subscribed(port: int) -> Iterator[Any]:
    """Yield a client that has subscribed to the states."""
    from websockets import Subprotocol
    from websockets.sync.client import connect

    protocols = [Subprotocol("foxglove.sdk.v1")]
    with connect(
        f"ws://127.0.0.1:{port}", subprotocols=protocols, ping_interval=None, close_timeout=1.0
    ) as client:
        while True:
            said = client.recv()
            if isinstance(said, str) and json.loads(said)["op"] == "advertise":
                channel = json.loads(said)["channels"][0]["id"]
                break
        wanted = {"op": "subscribe", "subscriptions": [{"id": 0, "channelId": channel}]}
        client.send(json.dumps(wanted))
        yield client


def _read(port: int, arrived: dict[int, float]) -> None:
    """Note when the state of each packet comes, until the server goes."""
    with suppress(Exception), _subscribed(port) as client:  # until its end
        while True:
            data = client.recv()
            now = time.perf_counter()
            if isinstance(data, bytes) and data[0] == 1:
                sample = round(json.loads(data[struct.calcsize("<BIQ") :])["t"] / DT)
                arrived.setdefault(sample, now)  # the last one comes again, older


def _processor(pid: int) -> float:
    """Return the processor time of a process so far [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _memory(pid: int) -> float:
    """Return the memory of a process [MB]."""
    pages = int(Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


# Roads and floors.


class Watched(NamedTuple):
    """False alarms on a dry road; time from sliding to the alarm [s], inf: none, NaN: no slide."""

    false: int
    late: float
    ratio: float


def watched(case: tuple[str, int]) -> Watched:
    """Return how a random car's loss of friction is found.

    Parameters
    ----------
    case : class and seed of the car.
    """
    kind, seed = case
    rng = np.random.default_rng([seed, 99])
    while True:
        car = random_cars.random_car(kind, rng)
        for _ in range(TRIED):
            speed = rng.uniform(2.6, 4.5) * car.vehicle.froude_speed
            steering = random_cars.random_steering(car, speed, random_cars.LEAD, rng)
            if steering is None:
                continue
            with suppress(PlantError):
                run = car.plant.simulate(steering, speed=speed)
                if not random_cars.is_good(car, run, random_cars.Beginning(), speed):
                    continue
                road = Friction(changes=(FrictionChange(scale=SCALE, at_time=CHANGE),))
                wet = car.plant.simulate(steering, speed=speed, friction=road)
                sensors = random_cars.good_sensors(car.vehicle)
                dry, lost = (one.recording(sensors, rng) for one in (run, wet))
                grip = SCALE * min(car.friction) * np.array(car.vehicle.axle_loads)
                return _found(car.declared, dry, lost, grip)


def _found(car: Vehicle, dry: Recording, wet: Recording, grip: Array) -> Watched:
    assert wet.axle_force is not None
    false = _rises([state.alarm for state in states(car, [dry])])
    t, use = wet.t - wet.t[0], np.abs(wet.axle_force / grip).max(axis=1)
    slides = t[(t > CHANGE) & (use > USED)]
    alarms = [state for state in states(car, [wet]) if state.alarm]
    if not slides.size:
        return Watched(false, math.nan, math.nan)
    if not alarms:
        return Watched(false, math.inf, math.nan)
    assert alarms[0].friction is not None
    return Watched(false, alarms[0].t - float(slides[0]), alarms[0].friction)


def states(car: Vehicle, logs: Sequence[Recording]) -> list[State]:
    """Return the states of logs that follow one another without a gap."""
    live, found, k = Live(car), [], 0
    for log in logs:
        v_y = log.needed("v_y")
        for i in range(len(log)):
            state = live.feed(DT * k, log.v_x[i], log.r[i], log.delta_f[i], None, v_y[i])
            k += 1
            if state is not None:
                found.append(state)
    return found


def _rises(alarms: Sequence[str]) -> int:
    """Return how often an alarm begins."""
    on = [bool(one) for one in alarms]
    return sum(now and not before for before, now in zip([False, *on], on, strict=False))


def joined(case: tuple[str, str, int]) -> float:
    """Return the time from a change of floor to its alarm [s]; infinite where there is none.

    Parameters
    ----------
    case : both floors, and the first sample of the second.
    """
    floor, other, first = case
    path = DATA / "dart_imu.csv.gz"
    before = read_recording(path, floor).taken(slice(2000, 2000 + LEARNING))
    after = read_recording(path, other).taken(slice(first, first + AFTER))
    change = DT * len(before)
    alarms = [one.t for one in states(DART, [before, after]) if one.alarm and one.t >= change]
    return alarms[0] - change if alarms else math.inf


def clean(case: tuple[Vehicle, str, str | None]) -> int:
    """Return the false alarms on a recording of one road."""
    car, name, run = case
    return _rises([state.alarm for state in states(car, [read_recording(DATA / name, run)])])


def canary() -> Values:
    """Return stiffness [N/rad] and largest a_y [m/s²] after 20 s of a drive."""
    state = states(sedan(), [sample_recording(seed=1).taken(slice(0, 2000))])[-1]
    front, rear = state.stiffness.tolist()
    return {"front": front, "rear": rear, "a_y_limit": state.a_y_limit}


def tables(v: Values) -> dict[str, Table]:
    """Return the tables of the documents.

    Parameters
    ----------
    v : recorded values.
    """
    rows = [
        ["packet to state at a client: median, 99 % [ms]",
         f"{v['served/median']:.1f}, {v['served/p99']:.1f}"],
        ["processor time at 100 Hz [% of a core]", f"{v['served/processor']:.1f}"],
        ["growth of memory from the first minute to the tenth [MB]", f"{v['served/growth']:.1f}"],
        ["states that a client read beside one that never reads",
         f"{v['served/read']} of {v['served/due']}"],
        ["random cars, friction halved: alarm within 1 s of sliding",
         f"{v['roads/in_time']} of {v['roads/slid']}"],
        ["random cars, dry: false alarms", f"{v['roads/false']} in {v['roads/cars']} drives"],
        ["real 1:10 car, on tape at once: alarm within 1 s",
         f"{v['floors/in_time']} of {v['floors/joins']}"],
        ["the same on the floor of another run: false alarms",
         f"{v['floors/false']} of {v['floors/joins']}"],
        ["recordings of full-size cars (8 min): false alarms", f"{v['clean/false']}"],
    ]  # fmt: skip
    return {"live": Table(("what", "measured"), rows)}


def main() -> int:
    """Measure and print; return 1 where a target was missed."""
    targets, options = Targets("live"), parse("live", __doc__)
    found = served(*((20.0, 10.0) if options.quick else (LASTS, TIMED)))
    median, p99 = (1e3 * float(np.quantile(found.times, q)) for q in (0.5, 0.99))
    targets.record("served/median", median)
    targets.at_most("packet to state, 99 %", p99, 5.0, "ms", key="served/p99")
    targets.at_most("processor time", 100.0 * found.processor, 5.0, "%", key="served/processor")
    targets.at_most("growth of memory", found.growth, 2.0, "MB", key="served/growth")
    targets.record("served/read", found.read)
    targets.record("served/due", found.due)
    show("states read beside a client that never reads", f"{found.read} of {found.due}")
    seeds = range(random_cars.FIRST_SEED, random_cars.FIRST_SEED + (1 if options.quick else CARS))
    with ProcessPoolExecutor() as pool:
        cases = [(kind, seed) for kind in random_cars.CLASSES for seed in seeds]
        roads = list(pool.map(watched, cases))
        late = np.array([one.late for one in roads if not math.isnan(one.late)])
        targets.record("roads/cars", len(roads))
        targets.record("roads/slid", late.size)
        targets.record("roads/in_time", int((late <= IN_TIME).sum()))
        show("alarms within 1 s of sliding", f"{(late <= IN_TIME).sum()} of {late.size}")
        targets.at_most("false alarms", sum(one.false for one in roads), 0, "", key="roads/false")
        if DATA.is_dir():
            pairs = list(pairwise([*FLOORS, FLOORS[0]]))
            alike = list(pool.map(joined, [(*pair, k) for pair in pairs for k in TAPES]))
            joins = list(pool.map(joined, [(one, TAPE, k) for one, _ in pairs for k in TAPES]))
            in_time = sum(one <= IN_TIME for one in joins)
            targets.record("floors/joins", len(joins))
            targets.at_least("alarms on tape", in_time, len(joins), "", key="floors/in_time")
            label = "alarms where the floor stays"
            targets.at_most(label, sum(map(math.isfinite, alike)), 0, "", key="floors/false")
            false = sum(pool.map(clean, CLEAN))
            targets.record("clean/false", false)
            show("false alarms on recordings", f"{false}")
    return targets.finish(canary, keep=options.record)


if __name__ == "__main__":
    sys.exit(main())
