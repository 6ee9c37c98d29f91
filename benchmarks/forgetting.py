"""What ten hours of driving leave of the paper's network, by what keeps its weights.

    python -m benchmarks.forgetting [CARS] [--record]

Every hour is ten drives of six minutes on the built-in plant, with sensor noise; each is identified
as `tireid identify --weights` does it, beginning with the weights that the drive before left. The
weights are kept by the paper's leakage (`tireid identify --paper`), or as `tireid check --tune
--keep` writes it: by a leakage with a dead zone, or by a projection in its place. After 0.1, 1, 3
and 10 hours the frozen network is asked about a lane change and a slalom that it never drove.
Ordinary: of the minutes three in four are calm and one is brisk, nothing is known at first. Calm:
six brisk minutes are learnt, then all are calm. An hour is simulated, and driven again with other
noise. The sedan has ten hours, CARS random cars have three: they judge the default of `--keep`.
"""

import sys
import time
from collections.abc import Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from benchmarks.targets import Targets, keeps
from codegen.arrays import Array
from identifier.driving import natural_driving
from identifier.methods import REFERENCE, make_method
from identifier.paper.design import PaperIdentifier, design_for, with_keeping
from identifier.paper.network import NetworkModel
from identifier.run import identify
from identifier.stability.gain_design import DEFAULT_KEEPING, KEEPINGS
from models.friction import Friction
from models.maneuvers import RandomSteer
from models.plant import Plant
from models.recordings import Recording
from models.vehicle import Vehicle, sedan
from tireid.commands.demo_story import DRIVES, RATE_LIMIT, SENSORS

SEED, CARS, PROCESSES = 11, 6, 2
MINUTES, PER_HOUR = 6, 10  # of a drive; drives of an hour
CALM_SHARE = 0.75  # of the minutes of ordinary driving
CALM, BRISK = (0.2, 1.0), (2.0, 4.5)  # largest steering of a minute [deg], least and most
SLOW, QUICK = (0.1, 0.3), (0.3, 0.6)  # fastest swing of a minute [Hz], calm and brisk
SPEEDS = (17.0, 23.0)  # of a drive [m/s]
AFTER = {"0.1": 1, "1": 10, "3": 30, "10": 100}  # hours, and drives until then
LAST = {True: "10", False: "3"}  # hours of the sedan, and of the random cars
SCENARIOS = ("ordinary", "calm")
HELD_OUT = ("lane_change", "slalom_20")


@dataclass(frozen=True, slots=True, kw_only=True)
class Minutes:
    """A maneuver of random steering, another one each minute.

    Parameters
    ----------
    parts : steering of each minute.
    """

    parts: tuple[RandomSteer, ...]

    @property
    def duration(self) -> float:
        """Length [s]."""
        return 60.0 * len(self.parts)

    def steering(self, t: Array) -> Array:
        """Commanded [δ_f, δ_r] [rad], (n, 2); straight ahead between the minutes.

        Parameters
        ----------
        t : times [s], (n,).
        """
        angles = np.zeros((len(t), 2))
        for k, part in enumerate(self.parts):
            now = t - 60.0 * k
            inside = (now >= 0.0) & (now < 60.0)
            fade = np.clip(np.minimum(now, 60.0 - now) / 2.0, 0.0, 1.0)[inside]
            angles[inside] = fade[:, None] * part.steering(now[inside])
        return angles


def drive(plant: Plant, rng: np.random.Generator, calm_share: float, mu: float) -> Recording:
    """Return a drive of six minutes, measured exactly.

    Parameters
    ----------
    plant : the car.
    rng : source of steering and speed.
    calm_share : of the minutes.
    mu : friction of the road [-].
    """
    parts = []
    for _ in range(MINUTES):
        calm = rng.random() < calm_share
        parts.append(
            RandomSteer(
                amplitude=np.radians(rng.uniform(*(CALM if calm else BRISK))),
                frequency=rng.uniform(*(SLOW if calm else QUICK)),
                seed=int(rng.integers(1 << 30)),
                onset=0.0,
                rate_limit=RATE_LIMIT,
                duration=60.0,
            )
        )
    maneuver, speed = Minutes(parts=tuple(parts)), rng.uniform(*SPEEDS)
    road = Friction(scale=mu)
    return plant.simulate(maneuver, speed=speed, friction=road).recording()


def hours(
    plant: Plant, rng: np.random.Generator, scenario: str, *, mu: float, drives: int
) -> Iterator[Recording]:
    """Yield drives as the sensors see them, in the calm case a brisk one before.

    Parameters
    ----------
    plant : the car.
    rng : source of all that is random.
    scenario : one of `SCENARIOS`.
    mu : friction of the road [-].
    drives : how many; after an hour they are driven again, with other noise.
    """
    if scenario == "calm":
        yield SENSORS.apply(drive(plant, rng, 0.0, mu), rng)
    known: list[Recording] = []
    for k in range(drives):
        if k < PER_HOUR:
            known.append(drive(plant, rng, 1.0 if scenario == "calm" else CALM_SHARE, mu))
        yield SENSORS.apply(known[k % PER_HOUR], rng)


class After(NamedTuple):
    """What is left after some hours: error of the frozen network [%], |W| [U] and |V| [-]."""

    error: float
    W: float
    V: float


def left_of(model: NetworkModel, asked: list[Recording]) -> After:
    """Return what a frozen network misses of the force on maneuvers that it never drove.

    Parameters
    ----------
    model : the network.
    asked : the maneuvers, with true forces.
    """
    missed, force = 0.0, 0.0
    for recording in asked:
        assert recording.axle_force is not None
        missed += float(np.mean((model.predict(recording) - recording.axle_force) ** 2))
        force += float(np.mean(recording.axle_force**2))
    W, V = (float(np.linalg.norm(weights)) for weights in model.weights)
    return After(100.0 * (missed / force) ** 0.5, W, V)


def designs(vehicle: Vehicle) -> dict[str, PaperIdentifier]:
    """Return the design of each keeping: that of --paper, and those of `tireid check --tune`.

    Parameters
    ----------
    vehicle : the car.
    """
    paper = make_method(REFERENCE, vehicle)
    found = design_for(vehicle, natural_driving(vehicle))
    assert isinstance(paper, PaperIdentifier)
    known = found.operation(vehicle)
    return {"leakage": paper} | {
        name: with_keeping(found, known, name) for name in KEEPINGS if name != "leakage"
    }


def left_after(
    vehicle: Vehicle, rng: np.random.Generator, scenario: str, *, mu: float, last: str
) -> Mapping[str, Mapping[str, After]]:
    """Return by keeping and hours what is left of the network; "learnt": before the calm hours.

    Parameters
    ----------
    vehicle : the car.
    rng : source of all that is random.
    scenario : one of `SCENARIOS`.
    mu : friction of the road [-].
    last : hours of driving, one of `AFTER`.
    """
    plant, chosen = Plant(vehicle), designs(vehicle)
    asked = [
        plant.simulate(DRIVES[name][0], speed=DRIVES[name][1], friction=Friction(scale=mu))
        for name in HELD_OUT
    ]
    exact = [run.recording() for run in asked]
    models: dict[str, NetworkModel] = {}
    found: dict[str, dict[str, After]] = {name: {} for name in chosen}
    names = {drives: hour for hour, drives in AFTER.items()}
    if scenario == "calm":
        names[0] = "learnt"
    first = 0 if scenario == "calm" else 1
    recordings = hours(plant, rng, scenario, mu=mu, drives=AFTER[last])
    for done, recording in enumerate(recordings, start=first):
        for name, design in chosen.items():
            history = identify(recording, vehicle, design, models.get(name))
            model = history.freeze(float(recording.t[-1]))
            assert isinstance(model, NetworkModel)
            models[name] = model
            if done in names:
                found[name][names[done]] = left_of(model, exact)
    linear = models["leakage"]
    nothing = linear.weights._replace(W=np.zeros_like(linear.weights.W))
    found["linear"] = {last: left_of(replace(linear, weights=nothing), exact)}
    return found


def random_car(rng: np.random.Generator) -> tuple[Vehicle, float]:
    """Return a car about the sedan, told with a stiffness that is wrong, and its road's friction.

    Parameters
    ----------
    rng : source of randomness.
    """
    base = sedan()
    mass, wheelbase = rng.uniform(1100.0, 1900.0), rng.uniform(2.4, 3.0)
    front = rng.uniform(0.40, 0.48)  # share of the wheelbase before the center of gravity
    l_f, l_r = front * wheelbase, (1.0 - front) * wheelbase
    loads = np.array([l_r, l_f]) / wheelbase * mass / base.mass
    loads /= np.array([base.l_r, base.l_f]) / base.wheelbase
    wrong = rng.uniform(0.85, 1.15, 2)
    car = replace(
        base,
        name="random car",
        mass=mass,
        yaw_inertia=mass * l_f * l_r * rng.uniform(0.9, 1.1),
        l_f=l_f,
        l_r=l_r,
        cornering_stiffness_front=base.cornering_stiffness_front * loads[0] * wrong[0],
        cornering_stiffness_rear=base.cornering_stiffness_rear * loads[1] * wrong[1],
    )
    return car, float(rng.uniform(0.7, 1.1))


Job = tuple[str, int]  # scenario, and the number of a random car, or -1 for the sedan
Found = Mapping[str, Mapping[str, After]]


def run(job: Job) -> Found:
    """Return what is left on one car; all that is random follows from the job.

    Parameters
    ----------
    job : which.
    """
    scenario, number = job
    rng = np.random.default_rng([SEED, SCENARIOS.index(scenario), number + 1])
    car, mu = (sedan(), 1.0) if number < 0 else random_car(rng)
    return left_after(car, rng, scenario, mu=mu, last=LAST[number < 0])


def of_the_sedan(targets: Targets, scenario: str, found: Found) -> None:
    """Print and record ten hours of the sedan; judge what the default of `--keep` keeps.

    Parameters
    ----------
    targets : where the numbers go.
    scenario : one of `SCENARIOS`.
    found : by keeping and hours.
    """
    print(f"sedan, {scenario}: error of the frozen network [%], |W| [kN], |V| after hours")
    for name, rows in found.items():
        told = "  ".join(f"{h}: {a.error:.1f} {a.W:.2f} {a.V:.2f}" for h, a in rows.items())
        print(f"  {name:12}{told}")
        for hour, left in rows.items():
            where = f"sedan/{scenario}/{name}/{hour}"
            targets.record(f"{where}/error", left.error, "%")
            if name != "linear":
                targets.record(f"{where}/W", left.W, "kN")
                targets.record(f"{where}/V", left.V)
    nothing, rows = found["linear"]["10"].error, found[DEFAULT_KEEPING]
    targets.at_most(
        f"{scenario}: error after 10 h over that of the linear tire, {DEFAULT_KEEPING}",
        rows["10"].error / nothing,
        0.75,
        "",
        f"sedan/{scenario}/over_linear",
    )


def of_random_cars(targets: Targets, scenario: str, found: list[Found]) -> None:
    """Print and record what is left on random cars; judge the default of `--keep`.

    Parameters
    ----------
    targets : where the numbers go.
    scenario : one of `SCENARIOS`.
    found : of each car.
    """
    last = LAST[False]
    errors = {name: [car[name][last].error for car in found] for name in found[0]}
    print(f"{len(found)} random cars, {scenario}: error after {last} h [%]")
    for name, values in errors.items():
        print(f"  {name:12}" + "".join(f"{value:6.1f}" for value in values))
        targets.record(f"cars/{scenario}/{name}/median", float(np.median(values)), "%")
        targets.record(f"cars/{scenario}/{name}/largest", max(values), "%")
    best = min(float(np.median(errors[name])) for name in KEEPINGS)
    targets.at_most(
        f"{scenario}: median error of {DEFAULT_KEEPING} over that of the best",
        float(np.median(errors[DEFAULT_KEEPING])) / best,
        1.05,
        "",
        f"cars/{scenario}/over_best",
    )


def main(cars: int = CARS, *, keep: bool = False) -> int:
    """Print the tables; 1 if a target was missed.

    Parameters
    ----------
    cars : random cars.
    keep : record what was measured.
    """
    begin, targets = time.perf_counter(), Targets("forgetting")
    targets.record("cars", cars)
    jobs = [(scenario, number) for number in range(-1, cars) for scenario in SCENARIOS]
    with ProcessPoolExecutor(PROCESSES) as pool:
        found = dict(zip(jobs, pool.map(run, jobs), strict=True))
    for scenario in SCENARIOS:
        of_the_sedan(targets, scenario, found[scenario, -1])
        if cars:
            of_random_cars(targets, scenario, [found[scenario, k] for k in range(cars)])
    targets.record("seconds", time.perf_counter() - begin, "s")
    return targets.finish(keep=keep)


if __name__ == "__main__":
    KEEP = keeps()
    sys.exit(main(*(int(word) for word in sys.argv[1:]), keep=KEEP))
