"""Do bands hold? Coverage of true forces by bands of 90 % on drives that nobody learnt from.

    python -m benchmarks.bands [--each N] [--first SEED] [--record]

Random cars of four classes learn on a drive with good sensors, and calibrate their bands on it, by
the motion alone. Then another drive, of another speed: a sample counts as held where the true force
lies in the band around the force that the frozen model gives back. Coverage is that of a drive,
meant over drives, within the known slip; it is taken with exact signals, as a band of a curve says
nothing of sensors, and with the noise of good sensors beside. Beside it stand the covariance alone
(as learning leaves it, no error of the model) and a band of one width, as narrow as holds 90 % of
the windows that taught. Constants were chosen on seeds 100 to 131. Where the recordings of CarMaker
are there, each run is asked of what the other taught.
"""

import argparse
import sys
from collections import defaultdict
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from itertools import chain
from typing import NamedTuple

import numpy as np

from benchmarks.answers import blind, drawn
from benchmarks.random_cars import CLASSES, FIRST_SEED, LEAD
from benchmarks.recorded_cars import CARMAKER, DATA
from benchmarks.targets import Targets, keeps
from codegen.arrays import Array
from identifier.axle import AxleIdentifier, AxleModel
from identifier.axle.band import RANGES, normal_quantile, ranges_of
from identifier.axle.curve import unit_matrix
from identifier.run import identify
from identifier.tire_model import AXLES
from identifier.verdict.motion import evidence
from models.recordings import Recording, read_recording
from models.vehicle import Vehicle

EACH, PROCESSES, FEWEST = 50, 2, 50  # cars of a class; samples, below which a drive tells nothing
LEVEL, TOLERANCE = 90.0, 5.0  # %
RUNS = ("slalom1_14_5ms", "experiment2_40kmh")
SLIPS = (*(f"to_{end:g}" for end in RANGES), f"from_{RANGES[-1]:g}")  # rad
BANDS = ("band", "covariance", "constant")


class Held(NamedTuple):
    """How a drive went in one axle: group, signals, subset of samples, and by band (coverage [%],
    mean half-width over the rms error [-]).
    """

    group: str
    signals: str
    part: str
    found: dict[str, tuple[float, float]]


def learnt(log: Recording, car: Vehicle) -> tuple[AxleModel, Array]:
    """Return the calibrated model of a drive, and the half-width (2,) [static loads] of a constant
    band that holds 90 % of the windows that taught it.
    """
    run = identify(blind(log), car, AxleIdentifier.for_vehicle(car, dt=log.dt))
    model = run.calibrated()
    assert isinstance(model, AxleModel)
    found = evidence(model, run.recording)
    assert found is not None
    return model, np.quantile(np.abs(found.measured - found.modelled), LEVEL / 100.0, axis=0)


def plain_covariance(model: AxleModel, slip: Array, axle: int) -> Array:
    """Return half the width of a band of the covariance alone [static loads], (k,)."""
    T, n = unit_matrix(slip, model.ladder), len(model.ladder)
    variance = np.einsum("ki,ij,kj->k", T, model.covariance[axle, :n, :n], T)
    width: Array = normal_quantile(LEVEL / 100.0) * np.sqrt(variance)
    return width


def held(
    group: str, signals: str, asked: tuple[AxleModel, Array], drive: Recording, force: Array
) -> Iterator[Held]:
    """Yield how the bands of a model held over a drive.

    Parameters
    ----------
    group : of the car.
    signals : of which kind.
    asked : from `learnt`.
    drive : its signals are the input.
    force : true (n, 2) [N].
    """
    model, constant = asked
    loads = np.array(model.vehicle.axle_loads)
    moving = drive.v_x >= model.min_speed
    moving &= drive.t >= drive.t[0] + (LEAD if group in CLASSES else 1.0)
    slips = np.abs(model.lagged_slip(drive))[moving]
    away = (np.abs(model.axle_force(drive) - force) / loads)[moving]
    for i, axle in enumerate(AXLES):
        slip, error = slips[:, i], away[:, i]
        half = {
            "band": model.half_band(slip)[:, i] / loads[i],
            "covariance": plain_covariance(model, slip, i),
            "constant": np.full(slip.size, constant[i]),
        }
        known = slip <= model.known_slip[i]
        parts = {"known": known, axle: known, "beyond": ~known}
        parts |= {name: known & (ranges_of(slip) == k) for k, name in enumerate(SLIPS)}
        for part, mine in parts.items():
            if mine.sum() >= FEWEST:
                size = float(np.sqrt(np.mean(error[mine] ** 2)))
                yield Held(
                    group,
                    signals,
                    part,
                    {
                        name: (
                            100.0 * float(np.mean(error[mine] <= wide[mine])),
                            float(np.mean(wide[mine])) / size,
                        )
                        for name, wide in half.items()
                    },
                )


def plant_case(job: tuple[str, int]) -> list[Held]:
    """Return how the bands of one random car held on another of its drives.

    Parameters
    ----------
    job : class of the car, and seed.
    """
    kind, seed = job
    drive, other = drawn(kind, seed), drawn(kind, seed, None, 1)
    if other.car.vehicle != drive.car.vehicle:  # its first car has no second drive
        return []
    asked = learnt(drive.log(np.random.default_rng([seed, 1])), drive.car.told)
    force = other.exact.axle_force
    assert force is not None
    noisy = blind(other.log(np.random.default_rng([seed, 2])))
    both = (("exact", blind(other.exact)), ("noisy", noisy))
    return list(chain(*(held(kind, name, asked, one, force) for name, one in both)))


def carmaker_cases() -> list[Held]:
    """Return how the bands of either CarMaker run held on the other."""
    runs = [read_recording(DATA / "carmaker.csv.gz", run=name) for name in RUNS]
    found: list[Held] = []
    for taught, other in (runs, runs[::-1]):
        assert other.axle_force is not None
        asked = learnt(taught, CARMAKER)
        run = other.name.split(":")[-1].split("_")[0]
        found += held(run, "exact", asked, blind(other), other.axle_force)
    return found


def mean(found: list[Held], band: str) -> tuple[float, float]:
    """Return the mean coverage [%] and the median half-width over the rms error [-]."""
    coverage, width = zip(*(one.found[band] for one in found), strict=True)
    return float(np.mean(coverage)), float(np.median(width))


def report(plants: list[Held], recorded: list[Held], targets: Targets) -> None:
    """Print tables, record their numbers and judge them.

    Parameters
    ----------
    plants, recorded : what was found.
    targets : collects what is missed.
    """
    table: dict[tuple[str, str], list[Held]] = defaultdict(list)
    for one in plants:
        keys = [one.part] if one.part != "known" else ["known", one.group]
        for key in keys:
            table[one.signals, key].append(one)
    for one in recorded:
        table["recorded", f"{one.group}/{one.part}"].append(one)
    print(f"  {'coverage [%], half-width over rms error':52} {'drives':>7}", *BANDS)
    for (signals, key), some in table.items():
        cells = {band: mean(some, band) for band in BANDS}
        text = "  ".join(f"{cover:5.1f} {wide:5.2f}" for cover, wide in cells.values())
        print(f"  {signals + ': ' + key:52} {len(some):7}  {text}")
        for band, (cover, wide) in cells.items():
            targets.record(f"{signals}/{key}/{band}/coverage", cover, "%")
            targets.record(f"{signals}/{key}/{band}/width", wide)
        targets.record(f"{signals}/{key}/drives", len(some))
    print("Targets")
    for (signals, key), some in table.items():
        if signals != "noisy" and (signals == "exact" or key.endswith("/known")):
            cover, _ = mean(some, "band")
            off, where = abs(cover - LEVEL), f"{signals}/{key}"
            label = f"{where}: coverage off {LEVEL:g} %"
            targets.at_most(label, off, TOLERANCE, key=f"{signals}/{key}/off")
    if ("exact", "known") in table:
        some = table["exact", "known"]
        label = "half-width over the rms error, known slip"
        targets.at_most(label, mean(some, "band")[1], 2.0, "", "width")
        ratio = mean(some, "band")[1] / max(mean(some, "constant")[1], 1e-9)
        targets.record("width_over_constant", ratio)
    else:
        targets.at_least("drives that were judged", 0.0, 1.0, "")


def main() -> int:
    """Run everything; return the exit code."""
    keep = keeps()
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--each", type=int, default=EACH, help="cars of each class")
    parser.add_argument("--first", type=int, default=FIRST_SEED, help="seed")
    options, targets = parser.parse_args(), Targets("bands")
    jobs = [(kind, options.first + k) for k in range(options.each) for kind in CLASSES]
    with ProcessPoolExecutor(PROCESSES) as pool:
        plants = list(chain(*pool.map(plant_case, jobs)))
    recorded: list[Held] = []
    if DATA.is_dir():
        recorded = carmaker_cases()
    else:
        print(f"  without recordings: they are not there: {DATA} (set TIREID_DATA)")
    report(plants, recorded, targets)
    everything = options.each == EACH and options.first == FIRST_SEED and bool(recorded)
    return targets.finish(keep=keep and everything)


if __name__ == "__main__":
    sys.exit(main())
