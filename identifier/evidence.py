"""What a model's forces explain of the measured motion, axle by axle, without a true force.

φ = F/F_z [static axle loads], rows front and rear.   ξ_i = v_y/g ± I_z r/(L F_z,i), the impulse of
the axle over its load, obeys dξ_i/dt = φ_i cos δ_i - v_x r/g: in means over a window of T seconds
φ̄_i = [ξ_i(t + T) - ξ_i(t)]/T + mean(v_x r)/g is measured, without a derivative and without a tire.
Means of what a model says over the same windows are set beside it.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from codegen.arrays import Array, root_mean_square
from identifier.axle.car import Car, axle_impulse, car_numbers
from identifier.estimate.drive import Drive
from identifier.tire_model import TireModel
from models.recordings import Recording
from models.recordings.evidence import Windows
from models.recordings.samples import white_noise
from models.vehicle import GRAVITY, Vehicle

WINDOW = 0.3  # T [s]: shorter ones show the noise of the sensors, longer ones no transient
BRISK = 0.6  # speed in sqrt(g L) from which a window counts; slower, slip angles mean little
FEWEST = 8  # windows, below which nothing can be said
_SEGMENT = 0.3  # share of the windows that may be missed in one piece
_REST_ERROR = 0.08  # of the force elsewhere, where a piece is missed
_CONFINED = 0.6  # of what is missed with that piece, what the rest may miss
_MOMENT = 0.2  # s, over which both are meant


def brisk_windows(recording: Recording, min_speed: float) -> Windows:
    """Return windows of 0.3 s, half-overlapping, where a car is never slower than a speed [m/s]."""
    return Windows.where(recording.v_x >= min_speed, recording, WINDOW)


def measured_force(
    recording: Recording, vehicle: Vehicle, windows: Windows, road: Array | None = None
) -> Array:
    """Return mean axle forces that the motion shows [static axle loads], (m, 2).
    recording : v_x, v_y and r; where no v_y was logged, a_y and r.
    road : what a banked road pushes to the left at each sample, taken off [weights], (n,); without
        v_y what the accelerometer shows beside forces; None where nobody knows of it.
    """
    impulse, sideways = impulse_signals(recording, vehicle, road)
    return windows.rate(impulse) + windows.mean(sideways)[:, None]


def impulse_signals(
    recording: Recording, vehicle: Vehicle, road: Array | None = None
) -> tuple[Array, Array]:
    """Return ξ (n, 2) [s] and v_x r/g without the road (n,): φ cos δ = dξ/dt + v_x r/g."""
    car = Car(*car_numbers(vehicle).T)
    v_y = recording.logged_v_y
    still = np.zeros(len(recording)) if v_y is None else v_y
    impulse = axle_impulse(car, still[:, None], recording.r[:, None])
    sideways = recording.needed("a_y") if v_y is None else recording.v_x * recording.r
    return impulse, sideways / GRAVITY - (0.0 if road is None else road)


def modelled_force(model: TireModel, recording: Recording, windows: Windows) -> Array:
    """Return mean axle forces of a model over the same windows [static axle loads], (m, 2)."""
    return windows.mean(model.predict(recording) / model.vehicle.axle_loads)


def noise_variance(recording: Recording, vehicle: Vehicle, windows: Windows) -> Array:
    """Return the variance that white noise of v_y and r leaves in `measured_force`, (2,)."""
    turning = (car_numbers(vehicle)[:, 2] * white_noise(recording.r)) ** 2
    v_y = recording.logged_v_y
    lateral = 0.0 if v_y is None else white_noise(v_y) / GRAVITY
    variance = 2.0 * (lateral**2 + turning) / windows.duration**2
    if v_y is None:
        variance += (white_noise(recording.needed("a_y")) / GRAVITY) ** 2 / windows.n
    return variance


def lateral_noise(recording: Recording, windows: Windows) -> float:
    """Return the variance that white noise leaves in means of v̇_y + v_x r [m²/s⁴]."""
    turning = float(np.mean(recording.v_x**2)) * white_noise(recording.r) ** 2 / windows.n
    return 2.0 * (white_noise(recording.needed("v_y")) / windows.duration) ** 2 + turning


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """Measured and modelled mean forces over the windows of a drive.
    measured, modelled : [static axle loads], (m, 2).
    noise : variance of white sensor noise in `measured` (2,).
    predicted : the model's axle forces at each sample of the drive [N], (n, 2).
    """

    windows: Windows
    measured: Array
    modelled: Array
    noise: Array
    predicted: Array

    @property
    def force(self) -> Array:
        """Force that was there to learn from, noise taken off: rms [static axle loads], (2,)."""
        return clean_rms(self.measured, self.noise)

    @property
    def peak(self) -> Array:
        """Force that 2 % of the windows exceed, three sigma of noise taken off, (2,)."""
        largest = np.percentile(np.abs(self.measured), 98.0, axis=0)
        return np.maximum(largest - 3.0 * np.sqrt(self.noise), 0.0)

    @property
    def model_error(self) -> Array:
        """Share of the measured force that is not explained, noise taken off, (2,); else one."""
        size = np.sqrt(np.mean(self.measured**2, axis=0))
        rms = clean_rms(self.measured - self.modelled, self.noise)
        return np.divide(rms, size, out=np.ones(2), where=size > 0.0)

    def worst(self, n: int) -> Array:
        """Return the largest of that share over `n` windows that follow each other, (2,)."""
        size = np.maximum(np.mean(self.measured**2, axis=0), 1e-12)
        missed = ((self.measured - self.modelled) ** 2 - self.noise) / size
        total, n = np.cumsum(np.vstack([np.zeros(2), missed]), axis=0), min(n, len(missed))
        return np.sqrt(np.maximum((total[n:] - total[:-n]).max(axis=0) / n, 0.0))

    def where(self, kept: NDArray[np.bool_]) -> "Evidence":
        """Return the evidence of some of the windows (m,)."""
        return replace(
            self,
            windows=replace(self.windows, starts=self.windows.starts[kept]),
            measured=self.measured[kept],
            modelled=self.modelled[kept],
        )

    def but_a_segment(self) -> "tuple[Evidence, tuple[int, int] | None]":
        """Return what a model is judged by, and which windows are left out of it: first, past last.

        One segment may be missed, as before a sensor has settled, where all the rest is explained:
        it is left out. None is where all is explained, or more than one segment is missed.
        """
        if (self.model_error <= _REST_ERROR).all():
            return self, None
        n = max(1, int(_SEGMENT * len(self.windows)))
        size = np.maximum(np.mean(self.measured**2, axis=0), 1e-12)
        residual = np.sum((self.measured - self.modelled) ** 2 / size, axis=1)
        total = np.append(0.0, np.cumsum(residual))
        first = int(np.argmax(total[n:] - total[:-n]))
        last = first + n
        place = np.arange(len(self.windows))
        rest = self.where((place < first) | (place >= last))
        most = min(_REST_ERROR, _CONFINED * float(self.model_error.max()))
        confined = (rest.model_error <= most).all()
        if len(rest.windows) >= FEWEST and confined:
            return rest, (first, last)
        return self, None


def clean_rms(signal: Array, noise: Array) -> Array:
    """Return the root mean square of a signal whose noise has a known variance, (2,).
    signal : (m, 2).   noise : its variance (2,).
    """
    return np.sqrt(np.maximum(np.mean(signal**2, axis=0) - noise, 0.0))


def brisk_from(model: TireModel) -> float:
    """Return the speed [m/s] from which a window counts."""
    return max(model.min_speed, BRISK * model.vehicle.froude_speed)


def evidence(model: TireModel, recording: Recording, road: Array | None = None) -> Evidence | None:
    """Return what a model explains of a drive; None where too little of it is driven."""
    vehicle = model.vehicle
    windows = brisk_windows(recording, brisk_from(model))
    if len(windows) < FEWEST:
        return None
    predicted = model.predict(recording)
    return Evidence(
        windows=windows,
        measured=measured_force(recording, vehicle, windows, road),
        modelled=windows.mean(predicted / vehicle.axle_loads),
        noise=noise_variance(recording, vehicle, windows),
        predicted=predicted,
    )


def road_push(recording: Recording, model: TireModel) -> Array | None:
    """Return what a banked road pushes to the left, by the accelerometer (n,) [weights].

    Where no v_y was logged, what the accelerometer shows beside forces; None where nobody tells.
    """
    if recording.a_y is None:
        return None
    if recording.logged_v_y is None:
        found = model.estimated_v_y(recording.as_logged())
        return None if found is None else found.beside
    return Drive.of(recording, model.vehicle, replay=True).signals[:, 6] / GRAVITY


# A frozen model against measured motion, without true forces: the mean of (F_f + F_r)/m is the
# lateral acceleration, that of (l_f F_f - l_r F_r)/I_z the yaw acceleration.


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionError:
    """What forces miss of the measured motion, root mean square of means over `_MOMENT`.

    The noise of the sensors, another mass or inertia and a banked road are in it too: where it is
    small the forces are right, where it is large they need not be wrong.
    lateral, yaw : missed of the lateral [m/s²] and the yaw acceleration [rad/s²].
    """

    lateral: float
    yaw: float
    lateral_rms: float
    yaw_rms: float

    @property
    def explained(self) -> tuple[float | None, float | None]:
        """Share of the mean square of both that the forces explain; None where it stands still."""
        pairs = (self.lateral, self.lateral_rms), (self.yaw, self.yaw_rms)
        lateral, yaw = (1.0 - (e / size) ** 2 if size > 0.0 else None for e, size in pairs)
        return lateral, yaw


def motion_error(
    force: Array, recording: Recording, vehicle: Vehicle, counted: NDArray[np.bool_]
) -> MotionError | None:
    """Return what axle forces miss of the measured motion; None where no window counts.
    force : lateral axle forces (n, 2) [N], frame of the body.
    counted : samples that count (n,); a window counts where all of its samples do, in one segment.
    """
    windows = Windows.where(counted, recording, _MOMENT, 1)
    if not len(windows):
        return None
    m, I_z, l_f, l_r = vehicle.bicycle[:4]
    v_y = recording.logged_v_y
    if v_y is None:
        a_y = windows.mean(recording.needed("a_y"))
    else:
        a_y = windows.rate(v_y) + windows.mean(recording.v_x * recording.r)
    r_dot = windows.rate(recording.r)
    with np.errstate(over="ignore", invalid="ignore"):  # of a law that diverged
        F = windows.mean(force)
        residual = a_y - F.sum(axis=1) / m, r_dot - (l_f * F[:, 0] - l_r * F[:, 1]) / I_z
        lateral, yaw, *sizes = map(root_mean_square, (*residual, a_y, r_dot))
    return MotionError(lateral=lateral, yaw=yaw, lateral_rms=sizes[0], yaw_rms=sizes[1])
