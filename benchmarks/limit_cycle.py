"""Beyond the gain limit: amplitude and frequency of the limit cycle, formula against identifier.

    python -m benchmarks.limit_cycle

A car corners steadily on saturated tires and the integral law runs at 1.2 to 3 times its sampled
limit. What the leakage leaves is a limit cycle: a line where lambda is near a, a circle where
lambda is 0.1 to 0.4 of it. Fails where a case is off by more than 5 % in amplitude or frequency.
"""

import sys
from typing import NamedTuple

import numpy as np

from benchmarks.random_drives import FORCE_UNIT, sampled_residual
from benchmarks.steady_cornering import network_input, random_corner
from benchmarks.targets import Targets, keeps
from codegen.arrays import Array
from identifier.paper.design import PaperIdentifier
from identifier.paper.laws import Gains, diagonal
from identifier.paper.network import Network
from identifier.run import identify
from identifier.stability.limit_cycle import LimitCycle, sampled_limit_cycle
from identifier.stability.limits import integral_euler_limit

ALLOWED = 5.0  # %
SLOW = (0.1, 0.4)  # lambda/a where the orbit is a circle
DURATION, WATCH, DT = 200.0, 60.0, 0.01  # s


class Case(NamedTuple):
    """One row: the design, the cycle by the formula, and that of the identifier."""

    a: float
    lam: float
    beyond: float
    formula: LimitCycle
    amplitude: float
    frequency: float

    @property
    def amplitude_ratio(self) -> float:
        """Amplitude of the identifier over that of the formula."""
        return self.amplitude / self.formula.amplitude

    @property
    def frequency_ratio(self) -> float:
        """Frequency of the identifier over that of the formula."""
        return self.frequency / self.formula.frequency


def dominant_frequency(signal: Array, dt: float) -> float:
    """Return the frequency of the largest peak of a signal's spectrum [rad/s].

    Parameters
    ----------
    signal : (n,).
    dt : sampling interval [s].
    """
    window = np.hanning(signal.size)
    spectrum = np.abs(np.fft.rfft((signal - signal.mean()) * window, 8 * signal.size))
    return float(2 * np.pi * np.argmax(spectrum) / (8 * signal.size * dt))


def random_case(rng: np.random.Generator, shares: tuple[float, float] | None = None) -> Case:
    """Return one random case.

    Parameters
    ----------
    rng : source of randomness.
    shares : range of lambda/a; None draws lambda and a alike.
    """
    corner = random_corner(rng, duration=DURATION)
    a, lam, beyond = rng.uniform(3.0, 10.0), rng.uniform(3.0, 10.0), rng.uniform(1.2, 3.0)
    if shares is not None:
        a = rng.uniform(6.0, 12.0)
        lam = a * rng.uniform(*shares)
    network, seed = Network(hidden=10), int(rng.integers(1 << 30))

    def design(eta_W: float, rho_W: float) -> PaperIdentifier:
        gains = Gains(
            A_d=diagonal(a), forgetting=lam, eta_W=eta_W, eta_V=0.0, rho_W=rho_W, rho_V=0.0
        )
        return PaperIdentifier(
            gains=gains, network=network, force_unit=FORCE_UNIT, dt=DT, seed=seed
        )

    g = beyond * integral_euler_limit(a, lam, DT)
    V = network.initial_weights(np.random.default_rng(seed)).V
    s = np.tanh(V @ network_input(corner, design(1.0, 1.0)))
    share = rng.uniform(0.02, 0.1)  # of the residual in the force that leakage lets W hold
    residual = float(np.linalg.norm(sampled_residual(corner.vehicle, corner.recording)[0]))
    rho_W = share * g / (a * lam * residual)
    formula = sampled_limit_cycle(a=a, lam=lam, g=g, rho_W=rho_W, dt=DT)
    # The residual of a corner has one direction, and an error that begins along it never leaves it,
    # stable or not: weights to begin with that point elsewhere take the symmetry away.
    W = rho_W * formula.amplitude * rng.standard_normal((2, network.hidden))
    judged = design(g / float(s @ s), rho_W)
    start = judged.frozen(corner.vehicle, {"W": W, "V": V})
    history = identify(corner.recording, corner.vehicle, judged, start)
    late = history.outputs["xi_tilde"][-round(WATCH / DT) :]
    return Case(
        a,
        lam,
        beyond,
        formula,
        amplitude=float(np.linalg.norm(late, axis=1).mean()),
        frequency=dominant_frequency(late[:, 0], DT),
    )


def largest(cases: list[Case]) -> tuple[float, float]:
    """Return the largest differences of amplitude and frequency [%].

    Parameters
    ----------
    cases : rows.
    """
    amplitude = max(abs(case.amplitude_ratio - 1.0) for case in cases)
    return 100.0 * amplitude, 100.0 * max(abs(case.frequency_ratio - 1.0) for case in cases)


def main() -> int:
    """Print a row for each case; 1 if one is off by more than is allowed."""
    rng, targets = np.random.default_rng(4), Targets("limit_cycle")
    kinds = {
        "near": [random_case(rng) for _ in range(16)],
        "slow": [random_case(rng, SLOW) for _ in range(12)],
    }
    print("    a    lam   g/limit   mean|xi_tilde| [kN s]   ratio    rad/s   ratio")
    for name, cases in kinds.items():
        for case in cases:
            print(
                f"{case.a:5.2f} {case.lam:6.2f} {case.beyond:9.2f} {case.amplitude:23.4f}"
                f"{case.amplitude_ratio:8.3f}{case.frequency:9.2f}{case.frequency_ratio:8.3f}"
            )
        amplitude, frequency = largest(cases)
        title = "lambda/a of 0.1 to 0.4" if name == "slow" else "lambda and a alike"
        targets.record(f"{name}/cases", len(cases))
        targets.at_most(f"{title}: amplitude", amplitude, ALLOWED, "%", f"{name}/amplitude")
        targets.at_most(f"{title}: frequency", frequency, ALLOWED, "%", f"{name}/frequency")
    return targets.finish(keep=keeps())


if __name__ == "__main__":
    sys.exit(main())
