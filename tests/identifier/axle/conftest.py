"""What sensors show that break, as the signals of a recording that they replace."""

from dataclasses import replace

import numpy as np

SIZES = {"v_y": 5.0, "r": 1.5, "delta_f": 0.5}  # of spikes: m/s, rad/s, rad


def spikes(log, rng):
    shown = {name: getattr(log, name).copy() for name in SIZES}
    for k in rng.integers(100, 1400, 15):
        name = rng.choice(list(SIZES))
        shown[name][k] += rng.choice([-1, 1]) * SIZES[name]
    return shown


def dropouts(log, rng):
    gone = np.zeros(len(log), dtype=bool)
    for k in rng.integers(100, 1400, 8):
        gone[k : k + rng.integers(5, 80)] = True
    return {name: np.where(gone, 0.0, getattr(log, name)) for name in ("v_x", *SIZES)}


def stuck(log, rng):
    shown = np.arange(len(log))
    for k in rng.integers(100, 1400, 8):
        shown[k : k + 60] = k
    return {name: getattr(log, name)[shown] for name in SIZES}


def stuck_yaw_rate(log, rng):
    held = log.r[300] + 1e-9 * rng.standard_normal(len(log))
    return {"r": np.where(np.arange(len(log)) < 300, log.r, held)}


def wandering_gains(log, rng):
    steps = 0.1 * rng.standard_normal((3, len(log)))
    return {
        name: getattr(log, name) * gain
        for name, gain in zip(SIZES, np.cumsum(steps, axis=1), strict=True)
    }


def noise(log, rng, v_y, r):
    """Noise of v_y [m/s] and r [rad/s] of these sizes."""
    return {"v_y": v_y * rng.standard_normal(len(log)), "r": r * rng.standard_normal(len(log))}


def for_a_while(log, shown, otherwise):
    return np.where((log.t >= 5.0) & (log.t < 9.0), shown, otherwise)


HOSTILE = {
    "spikes": spikes,
    "dropouts": dropouts,
    "stuck": stuck,
    "standstill": lambda log, rng: {
        "v_x": for_a_while(log, 0.0, log.v_x),
        "v_y": for_a_while(log, 0.02 * rng.standard_normal(len(log)), log.v_y),
    },
    "backwards": lambda log, _: {"v_x": for_a_while(log, -log.v_x, log.v_x)},
    "huge": lambda log, _: {
        "v_y": np.where(log.t < 7.0, log.v_y, 1e4),
        "r": np.where(log.t < 8.0, log.r, -1e4),
    },
    "chattering": lambda log, rng: {
        name: getattr(log, name) + added for name, added in noise(log, rng, 1.0, 1.0).items()
    },
    "noise_of_thousands": lambda log, rng: {
        name: rng.uniform(-9e3, 9e3, len(log)) for name in ("v_y", "r")
    },
    "noise_within_the_gate": lambda log, rng: noise(log, rng, 1.0, 0.3),
    "noise_of_a_dead_yaw_rate": lambda log, rng: {"r": noise(log, rng, 0.0, 1e-4)["r"]},
    "dead_yaw_rate": lambda log, _: {"r": 0.0 * log.r},
    "stuck_yaw_rate": stuck_yaw_rate,
    "flipped_yaw_rate": lambda log, _: {"r": -log.r},
    "threefold_yaw_rate": lambda log, _: {"r": 3.0 * log.r},
    "late_yaw_rate": lambda log, _: {"r": np.roll(log.r, 60)},
    "flipped_v_y": lambda log, _: {"v_y": -log.v_y},
    "constant_v_y": lambda log, _: {"v_y": np.ones(len(log))},
    "flipped_steering": lambda log, _: {"delta_f": -log.delta_f},
    "dead_steering": lambda log, _: {"delta_f": 0.0 * log.delta_f},
    "wandering_gains": wandering_gains,
}


def spoilt(log, fault):
    """The recording as sensors show it that break in one of these ways."""
    return replace(log, **HOSTILE[fault](log, np.random.default_rng(0)))
