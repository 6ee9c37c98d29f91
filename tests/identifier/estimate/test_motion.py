"""The forward model against its equations, integrated by other means, and its slopes."""

import os
import shutil
import subprocess
import sys

import numpy as np
import pytest

from identifier.estimate.drive import Drive
from identifier.estimate.priors import Priors
from identifier.estimate.solve import DELAYS, Problem, car_numbers, simulate
from identifier.motion.model import RATE, motion_scan
from identifier.motion.parameters import INDEX, NAMES, SLIPS
from models.vehicle import GRAVITY, sedan
from tests.identifier.estimate.conftest import driven

FINE = 10  # steps of the integration in a sample
SENSORS = {
    "v_y_bias": 0.1, "v_y_angle": 0.01, "v_y_lever": 0.05, "v_y_delay": 0.02,
    "steering_zero": 0.004, "steering_gain": 0.05, "steering_delay": 0.01, "r_bias": 0.01,
    "r_delay": 0.01, "v_y_lag": 0.01, "steering_lag": 0.01, "r_lag": 0.005, "r_gain": 0.02,
    "downforce_f": 1e-5, "downforce_r": -2e-5, "v_x_factor": 0.02,
    "cg_shift": 0.05, "ln_inertia": 0.1, "bank": 0.01, "ln_road": -0.2,
    "compliance_f": 0.03, "compliance_r": 0.04, "residual1_f": 0.05, "residual3_r": -0.04,
    "steering_play": 0.01,
}  # fmt: skip


def parameters():
    """The prior's mean with errors of all sensors."""
    p = Priors.of(sedan()).mean.copy()
    for name, value in SENSORS.items():
        p[INDEX[name]] = value
    return p


def of(drive, p, car):
    """Forces and what is missed, by Euler steps of the docstring's equations, (n, 2) each."""
    one = {name: float(p[k]) for name, k in INDEX.items()}
    m, I_z, l_f, l_r = car.bicycle[:4]
    L, dt = l_f + l_r, drive.dt / FINE
    arm = np.array([l_f - one["cg_shift"], -(l_r + one["cg_shift"])])
    share = np.array([-arm[1], arm[0]]) / L  # of the weight
    k, s = (np.array([one[f"{name}_{a}"] for a in "fr"]) for name in ("sway_share", "compliance"))
    omega, zeta = min(5.0 * np.sqrt(GRAVITY / L), 60.0) * np.exp(one["ln_sway"]), 0.3
    road = np.exp(one["ln_road"])

    def curve(x):
        phi, slope = np.empty(2), np.empty(2)
        for i, a in enumerate("fr"):
            mu, c, E = np.exp(one[f"ln_grip_{a}"]), one[f"shape_{a}"], one[f"curvature_{a}"]
            C = np.exp(one[f"ln_stiffness_{a}"])
            q = np.array([one[f"residual{j}_{a}"] for j in range(len(SLIPS))])

            def value(y, mu=mu, c=c, E=E, C=C, q=q):
                B = C / (c * mu)
                u = B * y - E * (B * y - np.arctan(B * y))
                return mu * np.sin(c * np.arctan(u)) + q @ np.tanh(y / np.array(SLIPS))

            h = 1e-6
            phi[i] = road * value(x[i] / road)
            slope[i] = (value(x[i] / road + h) - value(x[i] / road - h)) / (2.0 * h)
            slope[i] = max(slope[i], 0.02 * C)
        return phi, slope

    drive, n = drive.on_time(p[DELAYS]), len(drive.signals)
    steps = np.arange(n * FINE) / FINE
    v_x, v_y, r, d, _, a_x, bank, *_ = (
        np.interp(steps, np.arange(n), column) for column in drive.signals.T
    )
    v_y_rate, r_rate, d_rate = (np.interp(steps, np.arange(n), c) for c in drive.rates.T)
    v_x = v_x * (1.0 + one["v_x_factor"])
    r = (1.0 + one["r_gain"]) * (r + one["r_lag"] * r_rate) - one["r_bias"]
    v_y = v_y + one["v_y_lag"] * v_y_rate - one["v_y_bias"]
    v_y = v_y - one["v_y_angle"] * v_x - one["v_y_lever"] * r
    d = (1.0 + one["steering_gain"]) * (d + one["steering_lag"] * d_rate) + one["steering_zero"]
    inertia = I_z * np.exp(one["ln_inertia"])
    force, left = np.zeros((n, 2)), np.zeros((n, 2))
    x = rho = rate = late = None
    for j in range(len(steps)):
        slip = np.array([d[j], 0.0]) - np.arctan((v_y[j] + arm * r[j]) / v_x[j])
        if x is None:
            x, rho, rate = slip, v_x[j] * r[j], 0.0
        slip = slip - k * rate / (omega**2 * v_x[j])
        slip[0] -= np.clip(slip[0], -one["steering_play"], one["steering_play"])
        phi, slope = curve(x)
        f = a_x[j] / GRAVITY
        press = np.array([one["downforce_f"], one["downforce_r"]]) * v_x[j] ** 2
        load = np.maximum(1.0 - one["load_transfer"] * L * f / arm + press, 0.2)
        kind = "driving" if f > 0.0 else "braking"
        use = np.array([one[f"{kind}_{a}"] for a in "fr"]) * f
        F = phi * load * np.sqrt(np.maximum(1.0 - use**2, 0.05))
        # m (v_y' + v_x r) = sum, I_z r' = moments: the force of each axle over its static load.
        xi = v_y[j] / GRAVITY + inertia * r[j] / (m * GRAVITY * L * share * np.sign(arm))
        across = F * np.array([np.cos(d[j]), 1.0])
        u = across - v_x[j] * r[j] / GRAVITY + bank[j] / GRAVITY + one["bank"]
        late = -xi if late is None else late
        if j % FINE == 0:
            force[j // FINE], left[j // FINE] = across, RATE * (late + xi)
        late = late + dt * (-u - RATE * (late + xi))
        sigma = s * slope + 0.001 * L
        x = x + (1.0 - np.exp(-dt * v_x[j] / sigma)) * (slip - x)
        rate = rate + dt * (omega**2 * (GRAVITY * (share @ F) - rho) - 2.0 * zeta * omega * rate)
        rho = rho + dt * rate
    return force, left


@pytest.fixture(scope="module")
def drive():
    return Drive.of(driven(3), sedan(), slice(200, 700))


def test_the_model_is_its_equations_integrated_finely(drive):
    p, car = parameters(), sedan()
    found = simulate(drive, p, car)
    settled = slice(150, None)  # six times that of the filter
    for port, expected, within in zip(
        ("force", "residual"), of(drive, p, car), (0.02, 0.02), strict=True
    ):
        away = found[port][settled] - expected[settled]
        size = np.sqrt(np.mean(expected[settled] ** 2, axis=0))
        assert (np.sqrt(np.mean(away**2, axis=0)) < within * size).all(), port


def test_slopes_over_all_that_moves_are_finite_differences(drive):
    priors = Priors.of(sedan())
    problem, p = Problem([drive], sedan(), priors), parameters()
    slopes = problem.residuals(p).slopes
    assert slopes.shape[2] == np.count_nonzero(priors.moves) > 30
    for column, k in enumerate(problem.index):
        h = 1e-5 * max(priors.information[k, k] ** -0.5, 1e-3)
        ahead, behind = (p + sign * h * np.eye(len(p))[k] for sign in (1.0, -1.0))
        expected = (problem.residuals(ahead).e - problem.residuals(behind).e) / (2.0 * h)
        away = np.abs(slopes[:, :, column] - expected).max()
        assert away <= 2e-3 * np.abs(expected).max() + 1e-6, NAMES[k]


def test_slopes_over_faults_and_the_road_are_finite_differences(drive):
    """Of numbers that move only where a log shows them."""
    moves = Priors.of(sedan()).moves
    names = tuple(name for name, moving in zip(NAMES, moves, strict=True) if not moving)
    scan, p, car = motion_scan(names), parameters(), car_numbers(sedan())
    inputs = {**scan.zeros(), "signals": drive.signals, "rates": drive.rates}
    inputs |= {"car": car, "dt": np.array(drive.dt)}

    def run(p, port):
        return scan(len(drive.signals), {**inputs, "parameters": p}, ports=(port,))[port]

    slopes = run(p, "slopes")
    for column, name in enumerate(names):
        step = 1e-5 * np.eye(len(p))[INDEX[name]]
        expected = (run(p + step, "residual") - run(p - step, "residual")) / 2e-5
        away = np.abs(slopes[:, :, column] - expected).max()
        assert away <= 2e-3 * np.abs(expected).max(), name


@pytest.mark.skipif(shutil.which("clang") is None, reason="clang is not installed")
def test_clang_compiles_the_slopes_of_the_motion(tmp_path):
    code = (
        "from identifier.motion.model import motion_scan; motion_scan(('ln_grip_f',)).loop.argtypes"
    )
    variables = {**os.environ, "CC": "clang", "TIREID_CACHE": str(tmp_path)}
    subprocess.run([sys.executable, "-c", code], check=True, env=variables, timeout=60)
