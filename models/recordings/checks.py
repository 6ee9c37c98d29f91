"""Physical checks that need no vehicle: signs, axes and units of a recording.

Every rule is a regression over at least 2 s of moving windows and stays silent without enough
excitation, so straight, short, slow and drifting runs pass. The bounds come from physics, not
from any log; a wrong unit changes a number by 57.3 (degrees), 3.6 (km/h), 9.81 (g) or 1000 (kN),
and each bound lies inside that gap. One error nobody can see: a log whose lateral axis points to
the right throughout (SAE, NED) obeys the same laws.
"""

import numpy as np

from codegen.arrays import Array, root_mean_square, thinning
from models.bicycle import measured_slip
from models.logs.log import RecordingError
from models.recordings.evidence import (
    STRIDE,
    WINDOW,
    Fit,
    Means,
    Pair,
    Steering,
    computed_v_y,
    correlation,
    course_rate,
    least_squares,
    pair,
    proportional,
    shortest_wheelbase,
    steering,
    turning,
    windows,
)
from models.recordings.record import Recording, peak
from models.recordings.samples import multiple
from models.vehicle import Vehicle

_LARGEST_STEERING = 1.2  # [rad], 69 degrees: beyond every road wheel and scale car (about 50)
_LARGEST_SPEED = 110.0  # [m/s], 396 km/h; a sedan's 110 km/h reads 110
_LARGEST_V_X_R = 60.0  # [m/s^2], 6 g: beyond downforce cars; 1 m/s^2 in degrees reads 57
_SURE_PAIR = 0.9  # correlation from which two channels are of one bend
_NO_PAIR = 0.3  # correlation up to which they are of none
_LACKS = 0.35  # slope of a_y on v_x r, below zero, up to which it is not turned but lacks v_x r
_SLOPE = (0.5, 2.0)  # a_y on v_x r is 1, with roll up to 1.2; km/h 0.28, g 0.10, degrees 0.017
_LONGEST_WHEELBASE = 4.0  # [m], in judging a mass: so 64 kg at least, a kart with driver has 150
_LIGHTEST = 1.0  # [kg/m^3]: mass over wheelbase cubed is 17 to 300 for all cars; in kN 0.3 at most
_LARGEST_SLIP = 0.7  # [rad], 40 degrees in the median window: nobody drives a whole run like that

_PLACED = 0.03  # [m] to which the place of a v_y is known: more slip than that tells a sign

_DOCTOR = (
    "tireid doctor LOG --vehicle FILE, or diagnose(log, car) of a log read with check=False "
    "looks for other faults, and repairs them"
)


def check_physics(recording: Recording) -> None:
    """Refuse a recording whose signs, axes or units contradict the laws of motion."""
    _refuse(recording, physics_contradiction(recording))


def _refuse(recording: Recording, contradiction: str | None) -> None:
    """Raise what contradicts, and say who finds out why."""
    if contradiction is not None:
        contradiction = ("vy" in contradiction and computed_v_y(recording)) or contradiction
        raise RecordingError(f"{recording.name}: {contradiction}; {_DOCTOR}")


def physics_contradiction(recording: Recording) -> str | None:
    """Return how a recording contradicts the laws of motion: column, rule, value and remedy."""
    w = windows(recording)
    found = world_axes(recording) or _check_peaks(recording)
    if found or w.r.size * STRIDE < 2.0:
        return found
    if found := _check_signs_are_there(recording):
        return found
    largest = float(np.percentile(np.abs(w.v_x_r), 95))
    if largest > _LARGEST_V_X_R:
        return (
            f"r must be in rad/s, |v_x r| below {_LARGEST_V_X_R:g} m/s², it is "
            f"{largest:.4g}; degrees per second? multiply r by pi/180"
        )
    turn = steering(w)
    found = _check_turns(w) or _check_lateral_acceleration(w)
    if turn is not None:
        found = found or _check_steering(w, turn)
        found = found or _check_lateral_velocity(recording, w, turn)
    return found or _check_forces(w, turn)


def _check_peaks(recording: Recording) -> str | None:
    """Answer with steering beyond 1.2 rad, speeds beyond 110 m/s, and cars that drive backwards."""
    for column in ("delta_f", "delta_r"):
        largest = peak(getattr(recording, column))
        if largest > _LARGEST_STEERING:
            return (
                f"{column} must be the road-wheel angle in rad, below "
                f"{_LARGEST_STEERING}, its peak is {largest:.4g}; degrees or a hand-wheel "
                "angle? convert it (degrees: multiply by pi/180)"
            )
    fastest = peak(recording.v_x)
    if fastest > _LARGEST_SPEED:
        return (
            f"vx must be in m/s, below {_LARGEST_SPEED:g}, its peak is "
            f"{fastest:.4g}; km/h? divide by 3.6"
        )
    some = recording.v_x[:: thinning(len(recording))]
    forward, backward = float(np.percentile(some, 95)), float(np.percentile(some, 5))
    if backward < -1.0 and forward < -0.3 * backward:
        return (
            f"vx must point forward (ISO axes), 95 % of it lies below "
            f"{forward:.4g} m/s; change the sign of vx (and of vy, if the axes are turned about z)"
        )
    return None


def _check_signs_are_there(recording: Recording) -> str | None:
    """Answer with an r or a delta_f that is an amount: never negative, and large on both sides.

    Some cars send amounts, and whether they are negative in a channel of its own. Judged where a_y,
    or else r, goes to both sides beyond a third of its peak for a twentieth of the time.
    """
    some = slice(None, None, thinning(len(recording)))
    for name, other in (("r", "a_y"), ("delta_f", "a_y"), ("delta_f", "r")):
        if getattr(recording, other) is None:
            continue
        x, y = getattr(recording, name)[some], getattr(recording, other)[some]
        third = float(np.percentile(np.abs(y), 99.0)) / 3.0
        left, right = y > third, y < -third
        if min(np.mean(left), np.mean(right)) < 0.05 or np.min(x) < -0.02 * np.max(np.abs(x)):
            continue
        on_left, on_right = float(np.median(x[left])), float(np.median(x[right]))
        between = float(np.median(x[~left & ~right])) if np.any(~left & ~right) else 0.0
        if min(on_left, on_right) > 1.5 * max(between, 0.0) and min(on_left, on_right) > 0.0:
            return (
                f"{name} must be negative to the right, it never is, and as large there as to the "
                f"left: an amount with its sign in another channel? multiply by that"
            )
    return None


def world_axes(recording: Recording) -> str | None:
    """Return that v_x and v_y are of the world's axes, None where they are not.

    The direction of the velocity of a car turns with the car in the world's axes; in its own it
    does so, the other way, in a spin alone. Judged over 2 s of windows that turn.
    """
    found = course_rate(recording)
    if found is None:
        return None
    course, r = found
    turns = np.abs(r) > 0.2 * np.percentile(np.abs(r), 99)
    course, r = course[turns], r[turns]
    if r.size * WINDOW < 2.0 or not root_mean_square(r) > 0.01:
        return None
    slope = float(course @ r) / float(r @ r)
    if not (abs(abs(slope) - 1.0) < 0.2 and abs(correlation(course, r)) > 0.9):
        return None
    return (
        "vx and vy must be of the car's axes, their direction turns as the heading does, "
        f"{slope:.3g} times as fast as r: they are of the world's axes (east and north, or north "
        "and east); turn them by the heading, or give the pose, x, y and yaw"
    )


def _check_turns(w: Means) -> str | None:
    """Answer with the one of r, steering and a_y that turns the other way than both others.
    Of two alone nobody can tell which is wrong: they are named both.
    """
    turn, felt = w.v_x_r, w.a_y
    steered = w.v_x**2 * w.delta
    r_delta = pair(turn, steered, w.grips)
    if felt is None:
        return _check_two(r_delta)
    factor = multiple(w.r, felt)
    if factor is not None and not 0.5 < factor / float(np.mean(w.v_x)) < 2.0:
        return (
            "ay must be an acceleration, it is r times a number: a copy of the yaw rate? "
            "leave it out"
        )
    r_a, a_delta = pair(turn, felt), pair(felt, steered, w.grips)
    dot, dot_error = _of_v_y(least_squares(_kinematics(w), felt), w)
    against_v_y = dot_error < 0.6 and abs(dot) > dot_error
    if r_a.sign < 0:
        rho = r_a.correlation
        law = f"ay must be v̇_y + v_x r (ISO axes), its correlation with v_x r is {rho:.2f}"
        turned_r = r_delta.sign < 0 <= a_delta.sign
        turned_a = a_delta.sign < 0 <= r_delta.sign
        if against_v_y and turned_r == turned_a:
            turned_r, turned_a = dot > 0.0, dot < 0.0
        if turned_r:
            return f"r contradicts ay: {law}; r must be positive to the left, change the sign of r"
        if turned_a:
            return f"{law}; change the sign of ay (positive to the left)"
        return f"r and ay contradict one another: {law}; ambiguous, look at one left turn"
    if r_delta.sign < 0 and a_delta.sign >= 0 and r_a.sign > 0:
        return _check_two(r_delta)  # a_y says nothing of the steering
    if (
        abs(a_delta.correlation) > _SURE_PAIR
        and a_delta.sign
        and max(abs(r_a.correlation), abs(r_delta.correlation)) < _NO_PAIR
    ):
        return (
            "r must be the yaw rate, it goes neither with ay nor with the steering (correlations "
            f"{r_a.correlation:.2f} and {r_delta.correlation:.2f}), these two go together "
            f"({a_delta.correlation:.2f}): another axis of the gyro, or one that is not connected?"
        )
    return _check_two(r_delta)


def _check_two(r_delta: Pair) -> str | None:
    """Answer with a steering angle that turns the other way than r."""
    if r_delta.sign >= 0:
        return None
    return (
        "delta_f must turn the car to the left (r > 0) when positive, its correlation with r is "
        f"{r_delta.correlation:.2f}; change the sign of delta_f (or of r)"
    )


def _check_lateral_acceleration(w: Means) -> str | None:
    """Answer with a_y that is not v̇_y + v_x r in size.
    Regressors: v_x r, v̇_y where v_y was measured, ṙ (a sensor off the center of gravity) and,
    where v_x r varies by half its mean, 1 (bias, bank). Needs std(v_x r) >= 0.3 m/s^2, or a steady
    turn of 1.5 m/s^2, three times a usual bias; or as much of an a_y that goes with v_x r. A slope
    is judged when it is four standard errors outside its bound; too large a slope must also explain
    half of a_y, which vibration does not.
    """
    if w.a_y is None:
        return None
    X = _kinematics(w)
    some = turning(w.v_x_r, w.a_y)
    if not some.any():
        return None
    moved, felt = w.v_x_r[some], w.a_y[some]
    mean, spread = abs(float(np.mean(w.v_x_r))), float(np.std(moved))
    alike = correlation(felt - np.mean(felt), moved - np.mean(moved)) > _SURE_PAIR
    if spread >= max(0.3, 0.5 * mean) or (alike and float(np.std(felt)) >= 0.3):
        X = np.column_stack([X, np.ones(w.r.size)])
    elif mean < 1.5:
        return None
    fit = least_squares(X, w.a_y)
    slope, error = fit.theta[0], 4.0 * fit.error[0]
    dot, dot_error = _of_v_y(fit, w)
    law = f"must be v̇_y + v_x r (ISO axes), its slope on v_x r is {slope:.3g} instead of 1"
    if slope + error < _SLOPE[0] or (slope - error > _SLOPE[1] and fit.r_squared > 0.5):
        return _blame(slope, law)
    if _turned(dot, dot_error, w) and slope - error > 0.0:
        return (
            f"vy contradicts ay: ay must be v̇_y + v_x r, its slope on v̇_y is "
            f"{dot:.3g} instead of 1; vy must be positive to the left, change the sign of vy"
        )
    return None


def _kinematics(w: Means) -> Array:
    """Return v_x r, v̇_y where there is one, and ṙ (k, 2 or 3)."""
    return np.column_stack([one for one in (w.v_x_r, w.v_y_dot, w.r_dot) if one is not None])


def _of_v_y(fit: Fit, w: Means) -> tuple[float, float]:
    """Return the slope on v̇_y and four standard errors of it: 1 ± infinity where there is none."""
    return (1.0, np.inf) if w.v_y_dot is None else (fit.theta[1], 4.0 * fit.error[1])


def _turned(dot: float, dot_error: float, w: Means) -> bool:
    """Whether a slope on v̇_y is the -1 of a wrong sign, and v̇_y moves enough to say so."""
    moves = w.v_y_dot is not None and float(np.std(w.v_y_dot)) >= 0.003
    return moves and -2.5 < dot < -0.3 and dot + dot_error < 0.0


# What a slope of a_y on v_x r says where it is the factor of a unit.
_BLAMED = {
    1 / 57.3: "r must be in rad/s: ay {}; degrees per second? multiply r by pi/180",
    1 / 9.81: "ay {}; ay in g? multiply it by 9.81",
    1 / 3.6: "vx must be in m/s: ay {}; km/h? divide vx by 3.6",
    1 / 2.237: "vx must be in m/s: ay {}; mph? divide vx by 2.237",
    3.6: "vx must be in m/s: ay {}; m/s that were read as km/h? multiply vx by 3.6",
    9.81: "ay {}; m/s² that were read as g? divide ay by 9.81",
    57.3: "r must be in rad/s: ay {}; rad/s that were read as deg/s? multiply r by 180/pi",
}


def _blame(slope: float, law: str) -> str:
    """Name the column and unit whose factor lies nearest to the slope."""
    if slope > 0.0:
        factor = min(_BLAMED, key=lambda one: abs(np.log(slope / one)))
        if abs(np.log(slope / factor)) < np.log(1.3):
            return _BLAMED[factor].format(law)
    elif abs(slope) < _LACKS:
        return (
            f"ay {law}; it lacks the centripetal part (the change of a body's velocity, as some "
            "simulators give?): add v_x r, or leave the column ay out"
        )
    return f"ay {law}; check its axis, unit and time stamps, or leave the column ay out"


def _check_steering(w: Means, turn: Steering) -> str | None:
    """Answer with steering that turns the wrong way or an effective wheelbase out of all cars.

    Upper bound 7.5 m + 0.03 v_x^2 (a bus, with three times a sedan's understeer) where small
    steering says the same as large, since a car that slides over its front wheels reads long;
    lower bound 0.03 m (half a 1:43 car) rising to 0.12 m at 8 m/s (a sedan in degrees/s 0.05).
    """
    front, rear = (np.mean(angle**2) for angle in (w.delta_f, w.delta_r))
    column = "delta_f" if front >= rear else "delta_r"
    L = turn.wheelbase
    if turn.correlation < 0.7:
        return None
    v = root_mean_square(w.v_x)
    longest = 7.5 + 0.03 * v**2
    if longest < L and proportional(w):
        in_degrees = "degrees? multiply it by pi/180"
        wheel = (
            "the angle of the steering wheel? divide it by the steering ratio (12 to 20 in cars)"
        )
        likely = L * np.pi / 180.0 > (0.1 if v < 8.0 else 1.5)
        both = (in_degrees, wheel) if likely else (wheel, in_degrees)
        return (
            f"{column} must be in rad, the effective wheelbase v_x delta/r is "
            f"{L:.4g} m, above {longest:.3g}; {'; or '.join(both)}"
        )
    shortest = min(max(0.015 * v, 0.03), 0.12)
    if shortest > L:
        return (
            f"r must be in rad/s, the effective wheelbase v_x delta/r is "
            f"{L:.3g} m, below {shortest:.2g}; degrees per second? multiply r by pi/180"
        )
    return None


def _check_lateral_velocity(recording: Recording, w: Means, turn: Steering) -> str | None:
    """Answer with a center of rotation behind the rear axle: its tires would push outward.

    v_y/r is the distance from the center of gravity back to where lateral velocity vanishes,
    at most l_r, about half the wheelbase; alarm at 0.9 effective wheelbases.
    """
    if w.v_y is None:
        return None
    behind = float(w.v_y @ w.r) / float(w.r @ w.r)
    alike = behind * float(np.sqrt(np.mean(w.r**2) / (np.mean(w.v_y**2) + 1e-300)))
    rear_steers = peak(recording.delta_r) > 0.1 * peak(recording.delta_f)
    clear = turn.correlation > 0.7 and alike > 0.7 and not rear_steers
    if clear and behind > 0.9 * turn.wheelbase:
        return (
            f"vy must be positive to the left at the center of gravity, "
            f"vy/r is {behind:.3g} m, behind the rear axle (effective wheelbase "
            f"{turn.wheelbase:.3g} m); change the sign of vy or move it to the center of gravity"
        )
    return None


def _check_forces(w: Means, turn: Steering | None) -> str | None:
    """Answer with axle forces that push against the acceleration, are swapped, or are in kN.

    Needs rms(v̇_y + v_x r) >= 0.3 m/s^2. Signs: correlation below -0.5. Unit: the mass that the
    summed force implies, over the cube of the effective wheelbase.
    """
    a = w.acceleration
    if w.force is None or root_mean_square(a) < 0.3:
        return None
    for column, force in zip(("Fyf", "Fyr"), w.force.T, strict=True):
        together = correlation(force, a)
        if together < -0.5:
            return (
                f"{column} must push to the left when positive (ISO axes), its "
                f"correlation with v̇_y + v_x r is {together:.2f}; change the sign of {column}"
            )
    yaw = least_squares(w.force, w.r_dot)
    if yaw.r_squared > 0.5 and yaw.theta[0] < -8 * yaw.error[0] and yaw.theta[1] > 8 * yaw.error[1]:
        return (
            "Fyf must turn the car to the left and Fyr to the right, ṙ says "
            "the opposite; swap the columns Fyf and Fyr"
        )
    total = w.force.sum(axis=1)
    if turn is None or turn.correlation < 0.7 or correlation(total, a) < 0.7:
        return None
    fit = least_squares(_kinematics(w), total)
    dot, dot_error = (one / fit.theta[0] for one in _of_v_y(fit, w))
    if fit.theta[0] > 4.0 * fit.error[0] and _turned(dot, dot_error, w):
        return (
            f"vy contradicts Fyf + Fyr, which must be mass times v̇_y + v_x r, "
            f"the two slopes have the ratio {dot:.3g} instead of 1; change the sign of vy"
        )
    L = shortest_wheelbase(w, turn)
    mass = float(total @ a) / float(a @ a)
    if mass < _LIGHTEST * min(L, _LONGEST_WHEELBASE) ** 3:
        return (
            f"Fyf and Fyr must be in N, they imply a mass of {mass:.3g} kg on "
            f"an effective wheelbase of {L:.3g} m; kN? multiply by 1000"
        )
    return None


# The checks that need the axle positions: slip angles against accelerations and forces.


def check_against_vehicle(recording: Recording, vehicle: Vehicle) -> None:
    """Refuse a recording whose slip angles contradict this vehicle.

    Rules, each silent without excitation (2 s of motion, rms lateral acceleration 0.3 m/s^2):
    the median rear slip is below 0.7 rad; the effective wheelbase (the shorter of that of all and
    that of small steering) is above (l_f + l_r)/3 and below 3 (l_f + l_r) + 0.03 v_x^2;
    each axle's force, or failing that the lateral acceleration for the rear, rises with its slip
    angle (correlation above -0.3); the mass that the forces accelerate is a third to three times
    the vehicle's.
    """
    _refuse(recording, vehicle_contradiction(recording, vehicle))


def vehicle_contradiction(recording: Recording, vehicle: Vehicle) -> str | None:
    """Return how a recording contradicts a vehicle, by the rules of `check_against_vehicle`."""
    w = windows(recording)
    a = w.acceleration
    if w.r.size * STRIDE < 2.0 or root_mean_square(a) < 0.3:
        return None
    l_f, l_r = vehicle.l_f, vehicle.l_r
    slip = None
    if w.v_y is not None:
        motion = {"v_x": w.v_x, "v_y": w.v_y, "r": w.r}
        slip = measured_slip(l_f, l_r, **motion, delta_f=w.delta_f, delta_r=w.delta_r)
        typical = float(np.median(np.abs(slip[:, 1])))
        if typical > _LARGEST_SLIP:
            return (
                f"vy and r must be in m/s and rad/s, the median rear slip angle is "
                f"{typical:.3g} rad, above {_LARGEST_SLIP}; check units, and l_r = {l_r:g} m"
            )
    turn, other = steering(w), ""
    if turn is not None and turn.correlation > 0.7:
        L = shortest_wheelbase(w, turn)
        v = root_mean_square(w.v_x)
        lowest, highest = (l_f + l_r) / 3.0, 3.0 * (l_f + l_r) + 0.03 * v**2
        if not lowest < L < highest:
            return (
                f"delta_f, r and vx must fit the wheelbase {l_f + l_r:.3g} m, "
                f"v_x delta/r is {L:.3g} m, outside {lowest:.3g} to {highest:.3g}; check their "
                "units, or name the right vehicle"
            )
        if 3.0 * (l_f + l_r) < L:  # understeer may do it, the file of a smaller car does
            other = (
                f", or name the right vehicle: v_x delta/r is {L:.3g} m, the wheelbase of this "
                f"one {l_f + l_r:.3g} m"
            )
    if w.force is None:
        return None if slip is None else _check_rear_rises(slip[:, 1], w, l_r, other)
    for column, k in (("Fyr", 1), ("Fyf", 0)):
        if slip is not None and (falls := _falls(slip[:, k], w.force[:, k])) is not None:
            return (
                f"{column} {_RISES}, their correlation is {falls:.2f}; change the sign of {column} "
                f"or of vy{other}"
            )
    force, mass = w.force.sum(axis=1), vehicle.mass
    moved = float(force @ a / (a @ a))
    if correlation(force, a) > 0.8 and not mass / 3.0 < moved < 3.0 * mass:
        return (
            f"Fyf + Fyr must accelerate the vehicle of {mass:.4g} kg, they "
            f"move {moved:.4g} kg; check the unit of mass, or name the right vehicle"
        )
    return None


_RISES = "must rise with its slip angle (paper's sign, alpha = delta - atan2(v_y +- l r, v_x))"


def _falls(alpha: Array, pushed: Array) -> float | None:
    """Return the correlation of a slip angle with a push that falls with it, None where none does.
    alpha : [rad] (k,).   pushed : force, or acceleration (k,).
    """
    together = correlation(alpha, pushed)
    return together if together < -0.3 and root_mean_square(alpha) > 0.003 else None


def _check_rear_rises(alpha: Array, w: Means, l_r: float, other: str) -> str | None:
    """Answer with a lateral acceleration that falls with the slip of the rear: by v_y or the car.

    Where an accelerometer has the slope 1 on v̇_y the sign of v_y is right, and the car is wrong.
    """
    falls = _falls(alpha, w.acceleration)
    if falls is None or np.mean(alpha**2) < np.mean((_PLACED * w.r / w.v_x) ** 2):
        return None
    car = f"name the right vehicle; this file declares l_r = {l_r:g} m"
    place = "move vy to the center of gravity"
    remedy = f"change the sign of vy{other or f', or {car}'}, or {place}"
    if w.a_y is not None:
        slope, error = _of_v_y(least_squares(_kinematics(w), w.a_y), w)
        if slope > 0.3 > error:
            remedy = f"vy has the sign of ay: {car}, or {place}"
        elif slope < -0.3 < -error:
            remedy = "change the sign of vy"
    return f"lateral acceleration {_RISES}, their correlation is {falls:.2f}; {remedy}"
