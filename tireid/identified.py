"""What `tireid identify` found, and its files: numbers as JSON, curves as CSV, figures as PNG."""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import astuple
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from codegen.arrays import blocks, thinning
from codegen.escape import visible
from identifier.compare.course import side_slip
from identifier.frozen import vehicle_numbers
from identifier.methods import certify
from identifier.reproducibility import (
    AxleRmse,
    Replay,
    force_rms,
    freeze_key,
    online_error,
    replay,
    reproduce,
)
from identifier.run import History
from identifier.tire_model import TireModel
from identifier.verdict import Verdict, calibrated, judge, judge_prediction
from models.recordings import Recording
from tireid import __version__
from tireid.figures.forces import force_figure, inputs_figure, prediction_figure
from tireid.figures.paper import error_figure, weights_figure
from tireid.figures.side_slip import side_slip_figure
from tireid.figures.style import save_figures
from tireid.figures.tires import learnt_axles_figure, slip_figure
from tireid.learning import with_v_y
from tireid.output import (
    Columns,
    axle_columns,
    force_columns,
    text_table,
    write_csv,
    write_json,
    write_long_csv,
)
from tireid.progress import Progress, say
from tireid.verdicts import named_days

_OBSERVED = "xi_tilde"  # the output of a method that learns from the error of an observer
_ESTIMATED = {  # columns of forces.csv by the outputs of methods that estimate v_y
    "v_y_estimated_m_s": "v_y",
    "v_y_sd_m_s": "v_y_sd",
    "side_slip_observable": "side_slip_observable",
}
_WEIGHTS = ("W", "V", "own")  # carried matrices that are the learnt model, by whatever method
_ONLINE = "(against online, no truth)"
_WRITING = 0.6  # share of the time of curves and figures that a long recording's curves take
_CURVE_POINTS = 201
_FARTHER = 1.25  # than the slip that was driven, or is known


class Results(NamedTuple):
    """Models that were frozen over recordings.

    runs : of the method, over the recording that was learnt and over others.
    models, frozen : by freeze time as text [s], models and their replays by recording; the last
        counts.
    verdict : on the last.   evaluated : on it over the others, by name.
    parts : of the first run, where it is over several logs.
    """

    method: str
    runs: Sequence[History]
    models: Mapping[str, TireModel]
    frozen: Mapping[str, Mapping[str, Replay]]
    verdict: Verdict
    evaluated: Mapping[str, Verdict]
    parts: Sequence[History] = ()

    @classmethod
    def learnt(
        cls,
        method: str,
        runs: Sequence[History],
        times: Sequence[float],
        others: Sequence[Recording],
        parts: Sequence[History] = (),
        noted: Callable[[Verdict], Verdict] = lambda verdict: verdict,
    ) -> "Results":
        """Return what the first run learnt, and what it is worth over it and over others.

        times : of freezes, rising [s].   others : the recordings of the other runs, as read.
        noted : adds to the verdict what others know of the log.
        """
        learnt, last = runs[0], times[-1]
        verdict, model = noted(judge(learnt, last)), learnt.freeze(last)
        evaluated = {one.name: judge_prediction(model, with_v_y(one, model)) for one in others}
        models = {freeze_key(t): learnt.freeze(t) for t in times[:-1]}
        models[freeze_key(last)] = calibrated(learnt, last, verdict)
        frozen: dict[str, dict[str, Replay]] = {}
        for t, (key, model) in zip(times, models.items(), strict=True):
            frozen[key] = {learnt.recording.name: reproduce(learnt, t)}
            frozen[key] |= {run.recording.name: replay(model, run) for run in (*parts, *runs[1:])}
        return cls(method, runs, models, frozen, verdict, evaluated, parts)

    @property
    def model(self) -> TireModel:
        """The last."""
        return list(self.models.values())[-1]

    @property
    def drives(self) -> list[Recording]:
        """The logs: those that were learnt, then the others."""
        first, *others = self.runs
        return [one.recording for one in (*(self.parts or [first]), *others)]

    @property
    def replays(self) -> Mapping[str, Replay]:
        """Those of the last, by recording."""
        return list(self.frozen.values())[-1]

    def table(self) -> str:
        """Return a table of the errors per axle [N], and as a share of the true force; else "".

        Under the recording that was learnt stands the paper's measure: its past, t < T_freeze,
        against what was identified online.
        """
        runs = {run.recording.name: run for run in (*self.runs, *self.parts)}
        header, rows = ["frozen at", "replayed on", "front", "rear"], list[list[str]]()
        for key, replays in self.frozen.items():
            for name, result in replays.items():
                size, sides = force_rms(runs[name]), result.reproduction
                error = result.against_truth or result.against_online
                note = "" if size else _ONLINE
                if error is not None:
                    rows.append([f"{key} s", visible(name), *error_cells(error, size), note])
                if sides and sides.past_against_online:
                    past = error_cells(sides.past_against_online, size)
                    rows.append(["", "  its past, against online", *past, ""])
        return text_table([header, *rows], "><>>") if rows else ""

    def summary(self) -> dict[str, Any]:
        """Return what summary.json holds: errors by recording and freeze, and all that went in.

        All sums, of forces and of errors, are over the samples above the design's minimum speed.
        Those of `frozen` and `frozen_against_online` are over the whole recording;
        `reproducibility` splits the recording that was learnt at the freeze, and its
        `past_against_online` is the measure of the paper's section IV-A.
        """
        learnt, runs = self.runs[0], [self.runs[0], *self.parts, *self.runs[1:]]
        design = learnt.method
        certificate = None if design.whole else certify(design, learnt.vehicle)

        def of_frozen(measure: str) -> dict[str, Any]:
            return {
                key: {name: getattr(one, measure) for name, one in replays.items()}
                for key, replays in self.frozen.items()
            }

        sensors = {name: day.to_dict() for name, day in named_days(self.model, self.drives)}
        return {
            "verdict": self.verdict.to_dict(),
            **({"sensors": sensors} if sensors else {}),
            "replay_verdicts": {name: one.to_dict() for name, one in self.evaluated.items()},
            "rms_force_N": {h.recording.name: force_rms(h) for h in runs},
            "rmse_N": {
                "online": {h.recording.name: online_error(h) for h in runs},
                "frozen": of_frozen("against_truth"),
                "frozen_against_online": of_frozen("against_online"),
                "reproducibility": {
                    key: {n: one for n, one in by_name.items() if one}
                    for key, by_name in of_frozen("reproduction").items()
                },
            },
            "law": self.method,
            **design.numbers(),
            "certificate": None  # of a method that learns from whole logs: nothing learns in a car
            if certificate is None
            else {"verdict": certificate.verdict, "limits": certificate.limits},
            "vehicle": vehicle_numbers(learnt.vehicle),
            "diverged_at_s": learnt.diverged_at,
            "version": __version__,
        }

    def write(self, folder: Path, progress: Progress | None = None) -> dict[str, bytes]:
        """Write everything into a folder; return the figures by the name of their file.

        progress : informed how far it is; None informs nobody.
        """
        write_json(folder / "summary.json", self.summary())
        for key, model in self.models.items():
            last = model is self.model
            end = "" if last else f"_{key}s"
            model.save(folder / f"weights{end}.json", valid=self.verdict.valid if last else None)
            write_csv(folder / f"curve{end}.csv", _curve_columns(model, self.runs))
        learnt, progress = self.runs[0], progress or Progress("curves")
        for k, run in enumerate(self.runs):
            end = "" if run is learnt else f"_{file_name(run.recording)}"
            parts = (self._force_columns(run, part) for part in blocks(len(run.recording)))
            write_long_csv(folder / f"forces{end}.csv", parts)
            progress(_WRITING * (k + 1) / len(self.runs))
        if _OBSERVED in learnt.outputs:
            found = (
                {
                    "t_s": learnt.recording.t[one.part],
                    **axle_columns("xi_tilde_{}_Us", one.outputs[_OBSERVED]),
                    **axle_columns("z_{}_Us2", one.before["z"]),
                }
                for one in learnt.blocks()
            )
            write_long_csv(folder / "errors.csv", found)
        if learnt.online:
            write_long_csv(folder / "weights.csv", _weight_columns(learnt))
        say("drawing figures")
        return save_figures(folder, self._figures())

    def _force_columns(self, run: History, part: slice) -> Columns:
        """Return the columns of forces.csv: slip angles, true, online and frozen forces."""
        recording, car, outputs = run.recording, run.vehicle, run.outputs
        forces = {"true": recording.axle_force, "online": run.axle_force if run.online else None}
        for key, by_name in self.frozen.items():
            forces[f"frozen_{key}s"] = by_name[recording.name].axle_force
        given = {
            "t_s": recording.t,
            "v_x_m_s": recording.v_x,
            "v_y_m_s": recording.needed("v_y"),
            "r_rad_s": recording.r,
            "delta_f_rad": recording.delta_f,
            "delta_r_rad": recording.delta_r,
        }
        columns = {name: signal[part] for name, signal in given.items()}
        columns |= axle_columns("alpha_{}_rad", recording.alpha(car.l_f, car.l_r, part))
        for name, port in _ESTIMATED.items():
            if port in outputs:
                columns[name] = outputs[port][part].ravel()
        return columns | {name: force[part] for name, force in force_columns(forces).items()}

    def _figures(self) -> dict[str, Figure]:
        learnt, model = self.runs[0], self.model
        recording, name = learnt.recording, learnt.recording.name
        replayed = {float(key): replays[name] for key, replays in self.frozen.items()}
        figures = {
            "inputs": inputs_figure(recording),
            "slip": slip_figure(model, recording, self.verdict.forces),
            "forces": force_figure(learnt, replayed)
            if learnt.online
            else prediction_figure(self.replays[name], self.verdict.forces),
        }
        slip = side_slip(learnt, learnt.method.min_speed, recording.logged_v_y)
        if _OBSERVED in learnt.outputs:
            figures["error"] = error_figure(learnt, freeze_times=list(replayed))
            figures["weights"] = weights_figure(learnt, list(replayed))
        if slip is not None:
            figures["side_slip"] = side_slip_figure([recording], {"estimate": {name: slip}})
        if learnt.tracks_over(next(learnt.blocks())):
            figures["learnt"] = learnt_axles_figure(learnt, list(replayed))
        for run in self.runs[1:]:
            name = run.recording.name
            figures[f"replay_{file_name(run.recording)}"] = prediction_figure(
                self.replays[name], self.evaluated[name].forces
            )
        return figures


def file_name(recording: Recording) -> str:
    return re.sub(r"[^\w.-]+", "_", recording.name)


def error_cells(error: AxleRmse | None, size: AxleRmse | None) -> tuple[str, str]:
    """Return front and rear error as text, with their share of the rms force where it is known.

    error : [N]; None leaves a dash.   size : rms of the true forces [N], None without truth.
    """
    if error is None:
        return "-", "-"
    front, rear = (
        f"{newtons:8.4g} N{f' {100 * newtons / force:.0f} %' if force > 0.0 else '':>6}"
        for newtons, force in zip(astuple(error), astuple(size) if size else (0, 0), strict=True)
    )
    return front, rear


def _weight_columns(learnt: History) -> Iterator[Columns]:
    """Yield the columns of weights.csv: of a long run a row for each of at most `LONG` samples."""
    each = thinning(len(learnt.recording))
    for block in learnt.blocks():
        rows = slice(-block.part.start % each, None, each)
        weights = {"t_s": learnt.recording.t[block.part][rows]}
        for matrix in [name for name in _WEIGHTS if name in block.state]:
            values = block.before[matrix][rows]
            for place in np.ndindex(values.shape[1:]):
                weights["_".join([matrix, *(str(k + 1) for k in place)])] = values[:, *place]
        yield weights


def _curve_columns(model: TireModel, runs: Sequence[History]) -> Columns:
    """Return curve.csv: the steady force of each axle over slip, and whether it is known there."""
    car, known = model.vehicle, model.known_slip
    reach = [0.0 if known is None else float(known.max())]
    for one in (run.recording for run in runs):
        for part in blocks(len(one)):
            slip = one.alpha(car.l_f, car.l_r, part)[one.v_x[part] >= model.min_speed]
            reach.append(float(np.abs(slip).max(initial=0.0)))
    end = min(_FARTHER * max(reach) or 0.1, 0.5)
    slip = np.linspace(-end, end, _CURVE_POINTS)
    columns = {"slip_rad": slip, **axle_columns("Fy{}_N", model.force(slip))}
    if known is not None:
        # A point of the curve is the known slip itself, up to rounding.
        inside = (np.abs(slip)[:, None] <= known * (1.0 + 1e-9)).astype(np.float64)
        columns |= {"front_known": inside[:, 0], "rear_known": inside[:, 1]}
    if model.band is not None:
        for side, bound in zip(("low", "high"), model.band.at(slip), strict=True):
            columns |= axle_columns(f"Fy{{}}_{side}_N", bound)
    return columns
