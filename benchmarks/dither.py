"""What a weave about the path teaches a car that drives an easy road, and what it costs.

    python -m benchmarks.dither [--record]

The sedan knows its tires from three seconds of gentle steering, told stiffnesses that are 25 % low.
It drives 500 m of an easy road at 18 m/s with its tracker, and goes on learning: without a weave,
and with one of 10, 20 and 40 cm. What it knows at the end is asked about another drive, up to the
limit; medians over seeds of the sensors' noise.
"""

import sys
from dataclasses import replace

import numpy as np

import tireid as ti
from benchmarks.answers import force_error
from benchmarks.targets import Targets, keeps, show
from models.maneuvers import Slalom
from models.plant import Plant
from mpc.handover.learner import Learner

SEEDS, SPEED, LATE = 3, 18.0, 3.0  # m/s; s at the end of the road
WEAVES = (0.0, 0.1, 0.2, 0.4)  # m
LOW = 0.75


def main() -> int:
    """Run everything; return the exit code."""
    keep, targets, car = keeps(), Targets("dither"), ti.sedan()
    X = np.linspace(0.0, 500.0, 51)
    road = ti.paths.Path.from_waypoints(X, 3.0 * np.sin(X / 80.0), name="easy road")
    told = replace(
        car,
        cornering_stiffness_front=LOW * car.cornering_stiffness_front,
        cornering_stiffness_rear=LOW * car.cornering_stiffness_rear,
    )
    gentle = Slalom(amplitude=0.01, frequency=0.3, onset=0.5, rate_limit=1.0, duration=3.0)
    log = Plant(car).simulate(gentle, speed=SPEED).recording()
    begun = ti.identify(log, told, check=False).freeze()
    other = ti.sample_recording(car, seed=5)
    targets.record("before", max(force_error(begun, other)), "%")
    print("Error of the worse axle on another drive [% of rms force]")
    show("before the road", f"{targets.values['before']:.1f}")
    errors: dict[float, float] = {}
    for weave in WEAVES:
        found = []
        for seed in range(SEEDS):
            run = ti.drive(road, car, begun, speed=SPEED, learning=True, dither=weave, seed=seed)
            assert isinstance(run.learner, Learner)
            tire, off = run.learner.supervisor.identifier.model(), np.abs(run.drive.e_y)
            late = off[run.drive.t >= run.drive.t[-1] - LATE].max()
            found.append((max(force_error(tire, other)), off.max(), late))
        error, peak, late = (float(value) for value in np.median(found, axis=0))
        errors[weave] = error
        name = f"{100.0 * weave:g}_cm"
        show(f"weave of {100.0 * weave:g} cm", f"{error:.1f}, {peak:.3f} m off, at last {late:.3f}")
        for key, value, unit in (("error", error, "%"), ("late", late, "m")):
            targets.record(f"{name}/{key}", value, unit)
        if weave > 0.0:
            largest = float(max(one[1] for one in found))
            targets.at_most(f"{name}: largest deviation", largest, weave, "m", f"{name}/peak")
    targets.at_most(
        "error after a weave of 20 cm over that without", errors[0.2] / errors[0.0], 1.0, "", "gain"
    )
    return targets.finish(keep=keep)


if __name__ == "__main__":
    sys.exit(main())
