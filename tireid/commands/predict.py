"""`tireid predict MODEL LOG`: the axle forces of a drive by a stored model, and what they miss."""

import argparse
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from codegen.arrays import Array, blocks
from codegen.escape import visible
from identifier.band import UNCALIBRATED
from identifier.frozen import vehicle_numbers
from identifier.prediction import Prediction
from identifier.reproducibility import beyond_known
from identifier.tire_model import TireModel
from identifier.verdict import RoadFriction, Verdict, within_band
from identifier.verdict.verdict import PERCENT
from models.files import digest
from tireid import __version__, output
from tireid import report as page
from tireid.commands import COMMANDS
from tireid.commands import options as shared
from tireid.figures.forces import prediction_figure
from tireid.figures.predict import friction_figure, motion_figure
from tireid.figures.style import save_figures
from tireid.figures.tires import slip_figure
from tireid.identified import error_cells
from tireid.learning import replay
from tireid.progress import say, tell
from tireid.reports.common import READ, REPORT, drawing, origin
from tireid.reports.identify import (
    asked_warnings,
    band_sentence,
    curve_drawing,
)
from tireid.verdicts import (
    known_headline,
    missed_headline,
    of_answer,
    stored_warning,
    verdict_headline,
    verdict_section,
    verdict_text,
    verdict_warnings,
)


def add_parser(commands: Any) -> None:
    parser = commands.add_parser(
        "predict",
        help=COMMANDS["predict"],
        description="Predict the axle forces of LOG with a stored model, which stays as it is; "
        "write report.html, figures, forces.csv, summary.json and, where observable, "
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
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the command; return 3 where the model does not give back the drive's motion."""
    model = _model(options)
    recording = shared.read_log(
        options.log,
        model.vehicle,
        shared.given_map(options),
        check=not options.no_check,
    )
    prediction = replay(recording, model)
    recording = prediction.recording
    if recording.estimated:
        say(f"{recording.name}: vy is estimated, beginning with the tires of the model")
    verdict, facts = prediction.verdict, _Facts.of(prediction)
    with output.output_folder(options.out, force=options.force) as folder:
        columns = (_force_columns(prediction, facts.half, part) for part in blocks(len(recording)))
        output.write_long_csv(folder / "forces.csv", columns)
        if (friction := verdict.friction) is not None:
            given = {"t_s": friction.t, "friction": friction.ratio, "sd_of_log": friction.sd}
            given |= {"another": friction.another, "unexplained": friction.unexplained}
            output.write_csv(folder / "friction.csv", given)
        output.write_json(folder / "summary.json", summary(prediction, verdict, facts))
        lines = _prediction_text(prediction, friction, facts)
        say("drawing figures")
        figures = {
            "slip": slip_figure(model, recording),
            "forces": prediction_figure(prediction),
        }
        if verdict.forces is not None:
            figures["motion"] = motion_figure(verdict.forces, model.vehicle)
        if friction is not None:
            figures["friction"] = friction_figure(friction)
        save_figures(folder, figures)
        write_predict_report(
            folder, prediction, figures, lines, source=options.model, command=options.words
        )
    error, table = prediction.against_truth, ""
    if error is not None:
        name = visible(recording.name)
        cells = [name, *error_cells(error, prediction.true_force)]
        table = output.text_table([["predicted", "front", "rear"], cells], "<>>")
    tell("\n".join(one for one in (table, lines, verdict_text(verdict, numbers=False)) if one))
    say(f"wrote {options.out}/")
    return shared.exit_code(verdict, options)


def _model(options: argparse.Namespace) -> TireModel:
    """Return the model, on the car that drove."""
    model = shared.stored_model(options.model)
    assert model is not None
    vehicle = shared.read_vehicle(options, model, options.model)
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


class _Facts(NamedTuple):
    """What is asked of a prediction, each None where nobody knows.

    half : width of the band of its forces (n, 2) [N].
    beyond : share of samples whose slip is beyond the known.   inside : of windows whose force that
        the motion shows lies in the band.   held : of samples whose true force does, (2,) each.
    """

    half: Array | None
    beyond: tuple[float, float] | None
    inside: Array | None
    held: Array | None

    @classmethod
    def of(cls, prediction: Prediction) -> "_Facts":
        model, recording = prediction.model, prediction.recording
        half, truth, held = None, recording.axle_force, None
        if model.band is not None:
            half = model.band.over(recording)
        if half is not None and truth is not None and (half > 0.0).any():
            inside = (np.abs(prediction.axle_force - truth) <= half) & (half > 0.0)
            held = inside.sum(axis=0) / np.maximum((half > 0.0).sum(axis=0), 1)
        return cls(
            half,
            beyond_known(model, recording),
            within_band(model, recording),
            held,
        )


def _force_columns(prediction: Prediction, half: Array | None, part: slice) -> dict[str, Array]:
    """Return the columns of forces.csv: time, slip angles, predicted, band and true forces.

    half : width of its band (n, 2) [N]; None where the model has none.
    """
    recording, car = prediction.recording, prediction.model.vehicle
    alpha = recording.alpha(car.l_f, car.l_r, part)
    columns = {"t_s": recording.t[part], **output.axle_columns("alpha_{}_rad", alpha)}
    forces = {"predicted": prediction.axle_force, "half_band": half, "true": recording.axle_force}
    for name, force in forces.items():
        if force is not None:
            columns |= output.axle_columns(f"Fy{{}}_{name}_N", force[part])
    return columns


def summary(prediction: Prediction, verdict: Verdict, facts: _Facts) -> dict[str, Any]:
    """Return what summary.json holds; null stands for what cannot be known."""
    error, size, motion = prediction.against_truth, prediction.true_force, prediction.motion
    friction, model = verdict.friction, prediction.model
    inside, held, known = facts.inside, facts.held, model.known_slip
    shares = (None, None) if motion is None else motion.explained
    return {
        "verdict": verdict.to_dict(),
        "recording": prediction.recording.name,
        "samples": len(prediction.recording),
        "rmse_N": None if error is None else asdict(error),
        "rms_force_N": None if size is None else asdict(size),
        "motion": None
        if motion is None
        else {
            "missed_lateral_m_s2": motion.lateral,
            "missed_yaw_rad_s2": motion.yaw,
            "rms_lateral_m_s2": motion.lateral_rms,
            "rms_yaw_rad_s2": motion.yaw_rms,
            "explained_lateral": shares[0],
            "explained_yaw": shares[1],
        },
        "known_slip_rad": None if known is None else known.tolist(),
        "beyond_known_slip": facts.beyond,
        "windows_within_band": None if inside is None else inside.tolist(),
        "truth_within_band": None if held is None else held.tolist(),
        "friction": None
        if friction is None
        else {"unchanged": friction.unchanged, "roads": [one._asdict() for one in friction.roads]},
        "model": type(model).__name__,
        "vehicle": vehicle_numbers(model.vehicle),
        "version": __version__,
    }


def _prediction_text(prediction: Prediction, friction: RoadFriction | None, facts: _Facts) -> str:
    """Return what is to be said of a prediction beside its errors, as lines of text.

    friction : of the drive's road; None where it is not observable.
    """
    motion, model, lines = prediction.motion, prediction.model, []
    inside, held, beyond, known = facts.inside, facts.held, facts.beyond, model.known_slip
    if prediction.against_truth is None:
        lines.append("no true forces in the log: the error cannot be given in newtons")
    if motion is not None:
        lines.append(
            f"error over the measured motion: {motion.lateral:.3g} of {motion.lateral_rms:.3g} "
            f"m/s² lateral and {motion.yaw:.3g} of {motion.yaw_rms:.3g} rad/s² yaw acceleration, "
            f"rms, sensor noise included; {prediction.motion_text()}"
        )
    if beyond is not None and known is not None:
        front, rear = np.degrees(known)
        lines.append(
            f"known to {front:.1f} / {rear:.1f} deg of slip, which {100.0 * beyond[0]:.0f} / "
            f"{100.0 * beyond[1]:.0f} % of the samples exceed (front / rear)"
        )
    if inside is not None:
        lines.append(
            f"in {100.0 * inside[0]:.0f} / {100.0 * inside[1]:.0f} % of the windows of 0.3 s the "
            f"force in the motion lies in the band of 90 % (front / rear)"
        )
    if held is not None:
        lines.append(
            f"{100.0 * held[0]:.0f} / {100.0 * held[1]:.0f} % of the true forces lie in it, the "
            "noise of the sensors in the band (front / rear)"
        )
    if model.band is not None and not model.band.calibrated:
        lines.append(f"friction: not observable, the band is {UNCALIBRATED}")
    if friction is not None and not friction.roads:
        lines.append(
            "friction: that of the identification drive, as far as observable"
            if friction.unchanged
            else "friction: not observable, slip is too small"
        )
    return "\n".join(lines)


def write_predict_report(
    folder: Path,
    prediction: Prediction,
    figures: Mapping[str, Figure],
    lines: str,
    *,
    source: Path,
    command: str,
) -> None:
    """Write the report of a prediction.

    lines : what is said of it beside its errors.   source : the model's file.
    """
    model, recording, verdict = prediction.model, prediction.recording, prediction.verdict
    notes: list[str | page.Marked] = [*stored_warning(source), *asked_warnings(model, recording)]
    found: list[page.Block] = [*_errors(prediction)]
    found += [page.Paragraph(text=page.printed(line)) for line in lines.splitlines()]
    captions = {
        "motion": "Mean force over windows of 0.3 s: from the motion, and from the model.",
        "forces": "Axle forces over time.",
        "friction": "Friction of the road over that of the identification drive.",
    }
    found += [
        drawing(figures[name], caption, READ["replay" if name == "forces" else name])
        for name, caption in captions.items()
        if name in figures
    ]
    if band := band_sentence(model):
        found.append(page.Paragraph(text=band))
    report = page.Report(
        title=f"Tires of {source.name} on {recording.name}",
        summary=f"{recording.duration:.4g} s of driving of {model.vehicle.name}, not used for "
        "identification.",
        numbers=[
            verdict_headline(verdict, notes),
            *of_answer(verdict, [*missed_headline(verdict), *_predict_headlines(prediction)]),
        ],
        lead=[curve_drawing(figures, verdict)],
        warnings=[*verdict_warnings(verdict), *notes],
        sections=[
            verdict_section(verdict),
            page.Section(heading="What it predicts", blocks=found),
            origin(
                command,
                model.vehicle,
                [recording],
                model=f"{source.name}, hash {digest(model.to_dict())}",
            ),
        ],
    )
    page.write_report(folder / REPORT, report)


def _predict_headlines(prediction: Prediction) -> list[page.Headline]:
    """Return what is missed of the true force, explained of the motion, and the known slip."""
    numbers = []
    error, size, motion = prediction.against_truth, prediction.true_force, prediction.motion
    if error is not None and size is not None and min(size.front, size.rear) > 0.0:
        shares = error.front / size.front, error.rear / size.rear
        front, rear = (f"{PERCENT * share:.1f}" for share in shares)
        numbers.append(page.Headline(f"{front} / {rear} %", "of the rms true force, front / rear"))
    if motion is not None and None not in motion.explained:
        lateral, yaw = (f"{PERCENT * max(share or 0.0, 0.0):.1f}" for share in motion.explained)
        numbers.append(
            page.Headline(f"{lateral} / {yaw} %", "explained of the lateral / the yaw acceleration")
        )
    return [*numbers, *known_headline(prediction.model)]


def _errors(prediction: Prediction) -> list[page.Block]:
    error, size = prediction.against_truth, prediction.true_force
    if error is None or size is None:
        return []
    rows: list[list[page.Cell]] = [
        [axle, newtons, PERCENT * newtons / force if force > 0.0 else None]
        for axle, newtons, force in (
            ("front", error.front, size.front),
            ("rear", error.rear, size.rear),
        )
    ]
    caption = "RMSE of the axle force against the true one, and its share of the rms force."
    return [page.Table(caption=caption, header=["axle", "RMSE [N]", "share [%]"], rows=rows)]
