"""The checks that need the axle positions: slip angles against accelerations and forces."""

from typing import Protocol

import numpy as np

from models.recordings.evidence import STRIDE, correlation, onset, steering, windows
from models.recordings.record import Array, Recording, RecordingError

LARGEST_SLIP = 0.7  # [rad], 40 degrees in the median window: nobody drives a whole run like that


class Axles(Protocol):
    """What the check must know of a vehicle: its mass and the distances of its axles."""

    @property
    def l_f(self) -> float:
        """Center of gravity to front axle [m]."""

    @property
    def l_r(self) -> float:
        """Center of gravity to rear axle [m]."""

    @property
    def mass(self) -> float:
        """Mass [kg]."""


def check_against_vehicle(recording: Recording, vehicle: Axles) -> None:
    """Refuse a recording whose slip angles contradict this vehicle.

    Rules, each silent without excitation (2 s of motion, rms lateral acceleration 0.3 m/s^2):
    the median rear slip is below 0.7 rad; the effective wheelbase (the shorter of that of all and
    that of small steering) is above (l_f + l_r)/3 and below 3 (l_f + l_r) + 0.03 v_x^2;
    each axle's force, or failing that the lateral acceleration for the rear, rises with its slip
    angle (correlation above -0.3); the mass that the forces accelerate is a third to three times
    the vehicle's.

    Parameters
    ----------
    recording : the recording to judge.
    vehicle : anything with l_f and l_r [m] and mass [kg].

    Raises
    ------
    RecordingError
        Naming the column, the rule, the value and the remedy.
    """
    w = windows(recording)
    a = w.v_x_r + w.v_y_dot
    if w.r.size * STRIDE < 2.0 or np.sqrt(np.mean(a**2)) < 0.3:
        return
    l_f, l_r = vehicle.l_f, vehicle.l_r
    alpha_f = w.delta_f - np.arctan2(w.v_y + l_f * w.r, w.v_x)
    alpha_r = w.delta_r - np.arctan2(w.v_y - l_r * w.r, w.v_x)
    typical = float(np.median(np.abs(alpha_r)))
    if typical > LARGEST_SLIP:
        raise RecordingError(
            f"{recording.name}: vy and r must be in m/s and rad/s, the median rear slip angle is "
            f"{typical:.3g} rad, above {LARGEST_SLIP}; check units, and l_r = {l_r:g} m"
        )
    turn, small = steering(w), onset(w)
    if turn is not None and turn.correlation > 0.7:
        L = turn.wheelbase if small is None else min(turn.wheelbase, small.wheelbase)
        v = float(np.sqrt(np.mean(w.v_x**2)))
        lowest, highest = (l_f + l_r) / 3.0, 3.0 * (l_f + l_r) + 0.03 * v**2
        if not lowest < L < highest:
            raise RecordingError(
                f"{recording.name}: delta_f, r and vx must fit the wheelbase {l_f + l_r:.3g} m, "
                f"v_x delta/r is {L:.3g} m, outside {lowest:.3g} to {highest:.3g}; check their "
                "units, or name the right vehicle"
            )
    rear = a if w.force is None else w.force[:, 1]
    _check_rises(recording, alpha_r, rear, "vy" if w.force is None else "Fyr")
    if w.force is not None:
        _check_rises(recording, alpha_f, w.force[:, 0], "Fyf")
        _check_mass(recording, w.force.sum(axis=1), a, vehicle.mass)


def _check_mass(recording: Recording, force: Array, a: Array, mass: float) -> None:
    """Refuse a vehicle whose mass is far from the one that the forces accelerate."""
    moved = float(force @ a / (a @ a))
    if correlation(force, a) > 0.8 and not mass / 3.0 < moved < 3.0 * mass:
        raise RecordingError(
            f"{recording.name}: Fyf + Fyr must accelerate the vehicle of {mass:.4g} kg, they "
            f"move {moved:.4g} kg; check the unit of mass, or name the right vehicle"
        )


def _check_rises(recording: Recording, alpha: Array, force: Array, column: str) -> None:
    """Refuse a force (or acceleration) that falls with the slip angle that makes it."""
    together = correlation(alpha, force)
    if together < -0.3 and np.sqrt(np.mean(alpha**2)) > 0.003:
        what = "lateral acceleration" if column == "vy" else column
        raise RecordingError(
            f"{recording.name}: {what} must rise with its slip angle (paper's sign, "
            f"alpha = delta - atan2(v_y +- l r, v_x)), their correlation is {together:.2f}; "
            f"change the sign of {column}" + ("" if column == "vy" else " or of vy")
        )
