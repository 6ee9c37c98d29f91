"""Does a stored model notice that a drive is on another road than that of its identification?

    python -m benchmarks.road_friction [--quick] [--record]

Random cars of four classes learn on a drive with good sensors, with their v_y and without. Then
they are driven at random on the same road, and on one whose friction changes at a random time, to
0.3 to 0.8 of it and to 1.25 to 1.6; `Prediction.friction` of the stored model is asked of each. A
road is detected in time within a second of the moment from which the old curve, at the true motion
and at speeds at which the verdict looks, is wrong by more than 15 % of the static load of an axle:
before that no tire slides otherwise than it did. Constants of the filter were chosen on seeds 100
to 105.
"""

import math
import sys
from collections import defaultdict
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from dataclasses import replace
from typing import NamedTuple

import numpy as np

import tireid as ti
from benchmarks.answers import blind
from benchmarks.random_cars import CLASSES, FIRST_SEED, RandomCar, drawn, random_steering
from benchmarks.targets import Table, Targets, Values, parse
from identifier.evidence import BRISK
from models.friction import Friction, FrictionChange
from models.plant import PlantError
from models.recordings import Recording

EACH = 6  # cars of a class
SAME, DROPS, RISES = 2, 3, 1  # drives of a car
LESS, MORE = (0.3, 0.8), (1.25, 1.6)  # friction over that of the identification
WHEN = (4.0, 12.0)  # s, of the change, which takes a tenth of a second
SPIN, SLOWED = 0.3, 0.4  # largest |v_y/v_x|, and least v_x over that wanted, of a drive that counts
DRAWS = 60
WRONG = 0.15  # of the static load
SOON = 1.0  # s
WAYS = ("with_v_y", "without_v_y")


class Asked(NamedTuple):
    """What was detected of a drive.

    ratio : true friction, 1 where nothing changes.   after : when the change was detected, since
    the old curve was wrong [s]; inf never, nan where it never was wrong.   early : whether another
    road was detected before, or where there is none.   detected : friction at last, nan for none.
    """

    ratio: float
    after: float
    early: bool
    detected: float


def driven(
    car: RandomCar, ratio: float, rng: np.random.Generator
) -> tuple[Recording, float] | None:
    """Return a drive without noise and when its road changes [s]; None where all of them spin.

    Parameters
    ----------
    car : that drives.
    ratio : friction after the change.
    rng : source of randomness.
    """
    for _ in range(DRAWS):
        speed = float(rng.uniform(2.6, 4.5) * car.vehicle.froude_speed)
        steering = random_steering(car, speed, 2.0, rng)
        if steering is None:
            continue
        steering = replace(steering, amplitude=steering.amplitude * rng.uniform(0.4, 1.0))
        change = FrictionChange(scale=ratio, at_time=float(rng.uniform(*WHEN)), width=0.1)
        road = Friction() if ratio == 1.0 else Friction(changes=(change,))
        with suppress(PlantError):
            run = car.plant.simulate(steering, speed=speed, friction=road, name=car.kind)
            slip = np.abs(run.v_y / np.maximum(run.v_x, 1e-3))
            if slip.max() <= SPIN and run.v_x.min() >= SLOWED * speed:
                return run.recording(), math.inf if ratio == 1.0 else change.start
    return None


def wrong_at(model: ti.TireModel, drive: Recording, since: float) -> float:
    """Return from when on the curve is wrong at the true motion [s], inf never.

    Parameters
    ----------
    model : that was identified on another road.
    drive : with its true forces.
    since : not before [s].
    """
    assert drive.axle_force is not None
    away = np.abs(model.predict(drive) - drive.axle_force) / np.array(model.vehicle.axle_loads)
    fast = drive.v_x >= BRISK * model.vehicle.froude_speed
    wrong = (away.max(axis=1) > WRONG) & (drive.t >= since) & fast
    return float(drive.t[np.argmax(wrong)]) if wrong.any() else math.inf


def asked(
    model: ti.TireModel, log: Recording, ratio: float, change: float, wrong: float
) -> Asked | None:
    """Return what a stored model tells of a log; None where nothing can be detected.

    Parameters
    ----------
    model : that is asked.
    log : as the sensors show it.
    ratio, change : friction, and when it comes [s].
    wrong : from when on the old curve is wrong [s].
    """
    found = ti.replay(log, model).friction()
    if found is None:
        return None
    roads = found.roads
    after = [one.first for one in roads if one.first >= change]
    late = math.nan if math.isinf(wrong) else min(after, default=math.inf) - wrong
    detected = roads[-1].ratio if roads else math.nan
    return Asked(ratio, late, any(one.first < change for one in roads), detected)


def case(job: tuple[str, int]) -> dict[str, list[Asked]]:
    """Return what was detected of the drives of a random car, with its v_y and without.

    Parameters
    ----------
    job : class of the car, and seed.
    """
    kind, seed = job
    taught, rng = drawn(kind, seed), np.random.default_rng([seed, 77])
    car, log = taught.car, blind(taught.log(rng))
    logs = {"with_v_y": log, "without_v_y": replace(log, v_y=None)}
    models = {way: ti.identify(one, car.declared, check=False).tire for way, one in logs.items()}
    less = np.exp(rng.uniform(math.log(LESS[0]), math.log(LESS[1]), DROPS))
    detected: dict[str, list[Asked]] = {way: [] for way in WAYS}
    for ratio in (*[1.0] * SAME, *less.tolist(), *rng.uniform(*MORE, RISES).tolist()):
        for way, found in of_drive(car, models, ratio, rng).items():
            detected[way].append(found)
    return detected


def of_drive(
    car: RandomCar, models: Mapping[str, ti.TireModel], ratio: float, rng: np.random.Generator
) -> dict[str, Asked]:
    """Return what stored models tell of a drive on another road, where they tell anything.

    Parameters
    ----------
    car : that drives.
    models : with_v_y, and maybe without.
    ratio : friction after the change.
    rng : source of randomness.
    """
    drive, detected = driven(car, ratio, rng), {}
    if drive is None:
        return {}
    exact, change = drive
    shown = blind(car.sensors.apply(exact, rng))
    for way, model in models.items():
        log = shown if way == "with_v_y" else replace(shown, v_y=None)
        wrong = wrong_at(models["with_v_y"], exact, change)
        found = asked(model, log, ratio, change, wrong)
        if found is not None:
            detected[way] = found
    return detected


def report(way: str, every: Sequence[Asked], targets: Targets) -> None:
    """Print, record and judge what was detected of all drives in one way.

    Parameters
    ----------
    way : one of `WAYS`.
    every : what was detected.
    targets : collects what is missed.
    """
    early = 100.0 * float(np.mean([one.early for one in every]))
    targets.record(f"{way}/drives", len(every))
    label = f"{way.replace('_', ' ', 1)}: false alarms"
    targets.at_most(label, early, 1.0, key=f"{way}/early")
    for name, some in (
        ("drop", [one for one in every if one.ratio < 1.0]),
        ("rise", [one for one in every if one.ratio > 1.0]),
    ):
        slid = [one for one in some if not math.isnan(one.after)]
        if not slid:
            continue
        after = np.array([one.after for one in slid])
        found = 100.0 * float(np.mean(np.isfinite(after)))
        targets.record(f"{way}/{name}/slid", len(slid))
        targets.record(f"{way}/{name}/detected", found)
        print(f"  {way}, {name}: {len(slid)} that slid, {found:.0f} % detected")
        if name == "drop":
            off = [
                abs(one.detected / one.ratio - 1.0) for one in slid if not math.isnan(one.detected)
            ]
            soon = 100.0 * float(np.mean(after <= SOON))
            label = f"{way.replace('_', ' ', 1)}: detected within 1 s"
            targets.at_least(label, soon, 90.0, key=f"{way}/drop/soon")
            print(f"  median {np.median(after):.2f} s, size off by {100.0 * np.median(off):.1f} %")


def canary() -> Values:
    """Return what a stored model tells of one drop of friction."""
    taught, rng = drawn("sedan", FIRST_SEED), np.random.default_rng(0)
    models = {
        "with_v_y": ti.identify(blind(taught.log(rng)), taught.car.declared, check=False).tire
    }
    (found,) = of_drive(taught.car, models, 0.5, rng).values()
    return found._asdict()


def tables(v: Values) -> dict[str, Table]:
    """Return the table of the documents.

    Parameters
    ----------
    v : recorded values.
    """
    rows = [
        [way.replace("_", " ", 1), f"{v[f'{way}/drives']}", f"{v[f'{way}/early']:.1f}",
         f"{v[f'{way}/drop/slid']}", f"{v[f'{way}/drop/soon']:.0f}",
         f"{v[f'{way}/drop/detected']:.0f}",
         f"{v[key]:.0f}" if (key := f"{way}/rise/detected") in v else ""]
        for way in WAYS
    ]  # fmt: skip
    header = ("log", "drives", "false alarms [%]", "drops that matter", "detected within 1 s [%]",
              "detected [%]", "rises detected [%]")  # fmt: skip
    return {"road_friction": Table(header, rows)}


def main() -> int:
    """Run everything; return the exit code."""
    targets, options = Targets("road_friction"), parse("road_friction", __doc__)
    classes, each = (list(CLASSES)[:1], 1) if options.quick else (list(CLASSES), EACH)
    jobs = [(kind, FIRST_SEED + k) for k in range(each) for kind in classes]
    every: dict[str, list[Asked]] = defaultdict(list)
    with ProcessPoolExecutor() as pool:
        for detected in pool.map(case, jobs):
            for way, some in detected.items():
                every[way] += some
    for way in WAYS:
        report(way, every[way], targets)
    return targets.finish(canary, keep=options.record)


if __name__ == "__main__":
    sys.exit(main())
