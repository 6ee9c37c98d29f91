"""The files of `tireid compare`: compare.json, whose keys are stable, tables, CSV and figures.

compare.json: recordings (samples, duration, rms_force_N); judged_by (truth, or motion: mean forces
from the motion over 0.3 s); methods: by name online_N by recording, frozen_N by recording of
identification and of replay (null: a signal, no model), diverged_at_s by recording, percent (means
of both axles: online, in_sample, other), side_slip by recording of methods that estimate v_y
(rms_deg, within_two_sigma_percent), step_s and step_ratio (null: it learns from whole logs);
left_out: by name why a method is not compared.
verdict: by recording, of the default identified there (valid, findings, numbers, measures).
Errors are {"front", "rear"} in N; null stands for what diverged or is not there.
"""

import csv
from collections.abc import Iterator
from dataclasses import astuple
from itertools import compress, product
from pathlib import Path
from typing import Any

import numpy as np

from codegen.writing import naming, write_file
from identifier.compare.course import INFINITE, same_and_other
from identifier.compare.study import Comparison, ranking
from identifier.frozen import vehicle_numbers
from identifier.methods import DEFAULT, make_method, methods
from identifier.reproducibility import AxleRmse, freeze_key
from tireid import __version__
from tireid.figures.compare import methods_figure
from tireid.figures.side_slip import side_slip_figure
from tireid.figures.style import save_figures
from tireid.output import text_table, write_json
from tireid.progress import say
from tireid.report import (
    Block,
    Headline,
    Images,
    Note,
    Report,
    Section,
    Table,
    drawings,
    origin,
    write_report,
)
from tireid.verdicts import Verdicts, verdicts_headline, verdicts_notes


def summary_rows(comparison: Comparison) -> list[list[str]]:
    """Return the means over recordings of every method, best on other recordings first."""
    lines = [["method", "online", "frozen, same drive", "frozen, elsewhere"]]
    lines[0] += ["side slip [deg]", "within 2 sigma", "step"]  # of methods that estimate v_y
    for name in ranking(comparison):
        trial, time = comparison.trials[name], "-"
        if name in comparison.step_times:
            time = f"{1e9 * comparison.step_times[name]:.0f} ns x{comparison.time_ratio(name):.2f}"
        pairs = same_and_other(trial.frozen or {})
        cells = [_mean(comparison, some) for some in ([*trial.online.items()], *pairs)]
        if trial.diverged_at:
            cells = ["diverged"] * 3
        if trial.frozen is None:
            cells[1:] = "a signal, no model", ""
        errors = [one.rms for one in trial.side_slip.values() if one.rms is not None]
        shares = [one.within for one in trial.side_slip.values() if one.within is not None]
        cells.append(f"{np.mean(errors):.3f}" if errors else "-")
        cells.append(f"{np.mean(shares):.0f} %" if shares else "-")
        lines.append([name, *cells, time])
    return lines


_WITHOUT_V_Y = "get no v_y; they estimate it, and side slip is judged by the recorded one"


def summary_table(comparison: Comparison) -> str:
    n, measure = len(comparison.names), comparison.course.measure
    title = f"{measure}, front / rear, % of rms (N), mean over {n} recordings"
    rows = _text(title, summary_rows(comparison))
    return rows + "".join(f"  {line}\n" for line in remarks(comparison))


def remarks(comparison: Comparison) -> list[str]:
    """Return what the methods say of themselves below the table, those alike in one line."""
    notes: dict[str, list[str]] = {}
    for name in comparison.trials:
        if name in methods():
            method = make_method(name, comparison.course.vehicle, comparison.seed)
            notes.setdefault(method.remark, []).append(name)
            if "v_y" not in method.needs:
                notes.setdefault(_WITHOUT_V_Y, []).append(name)
    for name, why in comparison.left_out.items():
        notes.setdefault(why, []).append(name)
    return [f"{', '.join(names)}: {remark}" for remark, names in notes.items() if remark]


def pair_tables(comparison: Comparison) -> str:
    blocks = []
    for learnt, replayed in product(comparison.names, repeat=2):
        lines = []
        for name in ranking(comparison):
            frozen = comparison.trials[name].frozen
            if frozen is not None:
                error = frozen.get(learnt, {}).get(replayed, INFINITE)
                lines.append([name, _mean(comparison, [(replayed, error)])])
        title = f"identified on {learnt}, frozen, replayed on {replayed}"
        blocks += [_text(title, lines)] if lines else []
    return "\n".join(blocks)


def _mean(comparison: Comparison, pairs: list[tuple[str, AxleRmse]]) -> str:
    """Return a mean of errors as percent of the rms force and in newtons, front / rear."""
    if not pairs:
        return ""
    newtons = np.array([astuple(error) for _, error in pairs])
    sizes = _sizes(comparison)
    parts = np.mean(newtons / [astuple(sizes[name]) for name, _ in pairs], axis=0)
    newtons = newtons.mean(axis=0)
    if not np.isfinite(newtons).all():
        return "diverged"
    front, rear = (
        f"{100.0 * p:.1f} ({n:{'.0f' if n >= 100.0 else '.3g'}})"  # three digits, or more
        for p, n in zip(parts, newtons, strict=True)
    )
    return f"{front} / {rear}"


def _sizes(comparison: Comparison) -> dict[str, AxleRmse]:
    """Return the rms force of each recording [N]."""
    return {one.name: comparison.course.size(one) for one in comparison.course.recordings}


def _text(title: str, lines: list[list[str]]) -> str:
    return "\n".join([title, text_table(lines, indent="  "), ""])


def write_comparison(folder: Path, comparison: Comparison, verdicts: Verdicts) -> dict[str, bytes]:
    """Write everything that was found out into a folder; return the figures by their file's name.

    verdicts : on what the default learns, by recording.
    """
    judged = {"verdict": {name: verdict.to_dict() for name, verdict in verdicts.items()}}
    write_json(folder / "compare.json", _comparison_numbers(comparison) | judged)
    write_file(folder / "tables.txt", summary_table(comparison) + pair_tables(comparison))
    path = folder / "compare.csv"
    with naming(path), path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(_ERROR_COLUMNS)
        for row in _error_rows(comparison):
            writer.writerow(f"{cell:.9g}" if isinstance(cell, float) else cell for cell in row)
    say("drawing figures")
    figures = {"methods": methods_figure(comparison)}
    if any(trial.side_slip for trial in comparison.trials.values()):
        notes = {name: trial.side_slip for name, trial in comparison.trials.items()}
        figures["side_slip"] = side_slip_figure(comparison.course.recordings, notes)
    return save_figures(folder, figures)


def _comparison_numbers(comparison: Comparison) -> dict[str, Any]:
    course, sizes, methods = comparison.course, _sizes(comparison), dict[str, Any]()
    for name, trial in comparison.trials.items():
        timed = name in comparison.step_times
        methods[name] = {
            "online_N": trial.online,
            "frozen_N": trial.frozen,
            "diverged_at_s": trial.diverged_at,
            "percent": comparison.shares(name)._asdict(),
            "side_slip": {
                recording: {"rms_deg": one.rms, "within_two_sigma_percent": one.within}
                for recording, one in trial.side_slip.items()
            },
            "step_s": comparison.step_times[name] if timed else None,
            "step_ratio": comparison.time_ratio(name) if timed else None,
        }
    return {
        "recordings": {
            one.name: {
                "samples": len(one),
                "duration_s": one.duration,
                "rms_force_N": sizes[one.name],
            }
            for one in course.recordings
        },
        "judged_by": "motion" if course.by_motion else "truth",
        "methods": methods,
        "left_out": comparison.left_out,
        "vehicle": vehicle_numbers(course.vehicle),
        "min_speed_m_s": course.min_speed,
        "seed": comparison.seed,
        "version": __version__,
    }


_ERROR_COLUMNS = (
    "method", "kind", "identified_on", "replayed_on", "front_N", "rear_N",
    "front_percent", "rear_percent", "both_percent",
)  # fmt: skip


def _error_rows(comparison: Comparison) -> Iterator[tuple[str | float, ...]]:
    sizes = _sizes(comparison)
    for method, trial in comparison.trials.items():
        found = [("online", name, name, error) for name, error in trial.online.items()]
        for learnt, replays in (trial.frozen or {}).items():
            found += [("frozen", learnt, name, error) for name, error in replays.items()]
        for kind, learnt, name, error in found:
            size, both = sizes[name], comparison.course.share(name, error)
            shares = 100 * error.front / size.front, 100 * error.rear / size.rear
            yield method, kind, learnt, name, error.front, error.rear, *shares, both


def write_compare_report(
    folder: Path,
    comparison: Comparison,
    figures: Images,
    verdicts: Verdicts,
    command: str,
) -> None:
    """Write the report of a comparison.

    verdicts : on what the default learns, by recording.
    """
    course, said, rows = comparison.course, remarks(comparison), summary_rows(comparison)
    slips = ", ".join(f"{row[0]} {row[4]}°" for row in rows[1:] if row[4] != "-")
    known = [not {*cells} <= {"-", ""} for cells in zip(*rows[1:], strict=True)]
    rows = [list(compress(row, known)) for row in rows]
    captions = {
        "methods": _methods_caption(comparison),
        "side_slip": f"Side slip estimated without a lateral velocity, rms error: {slips}.",
    }
    blocks: list[Block] = [
        Table(
            f"{course.measure}, front / rear, in percent of the rms force (and N), mean "
            f"over {len(comparison.names)} recordings." + "".join(f" {line}." for line in said),
            rows[0],
            rows[1:],
        ),
        *drawings(figures, captions),
    ]
    meaning = f"recordings with a valid model of {DEFAULT}, the default"
    report = Report(
        title=f"Methods compared on {course.vehicle.name}",
        summary="Each method is identified on each recording, frozen at its end and replayed on "
        "all.",
        numbers=[*verdicts_headline(verdicts, meaning), *_compare_headlines(comparison)][:3],
        notes=[*verdicts_notes(verdicts), *_compare_notes(comparison)],
        sections=[
            Section("Errors of the methods", blocks),
            origin(command, course.vehicle, course.recordings, seed=str(comparison.seed)),
        ],
    )
    write_report(folder, report)


def _errors(comparison: Comparison) -> tuple[str, dict[str, float]]:
    """Return where errors are compared, and the error of each method there, the best first [%]."""
    kind, where = "in_sample", "on the same recording"
    if len(comparison.names) > 1:
        kind, where = "other", "on other recordings"
    shares = {name: getattr(comparison.shares(name), kind) for name in ranking(comparison)}
    finite = {name: one for name, one in shares.items() if one is not None and np.isfinite(one)}
    return where, finite


def _compare_headlines(comparison: Comparison) -> list[Headline]:
    where, errors = _errors(comparison)
    return [
        Headline(f"{value:.1f} %", f"error of {name} {where}, over the rms force")
        for name, value in errors.items()
    ]


def _methods_caption(comparison: Comparison) -> str:
    where, errors = _errors(comparison)
    ends = [f"{name} {value:.1f} %" for name, value in errors.items()]
    least = f"; frozen {where} from {ends[0]} to {ends[-1]} of the rms force" if ends else ""
    return f"Errors of every method{least}."


def _compare_notes(comparison: Comparison) -> list[Note]:
    estimates = comparison.course.vehicle.estimates
    said = [Note(f"{estimates}.")] * bool(estimates)
    if comparison.course.by_motion:
        text = (
            "Without true forces, methods are judged by the mean force in the motion over 0.3 s, "
            "sensor noise subtracted. A wrong mass scales all alike."
        )
        said.append(Note(text))
    for name, trial in comparison.trials.items():
        at = [f"{where} at {freeze_key(t)} s" for where, t in trial.diverged_at.items()]
        if at:
            said.append(Note(f"{name} diverged on {', '.join(at)}."))
    if len(comparison.names) == 1:
        said.append(Note("One recording only: give a second one as validation drive."))
    return said
