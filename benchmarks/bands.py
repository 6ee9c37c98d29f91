"""Do bands hold? Coverage of true forces by bands of 90 % on drives that nobody learnt from.

    python -m benchmarks.bands [--each N] [--first SEED] [--record]

Random cars of four classes learn on a drive with good sensors, and calibrate their bands on it, by
the motion alone. Then another drive, of another speed: a sample is held where the true force lies
in the band around the force that the frozen model gives back. Samples of all drives count alike, in
ranges of slip and of speed; all slip counts, known or not. Signals are exact, and once more as good
sensors show them, whose noise the band knows. Beside the band stand the covariance alone (as
learning leaves it, no error of the model) and a band of one width, as narrow as holds 90 % of the
windows that taught. `impulse` is what needs no true force: the share of windows whose integral of
the force lies in the band. Constants were chosen on seeds 100 to 131 and 200 to 231.
Where the recordings are there: CarMaker, each run asked of what the other taught; a real 1:10 car,
each run of what every other run taught, on the same floor, on another floor, of which the band was
told so (`on_another_road`) and not, and with runs so slow that half of their force is no motion.
"""

import argparse
import sys
from collections import defaultdict
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from itertools import chain, permutations
from typing import NamedTuple

import numpy as np
from benchmarks.extrapolate_recorded import SLOW, TILES
from numpy.typing import NDArray

from benchmarks.answers import blind, drawn
from benchmarks.random_cars import CLASSES, FIRST_SEED, LEAD
from benchmarks.recorded_cars import CARMAKER, DART, DATA
from benchmarks.targets import Targets, keeps
from codegen.arrays import Array
from codegen.processor import PROCESSORS, missing_tools, replay
from identifier.axle import AxleIdentifier, AxleModel
from identifier.axle.band import ranges_of
from identifier.axle.chosen import CHOSEN as AXLE_CHOSEN
from identifier.axle.curve import unit_matrix
from identifier.band import normal_quantile
from identifier.export.package import build_package, synthetic_samples
from identifier.export.processor import recording_program
from identifier.run import identify
from identifier.tire_model import AXLES
from identifier.verdict import calibrated, within_band
from identifier.verdict.motion import evidence
from models.recordings import Recording, read_recording
from models.vehicle import Vehicle

EACH, PROCESSES = 50, 2  # cars of a class
LEVEL, TOLERANCE, WIDEST = 90.0, 3.0, 2.0  # %, %, half-width over the rms error
FEWEST = 200  # samples, below which a range tells nothing
CARMAKER_RUNS = ("slalom1_14_5ms", "experiment2_40kmh")
REAL_RUNS = {
    "dart.csv.gz": ("ramp_steer02", "free_10_02_28", "free_10_12_05"),
    "dart_imu.csv.gz": ("ramp_steerneg025", TILES, *SLOW),
}
SLIPS = (*(f"to_{end:g}" for end in AXLE_CHOSEN.ranges), f"from_{AXLE_CHOSEN.ranges[-1]:g}")  # rad
FAST = (
    *(f"below_{end:g}" for end in AXLE_CHOSEN.speeds),
    f"above_{AXLE_CHOSEN.speeds[-1]:g}",
)  # sqrt(g L)
BANDS = ("band", "covariance", "constant")
JUDGED = ("exact", "noisy", "carmaker", "dart", "dart_other_floor")


class Held(NamedTuple):
    """How one part of a drive went in one axle.

    group, part : whose.   samples : how many.   squares : sum of squared errors.   held, width : by
    band, how many samples it held, and the sum of its half-widths [static loads].
    """

    group: str
    part: str
    samples: int
    squares: float
    held: dict[str, int]
    width: dict[str, float]

    def ratio(self, band: str) -> float:
        """Mean half-width over the rms error."""
        return float(self.width[band] / np.sqrt(self.samples * self.squares))


class Taught(NamedTuple):
    """What a drive taught: the calibrated model, and the half-width (2,) [static loads] of a
    constant band that holds 90 % of the windows that taught it.
    """

    model: AxleModel
    constant: Array


def learnt(log: Recording, car: Vehicle) -> Taught:
    """Return what a drive teaches.

    Parameters
    ----------
    log : with what sensors show.
    car : as it is told.
    """
    run = identify(blind(log), car, AxleIdentifier.for_vehicle(car, dt=log.dt))
    model = calibrated(run)
    assert isinstance(model, AxleModel)
    found = evidence(model, run.recording)
    assert found is not None
    away = np.abs(found.measured - found.modelled)
    return Taught(model, np.quantile(away, LEVEL / 100.0, axis=0))


def plain_covariance(model: AxleModel, slip: Array, axle: int) -> Array:
    """Return half the width of a band of the covariance alone [static loads], (k,)."""
    T, n = unit_matrix(slip, model.ladder), len(model.ladder)
    variance = np.einsum("ki,ij,kj->k", T, model.covariance[axle, :n, :n], T)
    width: Array = normal_quantile(LEVEL / 100.0) * np.sqrt(variance)
    return width


def held(
    groups: Iterable[str], taught: Taught, drive: Recording, force: Array, lead: float
) -> Iterator[Held]:
    """Yield how the bands of a model held over a drive, for each group that it counts in.

    Parameters
    ----------
    groups : of the drive.
    taught : what another drive taught.
    drive : its signals are the input.
    force : true (n, 2) [N].
    lead : seconds at its beginning that do not count.
    """
    model, constant = taught
    loads = np.array(model.vehicle.axle_loads)
    moving = (drive.v_x >= model.min_speed) & (drive.t >= drive.t[0] + lead)
    slips = np.abs(model.lagged_slip(drive))[moving]
    away = (np.abs(model.predict(drive) - force) / loads)[moving]
    wide = (model.band.over(drive) / loads)[moving]
    fast = np.searchsorted(
        AXLE_CHOSEN.speeds, drive.v_x[moving] / model.vehicle.froude_speed, side="right"
    )
    for i, axle in enumerate(AXLES):
        slip, error = slips[:, i], away[:, i]
        half = {
            "band": wide[:, i],
            "covariance": plain_covariance(model, slip, i),
            "constant": np.full(slip.size, constant[i]),
        }
        known = slip <= model.known_slip[i]
        parts: dict[str, NDArray[np.bool_]] = {"known": known, "beyond": ~known}
        parts |= {axle: known, "all": known | ~known}
        parts |= {name: ranges_of(slip) == k for k, name in enumerate(SLIPS)}
        parts |= {name: fast == k for k, name in enumerate(FAST)}
        for part, mine in parts.items():
            if not mine.any():
                continue
            one = Held(
                group="",
                part=part,
                samples=int(mine.sum()),
                squares=float(np.sum(error[mine] ** 2)),
                held={name: int(np.sum(error[mine] <= h[mine])) for name, h in half.items()},
                width={name: float(np.sum(h[mine])) for name, h in half.items()},
            )
            for group in groups:
                yield one._replace(group=group)


class Asked(NamedTuple):
    """What came of a drive, and shares of its windows in the band [%], by group."""

    held: list[Held]
    impulse: list[tuple[str, float]]


def asked(
    groups: tuple[str, ...], taught: Taught, drive: Recording, force: Array, lead: float = 1.0
) -> Asked:
    """Return how a model is right over a drive, with true forces and without."""
    share = within_band(taught.model, drive)
    impulse = [] if share is None else [(groups[0], 100.0 * float(np.mean(share)))]
    return Asked(list(held(groups, taught, drive, force, lead)), impulse)


def plant_case(job: tuple[str, int]) -> list[Asked]:
    """Return how the bands of one random car held on another of its drives.

    Parameters
    ----------
    job : class of the car, and seed.
    """
    kind, seed = job
    drive, other = drawn(kind, seed), drawn(kind, seed, None, 1)
    if other.car.vehicle != drive.car.vehicle:  # its first car has no second drive
        return []
    taught = learnt(drive.log(np.random.default_rng([seed, 1])), drive.car.told)
    force = other.exact.axle_force
    assert force is not None
    noisy = blind(other.log(np.random.default_rng([seed, 2])))
    return [
        asked(("exact", f"exact/{kind}"), taught, blind(other.exact), force, LEAD),
        asked(("noisy", f"noisy/{kind}"), taught, noisy, force, LEAD),
    ]


def carmaker_cases() -> Iterator[Asked]:
    """Yield how the bands of either CarMaker run held on the other."""
    runs = [read_recording(DATA / "carmaker.csv.gz", run=name) for name in CARMAKER_RUNS]
    for log, other in permutations(runs, 2):
        assert other.axle_force is not None
        groups = ("carmaker", f"carmaker/{other.name.split(':')[-1].split('_')[0]}")
        yield asked(groups, learnt(log, CARMAKER), blind(other), other.axle_force)


def dart_cases() -> Iterator[Asked]:
    """Yield how the bands of each run of the real car held on every other."""
    runs = {
        name: read_recording(DATA / log, run=name)
        for log, names in REAL_RUNS.items()
        for name in names
    }
    taught = {name: learnt(run, DART) for name, run in runs.items()}
    for one, name in permutations(runs, 2):
        tires, other = taught[one], runs[name]
        assert other.axle_force is not None
        truth = blind(other), other.axle_force
        if {one, name} & set(SLOW):
            yield asked(("dart_slow",), tires, *truth)
        elif TILES in (one, name):
            elsewhere = tires._replace(model=tires.model.band.on_another_road())
            yield asked(("dart_other_floor",), elsewhere, *truth)
            yield asked(("dart_other_floor_untold",), tires, *truth)
        else:
            yield asked(("dart",), tires, *truth)


def c_cost(targets: Targets) -> None:
    """Record what the band costs in C, in float on a Cortex-M4F; nothing without the tools.

    Parameters
    ----------
    targets : collects what is recorded.
    """
    if missing_tools():
        print(f"  cost in C: not measured, missing: {', '.join(missing_tools())}")
        return
    drive = drawn("sedan", FIRST_SEED)
    car, log = drive.car.told, drive.log(np.random.default_rng([FIRST_SEED, 1]))
    method, start = AxleIdentifier.for_vehicle(car, dt=log.dt), learnt(log, car).model
    cost = []
    for with_band in (False, True):
        package = build_package(method, car, start, with_band=with_band)
        samples = synthetic_samples(package.specialized)
        name = package.specialized.name
        ran = replay(recording_program(name, package.files, samples), PROCESSORS[0], single=True)
        cost.append(ran.instructions)
    plain, banded = cost
    print(f"  {PROCESSORS[0].name}, float: {plain} instructions a step, {banded} with the band")
    targets.record("c/instructions", plain)
    targets.record("c/instructions_with_band", banded)
    targets.record("c/more", 100.0 * (banded / plain - 1.0), "%")


def report(found: list[Asked], targets: Targets) -> None:
    """Print tables, record their numbers and judge them.

    Parameters
    ----------
    found : of all drives.
    targets : collects what is missed.
    """
    table: dict[tuple[str, str], list[Held]] = defaultdict(list)
    windows: dict[str, list[float]] = defaultdict(list)
    for one in found:
        for part in one.held:
            table[part.group, part.part].append(part)
        for group, share in one.impulse:
            windows[group].append(share)
    print(f"  {'coverage [%], half-width over rms error':46} {'samples':>9}", *BANDS)
    coverage: dict[tuple[str, str], float] = {}
    for key, parts in table.items():
        samples = sum(part.samples for part in parts)
        if samples < FEWEST:
            continue
        cells = []
        for band in BANDS:
            share = 100.0 * sum(part.held[band] for part in parts) / samples
            wide = float(np.median([part.ratio(band) for part in parts if part.samples >= 50]))
            cells.append(f"{share:5.1f} {wide:5.2f}")
            targets.record("/".join((*key, band, "coverage")), share, "%")
            targets.record("/".join((*key, band, "width")), wide)
            if band == "band":
                coverage[key] = share
        targets.record("/".join((*key, "samples")), samples)
        print(f"  {': '.join(key):46} {samples:9}  {'  '.join(cells)}")
    for group, shares in windows.items():
        targets.record(f"{group}/impulse", float(np.mean(shares)), "%")
        print(f"  {group + ': windows whose impulse is held':46} {np.mean(shares):15.1f}")
    judged(coverage, targets)


def judged(coverage: dict[tuple[str, str], float], targets: Targets) -> None:
    """Judge coverage in every range of slip, and the width in known slip.

    Parameters
    ----------
    coverage : [%], by group and part.
    targets : collects what is missed.
    """
    print("Targets")
    off = {key: abs(share - LEVEL) for key, share in coverage.items() if key[1] in SLIPS}
    for group in JUDGED:
        missed = [one for (of, _), one in off.items() if of == group and one > TOLERANCE]
        targets.record(f"count/{group}/missed", len(missed))
    for (group, part), away in off.items():
        if group in JUDGED:
            label = f"{group}, slip {part}: coverage off {LEVEL:g} %"
            key = f"{group}/{part}/off"
            targets.at_most(label, away, TOLERANCE, "%", key)
    for group in JUDGED:
        if (group, "known") in coverage:
            label = f"{group}, known slip: half-width over the rms error"
            width = float(targets.values[f"{group}/known/band/width"])
            targets.at_most(label, width, WIDEST, "")
    if not coverage:
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
        found = list(chain(*pool.map(plant_case, jobs)))
    recorded = DATA.is_dir()
    if recorded:
        found += [*carmaker_cases(), *dart_cases()]
    else:
        print(f"  without recordings: they are not there: {DATA} (set TIREID_DATA)")
    report(found, targets)
    c_cost(targets)
    everything = options.each == EACH and options.first == FIRST_SEED and recorded
    return targets.finish(keep=keep and everything)


if __name__ == "__main__":
    sys.exit(main())
