"""Random smooth drives of a bicycle on saturating tires, many at once in compiled code.

The tire is F = μ F_z sin(1.5 atan(C α/(1.5 μ F_z))): the stiffness that the vehicle states, and the
friction limit. The residual f that the identifier sees of a drive is known exactly:
(ξ_{k+1} - ξ_k)/dt - A_ξ ξ_k - B_ξ u_k.
"""

from functools import cache
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from codegen import BatchScan
from models.bicycle import BicycleParameters, bicycle, slip_angles
from models.vehicle import GRAVITY, Vehicle

Array = NDArray[np.float64]
SUBSTEPS = 10  # of the plant in a sample
HARD = (0.6, 1.3)  # lateral acceleration that is asked of the linear car, over friction x g
UNDERSTEER = 0.05  # rad/g, up to which steering makes up for it
SPEED_SHARE = 0.05  # of the speed, by which it swings


class Drives(NamedTuple):
    """Drives of n samples: v_x (N, n) [m/s], x = [v_y, r] and u = [δ_f, δ_r] (N, n, 2), SI."""

    v_x: Array
    x: Array
    u: Array


def smooth_steering(rng: np.random.Generator, t: Array, *, highest: float, peak: float) -> Array:
    """Return a sum of sines up to a frequency, faded in, (n, 2) [rad]; both axles may steer.

    Parameters
    ----------
    rng : source of randomness.
    t : times [s].
    highest : largest frequency [Hz].
    peak : largest angle of the front axle [rad].
    """
    frequencies = rng.uniform(0.05, highest, 6)
    sines = np.sin(2 * np.pi * np.outer(t, frequencies) + rng.uniform(0, 2 * np.pi, 6))
    wave = sines @ rng.standard_normal(6) * np.clip(t, 0.0, 1.0) ** 2
    rear = rng.choice([0.0, rng.uniform(-0.15, 0.15)])
    angles: Array = peak * np.column_stack([wave, rear * wave]) / np.abs(wave).max()
    return angles


def random_drives(
    vehicle: Vehicle,
    rng: np.random.Generator,
    count: int,
    *,
    v_x: float,
    friction: float,
    bandwidth: float,
    duration: float,
    dt: float,
) -> Drives:
    """Return drives straight from rest in the car's frame (v_y = r = 0), some beyond its limits.

    Parameters
    ----------
    vehicle : the car.
    rng : source of randomness.
    count : number of drives N.
    v_x : speed [m/s], about which it swings.
    friction : largest friction of the road; each drive has one from 0.3 times that on.
    bandwidth : highest frequency of steering [Hz].
    duration : of a drive [s].
    dt : sampling interval [s].
    """
    n = round(duration / dt)
    t: Array = np.arange(n, dtype=np.float64) * dt
    road = friction * rng.uniform(0.3, 1.0, count)
    lateral = road * GRAVITY * rng.uniform(*HARD, count)
    peak = vehicle.wheelbase * lateral / v_x**2
    peak = peak + lateral / GRAVITY * rng.uniform(0.0, UNDERSTEER, count)
    highest = bandwidth * rng.uniform(0.3, 1.0, count)
    u = np.array(
        [smooth_steering(rng, t, highest=h, peak=p) for h, p in zip(highest, peak, strict=True)]
    )
    swing = np.sin(2 * np.pi * np.outer(rng.uniform(0.05, 0.1, count), t))
    speed = v_x * (1.0 + SPEED_SHARE * swing)
    record = _plant()(
        n,
        {
            "x": np.zeros((count, 2)),
            "u": u,
            "u_ahead": np.concatenate([u[:, 1:], u[:, -1:]], axis=1),
            "v_x": speed[:, :, None],
            "vehicle": np.array(vehicle.bicycle),
            "road": np.column_stack([road, np.full(count, dt)]),
        },
        keep=range(n),
    )
    return Drives(speed, record["x"], u)


def residuals(vehicle: Vehicle, drives: Drives, dt: float) -> Array:
    """Return what the samples show of f, (N, n - 1, 2) [N].

    Parameters
    ----------
    vehicle : the car, whose linear tire is taken off.
    drives : its drives.
    dt : sampling interval [s].
    """
    model = bicycle(vehicle.bicycle, 1.0)
    K_inv = np.array(ca.DM(model.K_inv))
    v_y, r = drives.x[..., 0], drives.x[..., 1]
    alpha = slips(vehicle, drives)
    linear = alpha * [vehicle.cornering_stiffness_front, vehicle.cornering_stiffness_rear]
    turning = np.stack([-drives.v_x * r, np.zeros_like(v_y)], axis=-1) @ K_inv.T
    known = linear + turning  # A_ξ ξ + B_ξ u of (7)
    found: Array = np.diff(drives.x @ K_inv.T, axis=1) / dt - known[:, :-1]
    return found


def slips(vehicle: Vehicle, drives: Drives) -> Array:
    """Return [α_f, α_r] of (3), small angles, (N, n, 2) [rad].

    Parameters
    ----------
    vehicle : the car.
    drives : its drives.
    """
    lever = np.array([vehicle.l_f, -vehicle.l_r])
    v_y, r = drives.x[..., :1], drives.x[..., 1:]
    angles: Array = drives.u - (v_y + lever * r) / drives.v_x[..., None]
    return angles


@cache
def _plant() -> BatchScan:
    step = saturating_bicycle()
    over = ("u", "u_ahead", "v_x")
    return BatchScan(step, carry=("x",), over=over, lanes_over=("x", *over, "road"))


def _magic(y: Any) -> Any:
    """sin(1.5 atan(y)) = 3 s - 4 s³ with s = sin(atan(y)/2): roots only, which run in lanes."""
    c = 1.0 / ca.sqrt(1.0 + y * y)
    s = y * c / ca.sqrt(2.0 + 2.0 * c)
    return s * (3.0 - 4.0 * s * s)


def saturating_bicycle() -> ca.Function:
    """Return a sample of the bicycle: x (2,), u and u_ahead (2,), v_x, vehicle (6,) -> x_next.

    Its input road = [μ, sampling interval [s]]; the steering moves from u to u_ahead meanwhile.
    """
    x, u, u_ahead, v_x = (
        ca.SX.sym(n, k) for n, k in (("x", 2), ("u", 2), ("u_ahead", 2), ("v_x", 1))
    )
    parameters, road = ca.SX.sym("vehicle", 6), ca.SX.sym("road", 2)
    p = BicycleParameters(*ca.vertsplit(parameters))
    friction, dt = ca.vertsplit(road)
    load = p.m * GRAVITY / (p.l_f + p.l_r)

    def rate(x: Any, u: Any) -> Any:
        alpha = slip_angles(p.l_f, p.l_r, v_x, x, u)
        peak = ca.vertcat(friction * load * p.l_r, friction * load * p.l_f)
        C = ca.vertcat(p.C_f, p.C_r)
        F = peak * _magic(C * alpha / (1.5 * peak))
        return ca.vertcat((F[0] + F[1]) / p.m - v_x * x[1], (p.l_f * F[0] - p.l_r * F[1]) / p.I_z)

    now = x
    for k in range(SUBSTEPS):
        h = dt / SUBSTEPS
        here = u + (k + 0.5) / SUBSTEPS * (u_ahead - u)
        middle = now + h / 2 * rate(now, here)
        now = now + h * rate(middle, here)
    return ca.Function(
        "saturating_bicycle",
        [x, u, u_ahead, v_x, parameters, road],
        [now],
        ["x", "u", "u_ahead", "v_x", "vehicle", "road"],
        ["x_next"],
    )
