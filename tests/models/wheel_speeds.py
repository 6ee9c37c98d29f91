"""Wheel speeds of the plant, which has no turning wheels: its exact motion, and slip on it.

Slip follows the longitudinal forces as a brush does, plus what the plant has none of: wheels that
spin under power, and wheels that an anti-lock brake lets dive and come back.
"""

import numpy as np

CORNERS = ("wheel_fl", "wheel_fr", "wheel_rl", "wheel_rr")
SLIP_STIFFNESS = 20.0  # force over load per slip [-]


def rolling(run):
    """Speeds at which the wheels of a run would roll without slip [m/s], (n, 4): FL FR RL RR."""
    car, chassis = run.vehicle, run.vehicle.chassis
    found = []
    for front, side in ((1, 1), (1, -1), (0, 1), (0, -1)):
        x = car.l_f if front else -car.l_r
        y = 0.5 * side * (chassis.track_front if front else chassis.track_rear)
        angle = run.delta_f if front else run.delta_r
        place = np.array([x, y])
        velocity = np.array([run.v_x - run.r * place[1], run.v_y + run.r * place[0]])
        found.append(velocity[0] * np.cos(angle) + velocity[1] * np.sin(angle))
    return np.column_stack(found)


def gentle_slip(run):
    """Slip by the longitudinal force of each wheel [-], (n, 4)."""
    return run.F_x / (SLIP_STIFFNESS * run.F_z)


def spin(t, begin, lasts, size, rise=0.15):
    """Slip of a wheel that spins from a time on [-], (n,): it rises and falls in `rise` s."""
    up = np.clip((t - begin) / rise, 0.0, 1.0)
    down = np.clip((begin + lasts - t) / rise, 0.0, 1.0)
    return size * np.minimum(up, down)


def anti_lock(t, begin, lasts, frequency=7.0, phase=0.0):
    """Slip of a wheel that is braked at the limit [-], (n,): it dives and comes back."""
    braked = (t >= begin) & (t < begin + lasts)
    dive = 0.5 - 0.5 * np.cos(2.0 * np.pi * (frequency * (t - begin) + phase))
    return -0.3 * braked * dive**2


def shown(run, slip, rng=None, noise=0.02):
    """What the wheels show [m/s], by name: rolling times one more than their slip, and noise."""
    speeds = rolling(run) * (1.0 + slip)
    if rng is not None:
        speeds = speeds + noise * rng.standard_normal(speeds.shape)
    return dict(zip(CORNERS, speeds.T, strict=True))
