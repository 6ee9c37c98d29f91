"""How well do tires that a mixed drive taught tell the forces while a car brakes in a bend?

    python -m benchmarks.braking [--each N] [--first SEED] [--record]

The sedan, driven by its front wheels, by its rear wheels and by all, 60 to 40, learns on drives
with good sensors whose driver steers at random and brakes and pulls as he does, with half the grip
at most. Then it brakes in a bend, pulls in one, and drives through them at one speed; what it is
told of itself is mass, axles and inertia ("nothing"), or height, shares and drag too ("told"). A
second set of drives teaches at one speed: what is said of braking there is what was told. Errors:
rms over that of the axle's force, over both directions and two sizes of each bend.
"""

import argparse
import sys
from dataclasses import replace
from typing import NamedTuple

import numpy as np

import tireid as ti
from benchmarks.random_cars import FIRST_SEED, RandomCar, random_drive
from benchmarks.targets import Targets, keeps
from codegen.arrays import Array
from models.maneuvers import StepSteer
from models.plant import tire_of
from models.recordings import Recording
from models.vehicle import GRAVITY, Vehicle, sedan

LAYOUTS = {"front": 1.0, "rear": 0.0, "all": 0.6}  # share of the front axle in the drive
EACH = 4  # drives of a layout that teach
TAUGHT = {"mixed": 0.5, "steady": 0.0}  # of the grip, with which a driver who teaches pulls
PULL = 0.5  # of the grip, where it is asked
BENDS = {"brake": -4.0, "power": 2.5, "constant": 0.0}  # a_x [m/s²] in the bend
SPEED, SIZES = 20.0, (0.35, 0.55)  # m/s at turn-in; lateral acceleration there [g]
TURNED, BEGUN, LASTS = 1.0, 2.5, 6.0  # s: turn-in, a_x begins, length
KNOWN = ("nothing", "told")
LARGEST = 5.0  # %


class Errors(NamedTuple):
    """Of the front and the rear axle [-]."""

    front: float
    rear: float


def car_of(drive_front_share: float) -> RandomCar:
    """Return the sedan with a drive layout; what is told of it has no chassis.

    Parameters
    ----------
    drive_front_share : of the driving force [-].
    """
    built = sedan()
    chassis = replace(built.require_chassis(), drive_front_share=drive_front_share)
    tire = tire_of(built)
    return RandomCar(
        kind="sedan",
        vehicle=replace(built, chassis=chassis),
        told=replace(built, chassis=None),
        tires=(tire, tire),
        friction=(1.0, 1.0),
        frequency=0.5,
    )


def bend(car: RandomCar, a_x: float, a_y: float) -> Recording:
    """Return a bend, without noise, in which the speed changes.

    Parameters
    ----------
    car : that drives.
    a_x : wanted once it has turned in [m/s²].
    a_y : at turn-in [m/s²], positive to the left.
    """
    b, L = car.vehicle.bicycle, car.vehicle.wheelbase
    understeer = b.m * (b.l_r * b.C_r - b.l_f * b.C_f) / (b.C_f * b.C_r * L)
    angle = a_y * (L / SPEED**2 + understeer)
    steer = StepSteer(amplitude=angle, onset=TURNED, rate_limit=0.2, duration=LASTS)

    def wanted(t: Array) -> Array:
        speed: Array = np.maximum(SPEED + a_x * np.maximum(t - BEGUN, 0.0), 0.4 * SPEED)
        return speed

    run = car.pulling(PULL * GRAVITY).simulate(steer, speed=wanted, name="bend")
    return replace(run.recording(), a_x=run.a_x)


def missed(model: ti.TireModel, drives: list[Recording]) -> Errors:
    """Return what a model misses of the forces from turn-in on.

    Parameters
    ----------
    model : that is asked.
    drives : with their true forces.
    """
    wrong, true = np.zeros(2), np.zeros(2)
    for one in drives:
        assert one.axle_force is not None
        late = one.t >= TURNED
        wrong += np.square(model.predict(one) - one.axle_force)[late].sum(axis=0)
        true += np.square(one.axle_force)[late].sum(axis=0)
    front, rear = np.sqrt(wrong / true)
    return Errors(float(front), float(rear))


def as_told(car: RandomCar, known: str) -> Vehicle:
    """Return the car as it is told.

    Parameters
    ----------
    car : that drives.
    known : one of `KNOWN`.
    """
    if known == "nothing":
        return car.told
    alone = car.vehicle.without_chassis()
    return replace(alone, drag_area=0.0)  # no air about the plant


def of_layout(share: float, each: int, first: int) -> dict[tuple[str, str, str], Array]:
    """Return the errors of both axles by what teaches, is told and is asked, (each, 2).

    Parameters
    ----------
    share : of the front axle in the drive.
    each : drives that teach, each alone.
    first : seed of the first.
    """
    car = car_of(share)
    asked = {
        name: [bend(car, a_x, side * size * GRAVITY) for size in SIZES for side in (1.0, -1.0)]
        for name, a_x in BENDS.items()
    }
    found: dict[tuple[str, str, str], list[Errors]] = {}
    for seed in range(first, first + each):
        for taught, pull in TAUGHT.items():
            rng = np.random.default_rng(seed)
            log = random_drive(car, rng, pull=pull).log(rng)
            for known in KNOWN:
                model = ti.identify(log, as_told(car, known), check=False).freeze()
                for name, drives in asked.items():
                    found.setdefault((taught, known, name), []).append(missed(model, drives))
    return {key: np.array(listed) for key, listed in found.items()}


def main() -> int:
    """Run the command."""
    keep = keeps()
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--each", type=int, default=EACH, help="drives of each layout")
    parser.add_argument("--first", type=int, default=FIRST_SEED, help="seed")
    options = parser.parse_args()
    targets = Targets("braking")
    print("errors of front and rear axle, median over drives that teach")
    for layout, share in LAYOUTS.items():
        found = of_layout(share, options.each, options.first)
        for (taught, known, name), errors in found.items():
            front, rear = 100.0 * np.median(errors, axis=0)
            print(f"{layout:>6} {taught:>6} {known:>8} {name:>9} {front:6.1f} / {rear:.1f} %")
            key = f"{layout}/{taught}/{known}/{name}"
            targets.record(f"{key}/front", front, "%")
            if name == "brake" and (taught, known) != ("steady", "nothing"):
                label = f"{layout}, {taught}, {known}: rear axle, braking in a bend"
                targets.at_most(label, rear, LARGEST, key=f"{key}/rear")
            else:
                targets.record(f"{key}/rear", rear, "%")
    return targets.finish(keep=keep and (options.each, options.first) == (EACH, FIRST_SEED))


if __name__ == "__main__":
    sys.exit(main())
