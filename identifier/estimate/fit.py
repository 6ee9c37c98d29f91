"""Tires from one log or several: blocks of ten minutes, their information added up.

Logs with a v_y are estimated by the balance (`solve`), those without by `latent`.
"""

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from codegen.arrays import Array
from identifier.estimate.drive import FASTEST, Drive
from identifier.estimate.latent import Learnt, lateness, latent_priors, learn_latent
from identifier.estimate.model import FittedModel, Segment
from identifier.estimate.nodes import Nodes
from identifier.estimate.posterior import Posterior
from identifier.estimate.priors import SEDAN, Priors
from identifier.estimate.roads import Roads, with_roads
from identifier.estimate.solve import ENOUGH, estimate, simulate
from models.recordings import Recording
from models.vehicle import Vehicle

BLOCK = 600.0  # [s] that are estimated at once
ENOUGH_MORE = 1.0  # [nats] of improvement by a later block, below which it ends
LONG, COARSE = (
    3600.0,
    2.0,
)  # [s] of logs from which samples are averaged to intervals so much longer
REACHED = 0.25  # [s] for which a slip must have been exceeded to count as driven
MISSED = 0.06  # of the force, by which drives of one car differ from one model; of one log a belief


class Fit(NamedTuple):
    """What logs taught: the model, and the estimate behind it."""

    model: FittedModel
    posterior: Posterior


def fit(
    recordings: Sequence[Recording],
    vehicle: Vehicle,
    priors: Priors | None = None,
    *,
    progress: Callable[[float], None] | None = None,
) -> Fit:
    """Estimate the tires of a car from logs, with the same sensors.

    Parameters
    ----------
    recordings : logs of the car; a log longer than ten minutes is taken in blocks.
    priors : beliefs; None takes those of the car.
    progress : called now and then with the share that is done, 0 to 1.

    Raises
    ------
    ValueError
        Where no sample is fast enough to count.
    RecordingError
        Where a log has neither v_y nor a_y.
    """
    beliefs = Priors.of(vehicle) if priors is None else priors
    total = sum(one.duration for one in recordings)
    done, reach, found, parted, late = 0.0, Reach(), None, 0.0, 0.0
    segments: list[Segment] = []

    def told(seconds: float) -> None:
        nonlocal done
        done += seconds
        if progress is not None:
            progress(min(done / max(total, 1e-9), 1.0))

    for drives in _blocks([one for one in recordings if one.logged_v_y is not None], vehicle):
        if not any(one.counts.any() for one in drives):
            continue
        begin = None if found is None else found.p
        enough = ENOUGH if begin is None else ENOUGH_MORE
        found = estimate(drives, vehicle, beliefs, begin, enough=enough)
        found, roads = with_roads(drives, vehicle, beliefs, found)
        segments += _segments(drives, roads)
        reach = reach.and_of(drives, found, vehicle)
        beliefs = _after(beliefs, found)
        told(sum(len(one.signals) * one.dt for one in drives))
    for blind in (one for one in recordings if one.logged_v_y is None):
        late = lateness(blind, vehicle, latent_priors(vehicle, beliefs))
        for nodes in _blocks_of_nodes(blind, vehicle, late):
            if not nodes.counts.any():
                continue
            learnt = learn_latent(nodes, vehicle, beliefs)
            found, parted = learnt.posterior, max(parted, learnt.parted)
            reach = reach.and_of_states(learnt)
            beliefs = _after(beliefs, found)
            told(len(nodes.t) * nodes.dt)
    if found is None:
        name = recordings[0].name
        raise ValueError(f"{name}: no sample is fast enough to learn from")
    model = FittedModel(
        vehicle=vehicle,
        p=found.p,
        covariance=found.covariance,
        driven=reach.slip,
        speeds=reach.speeds,
        a_x=reach.a_x,
        missed=np.full(2, MISSED),
        segments=tuple(segments),
        parted=parted,
        a_y_late=late,
    )
    return Fit(model, found)


def _after(beliefs: Priors, found: Posterior) -> Priors:
    """Return what is believed after a block; what it does not tell stays as it was."""
    information, moves = beliefs.information.copy(), beliefs.moves.copy()
    information[found.index], information[:, found.index] = 0.0, 0.0
    information[np.ix_(found.index, found.index)] = found.information
    moves[found.index] = True
    return replace(beliefs, mean=found.p, information=information, moves=moves, typed=())


def _segments(drives: Sequence[Drive], roads: Roads | None) -> list[Segment]:
    """Return the segments on another road than that of the curves, by the drives' clocks."""
    listed: list[Segment] = []
    if roads is None:
        return listed
    for one, labels in zip(drives, roads.labels, strict=True):
        edges = np.flatnonzero(np.diff(labels)) + 1
        for part in np.split(np.arange(len(labels)), edges):
            label = int(labels[part[0]])
            if label:
                ratio = float(np.exp(roads.ln_m[label - 1]))
                begin, end = float(one.t[part[0]]), float(one.t[part[-1]])
                listed.append(Segment(begin, end, ratio, ratio * float(roads.sd[label - 1])))
    return listed


class Reach(NamedTuple):
    """What drives reached: slip (2,) [rad], least and largest speed [m/s] and a_x [m/s²]."""

    slip: Array = np.zeros(2)
    speeds: Array = np.array([np.inf, -np.inf])
    a_x: Array = np.array([np.inf, -np.inf])

    def and_of(self, drives: Sequence[Drive], found: Posterior, vehicle: Vehicle) -> "Reach":
        """Return what these drives reached, too."""
        slip, speeds, a_x = (np.array(one) for one in self)
        for one in drives:
            on = one.counts
            if not on.any():
                continue
            size = np.abs(simulate(one, found.p, vehicle)["slip"][on])
            k = min(max(round(REACHED / one.dt), 1), len(size))
            slip = np.maximum(slip, np.partition(size, len(size) - k, axis=0)[-k])
            for both, column in ((speeds, 0), (a_x, 5)):
                low, high = np.quantile(one.signals[on, column], [0.005, 0.995])
                both[:] = min(both[0], low), max(both[1], high)
        return Reach(slip, speeds, a_x)

    def and_of_states(self, learnt: Learnt) -> "Reach":
        """Return what a drive without v_y reached, too, by its estimated states."""
        nodes, on = learnt.nodes, learnt.nodes.counts
        size, given = np.abs(learnt.z[on, 2:4]), nodes.given[on]
        k = min(max(round(REACHED / nodes.dt), 1), len(size))
        low, high = np.quantile(given[:, [0, 3]], [0.005, 0.995], axis=0)
        speeds, a_x = (
            np.array([min(have[0], low[i]), max(have[1], high[i])])
            for i, have in enumerate((self.speeds, self.a_x))
        )
        return Reach(
            np.maximum(self.slip, np.partition(size, len(size) - k, axis=0)[-k]), speeds, a_x
        )


def _blocks_of_nodes(recording: Recording, vehicle: Vehicle, late: float) -> Iterator[Nodes]:
    """Yield nodes of at most `BLOCK`, of a log whose a_y is late [s]."""
    count = -(-len(recording) // max(round(BLOCK / recording.dt), 1))
    edges = np.linspace(0, len(recording), count + 1).astype(int)
    for begin, end in itertools.pairwise(edges):
        yield Nodes.of(recording, vehicle, slice(int(begin), int(end)), a_y_late=late)


def _blocks(recordings: Sequence[Recording], vehicle: Vehicle) -> Iterator[list[Drive]]:
    """Yield drives of at most `BLOCK` together."""
    group: list[Drive] = []
    length = 0.0
    coarse = COARSE if sum(one.duration for one in recordings) > LONG else 1.0
    scale = min(float(np.sqrt(vehicle.wheelbase / SEDAN)), 1.0)
    for recording in recordings:
        n = max(round(BLOCK / recording.dt), 1)
        count = -(-len(recording) // n)
        edges = np.linspace(0, len(recording), count + 1).astype(int)
        for begin, end in itertools.pairwise(edges):
            seconds = (end - begin) * recording.dt
            if group and length + seconds > BLOCK:
                yield group
                group, length = [], 0.0
            part = slice(int(begin), int(end))
            fastest = FASTEST * (coarse if coarse * scale >= 1.0 else 1.0)
            group.append(Drive.of(recording, vehicle, part, fastest=fastest))
            length += seconds
    if group:
        yield group
