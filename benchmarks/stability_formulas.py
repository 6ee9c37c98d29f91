"""The closed-form gain limits against eigenvalues of the 6x6 loop, over random designs.

    python -m benchmarks.stability_formulas

prints the largest relative difference: continuous limit and its frequency, Euler limit, the
instantaneous law's Euler limit, and for error dynamics that are no multiple of the identity the
gain margin against the roots of the Kronecker sum. Fails beyond 1e-8 (1e-6 for sampled loops).
"""

import sys

import numpy as np
from scipy.linalg import eigvals

from benchmarks.limits import (
    critical_frequency,
    instantaneous_euler_limit,
    integral_euler_limit,
    integral_limit,
)
from benchmarks.targets import Targets, keeps
from identifier.paper.laws import DrivingError
from identifier.stability.loop import INSTANTANEOUS, INTEGRAL, Loop, growth_rate
from identifier.stability.margins import gain_margin

DT, CASES = 0.01, 200
TOLERANCES = {
    "continuous limit": 1e-8,
    "critical frequency": 1e-8,
    "Euler limit": 1e-6,
    "instantaneous, Euler limit": 1e-6,
    "general A_d, Kronecker sum": 1e-6,
}


def scalar_loop(a: float, lam: float, leakage: float, law: DrivingError) -> Loop:
    """Return the loop of A_d = -a I at unit gain."""
    return Loop(A_d=-a * np.eye(2), forgetting=lam, law=law, G=np.eye(2), leakage=leakage)


def kronecker_difference(loop: Loop) -> float:
    """Return how far the gain margin is from the nearest root of det(M ⊕ M) = 0."""
    M = loop.matrix()
    free = M.copy()
    free[4:, :4] = 0.0
    eye = np.eye(6)
    constant = np.kron(free, eye) + np.kron(eye, free)
    roots = eigvals(constant, -np.kron(M - free, eye) - np.kron(eye, M - free))
    found = gain_margin(loop).factor
    return float(np.nanmin(np.abs(roots[np.isfinite(roots)] / found - 1.0)))


def random_error_dynamics(rng: np.random.Generator) -> np.ndarray:
    """Return a Hurwitz matrix that is not symmetric."""
    while True:
        A_d = -rng.uniform(3.0, 10.0) * np.eye(2) + 3.0 * rng.standard_normal((2, 2))
        if np.linalg.eigvals(A_d).real.max() < -0.5:
            return A_d


def differences(cases: int, seed: int) -> dict[str, float]:
    """Return the largest relative difference of every comparison.

    Parameters
    ----------
    cases : number of random designs.
    seed : of the designs.
    """
    rng = np.random.default_rng(seed)
    worst = dict.fromkeys(TOLERANCES, 0.0)
    for _ in range(cases):
        a, lam = np.exp(rng.uniform(np.log(0.5), np.log(30.0), 2))
        leakage = rng.choice([0.0, rng.uniform(0.0, 5.0)])
        loop = scalar_loop(a, lam, leakage, INTEGRAL)
        continuous, sampled = gain_margin(loop), gain_margin(loop, DT)
        quick = gain_margin(scalar_loop(a, lam, leakage, INSTANTANEOUS), DT)
        A_d = random_error_dynamics(rng)
        G = np.diag(rng.uniform(1.0, 300.0, 2))
        skewed = Loop(A_d=A_d, forgetting=lam, law=INTEGRAL, G=G, leakage=leakage)
        found = {
            "continuous limit": continuous.factor / integral_limit(a, lam, leakage) - 1.0,
            "critical frequency": continuous.frequency / critical_frequency(a, lam, leakage) - 1.0,
            "Euler limit": sampled.factor / integral_euler_limit(a, lam, DT, leakage) - 1.0,
            "instantaneous, Euler limit": quick.factor / instantaneous_euler_limit(a, DT, leakage)
            - 1.0,
            "general A_d, Kronecker sum": kronecker_difference(skewed),
        }
        worst = {name: max(worst[name], abs(found[name])) for name in worst}
    return worst


def rule_of_slowest_pole(cases: int, seed: int) -> float:
    """Return the share of random A_d for which the limit of -a_min I, halved, is still unstable.

    Parameters
    ----------
    cases : number of random matrices.
    seed : of the matrices.
    """
    rng = np.random.default_rng(seed)
    unsafe = 0
    for _ in range(cases):
        A_d, lam = random_error_dynamics(rng), rng.uniform(1.0, 10.0)
        slowest = -float(np.linalg.eigvals(A_d).real.max())
        g = 0.5 * integral_limit(slowest, lam)
        loop = Loop(A_d=A_d, forgetting=lam, law=INTEGRAL, G=g * np.eye(2))
        unsafe += bool(growth_rate(loop.matrix()) > 0.0)
    return unsafe / cases


def main() -> int:
    """Print the differences; 1 if one is too large."""
    worst, targets = differences(cases=CASES, seed=1), Targets("stability_formulas")
    targets.record("cases", CASES)
    print(f"{CASES} random designs{'largest difference':>40s}{'allowed':>10s}")
    for name, difference in worst.items():
        print(f"{name:34s}{difference:20.1e}{TOLERANCES[name]:10.0e}")
        key = name.replace(",", "").replace(" ", "_")
        title = f"{name}, of what is allowed"
        targets.at_most(title, difference / TOLERANCES[name], 1.0, "")
        targets.record(key, difference)
    unsafe = rule_of_slowest_pole(cases=1000, seed=2)
    print(f"half the limit of the slowest pole is unstable for {unsafe:.1%} of 1000 random A_d")
    targets.record("slowest_pole_unsafe", 100.0 * unsafe, "%")
    return targets.finish(keep=keeps())


if __name__ == "__main__":
    sys.exit(main())
