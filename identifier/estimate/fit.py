"""Tires from one log or several: blocks of ten minutes, their information added up."""

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from codegen.arrays import Array
from identifier.estimate.drive import FASTEST, Drive
from identifier.estimate.model import FittedModel, Segment
from identifier.estimate.posterior import Posterior
from identifier.estimate.priors import SEDAN, Priors
from identifier.estimate.roads import Roads, with_roads
from identifier.estimate.solve import ENOUGH, STRIDE, error_size, estimate, simulate
from models.recordings import Recording
from models.vehicle import GRAVITY, Vehicle

BLOCK = 600.0  # [s] that are estimated at once
ENOUGH_MORE = 1.0  # [nats] of improvement by a later block, below which it ends
LONG, COARSE = (
    3600.0,
    2.0,
)  # [s] of logs from which samples are averaged to intervals so much longer
REACHED = 0.25  # [s] for which a slip must have been exceeded to count as driven
LASTS = 0.15  # [s] after which noise of a sedan's sensors is over, errors of its model are not


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
    """Estimate the tires of a car from logs with a v_y, with the same sensors.

    Parameters
    ----------
    recordings : logs of the car; a log longer than ten minutes is taken in blocks.
    priors : beliefs; None takes those of the car.
    progress : called now and then with the share that is done, 0 to 1.

    Raises
    ------
    ValueError
        Where no sample is fast enough to count.
    """
    beliefs = Priors.of(vehicle) if priors is None else priors
    total = sum(one.duration for one in recordings)
    done, reach, found = 0.0, Reach(), None
    segments: list[Segment] = []
    for drives in _blocks(recordings, vehicle):
        if not any(one.counts.any() for one in drives):
            continue
        begin = None if found is None else found.p
        enough = ENOUGH if begin is None else ENOUGH_MORE
        found = estimate(drives, vehicle, beliefs, begin, enough=enough)
        found, roads = with_roads(drives, vehicle, beliefs, found)
        segments += _segments(drives, roads)
        reach = reach.and_of(drives, roads, found, vehicle)
        information = np.zeros_like(beliefs.information)
        information[np.ix_(found.index, found.index)] = found.information
        beliefs = replace(beliefs, mean=found.p, information=information, typed=())
        done += sum(len(one.signals) * one.dt for one in drives)
        if progress is not None:
            progress(min(done / max(total, 1e-9), 1.0))
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
        unexplained=np.sqrt(np.maximum(reach.alike, 0.0) / max(reach.pairs, 1)),
        segments=tuple(segments),
    )
    return Fit(model, found)


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
    """What drives reached: slip (2,) [rad], least and largest speed [m/s] and a_x [m/s²].

    alike, pairs : sum of products of what the model misses, over its size, at two times `LASTS`
    apart, (2,), and how many there are: white noise of the sensors has no part in it.
    """

    slip: Array = np.zeros(2)
    speeds: Array = np.array([np.inf, -np.inf])
    a_x: Array = np.array([np.inf, -np.inf])
    alike: Array = np.zeros(2)
    pairs: int = 0

    def and_of(
        self, drives: Sequence[Drive], roads: Roads | None, found: Posterior, vehicle: Vehicle
    ) -> "Reach":
        """Return what these drives reached, too."""
        slip, speeds, a_x, alike = (
            np.array(one) for one in (self.slip, self.speeds, self.a_x, self.alike)
        )
        pairs = self.pairs
        later = LASTS * min(float(np.sqrt(vehicle.wheelbase / SEDAN)), 1.0)
        for i, one in enumerate(drives):
            on = one.counts
            if not on.any():
                continue
            if roads is not None:
                one = one.on(np.concatenate([[0.0], roads.ln_m])[roads.labels[i]])
            driven = simulate(one, found.p, vehicle)
            size = np.abs(driven["slip"][on])
            force = np.abs(one.signals[:, 0] * one.signals[:, 2]) / GRAVITY
            e = np.nan_to_num(driven["missed"] / error_size(force)[:, None])
            n = max(round(max(later, STRIDE) / one.dt), 1)
            both = on[n:] & on[:-n]
            alike += (e[n:] * e[:-n])[both].sum(axis=0)
            pairs += int(np.count_nonzero(both))
            k = min(max(round(REACHED / one.dt), 1), len(size))
            slip = np.maximum(slip, np.partition(size, len(size) - k, axis=0)[-k])
            for both, column in ((speeds, 0), (a_x, 5)):
                low, high = np.quantile(one.signals[on, column], [0.005, 0.995])
                both[:] = min(both[0], low), max(both[1], high)
        return Reach(slip, speeds, a_x, alike, pairs)


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
