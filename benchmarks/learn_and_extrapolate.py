"""Learn the tire, not the maneuver: what the default method must show, numbers beside targets.

Returns 1 where a target is missed. Run it by `python -m benchmarks.learn_and_extrapolate`.
"""

import sys

from benchmarks.extrapolate_faults import faults
from benchmarks.extrapolate_plant import friction_drop, maneuvers
from benchmarks.extrapolate_recorded import carmaker, dart
from benchmarks.recorded_cars import DATA
from benchmarks.targets import Targets
from identifier.methods import DEFAULT, REFERENCE, make_method
from identifier.step_time import step_times
from models.vehicle import sedan
from tireid.plant_drives import plant_recordings


def cost(targets: Targets) -> None:
    """Judge the time of a step against that of the paper's law.

    Parameters
    ----------
    targets : collects what is missed.
    """
    methods = {name: make_method(name, sedan()) for name in (DEFAULT, REFERENCE)}
    times = step_times(methods, sedan(), plant_recordings(sedan())[0], repeats=200)
    print(
        "Cost, shortest of 200 runs: "
        + ", ".join(f"{k} {1e9 * v:.0f} ns" for k, v in times.items())
    )
    targets.at_most("time per step over the paper's", times[DEFAULT] / times[REFERENCE], 2.0, "-")


def main() -> int:
    """Print every number; return 1 where a target is missed."""
    targets = Targets()
    if DATA.is_dir():
        carmaker(targets)
        dart(targets)
    else:
        print(f"skipped CarMaker and the real car: no recordings in {DATA}")
    maneuvers(targets)
    friction_drop(targets)
    faults(targets)
    cost(targets)
    print(f"missed: {'; '.join(targets.missed) or 'nothing'}")
    return 1 if targets.missed else 0


if __name__ == "__main__":
    sys.exit(main())
