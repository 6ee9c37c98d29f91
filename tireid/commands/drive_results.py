"""The files of `tireid drive`: numbers as JSON, every signal as CSV, figures as PNG, the film."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from codegen.arrays import Array
from identifier.tire_model import TireModel
from models.faults import SensorFault
from models.files import digest
from mpc.loop import Drive, told_scores
from mpc.tires import CurveFitError, prediction_tire
from tireid import __version__
from tireid.animation import write_film
from tireid.animation.known import known_over_time, steady_curve
from tireid.driving.runs import FROZEN, LEARNING, LINEAR, ORACLE, WIDEST, Run
from tireid.driving.setup import Setup
from tireid.figures.drive import (
    AT_THE_END,
    drive_errors_figure,
    drive_path_figure,
    drive_solve_figure,
    drive_steering_figure,
)
from tireid.figures.side_slip import drive_lateral_figure
from tireid.figures.style import save_figure
from tireid.figures.tires import TireCurve, axle_slip, drive_tires_figure
from tireid.output import text_table, write_csv, write_json
from tireid.progress import say

NO_FILM = "none"


def write_drives(
    folder: Path,
    runs: Sequence[Run],
    curves: Sequence[TireCurve],
    *,
    inputs: Mapping[str, Any],
    drops: Sequence[tuple[float, float]],
    film: str,
    faults: Sequence[SensorFault] = (),
) -> dict[str, Figure]:
    """Write everything about drives along one path; return the figures by the name of their file.

    drops : arc length [m] and friction from there on.   film : webp, gif, mp4 or none.
    """
    first = runs[0]
    write_json(folder / "summary.json", summarize_drives(runs, inputs))
    for run in runs:
        name = "drive.csv" if run is first else f"drive_{run.label}.csv"
        write_csv(folder / name, drive_columns(run.drive))
    say("drawing figures")
    drives = {run.label: run.drive for run in runs}
    limits = first.problem.limits
    figures = {
        "path": drive_path_figure(drives),
        "errors": drive_errors_figure(drives, off_path=WIDEST, drops=drops, faults=faults),
        "steering": drive_steering_figure(
            drives,
            angle_limit=limits.steering,
            rate_limit=limits.steering_rate,
            drops=drops,
            faults=faults,
        ),
        "tires": drive_tires_figure(first.drive, curves),
        "solve_times": drive_solve_figure(first.drive),
    }
    if first.drive.told:
        figures["lateral"] = drive_lateral_figure(first.drive)
    for name, figure in figures.items():
        save_figure(figure, folder / f"{name}.png")
    if film != NO_FILM:
        title = f"{first.drive.path.name}: {first.label} tires"
        write_film(
            folder / f"drive.{film}",
            drives,
            curves,
            drops=drops,
            title=title,
            known=known_over_time(first.known, first.model, float(first.drive.v_x.mean())),
        )
    return figures


def summarize_drives(runs: Sequence[Run], inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return what summary.json holds: scores of the first drive and of each, and what went in."""
    by_label = {run.label: _scores(run) for run in runs}
    return {
        **by_label[runs[0].label],
        "tires": runs[0].label,
        "drives": by_label,
        "inputs": dict(inputs),
        "hash": digest(inputs),
        "version": __version__,
    }


def _scores(run: Run) -> dict[str, Any]:
    notes = [{"t_s": t, "note": text} for t, text in run.drive.notes]
    told = told_scores(run.drive)
    lateral = {} if told is None else {"lateral_velocity": told._asdict()}
    return {**run.scores.to_dict(), **lateral, "ending": run.drive.ending, "notes": notes}


COLUMNS_TOLD = {
    "v_y": "v_y_told_m_s",
    "v_y_sd": "v_y_told_sd_m_s",
    "observable": "side_slip_observable",
    "a_y": "a_y_level_m_s2",
    "inertial_v_y": "v_y_inertial_m_s",
    "inertial_v_y_sd": "v_y_inertial_sd_m_s",
}


def drive_columns(drive: Drive) -> dict[str, Array]:
    """Return every signal of a drive by the name of its column, with its unit."""
    slip = axle_slip(drive)
    units = {"t": "s", "psi": "rad", "r": "rad_s", "delta": "rad", "v_x": "m_s", "v_y": "m_s"}
    measured = {
        f"{name}_measured_{units.get(name, 'm_s2' if name == 'a_y' else 'm')}": values
        for name, values in drive.measured.items()
        if name != "t"
    }
    return {
        "t_s": drive.t,
        "s_m": drive.s,
        "X_m": drive.X,
        "Y_m": drive.Y,
        "psi_rad": drive.psi,
        "v_x_m_s": drive.v_x,
        "v_y_m_s": drive.v_y,
        "r_rad_s": drive.r,
        "a_x_m_s2": drive.a_x,
        "a_y_m_s2": drive.a_y,
        "delta_rad": drive.delta,
        "command_rad": drive.command,
        "e_y_m": drive.e_y,
        "e_psi_rad": drive.e_psi,
        "kappa_1_m": drive.kappa,
        "v_ref_m_s": drive.v_ref,
        "alpha_f_rad": slip[:, 0],
        "alpha_r_rad": slip[:, 1],
        "Fyf_N": drive.axle_force[:, 0],
        "Fyr_N": drive.axle_force[:, 1],
        "status": drive.status.astype(np.float64),
        "solve_time_s": drive.solve_time,
        **measured,
        **{COLUMNS_TOLD[name]: values for name, values in drive.told.items()},
    }


# What a tracker is told of the tires, as curves.


def known_curves(runs: Sequence[Run], setup: Setup, learnt: TireModel | None) -> list[TireCurve]:
    """Return what the trackers were told, and the linear and the true tire beside it."""
    models = {LINEAR: prediction_tire(setup.vehicle)}
    if learnt is not None:
        models[FROZEN] = prediction_tire(learnt, setup.vehicle)
    for run in runs:
        if run.label != LEARNING:
            models[run.label] = run.model
        if run.label != ORACLE and run.final is not run.model:
            models[run.label + AT_THE_END] = run.final
    with suppress(CurveFitError):  # a true tire that no curve can follow is not drawn
        models[ORACLE] = setup.oracle()
        if setup.drops:
            models[ORACLE + AT_THE_END] = setup.oracle(setup.drops[-1][1])
    v_x = float(setup.speeds().mean())
    return [steady_curve(label, model, v_x) for label, model in models.items()]


# What `tireid drive` prints: one line a drive.

TIMES = "wall time: median / p99 / max"
COLUMNS = ("tires", "rms e_y", "peak e_y", "completed", "failures", TIMES)


def drive_table(runs: Sequence[Run]) -> str:
    """Return the scores of drives as lines of text."""
    rows = [list(COLUMNS)]
    for run in runs:
        score = run.scores
        failures = ", ".join(f"{n} {name}" for name, n in score.failures.items()) or "0"
        times = " / ".join(f"{score.solve_ms[key]:.3f}" for key in ("median", "p99", "max"))
        off = [f"{score.rms_e_y_m:.3f} m", f"{score.peak_e_y_m:.3f} m"]
        rows.append([run.label, *off, _completed(run), failures, f"{times} ms"])
    lines = [text_table(rows, "<>><>>")]
    lines += [f"{run.label}: {told_words(run)}" for run in runs if run.drive.told]
    for run in runs:
        lines += [f"{run.label} at {t:.2f} s: {note}" for t, note in run.drive.notes]
    return "\n".join(lines)


def told_words(run: Run) -> str:
    """Return how right the v_y was that was told, in one line."""
    told = told_scores(run.drive)
    assert told is not None
    return (
        f"v_y told to {told.rms_error_m_s:.3f} m/s, side slip to {told.rms_error_deg:.2f} of "
        f"{told.rms_deg:.2f} degrees rms; {100.0 * told.within_two_sd:.0f} % of the errors within "
        f"two standard deviations"
    )


def _completed(run: Run) -> str:
    if run.scores.completed:
        return "yes"
    return f"no: {run.drive.ending} at {run.drive.s[-1]:.0f} m"
