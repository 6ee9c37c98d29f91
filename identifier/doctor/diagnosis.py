"""What the doctor says of a log and of its car: findings in order, a repair, and what is unseen."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

from identifier.doctor.estimate import estimate
from identifier.doctor.finding import Finding
from identifier.doctor.screen import Screened, screen, steering_finding
from models.recordings import Recording, RecordingError
from models.recordings.repair import Repair
from models.vehicle import Vehicle, VehicleError

MATTERS = 0.5  # confidence, from which a finding is one
STEERING = ("steering_ratio", "factor", "sign", "unit")  # codes of a gross steering finding
NEVER = (
    "mass: scales all forces alike and leaves the motion as it is; weigh the car",
    "the lateral axis mirrored throughout (y to the right, as in SAE or NED): all laws stay as "
    "they are; look at one left turn",
)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Diagnosis:
    """What is wrong with a log or with what is told of its car, and what takes it out.

    Parameters
    ----------
    name : of the recording.
    findings : those that matter most first.
    unseen : what this log cannot tell, and why, a line each.
    """

    name: str
    findings: tuple[Finding, ...]
    unseen: tuple[str, ...]

    @property
    def healthy(self) -> bool:
        """Whether nothing was found that matters."""
        return not any(one.confidence >= MATTERS for one in self.findings)

    @property
    def repair(self) -> Repair:
        """What takes out all that is sure."""
        return combined(one for one in self.findings if one.sure)

    def summary(self) -> str:
        """Return the findings and what is unseen as lines of text."""
        lines = [f"{one.text} ({_certainty(one)})" for one in self.findings]
        found = lines or ["nothing found"]
        return "\n".join([f"{self.name}:", *found, *(f"cannot be seen: {s}" for s in self.unseen)])

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain numbers and words, ready for JSON; None is what is not known."""
        return {
            "recording": self.name,
            "healthy": self.healthy,
            "findings": [finding_dict(one) for one in self.findings],
            "unseen": list(self.unseen),
            "repair": self.repair.tables(),
        }

    def __repr__(self) -> str:
        codes = ", ".join(f"{one.code} {one.channel}".strip() for one in self.findings)
        return f"<Diagnosis of {self.name!r}: {codes or 'nothing found'}>"


def _certainty(one: Finding) -> str:
    return "sure" if one.sure else f"confidence {100.0 * one.confidence:.0f} %"


def finding_dict(one: Finding) -> dict[str, Any]:
    """Return a finding as plain numbers and words, ready for JSON.

    Parameters
    ----------
    one : of a diagnosis.
    """

    def number(value: float) -> float | None:
        return value if math.isfinite(value) else None

    return {
        "code": one.code,
        "channel": one.channel,
        "size": number(one.size),
        "deviation": number(one.deviation),
        "unit": one.unit,
        "confidence": one.confidence,
        "text": one.text,
        "sure": one.sure,
        "repair": None if one.repair is None else one.repair.tables(),
    }


def combined(findings: Iterable[Finding]) -> Repair:
    """Return the repair of several findings, gross ones before those that were asked after them.

    Parameters
    ----------
    findings : with or without a repair.
    """
    repair = Repair()
    for one in findings:
        if one.repair is not None:
            repair = repair.merged(one.repair)
    return repair


def diagnose(recording: Recording, vehicle: Vehicle) -> Diagnosis:
    """Return what is wrong with a log or with what is told of its car, from the log alone.

    Parameters
    ----------
    recording : as it was read; its axle forces are not looked at.
    vehicle : as it was told.
    """
    gross = screen(recording, vehicle)
    fine: tuple[Finding, ...] = ()
    found = gross.findings
    blind = gross.blind
    if not blind:
        try:
            drive, car = gross.repair.apply(recording, vehicle)
            fine = estimate(drive, car)
        except (RecordingError, VehicleError) as error:
            blind = str(error)
        found, fine = _one_steering(found, fine)
    ranked = [*found, *fine]
    return Diagnosis(
        name=recording.name,
        findings=tuple(sorted(ranked, key=lambda one: not one.confidence >= MATTERS)),
        unseen=_unseen(recording, replace(gross, blind=blind)),
    )


def _one_steering(
    gross: tuple[Finding, ...], fine: tuple[Finding, ...]
) -> tuple[tuple[Finding, ...], tuple[Finding, ...]]:
    """Make one of a gross factor of the steering angle and a fine one that was found after it."""
    coarse = next((one for one in gross if _is_steering(one)), None)
    exact = next((one for one in fine if one.code == "factor" and one.channel == "delta_f"), None)
    if coarse is None or exact is None or coarse.repair is None or not exact.size > 0.0:
        return gross, fine
    factor = coarse.repair.factor["delta_f"] / exact.size
    one = steering_finding(factor, coarse.confidence, deviation=exact.deviation / exact.size)
    return tuple(one if other is coarse else other for other in gross), tuple(
        other for other in fine if other is not exact
    )


def _is_steering(one: Finding) -> bool:
    return one.channel == "delta_f" and one.code in STEERING and one.repair is not None


def _unseen(recording: Recording, gross: Screened) -> tuple[str, ...]:
    """Return what this log cannot tell, a line each."""
    lines = list(NEVER)
    if gross.blind:
        lines.append(
            f"offsets, delays, lever arms, scales, center of gravity, inertia: {gross.blind}"
        )
        return tuple(lines)
    if recording.a_y is None:
        lines.append(
            "bank of the road, and units of speed against one another: there is no a_y in the log"
        )
    return tuple(lines)
