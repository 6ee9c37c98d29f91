"""A sensor fails for up to 4 s while the default method learns: are the forces right afterwards?

    python -m benchmarks.sensor_faults [--faults N] [--record]

Random faults of every kind, in one channel at a time, on noisy random drives of the sedan's plant
and of random cars, taken sample by sample as a car would. Forces are right where over 5 s, from
3 s after the sensor is good again, they differ from those told without the fault by at most 5 % of
the rms force. The same faults are told to a method that never doubts: those that it does not get
over are harmful, and of these the time is told until the first sample is not believed or the
there is an alarm; a drift is small at first and is told apart. No number of the method was
chosen on these drives.
"""

import argparse
import math
import sys
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from benchmarks.random_drives import random_vehicle
from benchmarks.targets import Targets, keeps, show
from codegen.arrays import Array
from identifier.axle import AxleIdentifier
from identifier.axle.gate import GateState
from identifier.driving import Driving
from identifier.methods import DEFAULT, make_method
from identifier.run import OnlineIdentifier, identify
from identifier.stability.monte_carlo import random_drives, within
from models.faults import KINDS, SIZED, SensorFault
from models.friction import Friction
from models.maneuvers import RandomSteer
from models.plant import Plant
from models.recordings import Recording
from models.sensors import Sensor, Sensors
from models.vehicle import GRAVITY, Vehicle, sedan

FAULTS, DRIVES = 700, 24
SENSORS = Sensors(
    v_x=Sensor(noise=0.03), v_y=Sensor(noise=0.03), r=Sensor(noise=0.003), delta=Sensor(noise=5e-4)
)
SIZES = {"v_x": (1.0, 15.0), "v_y": (0.2, 4.0), "r": (0.03, 0.6), "delta_f": (0.01, 0.15)}  # SI
FACTORS = (0.2, 3.0)  # of a channel that is scaled
LASTS, BEGINS = (0.2, 4.0), (10.0, 20.0)  # s
AFTER, LOOK, RIGHT = 3.0, 5.0, 5.0  # s, s, % of the rms force
DT, DURATION = 0.01, 33.0  # s
ON, BAD = (GateState._fields.index(name) for name in ("on", "bad"))
SOON, NEVER = 0.5, 1e9  # s; a mean error that is not reached


class Drive(NamedTuple):
    """A car, its noisy recording, and the forces that are told where nothing fails (n, 2) [N]."""

    car: Vehicle
    recording: Recording
    forces: Array


class Result(NamedTuple):
    """A fault; error [% of the rms force] after it and with no watch; time to notice it [s]."""

    fault: SensorFault
    error: float
    unwatched: float
    noticed: float


def sedan_drive(rng: np.random.Generator) -> tuple[Vehicle, Recording]:
    """Return the sedan and a random drive of its plant.

    Parameters
    ----------
    rng : of road, speed, steering and noise.
    """
    car = sedan()
    speed, friction = rng.uniform(12.0, 28.0), rng.uniform(0.6, 1.0)
    steady = friction * GRAVITY * car.wheelbase / speed**2
    steer = RandomSteer(
        amplitude=min(0.15, rng.uniform(0.8, 1.1) * steady + 0.04),
        frequency=rng.uniform(0.4, 0.7),
        seed=int(rng.integers(1 << 30)),
        onset=0.5,
        rate_limit=1.0,
        duration=DURATION,
    )
    run = Plant(car).simulate(steer, speed=speed, friction=Friction(scale=friction))
    return car, run.recording(SENSORS, rng)


def random_car_drive(rng: np.random.Generator) -> tuple[Vehicle, Recording]:
    """Return a random car on saturating tires and a random drive of it.

    Parameters
    ----------
    rng : of car, road, speed, steering and noise.
    """
    car = random_vehicle(rng)
    while True:
        driving = Driving(
            v_x=rng.uniform(12.0, 28.0), slip=0.15, friction=1.0, bandwidth=rng.uniform(0.4, 1.0)
        )
        drives = random_drives(car, rng, 1, driving=driving, duration=DURATION, dt=DT)
        if within(car, drives, driving, DT)[0]:
            break
    x, u = drives.x[0], drives.u[0]
    recording = Recording(
        name="random car",
        t=DT * np.arange(len(x), dtype=np.float64),
        v_x=drives.v_x[0],
        v_y=x[:, 0],
        r=x[:, 1],
        delta_f=u[:, 0],
        delta_r=u[:, 1],
    )
    return car, SENSORS.apply(recording, rng)


def random_fault(rng: np.random.Generator) -> SensorFault:
    """Return a fault of any kind in any channel.

    Parameters
    ----------
    rng : source of randomness.
    """
    channel, kind = str(rng.choice(list(SIZES))), str(rng.choice(KINDS))
    least, most = FACTORS if kind == "scaled" else SIZES[channel]
    size = math.exp(rng.uniform(math.log(least), math.log(most)))
    if kind not in ("scaled", "noisy"):
        size *= rng.choice([-1.0, 1.0])
    return SensorFault(
        channel=channel,
        kind=kind,
        start=float(rng.uniform(*BEGINS)),
        duration=float(math.exp(rng.uniform(*np.log(LASTS)))),
        size=size if kind in SIZED else 0.0,
    )


def signals(recording: Recording, fault: SensorFault | None, rng: np.random.Generator) -> Array:
    """Return v_x, v_y, r, delta_f, delta_r as they are seen, (n, 5).

    Parameters
    ----------
    recording : what good sensors see.
    fault : None where nothing fails.
    rng : of the noise of a noisy channel.
    """
    seen = {name: getattr(recording, name) for name in ("v_x", "v_y", "r", "delta_f", "delta_r")}
    if fault is not None:
        good, broken = seen[fault.channel], fault.active(recording.t)
        noise = rng.standard_normal(broken.size)
        shown = fault.shown(recording.t, good, good[np.argmax(broken)], noise)
        seen[fault.channel] = np.where(broken, shown, good)
    return np.column_stack(list(seen.values()))


def drive(
    design: AxleIdentifier, car: Vehicle, seen: Array, fault: SensorFault | None = None
) -> tuple[Array, float]:
    """Return the forces (n, 2) [N], and how long after its start a fault was noticed [s].

    Parameters
    ----------
    design : the method.
    car : the car.
    seen : of `signals`.
    fault : None where nothing fails.
    """
    online, forces, noticed = OnlineIdentifier(design, car, DT), np.zeros((len(seen), 2)), math.inf
    times = DT * np.arange(len(seen))
    watching = np.zeros(len(seen), bool) if fault is None else fault.active(times)
    for k, (v_x, v_y, r, delta_f, delta_r) in enumerate(seen):
        forces[k] = online.update(np.array([v_y, r]), np.array([delta_f, delta_r]), v_x)
        if watching[k] and noticed == math.inf and is_noticed(online):
            assert fault is not None
            noticed = times[k] - fault.start
    return forces, noticed


def is_noticed(online: OnlineIdentifier) -> bool:
    """Return whether a sample was refused, the last one not believed, or there is an alarm.

    Parameters
    ----------
    online : the identifier.
    """
    state = online.state()
    gate_state = state["gate"].ravel()
    alarm, on, bad = state["watch"].ravel()[0], gate_state[ON], gate_state[BAD]
    return bool(online.counts.refused or alarm > 0.0 or bad > 0.0 or on == 0.0)


def after_fault(drive_: Drive, fault: SensorFault, forces: Array) -> float:
    """Return by how much forces still differ [% of the rms force], the worse axle.

    Parameters
    ----------
    drive_ : the drive.
    fault : what failed.
    forces : that were told (n, 2) [N].
    """
    t, end = drive_.recording.t, fault.start + fault.duration + AFTER
    window = (t >= end) & (t < end + LOOK)
    off = forces[window[: len(forces)]] - drive_.forces[window]
    size = np.sqrt(np.mean(drive_.forces**2, axis=0))
    return float(100.0 * (np.sqrt(np.mean(off**2, axis=0)) / size).max())


def run(count: int) -> tuple[dict[str, list[Result]], float]:
    """Return the results for sedan and random cars, and the share of time with a false alarm.

    Parameters
    ----------
    count : number of faults, half on each.
    """
    results, alarm = {}, []
    for stream, (name, make) in enumerate(
        {"sedan": sedan_drive, "random cars": random_car_drive}.items()
    ):
        drives = []
        for k in range(min(DRIVES, count)):
            rng = np.random.default_rng([20, stream, k])
            car, recording = make(rng)
            forces, _ = drive(_design(car), car, signals(recording, None, rng))
            drives.append(Drive(car, recording, forces))
            alarm.append(_alarm_share(car, recording))
        results[name] = [
            _result(drives[k % len(drives)], np.random.default_rng([21, stream, k]))
            for k in range(count // 2)
        ]
    return results, float(np.mean(alarm))


def _design(car: Vehicle) -> AxleIdentifier:
    design = make_method(DEFAULT, car)
    assert isinstance(design, AxleIdentifier)
    return design


def _alarm_share(car: Vehicle, recording: Recording) -> float:
    """Return the share of time with an alarm although nothing fails."""
    history = identify(recording, car, _design(car))
    return float((history.state["watch"].reshape(len(recording) + 1, -1)[:, 0] > 0.0).mean())


def _result(drive_: Drive, rng: np.random.Generator) -> Result:
    """Return what becomes of a random fault on a drive."""
    fault = random_fault(rng)
    seen = signals(drive_.recording, fault, rng)
    until = math.ceil((fault.start + fault.duration + AFTER + LOOK) / DT) + 1
    design = _design(drive_.car)
    blind = replace(design, watch=replace(design.watch, noticed=NEVER))
    (forces, noticed), (unwatched, _) = (
        drive(one, drive_.car, seen[:until], fault) for one in (design, blind)
    )
    error, without = (after_fault(drive_, fault, one) for one in (forces, unwatched))
    return Result(fault, error, without, noticed)


def report(results: dict[str, list[Result]], alarm: float, targets: Targets) -> None:
    """Print tables, record their numbers and judge them.

    Parameters
    ----------
    results : by cars.
    alarm : share of time with an alarm where nothing fails.
    targets : collects what is missed.
    """
    everything = [one for some in results.values() for one in some]
    print(f"  {'right [%]':15} cases  watch  without  harmful  noticed: median, 90 %, longest [s]")
    groups = dict(results)
    groups |= {kind: [one for one in everything if one.fault.kind == kind] for kind in KINDS}
    groups |= {name: [one for one in everything if one.fault.channel == name] for name in SIZES}
    for name, some in groups.items():
        if some:
            print(f"  {name:15} {_row(some, name.replace(' ', '_'), targets)}")
    harmful = [one for one in everything if one.unwatched > RIGHT]
    print("Targets")
    right = float(100.0 * np.mean([one.error <= RIGHT for one in everything]))
    targets.record("cases", len(everything))
    targets.at_least("forces right 3 s after the fault", right, 99.0, "%", key="right")
    unwatched = float(100.0 * np.mean([one.unwatched <= RIGHT for one in everything]))
    targets.record("unwatched", unwatched, "%")
    show("the same without the watch", f"{unwatched:.1f} %")
    at_once = [one.noticed for one in harmful if one.fault.kind != "drifting"]
    targets.record("harmful", len(harmful))
    targets.record("at_once", len(at_once))
    soon = float(100.0 * np.mean(np.array(at_once) <= SOON))
    label = f"harmful faults that do not grow, noticed within {SOON:g} s"
    targets.at_least(label, soon, 90.0, "%", key="soon")
    targets.at_most("time in doubt although nothing fails", 100.0 * alarm, 1.0, key="doubt")
    for one in sorted(everything, key=lambda one: -one.error)[:10]:
        show(
            str(one.fault), f"{one.error:.1f} %, {one.unwatched:.1f} % without, {one.noticed:.2f} s"
        )


def _row(some: Sequence[Result], key: str, targets: Targets) -> str:
    """Return a line of the table; its numbers are recorded."""
    shares = [
        100.0 * np.mean([value <= RIGHT for value in column])
        for column in ([one.error for one in some], [one.unwatched for one in some])
    ]
    noticed = [one.noticed for one in some if one.unwatched > RIGHT]
    targets.record(f"{key}/cases", len(some))
    targets.record(f"{key}/right", float(shares[0]), "%")
    targets.record(f"{key}/unwatched", float(shares[1]), "%")
    text = f"{len(some):5} {shares[0]:6.1f} {shares[1]:8.1f} {len(noticed):8}"
    if noticed:
        times = np.quantile(noticed, (0.5, 0.9, 1.0), method="lower")
        for name, time in zip(("median", "q90", "longest"), times, strict=True):
            targets.record(f"{key}/noticed/{name}", float(time) if math.isfinite(time) else "never")
        text += " ".join(f"{time:9.2f}" for time in times)
    return text


def main() -> int:
    """Run everything; return the exit code."""
    keep = keeps()
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--faults", type=int, default=FAULTS)
    count = parser.parse_args().faults
    targets = Targets("sensor_faults")
    results, alarm = run(count)
    report(results, alarm, targets)
    return targets.finish(keep=keep and count == FAULTS)


if __name__ == "__main__":
    sys.exit(main())
