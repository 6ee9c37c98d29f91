"""Drops of friction against the time in which the axle identifier is certified to follow them.

See `benchmarks.hostile_axle`.
"""

from itertools import count
from typing import NamedTuple

import numpy as np

from benchmarks.hostile_drives import blind, drop, told
from benchmarks.random_cars import FIRST_SEED
from benchmarks.targets import Targets, show
from identifier.axle import AxleIdentifier
from identifier.axle.certificate import FrictionDrop
from identifier.axle.covariance import unpacked
from identifier.axle.learning import ErrorState
from identifier.run import identify


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
