"""What is grossly wrong with a log or with its car, found before anything is estimated.

First the samples themselves, then whether there is anything to learn from, then units, signs and
the car: by that reading of the log which leaves least unexplained.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from identifier.doctor.finding import Finding
from identifier.doctor.pieces import SLOWEST, driven_pieces, driven_windows, looked_at, usual_speed
from identifier.doctor.readings import ARM, DEGREE, Change, Motion, Read, read
from identifier.doctor.samples import NOT_MEASURED, sample_findings
from identifier.doctor.suspects import similar_inertia, usual_inertia
from identifier.measured import with_doubt
from models.recordings import Recording, RecordingError
from models.recordings.checks import physics_contradiction
from models.recordings.repair import Repair
from models.vehicle import Vehicle

_QUIET = 0.8  # [m/s^2] of v_x r, which a drive must exceed in a share `lively` of its windows
_LIVELY = 0.005  # share of the windows of a drive, as of `quiet`
_SURE = 0.95  # confidence above which nothing else is named beside, and what is found is mended
_SEVERAL = 3  # changes at once, beyond which nothing is sure
_WHEEL = (5.0, 30.0)  # ratios of a steering wheel to the road wheels
NEAR = math.log(1.15)  # of a factor to that of a unit
_PERFECT = 0.999  # of a drive, from which a channel that does not change is no measurement
_OFTEN = 0.1  # of a drive, from which a channel that reads exactly 0 so long is no measurement
_SLOW = 1.0  # s between samples, from which a clock is in ms


@dataclass(frozen=True, slots=True, kw_only=True)
class Screened:
    """What is grossly wrong.
    repair : of samples and of what is read otherwise than it was given, sure or not, to go on with;
        of no number of the car.
    blind : why nothing finer can be asked, "" where it can.
    without : the same if the velocity sensor is where it should be, where that alone makes gross
        findings of it: to be asked where no size tells that it is elsewhere; None else.
    """

    findings: tuple[Finding, ...]
    repair: Repair
    blind: str = ""
    unobservable: tuple[str, ...] = ()
    without: "Screened | None" = None


def screen(recording: Recording, vehicle: Vehicle) -> Screened:
    """Return what is grossly wrong with a log or with the declaration of its car."""
    clock = clock_findings(recording)
    if clock:
        return Screened(findings=clock, repair=Repair(), blind="the clock is not in s")
    samples, given = sample_findings(recording), _unlike(vehicle)
    driven = sum(one.duration for one in driven_pieces(recording))
    lasts = {"frozen": _PERFECT * driven, "zero": _OFTEN * driven}
    missing = [
        one.channel
        for one in samples
        if one.code in NOT_MEASURED or one.size >= lasts.get(one.code, math.inf)
    ]
    blind = f"{' and '.join(missing)} was not measured" if missing else ""
    quiet = None if missing else _quiet_finding(recording)
    if quiet is not None:
        samples, blind = [quiet, *samples], "the car hardly corners"
    mended, motion = recording, None
    if not blind:
        mended, _ = before_sizes(samples).apply(recording, vehicle)
        motion = Motion.of(mended)
    if motion is None:
        blind = blind or "too little is driven"
        return Screened(findings=(*samples, *given), repair=Repair(), blind=blind)
    some, hidden = looked_at(mended)[0], sorted(motion.hidden)

    def admissible(changes: tuple[Change, ...]) -> bool:
        try:
            read_so, _ = _repair_of(changes).apply(some, vehicle)
        except RecordingError:  # beyond what a car does
            return False
        return physics_contradiction(read_so) is None

    def screened(found: Read) -> Screened:
        gross = _gross_findings(found, vehicle)
        other = any(change.code == "other_car" for change in found.best.changes)
        return Screened(
            findings=(*gross, *samples, *given),
            repair=before_sizes((*samples, *gross)),
            blind="the car is another one" if other else "",
            unobservable=tuple(
                f"unit of {name}: its signal hardly exceeds its noise on this drive"
                for name in hidden
            ),
            without=None if found.without is None else screened(found.without),
        )

    return screened(read(motion, vehicle, admissible))


def _gross_findings(found: Read, vehicle: Vehicle) -> list[Finding]:
    """Return what the best reading says is grossly wrong; a reading is judged as a whole."""
    parts: list[Change] = []
    for change in found.best.gross:
        pairs = zip(change.channels, change.factors, strict=True) if change.code == "unit" else ()
        each = [replace(change, channels=(name,), factors=(factor,)) for name, factor in pairs]
        parts += each or [change]
    gross = [_reading_finding(part, found, vehicle) for part in parts]
    of_steering = [one for one in gross if one.channel == "delta_f" and one.repair is not None]
    if len(of_steering) > 1:  # one angle: factors multiply
        factor = math.prod(one.repair.factor["delta_f"] for one in of_steering if one.repair)
        others = [one for one in gross if one not in of_steering]
        gross = [steering_finding(factor, of_steering[0].confidence), *others]
    return doubted(gross, gross)


def _repair_of(changes: tuple[Change, ...]) -> Repair:
    """Return the repair of a log. The car is unchanged."""
    repair = Repair()
    for change in changes:
        if change.code == ARM:
            repair = repair.merged(Repair(velocity_sensor_x=change.arm))
        elif change.channels:
            repair = repair.merged(Repair(factor=change.by_channel, sideslip=change.sideslip))
    return repair


def combined(findings: Iterable[Finding]) -> Repair:
    """Return the repair of several findings, gross ones before those that were asked after them."""
    repair = Repair()
    for one in findings:
        repair = repair if one.repair is None else repair.merged(one.repair)
    return repair


def before_sizes(findings: Iterable[Finding]) -> Repair:
    """Return what is taken out of a log before sizes are asked, sure or not.

    That is what is found of its samples and how it is read. Numbers of the car stay as declared.
    """
    return replace(combined(findings), vehicle={})


def doubted(later: Iterable[Finding], earlier: Iterable[Finding]) -> list[Finding]:
    """Return findings, none of them sure where one that they stand on is not.
    earlier : all of them; those without a repair say nothing that is taken out.
    """
    firm = all(one.sure for one in earlier if one.repair is not None)
    return [replace(one, sure=one.sure and firm) for one in later]


def _quiet_finding(recording: Recording) -> Finding | None:
    """Return that a drive has no corners, None where it has."""
    pieces = looked_at(recording)
    fast, turns = max(usual_speed(pieces), 1e-9), []
    for piece in pieces:
        windows = driven_windows(piece, SLOWEST * fast)
        if len(windows):
            turns.append(np.abs(windows.mean(piece.v_x * piece.r)))
    peak = float(np.percentile(np.concatenate(turns), 100.0 * (1.0 - _LIVELY))) if turns else 0.0
    if peak >= _QUIET:
        return None
    return Finding(
        code="straight",
        size=peak,
        unit="m/s²",
        confidence=0.99,
        text=f"the car hardly corners: v_x r reaches {peak:.2g} m/s² of the "
        f"{_QUIET:g} that are needed; drive a lane change or a slalom",
    )


def clock_findings(recording: Recording) -> tuple[Finding, ...]:
    """Return a sampling interval that is that of a clock in ms; nothing else can be asked then."""
    if recording.dt < _SLOW:
        return ()
    return (
        Finding(
            code="clock_unit",
            size=1e3,
            confidence=0.95,
            text=f"samples are {recording.dt:g} s apart: a clock in ms? divide t by 1000",
        ),
    )


def _unlike(vehicle: Vehicle) -> list[Finding]:
    """Return a yaw inertia that no car of that mass and those lengths has."""
    similar, (least, most) = similar_inertia(vehicle), usual_inertia(vehicle)
    ratio, origin = vehicle.yaw_inertia / similar, vehicle.origin("yaw_inertia")
    if least <= ratio <= most:
        return []
    return [
        Finding(
            code="yaw_inertia",
            size=ratio,
            confidence=0.8,
            text=f"the {origin} yaw inertia is {ratio:.2g} times m l_f l_r, of cars {least:g} to "
            f"{most:g}: {similar:.4g} kg m² would be usual",
            repair=Repair(vehicle={"yaw_inertia": similar}),
        )
    ]


def _reading_finding(change: Change, found: Read, vehicle: Vehicle) -> Finding:
    confidence = found.confidence
    if len(found.best.gross) > _SEVERAL:
        confidence = min(confidence, _SURE)  # so much that is wrong may be wrong otherwise
    factors = dict(change.factors)
    names = " and ".join(change.channels)
    doubt = "" if confidence > _SURE else f"; or {_words(found.other.changes)}"
    if change.code == "other_car":
        size = factors["size"]
        return Finding(
            code="other_car",
            size=1.0 / size,
            confidence=confidence,
            text=f"this is the motion of a car with about {size * vehicle.wheelbase:.2g} m "
            f"between the axles, the declared one has {vehicle.wheelbase:.3g} m: name the right "
            f"vehicle file{doubt}",
        )
    if change.code == "yaw_inertia":
        factor = factors["inertia"]
        return Finding(
            code="yaw_inertia",
            size=1.0 / factor,
            confidence=confidence,
            text=f"the {vehicle.origin(change.code)} yaw inertia is about {1.0 / factor:.2g} times "
            f"the right one{doubt}",
            repair=Repair(vehicle={"yaw_inertia": factor * vehicle.yaw_inertia}),
        )
    if change.code == "steering":
        return steering_finding(factors["delta"], confidence, doubt)
    factor = next(iter(factors.values()))
    if change.channels == ("delta_f",):
        return steering_finding(factor, confidence, doubt)
    if change.code == "sideslip":
        text = f"v_y is the sideslip angle in {change.unit}: take v_x tan of it{doubt}"
    elif change.code == "sign":
        verb = "has" if len(change.channels) == 1 else "have"
        text = f"{names} {verb} the wrong sign against the other channels: turn it{doubt}"
    else:
        unit = "deg/s" if change.unit == "deg" and change.channels == ("r",) else change.unit
        text = f"{names} is in {unit}{doubt}"
    return Finding(
        code=change.code,
        channel=change.channels[0],
        size=1.0 / factor,
        confidence=confidence,
        text=text,
        repair=_repair_of((change,)),
        sure=confidence > _SURE,
    )


def steering_finding(
    factor: float, confidence: float, doubt: str = "", deviation: float = math.nan
) -> Finding:
    """Return what a steering angle is that must be multiplied by a factor.
    doubt : what else it may be, in words.
    deviation : of the factor over the factor, NaN where nobody knows it.
    """
    size, turned = 1.0 / abs(factor), ", positive to the right" if factor < 0.0 else ""
    said = with_doubt(size, size * deviation)
    if abs(math.log(size)) < NEAR:
        code, text, size = "sign", f"delta_f has the wrong sign{doubt}", -1.0
        factor = -1.0
    elif abs(math.log(size * DEGREE)) < NEAR:
        code, text = "unit", f"delta_f is in degrees{turned}{doubt}"
        factor = math.copysign(DEGREE, factor)
        size = 1.0 / factor
    elif _WHEEL[0] < size < _WHEEL[1]:
        code = "steering_ratio"
        text = (
            f"delta_f is the angle of the steering wheel in rad, {said} times that of the "
            f"road wheels{turned}{doubt}"
        )
    elif _WHEEL[0] < size * DEGREE < _WHEEL[1]:
        code, size = "steering_ratio", size * DEGREE
        text = (
            "delta_f is the angle of the steering wheel in degrees, "
            f"{with_doubt(size, size * deviation)} times that of the road wheels{turned}{doubt}"
        )
    else:
        code = "factor"
        text = f"delta_f reads {said} times the right value{turned}{doubt}"
    return Finding(
        code=code,
        channel="delta_f",
        size=size,
        deviation=size * deviation,
        confidence=confidence,
        text=text,
        repair=Repair(factor={"delta_f": factor}),
        sure=confidence > _SURE and code != "factor",
    )


def _words(changes: tuple[Change, ...]) -> str:
    """Return changes in words.   changes : of a reading; none is a log that is right."""
    said = []
    for change in changes:
        names = " and ".join(change.channels)
        known = {
            "sign": f"{names} turned",
            ARM: f"a velocity sensor {change.arm:.2g} m ahead",
            "sideslip": f"the sideslip angle in {change.unit} as v_y",
            "steering": "another steering angle",
            "other_car": "another car",
            "yaw_inertia": "another yaw inertia",
        }
        said.append(known.get(change.code, f"{names} in {change.unit}"))
    return " with ".join(said) or "nothing of the kind"
