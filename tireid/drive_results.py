"""The files of `tireid drive`: numbers as JSON, every signal as CSV, figures as PNG, the film."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mpc.loop import Drive
from tireid import __version__
from tireid.animation import write_film
from tireid.drive_case import digest
from tireid.drive_runs import WIDEST, Run
from tireid.figures import (
    TireCurve,
    axle_slip,
    drive_errors_figure,
    drive_path_figure,
    drive_solve_figure,
    drive_steering_figure,
    drive_tires_figure,
    save_figure,
)
from tireid.output import write_csv, write_json
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
) -> None:
    """Write everything about drives along one path.

    Parameters
    ----------
    folder : an empty folder.
    runs : the drives, the one that it is about first.
    curves : tires to draw behind the forces of the first.
    inputs : all that went in, ready for JSON.
    drops : arc length [m] and friction from there on.
    film : gif, mp4 or none.
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
        "errors": drive_errors_figure(drives, off_path=WIDEST, drops=drops),
        "steering": drive_steering_figure(
            drives, angle_limit=limits.steering, rate_limit=limits.steering_rate, drops=drops
        ),
        "tires": drive_tires_figure(first.drive, curves),
        "solve_times": drive_solve_figure(first.drive),
    }
    for name, figure in figures.items():
        save_figure(figure, folder / f"{name}.png")
    if film != NO_FILM:
        title = f"{first.drive.path.name}: {first.label} tires"
        write_film(folder / f"drive.{film}", drives, curves, drops=drops, title=title)


def summarize_drives(runs: Sequence[Run], inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return what summary.json holds: scores of the first drive and of each, and what went in.

    Parameters
    ----------
    runs : the drives.
    inputs : all that went in, ready for JSON.
    """
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
    return {**run.scores.to_dict(), "ending": run.drive.ending, "notes": notes}


def drive_columns(drive: Drive) -> dict[str, NDArray[np.float64]]:
    """Return every signal of a drive by the name of its column, with its unit.

    Parameters
    ----------
    drive : the drive.
    """
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
    }
