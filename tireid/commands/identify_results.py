"""The files of `tireid identify`: numbers as JSON, every curve as CSV, figures as PNG."""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from codegen.arrays import Array, blocks, thinning
from identifier.axle.guarantee import ForceBound
from identifier.compare.course import side_slip
from identifier.frozen import vehicle_numbers
from identifier.method import Method
from identifier.methods import certify
from identifier.own_network import OnnxModel
from identifier.reproducibility import (
    AxleRmse,
    Replay,
    force_rms,
    freeze_key,
    online_error,
    replay,
)
from identifier.run import History
from identifier.setup import Block
from identifier.tire_model import TireModel
from identifier.verdict import Verdict, calibrated, guaranteed
from models.recordings import Recording
from models.vehicle import Vehicle
from tireid import __version__
from tireid.figures.forces import force_figure, inputs_figure, prediction_figure
from tireid.figures.paper import error_figure, weights_figure
from tireid.figures.side_slip import side_slip_figure
from tireid.figures.style import save_figures
from tireid.figures.thinned import DrawnRun
from tireid.figures.tires import drawn_tracks, learnt_axles_figure, slip_figure
from tireid.output import axle_columns, text_table, write_csv, write_json, write_table
from tireid.progress import Progress, say
from tireid.reports.identify import guaranteed_sentence


def _told(error: AxleRmse | None) -> dict[str, float] | None:
    return None if error is None else asdict(error)


def _certificate_numbers(design: Method, vehicle: Vehicle) -> dict[str, Any] | None:
    """Return the verdict on a method, and which bounds hold of it whatever is measured.

    None of a method that learns from whole logs: nothing learns in a car.
    """
    if design.whole:
        return None
    certificate = certify(design, vehicle)
    return {"verdict": certificate.verdict, "limits": certificate.limits}


def summarize(
    law: str,
    runs: Sequence[History],
    frozen: Mapping[str, Mapping[str, Replay]],
    verdict: Verdict | None,
    asked: Mapping[str, Verdict],
) -> dict[str, Any]:
    """Return what summary.json holds: errors by recording and freeze time, and all that went in.

    All sums, of forces and of errors, are over the samples above the design's minimum speed. Those
    of `frozen` and `frozen_against_online` are over the whole recording; `reproducibility` splits
    the recording that was learnt at the freeze, and its `past_against_online` is the measure of the
    paper's section IV-A.

    runs : the first of them was learnt.   frozen : freeze time [s] to recording name to replay.
    """
    learnt = runs[0]
    return {
        "verdict": None if verdict is None else verdict.to_dict(),
        "replay_verdicts": {name: one.to_dict() for name, one in asked.items()},
        "rms_force_N": {h.recording.name: _told(force_rms(h)) for h in runs},
        "rmse_N": {
            "online": {h.recording.name: _told(online_error(h)) for h in runs},
            "frozen": {
                key: {name: _told(r.against_truth) for name, r in replays.items()}
                for key, replays in frozen.items()
            },
            "frozen_against_online": {
                key: {name: _told(r.against_online) for name, r in replays.items()}
                for key, replays in frozen.items()
            },
            "reproducibility": {
                key: {name: asdict(r.reproduction) for name, r in replays.items() if r.reproduction}
                for key, replays in frozen.items()
            },
        },
        "law": law,
        **learnt.design.numbers(),
        "certificate": _certificate_numbers(learnt.design, learnt.vehicle),
        "vehicle": vehicle_numbers(learnt.vehicle),
        "diverged_at_s": learnt.diverged_at,
        "version": __version__,
    }


class AskedBound(NamedTuple):
    """A request for a guaranteed band; given: its bound, None estimates it."""

    given: ForceBound | None

    @classmethod
    def of(cls, numbers: Sequence[float]) -> "AskedBound":
        """Return what words of the command ask.

        numbers : error [static axle loads] and lateness [s], or the first of them, or none.
        """
        if len(numbers) > 2:
            raise ValueError(
                f"--bound takes an error and a lateness, it was given {len(numbers)} numbers"
            )
        if not numbers:
            return cls(None)
        error, late = (*numbers, 0.0)[:2]
        return cls(ForceBound(error=(error, error), lateness=(late, late)))


def guaranteed_text(model: TireModel) -> str:
    sentence = guaranteed_sentence(model)
    return sentence or (
        "no guaranteed band: it takes --method axle, a lateral velocity that "
        "was measured, and enough driving"
    )


Frozen = Mapping[float, Mapping[str, Replay]]
OBSERVED = "xi_tilde"  # the output of a method that learns from the error of an observer
_WRITING = 0.6  # share of the time of curves and figures that a long recording's curves take
TOLD = {  # columns of forces.csv by the outputs of methods that estimate v_y
    "v_y_estimated_m_s": "v_y",
    "v_y_sd_m_s": "v_y_sd",
    "side_slip_observable": "side_slip_observable",
}
WEIGHTS = ("W", "V", "own")  # carried matrices that are the learnt model, by whatever method


def write_results(
    folder: Path,
    law: str,
    learnt: History,
    others: Sequence[History],
    frozen: Frozen,
    verdict: Verdict,
    asked: Mapping[str, Verdict],
    parts: Sequence[History] = (),
    *,
    curves: str = "csv",
    bound: AskedBound | None = None,
    progress: Progress | None = None,
) -> dict[str, Figure]:
    """Write everything that was learnt into a folder; return the figures by the name of their file.

    frozen : freeze time [s] to recording name to replay.
    bound : of the guaranteed band of the last freeze; None asks for none.
    progress : told how far it is; None tells nobody.
    """
    tire = calibrated(learnt, max(frozen), verdict)
    if bound is not None:
        tire = guaranteed(learnt, bound.given, max(frozen), tire)
    by_key = {freeze_key(t): replays for t, replays in frozen.items()}
    summary = summarize(law, [learnt, *parts, *others], by_key, verdict, asked)
    write_json(folder / "summary.json", summary)
    for t in frozen:
        last = "" if t == max(frozen) else f"_{freeze_key(t)}s"
        model = learnt.freeze(t) if last else tire
        judged = verdict if t == max(frozen) else None
        model.save(folder / f"weights{last}.json", valid=None if judged is None else judged.valid)
        columns = _curve_columns(model, [run.recording for run in (learnt, *others)])
        write_csv(folder / f"curve{last}.csv", columns)
    tracks = drawn_tracks(learnt)
    told = progress or Progress("curves")
    _write_curves(folder, learnt, others, frozen, curves, told, tracks)
    say("drawing figures")
    return _draw(folder, learnt, others, frozen, tire, tracks)


def file_name(recording: Recording) -> str:
    return re.sub(r"[^\w.-]+", "_", recording.name)


def no_truth(error: AxleRmse | None, size: AxleRmse | None) -> str:
    """Return the note beside an error: against what, where there is no true force.

    error : None where there is none.   size : rms of the true forces [N], None without truth.
    """
    if size is not None:
        return ""
    return "(no truth)" if error is None else "(against online, no truth)"


def error_cells(error: AxleRmse | None, size: AxleRmse | None) -> tuple[str, str]:
    """Return front and rear error as text, with their share of the rms force where it is known.

    error : [N]; None leaves a dash.   size : rms of the true forces [N], None without truth.
    """
    if error is None:
        return "-", "-"
    forces = (0.0, 0.0) if size is None else (size.front, size.rear)
    front, rear = (
        f"{newtons:8.4g} N{f' {100 * newtons / force:.0f} %' if force > 0.0 else '':>6}"
        for newtons, force in zip((error.front, error.rear), forces, strict=True)
    )
    return front, rear


def _write_curves(
    folder: Path,
    learnt: History,
    others: Sequence[History],
    frozen: Frozen,
    curves: str,
    progress: Progress,
    tracks: DrawnRun | None,
) -> None:
    count = 1 + len(others)
    for k, history in enumerate((learnt, *others)):
        replays = {
            f"frozen_{freeze_key(t)}s": by_name[history.recording.name]
            for t, by_name in frozen.items()
        }
        name = "forces" if history is learnt else f"forces_{file_name(history.recording)}"
        told = progress.within(_WRITING * k / count, _WRITING * (k + 1) / count)
        _write_forces(folder / f"{name}.{curves}", history, replays, told)
    if OBSERVED in learnt.outputs:
        found = learnt.blocks()
        write_table(folder / f"errors.{curves}", (_error_columns(learnt, one) for one in found))

    if not learnt.online:
        return

    def weights() -> Iterator[dict[str, Array]]:
        for block in learnt.blocks():
            if tracks is not None:  # beside it: a long run is computed again for each look at it
                tracks.take(block)
            yield _weight_columns(learnt, block)

    write_table(folder / f"weights.{curves}", weights())


def _error_columns(learnt: History, block: Block) -> dict[str, Array]:
    return {
        "t_s": learnt.recording.t[block.part],
        **axle_columns("xi_tilde_{}_Us", block.outputs[OBSERVED]),
        **axle_columns("z_{}_Us2", block.before["z"]),
    }


def _weight_columns(learnt: History, block: Block) -> dict[str, Array]:
    """Return the columns of weights.csv: of a long run a row for each of at most `LONG` samples."""
    each = thinning(len(learnt.recording))
    rows = slice(-block.part.start % each, None, each)
    weights = {"t_s": learnt.recording.t[block.part][rows]}
    for matrix in [name for name in WEIGHTS if name in block.state]:
        values = block.before[matrix][rows]
        for place in np.ndindex(values.shape[1:]):
            weights["_".join([matrix, *(str(k + 1) for k in place)])] = values[:, *place]
    return weights


def _write_forces(
    path: Path,
    history: History,
    replays: Mapping[str, Replay],
    progress: Callable[[float], None] | None = None,
) -> None:
    """Write the curves of forces.csv: slip angles, true, online and frozen forces.

    progress : called now and then with the share that is done, 0 to 1.
    """
    n = len(history.recording)
    told = {
        column: history.outputs[port].ravel()
        for column, port in TOLD.items()
        if port in history.outputs
    }

    def parts() -> Iterator[dict[str, Array]]:
        for part in blocks(n):
            yield _force_columns(history, replays, told, part)
            if progress is not None:
                progress(part.stop / n)

    write_table(path, parts())


def _force_columns(
    history: History, replays: Mapping[str, Replay], told: Mapping[str, Array], part: slice
) -> dict[str, Array]:
    recording, car = history.recording, history.vehicle
    alpha = recording.alpha(car.l_f, car.l_r, part)
    columns = {
        "t_s": recording.t[part],
        "v_x_m_s": recording.v_x[part],
        "v_y_m_s": recording.needed("v_y")[part],
        "r_rad_s": recording.r[part],
        "delta_f_rad": recording.delta_f[part],
        "delta_r_rad": recording.delta_r[part],
        **axle_columns("alpha_{}_rad", alpha),
    }
    columns |= {name: values[part] for name, values in told.items()}
    curves = {"online": history.axle_force} if history.online else {}
    curves |= {label: replay.axle_force for label, replay in replays.items()}
    if recording.axle_force is not None:
        curves = {"true": recording.axle_force} | curves
    for name, force in curves.items():
        columns |= axle_columns(f"Fy{{}}_{name}_N", force[part])
    return columns


_CURVE_POINTS = 201
_FARTHER = 1.25  # than the slip that was driven, or is known


def _curve_columns(model: TireModel, recordings: Sequence[Recording]) -> dict[str, Array]:
    """Return curve.csv: the steady force of each axle over slip, and whether it is known there."""
    car, known = model.vehicle, model.known_slip
    reach = [0.0 if known is None else float(known.max())]
    for recording in recordings:
        for part in blocks(len(recording)):
            moving = recording.v_x[part] >= model.min_speed
            slip = np.abs(recording.alpha(car.l_f, car.l_r, part)[moving])
            reach.append(float(slip.max(initial=0.0)))
    end = min(_FARTHER * max(reach) or 0.1, 0.5)
    slip = np.linspace(-end, end, _CURVE_POINTS)
    force = model.force(slip)
    columns = {"slip_rad": slip, **axle_columns("Fy{}_N", force)}
    if known is not None:
        inside = (np.abs(slip)[:, None] <= known).astype(np.float64)
        columns |= {"front_known": inside[:, 0], "rear_known": inside[:, 1]}
    band = model.band(slip)
    for sides, found in (("low", "high"), band), (("least", "most"), model.guaranteed_band(slip)):
        for side, bound in zip(sides, found or (), strict=found is not None):
            columns |= axle_columns(f"Fy{{}}_{side}_N", bound)
    return columns


def _draw(
    folder: Path,
    learnt: History,
    others: Sequence[History],
    frozen: Frozen,
    tire: TireModel,
    tracks: DrawnRun | None,
) -> dict[str, Figure]:
    name, last = learnt.recording.name, max(frozen)
    own = {t: replays[name] for t, replays in frozen.items()}
    figures = {
        "forces": force_figure(learnt, own),
        "slip": slip_figure(tire, learnt.recording, _beside(learnt)),
        "inputs": inputs_figure(learnt.recording),
    }
    if OBSERVED in learnt.outputs:
        figures["error"] = error_figure(learnt, freeze_times=list(frozen))
        figures["weights"] = weights_figure(learnt, list(frozen))
    told = side_slip(learnt, learnt.design.min_speed, learnt.recording.logged_v_y)
    if told is not None:
        figures["side_slip"] = side_slip_figure([learnt.recording], {"estimate": {name: told}})
    if tracks is not None:
        figures["learnt"] = learnt_axles_figure(learnt, list(frozen), tracks)
    for other in others:
        replay = frozen[last][other.recording.name]
        figures[f"replay_{file_name(other.recording)}"] = prediction_figure(replay, _beside(other))
    return save_figures(folder, figures)


def _beside(run: History) -> History | None:
    """Return a run where it has forces of its own to compare with."""
    return run if run.online else None


# What `tireid identify --network` finds: a network of one's own over recordings.
#
# summary.json has the keys of a learnt model; in place of a freeze time stands "network". What the
# identifier finds online over the same recordings stands beside it.

NETWORK = "network"


def write_network_results(
    folder: Path,
    file: Path,
    law: str,
    model: OnnxModel,
    histories: Sequence[History],
    verdict: Verdict,
    asked: Mapping[str, Verdict],
    curves: str = "csv",
) -> tuple[Mapping[str, Replay], dict[str, Figure]]:
    """Write everything that is known of a network into a folder; return replays and figures."""
    replays = {history.recording.name: replay(model, history) for history in histories}
    about = {"file": file.name, "inputs": list(model.signals), "slip_sign": model.slip_sign}
    summary = summarize(law, histories, {NETWORK: replays}, verdict, asked)
    write_json(folder / "summary.json", {**summary, NETWORK: about})
    model.save(folder / "weights.json", valid=verdict.valid)
    columns = _curve_columns(model, [history.recording for history in histories])
    write_csv(folder / "curve.csv", columns)
    say("drawing figures")
    figures: dict[str, Figure] = {}
    for history in histories:
        recording = history.recording
        name, own = file_name(recording), replays[recording.name]
        last = "" if history is histories[0] else f"_{name}"
        _write_forces(folder / f"forces{last}.{curves}", history, {NETWORK: own})
        figures[f"slip{last}"] = slip_figure(model, recording, _beside(history))
        figures[f"replay_{name}"] = prediction_figure(own, _beside(history))
    figures["inputs"] = inputs_figure(histories[0].recording)
    return replays, save_figures(folder, figures)


def network_table(law: str, histories: Sequence[History], replays: Mapping[str, Replay]) -> str:
    """Return the errors of the network, and of what was learnt online beside it, as text."""
    table = [["", "replayed on", "front", "rear"]]
    for history in histories:
        name, size, online = history.recording.name, force_rms(history), online_error(history)
        own = replays[name]
        rows: list[tuple[str, AxleRmse | None]]
        rows = [(NETWORK, own.against_truth or own.against_online)]
        rows += [] if online is None else [(f"{law}, learning online", online)]
        table += [
            [title, name, *error_cells(error, size), no_truth(error, size)] for title, error in rows
        ]
    return text_table(table, "<<>>")
