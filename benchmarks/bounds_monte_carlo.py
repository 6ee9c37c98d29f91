"""The bounds that a certificate states against random drives: random cars, networks and gains.

    python -m benchmarks.bounds_monte_carlo [RUNS [DRIVES]] [--record]

Every run draws a car, conditions of driving with errors of its sensors, and a network, with gains
up to where the certificate proves nothing more (theta < 1); law, sampling and input source are
drawn too. Its certificate states bounds for
the declared conditions, and it identifies DRIVES random drives within them, with inputs held over a
sample, noisy sensors, and every second time with resumed weights. Whether it passes for its margins
makes no difference: what is stated as proven must hold.
Printed: how many drives passed a bound, and bound over observed sup|ξ̃| of each drive, beside what
the certificate states of an identifier without a network and of (14) as printed. Fails where a
proven bound is passed or an identifier with one diverges.
"""

import math
import sys
import time
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from benchmarks.monte_carlo import Beginning, Observed, bound_rows, monte_carlo
from benchmarks.random_drives import FORCE_UNIT, random_vehicle
from benchmarks.targets import Targets, keeps
from codegen.arrays import Array
from identifier.driving import Driving, natural_driving
from identifier.methods import certify
from identifier.paper.design import PaperIdentifier
from identifier.paper.laws import LAWS, Gains
from identifier.paper.network import Network
from identifier.stability import Certificate
from identifier.stability.bounds import small_gain, steady_capacity
from identifier.stability.loop import direction_matrix
from models.vehicle import Vehicle

SEED, PROCESSES = 5, 2
DRAWN = ("integral", "integral", "instantaneous", "pi_lead")
HIDDEN = (5, 20)
STEPS = (0.005, 0.01, 0.02)  # s
KEYS = {  # what is recorded: the bound in the certificate, and what it bounds
    "leakage": ("error_bound", "xi_tilde"),
    "weights": ("weight_bound", "W"),
    "V": ("V_bound", "V"),
    "no_network": ("trivial_bound", "xi_tilde"),
    "printed": ("printed_bound", "xi_tilde"),
}
PROVEN = ("leakage", "weights", "V")


class Found(NamedTuple):
    """What came of a design: by key bound over observed of each drive; drives that diverged."""

    ratios: dict[str, Array]
    passed: dict[str, int]
    diverged: int


def random_driving(rng: np.random.Generator, vehicle: Vehicle) -> Driving:
    """Return conditions about the natural ones, the sensors from exact to half as good again.

    Parameters
    ----------
    rng : source of randomness.
    vehicle : the car.
    """
    natural, noise = natural_driving(vehicle), rng.choice([0.0, rng.uniform(0.0, 1.5)])
    friction = rng.uniform(0.4, 1.0)
    return Driving(
        v_x=natural.v_x * rng.uniform(0.7, 1.4),
        slip=natural.slip * friction * np.exp(rng.uniform(np.log(0.4), np.log(1.25))),
        friction=friction,
        bandwidth=rng.uniform(0.3, 1.2),
        noise_v_x=noise * natural.noise_v_x,
        noise_v_y=noise * natural.noise_v_y,
        noise_r=noise * natural.noise_r,
        noise_delta=noise * natural.noise_delta,
    )


def random_error_dynamics(rng: np.random.Generator) -> Array:
    """Return A_d, half of the time with coupling, resolved by every step.

    Parameters
    ----------
    rng : source of randomness.
    """
    A_d = -np.diag(rng.uniform(2.0, 15.0, 2))
    if rng.random() < 0.5:
        A_d = A_d[0, 0] * np.eye(2)
    if rng.random() < 0.5:
        A_d = A_d + 0.3 * np.abs(A_d).max() * rng.uniform(-1.0, 1.0, (2, 2))
    return A_d if np.linalg.eigvals(A_d).real.max() < -1.0 else random_error_dynamics(rng)


def random_design(rng: np.random.Generator, network: Network, driving: Driving) -> PaperIdentifier:
    """Return a design that does not learn yet.

    Parameters
    ----------
    rng : source of randomness.
    network : its network.
    driving : the declared conditions.
    """
    A_d, law = random_error_dynamics(rng), str(rng.choice(DRAWN))
    gains = Gains(
        A_d=((A_d[0, 0], A_d[0, 1]), (A_d[1, 0], A_d[1, 1])),
        forgetting=rng.uniform(2.0, 15.0),
        eta_W=0.0,
        eta_V=0.0,
        rho_W=0.0,
        rho_V=0.0,
        lead=-2.0 / np.trace(A_d) * rng.uniform(0.3, 1.5) if law == "pi_lead" else 0.0,
    )
    return PaperIdentifier(
        gains=gains,
        network=network,
        law=law,
        input_source=str(rng.choice(["measured", "estimated"])),
        force_unit=FORCE_UNIT,
        dt=float(rng.choice(STEPS)),
        seed=int(rng.integers(1 << 30)),
        driving=driving,
    )


def with_leakage(
    rng: np.random.Generator, vehicle: Vehicle, blank: PaperIdentifier
) -> PaperIdentifier:
    """Return the design with gains up to theta = 1 and a leakage that holds the force, or does not.

    Parameters
    ----------
    rng : source of randomness.
    vehicle : the car.
    blank : of `random_design`.
    """
    gains, n_h = blank.gains, blank.network.hidden
    chosen = LAWS[blank.law]
    law, D = chosen.error(gains.lead), direction_matrix(chosen, gains.matrix)
    A_d, forgetting = gains.matrix, gains.forgetting
    integral = LAWS["integral"].error()
    unit = small_gain(
        A_d, law=integral, forgetting=forgetting, eta_W=1.0, n_h=n_h, dt=blank.dt, direction=D
    )
    eta_W = rng.uniform(0.02, 0.98) / unit
    if blank.law == "instantaneous":
        eta_W /= forgetting  # theta is 0 at any gain: as fast as the integral law
    needed = blank.operation(vehicle).needed_force
    capacity = needed * np.exp(rng.uniform(np.log(0.3), np.log(10.0)))
    rho = steady_capacity(
        D, law=law, forgetting=forgetting, eta_W=eta_W, rho_W=capacity, n_h=n_h
    )  # the capacity is inverse to rho
    eta_V = eta_W * rng.choice([0.0, rng.uniform(0.0, 0.3)])
    return replace(blank, gains=replace(gains, eta_W=eta_W, eta_V=eta_V, rho_W=rho, rho_V=rho))


def proven_design(
    rng: np.random.Generator, vehicle: Vehicle, driving: Driving, network: Network
) -> tuple[PaperIdentifier, Certificate]:
    """Return a design with a proven bound of its error, and its certificate.

    Parameters
    ----------
    rng : source of randomness.
    vehicle : the car.
    driving : the declared conditions.
    network : its network.
    """
    while True:
        design = with_leakage(rng, vehicle, random_design(rng, network, driving))
        certificate = certify(design, vehicle)
        if "error_bound" in stated(certificate):
            return design, certificate


def stated(certificate: Certificate) -> dict[str, float]:
    """Return the bounds and other values that are stated, by name; none where there is no bound.

    Parameters
    ----------
    certificate : the properties.
    """
    return {e.name: e.value for e in certificate.properties if math.isfinite(e.value)}


def driven(
    design: PaperIdentifier,
    vehicle: Vehicle,
    certificate: Certificate,
    count: int,
    rng: np.random.Generator,
) -> Observed:
    """Run random drives, every second one with weights as large as are proven.

    Parameters
    ----------
    design : the design, with its declared conditions.
    vehicle : the car.
    certificate : of the design.
    count : number of drives.
    rng : source of randomness.
    """
    assert design.driving is not None
    W = stated(certificate)["weight_bound"]
    V = design.operation(vehicle).V_start
    beginning = Beginning(W=W, V=V)
    return monte_carlo(design, vehicle, design.driving, count, beginning=beginning, rng=rng)


def compared(design: PaperIdentifier, certificate: Certificate, observed: Observed) -> Found:
    """Return what the certificate states, over what was seen.

    Parameters
    ----------
    design : the design.
    certificate : of the design.
    observed : its drives.
    """
    values, ratios = stated(certificate), {}
    passed = {row.name: row.passed for row in bound_rows(certificate, observed)}
    for key, (name, what) in KEYS.items():
        if name in values:
            ratios[key] = values[name] / getattr(observed, what)
    counted = {key: passed[name] for key, (name, _) in KEYS.items() if name in passed}
    ratios[f"printed_{design.law}"] = ratios.pop("printed")
    over = values["error_bound"] / values["trivial_bound"]
    ratios["leakage_over_no_network"] = np.array([over])
    counts = {key: int(np.sum(~(ratio >= 1.0 - 1e-9))) for key, ratio in ratios.items()}
    counts |= {key: counted[key] for key in ratios if key in PROVEN}
    return Found(ratios, counts, observed.diverged)


def run(number: int, drives: int) -> Found:
    """Return what came of the design of a run.

    Parameters
    ----------
    number : of the run; all that is random follows from it.
    drives : of each design.
    """
    rng = np.random.default_rng([SEED, number])
    vehicle = random_vehicle(rng)
    driving = random_driving(rng, vehicle)
    network = Network(hidden=int(rng.choice(HIDDEN)))  # its scale is compiled: one for all cars
    design, certificate = proven_design(rng, vehicle, driving, network)
    return compared(design, certificate, driven(design, vehicle, certificate, drives, rng))


def record(found: list[Found], targets: Targets) -> None:
    """Print and record the table.

    Parameters
    ----------
    found : of all designs.
    targets : where the numbers go.
    """
    ratios: dict[str, list[Array]] = defaultdict(list)
    passed: dict[str, int] = defaultdict(int)
    for one in found:
        for key, values in one.ratios.items():
            ratios[key].append(values)
            passed[key] += one.passed[key]
    print("bound over observed      drives  passed     min   median   90 %")
    for key in sorted(ratios):
        values = np.concatenate(ratios[key])
        low, middle, high = np.quantile(values, [0.0, 0.5, 0.9])
        print(f"{key:24s}{values.size:7d}{passed[key]:8d}{low:8.3g}{middle:9.3g}{high:7.3g}")
        for what, value in (("least", low), ("median", middle), ("q90", high)):
            targets.record(f"{key}/{what}", float(value))
        if key in PROVEN:
            title = f"drives that pass the bound of {key}"
            targets.at_most(title, passed[key], 0, "", f"{key}/passed")
        else:
            targets.record(f"{key}/passed", passed[key])
    diverged = sum(one.diverged for one in found)
    targets.at_most("drives that diverge though a bound is proven", diverged, 0, "", "diverged")


def main(runs: int = 200, drives: int = 16, *, keep: bool = False) -> int:
    """Print the table; 1 if a proven bound was passed.

    Parameters
    ----------
    runs : random cars, each with a network and a design.
    drives : of each design.
    keep : record what was measured.
    """
    begin, targets = time.perf_counter(), Targets("bounds_monte_carlo")
    with ProcessPoolExecutor(PROCESSES) as pool:
        found = list(pool.map(partial(run, drives=drives), range(runs)))
    targets.record("runs", runs)
    targets.record("drives", drives)
    targets.record("identified", runs * drives)
    record(found, targets)
    seconds = time.perf_counter() - begin
    print(f"{runs} cars with networks, {drives} drives each, {seconds:.0f} s")
    targets.record("seconds", seconds, "s")
    return targets.finish(keep=keep)


if __name__ == "__main__":
    KEEP = keeps()
    sys.exit(main(*(int(word) for word in sys.argv[1:]), keep=KEEP))
