"""Learning while the car drives, begun with a fit: another road, the same, a freeze at any time.

    python -m benchmarks.live [--record] [--cars N]

Random cars of four classes are fitted on one drive and go on learning on another, on which the
friction changes to 0.3 to 0.8 of it or stays; sensors have noise and zeros. Then the real 1:10 car,
where its recordings are there: a fit of each run on the rubber floor goes on learning on tape and
tiles, and on the other rubber runs; and the online method, begun afresh, is frozen every second.
Force errors are those of a first-order mean of a quarter of a second, over its rms, in percent.
"""

import argparse
import sys
from itertools import product

import numpy as np

import tireid as ti
from benchmarks.random_cars import CLASSES, FIRST_SEED, Beginning, random_car, random_drive
from benchmarks.recorded_cars import DART, DATA
from benchmarks.road_friction import LESS, driven
from benchmarks.targets import Targets, keeps
from codegen.arrays import Array
from identifier.methods import LIVE, continuing
from identifier.run import History, identify
from models.recordings import Recording, read_recording

RATE = 4.0  # 1/s
SETTLED = 5.0  # s of the new road, after which errors count
FREEZES = 20.0, 1.0  # s: from, every
RUBBER = ("free_10_02_28", "free_10_12_05", "rubber_12_37_59", "ramp_steerneg025", "free_10_01_01")
TAPE = "tape_tiles_steer_neg03"


def slow(force: Array, dt: float) -> Array:
    """Return a first-order mean of forces (n, 2)."""
    found, share = np.empty_like(force), 1.0 - np.exp(-RATE * dt)
    last = force[0]
    for k, one in enumerate(force):
        found[k] = last = last + share * (one - last)
    return found


def missed(force: Array, recording: Recording, since: float, slowest: float) -> Array:
    """Return the force that is missed over its rms, front and rear [%]."""
    truth = recording.axle_force
    assert truth is not None
    on = (recording.t >= since) & (recording.v_x > slowest)
    error = slow(force - truth, recording.dt)[on]
    size = slow(truth, recording.dt)[on]
    return np.asarray(100.0 * np.sqrt(np.mean(error**2, axis=0) / np.mean(size**2, axis=0)))


def onward(start: ti.TireModel, recording: Recording) -> History:
    """Return how a model goes on learning over a drive, sample by sample."""
    return identify(recording, start.vehicle, continuing(start, start.vehicle, recording.dt), start)


def changes(history: History) -> list[float]:
    """Return when another road was taken to have begun [s]."""
    road = history.state["change"].reshape(len(history.recording) + 1, -1)[:, -1]
    return [float(t) for t in history.recording.t[np.flatnonzero(np.diff(road))]]


def dart(targets: Targets) -> None:
    """Measure the real 1:10 car."""
    logs = {run: read_recording(DATA / "dart_imu.csv.gz", run=run) for run in (*RUBBER, TAPE)}
    slowest = 0.45 * DART.froude_speed
    fits = {run: ti.identify(logs[run], DART, check=False).freeze() for run in RUBBER}
    good, tape = 0, logs[TAPE]
    moving = float(tape.t[np.argmax(tape.v_x > 2.0 * slowest)])
    for run, model in fits.items():
        history = onward(model, tape)
        found = missed(history.axle_force, tape, moving + SETTLED, slowest)
        held = missed(model.predict(tape), tape, moving + SETTLED, slowest)
        good += bool(found.max() <= 25.0)
        print(f"{run} -> tape: {found.round(1)} %, held {held.round(1)}; {changes(history)}")
        for axle, value in zip(("front", "rear"), found, strict=True):
            targets.record(f"tape/{run}/{axle}", float(value), "%")
    targets.at_least("models of rubber within 25 % on tape", good, 4, "", key="tape/good")
    false = 0
    for run, model in fits.items():
        for other in RUBBER:
            if other == run:
                continue
            history = onward(model, logs[other])
            false += len(changes(history))
            found = missed(history.axle_force, logs[other], moving + SETTLED, slowest)
            held = missed(model.predict(logs[other]), logs[other], moving + SETTLED, slowest)
            print(f"{run} -> {other}: {found.round(1)}, held {held.round(1)}; {changes(history)}")
    targets.at_most("changes of road told on the same floor", false, 0, "", key="false")
    freezes(targets, slowest)


def freezes(targets: Targets, slowest: float) -> None:
    """Freeze a run of the real car, begun afresh, every second."""
    log = read_recording(DATA / "dart.csv.gz", run=RUBBER[0])
    history = ti.identify(log, DART, ti.make_method(LIVE, DART), check=False).history
    times = np.arange(log.t[0] + FREEZES[0], log.t[-1], FREEZES[1])
    found = [
        missed(history.freeze(float(t)).predict(log), log, float(log.t[0]), slowest)
        for t in (*times, float(log.t[-1]))
    ]
    worst = np.max(np.array(found[:-1]) / found[-1])
    print(f"frozen at the end {found[-1].round(1)} %, worst {np.max(found, axis=0).round(1)}")
    label = "error frozen at any time over that at the end"
    targets.at_most(label, float(worst), 1.3, "-", key="freeze/worst")


def random(targets: Targets, cars: int) -> None:
    """Measure random cars."""
    after, false, unnoticed = [], 0, 0
    for kind, seed in product(CLASSES, range(FIRST_SEED, FIRST_SEED + cars)):
        rng = np.random.default_rng([seed, 11])
        car = random_car(kind, rng)
        first = random_drive(car, rng, Beginning(lead=2.0, kind="biased"))
        model = ti.identify(first.log(rng), car.told, check=False).freeze()
        for ratio in (1.0, float(rng.uniform(*LESS))):
            drive = driven(car, ratio, rng)
            if drive is None:
                continue
            exact, change = drive
            history = onward(model, car.sensors.apply(exact, rng))
            told = changes(history)
            false += sum(t < change for t in told)
            since = SETTLED + (0.0 if ratio == 1.0 else change)
            slowest = 0.45 * car.vehicle.froude_speed
            found = missed(history.axle_force, exact, since, slowest)
            held = missed(model.predict(exact), exact, since, slowest)
            unnoticed += ratio < 1.0 and not any(t >= change for t in told)
            if ratio < 1.0:
                after.append(found.max())
            print(
                f"{kind} {seed} at {ratio:.2f} from {change:.1f} s: {found.round(1)} %, held "
                f"{held.round(1)}; {np.round(told, 1)}"
            )
    targets.record("random/after/median", float(np.median(after)), "%")
    targets.record("random/after/worst", float(np.max(after)), "%")
    targets.record("random/false", false)
    targets.record("random/unnoticed", unnoticed)
    print(
        f"after a change: {np.median(after):.1f} % median, {np.mean(after):.1f} mean, "
        f"{np.max(after):.1f} worst of {len(after)}; false {false}, not noticed {unnoticed}"
    )


def main() -> int:
    """Measure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cars", type=int, default=3, help="of each class")
    parser.add_argument("--record", action="store_true")
    options, targets = parser.parse_args(), Targets("live")
    random(targets, options.cars)
    if DATA.is_dir():
        dart(targets)
    else:
        print(f"the recordings are not there: {DATA} (set TIREID_DATA)")
    return targets.finish(keep=keeps())


if __name__ == "__main__":
    sys.exit(main())
