"""Steady cornering on saturated tires: every signal is constant, and so is the regressor."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from benchmarks.random_drives import FORCE_UNIT, random_vehicle
from codegen.arrays import Array
from identifier.paper.design import PaperIdentifier
from identifier.paper.network import Weights
from identifier.stability.loop import regressor_gains
from models.recordings import Recording
from models.vehicle import GRAVITY, Vehicle


class Corner(NamedTuple):
    """A car in a steady corner: its recording, and x_bar of a network (n_in,)."""

    vehicle: Vehicle
    recording: Recording


def jacobian_feedback(*, W: ArrayLike, V_x: ArrayLike, s: ArrayLike, K: ArrayLike) -> Array:
    """J_f K = W (I - Λ) V_x K of the present network [1/s], (2, 2).

    Parameters
    ----------
    W : (2, n_h) output weights, force unit U.
    V_x : (n_h, 2) d(V x_bar)/dx, with the scales of the input in it [s/m, s/rad].
    s : (n_h,) hidden units.
    K : (2, 2) of (6) for forces in U.
    """
    W, V_x, s, K = np.asarray(W), np.asarray(V_x), np.asarray(s), np.asarray(K)
    feedback: Array = (W * (1.0 - s**2)) @ V_x @ K
    return feedback


def random_corner(rng: np.random.Generator, *, duration: float, dt: float = 0.01) -> Corner:
    """Return a random car that corners at 80 to 98 % of its friction.

    Parameters
    ----------
    rng : source of randomness.
    duration : [s].
    dt : sampling interval [s].
    """
    vehicle = random_vehicle(rng)
    friction, share, speed = rng.uniform(0.4, 1.0), rng.uniform(0.8, 0.98), rng.uniform(15.0, 30.0)
    load = vehicle.mass * GRAVITY / vehicle.wheelbase
    peaks = friction * load * np.array([vehicle.l_r, vehicle.l_f])
    stiffness = np.array([vehicle.cornering_stiffness_front, vehicle.cornering_stiffness_rear])
    alpha = 1.5 * peaks / stiffness * math.tan(math.asin(share) / 1.5)
    r = share * friction * GRAVITY / speed
    v_y = vehicle.l_r * r - speed * alpha[1]
    delta_f = alpha[0] + (v_y + vehicle.l_f * r) / speed
    n = round(duration / dt)
    recording = Recording(
        name="steady corner",
        t=np.arange(n, dtype=np.float64) * dt,
        v_x=np.full(n, speed),
        v_y=np.full(n, v_y),
        r=np.full(n, r),
        delta_f=np.full(n, delta_f),
        delta_r=np.zeros(n),
    )
    return Corner(vehicle, recording)


def network_input(corner: Corner, design: PaperIdentifier) -> Array:
    """Return x_bar of the network [v_y, r, delta_f, delta_r], (4,).

    Parameters
    ----------
    corner : gives the signals.
    design : gives the scales.
    """
    signals = np.concatenate([corner.recording.x[0], corner.recording.u[0]])
    scaled: Array = signals / np.array(design.network.scale)
    return scaled


def loop_at(corner: Corner, design: PaperIdentifier, weights: Weights) -> tuple[Array, Array]:
    """Return G (2, 2) of the design at these weights, and J_f K (2, 2) [1/s].

    Parameters
    ----------
    corner : gives the regressor.
    design : gives gains and scales.
    weights : of the network.
    """
    x_bar = network_input(corner, design)
    s = np.tanh(weights.V @ x_bar)
    gains = design.gains
    G = regressor_gains(eta_W=gains.eta_W, eta_V=gains.eta_V, s=s, x_bar=x_bar, W=weights.W)[0]
    car = corner.vehicle
    K = FORCE_UNIT * np.array(
        [
            [1.0 / car.mass, 1.0 / car.mass],
            [car.l_f / car.yaw_inertia, -car.l_r / car.yaw_inertia],
        ]
    )
    V_x = weights.V[:, :2] / np.array(design.network.scale)[:2]
    return G, jacobian_feedback(W=weights.W, V_x=V_x, s=s, K=K)
