"""The files of `tireid identify`: numbers as JSON, every curve as CSV, figures as PNG."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from identifier.axle import AxleDesign
from identifier.design import Design
from identifier.history import History
from identifier.reproducibility import AxleRmse, Replay, freeze_key
from models.recordings import Recording
from tireid.figures import (
    error_figure,
    force_figure,
    inputs_figure,
    learnt_axles_figure,
    prediction_figure,
    save_figure,
    slip_figure,
    weights_figure,
)
from tireid.output import write_csv, write_json
from tireid.progress import say
from tireid.summary import summarize

Frozen = Mapping[float, Mapping[str, Replay]]
WEIGHTS = ("W", "V", "own")  # carried matrices that are the learnt model, by whatever method


def write_results(
    folder: Path, law: str, learnt: History, others: Sequence[History], frozen: Frozen
) -> None:
    """Write everything that was learnt into a folder.

    Parameters
    ----------
    folder : an empty folder.
    law : the law as the user named it.
    learnt : the online run that the weights come from.
    others : online runs of the same design over the recordings to predict.
    frozen : freeze time [s] to recording name to replay.
    """
    write_json(
        folder / "summary.json", summarize(law=law, learnt=learnt, others=others, frozen=frozen)
    )
    for t in frozen:
        name = "weights.json" if t == max(frozen) else f"weights_{freeze_key(t)}s.json"
        learnt.freeze(t).save(folder / name)
    _write_curves(folder, learnt, others, frozen)
    say("drawing figures")
    _draw(folder, learnt, others, frozen)


def file_name(recording: Recording) -> str:
    """Return the name of a recording as part of a file name.

    Parameters
    ----------
    recording : named FILE or FILE:RUN.
    """
    return re.sub(r"[^\w.-]+", "_", recording.name)


def error_cells(error: AxleRmse, size: AxleRmse | None) -> tuple[str, str]:
    """Return front and rear error as text, with their share of the rms force where it is known.

    Parameters
    ----------
    error : [N].
    size : rms of the true forces [N], None without truth.
    """
    forces = (0.0, 0.0) if size is None else (size.front, size.rear)
    front, rear = (
        f"{newtons:8.4g} N{f' {100 * newtons / force:.0f} %' if force > 0.0 else '':>6}"
        for newtons, force in zip((error.front, error.rear), forces, strict=True)
    )
    return front, rear


def _write_curves(folder: Path, learnt: History, others: Sequence[History], frozen: Frozen) -> None:
    for history in (learnt, *others):
        replays = {
            f"frozen_{freeze_key(t)}s": by_name[history.recording.name]
            for t, by_name in frozen.items()
        }
        name = "forces.csv" if history is learnt else f"forces_{file_name(history.recording)}.csv"
        write_csv(folder / name, force_columns(history, replays))
    t, n = learnt.recording.t, learnt.recording.t.size
    if isinstance(learnt.design, Design):
        write_csv(
            folder / "errors.csv",
            {
                "t_s": t,
                "xi_tilde_f_Us": learnt.told["xi_tilde"][:, 0],
                "xi_tilde_r_Us": learnt.told["xi_tilde"][:, 1],
                "z_f_Us2": learnt.carried["z"][:-1, 0],
                "z_r_Us2": learnt.carried["z"][:-1, 1],
            },
        )
    weights = {"t_s": t}
    for matrix in [name for name in WEIGHTS if name in learnt.carried]:
        values = learnt.carried[matrix]
        for i, j in np.ndindex(values.shape[1:]):
            weights[f"{matrix}_{i + 1}_{j + 1}"] = values[:n, i, j]
    write_csv(folder / "weights.csv", weights)


def force_columns(
    history: History, replays: Mapping[str, Replay]
) -> dict[str, NDArray[np.float64]]:
    """Return the curves of forces.csv: slip angles, true, online and frozen forces.

    Parameters
    ----------
    history : an online run.
    replays : replays of the same recording by the name of their columns.
    """
    recording, car = history.recording, history.vehicle
    alpha = recording.alpha(car.l_f, car.l_r)
    columns = {
        "t_s": recording.t,
        "v_x_m_s": recording.v_x,
        "v_y_m_s": recording.v_y,
        "r_rad_s": recording.r,
        "delta_f_rad": recording.delta_f,
        "delta_r_rad": recording.delta_r,
        "alpha_f_rad": alpha[:, 0],
        "alpha_r_rad": alpha[:, 1],
    }
    curves = {"online": history.axle_force}
    curves |= {label: replay.axle_force for label, replay in replays.items()}
    if recording.axle_force is not None:
        curves = {"true": recording.axle_force} | curves
    for name, force in curves.items():
        columns |= {f"Fyf_{name}_N": force[:, 0], f"Fyr_{name}_N": force[:, 1]}
    return columns


def _draw(folder: Path, learnt: History, others: Sequence[History], frozen: Frozen) -> None:
    name, last = learnt.recording.name, max(frozen)
    own = {t: replays[name] for t, replays in frozen.items()}
    figures = {
        "forces": force_figure(learnt, own),
        "slip": slip_figure(learnt.freeze(last), learnt.recording, learnt),
        "inputs": inputs_figure(learnt.recording),
    }
    if isinstance(learnt.design, Design):
        figures["error"] = error_figure(learnt, freeze_times=list(frozen))
        figures["weights"] = weights_figure(learnt, list(frozen))
    elif isinstance(learnt.design, AxleDesign):
        figures["learnt"] = learnt_axles_figure(learnt, list(frozen))
    for other in others:
        replay = frozen[last][other.recording.name]
        figures[f"replay_{file_name(other.recording)}"] = prediction_figure(replay, other)
    for label, figure in figures.items():
        save_figure(figure, folder / f"{label}.png")
