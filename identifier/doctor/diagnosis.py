"""What is wrong with a log and its car: findings in order, a repair, and what is not observable."""

import math
from dataclasses import dataclass, replace
from typing import Any

from codegen.arrays import one_thread
from identifier.doctor.faults import Examination, examine, prepared
from identifier.doctor.finding import Finding, first_of_each
from identifier.doctor.samples import sample_findings
from identifier.doctor.screen import (
    NEAR,
    Screened,
    before_sizes,
    clock_findings,
    combined,
    doubted,
    screen,
    steering_finding,
)
from models.recordings import Recording, RecordingError
from models.recordings.checks import physics_contradiction, vehicle_contradiction, world_axes
from models.recordings.repair import Repair
from models.vehicle import Vehicle, VehicleError

_ROUNDS = 2  # in which the ratio of a steering wheel is found
_SETTLED = 0.02  # change of that ratio, in parts, below which it is settled
_WIDE = 1.0  # of that ratio, by which the screen may be off
_SURELY = 0.9  # confidence that a law is broken

RATIOS = ("steering_ratio", "factor")  # codes of gross findings whose factor is any number
ELSEWHERE = ("velocity_sensor_x", "v_y")  # what may be in place of a gross fault
WITHOUT_V_Y = "all but what contradicts physics or the car: the log has no lateral velocity"
NEVER = (
    "mass: scales all forces alike and leaves the motion as it is; weigh the car",
    "the lateral axis mirrored throughout (y to the right, as in SAE or NED): the equations "
    "of motion hold either way; look at one left turn",
)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Diagnosis:
    """What is wrong with a log or with the declaration of its car, and the repair.

    Parameters
    ----------
    findings : those that matter most first.
    unobservable : what this log cannot tell, and why, a line each.
    """

    name: str
    findings: tuple[Finding, ...]
    unobservable: tuple[str, ...]

    @property
    def healthy(self) -> bool:
        """Whether nothing was found that matters, be it clear or not which of several it is."""
        return not any(one.matters for one in self.findings)

    @property
    def repair(self) -> Repair:
        """What takes out all that is sure."""
        return combined(one for one in self.findings if one.sure)

    def lines(self, *, unobservable: bool = True) -> list[str]:
        """Return the findings, and how certain they are, a line each.

        Parameters
        ----------
        unobservable : whether what the log cannot tell follows.
        """
        found = [f"{one.text} ({_certainty(one)})" for one in self.findings]
        return found + [f"not observable: {line}" for line in self.unobservable if unobservable]

    def summary(self) -> str:
        """Return the findings and what is unobservable as lines of text."""
        nothing = [] if self.findings else ["nothing found"]
        return "\n".join([f"{self.name}:", *nothing, *self.lines()])

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain numbers and words, ready for JSON; None is what is not known."""
        return {
            "recording": self.name,
            "healthy": self.healthy,
            "findings": [one.to_dict() for one in self.findings],
            "not_observable": list(self.unobservable),
            "repair": self.repair.tables(),
        }

    def __repr__(self) -> str:
        codes = ", ".join(f"{one.code} {one.channel}".strip() for one in self.findings)
        return f"<Diagnosis of {self.name!r}: {codes or 'nothing found'}>"


def _certainty(one: Finding) -> str:
    return "sure" if one.sure else ("note, " if one.note else "") + f"confidence {one.percent}"


@one_thread
def diagnose(recording: Recording, vehicle: Vehicle) -> Diagnosis:
    """Return what is wrong with a log or with the declaration of its car, from the log alone.

    Parameters
    ----------
    recording : as it was read; its axle forces are not used.
    """
    world = world_axes(recording)
    if world is not None:  # nothing that follows would be of this car
        finding = Finding(code="world_axes", channel="v_y", confidence=_SURELY, text=world)
        return Diagnosis(name=recording.name, findings=(finding,), unobservable=NEVER)
    if recording.logged_v_y is None:
        samples = clock_findings(recording) or sample_findings(recording)
        given = (*_contradictions(recording, vehicle), *samples)
        return Diagnosis(name=recording.name, findings=given, unobservable=(WITHOUT_V_Y, *NEVER))
    gross = screen(recording, vehicle)
    blind = gross.blind
    found, fine = list(gross.findings), Examination()
    if not blind:
        try:
            found, fine = _examined_finely(gross, recording, vehicle)
            if gross.without is not None and ELSEWHERE not in fine.taken:
                gross, fine = gross.without, Examination()
                found, blind = list(gross.findings), gross.blind
                if not blind:
                    found, fine = _examined_finely(gross, recording, vehicle)
            sure = combined(one for one in doubted(fine.findings, found) if one.sure)
            mended = before_sizes(found).merged(sure)
            found += _contradictions(*mended.apply(recording, vehicle))
        except (RecordingError, VehicleError) as error:
            blind = str(error)
    elif any(one.code == "straight" for one in found):  # by a yaw rate that may be the fault
        broken = _contradictions(recording, vehicle)
        found = [one for one in found if one.code != "straight" or not broken] + broken
    coarse = {one.channel for one in found if one.code == "quantized"}  # all sizes need delta_f
    sizes = [
        replace(one, note=True, sure=False) if coarse & {one.channel, "delta_f"} else one
        for one in doubted(fine.findings, found)
    ]
    ranked = sorted([*found, *sizes], key=lambda one: not one.matters)
    return Diagnosis(
        name=recording.name,
        findings=tuple(first_of_each(ranked)),
        unobservable=(*_unobservable(recording, replace(gross, blind=blind)), *fine.unobservable),
    )


def _examined_finely(
    gross: Screened, recording: Recording, vehicle: Vehicle
) -> tuple[list[Finding], Examination]:
    """Return the gross findings, the ratio of a steering wheel exactly, and sizes beside them."""
    found = list(gross.findings)
    wheel = next((one for one in found if one.code in RATIOS and one.repair), None)
    if wheel is None:
        return found, examine(*gross.repair.apply(recording, vehicle))
    exact = _exact_ratio(wheel, *gross.repair.apply(recording, vehicle))
    kept = [exact if one is wheel else one for one in gross.findings]
    found = [one for one in kept if one is not None]
    return found, examine(*before_sizes(found).apply(recording, vehicle))


def _contradictions(recording: Recording, vehicle: Vehicle) -> list[Finding]:
    """Return the law that a log still breaks as it is read best, as one finding.

    What is sure of its sizes is taken out before: a sensor far ahead alone may break a law.
    """
    blind = replace(recording, axle_force=None)
    said = physics_contradiction(blind) or vehicle_contradiction(blind, vehicle)
    return [] if said is None else [Finding(code="contradiction", confidence=_SURELY, text=said)]


def _exact_ratio(coarse: Finding, drive: Recording, car: Vehicle) -> Finding | None:
    """Return the ratio of a steering wheel as the drive says it, no stiffness believed.

    None where the drive says that the steering is right.
    """
    assert coarse.repair is not None
    factor, deviation = coarse.repair.factor["delta_f"], math.nan
    for _ in range(_ROUNDS):
        search = prepared(drive, car)
        if search is None:
            return coarse
        search.wide["steering_gain"] = _WIDE
        post = search.run()  # what distorts the motion distorts the ratio
        gain, deviation = post["steering_gain"], post.sd("steering_gain")
        factor *= 1.0 + gain
        if abs(gain) < _SETTLED:
            break
        drive, _ = Repair(factor={"delta_f": 1.0 + gain}).apply(drive, car)
    if abs(math.log(abs(factor))) < NEAR and factor > 0.0:
        return None
    exact = steering_finding(factor, coarse.confidence, deviation=deviation)
    return replace(exact, sure=exact.sure and coarse.sure)


def _unobservable(recording: Recording, gross: Screened) -> tuple[str, ...]:
    """Return what this log cannot tell, a line each."""
    lines = [*NEVER, *gross.unobservable]
    if gross.blind:
        sizes = "offsets, delays, lever arms, scales, center of gravity, inertia"
        lines.append(f"{sizes}: {gross.blind}")
    elif recording.a_y is None:
        speeds = "a v_x of 0.9 to 1.2 times the right one, units of speed against one another"
        lines.append(f"bank of the road, {speeds}: there is no a_y in the log")
    return tuple(lines)
