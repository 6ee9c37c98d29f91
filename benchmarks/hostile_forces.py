"""The errors of the axle identifier's forces against what is certified of them, and drops.

See `benchmarks.hostile_axle`.
"""

from itertools import count
from typing import NamedTuple

import numpy as np

from benchmarks.hostile_drives import Case, blind, cases, drop, recording_of, told
from benchmarks.random_cars import FIRST_SEED
from benchmarks.targets import Targets, show
from codegen.arrays import Array
from identifier.axle import AxleIdentifier
from identifier.axle.along import Adjoint, Taught, adjoint, begin_error, taught_by
from identifier.axle.certificate import FrictionDrop
from identifier.axle.chosen import CHOSEN as AXLE_CHOSEN
from identifier.axle.covariance import unpacked
from identifier.axle.learning import ErrorState
from identifier.run import identify

IDENTITY = 1e-6  # of the error, that sums of thousands of terms may differ
SLIPS = np.array([0.01, 0.05, 0.15])  # rad, at which forces are looked at


def forward(taught: Taught, error: Array, noise: Array) -> Array:
    """Return the errors of the parameters after a drive, sample by sample (2, q).

    Parameters
    ----------
    error : before the first sample (2, q).
    noise : ε (N, 2).
    """
    theta = error.copy()
    for k in range(len(noise)):
        e = noise[k] - (taught.h[k] * theta).sum(axis=1)
        theta = theta + taught.gains[k] * (taught.counts[k] * e)[:, None] + taught.moved[k]
    return theta


def judge_errors(drives: int, t: Targets) -> None:
    """Judge the bound of the force error: the identity behind it, and its worst case.

    Parameters
    ----------
    drives : for each.
    t : takes the numbers.
    """
    wrong, unseen, passed, missed, plants, tight = 0, 0, 0, 0, 0, []
    for number, case in enumerate(cases(8, drives)):
        rng = np.random.default_rng([35, number])
        history = identify(recording_of(case.drive), case.vehicle, case.design)
        taught = taught_by(case.design, history)
        reach = adjoint(taught, np.tile(SLIPS, (2, 1)), case.design.ladder)
        found = identity(case, taught, reach, rng)
        wrong += not found[0]
        unseen += found[1]
        i, m = int(rng.integers(2)), int(rng.integers(SLIPS.size))
        most, reached, beyond, matter = worst(case, taught, reach, (i, m))
        passed += reached > most * (1.0 + IDENTITY)
        tight.append(reached / most)
        if matter:
            plants += 1
            missed += not beyond > most * (1.0 + IDENTITY)
    told(t, "identity", drives, wrong, drives, unseen)
    told(t, "worst", drives, passed, plants, missed)
    t.record("worst/least_of_bound", min(tight))
    show("worst: of its bound the error reaches at least", f"{min(tight):.6f}")


def identity(
    case: Case, taught: Taught, reach: Adjoint, rng: np.random.Generator
) -> tuple[bool, bool]:
    """Return whether the learnt forces err as the recursion says, for a random truth.

    And whether that also seems so with the gains of another design, by a tenth larger.

    Parameters
    ----------
    taught : by the drive.
    reach : of errors, at `SLIPS` of both axles.
    rng : source of the truth.
    """
    n, first = len(case.design.ladder), taught.theta[0]
    draws = rng.standard_normal(first.shape)
    truth = first + np.einsum("aij,aj->ai", np.linalg.cholesky(taught.begin), draws)
    noise = taught.e + (taught.h * (taught.theta[:-1] - truth)).sum(axis=2)
    units = np.tanh(SLIPS[:, None] / np.array(case.design.ladder))
    real = (taught.theta[-1] - truth)[:, :n] @ units.T
    begin = np.einsum("ami,ai->am", reach.begin, first - truth) + reach.moved
    learnt = np.einsum("nam,na->am", reach.g, noise)
    size = 1.0 + np.abs(begin) + np.einsum("nam,na->am", np.abs(reach.g), np.abs(noise))

    def holds(share: float) -> bool:
        return bool((np.abs(real - begin - share * learnt) <= IDENTITY * size).all())

    taught_nothing = bool((np.abs(learnt) <= 20.0 * IDENTITY * size).all())
    return holds(1.0), holds(1.1) and not taught_nothing


def worst(
    case: Case, taught: Taught, reach: Adjoint, at: tuple[int, int]
) -> tuple[float, float, float, bool]:
    """Return the bound of a force error, what the worst errors of y reach, and a twentieth more.

    And whether errors of y make a hundredth of the bound.

    Parameters
    ----------
    taught : by the drive.
    reach : of errors, at `SLIPS` of both axles.
    at : axle and slip.
    """
    i, m = at
    g, begin, told_ = reach.g[:, i, m], reach.begin[i, m], taught.declared[:, i]
    by_begin, by_told = float(begin_error(taught, reach)[i, m]), float(np.abs(g) @ told_)
    most = by_begin + by_told + abs(float(reach.moved[i, m]))
    side = 1.0 if reach.moved[i, m] >= 0.0 else -1.0
    error = np.zeros_like(taught.theta[0])
    error[i] = side * AXLE_CHOSEN.begin**2 * taught.begin[i] @ begin / max(by_begin, 1e-300)
    units = np.tanh(SLIPS[m] / np.array(case.design.ladder))
    ends = []
    for share in (1.0, 1.05):
        noise = np.zeros_like(taught.declared)
        noise[:, i] = share * side * np.sign(g) * told_
        ends.append(abs(float(units @ forward(taught, error, noise)[i, : units.size])))
    return most, ends[0], ends[1], by_told > 0.01 * most


class Followed(NamedTuple):
    """A drop: time for which both axles were half wrong [s], that with a blind design, the bound.

    fair : whether the conditions of the bound held.
    """

    time: float
    blind: float
    bound: float
    fair: bool


def followed(rng: np.random.Generator) -> Followed:
    """Drive through a drop of friction.

    Parameters
    ----------
    rng : source of the drive.
    """
    case, claim = drop(rng), FrictionDrop()
    car, v_x = case.vehicle, float(case.recording.v_x[0])
    design = AxleIdentifier.for_vehicle(car)
    n, loads = len(design.ladder), np.array(car.axle_loads)
    times = []
    for one in (design, blind(design)):
        history = identify(case.recording, car, one)
        force = history.axle_force / (loads * np.cos(case.delta))
        wrong = np.abs(force - case.force)[case.at :] > 0.25 * case.level
        both = wrong.all(axis=1)
        times.append((int(np.argmin(both)) if not both.all() else both.size) * one.dt)
        if one is design:
            state, before = history.state, np.abs(force - case.force)[case.at - 20 : case.at]
    at = slice(case.at, case.at + max(round(times[0] / design.dt), 1))
    W, x = state["W"][at], state["slip"][at, :, 0][:, :, None] / np.array(design.ladder)
    slopes = W / np.cosh(x) ** 2
    seen, slope = (
        np.abs((W * np.tanh(x) - slopes * x).sum(axis=2)),
        slopes / np.array(design.ladder),
    )
    P = unpacked(state["UD"][case.at], n + 3)
    h = np.zeros((2, n + 3))
    h[:, :n], h[:, -1] = np.tanh(x[0]), slope[0].sum(axis=1) * [1.0, 1.0 / v_x]
    unsure = np.sqrt(np.einsum("ai,aij,aj->a", h, P, h))
    A, b, E, _ = state["change"].reshape(-1, 4)[at].T
    change, slow = design.change, ErrorState(*state["errors"][case.at].T).slow
    taken = b**2 / (A + change.spread**-2)
    alike = taken >= change.explains * E
    fair = (
        seen.min() >= claim.seen
        and slope.sum(axis=2).max() <= claim.slope
        and unsure.max() <= claim.unsure
        and alike[taken >= 2.0 * change.evidence].all()
        and slow.max() <= claim.errors
        and before.max() <= claim.noise
    )
    bound = claim.time(design, case.level, v_x)
    return Followed(times[0], times[1], bound, bool(fair))


def judge_drops(drives: int, t: Targets) -> None:
    """Judge the time to follow a drop of friction.

    Parameters
    ----------
    drives : that keep the conditions.
    t : takes the numbers.
    """
    found, left_out = [], 0
    for number in count(FIRST_SEED):
        one = followed(np.random.default_rng([36, number]))
        if one.fair:
            found.append(one)
        else:
            left_out += 1
        if len(found) == drives:
            break
    late = sum(not one.time <= one.bound for one in found)
    unseen = sum(not one.blind > one.bound for one in found)
    told(t, "drop", drives, late, len(found), unseen)
    ratio = [one.bound / one.time for one in found]
    t.record("drop/left_out", left_out)
    t.record("drop/longest", max(one.time for one in found), "s")
    t.record("drop/bound_longest", max(one.bound for one in found), "s")
    t.record("drop/bound_over_seen", float(np.median(ratio)))
    show("drop: bound over time, median", f"{np.median(ratio):.2f} ({left_out} left out)")
