"""`tireid predict MODEL LOG`: the axle forces of a drive by a stored model, and what they miss."""

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from codegen.arrays import Array
from codegen.escape import visible
from identifier.band import UNCALIBRATED
from identifier.frozen import vehicle_numbers
from identifier.prediction import Prediction
from identifier.reproducibility import beyond_known
from identifier.tire_model import TireModel
from identifier.verdict import within_band
from models.files import digest
from models.recordings import LogMap
from tireid import __version__, output
from tireid.commands import options as shared
from tireid.figures.forces import friction_figure, inputs_figure, prediction_figure
from tireid.figures.style import save_figures
from tireid.figures.tires import slip_figure
from tireid.identified import error_cells
from tireid.learning import replay
from tireid.progress import say, tell
from tireid.report import (
    Block,
    Images,
    Report,
    Section,
    drawings,
    origin,
    sentence,
    write_report,
)
from tireid.reports.captions import (
    force_caption,
    friction_caption,
    slip_caption,
)
from tireid.reports.identify import (
    band_sentence,
    curve_drawing,
    error_numbers,
    error_table,
    estimates_notes,
    extrapolated,
    went_in,
)
from tireid.verdicts import (
    known_headline,
    model_error_headline,
    of_answer,
    sensors_section,
    sensors_text,
    stored_notes,
    verdict_headline,
    verdict_notes,
    verdict_section,
    verdict_text,
)


def declare(new: Any) -> None:
    parser = new(
        description="Predict the axle forces of LOG with a stored model, which stays as it is; "
        "write report.html, figures, forces.csv, summary.json and, where the model misses a part, "
        "friction.csv: friction of the road over that of the identification drive. Where LOG "
        "has true forces, give the error; else how much of the measured lateral and yaw "
        "acceleration the forces explain, in means over 0.2 s.",
    )
    parser.add_argument("model", type=Path, metavar="MODEL", help="weights.json, as identified")
    parser.add_argument("log", metavar="LOG", help="recording; LOG:RUN names one of its runs")
    shared.add_vehicle(parser, default="that of the model")
    shared.add_log_reading(parser)
    shared.add_accept(parser)
    shared.add_output(parser, "predict")


def run(options: argparse.Namespace) -> int:
    """Run the command; return 3 where the drive has another motion than the model gives."""
    model = _model(options)
    recording = shared.read_log(options.log, model.vehicle, options)
    prediction = replay(recording, model)
    recording, verdict = prediction.recording, prediction.verdict
    if recording.estimated:
        say(f"{recording.name}: vy is estimated, beginning with the tires of the model")
    half = None if model.band is None else model.band.over(recording)
    facts, friction = summary(prediction, half), verdict.friction
    lines = _prediction_text(prediction, facts)
    with shared.folder_of(options) as folder:
        alpha = recording.alpha(model.vehicle.l_f, model.vehicle.l_r)
        forces = {"predicted": prediction.axle_force, "half_band": half}
        columns = {"t_s": recording.t, **output.axle_columns("alpha_{}_rad", alpha)}
        columns |= output.force_columns({**forces, "true": recording.axle_force})
        output.write_csv(folder / "forces.csv", columns)
        if friction is not None:
            given = {"t_s": friction.t, "friction": friction.ratio, "sd_of_log": friction.sd}
            given |= {"another": friction.another, "unexplained": friction.unexplained}
            output.write_csv(folder / "friction.csv", given)
        output.write_json(folder / "summary.json", facts)
        say("drawing figures")
        figures = {
            "slip": slip_figure(model, recording, verdict.forces),
            "forces": prediction_figure(prediction, verdict.forces),
            "inputs": inputs_figure(recording),
        }
        if friction is not None:
            figures["friction"] = friction_figure(friction)
        images = save_figures(folder, figures)
        log_map = shared.given_map(options)
        write_predict_report(
            folder, prediction, images, lines, options.model, options.words, log_map
        )
    error, table = prediction.against_truth, ""
    if error is not None:
        cells = [visible(recording.name), *error_cells(error, prediction.true_force)]
        table = output.text_table([["predicted", "front", "rear"], cells], "<>>")
    tell(table, lines, sensors_text(model, [recording]), verdict_text(verdict, numbers=False))
    say(f"wrote {options.out}/")
    return shared.exit_code(verdict, options)


def _model(options: argparse.Namespace) -> TireModel:
    """Return the model, on the car that drove."""
    model = shared.stored_model(options.model)
    assert model is not None
    vehicle = shared.read_vehicle(options, model)
    if vehicle.moves_as(model.vehicle):
        return model
    if not model.scales_with_load:
        raise ValueError(
            f"{options.model} is of the car {model.vehicle.name!r} and cannot be mounted on "
            f"{vehicle.name!r}, as models of the axle identifier can: leave --vehicle out to use "
            f"its stored car"
        )
    say(f"{options.model} is of the car {model.vehicle.name!r}: scaled by the axle loads")
    return model.mounted_on(vehicle)


def summary(prediction: Prediction, half: Array | None) -> dict[str, Any]:
    """Return what summary.json holds; null stands for what cannot be known.

    half : width of the band (n, 2) [N]; None where the model has none.
    """
    model, recording, motion = prediction.model, prediction.recording, prediction.motion
    friction, truth, coverage = prediction.verdict.friction, recording.axle_force, None
    if half is not None and truth is not None and (half > 0.0).any():
        inside = (np.abs(prediction.axle_force - truth) <= half) & (half > 0.0)
        coverage = inside.sum(axis=0) / np.maximum((half > 0.0).sum(axis=0), 1)
    return {
        "verdict": prediction.verdict.to_dict(),
        "recording": recording.name,
        "samples": len(recording),
        "rmse_N": prediction.against_truth,
        "rms_force_N": prediction.true_force,
        **({} if prediction.day is None else {"sensors": prediction.day.to_dict()}),
        "motion": None
        if motion is None
        else {
            "missed_lateral_m_s2": motion.lateral,
            "missed_yaw_rad_s2": motion.yaw,
            "rms_lateral_m_s2": motion.lateral_rms,
            "rms_yaw_rad_s2": motion.yaw_rms,
            **dict(zip(("explained_lateral", "explained_yaw"), motion.explained, strict=True)),
        },
        "known_slip_rad": model.known_slip,
        "beyond_known_slip": beyond_known(model, recording),
        "windows_within_band": within_band(model, recording),
        "truth_within_band": coverage,
        "friction": None
        if friction is None
        else {"unchanged": friction.unchanged, "roads": [one._asdict() for one in friction.roads]},
        "model": type(model).__name__,
        "vehicle": vehicle_numbers(model.vehicle),
        "version": __version__,
    }


_SHARES = {  # keys of summary.json, and what their shares are printed as
    "beyond_known_slip": "known to {1:.1f} / {2:.1f} deg of slip, which {0} of the samples exceed "
    "(front / rear)",
    "windows_within_band": "in {0} of the windows of 0.3 s the force in the motion lies in the "
    "band of 90 % that the tires had before this log (front / rear)",
    "truth_within_band": "{0} of the true forces lie in it, the noise of the sensors in the band "
    "(front / rear)",
}


def _prediction_text(prediction: Prediction, facts: Mapping[str, Any]) -> str:
    """Return what is to be said of a prediction beside its errors, as lines of text.

    facts : its summary.
    """
    motion, band, lines = prediction.motion, prediction.model.band, []
    verdict, known = prediction.verdict, facts["known_slip_rad"]
    friction = verdict.friction
    if prediction.against_truth is None:
        lines.append("no true forces in the log: the error cannot be given in newtons")
    if motion is not None:
        lines.append(
            f"error over the measured motion: {motion.lateral:.3g} of {motion.lateral_rms:.3g} "
            f"m/s² lateral and {motion.yaw:.3g} of {motion.yaw_rms:.3g} rad/s² yaw acceleration, "
            f"rms, sensor noise included; {prediction.motion_text()}"
        )
    for key, text in _SHARES.items():
        if facts[key] is not None:
            share = "{:.0f} / {:.0f} %".format(*100.0 * np.array(facts[key]))
            slip = () if known is None else np.degrees(known)
            lines.append(text.format(share, *slip))
    if band is not None and not band.calibrated:
        lines.append(f"friction: not observable, the band is {UNCALIBRATED}")
    elif band is not None and verdict.judged and friction is None:
        lines.append("friction: that of the identification drive, which explains every part")
    if friction is not None and not friction.roads:
        lines.append(
            f"friction: that of the identification drive, as far as observable; {friction.text}"
            if friction.unchanged
            else "friction: not observable, slip is too small"
        )
    return "\n".join(lines)


def write_predict_report(
    folder: Path,
    prediction: Prediction,
    figures: Images,
    lines: str,
    source: Path,
    command: str,
    log_map: LogMap,
) -> None:
    """Write the report of a prediction.

    lines : what is said of it beside its errors.   source : the model's file.
    log_map : how the log was read.
    """
    model, recording, verdict = prediction.model, prediction.recording, prediction.verdict
    notes = [
        *verdict_notes(verdict),
        *stored_notes(source),
        *estimates_notes(model.vehicle),
        *extrapolated(model, recording),
    ]
    error, found = prediction.against_truth, list[Block]()
    if error is not None:
        found.append(error_table([[recording.name, *error_numbers(error, prediction.true_force)]]))
    found += map(sentence, lines.splitlines())
    captions = {"replay": force_caption(recording, prediction.axle_force, model, verdict)}
    if verdict.friction is not None:
        captions["friction"] = friction_caption(verdict.friction)
    found += drawings({**figures, "replay": figures["forces"]}, captions)
    if band := band_sentence(model):
        found.append(band)
    report = Report(
        title=f"Tires of {model.vehicle.name}, predicted on {recording.name}",
        summary=f"{recording.duration:.4g} s of driving of {model.vehicle.name}, "
        f"predicted by {source.name}.",
        numbers=[
            verdict_headline(verdict),
            *of_answer(verdict, [*model_error_headline(verdict), *known_headline(model)]),
        ],
        lead=[curve_drawing(figures, verdict, slip_caption(model, recording, verdict.forces))],
        notes=notes,
        sections=[
            verdict_section(verdict, model),
            Section("What it predicts", found),
            *sensors_section(model, [recording]),
            Section("What went in", went_in(model, log_map, recording, figures)),
            origin(
                command,
                model.vehicle,
                [recording],
                channels=f"hash {digest(repr(log_map))}",
                model=f"{source.name}, hash {digest(model.to_dict())}",
            ),
        ],
    )
    write_report(folder, report)
