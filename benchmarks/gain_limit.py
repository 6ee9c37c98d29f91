"""The gain limit of the integral law: 6x6 loop against the identifier itself.

    python -m benchmarks.gain_limit

A car corners steadily on saturated tires. The identifier settles at a low gain; then its weights
are disturbed by a millionth and the gain is bisected until the disturbance neither grows nor
decays. The table compares that gain with the limit that the 6x6 loop predicts at the settled
weights (both layers learn, Euler and Runge-Kutta, A_d with and without coupling). Fails where a
case is off by more than 1 % with measured input, 8 % where the network reads its own estimate.
"""

import sys
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from benchmarks.limits import integral_limit
from benchmarks.random_drives import FORCE_UNIT
from benchmarks.steady_cornering import Corner, loop_at, random_corner
from benchmarks.targets import Targets, keeps
from identifier.paper.design import PaperIdentifier
from identifier.paper.laws import Gains
from identifier.paper.network import Network, Weights
from identifier.run import identify
from identifier.stability.loop import INTEGRAL, INTEGRATORS, Loop
from identifier.stability.margins import gain_margin
from identifier.stability.operation import estimated_input_feedback, minimal_decay

ALLOWED = {"measured": 1.0, "estimated": 8.0}  # %
SETTLE, WATCH = 150.0, 40.0  # s


class Case(NamedTuple):
    """One row: what was run, the predicted and the found factor on eta_W and eta_V."""

    source: str
    integrator: str
    n_h: int
    a: float
    lam: float
    coupled: bool
    predicted: float
    found: float

    @property
    def ratio(self) -> float:
        """Found over predicted limit."""
        return self.found / self.predicted


def scaled(design: PaperIdentifier, factor: float) -> PaperIdentifier:
    """Return the design with both learning rates multiplied."""
    gains = design.gains
    return replace(
        design, gains=replace(gains, eta_W=factor * gains.eta_W, eta_V=factor * gains.eta_V)
    )


def grows(corner: Corner, design: PaperIdentifier, weights: Weights) -> bool:
    """Return whether a disturbance of a millionth grows, in the end or a hundredfold on the way."""
    state = {"W": weights.W * (1.0 + 1e-6), "V": weights.V}
    start = design.frozen(corner.vehicle, state)
    history = identify(corner.recording, corner.vehicle, design, start)
    error = np.linalg.norm(history.outputs["xi_tilde"], axis=1)
    n, first_second = error.size, round(1.0 / design.dt)
    middle, end = error[n // 2 : 3 * n // 4].max(), error[3 * n // 4 :].max()
    return not end < middle or bool(error.max() > 100.0 * error[:first_second].max())


def shortened(corner: Corner, duration: float) -> Corner:
    """Return the first seconds of a corner."""
    recording = corner.recording
    n = round(duration / recording.dt)
    names = ("t", "v_x", "v_y", "r", "delta_f", "delta_r")
    return corner._replace(
        recording=replace(recording, **{name: getattr(recording, name)[:n] for name in names})
    )


def random_case(rng: np.random.Generator, source: str, integrator: str, coupled: bool) -> Case:
    """Return one random case.

    Parameters
    ----------
    rng : source of randomness.
    source : "measured" or "estimated".
    integrator : "euler" or "rk4".
    coupled : whether A_d has elements off its diagonal.
    """
    corner = random_corner(rng, duration=SETTLE)
    car, v_x = corner.vehicle, float(corner.recording.v_x[0])
    a, lam = rng.uniform(4.0, 10.0), rng.uniform(4.0, 10.0)
    if source == "estimated":
        lost = (car.cornering_stiffness_front, car.cornering_stiffness_rear)
        feedback = estimated_input_feedback(
            m=car.mass,
            I_z=car.yaw_inertia,
            l_f=car.l_f,
            l_r=car.l_r,
            stiffness_lost=lost,
            v_x=v_x,
        )
        a = max(a, 1.5 * minimal_decay(feedback))
    n_h = int(rng.choice([5, 10, 20]))
    off = (0.3 * a, -0.15 * a) if coupled else (0.0, 0.0)
    eta_W = 0.15 * integral_limit(a, lam) / n_h
    gains = Gains(
        A_d=((-a, off[0]), (off[1], -a)),
        forgetting=lam,
        eta_W=eta_W,
        eta_V=0.05 * eta_W,
        rho_W=0.02,
        rho_V=0.02,
    )
    design = PaperIdentifier(
        gains=gains,
        network=Network(hidden=n_h),
        input_source=source,
        integrator=integrator,
        force_unit=FORCE_UNIT,
        seed=int(rng.integers(1 << 30)),
    )
    state = identify(corner.recording, car, design).state_at(SETTLE)
    weights = Weights(W=state["W"], V=state["V"])
    G, feedback = loop_at(corner, design, weights)
    loop = Loop(
        A_d=gains.matrix,
        forgetting=lam,
        law=INTEGRAL,
        G=G,
        input_feedback=feedback if source == "estimated" else None,
    )
    predicted = gain_margin(loop, INTEGRATORS[integrator], design.dt).factor
    corner = shortened(corner, WATCH)
    low, high = np.log(predicted / 2.0), np.log(predicted * 2.0)
    for _ in range(13):
        middle = (low + high) / 2.0
        if grows(corner, scaled(design, float(np.exp(middle))), weights):
            high = middle
        else:
            low = middle
    found = float(np.exp((low + high) / 2.0))
    return Case(source, integrator, n_h, a, lam, coupled, predicted, found)


def cases(seed: int, each: int = 4) -> list[Case]:
    """Return random cases: both inputs, both integrators, A_d with and without coupling.

    Parameters
    ----------
    seed : of the cases.
    each : cases of a kind.
    """
    rng = np.random.default_rng(seed)
    kinds = (("euler", False), ("euler", True), ("rk4", False), ("rk4", True))
    return [
        random_case(rng, source, integrator, coupled)
        for source in ALLOWED
        for integrator, coupled in kinds
        for _ in range(each)
    ]


def main() -> int:
    """Print a row for each case; 1 if one is off by more than is allowed."""
    table = cases(seed=3)
    print("input      step   n_h      a    lam  A_d      limit by 6x6  by bisection   ratio")
    for case in table:
        kind = "coupled" if case.coupled else "-a I"
        print(
            f"{case.source:10s} {case.integrator:5s} {case.n_h:4d} {case.a:6.2f} {case.lam:6.2f}"
            f"  {kind:8s}{case.predicted:13.4f}{case.found:14.4f}{case.ratio:8.4f}"
        )
    targets = Targets("gain_limit")
    targets.record("cases", len(table))
    for source, allowed in ALLOWED.items():
        off = [100.0 * abs(case.ratio - 1.0) for case in table if case.source == source]
        title = f"largest difference of {len(off)} cases, input {source}"
        targets.at_most(title, max(off), allowed, "%", f"{source}/difference")
    return targets.finish(keep=keeps())


if __name__ == "__main__":
    sys.exit(main())
