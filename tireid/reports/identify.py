"""The report of `tireid identify`: what was learnt, how well it predicts, where not to ask it."""

from collections.abc import Sequence
from dataclasses import astuple
from pathlib import Path

import numpy as np

from identifier.doctor import Diagnosis
from identifier.measured import with_doubt
from identifier.reproducibility import (
    AxleRmse,
    beyond_known,
    force_rms,
    freeze_key,
    online_error,
)
from identifier.run import History
from identifier.tire_model import TireModel
from identifier.verdict import Verdict
from identifier.verdict.verdict import PERCENT
from models.files import digest
from models.recordings import LogMap, Recording
from models.recordings.choice import column_of
from models.vehicle import Vehicle
from tireid import verdicts
from tireid.diagnoses import diagnosis_notes, diagnosis_section
from tireid.identified import Results, file_name
from tireid.report import (
    READ,
    Block,
    Cell,
    Images,
    Marked,
    Note,
    Picture,
    Report,
    Section,
    Table,
    drawings,
    origin,
    sentence,
    write_report,
)
from tireid.reports.captions import (
    force_caption,
    inputs_caption,
    percents,
    settled_caption,
    slip_caption,
)

_EXTRAPOLATED = 0.01  # share of the samples beyond the known slip that is worth a note
_CAR = {  # numbers of a car and their units
    "mass": "kg",
    "l_f": "m",
    "l_r": "m",
    "yaw_inertia": "kg m²",
    "cornering_stiffness_front": "N/rad",
    "cornering_stiffness_rear": "N/rad",
}


def write_identify_report(
    folder: Path,
    found: Results,
    figures: Images,
    diagnosis: Diagnosis,
    command: str,
    log_map: LogMap,
) -> None:
    """Write the report of what was learnt.   log_map : how its logs were read."""
    learnt, model, verdict, evaluated = found.runs[0], found.model, found.verdict, found.evaluated
    slip = slip_caption(model, learnt.recording, verdict.forces)
    meaning = "validation drives on which the model is valid"
    third = verdicts.verdicts_headline(evaluated, meaning) or verdicts.known_headline(model)
    numbers = [*verdicts.model_error_headline(verdict), *third]
    report = Report(
        title=f"Tires of {learnt.vehicle.name}, identified on {learnt.recording.name}",
        summary=_how_learnt(learnt),
        numbers=[
            verdicts.verdict_headline(verdict),
            *verdicts.of_answer(verdict, numbers),
        ],
        lead=[curve_drawing(figures, verdict, slip)],
        notes=[
            *verdicts.verdict_notes(verdict),
            *verdicts.verdicts_notes(evaluated),
            *diagnosis_notes(diagnosis, verdict),
            *identify_notes(model, found.runs),
        ],
        sections=[
            verdicts.verdict_section(verdict, model),
            Section("Identified tires", learnt_blocks(found, figures)),
            *verdicts.sensors_section(model, found.drives),
            Section(
                "How well it predicts",
                [*_evaluated(evaluated), *_errors(found, figures)],
            ),
            Section("What went in", went_in(model, log_map, learnt.recording, figures)),
            diagnosis_section(diagnosis),
            origin(
                command,
                learnt.vehicle,
                [run.recording for run in found.runs],
                channels=f"hash {digest(repr(log_map))}",
                method=f"{found.method}, hash {digest(learnt.method.numbers())}",
            ),
        ],
    )
    write_report(folder, report)


def _how_learnt(learnt: History) -> str:
    estimated = learnt.recording.logged_v_y is None
    lateral = "acceleration" if estimated else "velocity"
    declared = side_slip_text(learnt)
    more = f" Lateral velocity was not measured: {declared}." if estimated and declared else ""
    how = "identified sample by sample" if learnt.online else "one estimate of tires and sensors"
    return (
        f"{learnt.recording.duration:.4g} s of driving, {how} from speed, "
        f"lateral {lateral}, yaw rate and steering.{more}"
    )


def side_slip_text(learnt: History) -> str:
    """Return how well a run knew side slip, where it estimated it; else nothing."""
    if not {"v_y_sd", "side_slip_observable"} <= set(learnt.outputs):
        return ""
    moves = learnt.recording.v_x >= learnt.method.min_speed
    sd = learnt.outputs["v_y_sd"].ravel()[moves] / learnt.recording.v_x[moves]
    seen = 100.0 * float(np.mean(learnt.outputs["side_slip_observable"].ravel()[moves]))
    median = float(np.degrees(np.median(sd)))
    return (
        f"side slip was estimated to ± {median:.2g} deg (median), observable {seen:.0f} % of the "
        "time"
    )


def curve_drawing(figures: Images, verdict: Verdict, caption: str) -> Picture:
    """Return the learnt curve with its band, the first figure of a report."""
    word = "" if verdict.valid else f"{verdict.word[0].upper()}{verdict.word[1:]}. "
    return drawings(figures, {"slip": f"{word}{caption}"})[0]


def identify_notes(model: TireModel, runs: Sequence[History]) -> list[Note]:
    """Return what speaks against a frozen model: divergence, extrapolation, no truth."""
    said = estimates_notes(model.vehicle)
    for run in runs:
        name = run.recording.name
        if run.diverged_at is not None:
            said.append(
                Note(f"learning diverged at {freeze_key(run.diverged_at)} s.", "doubt", name)
            )
        if run.recording.axle_force is None and run.online:
            text = "no true forces: errors are against the forces identified online."
            said.append(Note(text, where=name))
        said += extrapolated(model, run.recording)
    if model.known_slip is None:
        text = "This kind of model does not report the slip range that it was identified for."
        said.append(Note(text))
    return said


def estimates_notes(vehicle: Vehicle) -> list[Note]:
    """Return that the yaw inertia was not measured, as a note."""
    text = "The yaw inertia is estimated from mass, l_f and l_r: declare it where it is known."
    return [Note(text)] * ("yaw_inertia" in vehicle.estimated)


def went_in(
    model: TireModel, log_map: LogMap, recording: Recording, figures: Images
) -> list[Block]:
    """Return the numbers of the car, the channels that were declared, and the signals."""
    car, rows = model.vehicle, list[list[Cell]]()
    for name, unit in _CAR.items():
        unused = name.startswith("cornering") and model.kind == "fit"
        origin_of = f"{car.origin(name)}{', not used by this method' * unused}"
        rows.append([name, f"{getattr(car, name):.6g} {unit}", origin_of])
    channels = list[list[Cell]]()
    for name, one in log_map.signals.items():
        given = {"ratio": one.ratio - 1.0, "factor": one.factor - 1.0, "offset": one.offset}
        read = [f"{key} {getattr(one, key):g}" for key, change in given.items() if change]
        how = [one.unit or "its unit", *read, *["table"] * bool(one.table)]
        channels.append([column_of(name), " + ".join(one.channel), ", ".join(how)])
    listed = "Declared channels. Signals without a row have standard names or notes below."
    header = ["signal", "channel", "read as"]
    tables = [Table(f"The car, {car.name}.", ["number", "value", "origin"], rows)]
    tables += [Table(listed, header, channels)] * bool(channels)
    return [*tables, *drawings(figures, {"inputs": inputs_caption(recording)})]


def extrapolated(model: TireModel, recording: Recording) -> list[Note]:
    """Return how much of a drive exceeds the identified slip range, as a note."""
    beyond = beyond_known(model, recording)
    if model.known_slip is None or beyond is None or max(beyond) <= _EXTRAPOLATED:
        return []
    front, rear = np.degrees(model.known_slip)
    text = (
        f"{percents(beyond)} of the samples exceed the identified slip range (front / rear, "
        f"{front:.1f} / {rear:.1f}°). There the curve is extrapolated."
    )
    return [Note(text, where=recording.name)]


def learnt_blocks(found: Results, figures: Images) -> list[Block]:
    blocks: list[Block] = [
        (
            "Slip has the sign of the paper, so that curves rise: positive slip pushes to the "
            "left. curve.csv has the curve with its uncertainty, weights.json the model."
        )
    ]
    if band := band_sentence(found.model):
        blocks.append(band)
    captions = {
        "side_slip": sentence(side_slip_text(found.runs[0]) or "side slip as estimated"),
        "learnt": settled_caption(found.runs[0]) if "learnt" in figures else "",
        "error": "Norm of the observer's error.",
        "weights": "Weights of the network.",
    }
    return [*blocks, *drawings(figures, captions)]


def band_sentence(model: TireModel) -> str:
    """Return how wide the band is where slip is known, in words; empty where there is none."""
    known, band = model.known_slip, model.band
    if known is None or band is None or not (known > 0.0).all():
        return ""
    at, half = model.force(known), band.half(known)
    shares = [100.0 * float(half[i, i]) / max(abs(float(at[i, i])), 1.0) for i in range(2)]
    return (
        "The band is where nine of ten forces of other drives are to be expected: at the end of "
        f"the known slip ± {shares[0]:.1f} / {shares[1]:.1f} % of the force (front / rear). Its "
        f"width: {band.origin}. Where slip is not known it widens to the prior."
    )


def _evaluated(evaluated: verdicts.Verdicts) -> list[Block]:
    rows: list[list[Cell]] = []
    for name, verdict in evaluated.items():
        errors = verdict.model_error or (None, None)
        shares = [None if one is None else with_doubt(PERCENT * one) for one in errors]
        rows.append([name, Marked(verdict.word, verdicts.tone_of(verdict)), *shares])
    caption = "Verdict on each validation drive, and the model error over the force in the motion."
    header = ["validation drive", "verdict", "front [%]", "rear [%]"]
    return [Table(caption, header, rows)] if rows else []


def _errors(found: Results, figures: Images) -> list[Block]:
    learnt, *others = found.runs
    rows, online = list[list[Cell]](), learnt.online
    for run in (learnt, *found.parts, *others):
        name, size = run.recording.name, force_rms(run)
        if online:
            rows.append([f"{name}, online", *error_numbers(online_error(run), size)])
        for key, replays in found.frozen.items():
            error = replays[name].against_truth or replays[name].against_online
            named = f"{name}, frozen, {key} s" if online or len(found.frozen) > 1 else name
            rows.append([named, *error_numbers(error, size)])
    against = "; without one it is against what was identified online" * online
    blocks: list[Block] = [error_table(rows, against)] if any(row[1] for row in rows) else []
    blocks.append(replay_picture(found, figures, "forces", learnt.recording.name))
    for one in (run.recording for run in others):
        blocks.append(replay_picture(found, figures, f"replay_{file_name(one)}", one.name))
    return blocks


def replay_picture(found: Results, figures: Images, figure: str, name: str) -> Picture:
    """Return a figure of the frozen model on a drive, with its error.

    figure : by the name of its file.   name : of the drive.
    """
    learnt, replay = found.runs[0], found.replays[name]
    verdict = {learnt.recording.name: found.verdict, **found.evaluated}[name]
    caption = force_caption(replay.recording, replay.axle_force, found.model, verdict)
    online = learnt.online and figure == "forces"
    return Picture(figures[figure], caption, READ["forces" if online else "replay"])


def error_table(rows: Sequence[Sequence[Cell]], more: str = "") -> Table:
    """Return a table of errors, of rows of a name and `error_numbers`."""
    return Table(
        f"RMSE of the axle force, and its share of the rms force where there is a truth{more}.",
        ["drive", "front [N]", "share", "rear [N]", "share"],
        rows,
    )


def error_numbers(error: AxleRmse | None, size: AxleRmse | None) -> list[Cell]:
    """Return front and rear error, each with its share of the rms force where it is known."""
    if error is None:
        return [None] * 4
    shares = [
        f"{100.0 * newtons / force:.1f} %" if force > 0.0 else None
        for newtons, force in zip(astuple(error), astuple(size) if size else (0, 0), strict=True)
    ]
    return [error.front, shares[0], error.rear, shares[1]]
