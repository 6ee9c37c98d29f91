"""The report of `tireid predict`: does a stored model give back the motion of a drive?"""

from collections.abc import Mapping
from pathlib import Path

from matplotlib.figure import Figure

from identifier.prediction import Prediction
from identifier.verdict.verdict import PERCENT
from models.files import digest
from tireid import report as page
from tireid.reports.common import READ, REPORT, drawing, origin
from tireid.reports.identify import (
    asked_warnings,
    band_sentence,
    curve_drawing,
    guaranteed_sentence,
)
from tireid.verdicts import (
    known_headline,
    missed_headline,
    of_answer,
    stored_warning,
    verdict_headline,
    verdict_section,
    verdict_warnings,
)


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
    tires = [
        page.Paragraph(text=text) for text in (band_sentence(model), guaranteed_sentence(model))
    ]
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
            page.Section(
                heading="What it predicts", blocks=[*found, *(one for one in tires if one.text)]
            ),
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
