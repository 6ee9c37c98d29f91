"""What the signals of a drive must agree on, whatever its tires are: residuals over faults.

Kinematics, of a log with an accelerometer:  a_y - ρ a_y(t - τ) = v̇_y + v_x r - g sin β, where the
body rolls with the accelerometer by ρ/(1 - ρ) rad for each g, τ behind, so that it shows weight.
Dynamics, per axle in static axle loads:  dξ_i/dt + v_x r/g - sin β = h_i(α_i) cos δ_i, of an odd
curve h_i = Σ_j w_j tanh(α/α_j) that nobody knows: the weights that fit best are taken for every
size of the faults (variable projection); it grows as 1 + κ_i v_x² with downforce, told or found.
ξ_i = v_y/g ± I_z r/(L F_z,i),
α_i = δ_i - atan((v_y ± l_i r)/v_x).
Both are asked in means over smooth windows ψ, ∫ψ ẋ dt = -∫ψ̇ x dt: no signal is differentiated.
What a real car adds is estimated beside the faults and reported by nobody: the way it rolls before
force follows slip, the sway of its body, whose roll follows a_y, over the contact patches, and the
weight that an accelerometer shows as it rolls with the body.
"""

import math
from collections.abc import Mapping
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from codegen.arrays import Array
from identifier.axle.curve import unit_matrix
from identifier.doctor.suspects import NUISANCES, grown
from identifier.doctor.windows import Windows, not_negative
from identifier.verdict.motion import BRISK
from models.recordings import Recording
from models.recordings.record import CHANNELS
from models.sensors import noise_in_means
from models.smoothing import low_passed, smoothed, window
from models.vehicle import GRAVITY, LIGHTEST, Vehicle

LADDER = (0.016, 0.032, 0.064, 0.128, 0.256)  # rad, slip scales of the curve
RIDGE = 1e-3  # on its weights, over the mean power of its units
# Of times in lengths of ψ:
SMOOTHED = 0.125  # half the window by which every channel is smoothed alike
SWAYED = 0.25  # half the window of what the roll of the body follows
STEP = 0.0375  # sampling interval after it
LONG, SHORT = 0.4, 0.1  # lengths of ψ, in periods of the swings of the drive
QUIET = 0.1  # noise over what no model explains, for which ψ is as long as it must be
FASTEST, SLOWEST = 4.0, 16.0  # periods of the swings that are believed, in sqrt(L/g)
MARGIN = 0.4  # s at both ends, what a delay may be
BANKS = 6  # cosines over the drive in which a bank may swing
OVERLAP = 4  # windows that begin within the length of one
WANDER = 0.03  # of a force: what no model of this size explains; of kinematics a third
SMALL = 0.004  # static axle loads
MOST_TILT = 0.15  # ρ of the softest body, 10 degrees for each g; none leans into the turn
TYPICAL = 10.0  # slope of a curve [static axle loads per rad], for the noise that slip brings

Sizes = Mapping[str, float]  # of faults, by key; what is not named is not there
Told = tuple[tuple[str, float], ...]  # the same, those of it that matter
FRONT, REAR, KINEMATICS = range(3)
STEERING = ("delta_f", "delta_r")
RELAXATION = ("relaxation.front", "relaxation.rear")
DOWNFORCE = ("downforce.front", "downforce.rear")  # κ beside the told one [s²/m²]
# Sizes that change nothing of a part: it is not computed again for their sake.
TIRES = frozenset({*RELAXATION, "sway"})
BODY = frozenset({"tilt"})
ROLL = frozenset({"roll_delay"})
GEOMETRY = frozenset({"center_of_gravity", "yaw_inertia"})
AHEAD = frozenset({"acceleration_sensor_x"})
BANKED = frozenset(f"bank.{k}" for k in range(BANKS))
PRESSED = frozenset(DOWNFORCE)
NOT_OF_FORCES = TIRES | ROLL | BODY | AHEAD | PRESSED
NOT_OF_MOTION = NOT_OF_FORCES | GEOMETRY | BANKED
NOT_OF_AXLES = AHEAD | BODY
NOT_OF_PART = (NOT_OF_AXLES | {RELAXATION[REAR], DOWNFORCE[REAR]},
               NOT_OF_AXLES | {RELAXATION[FRONT], DOWNFORCE[FRONT]},
               TIRES | GEOMETRY | PRESSED)  # fmt: skip
RECENT = 4  # sizes whose parts are kept


class Smooth(NamedTuple):
    """A channel and its two first derivatives, (k,)."""

    value: Array
    slope: Array
    bend: Array


class Residual(NamedTuple):
    """What the equations miss at some sizes of the faults.

    parts : front, rear and, where a_y is there, kinematics, (m,) each, over what is allowed.
    noise : mean square that white noise of the channels leaves in each.
    """

    parts: tuple[Array, ...]
    noise: tuple[float, ...]


class Motion(NamedTuple):
    """A drive without its faults, and what follows from it alone.

    channels : by name (n,).   a_y_dot : of what makes the body roll [m/s³], (n,).   rolled : way so
    far [m], (n,).   v_x : mean under each window [m/s], (m,).
    """

    channels: Mapping[str, Array]
    a_y_dot: Array
    rolled: Array
    v_x: Array


class Car(NamedTuple):
    """Geometry that holds if the told one is wrong: l_f and l_r [m], I_z/m [m²]."""

    l_f: float
    l_r: float
    inertia: float

    @classmethod
    def of(cls, vehicle: Vehicle, sizes: Sizes) -> "Car":
        """Return it."""
        back = sizes.get("center_of_gravity", 0.0)
        per_mass = vehicle.yaw_inertia / vehicle.mass
        return cls(
            vehicle.l_f - back,
            vehicle.l_r + back,
            per_mass * math.exp(-sizes.get("yaw_inertia", 0.0)),
        )


class Balance:
    """The equations of a drive, or of some stretches of it."""

    def __init__(self, stretches: tuple[Recording, ...], vehicle: Vehicle) -> None:
        self.vehicle = vehicle
        dt = stretches[0].dt
        self.white = {
            name: float(np.median([noise_in_means(getattr(one, name)) for one in stretches]))
            for name in CHANNELS
            if getattr(stretches[0], name) is not None
        }
        self.names = list(self.white)
        self.length = window_length(stretches, vehicle, self.white)
        every = max(1, round(STEP * self.length / dt))
        half = max(1, round(SMOOTHED * self.length / dt))
        self.dt = every * dt
        self.margin = round(MARGIN / self.dt) + 1
        smooth = {
            name: [thinned(getattr(one, name), half, dt, every) for one in stretches]
            for name in self.names
        }
        sizes = [one.value.size for one in smooth["v_x"]]
        ends = np.cumsum(sizes)
        inside = [
            np.arange(end - size + self.margin, end - self.margin)
            for size, end in zip(sizes, ends, strict=True)
        ]
        self.at = np.concatenate(inside)
        self.signals = {
            name: Smooth(*(np.concatenate(one) for one in zip(*pieces, strict=True)))
            for name, pieces in smooth.items()
        }
        self.as_logged = {
            name: (one.value[self.at], one.slope[self.at]) for name, one in self.signals.items()
        }
        clock = np.concatenate([one.t[::every] for one in stretches])[self.at]
        share = (clock - clock[0]) / max(clock[-1] - clock[0], 1e-9)
        self.banks = np.cos(math.pi * np.outer(share, np.arange(BANKS)))
        sway = max(2, round(SWAYED * self.length / self.dt))
        self._make_windows([one.size for one in inside], sway)
        bell = np.hanning(2 * sway + 1)
        self.jerk = np.gradient(np.pad(bell / bell.sum(), 1), self.dt)
        self.jolt = np.gradient(np.pad(self.jerk, 1), self.dt)
        self.norms = self._norms(half, every)
        self.motion = lru_cache(RECENT)(self._motion)
        self.forces = lru_cache(RECENT)(self._forces)
        self.part = lru_cache(len(NOT_OF_PART) * RECENT)(self._part)
        self.allowed, self.size = np.ones((len(self), 3)), np.ones(2)
        if len(self):
            self.allowed, self.size = self._allowed()

    def __len__(self) -> int:
        """Return how many windows there are."""
        return int(self.starts.size)

    @property
    def has_accelerometer(self) -> bool:
        """Whether kinematics can be asked."""
        return "a_y" in self.names

    @property
    def independent(self) -> float:
        """How many windows there are of which none overlaps another."""
        return len(self) / OVERLAP

    def _make_windows(self, lengths: list[int], sway: int) -> None:
        """Place windows in which the car drives, and none across two stretches."""
        length = max(6, round(self.length / self.dt))
        stride = max(1, length // OVERLAP)
        places, begin = [], 0
        for n in lengths:
            places.append(begin + np.arange(sway, max(n - sway - length, sway), stride))
            begin += n
        starts = np.concatenate(places)
        slow = self.signals["v_x"].value[self.at] < BRISK * self.vehicle.froude_speed
        total = np.concatenate([[0], np.cumsum(slow)])
        self.starts = starts[total[starts + length] == total[starts]]
        psi = np.hanning(length)  # zero at its ends, so that sums by parts are exact
        self.psi = psi / psi.sum()
        self.psi_dot = np.gradient(np.pad(self.psi, 1), self.dt)[1:-1]
        under = self.starts[:, None] + np.arange(length)
        self.mean, self.rate = (Windows(under, one) for one in (self.psi, -self.psi_dot))
        self.curved: dict[int, NDArray[np.bool_]] = {}  # which weights of a curve were not zero

    def _norms(self, half: int, every: int) -> tuple[float, float]:
        """Return the power that smoothing and ψ, or ψ̇, leave of white noise of every sample."""
        bell = window(half)
        powers = []
        for kernel in (self.psi, self.psi_dot):
            spread = np.zeros(every * (kernel.size - 1) + 1)
            spread[::every] = kernel
            whole = np.convolve(spread, bell)
            powers.append(float(whole @ whole))
        return powers[0], powers[1]

    # The equations.

    def channels(self, sizes: Sizes) -> dict[str, Array]:
        """Return the channels without the faults, (n,) each."""
        get, out = sizes.get, {}
        for name in self.names:
            factor = math.exp(-get(f"factor.{name}", 0.0))
            value, slope = self.as_logged[name]
            delay = get(f"delay.{name}", 0.0)
            if name in ("r", "a_y"):
                delay += get("delay.r+a_y", 0.0)
            if delay:
                value, slope = self._later(self.signals[name], delay)
            lag = get(f"lag.{name}", 0.0)
            if name != "v_y" or lag < 0.0:
                value = value + lag * slope
            out[name] = factor * value - get(f"offset.{name}", 0.0)
        # The noise of v_y counts most: where v_y lags, the others are made to lag, not it to lead.
        if (lag := get("lag.v_y", 0.0)) > 0.0:
            out = {
                name: x if name == "v_y" else low_passed(x, lag, self.dt) for name, x in out.items()
            }
        angle = get("velocity_sensor_angle", 0.0)
        c, s = math.cos(angle), math.sin(angle)
        v_x, v_y = out["v_x"], out["v_y"]
        out["v_x"] = np.maximum(c * v_x - s * v_y, 0.3 * self.vehicle.froude_speed)
        out["v_y"] = c * v_y + s * v_x - get("velocity_sensor_x", 0.0) * out["r"]
        if swung := get("velocity_sensor_z", 0.0):
            usual = {"roll_delay": NUISANCES["roll_delay"][0] * grown("time", self.vehicle)}
            out["v_y"] = out["v_y"] + swung * self._as_it_rolls(self._a_y_dot(out), usual)
        return out

    def _a_y_dot(self, x: Mapping[str, Array]) -> Array:
        """Return the change of what makes the body roll [m/s³], (n,)."""
        changes: Array = np.convolve(x["v_y"], self.jolt, "same")
        return changes + np.convolve(x["v_x"] * x["r"], self.jerk, "same")

    def _later(self, signal: Smooth, delay: float) -> tuple[Array, Array]:
        """Return value and slope of a channel at t + delay, by cubics between samples."""
        most = self.margin - 1
        ahead = min(max(delay / self.dt, -most), most - 1e-9)
        k = math.floor(ahead)
        f, a, b = ahead - k, self.at + k, self.at + k + 1
        value, slope, bend, h = signal.value, signal.slope, signal.bend, self.dt
        return (
            cubic(value[a], value[b], slope[a], slope[b], f, h),
            cubic(slope[a], slope[b], bend[a], bend[b], f, h),
        )

    def _bank(self, sizes: Sizes) -> Array:
        """Return sin β (n,)."""
        if "bank.0" not in sizes:
            return np.zeros(self.at.size)
        swings = np.array([sizes.get(f"bank.{k}", 0.0) for k in range(BANKS)])
        return np.asarray(np.sin(self.banks @ swings), dtype=np.float64)

    def _force(self, x: Mapping[str, Array], car: Car, bank: Array) -> Array:
        """Return mean forces that the motion shows [static axle loads], (m, 2)."""
        g = GRAVITY
        rates = self.rate @ np.column_stack([x["v_y"], x["r"]])
        lateral = rates[:, 0] / g + self.mean @ (x["v_x"] * x["r"] / g - bank)
        yaw = car.inertia * rates[:, 1] / g
        return np.column_stack([lateral + yaw / car.l_r, lateral - yaw / car.l_f])

    def _slip(self, motion: Motion, axle: int, car: Car, sizes: Sizes) -> Array:
        """Return slip angles of an axle as force follows them [rad], (n,)."""
        x = motion.channels
        swayed = self._as_it_rolls(motion.a_y_dot, sizes)
        sideways = x["v_y"] + sizes.get("sway", 0.0) * swayed
        arm = (car.l_f, -car.l_r)[axle]
        slip = x[STEERING[axle]] - np.arctan((sideways + arm * x["r"]) / x["v_x"])
        length = max(sizes.get(RELAXATION[axle], 0.0), 0.0) * self.vehicle.wheelbase
        followed: Array = np.interp(motion.rolled - length, motion.rolled, slip)
        return followed

    def _as_it_rolls(self, signal: Array, sizes: Sizes) -> Array:
        """Return what the roll of the body follows as late as the body does, (n,)."""
        later = max(sizes.get("roll_delay", 0.0), 0.0)
        steps = np.arange(self.at.size) * self.dt
        followed: Array = np.interp(steps - later, steps, signal)
        return followed

    def residual(self, sizes: Sizes) -> Residual:
        """Return what the equations miss."""
        parts = (FRONT, REAR, KINEMATICS) if self.has_accelerometer else (FRONT, REAR)
        found = [self.part(i, told(sizes, NOT_OF_PART[i])) for i in parts]
        return Residual(tuple(part for part, _ in found), tuple(noise for _, noise in found))

    def _motion(self, of: Told) -> Motion:
        x = self.channels(dict(of))
        v_x = x["v_x"]
        rolled = np.concatenate([[0.0], np.cumsum(0.5 * (v_x[1:] + v_x[:-1]) * self.dt)])
        return Motion(x, self._a_y_dot(x), rolled, self.mean @ v_x)

    def _forces(self, of: Told) -> Array:
        sizes = dict(of)
        x = self.motion(told(sizes, NOT_OF_MOTION)).channels
        return self._force(x, Car.of(self.vehicle, sizes), self._bank(sizes))

    def _part(self, part: int, of: Told) -> tuple[Array, float]:
        """Return what an equation misses (m,), and the mean square that noise leaves in it."""
        sizes = dict(of)
        motion, car = self.motion(told(sizes, NOT_OF_MOTION)), Car.of(self.vehicle, sizes)
        allowed = self.allowed[:, part]
        if part == KINEMATICS:
            missed = self._kinematics(motion.channels, self._bank(sizes), sizes)
            left = self._noise(part, sizes, car, motion.v_x, motion.v_x)
            return missed / allowed, float(np.mean(left / allowed**2))
        y = self.forces(told(sizes, NOT_OF_FORCES))[:, part] / allowed
        slip = self._slip(motion, part, car, sizes)
        x = motion.channels
        kappa = self.vehicle.downforce[part] + sizes.get(DOWNFORCE[part], 0.0)
        pressed = np.maximum(1.0 + kappa * x["v_x"] ** 2, LIGHTEST)
        units = unit_matrix(slip, LADDER) * (pressed * np.cos(x[STEERING[part]]))[:, None]
        basis = (self.mean @ units) / allowed[:, None]
        w = rising(basis, y, self.curved.get(part))
        self.curved[part] = w > 0.0
        # Over the size of the force: to shrink it, by a factor of r, explains nothing.
        size = self.size[part] / max(math.sqrt(float(y @ y) / y.size), 1e-9)
        slope = (1.0 - unit_matrix(self.mean @ slip, LADDER) ** 2) @ (w / np.array(LADDER))
        slope *= self.mean @ pressed
        left = self._noise(part, sizes, car, motion.v_x, slope) / allowed**2
        return (y - basis @ w) * size, float(np.mean(left)) * size**2

    def _kinematics(self, x: Mapping[str, Array], bank: Array, sizes: Sizes) -> Array:
        g, ahead = GRAVITY, sizes.get("acceleration_sensor_x", 0.0)
        rates = self.rate @ np.column_stack([x["v_y"], x["r"]])
        weight = tilted(sizes) * self._as_it_rolls(x["a_y"], sizes)
        means = self.mean @ (x["a_y"] - weight - x["v_x"] * x["r"] + g * bank)
        return np.asarray((means - rates[:, 0] - ahead * rates[:, 1]) / g, dtype=np.float64)

    # Noise. Faults that merely make the noise smaller must not look true.

    def _noise(self, part: int, sizes: Sizes, car: Car, v_x: Array, slope: Array) -> Array:
        """Return the variance that white noise leaves in a part [weights²], (m,).

        Slip is behind by the way of relaxation, ψ(t + τ) = ψ + τ ψ̇: then noise of slip and of
        what is like a derivative have something in common.
        """
        get, g = sizes.get, GRAVITY
        mean, rate = self.norms

        def variance(name: str) -> float:
            return float((self.white[name] * math.exp(-get(f"factor.{name}", 0.0))) ** 2)

        v_y, r, ahead = variance("v_y"), variance("r"), get("velocity_sensor_x", 0.0)
        if part == KINEMATICS:
            yaw = get("acceleration_sensor_x", 0.0) - ahead
            of_r = v_x**2 * mean + yaw**2 * rate
            return np.asarray((v_y * rate + r * of_r + variance("a_y") * mean) / g**2)
        arm = (car.l_f, -car.l_r)[part] - ahead
        yaw = car.inertia / (car.l_r, -car.l_f)[part] - ahead
        per_speed = slope / v_x
        late = max(get(RELAXATION[part], 0.0), 0.0) * self.vehicle.wheelbase / v_x
        of_v_y = rate / g**2 + per_speed**2 * mean - 2.0 * late * per_speed * rate / g
        of_r = rate * (yaw / g) ** 2 + (v_x / g + per_speed * arm) ** 2 * mean
        of_r = of_r - 2.0 * late * per_speed * arm * yaw * rate / g
        return np.asarray(v_y * of_v_y + r * of_r + variance(STEERING[part]) * slope**2 * mean)

    def _allowed(self) -> tuple[Array, Array]:
        """Return what may be missed, noise and share of the force, (m, 3), and rms forces (2,)."""
        x, car = self.channels({}), Car.of(self.vehicle, {})
        force = self._force(x, car, np.zeros(self.at.size))
        v_x = self.mean @ x["v_x"]
        slope = np.full(len(self), TYPICAL)
        parts = (FRONT, REAR, KINEMATICS) if self.has_accelerometer else (FRONT, REAR, REAR)
        noise = np.column_stack([self._noise(i, {}, car, v_x, slope) for i in parts])
        size = np.abs(force)
        share = WANDER * np.column_stack([size, size.mean(axis=1) / 3.0])
        allowed = np.sqrt(noise + share**2 + SMALL**2)
        rms = np.sqrt(np.mean((force / allowed[:, :2]) ** 2, axis=0))
        return allowed, rms


def tilted(sizes: Sizes) -> float:
    """Return ρ, the share of a_y that is weight as the body rolls: from 0 to its most, smoothly.

    Parameters
    ----------
    sizes : by key; without a tilt there is none.
    """
    if "tilt" not in sizes:
        return 0.0
    return 0.5 * MOST_TILT * (1.0 + sizes["tilt"] / math.hypot(1.0, sizes["tilt"]))


def told(sizes: Sizes, without: frozenset[str]) -> Told:
    """Return the sizes that matter."""
    return tuple(one for one in sizes.items() if one[0] not in without)


def rising(basis: Array, y: Array, guess: NDArray[np.bool_] | None = None) -> Array:
    """Return weights of least squares, none negative: a curve that rises ever less (k,).

    Without that an odd curve can pass through zero at some slip, and hide an offset of it.

    Parameters
    ----------
    basis : (m, k).
    y : (m,).
    guess : which weights are rather not zero (k,).
    """
    gram = basis.T @ basis
    k = gram.shape[0]
    ridge = RIDGE * np.trace(gram) / k + 1e-12
    return not_negative(gram + ridge * np.eye(k), basis.T @ y, guess)


# Signals.


def thinned(signal: Array, half: int, dt: float, every: int) -> Smooth:
    """Return a channel without its fastest noise, and thinned.

    Parameters
    ----------
    signal : samples (n,).
    dt : sampling interval [s].
    """
    value = smoothed(signal, half)
    slope = np.gradient(value, dt)
    bend = np.gradient(slope, dt)
    return Smooth(*(one[::every].copy() for one in (value, slope, bend)))


def cubic(a: Array, b: Array, slope_a: Array, slope_b: Array, share: float, step: float) -> Array:
    """Return Hermite's cubic between samples.

    Parameters
    ----------
    a, b : values at both ends (n,).
    slope_a, slope_b : slopes there (n,).
    """
    f, e = share, 1.0 - share
    inside: Array = (
        e * e * (1.0 + 2.0 * f) * a
        + f * f * (1.0 + 2.0 * e) * b
        + step * f * e * (e * slope_a - f * slope_b)
    )
    return inside


def window_length(
    stretches: tuple[Recording, ...], vehicle: Vehicle, white: Mapping[str, float]
) -> float:
    """Return how long ψ is [s]: short against the swings of the drive, but not full of noise.

    White noise s of every sample leaves s² dt ∫ψ̇² = s² dt 2π²/T³ of a derivative.
    """
    time, dt = vehicle.froude_time, stretches[0].dt
    half = max(1, round(0.3 * time / dt))
    smooth = [thinned(one.r - np.mean(one.r), half, dt, 1) for one in stretches]
    turning = math.sqrt(sum(float(one.value @ one.value) for one in smooth))
    changing = math.sqrt(sum(float(one.slope @ one.slope) for one in smooth))
    period = 2.0 * math.pi * turning / max(changing, 1e-9)
    period = float(np.clip(period, FASTEST * time, SLOWEST * time))
    sideways = np.concatenate([one.v_x * one.r for one in stretches]) / GRAVITY
    wanted = QUIET * math.hypot(SMALL, WANDER * math.sqrt(float(np.mean(sideways**2))))
    arm = vehicle.yaw_inertia / vehicle.mass / min(vehicle.l_f, vehicle.l_r)
    noise = math.hypot(white["v_y"], arm * white["r"]) / GRAVITY
    quiet = float(np.cbrt(2.0 * math.pi**2 * dt * (noise / wanted) ** 2))
    return min(max(quiet, SHORT * period), LONG * period)
