"""Tires and side slip without a sensor of lateral velocity: how far, how sure, how honest.

    python -m benchmarks.inertial [--record] [--cars N]

Random cars of four classes on banked roads, with what inertial sensors add: noise, bias of a_y and
r, roll of the body, an accelerometer beside the center of gravity, a delay that nobody knows, a
speed that is off; then recorded cars, where the recordings are. v_y only scores. Learning with v_y
is what the axle identifier makes of the log with a good sensor of it. Numbers of the identifier
were chosen on seeds below `FIRST_SEED`; this measures on seeds from there on.
"""

import argparse
import math
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.random_cars import (
    CLASSES,
    DRIVEN,
    FIRST_SEED,
    LEAD,
    Beginning,
    RandomCar,
    is_good,
    random_car,
    random_steering,
)
from benchmarks.recorded_cars import CARMAKER, DART, DATA
from benchmarks.targets import Targets, keeps
from codegen.arrays import Array
from identifier.axle import AxleIdentifier
from identifier.inertial import InertialIdentifier
from identifier.run import History, identify, learn
from identifier.tire_model import TireModel
from models.plant import PlantError
from models.recordings import Recording, read_recording
from models.vehicle import GRAVITY, Vehicle

CARS = 200
DRAWS = 60  # of a drive of one car, before another is drawn
BANKS = (0.0, 2.0, 6.0)  # degrees
SIGMAS = 2.0
LATE = 6  # samples by which fresh numbers of the 1:10 car's own sensors are late
BRISK = 1.0  # m/s, above which its side slip is judged
CARMAKER_RUNS = ("slalom1_14_5ms", "experiment2_40kmh")


class Drive(NamedTuple):
    """A drive: the car as told, what its sensors show, the truth, where inertial ones sit [m].

    shown : with a good sensor of v_y.
    """

    kind: str
    told: Vehicle
    shown: Recording
    exact: Recording
    position: tuple[float, float]


def random_bank(rng: np.random.Generator, duration: float) -> Callable[[Array], Array]:
    """Return the angle of a road over time [rad]: it changes every 4 to 9 seconds, smoothly.

    Parameters
    ----------
    rng : source of randomness.
    duration : of the drive [s].
    """
    steepest = math.radians(rng.choice(BANKS, p=(0.2, 0.4, 0.4)))
    step = rng.uniform(4.0, 9.0)
    heights = rng.uniform(-steepest, steepest, math.ceil(duration / step) + 2)

    def bank(t: Array) -> Array:
        k = np.clip((t / step).astype(np.int64), 0, heights.size - 2)
        part = 0.5 - 0.5 * np.cos(np.pi * (t / step - k))
        return np.asarray(heights[k] + (heights[k + 1] - heights[k]) * part)

    return bank


def inertial_drive(kind: str, seed: int) -> Drive:
    """Return a random drive of a random car, as inertial sensors show it.

    Parameters
    ----------
    kind : one of `CLASSES`.
    seed : of everything.

    Raises
    ------
    PlantError
        Where no car of this seed keeps on the road.
    """
    rng = np.random.default_rng(seed)
    for _ in range(20):
        car = random_car(kind, rng)
        found = _driven(car, rng)
        if found is not None:
            return found
    raise PlantError(f"no {kind} of seed {seed} drives without a spin")


def _driven(car: RandomCar, rng: np.random.Generator) -> Drive | None:
    vehicle, begin = car.vehicle, Beginning(lead=LEAD)
    for _ in range(DRAWS):
        speed = rng.uniform(2.6, 4.5) * vehicle.froude_speed
        maneuver = random_steering(car, speed, begin.lead, rng)
        if maneuver is None:
            continue
        bank = random_bank(rng, LEAD + DRIVEN)
        try:
            run = car.plant.simulate(maneuver, speed=speed, bank=bank, name=car.kind)
        except PlantError:
            continue
        if is_good(car, run, begin, speed):
            break
    else:
        return None
    exact, L = run.recording(), vehicle.wheelbase
    size = math.sqrt(L / 2.7)
    t, n = exact.t, len(exact)
    x, y = rng.uniform(-0.15, 0.15) * L, rng.uniform(-0.05, 0.05) * L
    felt = run.a_y * np.cos(run.roll) + GRAVITY * np.sin(run.roll)
    felt = felt + x * np.gradient(run.r, t) - y * run.r**2
    bias_a, bias_r, zero = rng.normal(0, 0.15), rng.normal(0, 0.003) / size, rng.normal(0, 0.003)
    late_r, late_a = rng.uniform(-0.005, 0.005, 2)
    shown = replace(
        exact,
        v_x=exact.v_x * (1 + rng.normal(0, 0.005)) + 0.03 * size * rng.normal(size=n),
        v_y=exact.needed("v_y") + 0.03 * size * rng.normal(size=n),  # for learning with v_y alone
        r=np.interp(t - late_r, t, exact.r) + bias_r + 0.003 / size * rng.normal(size=n),
        a_y=np.interp(t - late_a, t, felt) + bias_a + rng.uniform(0.05, 0.3) * rng.normal(size=n),
        delta_f=exact.delta_f - zero + 5e-4 * rng.normal(size=n),
        axle_force=None,
    )
    told = (x + 0.01 * L * rng.normal(), y + 0.01 * L * rng.normal())
    return Drive(car.kind, car.told, shown, exact, told)


@dataclass(frozen=True, slots=True, kw_only=True)
class SideSlip:
    """How v_y was told, where the filter ran.

    Parameters
    ----------
    rms, true, largest : error, side slip itself, largest error [degrees].
    within : share of errors within two standard deviations [-].
    observed : share of samples that are told for observed [-].
    right : share of those within twice what that promises [-].
    """

    rms: float
    true: float
    largest: float
    within: float
    observed: float
    right: float


def side_slip(
    history: History, exact: Recording, where: NDArray[np.bool_] | None = None, slowest: float = 0.3
) -> SideSlip:
    """Return how well v_y was told.

    Parameters
    ----------
    history : of the inertial identifier.
    exact : the truth.
    where : samples that count, (n,); None counts all in which the filter ran.
    slowest : speed that side slip is divided by at least [m/s].
    """
    design = history.design
    assert isinstance(design, InertialIdentifier)
    runs = history.state["running"].reshape(-1, 3)[1:, 0] > 0.5
    on = runs if where is None else runs & where
    v_x = np.maximum(exact.v_x, slowest)[on]
    error = (history.outputs["v_y"].ravel() - exact.needed("v_y"))[on]
    sd = history.outputs["v_y_sd"].ravel()[on]
    seen = history.outputs["side_slip_observable"].ravel()[on] > 0.5
    beta = error / v_x
    promised = SIGMAS * design.trust.observable
    return SideSlip(
        rms=float(np.degrees(np.sqrt(np.mean(beta**2)))),
        true=float(np.degrees(np.std(exact.needed("v_y")[on] / v_x))),
        largest=float(np.degrees(np.abs(beta).max())),
        within=float(np.mean(np.abs(error) < SIGMAS * sd)),
        observed=float(seen.mean()),
        right=float(np.mean(np.abs(beta[seen]) < promised)) if seen.any() else 1.0,
    )


def without_v_y(
    recording: Recording, vehicle: Vehicle, position: tuple[float, float], *, roll: bool = True
) -> History:
    """Return the run of the inertial identifier, to which v_y is not even given.

    Parameters
    ----------
    recording : the log; its v_y is put to zero.
    vehicle : the car as told.
    position : of the accelerometer [m].
    roll : whether the accelerometer rolls with the body; else a_y is in the plane of the road.
    """
    design = InertialIdentifier.for_vehicle(vehicle, dt=recording.dt)
    design = replace(design, sensor_position=position)
    if not roll:
        design = replace(design, beliefs=replace(design.beliefs, roll=1e-6, sd_roll=0.002))
    return identify(replace(recording, v_y=np.zeros(len(recording))), vehicle, design)


def frozen_error(model: TireModel, exact: Recording) -> float:
    """Return the mean over both axles of the error of frozen forces, over their rms [-].

    Parameters
    ----------
    model : what was learnt.
    exact : where it is asked.
    """
    predicted, truth = model.predict(exact), exact.axle_force
    assert truth is not None
    return float(np.sqrt(((predicted - truth) ** 2).mean(0) / (truth**2).mean(0)).mean())


def _with_v_y(drive: Drive) -> TireModel:
    return learn(drive.shown, drive.told, AxleIdentifier.for_vehicle(drive.told))


def random_drives(targets: Targets, cars: int) -> None:
    """Drive random cars without v_y.

    Parameters
    ----------
    targets : collects what is missed.
    cars : how many, a multiple of the classes.
    """
    print(f"{cars} random cars: side slip [deg], errors within two sigma, frozen force, by class")
    rows: dict[str, list[tuple[SideSlip, float]]] = {kind: [] for kind in CLASSES}
    told: dict[str, list[tuple[float, float]]] = {kind: [] for kind in CLASSES}
    for k in range(cars // len(CLASSES)):
        for j, kind in enumerate(CLASSES):
            drive = inertial_drive(kind, FIRST_SEED + len(CLASSES) * k + j)
            history = without_v_y(drive.shown, drive.told, drive.position)
            error, slip = (
                frozen_error(history.freeze(), drive.exact),
                side_slip(history, drive.exact),
            )
            rows[kind].append((slip, error / frozen_error(_with_v_y(drive), drive.exact)))
            told[kind].append((slip.rms, 100.0 * error))
    for kind, found in rows.items():
        typical = [float(np.median([getattr(one, name) for one, _ in found])) for name in SHOWN]
        cells = "  ".join(f"{name} {value:.3f}" for name, value in zip(SHOWN, typical, strict=True))
        print(f"  {kind:8} {cells}  force {np.median([ratio for _, ratio in found]):.2f}")
        for name, value in zip(SHOWN, typical, strict=True):
            targets.record(f"cars/{kind}/{name}", value)
    every = [one for found in rows.values() for one in found]
    within = 100.0 * float(np.mean([one.within for one, _ in every]))
    ratios = np.array([ratio for _, ratio in every])
    share = float(np.mean([one.rms / one.true for one, _ in every]))
    targets.record("cars/rms_over_true", share)
    targets.record("cars/least_within", 100.0 * min(one.within for one, _ in every), "%")
    targets.record("cars/observed", 100.0 * float(np.mean([one.observed for one, _ in every])), "%")
    targets.at_least("errors within two sigma, at least", within, 93.0, key="cars/within")
    targets.at_most("errors within two sigma, at most", within, 97.0)
    right = 100.0 * float(np.mean([one.right for one, _ in every]))
    targets.at_least("told for observed, and right", right, 95.0, key="cars/right")
    largest = max(one.largest for one, _ in every)
    targets.at_most("no drive diverges: largest error", largest, 20.0, "deg", key="cars/largest")
    median, ninth = float(np.median(ratios)), float(np.quantile(ratios, 0.9))
    targets.at_most("force over with v_y, median", median, 1.3, "-", key="cars/force_median")
    targets.at_most("force over with v_y, 90 of 100", ninth, 1.8, "-", key="cars/force_90")
    for kind, both in told.items():
        rms, force = map(float, np.median(both, axis=0))
        targets.record(f"sets/none/{kind}/rms", rms, "deg")
        targets.record(f"sets/none/{kind}/force", force, "%")


SHOWN = ("rms", "true", "within", "observed")


def carmaker(targets: Targets) -> None:
    """Judge both runs of CarMaker, whose a_y is in the plane of the road.

    Parameters
    ----------
    targets : collects what is missed.
    """
    print("CarMaker: side slip from the first sample, frozen force over learning with v_y")
    runs = [read_recording(DATA / "carmaker.csv.gz", run=run) for run in CARMAKER_RUNS]
    histories = [without_v_y(run, CARMAKER, (0.0, 0.0), roll=False) for run in runs]
    for name, run, history, limit in zip(CARMAKER_RUNS, runs, histories, (0.10, 0.03), strict=True):
        told = side_slip(history, run)
        label = f"{name}, {told.true:.2f} deg, {100 * told.within:.0f} % within two sigma"
        targets.at_most(label, told.rms, limit, "deg", key=f"carmaker/{name}/rms")
        targets.record(f"carmaker/{name}/within", 100.0 * told.within, "%")
    models = [history.freeze() for history in histories]
    given = [learn(run, CARMAKER, AxleIdentifier.for_vehicle(CARMAKER)) for run in runs]
    for i, learnt in enumerate(CARMAKER_RUNS):
        for j, asked in enumerate(CARMAKER_RUNS):
            ratio = frozen_error(models[i], runs[j]) / frozen_error(given[i], runs[j])
            key = f"carmaker/{learnt}/{asked}/force"
            targets.at_most(f"learnt on {learnt}, asked {asked}", ratio, 1.3, "-", key=key)


def own_sensors() -> dict[str, tuple[Recording, Recording]]:
    """Return what the 1:10 car's own sensors and Vicon show of each run, by its name."""
    table = np.genfromtxt(
        DATA / "dart_imu.csv.gz", delimiter=",", names=True, dtype=None, encoding="utf-8"
    )
    found = {}
    for name in dict.fromkeys(table["run"]):
        run = table[table["run"] == name]
        late = {key: np.append(run[key][LATE:], np.full(LATE, run[key][-1])) for key in OWN}
        vicon = Recording(
            name=str(name),
            t=run["t"] - run["t"][0],
            v_x=run["vx"],
            v_y=run["vy"],
            r=run["r"],
            delta_f=run["delta_f"],
            delta_r=np.zeros(len(run)),
            a_y=run["ay"],
            axle_force=np.column_stack((run["Fyf_inv"], run["Fyr_inv"])),
        )
        own = replace(
            vicon, v_x=late["vx_encoder"], r=late["r_imu"], a_y=late["ay_imu"], axle_force=None
        )
        found[str(name)] = (own, vicon)
    return found


OWN = ("vx_encoder", "r_imu", "ay_imu")


def dart(targets: Targets) -> None:
    """Judge the real 1:10 car with its own sensors, which learn alone.

    Parameters
    ----------
    targets : collects what is missed.
    """
    print("Real 1:10 car, encoder, IMU and steering: side slip above 1 m/s, frozen on other runs")
    runs = own_sensors()
    ratios = []
    learnt: dict[str, dict[str, TireModel]] = {way: {} for way in WAYS}
    for name, (own, vicon) in runs.items():
        history = without_v_y(own, DART, (0.0, 0.0))
        told = side_slip(history, vicon, vicon.v_x > BRISK)
        given = learn(vicon, DART, AxleIdentifier.for_vehicle(DART))
        models = (history.freeze(), given)
        for way, model in zip(WAYS, models, strict=True):
            learnt[way][name] = model
        without, with_v_y = (
            float(np.mean([frozen_error(m, v) for other, (_, v) in runs.items() if other != name]))
            for m in models
        )
        ratios.append(without / with_v_y)
        print(
            f"  {name:24} {told.rms:.2f} of {told.true:.2f} deg, {100 * told.within:.0f} % within "
            f"two sigma, frozen {100 * without:.0f} %, with Vicon {100 * with_v_y:.0f} %"
        )
        for key, value, unit in (
            ("rms", told.rms, "deg"),
            ("true", told.true, "deg"),
            ("within", 100.0 * told.within, "%"),
            ("force", 100.0 * without, "%"),
            ("force_with_vicon", 100.0 * with_v_y, "%"),
        ):
            targets.record(f"dart/{name}/{key}", value, unit)
    median = float(np.median(ratios))
    targets.at_most(
        "force over learning from Vicon, median of runs", median, 1.3, "-", key="dart/force"
    )
    handed_on(targets, runs, learnt)


WAYS = ("own sensors", "Vicon, by the axle identifier")


def handed_on(
    targets: Targets,
    runs: Mapping[str, tuple[Recording, Recording]],
    learnt: Mapping[str, Mapping[str, TireModel]],
) -> None:
    """Tell side slip on every run, begun with what was learnt on each other one.

    Parameters
    ----------
    targets : collects what is missed.
    runs : what own sensors and Vicon show, by run.
    learnt : models by way of learning, `WAYS`, the first without v_y, and by run.
    """
    design = InertialIdentifier.for_vehicle(DART)
    for name, (own, vicon) in runs.items():
        fast, rms = vicon.v_x > BRISK, {}
        for way, models in learnt.items():
            errors = [
                side_slip(identify(own, DART, design, start=model), vicon, fast).rms
                for other, model in models.items()
                if other != name
            ]
            rms[way] = float(np.mean(errors))
            targets.record(f"dart/{name}/begun/{way}", rms[way], "deg")
        ours, given = rms.values()
        label = f"{name}: side slip over that of tires learnt from Vicon"
        targets.at_most(label, ours / given, 1.5, "-", key=f"dart/{name}/side_slip")


def main() -> int:
    """Print every table; return the exit code."""
    keep = keeps()
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cars", type=int, default=CARS, help="random cars (default: %(default)s)")
    options = parser.parse_args()
    targets = Targets("inertial")
    random_drives(targets, options.cars)
    if DATA.is_dir():
        carmaker(targets)
        dart(targets)
    else:
        print(f"recorded cars: skipped, there is no {DATA}")
    return targets.finish(keep=keep and options.cars == CARS)


if __name__ == "__main__":
    sys.exit(main())
