"""Does the guaranteed band hold where steering is faster than that which taught?

    python -m benchmarks.guaranteed_faster [--each N] [--first SEED] [--record]

Random cars of four classes learn on one drive, as in `guaranteed.py`, steered at 0.4 to 1.5 Hz.
Then each is asked about sines of 1.5 and 2.5 Hz at the speed of that drive, of a quarter to all of
its steering angle. Counted are those whose slip stays within what taught; one is outside where at
any instant the true force of an axle is outside of `guarantee.over`. The same drives are counted
against the band as it was without ρ in β. These cars had been looked at when ρ came into β; ask
others with `--first 1100`.
"""

import argparse
import math
import sys
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from dataclasses import replace

import numpy as np

from benchmarks.answers import blind, drawn
from benchmarks.guaranteed import Asked, asked, learnt
from benchmarks.random_cars import CLASSES, FIRST_SEED
from benchmarks.targets import Targets, keeps
from identifier.axle import AxleModel
from identifier.verdict import guaranteed
from models.maneuvers import Slalom
from models.plant import PlantError

EACH, PROCESSES = 10, 2  # cars of a class
FREQUENCIES, SHARES = (1.5, 2.5), (0.25, 0.5, 0.75, 1.0)  # Hz; of the steering angle that taught
STRAIGHT, LASTS = 2.0, 8.0  # s
ANY_RATE = 1e9  # static axle loads/s


def plant_case(job: tuple[str, int]) -> list[tuple[float, dict[str, Asked]]]:
    """Return how the bands of a random car held on its sines, each with its frequency [Hz].

    Parameters
    ----------
    job : class of the car, seed.
    """
    kind, seed = job
    drive = drawn(kind, seed)
    model = guaranteed(learnt(drive.log(np.random.default_rng([seed, 1])), drive.car.told))
    assert isinstance(model, AxleModel) and model.possible is not None
    models = {
        "": model,
        "without": replace(model, possible=replace(model.possible, fastest=(ANY_RATE, ANY_RATE))),
    }
    largest, found = float(np.abs(drive.exact.delta_f).max()), []
    for frequency in FREQUENCIES:
        for share in SHARES:
            sine = Slalom(
                amplitude=share * largest,
                frequency=frequency,
                onset=STRAIGHT,
                rate_limit=2.02 * math.pi * frequency * share * largest,
                duration=LASTS,
            )
            with suppress(PlantError):
                run = drive.car.plant.simulate(sine, speed=np.float64(drive.speed), name="sine")
                log = run.recording()
                if (np.abs(model.lagged_slip(blind(log))) <= model.driven_slip).all():
                    found.append((frequency, asked(models, log, STRAIGHT)))
    return found


def main() -> int:
    """Run everything; return the exit code."""
    keep = keeps()
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--each", type=int, default=EACH, help="cars of each class")
    parser.add_argument("--first", type=int, default=FIRST_SEED, help="seed")
    options, targets = parser.parse_args(), Targets("guaranteed_faster")
    jobs = [(kind, options.first + k) for k in range(options.each) for kind in CLASSES]
    with ProcessPoolExecutor(PROCESSES) as pool:
        drives = [one for some in pool.map(plant_case, jobs) for one in some]
    for frequency in FREQUENCIES:
        mine = [told for at, told in drives if at == frequency]
        key = f"{frequency:g}_Hz"
        targets.record(f"{key}/drives", len(mine))
        for name in ("", "without"):
            some = [told[name] for told in mine]
            outside, farthest = sum(one.outside for one in some), max(one.beyond for one in some)
            width = float(np.nanmedian([one.over_largest for one in some]))
            label = f"{frequency:g} Hz{', ' * bool(name)}{name}"
            print(
                f"  {label:20} {len(some)} drives, {outside} outside, farthest {farthest:.3f},"
                f" width over largest error {width:.2f}"
            )
            of = f"{key}/{name}/" if name else f"{key}/"
            targets.record(f"{of}farthest", farthest, "static axle loads")
            targets.record(f"{of}over_largest", width)
            if name:
                targets.record(f"{of}outside", outside)
            else:
                targets.at_most(f"{label}: drives outside", outside, 0, "", f"{of}outside")
    return targets.finish(keep=keep and (options.each, options.first) == (EACH, FIRST_SEED))


if __name__ == "__main__":
    sys.exit(main())
