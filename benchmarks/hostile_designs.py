"""Random designs about the border of what a certificate allows, and drives that try to break them.

Designs are plain numbers, drawn without any help of the identifier: another version of the
certificate can be asked about exactly the same ones.
"""

from typing import Any, NamedTuple

import numpy as np

from benchmarks.random_drives import random_vehicle
from models.vehicle import Vehicle

LAWS, INTEGRATORS = ("integral", "instantaneous", "pi_lead"), ("euler", "rk4")
HIDDEN, INPUTS, UNIT = 6, 4, 1000.0
STEPS = (0.005, 0.01, 0.02)  # s
ODD = 0.05  # share of designs in which a gain is far off


class Case(NamedTuple):
    """A car, the conditions that are declared of its drives, and a design as plain numbers."""

    vehicle: Vehicle
    driving: dict[str, float]
    gains: dict[str, Any]
    settings: dict[str, Any]


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Return a number whose logarithm is uniform.

    Parameters
    ----------
    rng : source of randomness.
    low, high : smallest and largest.
    """
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def random_case(rng: np.random.Generator, law: str, integrator: str) -> Case:
    """Return a random case.

    Parameters
    ----------
    rng : source of randomness.
    law : "integral", "instantaneous" or "pi_lead".
    integrator : "euler" or "rk4".
    """
    car = random_vehicle(rng)
    C = np.array([car.cornering_stiffness_front, car.cornering_stiffness_rear])
    load = np.array(car.axle_loads)
    friction = rng.uniform(0.4, 1.0)
    slip = friction * float((load / C).max()) * log_uniform(rng, 0.7, 2.5)
    v_x = 4.0 * car.froude_speed * rng.uniform(0.7, 1.4)
    bandwidth = log_uniform(rng, 0.3, 1.0)
    noise = rng.choice([0.0, rng.uniform(0.0, 1.5)])
    driving = {"v_x": v_x, "slip": slip, "friction": friction, "bandwidth": bandwidth}
    driving |= {"noise_v_x": 0.12 * noise, "noise_v_y": 0.12 * noise}
    driving |= {"noise_r": 0.012 * noise, "noise_delta": 0.002 * noise}

    dt = float(rng.choice(STEPS))
    a = min(2.0 * np.pi * bandwidth * log_uniform(rng, 1.5, 5.0), 0.25 / dt)
    A_d = -a * np.eye(2)
    if rng.random() < 0.5:
        A_d = A_d + a * rng.uniform(-0.3, 0.3, (2, 2))
    lam = a * log_uniform(rng, 0.5, 2.0)
    if rng.random() < ODD:
        lam = rng.uniform(0.8, 2.0) / dt
    lead = 1.2 / a if law == "pi_lead" else 0.0
    c_z, c_xi = {"integral": (1.0, 0.0), "instantaneous": (0.0, 1.0)}.get(law, (1.0, lead))
    drive = c_z / lam + c_xi
    eta_W = log_uniform(rng, 0.05, 1.2) * a**2 * lam / HIDDEN / drive / (1.0 + c_xi * lam)
    peak = friction * load
    force = C * slip - peak * np.sin(1.5 * np.arctan(C * slip / (1.5 * peak)))
    needed = float(np.linalg.norm(force)) / UNIT
    rho_W = HIDDEN * eta_W / a * drive / (needed * log_uniform(rng, 1.0, 12.0))
    W = needed * 2.0
    eta_V = eta_W / (6.0 * W) ** 2 * log_uniform(rng, 0.05, 3.0)
    rho_V = rho_W * float(np.exp(rng.normal(-1.0, 2.0)))
    if rng.random() < ODD:
        rho_V = rho_W * log_uniform(rng, 10.0, 1e5)
    W_max = V_max = np.inf
    if rng.random() < 0.3:
        W_max, V_max = W * log_uniform(rng, 0.3, 3.0), 12.0
    if rng.random() < ODD:
        rho_W = 0.0
    gains = {
        "A_d": ((A_d[0, 0], A_d[0, 1]), (A_d[1, 0], A_d[1, 1])),
        "forgetting": lam,
        "eta_W": eta_W,
        "eta_V": eta_V * rng.choice([0.0, 1.0, 1.0]),
        "rho_W": rho_W,
        "rho_V": rho_V,
        "W_max": W_max,
        "V_max": V_max,
        "lead": lead,
    }
    settings = {
        "law": law,
        "integrator": integrator,
        "dt": dt,
        "input_source": str(rng.choice(["measured", "measured", "estimated"])),
        "seed": int(rng.integers(1 << 30)),
    }
    return Case(car, driving, gains, settings)


def random_cases(law: str, integrator: str, count: int) -> list[Case]:
    """Return the cases of a law and an integrator, always the same ones.

    Parameters
    ----------
    law : "integral", "instantaneous" or "pi_lead".
    integrator : "euler" or "rk4".
    count : how many.
    """
    seed = [11, LAWS.index(law), INTEGRATORS.index(integrator)]
    rng = np.random.default_rng(seed)
    return [random_case(rng, law, integrator) for _ in range(count)]
