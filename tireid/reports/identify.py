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
from identifier.tire_model import AXLES, TireModel
from identifier.verdict import Verdict
from identifier.verdict.verdict import PERCENT
from models.files import digest
from models.recordings import Recording
from tireid import verdicts
from tireid.diagnoses import diagnosis_section, diagnosis_warnings
from tireid.identified import Results
from tireid.report import (
    READ,
    Block,
    Cell,
    Headline,
    Images,
    Marked,
    Picture,
    Report,
    Section,
    Table,
    Tone,
    drawings,
    origin,
    write_report,
)

_EXTRAPOLATED = 0.01  # share of the samples beyond the known slip that is worth a warning


def write_identify_report(
    folder: Path,
    found: Results,
    figures: Images,
    diagnosis: Diagnosis,
    command: str,
) -> None:
    """Write the report of what was learnt."""
    learnt, model, verdict, evaluated = found.runs[0], found.model, found.verdict, found.evaluated
    notes = [*diagnosis_warnings(diagnosis), *identify_warnings(model, found.runs)]
    numbers = [
        *verdicts.model_error_headline(verdict),
        *_evaluated_headlines(evaluated),
        *verdicts.number_headlines(verdict),
        *identify_headlines(found),
    ]
    report = Report(
        title=f"Tires of {learnt.vehicle.name}, identified on {learnt.recording.name}",
        summary=_how_learnt(learnt),
        numbers=[
            verdicts.verdict_headline(verdict, notes),
            *verdicts.of_answer(verdict, numbers),
        ],
        lead=[curve_drawing(figures, verdict)],
        warnings=[
            *verdicts.verdict_warnings(verdict),
            *verdicts.verdicts_warnings(evaluated, "{}, replayed: "),
            *notes,
        ],
        sections=[
            verdicts.verdict_section(verdict),
            Section("Identified tires", learnt_blocks(found.method, model, figures)),
            *verdicts.sensors_section(model, found.drives),
            Section(
                "How well it predicts",
                [*_evaluated(evaluated), *_errors(found, figures)],
            ),
            Section(
                "What went in",
                drawings(figures, {"inputs": f"Signals of {learnt.recording.name}."}),
            ),
            diagnosis_section(diagnosis),
            origin(
                command,
                learnt.vehicle,
                [run.recording for run in found.runs],
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


def identify_headlines(found: Results) -> list[Headline]:
    """Return the errors of a frozen model, other drives first, and up to which slip it knows."""
    numbers, runs = [], found.runs
    for kind, some in (("of validation", runs[1:]), ("of identification", runs[:1])):
        shares = []
        for run in some:
            size, error = force_rms(run), found.replays[run.recording.name].against_truth
            if size and error and size.both > 0.0:
                shares.append(error.both / size.both)
        if shares:
            meaning = f"of the rms force: error on drives {kind}, frozen"
            numbers.append(Headline(f"{100.0 * float(np.mean(shares)):.1f} %", meaning))
    return [*numbers, *verdicts.known_headline(found.model)]


def _evaluated_headlines(evaluated: verdicts.Verdicts) -> list[Headline]:
    """Return on how many validation drives a model is valid, and its error."""
    meaning = "replayed validation drives with a valid prediction"
    numbers = verdicts.verdicts_headline(evaluated, meaning)
    shares = [one.model_error for one in evaluated.values() if one.model_error is not None]
    if shares:
        front, rear = (f"{PERCENT * share:.1f}" for share in np.mean(shares, axis=0))
        meaning = "error over the force in the motion of these drives, front / rear"
        numbers.append(Headline(f"{front} / {rear} %", meaning))
    return numbers


def curve_drawing(figures: Images, verdict: Verdict) -> Picture:
    """Return the learnt curve with its band, the first figure of a report."""
    word = "" if verdict.valid else f"{verdict.word[0].upper()}{verdict.word[1:]}. "
    caption = f"{word}Axle force over slip angle: drive, curve and its band."
    return drawings(figures, {"slip": caption})[0]


def identify_warnings(model: TireModel, runs: Sequence[History]) -> list[str]:
    """Return what speaks against a frozen model: divergence, extrapolation, no truth."""
    said = [f"{model.vehicle.estimates}."] if model.vehicle.estimates else []
    for run in runs:
        name, recording = run.recording.name, run.recording
        if run.diverged_at is not None:
            said.append(f"{name}: learning diverged at {freeze_key(run.diverged_at)} s.")
        if recording.axle_force is None and run.online:
            said.append(
                f"{name} has no true forces: errors are against the forces identified online."
            )
        said += extrapolated(model, recording)
    if model.known_slip is None:
        said.append("This kind of model does not report the slip range that it was identified for.")
    return said


def extrapolated(model: TireModel, recording: Recording) -> list[str]:
    """Return at which axles a drive exceeds the identified slip range, in words."""
    beyond = beyond_known(model, recording)
    if model.known_slip is None or beyond is None:
        return []
    return [
        f"{recording.name}: {100.0 * share:.0f} % of the samples exceed the identified slip range "
        f"of the {axle} axle ({known:.1f}°). There the curve is extrapolated."
        for axle, share, known in zip(AXLES, beyond, np.degrees(model.known_slip), strict=True)
        if share > _EXTRAPOLATED
    ]


def learnt_blocks(law: str, model: TireModel, figures: Images) -> list[Block]:
    facts = [[f"{fact.title} [{fact.unit}]", *fact.words] for fact in model.facts()]
    blocks: list[Block] = [
        (
            "Slip has the sign of the paper, so that curves rise: positive slip pushes to the "
            "left. curve.csv has the curve with its uncertainty, weights.json the model."
        )
    ]
    if facts:
        blocks.append(Table(f"Parameters of the tires, {law}.", ["", *AXLES], facts))
    if band := band_sentence(model):
        blocks.append(band)
    captions = {
        "side_slip": "Side slip as it was estimated.",
        "learnt": "Estimates over time.",
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
        tone: Tone = "" if verdict.valid else "bad" if verdict.judged else "doubt"
        rows.append([name, Marked(verdict.word, tone), *shares])
    if not rows:
        return []
    caption = (
        "The verdict on each replayed drive, as of tireid predict, and the error over the force "
        "in the motion."
    )
    return [Table(caption, ["drive", "verdict", "front [%]", "rear [%]"], rows)]


def _errors(found: Results, figures: Images) -> list[Block]:
    learnt, *others = found.runs
    rows, online = list[list[Cell]](), learnt.online
    for run in (learnt, *found.parts, *others):
        name, size = run.recording.name, force_rms(run)
        if online:
            rows.append([f"{name}, online", *error_numbers(online_error(run), size)])
        for key, replays in found.frozen.items():
            error = replays[name].against_truth or replays[name].against_online
            rows.append([f"{name}, frozen, {key} s", *error_numbers(error, size)])
    blocks: list[Block] = [
        error_table(rows, "; without one it is against what was identified online" * online)
    ]
    if "forces" in figures:
        caption = f"Axle forces over time: {'online, and ' * online}replayed with frozen weights."
        read = READ["forces" if online else "replay"]
        blocks.append(Picture(figures["forces"], caption, read))
    for name, image in figures.items():
        if name.startswith("replay_"):
            caption = f"The frozen model on {name.removeprefix('replay_')}."
            blocks.append(Picture(image, caption, READ["replay"]))
    return blocks


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
