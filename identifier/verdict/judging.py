"""Judging a model by the motion: the share of the axle forces that it misses of a drive.

A drive that did not teach the model is the judge proper. Of its own drive the share says less, so
that it counts there together with what the drive left undecided.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from codegen.arrays import Array
from identifier.evidence import (
    FEWEST,
    WINDOW,
    Evidence,
    evidence,
    lateral_noise,
    motion_error,
    road_push,
)
from identifier.reproducibility import beyond_known
from identifier.run import History, state_index
from identifier.tire_model import AXLES, Reached, TireModel
from identifier.verdict.friction import RoadFriction, road_friction
from identifier.verdict.verdict import (
    BEYOND_KNOWN,
    LARGEST_MODEL_ERROR,
    PERCENT,
    WITHOUT_V_Y,
    Number,
    Objection,
    Verdict,
    WindowForces,
    drive_judges,
)
from models.recordings import Recording
from models.recordings.portion import Portion, portion
from models.vehicle import GRAVITY

_SECANT = 0.01  # rad, to which the slope of a curve is taken: play makes none at zero
# model error over `_PART` windows (3 s), of the rms force of the drive, from which another friction
# is looked for: of 24 random cars (seeds 200 to 205) it was 0.2 and more where one was found, 0.12
# and less on the road that taught
_PART, _MISSED = 20, 0.15
# of the largest force, least one of a drive that decides a point of the curve: 0.68 and more where
# 48 random cars hold a fifth of their steering, 0.07 and less in steps, ramps and slaloms
_STEADY = 0.5
_ROADS = 3  # segments of another friction that are listed one by one
# windows of an identification drive, 3.8 s: of 14 snippets of 2 s of random drives 4 had bands
# that held 41 to 64 % of the true forces, of snippets of 5 s none below 80 %
_FEWEST_TAUGHT = 24


@dataclass(frozen=True, slots=True, kw_only=True)
class _Rules:
    """Limits of a verdict; set on random cars of four classes, confirmed on recordings.
    model_error : share of the force, rms, that a model may miss at an axle [-].
    force : below which there is no force to judge by [static axle loads].
    doubt : standard deviation of the curve over the prior's, where the force is [-].
    stiffness : that tires have, over the static load [1/rad].
    beyond : share of the samples beyond the known slip, from which it is noted [-].
    side_slip : standard deviation of an estimated one, median [rad].
    rolling : slope of a recorded a_y on the motion with an estimated v_y, which roll distorts [-].
    v_y : standard deviation of one whose delay was removed, over what the rear axle slips, from
        which it is noted and from which refused [-].
    """

    model_error: float = LARGEST_MODEL_ERROR
    force: float = 0.1
    doubt: float = 0.5
    stiffness: tuple[float, float] = (2.0, 100.0)
    beyond: float = 0.01
    side_slip: float = 0.01
    rolling: tuple[float, float] = (0.85, 1.25)
    v_y: tuple[float, float] = (0.06, 0.15)


RULES = _Rules()


class _Evaluated(NamedTuple):
    """A model and a drive.

    portion : what of the drive is evaluated.   t : its times, in the drive's clock (k,) [s].
    found : what the model explains of it.
    taught : whether the drive taught the model.   left_out : a segment that is not judged, from
    and to [s].
    """

    model: TireModel
    portion: Portion
    t: Array
    found: Evidence
    taught: bool
    left_out: tuple[float, float] | None

    @property
    def recording(self) -> Recording:
        return self.portion.recording

    @property
    def middle(self) -> Array:
        """Middle of each window, in the clock of the drive (m,) [s]."""
        starts = self.found.windows.starts
        return 0.5 * (self.t[starts] + self.t[starts + self.found.windows.n])

    @property
    def forceless(self) -> list[bool]:
        return [bool(peak < RULES.force) for peak in self.found.peak]


def judge(history: History, t: float | None = None) -> Verdict:
    """Return the verdict on a run: on the model that was frozen, over all of its recording.
    t : time of the freeze in the recording's own clock [s]; None is the end.
    """
    model, whole = history.freeze(t), history.recording
    end = float(whole.t[-1]) if t is None else t
    limits = history.method.limits
    reached = model.drives.at_bounds if limits is None else limits.active(history.state_at(end))
    return judge_identification(model, whole, state_index(whole, end), reached)


def judge_identification(
    model: TireModel,
    recording: Recording,
    frozen: int | None = None,
    reached: Sequence[Reached] | None = None,
) -> Verdict:
    """Return the verdict on a model over the drive that taught it.
    frozen : samples that taught; None is all of them.
    reached : numbers that rest at their bounds; None asks the model.
    """
    evaluated = _evaluated(model, recording, taught=True, frozen=frozen)
    if evaluated is None:
        return _too_short(model, _FEWEST_TAUGHT, taught=True)
    bounds = model.drives.at_bounds if reached is None else reached
    notes = [Objection(code, None, text, False) for code, text in model.drives.notes]
    at_bound = [
        Objection(
            "at_bound",
            one.axle,
            f"{one.title} is at its bound, {one.value:.3g} {one.unit}: {one.meaning}",
            one.refuses,
        )
        for one in bounds
    ]
    return _verdict(evaluated, [*_findings(evaluated), *at_bound, *notes], recording)


def judge_prediction(model: TireModel, recording: Recording) -> Verdict:
    """Return the verdict on a stored model over a drive: does it give back the drive's motion?"""
    evaluated = _evaluated(model, recording, taught=False)
    if evaluated is None:
        return _too_short(model, FEWEST, taught=False)
    worst = evaluated.found.worst(_PART)[~np.array(evaluated.forceless)].max(initial=0.0)
    missed = evaluated.left_out is not None or worst > _MISSED  # as on another road
    friction = friction_of(model, recording) if missed else None
    verdict = _verdict(evaluated, [*_findings(evaluated), *_roads(friction)], recording)
    return replace(verdict, friction=friction)


def friction_of(model: TireModel, recording: Recording) -> RoadFriction | None:
    """Return the friction of a drive's road, a banked road taken off; None where unobservable."""
    return road_friction(model, recording, road_push(portion(recording).recording, model))


def _evaluated(
    model: TireModel, recording: Recording, *, taught: bool, frozen: int | None = None
) -> _Evaluated | None:
    """Return what is judged; None where too little is driven."""
    part = portion(recording, frozen)
    t = recording.t[part.samples]
    model = model.held_on(recording, part)
    found = evidence(model, part.recording, road_push(part.recording, model))
    if taught and found is not None:
        other = model.drives.road_differs(t)
        found = found.where(~other[found.windows.starts])
    fewest = _FEWEST_TAUGHT if taught else FEWEST
    if found is None or len(found.windows) < fewest:
        return None
    judged, some = found.but_a_segment()
    left_out = None
    if some is not None:
        starts = found.windows.starts
        left_out = float(t[starts[some[0]]]), float(t[starts[some[1] - 1] + found.windows.n])
    return _Evaluated(model, part, t, judged, taught, left_out)


def _findings(evaluated: _Evaluated) -> list[Objection]:
    rules = (
        _v_y_stuck, _v_y_unsure, _no_force, _model_error, _left_out, _unsure, _no_tire, _beyond,
        _turning, _unobserved, _sensors,
    )  # fmt: skip
    return [finding for rule in rules for finding in rule(evaluated)]


def _v_y_stuck(evaluated: _Evaluated) -> Iterator[Objection]:
    recording, brisk = evaluated.recording, evaluated.found.windows.starts
    v_y = recording.logged_v_y
    if v_y is None:
        return
    turns = float(np.std(recording.r[brisk] * recording.v_x[brisk])) > RULES.force * GRAVITY
    if turns and not float(np.ptp(v_y[brisk])) > 0.0:
        text = "v_y never changes while the car turns: it was not measured"
        yield Objection("v_y_stuck", None, text, True)


def _v_y_unsure(evaluated: _Evaluated) -> Iterator[Objection]:
    """Refuse a v_y of which too little is left after its delay was removed."""
    recording, starts = evaluated.recording, evaluated.found.windows.starts
    if not recording.v_y_sd > 0.0:
        return
    sideways = recording.needed("v_y") - evaluated.model.vehicle.l_r * recording.r
    size = float(np.sqrt(np.mean(sideways[starts] ** 2)))
    noted, refused = (share * size for share in RULES.v_y)
    if recording.v_y_sd > noted:
        text = (
            f"v_y is rare, noisy or late by an unknown time: ± {recording.v_y_sd:.2g} m/s of the "
            f"{size:.2g} m/s by which the rear axle slips (limit {PERCENT * RULES.v_y[1]:.0f} %); "
            "align it, or leave it out: ay is there"
        )
        yield Objection("v_y_unsure", None, text, evaluated.taught and recording.v_y_sd > refused)


def _no_force(evaluated: _Evaluated) -> Iterator[Objection]:
    forceless, noise = evaluated.forceless, np.sqrt(evaluated.found.noise)
    for axle, peak, none, sd in zip(AXLES, evaluated.found.peak, forceless, noise, strict=True):
        if not none:
            continue
        if sd > RULES.force:
            advice = "noise of v_y and yaw rate hides it: repair the sensors"
        elif evaluated.taught:
            advice = "its numbers are default values; drive a slalom"
        else:
            advice = "this drive cannot judge the model"
        need = f"{RULES.force:g} are needed"
        text = f"lateral force reaches {peak:.2g} of the static load, {need}: {advice}"
        yield Objection("no_force", axle, text, evaluated.taught, all(forceless))


def _model_error(evaluated: _Evaluated) -> Iterator[Objection]:
    limit, found = RULES.model_error, evaluated.found
    t = evaluated.middle[np.abs(found.measured - found.modelled).argmax(axis=0)]
    for axle, share, at, none in zip(AXLES, found.model_error, t, evaluated.forceless, strict=True):
        if not (share <= limit or none):
            text = (
                f"model error {PERCENT * share:.1f} % of the force in the motion (limit "
                f"{PERCENT * limit:.0f} %), largest at {at:.4g} s; tireid doctor looks for the "
                "cause"
            )
            yield Objection("force_missed", axle, text, True)


def _left_out(evaluated: _Evaluated) -> Iterator[Objection]:
    if evaluated.left_out is not None:
        begin, end = evaluated.left_out
        text = (
            f"from {begin:.4g} to {end:.4g} s the motion is not explained, elsewhere it is (model "
            f"error {PERCENT * float(evaluated.found.model_error.max()):.0f} % of the force): a "
            "sensor that had not settled, or a banked or slippery segment"
        )
        yield Objection("segment", None, text, False)


def _unsure(evaluated: _Evaluated) -> Iterator[Objection]:
    known = evaluated.model.known_slip
    least, most = np.quantile(np.abs(evaluated.found.measured), (0.02, 0.98), axis=0)
    point = evaluated.taught & (least > _STEADY * most)
    if known is not None:
        point |= ~(known > 0.0)
    for axle, one, forceless in zip(AXLES, point, evaluated.forceless, strict=True):
        if one and not forceless:
            text = "no range of slip is identified, as by one steady corner: drive a slalom"
            yield Objection("prior", axle, text, True)
    if not evaluated.taught or (band := evaluated.model.band) is None:
        return
    car, windows = evaluated.model.vehicle, evaluated.found.windows
    slip = np.abs(windows.mean(np.asarray(evaluated.recording.alpha(car.l_f, car.l_r))))
    for i, axle in enumerate(AXLES):
        doubt = band.relative_sd(np.maximum(slip[:, i], 1e-4))
        power = evaluated.found.measured[:, i] ** 2
        mean = float(np.sqrt(np.sum(power * doubt[:, i] ** 2) / max(float(power.sum()), 1e-12)))
        if not (mean <= RULES.doubt or evaluated.forceless[i] or point[i]):
            text = (
                f"the drive reduced the uncertainty of the curve to {PERCENT * mean:.0f} % of the "
                f"prior's (limit {PERCENT * RULES.doubt:.0f} %): drive longer"
            )
            yield Objection("prior", axle, text, True)


def _no_tire(evaluated: _Evaluated) -> Iterator[Objection]:
    secant = (
        evaluated.model.force(np.array([_SECANT]))[0] / _SECANT / evaluated.model.vehicle.axle_loads
    )
    least, most = RULES.stiffness
    for axle, each in zip(AXLES, secant, strict=True):
        if not least <= each <= most:
            soft = "play of the steering, " if axle == "front" and each < least else ""
            text = (
                f"the force at {np.degrees(_SECANT):.2g} deg of slip is {each:.2g} static loads "
                f"per rad, tires have {least:g} to {most:g}: check {soft}signs, units and the "
                "vehicle file"
            )
            yield Objection("no_tire", axle, text, True)


def _beyond(evaluated: _Evaluated) -> Iterator[Objection]:
    beyond, known = beyond_known(evaluated.model, evaluated.recording), evaluated.model.known_slip
    if beyond is None or known is None or evaluated.taught:
        return
    for axle, share, slip in zip(AXLES, beyond, known, strict=True):
        if share > RULES.beyond:
            text = (
                f"{PERCENT * share:.0f} % of the samples exceed the identified slip range "
                f"({np.degrees(slip):.1f} deg); there the curve is extrapolated"
            )
            yield Objection(BEYOND_KNOWN, axle, text, False)


def _turning(evaluated: _Evaluated) -> Iterator[Objection]:
    """Judge an estimated v_y by the accelerometer; means tell of bank and offset, and are left."""
    recording, windows = evaluated.recording, evaluated.found.windows
    if recording.logged_v_y is not None or recording.v_y is None or recording.a_y is None:
        return
    felt = windows.mean(recording.a_y)
    motion = windows.rate(recording.v_y) + windows.mean(recording.v_x * recording.r)
    felt, motion = felt - felt.mean(), motion - motion.mean()
    power = float(np.mean(motion**2)) - lateral_noise(recording, windows)
    if not power > (RULES.force * GRAVITY) ** 2:
        return
    slope, (least, most) = float(np.mean(felt * motion)) / power, RULES.rolling
    if not least <= slope <= most:
        text = (
            f"the recorded a_y is {slope:.2g} times what v_x, r and the estimated v_y give "
            f"({least:g} to {most:g} are usual): check the scales of v_x, r and a_y, and delays"
        )
        yield Objection("a_y_disagrees", None, text, True)


def _unobserved(evaluated: _Evaluated) -> Iterator[Objection]:
    """Refuse where the side slip that the model is judged at is hardly known."""
    recording = evaluated.recording
    if recording.logged_v_y is not None or recording.a_y is None:
        return
    found = evaluated.model.estimated_v_y(recording.as_logged())
    if found is None:
        return
    at = evaluated.found.windows.starts
    sd = float(np.median(found.sd[at] / recording.v_x[at]))
    if not sd <= RULES.side_slip:
        text = (
            f"side slip is estimated to ± {np.degrees(sd):.2g} deg (limit "
            f"{np.degrees(RULES.side_slip):.2g} deg): measure v_y, or drive a slalom"
        )
        taught = evaluated.taught
        yield Objection("side_slip_unknown", None, text, taught, not taught)


def _sensors(evaluated: _Evaluated) -> Iterator[Objection]:
    days = evaluated.model.days(evaluated.recording)
    for first, day in days:
        begin = f"from {evaluated.recording.t[first]:.4g} s on: " if len(days) > 1 else ""
        for code, text in day.notes:
            yield Objection(code, None, f"{begin}{text}", False)


def _roads(found: RoadFriction | None) -> list[Objection]:
    """Return a note for each of the first segments on another road than that which taught."""
    roads = () if found is None else found.roads
    listed = [Objection("another_road", None, one.text, False) for one in roads[:_ROADS]]
    if len(roads) > _ROADS:
        more = f"and {len(roads) - _ROADS} more segments of another friction"
        listed.append(Objection("another_road", None, more, False))
    return listed


def _verdict(evaluated: _Evaluated, listed: list[Objection], whole: Recording) -> Verdict:
    model, recording, found = evaluated.model, evaluated.recording, evaluated.found
    if len(recording) < len(whole):
        minutes = len(recording) * whole.dt / 60.0, whole.duration / 60.0
        text = "judged by {:.3g} of {:.3g} minutes: those with the hardest cornering of each part"
        listed.append(Objection("portion", None, text.format(*minutes), False))
    listed.sort(key=lambda finding: (not finding.refuses, not finding.silent))
    judged = drive_judges(listed)
    counted = recording.v_x >= model.min_speed
    motion = motion_error(found.predicted, recording, model.vehicle, counted)
    lateral, yaw = (None, None) if motion is None else motion.explained
    measures = {
        "force_missed": tuple(map(float, found.model_error)),
        "rms_force_static_loads": tuple(map(float, found.force)),
        "peak_force_static_loads": tuple(map(float, found.peak)),
        "explained_lateral": lateral,
        "explained_yaw": yaw,
    }
    refused = {one.axle for one in listed if one.refuses}
    errors = dict(zip(AXLES, found.model_error, strict=True))
    numbers = tuple(
        Number(
            *(one.with_model_error(float(errors[one.axle])) if judged else one),
            valid=judged and one.identified and not refused & {None, one.axle},
            judged=judged,
        )
        for one in model.estimates()
    )
    loads = np.array(model.vehicle.axle_loads)
    forces = WindowForces(
        t=evaluated.middle,
        measured=loads * found.measured,
        modelled=loads * found.modelled,
        slip=found.windows.mean(model.lagged_slip(recording)),
    )
    return Verdict(
        findings=tuple(listed),
        numbers=numbers,
        measures=measures,
        reach=_reach(model, recording),
        blind=WITHOUT_V_Y if recording.logged_v_y is None else (),
        forces=forces,
    )


def _reach(model: TireModel, recording: Recording) -> str:
    """Return in which range of speed and slip a model is known, in words; empty: unknown."""
    speeds, known = model.drives.speeds, model.known_slip
    if known is None:
        return ""
    if speeds is None:
        driven = recording.v_x[recording.v_x >= model.min_speed]
        speeds = np.quantile(driven, [0.005, 0.995]) if driven.size else np.zeros(2)
    front, rear = np.degrees(known)
    slip = f"slip up to {front:.1f} / {rear:.1f} deg (front / rear)"
    return f"{speeds[0]:.3g} to {speeds[1]:.3g} m/s, {slip}"


def _too_short(model: TireModel, fewest: int, *, taught: bool) -> Verdict:
    few = f"fewer than {fewest} windows of {WINDOW:g} s are driven briskly"
    text = f"{few}: there is nothing to judge by"
    finding = Objection("too_short", None, text, taught, not taught)
    numbers = tuple(Number(*one, valid=False, judged=taught) for one in model.estimates())
    return Verdict(findings=(finding,), numbers=numbers, measures={})
