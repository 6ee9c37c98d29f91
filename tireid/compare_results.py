"""The files of `tireid compare`: compare.json, whose keys are stable, tables, CSV and figures.

compare.json: recordings (samples, duration, rms_force_N); methods: by name online_N by recording,
frozen_N by recording learnt on and recording replayed (null: a signal, no model), diverged_at_s by
recording, percent (means of both axles: online, in_sample, other), step_s and step_ratio; floors:
by network frozen_N and percent; sweep: by method designs, diverged, default, best, front, trials.
Errors are {"front", "rear"} in N; null stands for what diverged or is not there.
"""

import csv
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from identifier.cross_replay import Shares, frozen_shares
from identifier.model_format import vehicle_numbers
from identifier.pareto import best_candidate, pareto_front
from identifier.reproducibility import AxleRmse
from identifier.sweep import Candidate
from tireid import __version__
from tireid.compare_study import Comparison, Frozen
from tireid.compare_table import pair_tables, summary_table, sweep_table
from tireid.figures import matrix_figure, methods_figure, pareto_figure, save_figure
from tireid.output import write_json
from tireid.progress import say

Row = tuple[str | float | int, ...]


def write_comparison(folder: Path, comparison: Comparison) -> None:
    """Write everything that was found out into a folder.

    Parameters
    ----------
    folder : an empty folder.
    comparison : the methods.
    """
    write_json(folder / "compare.json", comparison_numbers(comparison))
    (folder / "tables.txt").write_text(comparison_text(comparison) + pair_tables(comparison))
    _write_rows(folder / "compare.csv", ERROR_COLUMNS, _error_rows(comparison))
    if comparison.sweeps:
        _write_rows(folder / "sweep.csv", SWEEP_COLUMNS, _sweep_rows(comparison))
    say("drawing figures")
    save_figure(methods_figure(comparison), folder / "methods.png")
    if any(trial.frozen for trial in comparison.trials.values()):
        save_figure(matrix_figure(comparison), folder / "matrix.png")
    if comparison.sweeps:
        save_figure(pareto_figure(comparison), folder / "pareto.png")


def comparison_text(comparison: Comparison) -> str:
    """Return the summary, and that of the sweep, as lines of text.

    Parameters
    ----------
    comparison : the methods.
    """
    text = summary_table(comparison)
    return text + (sweep_table(comparison) if comparison.sweeps else "")


def comparison_numbers(comparison: Comparison) -> dict[str, Any]:
    """Return what compare.json holds.

    Parameters
    ----------
    comparison : the methods.
    """
    course = comparison.course
    return {
        "recordings": {
            recording.name: {
                "samples": len(recording),
                "duration_s": recording.duration,
                "rms_force_N": _axles(course.size(recording)),
            }
            for recording in course.recordings
        },
        "methods": {name: _method_numbers(comparison, name) for name in comparison.trials},
        "floors": {
            name: {
                "frozen_N": _pairs(frozen),
                "percent": dict(
                    zip(("in_sample", "other"), frozen_shares(frozen, course), strict=True)
                ),
            }
            for name, frozen in comparison.floors.items()
        },
        "sweep": {
            name: _sweep_numbers(comparison, name, candidates)
            for name, candidates in comparison.sweeps.items()
        },
        "vehicle": vehicle_numbers(course.vehicle),
        "min_speed_m_s": course.min_speed,
        "seed": comparison.seed,
        "version": __version__,
    }


def _method_numbers(comparison: Comparison, name: str) -> dict[str, Any]:
    trial = comparison.trials[name]
    return {
        "online_N": {recording: _axles(error) for recording, error in trial.online.items()},
        "frozen_N": None if trial.frozen is None else _pairs(trial.frozen),
        "diverged_at_s": dict(trial.diverged_at),
        "percent": _percent(comparison.shares(name)),
        "step_s": comparison.step_times[name],
        "step_ratio": comparison.time_ratio(name),
    }


def _sweep_numbers(
    comparison: Comparison, name: str, candidates: tuple[Candidate, ...]
) -> dict[str, Any]:
    best = best_candidate(candidates)
    return {
        "designs": len(candidates),
        "diverged": sum(bool(candidate.diverged_on) for candidate in candidates),
        "default": _percent(comparison.shares(name)),
        "best": None if best is None else _candidate(best),
        "front": [_candidate(candidate) for candidate in pareto_front(candidates)],
        "trials": [_candidate(candidate) for candidate in candidates],
    }


def _candidate(candidate: Candidate) -> dict[str, Any]:
    return {
        "values": dict(candidate.values),
        "percent": _percent(candidate.shares),
        "diverged_on": list(candidate.diverged_on),
    }


def _percent(found: Shares) -> dict[str, float | None]:
    return found._asdict()


def _axles(error: AxleRmse) -> dict[str, float]:
    return {"front": error.front, "rear": error.rear}


def _pairs(frozen: Frozen) -> dict[str, dict[str, dict[str, float]]]:
    return {
        learnt: {name: _axles(error) for name, error in replays.items()}
        for learnt, replays in frozen.items()
    }


ERROR_COLUMNS = (
    "method",
    "kind",
    "learnt_on",
    "replayed_on",
    "front_N",
    "rear_N",
    "front_percent",
    "rear_percent",
    "both_percent",
)
SWEEP_COLUMNS = (
    "method",
    "number",
    "diverged",
    "online_percent",
    "in_sample_percent",
    "other_percent",
    "values",
)


def _error_rows(comparison: Comparison) -> Iterator[Row]:
    sizes = {rec.name: comparison.course.size(rec) for rec in comparison.course.recordings}

    def row(method: str, kind: str, learnt: str, name: str, error: AxleRmse) -> Row:
        front, rear = error.front / sizes[name].front, error.rear / sizes[name].rear
        both = comparison.course.share(name, error)
        return method, kind, learnt, name, error.front, error.rear, 100 * front, 100 * rear, both

    def frozen_rows(method: str, kind: str, frozen: Frozen) -> Iterator[Row]:
        for learnt, replays in frozen.items():
            for name, error in replays.items():
                yield row(method, kind, learnt, name, error)

    for method, trial in comparison.trials.items():
        for name, error in trial.online.items():
            yield row(method, "online", name, name, error)
        yield from frozen_rows(method, "frozen", trial.frozen or {})
    for network, frozen in comparison.floors.items():
        yield from frozen_rows(network, "floor", frozen)


def _sweep_rows(comparison: Comparison) -> Iterator[Row]:
    for method, candidates in comparison.sweeps.items():
        for number, candidate in enumerate(candidates):
            found = ["" if value is None else value for value in candidate.shares]
            values = _words(candidate.values)
            yield method, number, " ".join(candidate.diverged_on), *found, values


def _words(values: Mapping[str, float]) -> str:
    return " ".join(f"{name}={value:.6g}" for name, value in values.items())


def _write_rows(path: Path, columns: tuple[str, ...], rows: Iterator[Row]) -> None:
    with path.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        for row in rows:
            writer.writerow(f"{cell:.9g}" if isinstance(cell, float) else cell for cell in row)
