"""Velocities of a car from its pose: position and heading of motion capture, SLAM, /tf or odometry.

x, y [m] and heading ψ [rad] are smoothed without phase, p minimizes Σ (z - p)² + λ Σ (Δ³p)² with λ
by generalized cross-validation, and differentiated:
v_x = ẋ cos ψ + ẏ sin ψ,  v_y = -ẋ sin ψ + ẏ cos ψ,  r = ψ̇.
A heading may count clockwise, from north or in degrees: the direction of travel tells.
"""

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from codegen.arrays import Array, root_mean_square
from models.logs.clock import Raw, gaps, typical_step
from models.logs.log import RecordingError
from models.logs.signals import POSE, QUANTITIES, Signal
from models.recordings.evidence import least_squares
from models.recordings.map import LONGEST_GAP
from models.recordings.record import resample

_NO_SLIP = 2e-3  # v_y over v_x of a pose that is integrated along its heading
_SLOW = 0.025  # [s] between poses from which a gyro tells the yaw rate
_FEWEST_SAMPLES = 30  # samples of a piece that is differentiated
_STANDS = 0.05  # [m/s], a pose that never goes faster does not move
_ALONG = 0.35  # [rad] that the direction of travel may lie off the heading, or a quarter of a turn
_ACROSS = 0.4  # rms of the velocity across the car over all of it, with slip of a drift
_CLEARLY = 1.5  # times that another sense must leave across to be out, each with its side slip
_STRAIGHT = 2e-3  # of the speed, more: what is across where nothing turns
# Straight ahead v_y is 0: what goes with v_x alone is how the frame of a pose is turned. On 72
# random drives with the noise of a pose, turned by nothing, it was found to 0.05 to 0.3 deg.
_APART = 0.125  # [s] between samples that tell it
_SURELY = 3.0  # standard deviations that it must be from none
_BOTH = 0.6  # of all turning that may be more to one side than to the other
_TURNED = 0.015  # [rad], less of which the estimate of the tires finds itself
_LATEST = 0.3  # [s] that a gyro may be late against a pose
_LATE = 0.01  # [s] that it is late, more of which is taken out of it
_ALIKE = 0.9  # correlation of the two yaw rates from which that is known

_TURN = math.pi / 2.0
_STRENGTHS = np.geomspace(1e-3, 1e9, 49)  # λ [-]


def with_pose(
    label: str, signals: Mapping[str, Signal], parts: Mapping[str, list[Raw]], declared: bool
) -> tuple[dict[str, Signal], dict[str, list[Raw]], tuple[str, ...]]:
    """Return signals and their channels with v_x, v_y and r of the pose in its place, and notes.

    A gyro tells how late it, and what else a box has, is against the pose; that is taken out.
    parts : by signal its channels in SI.
    declared : whether somebody said how the heading counts.
    """
    if not set(POSE) <= set(signals):
        return dict(signals), dict(parts), ()
    pose = {name: parts[name][0] for name in POSE}
    if len(parts["heading"]) > 1:
        pose["heading"] = _of_quaternion(label, parts["heading"])
    for name, raw in pose.items():
        values = signals[name].value([raw.values], QUANTITIES[name])
        pose[name] = raw._replace(values=values)
    motion = _motion_of(label, pose, signals, declared)
    sideways = root_mean_square(motion.v_y.values)
    if sideways < _NO_SLIP * root_mean_square(motion.v_x.values):
        raise RecordingError(
            f"{label}: the pose never leaves its heading, as one that is integrated from wheels: "
            "vy is not in it; give the pose of another sensor, or leave it out"
        )
    found = {name: raws for name, raws in parts.items() if name not in POSE}
    gyro = parts["r"][0] if "r" in parts else None
    slow = typical_step(motion.r.t) > _SLOW
    of_pose = {"v_x": motion.v_x, "v_y": motion.v_y}
    if gyro is None or not slow:
        of_pose["r"] = motion.r
    what = "vx, vy and r" if "r" in of_pose else "vx and vy"
    said = [f"{what} are taken from the pose{motion.said}"]
    late = None if gyro is None else _lateness(gyro, motion.r)
    if late is not None and abs(late) > _LATE:
        box = [name for name in ("r", "a_y", "a_x") if name in found]
        for name in box:
            found[name] = [_earlier(raw, late, motion.r.t) for raw in found[name]]
        side = "late against" if late > 0.0 else "ahead of"
        words = ", ".join(box)
        said.append(
            f"the gyro is {1e3 * abs(late):.0f} ms {side} the pose: {words} are moved by it"
        )
    found |= {name: [raw] for name, raw in of_pose.items()}
    kept = {name: one for name, one in signals.items() if name in found}
    kept |= {name: Signal(channel=("pose",)) for name in of_pose}
    return kept, found, tuple(said)


def _earlier(raw: Raw, late: float, t: Array) -> Raw:
    """Return a channel as much earlier, on the clock of the pose (n,) where it has no gap."""
    moved = raw._replace(t=raw.t - late)
    if gaps(moved.t, LONGEST_GAP).size or typical_step(raw.t) > _SLOW:
        return moved
    inside = t[(t >= moved.t[0]) & (t <= moved.t[-1])]
    rows = raw.rows[np.minimum(np.searchsorted(moved.t, inside), raw.rows.size - 1)]
    return raw._replace(t=inside, values=np.interp(inside, moved.t, raw.values), rows=rows)


def _of_quaternion(label: str, parts: Sequence[Raw]) -> Raw:
    """Return the heading of x, y, z, w, or of z and w alone [rad]."""
    if len(parts) not in (2, 4) or any(one.t.size != parts[0].t.size for one in parts):
        raise RecordingError(
            f"{label}: heading must be one channel, or x, y, z and w of a quaternion, it has "
            f"{len(parts)}"
        )
    still = np.zeros(parts[0].t.size)
    x, y, z, w = (still, still, *(one.values for one in parts))[-4:]
    return parts[0]._replace(values=np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))


class _Motion(NamedTuple):
    """v_x, v_y [m/s] and r [rad/s] of a pose on its clock, and how it was read, in words."""

    v_x: Raw
    v_y: Raw
    r: Raw
    said: str


def _motion_of(
    label: str, parts: Mapping[str, Raw], signals: Mapping[str, Signal], declared: bool
) -> _Motion:
    """Return how a car moves by its pose.
    parts : by name of `POSE` on one clock or several, SI.
    """
    x = parts["x"]
    t = x.t
    psi = parts["heading"].values
    period = 360.0 if np.abs(psi).max(initial=0.0) > 2.0 * math.pi + 0.1 else 2.0 * math.pi
    values = (x.values, parts["y"].values, np.unwrap(psi, period=period))
    of_pose = zip(POSE, values, strict=True)
    z = np.column_stack([np.interp(t, parts[name].t, one) for name, one in of_pose])
    pieces = []
    for first, end in pairwise([0, *gaps(t, LONGEST_GAP).tolist(), t.size]):
        if end - first >= _FEWEST_SAMPLES:
            pieces.append(_piece(t[first:end], z[first:end], x.rows[first:end]))
    if not pieces:
        raise RecordingError(
            f"{label}: the pose must have at least {_FEWEST_SAMPLES} samples without a gap, "
            f"it has {t.size}"
        )
    body, r, unit, turned = _in_axes(label, pieces, signals, declared)
    rows = np.concatenate([piece.rows for piece in pieces])
    clock = np.concatenate([piece.t for piece in pieces])
    v_x, v_y, turns = (Raw(clock, one, x.place, rows) for one in (body.real, body.imag, r))
    place, heading = np.median([piece.noise for piece in pieces], axis=0)
    said = (
        f"{turned}; its position scatters by {place:.2g} m, its heading by "
        f"{math.degrees(unit * heading):.2g} deg"
    )
    return _Motion(v_x, v_y, turns, said)


class _Piece(NamedTuple):
    """A piece without a gap: times and rows (n,), rates (n, 3), heading (n,), noise."""

    t: Array
    rows: NDArray[np.int64]
    rates: Array
    heading: Array
    noise: tuple[float, float]


def _piece(t: Array, z: Array, rows: NDArray[np.int64]) -> _Piece:
    step = float((t[-1] - t[0]) / (t.size - 1))
    even, pose = resample(t, dict(zip(POSE, z.T, strict=True)), step)
    z = np.column_stack(list(pose.values()))
    (place, off), (heading, turned) = _smoothed(z[:, :2]), _smoothed(z[:, 2:])
    rates = np.gradient(np.column_stack([place, heading]), step, axis=0, edge_order=2)
    return _Piece(even, rows, rates, heading[:, 0], (off, turned))


def _smoothed(z: Array) -> tuple[Array, float]:
    """Return columns of one size, smoothed alike as strongly as they predict themselves best.
    Beside them (n, k) stands the standard deviation of what was taken out.
    z : (n, k), evenly sampled.
    """
    from scipy.fft import dct  # takes longer than to read a short log
    from scipy.linalg import solveh_banded

    n = len(z)
    line = z[0] + np.outer(np.arange(n) / (n - 1.0), z[-1] - z[0])
    power = np.sum(dct(z - line, axis=0, norm="ortho") ** 2, axis=1)
    stiff = (2.0 - 2.0 * np.cos(np.pi * np.arange(n) / n)) ** 3  # of Δ³, for cosines
    left = 1.0 - 1.0 / (1.0 + np.outer(_STRENGTHS, stiff))
    misses = np.sum(left**2 * power, axis=1) / np.sum(left, axis=1) ** 2
    best = int(np.argmin(misses))
    third = np.array([-1.0, 3.0, -3.0, 1.0])
    bands = np.zeros((4, n))
    for lag in range(4):
        for k in range(lag, 4):
            bands[3 - lag, k : k + n - 3] += third[k - lag] * third[k]
    bands *= _STRENGTHS[best]
    bands[3] += 1.0
    values = np.asarray(solveh_banded(bands, z))
    freedom = float(np.sum(left[best])) * z.shape[1]
    noise = math.sqrt(float(np.sum((z - values) ** 2)) / max(freedom, 1.0))
    return values, noise


def _in_axes(
    label: str, pieces: Sequence[_Piece], signals: Mapping[str, Signal], declared: bool
) -> tuple[NDArray[np.complex128], Array, float, str]:
    """Return v_x + i v_y [m/s] and r [rad/s], the unit of the heading [rad], and how it was read.

    The sense and unit count that leave the least velocity across the car.
    declared : whether somebody said how it counts, which holds where the drive does not tell.
    """
    x_dot, y_dot, r = np.concatenate([piece.rates for piece in pieces]).T
    v = x_dot + 1j * y_dot
    heading = np.concatenate([piece.heading for piece in pieces])
    if not (most := np.abs(v).max()) > _STANDS:
        raise RecordingError(f"{label}: the pose must move, its largest speed is {most:.3g} m/s")
    ways = [(sign, unit) for unit in (1.0, math.pi / 180.0) for sign in (1.0, -1.0)]
    turned = [v * np.exp(-1j * sign * unit * heading) for sign, unit in ways]
    axes = [np.mean(one**2) / np.mean(np.abs(v) ** 2) for one in turned]  # squared: or backwards
    across = np.sqrt(np.maximum(0.5 - 0.5 * np.abs(axes), 0.0))
    best = int(np.argmin(across))
    if across[best] > _ACROSS:
        raise RecordingError(
            f"{label}: the heading must go along with the direction of travel of x and y, it does "
            "not: another channel, or other axes?"
        )
    alike = across < _CLEARLY * across[best] + _STRAIGHT
    if alike.sum() > 1:
        if not (declared and alike[0]):
            x, y, angle = (" + ".join(signals[name].channel) for name in POSE)
            in_unit = signals["heading"].unit or ("rad" if alike[:2].any() else "deg")
            raise RecordingError(
                f"{label}: the drive does not tell whether the heading counts to the left or "
                f'clockwise: declare it by --columns "x={x}" "y={y}" '
                f'"heading={angle} [{in_unit}]", with *-1 behind the unit if clockwise'
            )
        best = 0
    (sign, unit), away = ways[best], float(np.angle(axes[best])) / 2.0
    away += math.pi if np.mean(turned[best] * np.exp(-1j * away)).real < 0.0 else 0.0
    whole = _TURN * round(away / _TURN)
    shift = whole if abs(away - whole) < _ALONG else away
    body = turned[best] * np.exp(-1j * shift)
    r = sign * unit * r
    each = slice(None, None, max(1, round(_APART / typical_step(pieces[0].t))))
    terms = np.column_stack([body.real, r, r * body.real**2])[each]  # turned, ahead and slip
    found = least_squares(terms, body.imag[each])
    both = abs(r.sum()) < _BOTH * np.abs(r).sum()  # else slip is to one side, too
    if both and abs(found.theta[0]) > max(_SURELY * found.error[0], _TURNED):
        shift += float(found.theta[0])
        body *= np.exp(-1j * found.theta[0])
    said = ["its heading is clockwise"] if sign < 0 else []
    said += ["its heading is in degrees"] if unit != 1.0 else []
    said += [f"its heading lies {math.degrees(shift):.3g} deg off the travel"] if shift else []
    words = f" ({', '.join(said)})" if said else ""
    return body, r, unit, words


def _lateness(gyro: Raw, pose: Raw) -> float | None:
    """Return by how much a gyro is late against the yaw rate of a pose [s]; None if not known."""
    dt = max(typical_step(gyro.t), typical_step(pose.t)) / 2.0
    begin, end = (
        max(gyro.t[0], pose.t[0]) + _LATEST,
        min(gyro.t[-1], pose.t[-1]) - _LATEST,
    )
    if end - begin < 10.0 * _LATEST:
        return None
    grid = np.arange(begin, end, dt)
    reference = np.interp(grid, pose.t, pose.values)
    lags = dt * np.arange(-int(_LATEST / dt), int(_LATEST / dt) + 1)
    if np.std(reference) == 0.0 or np.std(gyro.values) == 0.0:
        return None
    alike = np.array(
        [np.corrcoef(reference, np.interp(grid + lag, gyro.t, gyro.values))[0, 1] for lag in lags]
    )
    k = int(np.argmax(alike))
    if alike[k] < _ALIKE or not 0 < k < lags.size - 1:
        return None
    low, peak, high = alike[k - 1 : k + 2]
    return float(lags[k] + dt * 0.5 * (low - high) / (low - 2.0 * peak + high))
