"""What a planned maneuver teaches beside a slalom and random steering, on cars that nobody knows.

    python -m benchmarks.plan [--each N] [--first SEED] [--record]

Random cars of four classes; the planner is told the car with stiffnesses off by 0.7 to 1.4, and a
friction that is typical of the class. A slalom of 24 s at the same share of the grip (and one at 70
% of it) is driven first, from the same knowledge; the plan has a third of its time and half of its
area, as planned, margins counted in both. Random steering has the time of the plan and all the room
that it wants. Each is driven on the double-track plant, held on its course, with good sensors; the
default identifier learns, and what it has frozen at the end is asked about another drive, at random
up to the limit. Constants of the planner were chosen on seeds 100 to 109.
"""

import argparse
import math
import sys
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from typing import NamedTuple

import numpy as np

import tireid as ti
from benchmarks.answers import blind, drawn, force_error
from benchmarks.random_cars import CLASSES, FIRST_SEED, RandomCar
from benchmarks.targets import Targets, keeps, show
from codegen.arrays import Array
from identifier.plan import PlanError, hold_of, rehearse
from identifier.plan.chosen import CHOSEN as PLAN_CHOSEN
from identifier.plan.motion import steps_of
from identifier.plan.plan import extent, free_motion, hardest, random_of, slalom_of
from identifier.plan.rehearsal import Course
from identifier.plan.search import Space, body_of, edge_distance
from identifier.plan.tires import PlausibleTires
from models.maneuvers import Maneuver
from models.recordings import Recording
from tireid.planning import MARGIN, MAX_ANGLE, RATE, SHARE

EACH, PROCESSES = 6, 2  # cars of a class
TIME, TIMES, AREA = 8.0, 3.0, 0.5  # s of the plan; of the slalom over it; area of the plan over its
GENTLER = 0.7  # share of the grip of another slalom
FRICTION = {"compact": 0.9, "sedan": 0.9, "race": 1.5, "tenth": 0.7}  # typical of the class
SPEEDS = (2.8, 4.2)  # sqrt(g L)


class Taught(NamedTuple):
    """What maneuvers taught a car: errors of frozen forces [% of rms force], mean of both axles.

    plan, slalom, gentle, random : at the end of each; slalom_then : the slalom at the time of the
    plan.   area : of the plan over that of the slalom [-].   outside : how far the car left the
    area of the plan, negative inside [m].   reaches : when the slalom was as good as the plan
    [times of the plan], inf where never.   expected : error over the grip that was promised [%].
    """

    kind: str
    plan: float
    slalom: float
    slalom_then: float
    gentle: float
    random: float
    area: float
    outside: float
    reaches: float
    expected: float


class Driven(NamedTuple):
    """A log with what it taught: errors at times since the maneuver began, and the way (n, 3)."""

    errors: dict[float, float]
    way: Array


def driven(
    car: RandomCar,
    tires: PlausibleTires,
    speed: float,
    steering: Maneuver,
    course: Course,
    asked: Recording,
    times: list[float],
    seed: int,
) -> Driven:
    """Return what a maneuver taught, by the public road.

    Parameters
    ----------
    car : that drives.
    tires : as they were planned with.
    speed : [m/s].
    steering, course : as planned.
    asked : drive on which errors are measured, with true forces.
    times : since the maneuver began [s].
    seed : of the noise.
    """
    exact, way = rehearse(car.plant, steering, course, speed, hold_of(tires, speed))
    log = blind(car.sensors.apply(exact, np.random.default_rng([seed, 7])))
    run = ti.identify(log, car.told, check=False)
    errors = {
        t: float(np.mean(force_error(run.freeze(t=PLAN_CHOSEN.lead + t), asked))) for t in times
    }
    return Driven(errors, way[exact.t >= PLAN_CHOSEN.lead - 1e-9])


def open_course(tires: PlausibleTires, speed: float, steering: Maneuver) -> Course:
    """Return the course of the likely tires on an open field.

    Parameters
    ----------
    tires : that the car may have.
    speed : [m/s].
    steering : as planned.
    """
    t = steps_of(tires, steering.duration)
    motion = free_motion(tires, steering.steering(t)[:, :1], speed)
    lines = [one[:, 0, 0] for one in (motion.X, motion.Y, motion.psi)]
    return lambda at: np.column_stack([np.interp(at, t, line) for line in lines])


def case(job: tuple[str, int]) -> Taught | str:
    """Return what maneuvers taught one random car; why there is no plan.

    Parameters
    ----------
    job : class of the car, and seed.
    """
    kind, seed = job
    other = drawn(kind, seed, None, 1)
    car, asked = other.car, other.exact
    rng = np.random.default_rng([seed, 16])
    told, mu = car.told, FRICTION[kind]
    speed = float(rng.uniform(*SPEEDS) * told.froude_speed)
    tires = PlausibleTires.declared(told, mu)
    margin = MARGIN * told.wheelbase
    space = Space(
        length=1e3,
        width=1e3,
        speed=speed,
        share=SHARE,
        margin=margin,
        rate_limit=RATE / told.froude_time,
        max_angle=MAX_ANGLE,
    )
    long = TIMES * TIME

    def taught(steering: Maneuver, times: list[float]) -> Driven:
        course = open_course(tires, speed, steering)
        return driven(car, tires, speed, steering, course, asked, times, seed)

    every = [TIME * k for k in np.arange(0.25, TIMES + 0.01, 0.25).tolist()]
    steering = hardest(tires, space, slalom_of(told, long, car.frequency))
    slalom = taught(steering, every)
    gentle_space = replace(space, share=GENTLER)
    gentle = taught(hardest(tires, gentle_space, slalom_of(told, long, car.frequency)), [long])
    random = taught(hardest(tires, space, random_of(told, TIME, seed)), [TIME])
    body = body_of(tires)
    way = open_course(tires, speed, steering)(np.linspace(0.0, long, 2000))
    sides = extent(way[:, 0], way[:, 1])
    taken = (sides[0] + body.ahead + body.behind + 2.0 * margin) * (
        sides[1] + 2.0 * body.side + 2.0 * margin
    )
    length = speed * TIME + body.ahead + body.behind + 2.0 * margin + 0.5 * told.wheelbase
    try:
        found = ti.plan(
            told, area=(length, AREA * taken / length), speed=speed, time=TIME, friction=mu
        )
    except PlanError as error:
        return f"{kind} {seed}: {error}"
    (one,) = found.passes
    plan = driven(car, tires, speed, one.steering, one.course, asked, [TIME], seed)
    missed = plan.errors[TIME]
    good = [t / TIME for t in every if slalom.errors[t] <= missed]
    return Taught(
        kind=kind,
        plan=missed,
        slalom=slalom.errors[long],
        slalom_then=slalom.errors[TIME],
        gentle=gentle.errors[long],
        random=random.errors[TIME],
        area=found.space.length * found.space.width / taken,
        outside=-float(edge_distance(found.space, body, *plan.way.T)),
        reaches=min(good, default=math.inf),
        expected=100.0 * found.error,
    )


def report(found: list[Taught], refused: list[str], targets: Targets) -> None:
    """Print tables, record their numbers and judge them.

    Parameters
    ----------
    found : what was taught.
    refused : why there was no plan.
    targets : collects what is missed.
    """
    by_kind: dict[str, list[Taught]] = defaultdict(list)
    for one in found:
        by_kind[one.kind].append(one)
    for text in refused:
        print(f"  no plan: {text}")
    print("Median error of frozen forces on another drive [% of rms force]")
    names = ("plan", "random", "slalom_then", "slalom", "gentle")
    for kind, some in by_kind.items():
        medians = {name: float(np.median([getattr(one, name) for one in some])) for name in names}
        show(kind, ", ".join(f"{name} {value:.1f}" for name, value in medians.items()))
        for name, value in medians.items():
            targets.record(f"{kind}/{name}", value, "%")
        targets.record(f"{kind}/cars", len(some))
        for name in ("slalom", "gentle"):
            ratio = float(np.median([one.plan / getattr(one, name) for one in some]))
            label = f"{kind}: plan over {name}, three times its time, median"
            targets.at_most(label, ratio, 1.0, "", f"{kind}/over_{name}")
        later = float(np.mean([one.reaches >= TIMES for one in some]))
        targets.record(f"{kind}/slalom_not_before", 100.0 * later, "%")
    targets.at_most("cars without a plan", float(len(refused)), 0.0, "", "refused")
    area = max(one.area for one in found)
    targets.at_most("area over that of the slalom, largest", area, AREA + 1e-9, "", "area")
    gone = sum(one.outside > 0.0 for one in found)
    targets.at_most("cars that left the area", float(gone), 0.0, "", "left")
    ratios = [one.plan / one.slalom for one in found]
    targets.record("over_slalom", float(np.median(ratios)))
    targets.record("over_gentle", float(np.median([one.plan / one.gentle for one in found])))
    targets.record("over_random", float(np.median([one.plan / one.random for one in found])))
    targets.record("drives", len(found))
    show("over a slalom of 70 %", f"{targets.values['over_gentle']:.2f}")
    show("over random steering of the same time", f"{targets.values['over_random']:.2f}")


def main() -> int:
    """Run everything; return the exit code."""
    keep = keeps()
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--each", type=int, default=EACH, help="cars of each class")
    parser.add_argument("--first", type=int, default=FIRST_SEED, help="seed")
    options, targets = parser.parse_args(), Targets("plan")
    jobs = [(kind, options.first + k) for k in range(options.each) for kind in CLASSES]
    found: list[Taught] = []
    refused: list[str] = []
    with ProcessPoolExecutor(PROCESSES) as pool:
        for one in pool.map(case, jobs):
            print(f"  {one}", flush=True)
            if isinstance(one, Taught):
                found.append(one)
            else:
                refused.append(one)
    report(found, refused, targets)
    everything = options.each == EACH and options.first == FIRST_SEED
    return targets.finish(keep=keep and everything)


if __name__ == "__main__":
    sys.exit(main())
