"""The proven bounds against random drives: random cars, maneuvers, networks and gains.

    python -m benchmarks.bounds_monte_carlo [RUNS]

Every run drives a random car smoothly, often at the limit of its tires. The identifier runs twice:
with leakage and gains up to the certificate (theta < 1), and with a projection of W at any gain.
Printed: how often a bound was passed, and bound over observed sup|ξ̃|, beside (14) as printed (scale
of P at its best, with the ideal weights and the approximation error of that very run) and the
bound of an identifier without a network. Fails where a proven bound is passed.
"""

import sys
import time
from collections import defaultdict

import numpy as np
from numpy.typing import NDArray

from benchmarks.random_drives import FORCE_UNIT, Drive, random_drive
from benchmarks.targets import Targets, keeps
from identifier.design import Design
from identifier.gains import Gains
from identifier.history import History
from identifier.identify import identify
from identifier.laws import DRIVING_ERRORS
from identifier.network import Network
from identifier.stability.loop import linear_law
from identifier.stability.lyapunov import lyapunov, sampled_peak_gain
from identifier.stability.state_bound import (
    Start,
    V_bound,
    projection_bound,
    small_gain,
    state_bounds,
    steady_capacity,
)
from identifier.stability.ultimate_bound import best_printed_bound

Array = NDArray[np.float64]
DT = 0.01
KEYS = {  # of what is recorded, for each column
    "xi_tilde": "leakage",
    "W": "weights",
    "V": "V",
    "xi_tilde, projected": "projection",
    "no network": "no_network",
    "X over no network": "leakage_over_no_network",
    "(14), integral": "printed_integral",
    "(14), instantaneous": "printed_instantaneous",
}
PROVEN = ("xi_tilde", "W", "V", "xi_tilde, projected")


def random_error_dynamics(rng: np.random.Generator) -> Array:
    """Return A_d, half of the time with coupling, resolved by the step."""
    A_d = (
        -np.diag(rng.uniform(2.0, 15.0, 2))
        if rng.random() < 0.5
        else -rng.uniform(2, 15) * np.eye(2)
    )
    if rng.random() < 0.5:
        A_d = A_d + 0.3 * np.abs(A_d).max() * rng.uniform(-1.0, 1.0, (2, 2))
    return A_d if np.linalg.eigvals(A_d).real.max() < -1.0 else random_error_dynamics(rng)


def random_network(rng: np.random.Generator) -> Network:
    """Return a network of 5 to 20 hidden units."""
    return Network(hidden=int(rng.choice([5, 10, 15, 20])))


def design_of(
    rng: np.random.Generator,
    network: Network,
    A_d: Array,
    law: str,
    forgetting: float,
    eta_W: float,
    rho: float,
    W_max: float = np.inf,
) -> Design:
    """Return a design with a random input source and V layer."""
    projected = np.isfinite(W_max)
    gains = Gains(
        A_d=((A_d[0, 0], A_d[0, 1]), (A_d[1, 0], A_d[1, 1])),
        forgetting=forgetting,
        eta_W=eta_W,
        eta_V=eta_W * rng.choice([0.0, rng.uniform(0.0, 0.3)]),
        rho_W=rho,
        rho_V=rho,
        W_max=W_max,
        V_max=20.0 if projected else np.inf,
    )
    return Design(
        gains=gains,
        network=network,
        law=law,
        input_source=str(rng.choice(["measured", "estimated"])),
        force_unit=FORCE_UNIT,
        dt=DT,
        seed=int(rng.integers(1 << 30)),
    )


def printed_bound(drive: Drive, history: History, design: Design) -> float:
    """Return (14) with the weights that fit this run best and the error that they leave."""
    s = hidden_units(drive, history, design)[: len(drive.residual)]
    fitted = np.linalg.solve(s.T @ s + 1e-6 * len(s) * np.eye(s.shape[1]), s.T @ drive.residual)
    return best_printed_bound(
        lyapunov(design.gains.matrix, np.eye(2)),
        w_bar=float(np.linalg.norm(drive.residual - s @ fitted, axis=1).max()),
        W_M=float(np.linalg.norm(fitted)),
        n_h=design.network.hidden,
        eta_W=design.gains.eta_W,
        rho_W=design.gains.rho_W,
    )


def hidden_units(drive: Drive, history: History, design: Design) -> Array:
    """Return tanh(V_hat x_bar) along a run with measured input, (n, n_h)."""
    signals = np.hstack([drive.recording.x, drive.recording.u])
    x_bar = signals / np.array(design.network.scale)
    units: Array = np.tanh(np.einsum("nhi,ni->nh", history.carried["V"][:-1], x_bar))
    return units


def with_leakage(rng: np.random.Generator, drive: Drive) -> dict[str, float]:
    """Return bound over observed of a run with leakage, gains up to the certificate."""
    A_d, forgetting = random_error_dynamics(rng), rng.uniform(2.0, 15.0)
    law = str(rng.choice(["integral", "integral", "integral", "instantaneous"]))
    driving, f_max = (
        linear_law(DRIVING_ERRORS[law]),
        float(np.linalg.norm(drive.residual, axis=1).max()),
    )
    network = random_network(rng)
    n_h = network.hidden
    integral = linear_law(DRIVING_ERRORS["integral"])
    unit = small_gain(A_d, law=integral, forgetting=forgetting, eta_W=1.0, n_h=n_h, dt=DT)
    eta_W = rng.uniform(0.02, 0.98) / unit / (forgetting if law == "instantaneous" else 1.0)
    capacity = f_max * np.exp(rng.uniform(np.log(0.3), np.log(10.0)))
    rho = steady_capacity(
        A_d, law=driving, forgetting=forgetting, eta_W=eta_W, rho_W=capacity, n_h=n_h
    )  # the capacity is inverse to rho
    design = design_of(rng, network, A_d, law, forgetting, eta_W, rho)
    gains = design.gains
    start = Start(
        V=float(
            np.linalg.norm(design.network.initial_weights(np.random.default_rng(design.seed)).V)
        )
    )
    bounds = state_bounds(
        A_d,
        law=driving,
        forgetting=forgetting,
        eta_W=eta_W,
        rho_W=rho,
        n_h=n_h,
        residual_bound=f_max,
        start=start,
        dt=DT,
    )
    if rho * DT * bounds.xi_tilde > 1.0:
        return with_leakage(rng, drive)  # the certificate does not let it pass
    history = identify(drive.recording, drive.vehicle, design)
    observed = float(np.linalg.norm(history.told["xi_tilde"], axis=1).max())
    W = float(np.linalg.norm(history.carried["W"], axis=(1, 2)).max())
    found = {
        "xi_tilde": bounds.xi_tilde / observed,
        "W": bounds.W / W,
        "no network": sampled_peak_gain(A_d, DT) * f_max / observed,
        "X over no network": bounds.xi_tilde / (sampled_peak_gain(A_d, DT) * f_max),
    }
    if design.input_source == "measured":
        signals = np.hstack([drive.recording.x, drive.recording.u])
        x_bar_max = float(np.linalg.norm(signals / np.array(design.network.scale), axis=1).max())
        limit = V_bound(
            A_d,
            bounds,
            law=driving,
            forgetting=forgetting,
            eta_V=gains.eta_V,
            rho_V=rho,
            x_bar_max=x_bar_max,
            start=start,
        )
        found["V"] = limit / float(np.linalg.norm(history.carried["V"], axis=(1, 2)).max())
        found[f"(14), {law}"] = printed_bound(drive, history, design) / observed
    return found


def with_projection(rng: np.random.Generator, drive: Drive) -> dict[str, float]:
    """Return bound over observed of a run with a projection, any law and any gain."""
    A_d, law = random_error_dynamics(rng), str(rng.choice(["integral", "instantaneous"]))
    eta_W, W_max = np.exp(rng.uniform(np.log(1.0), np.log(1e6))), rng.uniform(0.5, 20.0)
    design = design_of(
        rng, random_network(rng), A_d, law, rng.uniform(2.0, 15.0), eta_W, 0.0, W_max
    )
    history = identify(drive.recording, drive.vehicle, design)
    bound = projection_bound(
        A_d,
        W_max=W_max,
        n_h=design.network.hidden,
        dt=DT,
        residual_bound=float(np.linalg.norm(drive.residual, axis=1).max()),
    )
    observed = float(np.linalg.norm(history.told["xi_tilde"], axis=1).max())
    return {"xi_tilde, projected": bound / observed}


def ratios(runs: int, seed: int) -> dict[str, Array]:
    """Return bound over observed for every bound.

    Parameters
    ----------
    runs : number of random drives, each identified twice.
    seed : of everything.
    """
    rng = np.random.default_rng(seed)
    found: dict[str, list[float]] = defaultdict(list)
    for _ in range(runs):
        drive = random_drive(rng)
        for name, ratio in (with_leakage(rng, drive) | with_projection(rng, drive)).items():
            found[name].append(ratio)
    return {name: np.array(values) for name, values in found.items()}


def main(runs: int = 1000) -> int:
    """Print the table; 1 if a proven bound was passed."""
    begin, targets = time.perf_counter(), Targets("bounds_monte_carlo")
    table = ratios(runs, seed=5)
    targets.record("runs", runs)
    print("bound over observed       runs  passed     min   median   90 %")
    for name, values in table.items():
        low, middle, high = values.min(), np.median(values), np.quantile(values, 0.9)
        passed = int(np.sum(~(values >= 1.0 - 1e-9)))
        print(f"{name:24s}{values.size:6d}{passed:8d}{low:8.3g}{middle:9.3g}{high:7.3g}")
        key = KEYS[name]
        for what, value in (("least", low), ("median", middle), ("q90", high)):
            targets.record(f"{key}/{what}", float(value))
        if name in PROVEN:
            title = f"runs that pass the bound of {name}"
            targets.at_most(title, passed, 0, "", f"{key}/passed")
        else:
            targets.record(f"{key}/passed", passed)
    seconds = time.perf_counter() - begin
    print(f"{runs} drives, each identified twice, in {seconds:.0f} s")
    targets.record("seconds", seconds, "s")
    return targets.finish(keep=keeps())


if __name__ == "__main__":
    sys.exit(main(*(int(word) for word in sys.argv[1:] if word != "--record")))
