"""The rules: what is found against a tire model, each with what it means and its likely cause."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from codegen.arrays import Array
from identifier.measured import printed_unit, printed_value
from identifier.tire_model import AXLES, RELAXATION, TireModel
from identifier.verdict.causes import TELLING, Suspect
from identifier.verdict.motion import Evidence, lateral_noise
from identifier.verdict.verdict import MOST_MISSED, PERCENT, Objection
from models.recordings import Recording
from models.vehicle import GRAVITY, Vehicle

MOST_MISSED_ELSEWHERE = 0.6  # and one that a part of the drive did not teach, of that part
MOST_APART = 0.25  # online from frozen, over the later half of the drive
LEAST_FORCE = 0.1  # static axle loads: less is no force to learn from
MOST_DOUBT = 0.5  # standard deviation of the curve over the prior's, where the force is
LEAST_SLIP = 1e-4  # rad: every curve is known at zero
STIFFNESS = (2.0, 100.0)  # 1/rad, over static load: scale cars have 4, race cars 50
REAR_OVER_FRONT = (0.4, 3.0)  # of these
MOST_RELAXATION = 1.0  # wheelbases; right answers on random cars, late sensors included, had 0.92
FAR_FROM_TOLD = 3.0  # ratio of learnt to told stiffness, or told to learnt
STIFFENS = 1.6  # secant at the known slip over slope at zero: no tire stiffens with slip
INERTIA = (0.3, 2.0)  # I_z/(m l_f l_r): two points on the axles have 1
MOST_A_Y = 0.25  # share of the recorded a_y that v_y, r and v_x do not give
A_Y_SLOPE = (0.87, 1.25)  # of the recorded a_y on theirs: a body that rolls reads up to 1.2
ROLLING = (0.85, 1.25)  # the same of an estimated v_y, which the roll distorts as well
CENTER = (-0.065, 0.12)  # of the wheelbase: where right cars seem to have their center of gravity,
# forward and back of the told one; the body rolls, which looks like a center farther back
CERTAIN = 0.3  # share of what is missed (squared) that another center of gravity must explain,
NOTICED = 0.011  # and the share of the force (rms) that this must be


class Drive(NamedTuple):
    """What the rules look at.

    model, recording : what was learnt, or asked, and the drive.   found : what the model explains.
    suspects : causes of what is missed, the likeliest first.   notes : what is said beside.
    center : the center of gravity that explains most, None where it was not asked.   pressed : the
    downforce that explains most, where another center of gravity would explain much.   elsewhere :
    force missed by models taught without a part of the drive in that part, over the force (2,),
    None unknown.   apart : online from frozen (2,), None unknown.   learns : whether the model was
    learnt on this drive.
    """

    model: TireModel
    recording: Recording
    found: Evidence
    suspects: tuple[Suspect, ...] = ()
    notes: tuple[Objection, ...] = ()
    center: Suspect | None = None
    pressed: Suspect | None = None
    elsewhere: Array | None = None
    apart: Array | None = None
    learns: bool = False


def findings(drive: Drive) -> list[Objection]:
    """Return all that is found.

    Parameters
    ----------
    drive : what the rules look at.
    """
    of_tires = (_stiffness, _relaxation, _shape)
    rules = (_v_y_stuck, _no_force, _missed, _elsewhere, _unknown, *of_tires, _apart, _car)
    return [*(finding for rule in rules for finding in rule(drive)), *drive.notes]


def _forceless(drive: Drive) -> list[bool]:
    return [bool(peak < LEAST_FORCE) for peak in drive.found.peak]


def _no_force(drive: Drive) -> Iterator[Objection]:
    forceless = _forceless(drive)
    noise = np.sqrt(drive.found.noise)
    for axle, peak, none, hidden in zip(
        AXLES, drive.found.peak, forceless, noise > LEAST_FORCE, strict=True
    ):
        if none:
            said = (
                "what is printed is not identifiable from this drive; drive a slalom"
                if drive.learns
                else "whether the model is right cannot be seen here"
            )
            if hidden:
                said = "noise of v_y and yaw rate hides it: mend the sensors"
            yield Objection(
                "no_force",
                axle,
                f"the drive shows no force to learn from or to judge by (at most {peak:.2g} of "
                f"the static load, {LEAST_FORCE:g} are needed): {said}",
                drive.learns or all(forceless),
            )


def _cause(drive: Drive) -> str:
    """Return the likely cause of what is missed, in words."""
    for suspect in drive.suspects[:1]:
        if suspect.share >= TELLING:
            share = PERCENT * min(suspect.share, 1.0)
            return f"likely cause: {suspect.text} (that would explain {share:.0f} % of it)"
    if drive.recording.logged_v_y is None:
        return "without a measured v_y nobody can tell which fault or road does it"
    return (
        "no single fault of a sensor or of the vehicle file explains it: a road that changes, "
        "tires that change, or several faults"
    )


def _missed(drive: Drive) -> Iterator[Objection]:
    for axle, missed, none in zip(AXLES, drive.found.missed, _forceless(drive), strict=True):
        if not (missed <= MOST_MISSED or none):
            yield Objection(
                "force_missed",
                axle,
                f"the frozen model misses {PERCENT * missed:.0f} % of the force that the motion "
                f"shows ({PERCENT * MOST_MISSED:.0f} % are allowed); {_cause(drive)}",
                True,
            )


def _elsewhere(drive: Drive) -> Iterator[Objection]:
    if drive.elsewhere is None:
        return
    found = zip(AXLES, drive.elsewhere, drive.found.missed, _forceless(drive), strict=True)
    for axle, missed, here, none in found:
        if not (missed <= MOST_MISSED_ELSEWHERE or here > MOST_MISSED or none):
            yield Objection(
                "not_repeated",
                axle,
                f"what most of the drive teaches misses {PERCENT * missed:.0f} % of the force in "
                f"the part left out ({PERCENT * MOST_MISSED_ELSEWHERE:.0f} % are allowed): the "
                "drive is too short or too gentle, or the tires changed",
                True,
            )


def _unknown(drive: Drive) -> Iterator[Objection]:
    car, windows = drive.model.vehicle, drive.found.windows
    slip = np.abs(windows.mean(np.asarray(drive.recording.alpha(car.l_f, car.l_r))))
    for i, axle in enumerate(AXLES):
        doubt = drive.model.relative_sd(np.maximum(slip[:, i], LEAST_SLIP))
        if doubt is None:
            return
        power = drive.found.measured[:, i] ** 2
        mean = float(np.sqrt(np.sum(power * doubt[:, i] ** 2) / max(float(power.sum()), 1e-12)))
        if not (mean <= MOST_DOUBT or _forceless(drive)[i]):
            yield Objection(
                "prior",
                axle,
                f"where the drive's force is, the curve is still {PERCENT * mean:.0f} % as unsure "
                f"as before the first sample ({PERCENT * MOST_DOUBT:.0f} % are allowed): what "
                "stands there was believed, not learnt; drive longer, or as hard as this",
                True,
            )


def _stiff(C: float) -> str:
    return f"{printed_value(C, None, 'N/rad')} {printed_unit('N/rad')}"


def _stiffness(drive: Drive) -> Iterator[Objection]:
    vehicle = drive.model.vehicle
    loads = np.array(vehicle.axle_loads)
    stiffness = drive.model.stiffness
    told = np.array(vehicle.bicycle)[4:]
    relative = stiffness / loads
    usual = True
    for axle, each, C, before in zip(AXLES, relative, stiffness, told, strict=True):
        if not STIFFNESS[0] <= each <= STIFFNESS[1]:
            usual = False
            yield Objection(
                "no_tire",
                axle,
                f"a cornering stiffness of {_stiff(C)} is {each:.2g} static loads per rad, "
                f"tires have {STIFFNESS[0]:g} to {STIFFNESS[1]:g}: the axle was not learnt, or "
                "signs, units or the vehicle file are wrong",
                True,
            )
        elif not 1.0 / FAR_FROM_TOLD <= C / before <= FAR_FROM_TOLD:
            origin = vehicle.origin(f"cornering_stiffness_{axle}")
            swapped = "l_f and l_r swapped, or the vehicle file of another car"
            yield Objection(
                "far_from_told",
                axle,
                f"a cornering stiffness of {_stiff(C)} against {_stiff(before)} {origin}: "
                + (swapped if origin == "told" else f"an estimate that was far off, {swapped}"),
                False,
            )
    ratio = float(relative[1] / relative[0]) if relative[0] > 0.0 else np.inf
    if usual and not REAR_OVER_FRONT[0] <= ratio <= REAR_OVER_FRONT[1]:
        yield Objection(
            "front_against_rear",
            None,
            f"the rear tires are {ratio:.2g} times as stiff over their load as the front ones, "
            f"cars have {REAR_OVER_FRONT[0]:g} to {REAR_OVER_FRONT[1]:g}: l_f and l_r swapped, "
            "v_y measured far from the center of gravity, or steering scaled",
            True,
        )


def _relaxation(drive: Drive) -> Iterator[Objection]:
    wheelbase, late = drive.model.vehicle.wheelbase, "r or a_y is late or low-passed"
    if drive.recording.logged_v_y is not None:
        late = "v_y is measured high above the road, on a roof that rolls, or low-passed or late"
    for one in drive.model.estimates():
        if one.title == RELAXATION and one.value > MOST_RELAXATION * wheelbase:
            yield Objection(
                "lags_too_far",
                one.axle,
                f"a relaxation length of {one.value:.3g} m is more than the car is long between "
                f"its axles: no tire's. {late}; or the yaw inertia is far off",
                True,
            )


def _shape(drive: Drive) -> Iterator[Objection]:
    known = drive.model.known_slip
    if known is None or not drive.learns:
        return
    for axle, largest, slope in zip(AXLES, known, drive.model.stiffness, strict=True):
        if not largest > 0.0:
            continue
        grid = largest * np.linspace(0.1, 1.0, 19)
        secant = np.asarray(drive.model.force(grid, axle)) / grid
        steepest = float(secant.max()) / max(float(slope), 1e-12)
        if steepest > STIFFENS:
            yield Objection(
                "curve_stiffens",
                axle,
                f"the curve is {steepest:.2g} times as steep at "
                f"{np.degrees(grid[int(np.argmax(secant))]):.1f} degrees of slip as at zero, as no "
                "tire is: an offset that was not found, play in the steering, or a delay",
                True,
            )


def _apart(drive: Drive) -> Iterator[Objection]:
    if drive.apart is None:
        return
    for axle, apart, none in zip(AXLES, drive.apart, _forceless(drive), strict=True):
        if not (apart <= MOST_APART or none):
            yield Objection(
                "online_apart",
                axle,
                f"what was found online lies {PERCENT * apart:.0f} % from the frozen model over "
                "the second half of the drive: it was still changing when it was frozen",
                True,
            )


def _v_y_stuck(drive: Drive) -> Iterator[Objection]:
    recording, windows = drive.recording, drive.found.windows
    v_y, brisk = recording.logged_v_y, windows.starts
    if v_y is None:
        return
    moves = float(np.std(recording.r[brisk] * recording.v_x[brisk])) > LEAST_FORCE * GRAVITY
    if moves and not float(np.ptp(v_y[brisk])) > 0.0:
        yield Objection(
            "v_y_stuck",
            None,
            "v_y never changes while the car turns: it was not measured, and slip angles without "
            "it are not slip angles",
            True,
        )


def _car(drive: Drive) -> Iterator[Objection]:
    vehicle, found = drive.model.vehicle, drive.found
    ratio = vehicle.yaw_inertia / (vehicle.mass * vehicle.l_f * vehicle.l_r)
    if not INERTIA[0] <= ratio <= INERTIA[1]:
        yield Objection(
            "yaw_inertia",
            None,
            f"the {vehicle.origin('yaw_inertia')} yaw inertia is {ratio:.2g} m l_f l_r, cars have "
            f"{INERTIA[0]:g} to {INERTIA[1]:g}: check it, transients are read with it",
            False,
        )
    yield from _center(drive)
    if drive.recording.logged_v_y is None:
        yield from _turning(drive.recording, found)
    elif drive.recording.a_y is not None:
        yield from _a_y(drive, vehicle, found)


def is_off_center(drive: Drive) -> bool:
    """Return whether another center of gravity explains much, and lies where that of no car does.

    Parameters
    ----------
    drive : whose `center` was asked.
    """
    if drive.center is None or any(_forceless(drive)):
        return False
    off = drive.center.size / drive.model.vehicle.wheelbase
    gained = float(np.sqrt(np.mean(drive.found.missed**2) * max(drive.center.share, 0.0)))
    moved = not CENTER[0] <= off <= CENTER[1]
    return moved and drive.center.share > CERTAIN and gained > NOTICED


def _center(drive: Drive) -> Iterator[Objection]:
    """The split of the force between the axles follows the center of gravity, and downforce."""
    center, pressed = drive.center, drive.pressed
    if center is None or not is_off_center(drive):
        return
    share = PERCENT * min(center.share, 1.0)
    if pressed is not None and pressed.share > center.share:
        more = PERCENT * min(pressed.share, 1.0)
        yield Objection(
            "downforce",
            None,
            f"{pressed.text}: that would explain {more:.0f} % of what is missed; or "
            f"{center.text}: {share:.0f} %",
            True,
        )
        return
    yield Objection(
        "center_of_gravity",
        None,
        f"{center.text}: that would explain {share:.0f} % of what is missed; are l_f and l_r "
        "swapped? A v_y that is late or measured elsewhere looks alike",
        True,
    )


def _turning(recording: Recording, found: Evidence) -> Iterator[Objection]:
    """Without a v_y: a_y is v̇_y + v_x r, of the v_y that was estimated, but for bank and roll.

    The means tell of bank and of an offset that was found: they are left out.
    """
    windows, v_y = found.windows, recording.needed("v_y")
    felt = windows.mean(recording.needed("a_y"))
    motion = windows.rate(v_y) + windows.mean(recording.v_x * recording.r)
    felt, motion = felt - felt.mean(), motion - motion.mean()
    power = float(np.mean(motion**2))
    if not power > (LEAST_FORCE * GRAVITY) ** 2:
        return
    slope = float(np.mean(felt * motion)) / power
    if not ROLLING[0] <= slope <= ROLLING[1]:
        yield Objection(
            "a_y_disagrees",
            None,
            f"the recorded a_y is {slope:.2g} times what v_x, r and the estimated v_y give "
            f"({ROLLING[0]:g} to {ROLLING[1]:g} of right ones): a scale of v_x, r or a_y, or "
            "a delay",
            True,
        )


def _a_y(drive: Drive, vehicle: Vehicle, found: Evidence) -> Iterator[Objection]:
    assert drive.recording.a_y is not None
    recorded = found.windows.mean(drive.recording.a_y)
    motion = found.measured @ np.array(vehicle.axle_loads) / vehicle.mass
    of_motion, of_a_y = lateral_noise(drive.recording, found.windows)
    power = float(np.mean(motion**2)) - of_motion
    if not power > (LEAST_FORCE * GRAVITY) ** 2:
        return
    offset = float(np.mean(recorded - motion))
    slope = float(np.mean(recorded * motion)) / power
    apart = float(np.mean((recorded - motion) ** 2)) - of_motion - of_a_y
    missed = float(np.sqrt(max(apart, 0.0) / power))
    if missed > MOST_A_Y or not A_Y_SLOPE[0] <= slope <= A_Y_SLOPE[1]:
        yield Objection(
            "a_y_disagrees",
            None,
            f"the recorded a_y lies {PERCENT * missed:.0f} % from what v_y, r and v_x give, "
            f"{slope:.2g} times as large and {offset:+.2g} m/s² in the mean: a scale of r or v_x, "
            "a banked road, a tilted or late sensor, or v_y of another point than the c.g.",
            True,
        )
