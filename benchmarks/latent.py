"""Logs without v_y or with a poor one, as a user gives them to `ti.identify`.

    python -m benchmarks.latent [--record] [--only PART ...] [--cars N]

Without v_y side slip is judged by the true v_y, which nobody is shown, rms in degrees over all
samples; frozen force by the true one, in percent of its rms, both axles together, beside that of
the default learning with v_y. Random cars of four classes: half of the drives on banked roads, half
under a driver who brakes and pulls on banked roads too, so that forces are missed for as long as a
corner lasts. Sensors have noise, bias and lateness; the body rolls. Then CarMaker, also with an a_y
that was smoothed, and a real race car whose stiffness is told in two ways. A poor v_y is that of a
satellite receiver (10 Hz, 150 ms late, twice without reception), or it is noisy, or biased: frozen
force on exact signals, with the same bias, over that of a good v_y. Recordings are those of
`recorded_cars`.
"""

import argparse
import logging
import math
import sys
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.signal import butter, filtfilt, lfilter

import tireid as ti
from benchmarks.estimate import FERRARI
from benchmarks.inertial import BRISK, CARMAKER_RUNS, inertial_drive, own_sensors, random_bank
from benchmarks.random_cars import (
    CLASSES,
    DRIVEN,
    FIRST_SEED,
    Beginning,
    RandomCar,
    changing_speed,
    is_good,
    random_car,
    random_steering,
)
from benchmarks.recorded_cars import CARMAKER, DART, DATA
from benchmarks.targets import Targets, keeps
from codegen.arrays import Array
from models.plant import PlantError, PlantRun
from models.recordings import Recording, read_recording
from models.vehicle import GRAVITY, Vehicle
from tireid.run import Run

CARS = 12
PULL = 0.5  # of the grip, with which drivers brake and pull
LEAD = 2.0  # s
DRAWS = 40
SMOOTH = (5.0, 2.0)  # Hz
TOLD = {"66/105": (66e3, 105e3), "150/150": (150e3, 150e3)}  # N/rad
OF_DART = ("ramp_steerneg025", "rubber_12_37_59", "tape_tiles_steer_neg03")
POOR = {"receiver": 0.01, "noise/0.05": 0.05, "noise/0.1": 0.1, "bias/0.3": 0.3}  # [m/s], sedan
RECEIVED, RECEIVED_LATE, LOST = 0.1, 0.15, (1.0, 3.0)  # s
REPEATED = 3  # draws of noise on a recording
PARTS = ("random", "poor", "carmaker", "smoothed", "ferrari", "dart")


class Answer(NamedTuple):
    """Error of side slip, rms [degrees]; share of errors within two standard deviations [%];
    whether the verdict is valid; frozen forces of other drives missed [%].
    """

    rms: float
    within: float
    valid: bool
    force: float
    run: Run


def force_missed(run: Run, exact: Recording, slowest: float) -> float:
    """Return the frozen force that is missed of a drive over its rms, both axles [%]."""
    truth, on = exact.axle_force, exact.v_x > slowest
    assert truth is not None
    missed = (run.freeze().predict(exact) - truth)[on]
    return 100.0 * float(np.sqrt(np.sum(missed**2) / np.sum(truth[on] ** 2)))


def answer(
    shown: Recording, exact: Recording, car: Vehicle, slowest: float, asked: Recording | None = None
) -> Answer:
    """Return how a log without v_y was answered.

    Parameters
    ----------
    shown : the log; its v_y and its forces are taken away.
    exact : the truth.
    slowest : speed from which samples count [m/s].
    asked : another drive of the car; None asks about the same.
    """
    run = ti.identify(replace(shown, v_y=None, axle_force=None), car, check=False)
    told, on = run.recording.needed("v_y"), exact.v_x > slowest
    v_x, true = exact.v_x[on], exact.needed("v_y")[on]
    slip = np.degrees(np.arctan2(told[on], v_x) - np.arctan2(true, v_x))
    sd = run.history.outputs["v_y_sd"].ravel()[on]
    return Answer(
        rms=float(np.sqrt(np.mean(slip**2))),
        within=100.0 * float(np.mean(np.abs(told[on] - true) < 2.0 * sd)),
        valid=run.verdict.valid,
        force=math.nan
        if exact.axle_force is None
        else force_missed(run, exact if asked is None else asked, slowest),
        run=run,
    )


class Drive(NamedTuple):
    """A drive of a random car: as told, as its sensors show it with v_y, and the truth."""

    told: Vehicle
    shown: Recording
    exact: Recording


def banked_drive(kind: str, seed: int) -> Drive:
    """Return a drive at a held speed on a banked road, a_y at the center of gravity."""
    drive = inertial_drive(kind, seed)
    (x, y), r, a_y = drive.position, drive.shown.r, drive.shown.needed("a_y")
    central = a_y - x * np.gradient(r, drive.shown.dt) + y * r**2
    return Drive(drive.told, replace(drive.shown, a_y=central), drive.exact)


def pulled_drive(kind: str, seed: int) -> Drive:
    """Return a drive on a banked road whose driver brakes and pulls.

    Raises
    ------
    PlantError
        Where no car of this seed keeps on the road.
    """
    rng = np.random.default_rng([seed, 7])
    for _ in range(20):
        car = random_car(kind, rng)
        run = _pulled(car, rng)
        if run is not None:
            return _sensed(car, run, rng)
    raise PlantError(f"no {kind} of seed {seed} drives without a spin")


def _pulled(car: RandomCar, rng: np.random.Generator) -> PlantRun | None:
    begin, most = Beginning(lead=LEAD), PULL * min(car.friction) * GRAVITY
    plant = car.pulling(most)
    for _ in range(DRAWS):
        speed = rng.uniform(2.6, 4.5) * car.vehicle.froude_speed
        maneuver = random_steering(car, speed, LEAD, rng)
        if maneuver is None:
            continue
        wanted = changing_speed(_held(speed), car, speed, most, maneuver, rng)
        bank = random_bank(rng, LEAD + DRIVEN)
        try:
            run = plant.simulate(maneuver, speed=wanted, bank=bank, name=car.kind)
        except PlantError:
            continue
        if is_good(car, run, begin, speed):
            return run
    return None


def _held(speed: float) -> Callable[[Array], Array]:
    return lambda t: np.full(t.size, speed)


def _sensed(car: RandomCar, run: PlantRun, rng: np.random.Generator) -> Drive:
    exact, L = run.recording(), car.vehicle.wheelbase
    size, t, n = math.sqrt(L / 2.7), exact.t, len(exact)
    felt = run.a_y * np.cos(run.roll) + GRAVITY * np.sin(run.roll)
    felt = felt + 0.01 * L * rng.normal() * np.gradient(run.r, t)
    bias_a, bias_r, zero = rng.normal(0, 0.15), rng.normal(0, 0.003) / size, rng.normal(0, 0.003)
    late_r, late_a = rng.uniform(-0.003, 0.003, 2)
    shown = replace(
        exact,
        v_x=exact.v_x * (1 + rng.normal(0, 0.005)) + 0.03 * size * rng.normal(size=n),
        v_y=exact.needed("v_y") + 0.03 * size * rng.normal(size=n),
        r=np.interp(t - late_r, t, exact.r) + bias_r + 0.003 / size * rng.normal(size=n),
        a_y=np.interp(t - late_a, t, felt) + bias_a + rng.uniform(0.05, 0.3) * rng.normal(size=n),
        delta_f=exact.delta_f - zero + 5e-4 * rng.normal(size=n),
        axle_force=None,
    )
    return Drive(car.told, shown, exact)


def random_drives(targets: Targets, cars: int) -> None:
    """Judge random cars."""
    kinds, found, ratios, wrong = list(CLASSES), [], [], 0
    for k in range(cars):
        kind = kinds[k % len(kinds)]
        drive = (banked_drive, pulled_drive)[k // len(kinds) % 2](kind, FIRST_SEED + k)
        slowest = 0.5 * drive.told.froude_speed
        one = answer(drive.shown, drive.exact, drive.told, slowest)
        beside = ti.identify(drive.shown, drive.told, check=False)
        with_v_y = force_missed(beside, drive.exact, slowest)
        wrong += one.valid and one.force > 20.0
        ratios.append(one.force / with_v_y)
        found.append(one)
        print(
            f"  {kind:8} {one.rms:.3f} deg, {one.within:3.0f} % within two sd, force "
            f"{one.force:.1f} %, with v_y {with_v_y:.1f} %, {'valid' if one.valid else 'refused'}",
            flush=True,
        )
    rms = [one.rms for one in found]
    within = float(np.mean([one.within for one in found]))
    targets.at_most("side slip, median of cars", float(np.median(rms)), 0.12, "deg", key="cars/rms")
    targets.record("cars/worst", max(rms), "deg")
    targets.record("cars/force", float(np.median([one.force for one in found])), "%")
    targets.record("cars/valid", sum(one.valid for one in found))
    targets.at_least("errors within two sd, at least", within, 90.0, key="cars/within")
    targets.at_most("errors within two sd, at most", within, 98.0)
    ratio = float(np.median(ratios))
    targets.at_most("force over learning with v_y", ratio, 1.2, "-", key="cars/force_over_v_y")
    targets.at_most("valid above 20 %", wrong, 0, "", key="cars/wrong")


def poor_v_y(kind: str, good: Array, exact: Recording, size: float, seed: int) -> Array:
    """Return a v_y that is poor in one way, (n,) [m/s].

    Parameters
    ----------
    kind : of `POOR`.
    good : of a good sensor (n,) [m/s].
    exact : the truth.
    size : root of the wheelbase over 2.7 m.
    """
    rng, much, n = np.random.default_rng([seed, 11]), POOR[kind] * size, len(exact)
    if kind.startswith("bias"):
        return good + much
    true = exact.needed("v_y")
    if kind.startswith("noise"):
        return true + much * rng.normal(size=n)
    told = np.interp(exact.t - RECEIVED_LATE, exact.t, true) + much * rng.normal(size=n)
    at = np.arange(n) // round(RECEIVED / exact.dt) * round(RECEIVED / exact.dt)
    for _ in range(2):
        lost = rng.uniform(LEAD, exact.duration - 5.0) / exact.dt
        inside = (at > lost) & (at < lost + rng.uniform(*LOST) / exact.dt)
        at = np.where(inside, at[np.searchsorted(at, lost, side="right") - 1], at)
    return told[at]


def over_good(
    shown: Recording, exact: Recording, car: Vehicle, slowest: float, asked: Recording, seed: int
) -> dict[str, tuple[float, float, bool]]:
    """Return what is missed with each poor v_y, and with a good one [%], and wrong verdicts.

    A biased sensor is asked at its own speed, since at one speed nobody tells it from a turned one.

    Parameters
    ----------
    shown, exact, asked : as of `answer`, v_y in all of them.
    """
    size, good = math.sqrt(car.wheelbase / 2.7), shown.needed("v_y")
    best, found = ti.identify(shown, car, check=False), {}
    for kind in POOR:
        v_y = poor_v_y(kind, good, exact, size, seed)
        run = ti.identify(replace(shown, v_y=v_y), car, check=False)
        biased = kind.startswith("bias")
        other = exact if biased else asked
        off = POOR[kind] * size * biased
        missed = force_missed(run, replace(other, v_y=other.needed("v_y") + off), slowest)
        with_good = force_missed(best, other, slowest)
        found[kind] = missed, with_good, run.verdict.valid and missed > 20.0
    return found


def poor(targets: Targets, cars: int) -> None:
    """Judge a poor v_y against a good one."""
    kinds, of_cars = list(CLASSES), []
    for k in range(cars):
        drive = (banked_drive, pulled_drive)[k // len(kinds) % 2](
            kinds[k % len(kinds)], FIRST_SEED + k
        )
        slowest = 0.5 * drive.told.froude_speed
        of_cars.append(over_good(drive.shown, drive.exact, drive.told, slowest, drive.exact, k))
    wrong = sum(bad for one in of_cars for *_, bad in one.values())
    for kind in POOR:
        ratio = float(np.median([one[kind][0] / one[kind][1] for one in of_cars]))
        label = f"random cars, {kind}, force over a good v_y, median"
        targets.at_most(label, ratio, 1.3, "-", key=f"poor/cars/{kind}")
    if DATA.is_dir():
        runs = [read_recording(DATA / "carmaker.csv.gz", run=name) for name in CARMAKER_RUNS]
        found = [
            over_good(one, one, CARMAKER, 1.0, other, seed)
            for one, other in (runs, runs[::-1])
            for seed in range(REPEATED)
        ]
        wrong += sum(bad for one in found for *_, bad in one.values())
        for kind in POOR:
            missed, with_good = (float(np.mean([one[kind][k] for one in found])) for k in (0, 1))
            targets.record(f"poor/carmaker/{kind}/missed", missed, "%")
            ratio, label = missed / with_good, f"CarMaker, {kind}, force over a good v_y, of means"
            targets.at_most(label, ratio, 1.3, "-", key=f"poor/carmaker/{kind}")
    targets.at_most("poor v_y, valid above 20 %", wrong, 0, "", key="poor/wrong")


def carmaker(targets: Targets) -> None:
    """Judge both runs of CarMaker, frozen force on the other."""
    runs = [read_recording(DATA / "carmaker.csv.gz", run=name) for name in CARMAKER_RUNS]
    force, beside = [], []
    for name, run, other, limit in zip(CARMAKER_RUNS, runs, runs[::-1], (0.15, 0.05), strict=True):
        one = answer(run, run, CARMAKER, 1.0, other)
        with_v_y = force_missed(ti.identify(run, CARMAKER, check=False), other, 1.0)
        force.append(one.force)
        beside.append(with_v_y)
        targets.at_most(f"{name}, side slip", one.rms, limit, "deg", key=f"carmaker/{name}/rms")
        targets.record(f"carmaker/{name}/within", one.within, "%")
        targets.record(f"carmaker/{name}/force", one.force, "%")
        targets.record(f"carmaker/{name}/force_with_v_y", with_v_y, "%")
    ratio = sum(force) / sum(beside)
    targets.at_most("force over learning with v_y", ratio, 1.2, "-", key="carmaker/over_v_y")


def smoothed(targets: Targets) -> None:
    """Judge CarMaker's harder run with an a_y behind low passes: without lateness, and causal."""
    run = read_recording(DATA / "carmaker.csv.gz", run=CARMAKER_RUNS[0])
    plain = answer(run, run, CARMAKER, 1.0).rms
    for hertz in SMOOTH:
        taps = butter(2, 2.0 * hertz * run.dt)
        for way, pass_, limit in (("zero_phase", filtfilt, 1.3), ("causal", lfilter, 1.6)):
            shown = replace(run, a_y=pass_(*taps, run.needed("a_y")))
            one = answer(shown, run, CARMAKER, 1.0)
            label = f"a_y below {hertz:g} Hz, {way}, over a_y as it is"
            key = f"smoothed/{hertz:g}/{way}"
            targets.at_most(label, one.rms / plain, limit, "-", key=key)
            targets.record(f"{key}/valid", int(one.valid))


def ferrari(targets: Targets) -> None:
    """Judge the real race car from the beginning of its file, whatever stiffness is told."""
    run = read_recording(DATA / "ferrari.csv.gz")
    for name, (front, rear) in TOLD.items():
        car = replace(FERRARI, cornering_stiffness_front=front, cornering_stiffness_rear=rear)
        one = answer(run, run, car, 3.0)
        limit = 0.32 if name == "66/105" else 0.40
        label = f"race car, told {name} kN/rad, side slip"
        targets.at_most(label, one.rms, limit, "deg", key=f"ferrari/{name}/rms")
        if name == "66/105":
            targets.at_least("errors within two sd", one.within, 90.0, key="ferrari/within")
            targets.record("ferrari/valid", int(one.valid))


def dart(targets: Targets) -> None:
    """Record how the real 1:10 car with its own sensors is answered; Vicon is the truth."""
    runs = own_sensors()
    found = {name: answer(*runs[name], DART, BRISK) for name in OF_DART}
    for name, one in found.items():
        targets.record(f"dart/{name}/rms", one.rms, "deg")
        targets.record(f"dart/{name}/within", one.within, "%")
        targets.record(f"dart/{name}/force", one.force, "%")
        targets.record(f"dart/{name}/valid", int(one.valid))
    targets.record("dart/rms", float(np.median([one.rms for one in found.values()])), "deg")
    wrong = sum(one.valid and one.force > 20.0 for one in found.values())
    targets.at_most("1:10 car, valid above 20 %", wrong, 0, "", key="dart/wrong")


def main() -> int:
    """Print what was measured; return the exit code."""
    keep = keeps()
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cars", type=int, default=CARS, help="random cars (default: %(default)s)")
    parser.add_argument("--only", nargs="+", choices=PARTS, default=PARTS, metavar="PART")
    options = parser.parse_args()
    logging.getLogger("tireid").setLevel(logging.ERROR)
    targets, there = Targets("latent"), DATA.is_dir()
    if "random" in options.only:
        random_drives(targets, options.cars)
    if "poor" in options.only:
        poor(targets, options.cars)
    for name, part in (
        *(("carmaker", carmaker), ("smoothed", smoothed)),
        *(("ferrari", ferrari), ("dart", dart)),
    ):
        if name in options.only and there:
            part(targets)
    if not there:
        print(f"no recordings in {DATA}: only random cars are judged")
    whole = options.cars == CARS and there and tuple(options.only) == PARTS
    return targets.finish(keep=keep and whole)


if __name__ == "__main__":
    sys.exit(main())
