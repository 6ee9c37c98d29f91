"""Learn the tire, not the maneuver: what the default method must show, numbers beside targets.

    python -m benchmarks.learn_and_extrapolate [--record]

Recordings are compared as `tireid compare` compares them. Returns 1 where a target is missed.
"""

import sys
import time
from collections.abc import Callable, Mapping
from functools import partial

from benchmarks.extrapolate_faults import faults
from benchmarks.extrapolate_plant import friction_drop, maneuvers, random_fleet
from benchmarks.extrapolate_recorded import carmaker, dart, side_by_side
from benchmarks.recorded_cars import DATA
from benchmarks.targets import Targets, keeps, show
from identifier.compare.course import step_times
from identifier.methods import LIVE, REFERENCE, make_method
from identifier.run import identify
from models.vehicle import sedan
from tireid.commands.demo_story import plant_recordings


def shortest(actions: Mapping[str, Callable[[], object]], turns: int) -> dict[str, float]:
    """Return the shortest processor time of each action [s]; they take turns."""
    best = dict.fromkeys(actions, float("inf"))
    for _ in range(turns):
        for name, action in actions.items():
            start = time.process_time()
            action()
            best[name] = min(best[name], time.process_time() - start)
    return best


def cost(targets: Targets) -> None:
    """Judge the time of a step against that of the paper's law, in the bare loop and recorded.

    Parameters
    ----------
    targets : collects what is missed.
    """
    methods = {name: make_method(name, sedan()) for name in (LIVE, REFERENCE)}
    slalom = plant_recordings(sedan())[0]
    times = step_times(methods, sedan(), slalom, repeats=200)
    print(
        "Cost, shortest of 200 runs: "
        + ", ".join(f"{k} {1e9 * v:.0f} ns" for k, v in times.items())
    )
    for name, duration in times.items():
        targets.record(f"step/{name}", 1e6 * duration, "µs")
    ratio = times[LIVE] / times[REFERENCE]
    targets.at_most("time per step over the paper's", ratio, 2.0, "-", key="step/ratio")
    runs = {name: partial(identify, slalom, sedan(), method) for name, method in methods.items()}
    whole = shortest(runs, turns=200)
    recorded = whole[LIVE] / whole[REFERENCE]
    show("the same with everything recorded, as identify() does", f"{recorded:.2f}")
    targets.record("step/ratio_recorded", recorded, "-")


def main() -> int:
    """Print every number; return 1 where a target is missed."""
    targets = Targets("learn_and_extrapolate")
    if DATA.is_dir():
        carmaker(targets)
        dart(targets)
        side_by_side(targets)
    else:
        print(f"skipped CarMaker and the real car: no recordings in {DATA}")
    maneuvers(targets)
    random_fleet(targets)
    friction_drop(targets)
    faults(targets)
    cost(targets)
    return targets.finish(keep=keeps())


if __name__ == "__main__":
    sys.exit(main())
