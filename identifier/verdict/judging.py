"""Judging a run, and a model that is asked about a drive."""

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np

from codegen.arrays import Array
from identifier.axle import AxleIdentifier
from identifier.method import Method
from identifier.reproducibility import motion_error
from identifier.run import History, identify
from identifier.tire_model import AXLES, TireModel
from identifier.verdict.causes import CAUSES, OF_ROAD, Ask, Cause, Mended, Suspect, suspects
from identifier.verdict.friction import RoadFriction, road_friction
from identifier.verdict.motion import (
    FEWEST,
    WINDOW,
    Evidence,
    Windows,
    clean_share,
    evidence,
    measured_force,
    modelled_force,
    noise_variance,
)
from identifier.verdict.parts import asked_run, taught_elsewhere, without_v_y
from identifier.verdict.rules import Drive, findings, is_off_center
from identifier.verdict.verdict import (
    MOST_MISSED,
    PERCENT,
    WITHOUT_V_Y,
    Number,
    Objection,
    Verdict,
    WindowForces,
)
from models.recordings import Recording
from models.recordings.portion import Portion, portion
from models.vehicle import Vehicle

ROADS = 3  # stretches of another friction that are told one by one
TINY = 1e-9  # of a force, squared [static axle loads²]
GEOMETRY, PRESS = "center_of_gravity", "downforce"


def judge(history: History, t: float | None = None) -> Verdict:
    """Return the verdict on a run: on the model that was frozen, over all of its recording.

    Parameters
    ----------
    history : the run.
    t : time of the freeze in the recording's own clock [s]; None is the end.

    Raises
    ------
    DivergedError
        Where the law had diverged by then.
    CannotFreezeError
        Where the method estimates a signal, not a model.
    """
    run = asked_run(history, t)
    model, asked, whole, road = run.model, run.portion, history.recording, run.road

    def taught(mended: Mended) -> TireModel:
        return run.taught(mended.recording, mended.vehicle)

    drive = _looked_at(taught, model, asked, whole.t, road)
    if drive is None:
        return _too_short(model)
    drive = drive._replace(
        center=(
            None if drive.notes or without_v_y(asked) else _suspect(GEOMETRY, drive, taught, road)
        ),
        elsewhere=_elsewhere(taught, drive, history.vehicle),
        apart=_apart(history.axle_force[asked.samples], history.vehicle, drive.found),
        learns=True,
    )
    if is_off_center(drive):
        drive = drive._replace(pressed=_suspect(PRESS, drive, taught, road))
    reached = [
        Objection(
            "at_bound",
            one.axle,
            f"the {one.title} rests at its bound, {one.value:.3g} {one.unit}: {one.meaning}",
            one.refuses,
        )
        for one in history.design.reached(history.vehicle, history.state_at(run.end))
    ]
    listed = [*findings(drive), *reached, *_asked_of(asked, whole)]
    return _verdict(drive, listed, whole.t[asked.samples])


def judge_prediction(
    model: TireModel, recording: Recording, *, another_road: bool = True
) -> Verdict:
    """Return the verdict on a stored model over a drive: does it give back the drive's motion?

    Parameters
    ----------
    model : that learns nothing from it.
    recording : the drive.
    another_road : whether the road may be another one than that which taught, and its friction is
        told; of a drive that taught the model it is not.
    """

    def mounted(mended: Mended) -> TireModel:
        tires = model if mended.vehicle == model.vehicle else model.mounted_on(mended.vehicle)
        return tires if mended.friction == 1.0 else tires.at_friction(mended.friction)

    asked = portion(recording)
    road = _road_driven(asked.recording, model.vehicle)
    # Downforce changes the curve that is learnt: of one that is not learnt anew it is friction.
    of_drive = tuple(one for one in CAUSES if one.code != PRESS)
    causes = (*of_drive, OF_ROAD) if another_road else of_drive
    drive = _looked_at(mounted, model, asked, recording.t, road, causes)
    if drive is None:
        return _too_short(model)
    friction = road_friction(model, recording, road) if another_road else None
    listed = [*findings(drive), *_roads(friction), *_asked_of(asked, recording)]
    return replace(_verdict(drive, listed, recording.t[asked.samples]), friction=friction)


def _roads(found: RoadFriction | None) -> list[Objection]:
    """Return a note for each of the first stretches on another road than that which taught."""
    roads = () if found is None else found.roads
    listed = [Objection("another_road", None, one.text, False) for one in roads[:ROADS]]
    if len(roads) > ROADS:
        more = f"and {len(roads) - ROADS} more stretches of another friction"
        listed.append(Objection("another_road", None, more, False))
    return listed


def _asked_of(asked: Portion, whole: Recording) -> list[Objection]:
    """Return a note where only a portion of a drive was asked."""
    if len(asked.recording) == len(whole):
        return []
    minutes = len(asked.recording) * whole.dt / 60.0, whole.duration / 60.0
    return [
        Objection(
            "portion",
            None,
            "judged by {:.3g} of its {:.3g} minutes: of each part of the drive those in which the "
            "car was turned hardest".format(*minutes),
            False,
        )
    ]


def _road_driven(recording: Recording, vehicle: Vehicle) -> Array | None:
    """Return what the default takes a banked road to push, by the accelerometer (n,) [weights]."""
    if recording.a_y is None or recording.logged_v_y is None:
        return None
    design: Method = AxleIdentifier.for_vehicle(vehicle, dt=recording.dt)
    return design.road_push(identify(recording, vehicle, design).state)


Tires = Callable[[Mended], TireModel]  # of a car and a drive that a fault was taken out of


def _looked_at(
    tires: Tires,
    model: TireModel,
    asked: Portion,
    clock: Array,
    road: Array | None,
    causes: Iterable[Cause] = CAUSES,
) -> Drive | None:
    """Return what the rules look at; None where too little is driven.

    A stretch that `Evidence.but_a_stretch` leaves out is noted.
    """
    recording = asked.recording
    whole = evidence(model, recording, road)
    if whole is None:
        return None
    found, left_out = whole.but_a_stretch()
    notes = () if left_out is None else (_stretch(whole, found, clock[asked.samples], *left_out),)
    listed: tuple[Suspect, ...] = ()
    if not ((found.missed <= MOST_MISSED).all() or without_v_y(asked)):
        listed = suspects(_ask(tires, found.windows, road), recording, model.vehicle, causes)
    return Drive(model=model, recording=recording, found=found, suspects=listed, notes=notes)


def _suspect(code: str, drive: Drive, tires: Tires, road: Array | None) -> Suspect:
    """Return a cause of that code with the size that would explain most."""
    ask = _ask(tires, drive.found.windows, road)
    causes = [one for one in CAUSES if one.code == code]
    listed = drive.suspects or suspects(ask, drive.recording, drive.model.vehicle, causes)
    return next(one for one in listed if one.cause.code == code)


def _stretch(found: Evidence, rest: Evidence, t: Array, first: int, last: int) -> Objection:
    starts = found.windows.starts
    begin, end = t[starts[first]], t[starts[last - 1] + found.windows.n]
    return Objection(
        "stretch",
        None,
        f"from {begin:.4g} to {end:.4g} s the motion is not explained, elsewhere all but "
        f"{PERCENT * float(rest.missed.max()):.0f} % of the force is: a sensor that had not "
        "settled, or a banked or slippery stretch",
        False,
    )


def _ask(tires: Tires, windows: Windows, road: Array | None) -> Ask:
    """Return what asks for the share of the force, of both axles, missed of a mended drive."""

    def ask(mended: Mended) -> float:
        recording, model = mended.recording, tires(mended)
        force = measured_force(recording, model.vehicle, windows, road) - mended.road
        away = force - modelled_force(model, recording, windows)
        noise = noise_variance(recording, model.vehicle, windows)
        power = np.mean(force**2, axis=0)
        return float(np.mean((np.mean(away**2, axis=0) - noise) / np.maximum(power, TINY)))

    return ask


def _verdict(drive: Drive, listed: list[Objection], clock: Array) -> Verdict:
    """Return the verdict of what was found; the clock is that of the drive's samples [s]."""
    listed.sort(key=lambda finding: not finding.refuses)
    found, model, recording = drive.found, drive.model, drive.recording
    motion = motion_error(
        model.axle_force(recording), recording, model.vehicle, recording.v_x >= model.min_speed
    )
    lateral, yaw = (None, None) if motion is None else motion.explained
    measures: dict[str, tuple[float, ...] | float | None] = {
        "force_missed": _pair(found.missed),
        "force_missed_elsewhere": _pair(drive.elsewhere),
        "online_from_frozen": _pair(drive.apart),
        "rms_force_static_loads": _pair(found.force),
        "peak_force_static_loads": _pair(found.peak),
        "center_of_gravity_m": None if drive.center is None else drive.center.size,
        "center_of_gravity_explains": None if drive.center is None else drive.center.share,
        "explained_lateral": lateral,
        "explained_yaw": yaw,
    }
    refused = {one.axle for one in listed if one.refuses}
    missed = dict(zip(AXLES, found.missed, strict=True))
    numbers = tuple(
        Number(
            *one.with_missed(float(missed[one.axle])),
            valid=one.learnt and not refused & {None, one.axle},
        )
        for one in model.estimates()
    )
    blind = WITHOUT_V_Y if recording.logged_v_y is None else ()
    starts, n = found.windows.starts, found.windows.n
    middle = 0.5 * (clock[starts] + clock[starts + n])
    return Verdict(
        findings=tuple(listed),
        numbers=numbers,
        measures=measures,
        blind=blind,
        shown=WindowForces(middle, found.measured, found.modelled),
    )


def _pair(values: Array | None) -> tuple[float, ...] | None:
    return None if values is None else tuple(float(value) for value in values)


def _too_short(model: TireModel) -> Verdict:
    finding = Objection(
        "too_short",
        None,
        f"fewer than {FEWEST} windows of {WINDOW:g} s are driven briskly: there is nothing to "
        "judge by",
        True,
    )
    numbers = tuple(Number(*one, valid=False) for one in model.estimates())
    return Verdict(findings=(finding,), numbers=numbers, measures={})


def _apart(force: Array, vehicle: Vehicle, found: Evidence) -> Array:
    """Return how far online lies from frozen over the later half, over the frozen force (2,)."""
    windows = found.windows
    online = windows.mean(force / np.array(vehicle.axle_loads))
    later = np.arange(len(windows)) >= len(windows) // 2
    later &= np.isfinite(online).all(axis=1)  # before a law diverged
    return clean_share((online - found.modelled)[later], found.modelled[later], np.zeros(2))


def _elsewhere(taught: Tires, drive: Drive, car: Vehicle) -> Array | None:
    """Return what models taught without a part of the drive miss of that part, over its force (2,).

    A window counts where such a model knows the slip.
    """
    recording, found = drive.recording, drive.found
    windows = found.windows
    slip = np.abs(windows.mean(np.asarray(recording.alpha(car.l_f, car.l_r))))
    missed, force = np.zeros_like(found.measured), np.zeros_like(found.measured)

    def teach(halting: Recording) -> TireModel:
        return taught(Mended(halting, car))

    parts = 0
    for mine, model in taught_elsewhere(teach, recording, found):
        if model is None:
            return None
        parts += 1
        known = model.known_slip
        counted = mine[:, None] & (slip <= (np.inf if known is None else known))
        away = found.measured - modelled_force(model, recording, windows)
        missed[counted], force[counted] = away[counted], found.measured[counted]
    if parts == 0:
        return None
    seen = np.mean(force != 0.0, axis=0)
    return np.where(seen > 0.0, clean_share(missed, force, found.noise * seen), 0.0)
