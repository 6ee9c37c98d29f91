"""Certificates against drives that try to break them: is every pass true, and how dear is that?

    python -m benchmarks.hostile_certificates [DESIGNS [ROUNDS]] [--record]

For each law and integrator DESIGNS random designs about the border of the certificate are judged,
with a car, conditions of driving and sensors of their own. Each that passes drives, in the
conditions that it declares: steering as sums of sines, slaloms and ramps at the limits of slip,
angle and rate, sensors that err as much as they may, weights that are resumed up to the proven
bound. Where the error comes nearest to its bound, hill climbing on drives and gains looks for
worse. No bound of a pass may be passed, and none may diverge.

What the caution costs: benchmarks/hostile_verdicts.json holds which of the same designs passed in
version 0.1.0, with the bound on the error that was stated. A design is fine that on the same drives
neither diverges nor passes that bound nor throws V beyond ten times its start (its units are then
saturated for good), and has lambda dt <= 1, which every proof needs. Of those at least 90 % must
still pass.
"""

import json
import math
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.hostile_designs import HIDDEN, INPUTS, INTEGRATORS, LAWS, UNIT, Case, random_cases
from benchmarks.monte_carlo import (
    Beginning,
    Drives,
    driven,
    first_weights,
    largest_norms,
    measured,
    within,
)
from benchmarks.targets import Targets, keeps
from codegen.arrays import Array
from identifier.driving import SPEED_SPREAD, Driving
from identifier.paper.design import PaperIdentifier
from identifier.paper.laws import LAWS as KNOWN
from identifier.paper.laws import Gains
from identifier.paper.network import Network
from identifier.stability import Certificate, certify
from identifier.stability.checks import bound_checks, drift_check, dynamics_checks
from identifier.stability.loop import direction_matrix
from identifier.stability.operation import (
    declared_signals,
    largest_steering_rate,
    proven_bounds,
)
from models.vehicle import Vehicle

FROZEN = Path(__file__).parent / "hostile_verdicts.json"
DRIVES, DURATION, GENES = 8, 8.0, 24
SOFTER, TRIES = 0.7, 6  # steering of a drive that breaks a condition, and how often
PROCESSES = 2
CLIMBED = 4  # designs of each law and integrator that are climbed on
TOLERANCE = 1e-9
THROWN = 10.0 * 2.0 * math.sqrt(HIDDEN * INPUTS)  # |V| that has run away


class Attack(NamedTuple):
    """What drives did to a design: |ξ̃|, |W|, |V| over their bounds (N, 3), largest |ξ̃| and |V|."""

    ratios: Array
    error: float
    V: float

    @property
    def worst(self) -> float:
        """Largest ratio; inf where a drive diverged."""
        return float(np.where(np.isfinite(self.ratios), self.ratios, np.inf).max(initial=0.0))

    @property
    def diverged(self) -> bool:
        """Whether the identifier ran away."""
        return not np.isfinite(self.error)


def design_of(case: Case) -> PaperIdentifier:
    """Return the design of a case, with its declared conditions.

    Parameters
    ----------
    case : plain numbers.
    """
    return PaperIdentifier(
        gains=Gains(**case.gains),
        network=Network(hidden=HIDDEN),
        force_unit=UNIT,
        driving=Driving(**case.driving),
        **case.settings,
    )


def certificate_of(design: PaperIdentifier, vehicle: Vehicle) -> Certificate:
    """Return the certificate, as `tireid check` does.

    Parameters
    ----------
    design : with its declared conditions.
    vehicle : the car.
    """
    assert design.driving is not None
    chosen = KNOWN[design.law]
    return certify(design.gains, chosen, design.operation(vehicle, design.driving))


def may_pass(design: PaperIdentifier, vehicle: Vehicle) -> bool:
    """Return whether the quick part of the certificate passes; it saves the rest where it does not.

    Parameters
    ----------
    design : with its declared conditions.
    vehicle : the car.
    """
    assert design.driving is not None
    chosen, gains = KNOWN[design.law], design.gains
    law, D = chosen.error(gains.lead), direction_matrix(chosen, gains.matrix)
    task = design.operation(vehicle, design.driving)
    found = proven_bounds(gains, law, task, D)
    entries = [
        *dynamics_checks(gains, task),
        drift_check(gains, law, task, D),
        *bound_checks(gains, law, task, D, found),
    ]
    return all(entry.status == "pass" for entry in entries)


def proven(certificate: Certificate) -> Array:
    """Return the smallest proven bounds of |ξ̃|, |W| and |V| (3,); inf where none is stated.

    Parameters
    ----------
    certificate : the properties.
    """
    known = {entry.name: entry.value for entry in certificate.properties}
    error = min(known.get("error_bound", math.inf), known.get("projection_bound", math.inf))
    return np.array([error, known.get("weight_bound", math.inf), known.get("V_bound", math.inf)])


def hostile_drives(vehicle: Vehicle, driving: Driving, genes: Array, dt: float) -> Drives:
    """Return those drives of the genes that keep the conditions, made softer until they do.

    Parameters
    ----------
    vehicle : the car.
    driving : the declared conditions.
    genes : (N, 24) in 0 to 1: road, kind, frequencies, shares, phases, angle, rear, speed.
    dt : sampling interval [s].
    """
    t = np.arange(round(DURATION / dt)) * dt
    signals, rates = declared_signals(vehicle, driving), largest_steering_rate(vehicle, driving)
    omega = 2.0 * np.pi * driving.bandwidth * (0.05 + 0.95 * genes[:, 2:8])
    phase, share = 2.0 * np.pi * genes[:, 8:14], genes[:, 14:20] + 1e-3
    sines = np.sin(omega[:, :, None] * t + phase[:, :, None])
    wave = np.einsum("ki,kit->kt", share, sines)
    wave /= np.abs(wave).max(axis=1, keepdims=True)
    single = sines[:, 0]
    ramps = np.clip(single * (2.0 + 6.0 * genes[:, 21:22]), -1.0, 1.0)
    kind = genes[:, 1:2]
    wave = np.where(kind < 0.4, wave, np.where(kind < 0.7, single, ramps))
    wave = wave * np.clip(t / 0.5, 0.0, 1.0) ** 2
    road = driving.friction * (0.2 + 0.8 * genes[:, 0])
    angle = signals["delta_f"] * (0.1 + 0.9 * genes[:, 20])
    rear = np.where(genes[:, 22] < 0.6, 0.0, 0.6 * (genes[:, 22] - 0.8))
    sway = np.sin(2.0 * np.pi * (0.03 + 0.07 * genes[:, 23:24]) * t + phase[:, :1])
    speed = driving.v_x * (1.0 + SPEED_SPREAD * sway)
    fastest = np.abs(np.diff(wave, axis=1)).max(axis=1) / dt
    angle = np.minimum(angle, 0.999 * rates[0] / np.maximum(fastest, 1e-9))
    found: list[Drives] = []
    left = np.arange(len(genes))
    for _ in range(TRIES):
        steering = angle[left, None] * wave[left]
        u = np.stack([steering, rear[left, None] * steering], axis=-1)
        drives = driven(vehicle, u, speed[left], road[left], dt)
        good = within(vehicle, drives, driving, dt)
        found.append(Drives(*(values[good] for values in drives)))
        angle[left] *= SOFTER
        left = left[~good]
        if not left.size:
            break
    return Drives(*(np.concatenate(values) for values in zip(*found, strict=True)))


def attack(
    design: PaperIdentifier, vehicle: Vehicle, bounds: Array, genes: Array, rng: np.random.Generator
) -> Attack:
    """Drive a design hard; return what it did beside its bounds.

    Parameters
    ----------
    design : the design.
    vehicle : the car.
    bounds : of |ξ̃|, |W| and |V| (3,).
    genes : of the drives (N, 24).
    rng : source of noise and first weights.
    """
    assert design.driving is not None
    drives = hostile_drives(vehicle, design.driving, genes, design.dt)
    if not len(drives.v_x):
        return Attack(np.zeros((0, 3)), 0.0, 0.0)
    V_start = 2.0 * math.sqrt(HIDDEN * len(design.network.inputs))
    W_start = min(bounds[1], design.gains.W_max)
    beginning = Beginning(
        W=W_start if math.isfinite(W_start) else 0.0, V=min(V_start, design.gains.V_max)
    )
    weights = first_weights(design, len(drives.v_x), beginning, rng)
    seen = measured(drives, design.driving, rng)
    norms = np.column_stack(largest_norms(design, vehicle, seen, weights))
    error = norms[:, 0].max() if np.isfinite(norms).all() else math.inf
    finite = np.where(np.isfinite(norms), norms, np.finfo(np.float64).max)
    return Attack(finite / bounds, float(error), float(finite[:, 2].max()))


def climbed(
    design: PaperIdentifier, vehicle: Vehicle, rounds: int, rng: np.random.Generator
) -> tuple[float, bool, int]:
    """Climb on drives and gains while the certificate passes; worst ratio, diverged, attacks.

    The learnt rates of W and V, both leakages, λ and A_d are changed with the drives.

    Parameters
    ----------
    design : a design that passes.
    vehicle : the car.
    rounds : generations.
    rng : source of randomness.
    """
    genes = rng.random((DRIVES, GENES))
    best, ratio, wild = design, 0.0, False
    for _ in range(rounds):
        factors = dict(
            zip(
                ("eta_W", "eta_V", "rho_W", "rho_V", "forgetting"),
                np.exp(0.3 * rng.standard_normal(5)),
                strict=True,
            )
        )
        changed = {name: factor * getattr(best.gains, name) for name, factor in factors.items()}
        trial = replace(best, gains=replace(best.gains, **changed))
        certificate = certificate_of(trial, vehicle)
        if certificate.verdict != "pass":
            trial, certificate = best, certificate_of(best, vehicle)
        children = np.clip(genes + 0.15 * rng.standard_normal(genes.shape), 0.0, 1.0)
        found = attack(trial, vehicle, proven(certificate), children, rng)
        wild |= found.diverged
        if found.worst > ratio:
            best, ratio, genes = trial, found.worst, children
    return ratio, wild, rounds


class Found(NamedTuple):
    """What came of the designs of one law and integrator."""

    passes: int
    exceeded: int
    diverged: int
    worst: float
    error_worst: float
    climbed: float
    generations: int
    untrue_before: int
    fine_before: int
    kept: int


def searched(
    law: str, integrator: str, count: int, rounds: int, frozen: dict[str, float | None]
) -> Found:
    """Attack the designs of a law and an integrator.

    Parameters
    ----------
    law, integrator : which.
    count : number of designs.
    rounds : of hill climbing.
    frozen : by number of the design, the bound of |ξ̃| that version 0.1.0 stated where it passed.
    """
    rng = np.random.default_rng([7, LAWS.index(law), INTEGRATORS.index(integrator)])
    cases = random_cases(law, integrator, count)
    passes, exceeded, diverged, worst = 0, 0, 0, 0.0
    fine, kept, untrue, error_worst = 0, 0, 0, 0.0
    front: list[tuple[float, Case, PaperIdentifier]] = []
    for i, case in enumerate(cases):
        design, before = design_of(case), str(i) in frozen
        if not (before or may_pass(design, case.vehicle)):
            continue
        certificate = certificate_of(design, case.vehicle)
        good = certificate.verdict == "pass"
        if not (good or before):
            continue
        genes = rng.random((DRIVES, GENES))
        found = attack(design, case.vehicle, proven(certificate), genes, rng)
        if good:
            passes += 1
            exceeded += found.worst > 1.0 + TOLERANCE
            diverged += found.diverged
            worst = max(worst, found.worst)
            front.append((float(found.ratios[:, 0].max(initial=0.0)), case, design))
            error_worst = max(error_worst, front[-1][0])
        if before:
            stated = frozen[str(i)]
            true = not found.diverged and found.error <= (math.inf if stated is None else stated)
            untrue += not true
            true = true and design.gains.forgetting * design.dt <= 1.0 and found.V <= THROWN
            fine += true
            kept += true and good
    front.sort(key=lambda entry: -entry[0])
    attacks, climb_worst = 0, 0.0
    for _, case, design in front[:CLIMBED]:
        ratio, wild, tried = climbed(design, case.vehicle, rounds, rng)
        exceeded += ratio > 1.0 + TOLERANCE
        diverged += wild
        attacks, climb_worst = attacks + tried, max(climb_worst, ratio)
    return Found(
        passes, exceeded, diverged, worst, error_worst, climb_worst, attacks, untrue, fine, kept
    )


def told(law: str, integrator: str, count: int, before: int, found: Found, t: Targets) -> None:
    """Print and keep what came of the designs.

    Parameters
    ----------
    law, integrator : which.
    count : number of designs.
    before : of which passed in version 0.1.0.
    found : of `searched`.
    t : takes the numbers.
    """
    key, name, most = f"{law}/{integrator}", f"{law}, {integrator}", 1.0 + TOLERANCE
    print(
        f"{name}: {found.passes} of {count} designs pass, {found.generations} generations climbed"
    )
    t.record(f"{key}/designs", count)
    t.record(f"{key}/passes", found.passes)
    t.record(f"{key}/passes_before", before)
    t.record(f"{key}/untrue_before", found.untrue_before)
    t.record(f"{key}/fine_before", found.fine_before)
    t.record(f"{key}/generations", found.generations)
    t.record(f"{key}/error_worst", found.error_worst)
    t.at_most(f"{name}: untrue passes", found.exceeded, 0, "", f"{key}/exceeded")
    t.at_most(f"{name}: passes that diverged", found.diverged, 0, "", f"{key}/diverged")
    title = f"{name}: largest |ξ̃|, |W| or |V| over its bound"
    t.at_most(title, found.worst, most, "", f"{key}/worst")
    t.at_most(f"{name}: the same, climbed", found.climbed, most, "", f"{key}/climbed")
    share = 100.0 * found.kept / found.fine_before if found.fine_before else 100.0
    title = f"{name}: of {found.fine_before} that passed before and are fine, pass"
    t.at_least(title, share, 90.0, "%", f"{key}/kept")


def totals(t: Targets) -> None:
    """Record sums and extremes over laws and integrators.

    Parameters
    ----------
    t : what was recorded of each.
    """

    def of_all(key: str) -> list[float]:
        return [float(v) for k, v in list(t.values.items()) if k.endswith(f"/{key}")]

    for key in ("designs", "generations", "passes", "passes_before", "untrue_before"):
        t.record(f"all/{key}", round(sum(of_all(key))))
    for key in ("exceeded", "diverged"):
        t.record(f"all/{key}", round(sum(of_all(key))))
    t.record("all/kept_least", min(of_all("kept")), "%")
    t.record("all/kept_most", max(of_all("kept")), "%")
    t.record("all/error_worst_most", max(of_all("error_worst")))


def main(count: int = 2000, rounds: int = 25) -> int:
    """Attack every law and integrator; 1 if a pass was untrue, or too many were lost.

    Parameters
    ----------
    count : designs of each law and integrator.
    rounds : generations of hill climbing on each of the worst designs.
    """
    keep, begin = keeps(), time.perf_counter()
    targets = Targets("hostile_certificates")
    frozen = json.loads(FROZEN.read_text(encoding="utf-8"))
    kinds = [(law, integrator) for law in LAWS for integrator in INTEGRATORS]
    passed = [
        {i: X for i, X in frozen["passed"]["/".join(kind)].items() if int(i) < count}
        for kind in kinds
    ]
    with ProcessPoolExecutor(PROCESSES) as pool:
        jobs = [
            pool.submit(searched, *kind, count, rounds, before)
            for kind, before in zip(kinds, passed, strict=True)
        ]
        for kind, before, job in zip(kinds, passed, jobs, strict=True):
            told(*kind, count, len(before), job.result(), targets)
    totals(targets)
    print(f"in {time.perf_counter() - begin:.0f} s")
    return targets.finish(keep=keep)


if __name__ == "__main__":
    sys.exit(main(*(int(word) for word in sys.argv[1:] if word != "--record")))
