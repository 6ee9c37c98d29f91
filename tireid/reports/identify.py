"""The report of `tireid identify`: what was learnt, how well it predicts, where not to ask it."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from identifier.axle.guarantee import Guarantee
from identifier.doctor import Diagnosis
from identifier.reproducibility import (
    AxleRmse,
    Replay,
    beyond_known,
    force_rms,
    freeze_key,
    online_error,
)
from identifier.run import History
from identifier.tire_model import TireModel
from identifier.verdict import Verdict
from models.files import digest
from tireid.diagnoses import diagnosis_section, diagnosis_warnings
from tireid.report import Block, Headline, Paragraph, Report, Section, Table, write_report
from tireid.reports.common import READ, REPORT, drawing, origin
from tireid.verdicts import verdict_headline, verdict_section, verdict_warnings

AXLES = ("front", "rear")
HEADLINES = 3  # facts of a model that stand at the top
EXTRAPOLATED = 0.01  # share of the samples beyond the known slip that is worth a warning


def write_identify_report(
    folder: Path,
    law: str,
    model: TireModel,
    runs: Sequence[History],
    frozen: Mapping[str, Mapping[str, Replay]],
    figures: Mapping[str, Figure],
    verdict: Verdict,
    parts: Sequence[History] = (),
    *,
    diagnosis: Diagnosis,
    command: str,
) -> None:
    """Write the report of what was learnt, or of a network that was judged.

    Parameters
    ----------
    folder : where to.
    law : what learnt, as the user named it.
    runs : online, the one that was learnt on first.
    frozen : by when it was frozen, replays by recording; the last is of the model.
    figures : by the name of their files.
    verdict : on the model.
    parts : of the first run, over each of several logs that were learnt on.
    diagnosis : of what was learnt on, as it was read.
    command : as it was typed.
    """
    learnt, last = runs[0], list(frozen.values())[-1]
    sections = [
        verdict_section(verdict),
        Section(heading="What was learnt", blocks=learnt_blocks(law, model, figures)),
        Section(
            heading="How well it predicts",
            blocks=_errors([runs[0], *parts, *runs[1:]], frozen, figures),
        ),
        Section(
            heading="What went in",
            blocks=[
                drawing(figures["inputs"], f"Signals of {learnt.recording.name}.", READ["inputs"])
            ],
        ),
        diagnosis_section(diagnosis),
        origin(
            command,
            learnt.vehicle,
            [run.recording for run in runs],
            method=f"{law}, hash {digest(learnt.design.numbers())}",
        ),
    ]
    report = Report(
        title=f"Tires of {learnt.vehicle.name}, learnt on {learnt.recording.name}",
        summary=_how_learnt(learnt),
        numbers=[verdict_headline(verdict), *identify_headlines(model, runs, last)],
        warnings=[
            *verdict_warnings(verdict),
            *diagnosis_warnings(diagnosis),
            *identify_warnings(model, runs),
        ],
        sections=sections,
    )
    write_report(folder / REPORT, report)


def _how_learnt(learnt: History) -> str:
    """Return what was learnt from, in words."""
    estimated = learnt.recording.logged_v_y is None
    lateral = "acceleration" if estimated else "velocity"
    told = side_slip_text(learnt)
    more = f" Nobody measured lateral velocity: {told}." if estimated and told else ""
    return (
        f"{learnt.recording.duration:.4g} s of driving, learnt sample by sample from speed, "
        f"lateral {lateral}, yaw rate and steering.{more}"
    )


def side_slip_text(learnt: History) -> str:
    """Return how well a run knew side slip, where it tells it; else nothing.

    Parameters
    ----------
    learnt : the run.
    """
    if not {"v_y_sd", "side_slip_observable"} <= set(learnt.outputs):
        return ""
    moves = learnt.recording.v_x >= learnt.design.min_speed
    sd = learnt.outputs["v_y_sd"].ravel()[moves] / learnt.recording.v_x[moves]
    seen = 100.0 * float(np.mean(learnt.outputs["side_slip_observable"].ravel()[moves]))
    median = float(np.degrees(np.median(sd)))
    return f"side slip was told to ± {median:.2g} deg (median), observable {seen:.0f} % of the time"


def identify_headlines(
    model: TireModel, runs: Sequence[History], replays: Mapping[str, Replay]
) -> list[Headline]:
    """Return the errors of a frozen model, other drives first, and what it says of the tires.

    Parameters
    ----------
    runs : online, the one that was learnt on first.
    replays : of the model, by recording.
    """
    numbers = []
    for kind, some in (("not learnt on", runs[1:]), ("learnt on", runs[:1])):
        shares = [share for run in some if (share := _share(run, replays)) is not None]
        if shares:
            meaning = f"of the rms force missed on drives {kind}, frozen"
            numbers.append(Headline(f"{100.0 * float(np.mean(shares)):.1f} %", meaning))
    for title, (front, rear), unit in model.facts()[:HEADLINES]:
        scale, name = (1e3, f"k{unit}") if unit.startswith("N") and front >= 1e3 else (1.0, unit)
        value = f"{front / scale:.3g} / {rear / scale:.3g} {'°' if name == 'deg' else name}"
        numbers.append(Headline(value.replace(" °", "°"), f"{title}, front / rear"))
    return numbers


def _share(run: History, replays: Mapping[str, Replay]) -> float | None:
    """Return the frozen error of both axles over their rms force, None without truth."""
    size, replay = force_rms(run), replays.get(run.recording.name)
    if size is None or replay is None or replay.against_truth is None or not size.both > 0.0:
        return None
    return replay.against_truth.both / size.both


def identify_warnings(model: TireModel, runs: Sequence[History]) -> list[str]:
    """Return what speaks against a frozen model: divergence, extrapolation, no truth.

    Parameters
    ----------
    runs : online, the one that was learnt on first.
    """
    said = [f"{model.vehicle.estimates}."] if model.vehicle.estimates else []
    for run in runs:
        name, recording = run.recording.name, run.recording
        if run.diverged_at is not None:
            said.append(f"{name}: learning diverged at {freeze_key(run.diverged_at)} s.")
        if recording.axle_force is None:
            said.append(
                f"{name} has no true forces: errors are against what was identified online over "
                "it, which asks only whether the model agrees with itself."
            )
        beyond = beyond_known(model, recording)
        if model.known_slip is None or beyond is None:
            continue
        for axle, share, known in zip(AXLES, beyond, np.degrees(model.known_slip), strict=True):
            if share > EXTRAPOLATED:
                said.append(
                    f"{name}: {100.0 * share:.0f} % of the samples slip farther than is known at "
                    f"the {axle} axle ({known:.1f}°): there the curve is a guess."
                )
    if model.known_slip is None:
        said.append("This kind of model cannot tell where it knows the tires and where it guesses.")
    return said


def learnt_blocks(law: str, model: TireModel, figures: Mapping[str, Figure]) -> list[Block]:
    """Return the numbers and the figures of a frozen model.

    Parameters
    ----------
    law : what learnt, as the user named it.
    figures : by the name of their files.
    """
    facts = [[fact.title, *fact.words, fact.unit] for fact in model.facts()]
    blocks: list[Block] = [
        Paragraph(
            text="Slip has the sign of the paper, so that curves rise: positive slip pushes to the "
            "left. curve.csv holds the curve with what is known of it, weights.json the model."
        ),
        Table(caption=f"The tires by {law}.", header=["", *AXLES, "unit"], rows=facts),
        drawing(figures["slip"], "Axle force over slip angle: drive and curve.", READ["slip"]),
    ]
    for told in (band_sentence(model), guaranteed_sentence(model)):
        if told:
            blocks.append(Paragraph(text=told))
    for name, caption in (
        ("side_slip", "Side slip as it was estimated."),
        ("learnt", "What was learnt over time."),
        ("error", "Norm of the observer's error."),
        ("weights", "Weights of the network."),
    ):
        if name in figures:
            blocks.append(drawing(figures[name], caption, READ[name]))
    return blocks


def band_sentence(model: TireModel) -> str:
    """Return how wide the band is where slip is known, in words; empty where there is none.

    Parameters
    ----------
    model : frozen, its band calibrated or not.
    """
    known = model.known_slip
    half = None if known is None else model.half_band(known)
    if known is None or half is None or not (known > 0.0).all():
        return ""
    at = model.force(known)
    shares = [100.0 * float(half[i, i]) / max(abs(float(at[i, i])), 1.0) for i in range(2)]
    how = (
        "its width was found on parts of the drive that had not taught the model, by the motion"
        if model.band_calibrated
        else "the drive was too short to check its width, which is what learning believes"
    )
    return (
        "The band is where nine of ten forces of other drives are to be expected: at the end of "
        f"the known slip ± {shares[0]:.1f} / {shares[1]:.1f} % of the force (front / rear); {how}. "
        "Where slip is not known it widens to what was believed before the drive."
    )


def guaranteed_sentence(model: TireModel) -> str:
    """Return which forces are guaranteed where slip is known, in words; empty where none are.

    Parameters
    ----------
    model : frozen, with a guaranteed band or without.
    """
    known, given = model.known_slip, getattr(model, "guarantee", None)
    limits = None if known is None else model.guaranteed_band(known)
    if known is None or not isinstance(given, Guarantee) or limits is None:
        return ""
    low, high = (np.diag(side) / model.vehicle.axle_loads for side in limits)
    ends = [f"{least:.2f} to {most:.2f}" for least, most in zip(low, high, strict=True)]
    front, rear = given.bound.error
    late_front, late_rear = (1e3 * tau for tau in given.bound.lateness)
    fast_front, fast_rear = given.fastest
    return (
        f"Guaranteed at the end of the known slip: a force of {ends[0]} / {ends[1]} static axle "
        "loads (front / rear), if no force of the drive or of another differs from the best curve "
        f"by more than {front:.3f} / {rear:.3f} static axle loads, and {late_front:.0f} / "
        f"{late_rear:.0f} ms times how fast it changes. Where slip is beyond that of the drive, "
        f"or a force changes faster than there, by more than {fast_front:.1f} / {fast_rear:.1f} "
        "static axle loads a second, the difference may be as much larger. That bound was "
        f"{'told' if given.told else 'estimated from the drive'}."
    )


def _errors(
    runs: Sequence[History],
    frozen: Mapping[str, Mapping[str, Replay]],
    figures: Mapping[str, Figure],
) -> list[Block]:
    rows = []
    for run in runs:
        name, size = run.recording.name, force_rms(run)
        rows.append([name, "online", *_cells(online_error(run), size)])
        for when, replays in frozen.items():
            error = replays[name].against_truth or replays[name].against_online
            rows.append([name, f"frozen, {when}", *_cells(error, size)])
    blocks: list[Block] = [
        Table(
            caption="RMSE of the axle force, and its share of the rms force where there is a "
            "truth; without one it is against what was identified online.",
            header=["drive", "", "front [N]", "share", "rear [N]", "share"],
            rows=rows,
        )
    ]
    if "forces" in figures:
        caption = "Axle forces over time: online, and replayed with frozen weights."
        blocks.append(drawing(figures["forces"], caption, READ["forces"]))
    for name, figure in figures.items():
        if name.startswith("replay_"):
            caption = f"The frozen model asked about {name.removeprefix('replay_')}."
            blocks.append(drawing(figure, caption, READ["replay"]))
    return blocks


def _cells(error: AxleRmse | None, size: AxleRmse | None) -> list[str | float | None]:
    if error is None:
        return [None] * 4
    cells: list[str | float | None] = []
    for newtons, force in zip(
        (error.front, error.rear), (size.front, size.rear) if size else (0.0, 0.0), strict=True
    ):
        cells += [newtons, f"{100.0 * newtons / force:.1f} %" if force > 0.0 else None]
    return cells
