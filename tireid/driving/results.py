"""The files of `tireid drive`: numbers as JSON, every signal as CSV, figures as PNG, the film."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from codegen.arrays import Array
from identifier.frozen import vehicle_numbers
from identifier.tire_model import TireModel
from models.files import digest
from mpc.handover.rules import Verdict
from mpc.loop.record import Drive, estimate_scores
from mpc.tires import CurveFitError, prediction_tire
from mpc.tires.tire import curves_at
from tireid import __version__
from tireid.driving.runs import (
    FROZEN,
    FULL,
    IMU,
    LEARNING,
    LINEAR,
    ORACLE,
    ClosedLoop,
    Conditions,
    run_drive,
)
from tireid.driving.setup import PERIOD, PLANT, Setup, faster_than
from tireid.figures.drive import (
    AT_THE_END,
    drive_errors_figure,
    drive_path_figure,
    drive_solve_figure,
    drive_steering_figure,
)
from tireid.figures.film import Film, write_film
from tireid.figures.side_slip import drive_lateral_figure
from tireid.figures.style import save_figures
from tireid.figures.tires import TireCurve, axle_slip, drive_tires_figure
from tireid.output import axle_columns, finite, text_table, write_csv, write_json
from tireid.progress import say
from tireid.report import (
    READ,
    Block,
    Headline,
    Images,
    Note,
    Picture,
    Report,
    Section,
    Table,
    drawings,
    origin,
    printed,
    write_report,
)
from tireid.reports.captions import curves_caption

NO_FILM = "none"
_AT_LIMIT = 0.99  # of a limit: the steering rate is at it
_Runs = Sequence[ClosedLoop]


def headline(conditions: Conditions) -> str:
    """Return a case in one line."""
    setup = conditions.setup
    v = setup.speeds()
    planned = f"{v.min():.1f} to {v.max():.1f} m/s as planned"
    speed = f"{v.min():.1f} m/s" if np.ptp(v) < 0.05 else planned
    share = setup.wish.words + ", earned on the way" * conditions.confirm
    drops = "".join(f", {mu:g} from {s:g} m on" for s, mu in setup.drops)
    noise = "sensor noise" if conditions.noise else "no noise"
    noise += f", caution {conditions.caution:g}" if conditions.caution > 0.0 else ""
    noise += ", no v_y" if conditions.kind == IMU else ""
    noise += "".join(f", {fault}" for fault in conditions.faults)
    return (
        f"{setup.path.name} at {speed}{share}; friction {setup.mu:g}{drops}; "
        f"{PLANT} {setup.vehicle.name}, {1e3 * PERIOD * conditions.delay:g} ms delay, "
        f"{noise}, seed {conditions.seed}"
    )


class Drives(NamedTuple):
    """Drives along one path on several tires, the first of which leads.

    learnt : the frozen tires, None where none drives on them.   source : where they are from.
    """

    conditions: Conditions
    runs: _Runs
    learnt: TireModel | None
    source: str

    @classmethod
    def driven(
        cls, conditions: Conditions, labels: Sequence[str], learnt: TireModel | None, source: str
    ) -> "Drives":
        """Drive once on each tire."""
        runs = [run_drive(label, conditions, learnt) for label in labels]
        return cls(conditions, runs, learnt, source)

    @property
    def inputs(self) -> dict[str, Any]:
        """All that goes into the drives, ready for JSON."""
        conditions, setup = self.conditions, self.conditions.setup
        v, chassis = setup.speeds(), setup.vehicle.require_chassis()
        tire = None if setup.tires is None else digest(repr(setup.tires))
        if chassis.tire is not None:  # a hash in place of its file
            tire = digest(Path(chassis.tire).read_text(errors="replace", encoding="utf-8"))
        return {
            "path": setup.path.name,
            "path_hash": digest([setup.path.X.tolist(), setup.path.Y.tolist()]),
            "length_m": setup.path.length,
            "closed": setup.path.closed,
            "laps": conditions.laps,
            "speed": {
                "share": setup.wish.share,
                "a_y_m_s2": setup.wish.a_y,
                "m_s": setup.wish.speed,
                **({"v_max_m_s": most} if (most := setup.wish.most) < np.inf else {}),
                "confirm": conditions.confirm,
            },
            "speed_m_s": {"min": float(v.min()), "max": float(v.max())},
            "mu": setup.mu,
            "mu_drops": [{"s_m": s, "mu": mu} for s, mu in setup.drops],
            "tires": [run.label for run in self.runs],
            "frozen": self.source,
            "weights_hash": None if self.learnt is None else digest(self.learnt.to_dict()),
            "plant": PLANT,
            "vehicle": vehicle_numbers(setup.vehicle),
            "chassis": {k: x for k, x in asdict(chassis).items() if x != ()} | {"tire": tire},
            "delay_ms": 1e3 * PERIOD * conditions.delay,
            "period_ms": 1e3 * PERIOD,
            "noise": conditions.noise,
            **({"sensors": conditions.kind} if conditions.kind != FULL else {}),
            **({"caution": conditions.caution} if conditions.caution > 0.0 else {}),
            "faults": [finite(fault) for fault in conditions.faults],
            "seed": conditions.seed,
        }

    def write(self, folder: Path, film: str) -> dict[str, bytes]:
        """Write everything about the drives; return the figures by the name of their file.

        film : webp, gif or none.
        """
        first, setup, faults = self.runs[0], self.conditions.setup, self.conditions.faults
        curves = _known_curves(self.runs, setup, self.learnt)
        scores = {run.label: _scores(run) for run in self.runs}
        facts = {"tires": first.label, "drives": scores, "inputs": self.inputs}
        facts |= {"hash": digest(self.inputs), "version": __version__}
        write_json(folder / "summary.json", scores[first.label] | facts)
        for run in self.runs:
            name = "drive.csv" if run is first else f"drive_{run.label}.csv"
            write_csv(folder / name, _drive_columns(run.drive))
        say("drawing figures")
        drives = {run.label: run.drive for run in self.runs}
        on_the_way: dict[str, Any] = {"drops": setup.drops, "faults": faults}
        limits = first.problem.limits
        figures = {
            "path": drive_path_figure(drives),
            "errors": drive_errors_figure(drives, off_path=setup.widest, **on_the_way),
            "steering": drive_steering_figure(
                drives, angle_limit=limits.steering, rate_limit=limits.steering_rate, **on_the_way
            ),
            "tires": drive_tires_figure(first.drive, curves),
            "solve_times": drive_solve_figure(first.drive),
        }
        if first.drive.estimates:
            figures["lateral"] = drive_lateral_figure(first.drive)
        images = save_figures(folder, figures)
        if film != NO_FILM:
            title = f"{first.drive.path.name}: {first.label} tires"
            drawn = Film(title, drives, curves, setup.drops, first.known, first.model)
            write_film(folder / f"drive.{film}", drawn)
        return images

    @property
    def faster(self) -> str:
        """Where the plan is faster than the log of the tires, and what to do; else empty."""
        speeds = None if self.learnt is None else self.learnt.drives.speeds
        if speeds is None:
            return ""
        setup, why = self.conditions.setup, "the tires are extrapolated; add"
        option = "--speed" if setup.constant else "--v-max"
        return faster_than(setup.speeds(), float(speeds[1]), why, option)

    def text(self) -> str:
        lines = [headline(self.conditions), text_table([SCORES, *score_rows(self.runs)], "<>><>>")]
        lines += [self.faster] if self.faster else []
        for run in self.runs:
            got = estimate_scores(run.drive)
            if got is not None:
                lines.append(
                    f"{run.label}: v_y estimated to {got.rms_error_m_s:.3f} m/s, side slip to "
                    f"{got.rms_error_deg:.2f} of {got.rms_deg:.2f} degrees rms; "
                    f"{100.0 * got.within_two_sd:.0f} % of the errors within two standard "
                    "deviations"
                )
        for run in self.runs:
            lines += [f"{run.label} at {t:.2f} s: {note}" for t, note in run.drive.notes]
        return "\n".join(lines)


SCORES = ("tires", "rms e_y", "peak e_y", "completed", "failures", "wall time: median / p99 / max")


def score_rows(runs: _Runs) -> list[list[str]]:
    rows = []
    for run in runs:
        score, end = run.scores, f"no: {run.drive.ending} at {run.drive.s[-1]:.0f} m"
        failures = ", ".join(f"{n} {name}" for name, n in score.failures.items()) or "0"
        times = " / ".join(f"{score.solve_ms[key]:.3f}" for key in ("median", "p99", "max"))
        off = [f"{score.rms_e_y_m:.3f} m", f"{score.peak_e_y_m:.3f} m"]
        rows.append([run.label, *off, "yes" if score.completed else end, failures, f"{times} ms"])
    return rows


def _scores(run: ClosedLoop) -> dict[str, Any]:
    notes = [{"t_s": t, "note": text} for t, text in run.drive.notes]
    given = estimate_scores(run.drive)
    lateral = {} if given is None else {"lateral_velocity": given._asdict()}
    return {**run.scores._asdict(), **lateral, "ending": run.drive.ending, "notes": notes}


_COLUMNS_ESTIMATED = {
    "v_y": "v_y_estimated_m_s",
    "v_y_sd": "v_y_estimated_sd_m_s",
    "observable": "side_slip_observable",
    "a_y": "a_y_level_m_s2",
    "inertial_v_y": "v_y_inertial_m_s",
    "inertial_v_y_sd": "v_y_inertial_sd_m_s",
}
_UNITS = {  # of signals of a drive, by their name, in the order of columns
    "t": "s", "s": "m", "X": "m", "Y": "m", "psi": "rad", "v_x": "m_s", "v_y": "m_s", "r": "rad_s",
    "a_x": "m_s2", "a_y": "m_s2", "delta": "rad", "command": "rad", "e_y": "m", "e_psi": "rad",
    "kappa": "1_m", "v_ref": "m_s",
}  # fmt: skip


def _drive_columns(drive: Drive) -> dict[str, Array]:
    """Return every signal of a drive by the name of its column, with its unit."""
    return {
        **{f"{name}_{_UNITS[name]}": getattr(drive, name) for name in _UNITS},
        **axle_columns("alpha_{}_rad", axle_slip(drive)),
        **axle_columns("Fy{}_N", drive.axle_force),
        "status": drive.status.astype(np.float64),
        "solve_time_s": drive.solve_time,
        **{
            f"{name}_measured_{_UNITS[name]}": values
            for name, values in drive.measured.items()
            if name != "t"
        },
        **{_COLUMNS_ESTIMATED[name]: values for name, values in drive.estimates.items()},
    }


def _known_curves(runs: _Runs, setup: Setup, learnt: TireModel | None) -> list[TireCurve]:
    """Return the tires of the trackers, and the linear and the true tire beside it.

    An identified one is NaN beyond the slip up to which it was identified.
    """
    models, known = {LINEAR: prediction_tire(setup.vehicle)}, {}
    if learnt is not None:
        models[FROZEN] = prediction_tire(learnt, setup.vehicle)
        known[FROZEN] = learnt.known_slip
    for run in runs:
        if run.label != LEARNING:
            models[run.label] = run.model
        if run.label != ORACLE and run.final is not run.model:
            models[run.label + AT_THE_END] = run.final
            since = [one.slip for one in run.known if (one.steering == run.final.weights).all()]
            known[run.label + AT_THE_END] = next(iter(since), None)
    with suppress(CurveFitError):  # a true tire that no curve can follow is not drawn
        models[ORACLE] = setup.oracle()
        if setup.drops:
            models[ORACLE + AT_THE_END] = setup.oracle(setup.drops[-1][1])
    v_x, slip = float(setup.speeds().mean()), np.linspace(-0.35, 0.35, 281)
    curves = []
    for label, model in models.items():
        force, end = curves_at(model, slip, v_x).T, known.get(label)
        if end is not None:
            force = np.where(np.abs(slip)[:, None] > end, np.nan, force)
        curves.append(TireCurve(label, slip, force))
    return curves


def write_drive_report(
    folder: Path, drives: Drives, figures: Images, film: str, command: str
) -> None:
    """Write the report of drives along one path."""
    runs = drives.runs
    first = runs[0]
    report = Report(
        title=f"{first.drive.path.name} on {first.label} tires",
        summary=f"{headline(drives.conditions)}.",
        numbers=_drive_headlines(runs),
        notes=_drive_notes(drives),
        sections=[
            Section("How the car drove", _drive_blocks(folder, drives, figures, film)),
            Section("The tracker's tires", known_blocks(drives, figures)),
            Section("Timing", drawings(figures, {"solve_times": _timing_caption(first)})),
            origin(
                command,
                first.drive.vehicle,
                (),
                tires=drives.source,
                **({"simulated_car": assumed} if (assumed := first.drive.vehicle.assumed) else {}),
                all_inputs=f"hash {digest(drives.inputs)}, listed in summary.json",
            ),
        ],
    )
    write_report(folder, report)


def _drive_headlines(runs: _Runs) -> list[Headline]:
    """Return how far the first car was off its path, and whether a step ends in time."""
    first, score = runs[0], runs[0].scores
    s, peak = _farthest(first)
    end = "" if score.completed else f": {first.drive.ending}"
    slow, period = score.solve_ms["p99"], 1e3 * PERIOD
    return [
        Headline(
            f"{score.rms_e_y_m:.3f} m",
            f"rms deviation from the path, {first.label} tires{end}",
            "bad" if end else "",
        ),
        Headline(f"{peak:.3f} m", f"largest deviation, at {s:.1f} m"),
        Headline(
            f"{slow:.2g} ms",
            f"within which 99 of 100 steps of the tracker end (period {period:g} ms)",
            "bad" if slow > period else "",
        ),
    ]


def _farthest(run: ClosedLoop) -> tuple[float, float]:
    """Return where a car is farthest off its path, and by how much [m]."""
    k = int(np.abs(run.drive.e_y).argmax())
    return float(run.drive.s[k]), float(abs(run.drive.e_y[k]))


def _drive_notes(drives: Drives) -> list[Note]:
    runs, said = drives.runs, [Note(f"{drives.faster}.")] if drives.faster else []
    for run in runs:
        scores = run.scores
        if not scores.completed:
            text = f"{run.drive.ending} at {run.drive.s[-1]:.0f} m; its numbers end there."
            said.append(Note(text, "bad" if run is runs[0] else "", run.label))
        if scores.failures:
            counted = ", ".join(f"{n} {name}" for name, n in scores.failures.items())
            said.append(Note(f"steps of the tracker failed: {counted}.", where=run.label))
        if scores.solve_ms["p99"] > 1e3 * PERIOD:
            text = "one step in a hundred takes longer than the period."
            said.append(Note(text, where=run.label))
        for t, text in run.drive.notes:
            if text.startswith(Verdict.FAULT.value) or "dead reckoning" in text:
                said.append(Note(f"at {t:.2f} s: {printed(text)}.", where=run.label))
    return said


def errors_caption(drives: Drives) -> str:
    """Return how far each car is off its path and where, and where friction changes."""
    most = ", ".join(
        f"{run.label} {peak:.3f} m at {s:.1f} m"
        for run in drives.runs
        for s, peak in [_farthest(run)]
    )
    drops = "".join(
        f"; friction is {mu:g} from {s:g} m on" for s, mu in drives.conditions.setup.drops
    )
    return f"Deviation, heading, acceleration and speed. Largest deviation: {most}{drops}."


def _steering_caption(run: ClosedLoop) -> str:
    drive, limits = run.drive, run.problem.limits
    rate = np.abs(np.diff(drive.command) / np.diff(drive.t))
    at = np.mean(rate > _AT_LIMIT * limits.steering_rate)
    most, limit = np.degrees([np.abs(drive.command).max(), limits.steering])
    return (
        f"Steering of {run.label}: at most {most:.1f}° (limit {limit:.0f}°), at the limit of "
        f"its rate in {100.0 * at:.0f} % of the steps."
    )


def _timing_caption(run: ClosedLoop) -> str:
    ms, period = run.scores.solve_ms, 1e3 * PERIOD
    late = int(np.count_nonzero(run.drive.solve_time > PERIOD))
    return (
        f"Time of a step: median {ms['median']:.2g}, largest {ms['max']:.2g} ms; {late} of "
        f"{len(run.drive)} steps take longer than the period of {period:g} ms."
    )


def _drive_blocks(folder: Path, drives: Drives, figures: Images, film: str) -> list[Block]:
    first = drives.runs[0]
    blocks: list[Block] = [Table("Scores of the drives.", SCORES, score_rows(drives.runs))]
    if film != NO_FILM:
        blocks.append(film_picture(folder / f"drive.{film}", drives.runs))
    ends = [f"{run.label} {run.drive.ending} at {run.drive.s[-1]:.0f} m" for run in drives.runs]
    captions = {
        "path": f"The path from above: {'; '.join(ends)}.",
        "errors": errors_caption(drives),
        "steering": _steering_caption(first),
    }
    return [*blocks, *drawings(figures, captions)]


def film_picture(path: Path, runs: _Runs) -> Picture:
    first, *others = runs
    beside = f"; outlines: {', '.join(run.label for run in others)}" if others else ""
    seconds, v = first.drive.t[-1], first.drive.v_x
    caption = (
        f"{seconds:.3g} s of the drive on {first.label} tires, driven at {v.min():.1f} to "
        f"{v.max():.1f} m/s{beside}."
    )
    return Picture(path, caption, READ["film"])


def known_blocks(drives: Drives, figures: Images) -> list[Block]:
    """Return what trackers believed of the tires, and what they were given on the way."""
    runs, first, setup = drives.runs, drives.runs[0].drive, drives.conditions.setup
    given, lateral = estimate_scores(first), ""
    if given is not None:
        lateral = (
            f": rms error of the estimate {given.rms_error_m_s:.3f} m/s, "
            f"{given.rms_error_deg:.2f}° of side slip ({given.rms_deg:.2f}° rms); "
            f"{100.0 * given.within_two_sd:.0f} % of the errors within two standard deviations"
        )
    captions = {
        "tires": curves_caption(first, _known_curves(runs, setup, drives.learnt), setup.drops),
        "lateral": f"Lateral velocity, which no sensor measured{lateral}.",
    }
    blocks: list[Block] = [*drawings(figures, captions)]
    notes = [[run.label, f"{t:.2f}", printed(text)] for run in runs for t, text in run.drive.notes]
    if notes:
        blocks.append(Table("Decisions along the way.", ["tires", "time [s]", "what"], notes))
    return blocks
