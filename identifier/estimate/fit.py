"""Tires from one log or several: blocks of ten minutes, their information added up.

Logs with a v_y are estimated by the balance (`solve`), those without by `latent`.
"""

import itertools
import logging
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from codegen.arrays import Array, one_thread, root_mean_square
from identifier.estimate.day import days_apart, long_segments, steering_zeros
from identifier.estimate.drive import FASTEST, Drive, hardest
from identifier.estimate.information import CHANGES, Information, coordinates
from identifier.estimate.latent import Learnt, accelerometer_off, latent_priors, learn_latent
from identifier.estimate.model import FittedModel
from identifier.estimate.nodes import Nodes
from identifier.estimate.posterior import Posterior, Reach, Segment
from identifier.estimate.priors import ANOTHER_ROAD, LEAST_DOUBT, Priors
from identifier.estimate.roads import Roads, road_of, with_roads
from identifier.estimate.solve import (
    ENOUGH,
    MOST_COUNT,
    STRIDE,
    around_beliefs,
    error_size,
    estimate,
    settled,
    simulate,
    softness,
)
from identifier.motion.parameters import INDEX, NAMES
from identifier.tire_model import GRIP
from models.recordings import Recording, joined
from models.vehicle import GRAVITY, Vehicle

_log = logging.getLogger("tireid.estimate")

_BLOCK = 600.0  # [s] that are estimated at once
_BLIND = 300.0  # [s] of a log without v_y that teach: those of hardest cornering
_ENOUGH_MORE = 1.0  # [nats] of improvement by a later block, below which it ends
_LONG = 599.0  # [s]: samples of logs of ten minutes and more are averaged
_COARSE = 2.0  # times the usual interval, to which they are averaged
_PLAY = INDEX["steering_play"]
# standard deviations of the front axle's softness, from which a play is asked for: of 12 full-size
# random cars with a play of .01 rad all had more (1.1 to 10), without one none (up to 0.9)
_SOFT = 1.0
_SURELY = 3.0  # standard deviations that a play is then from none
_REACHED = 0.25  # [s] for which a slip must have been exceeded to count as driven
_NOTHING_FITS = 0.15  # share of the force that tires of several logs miss, from which zeros of
_MUCH_LESS = 0.7  # each are tried, and times what they must miss then
_ANY_ZERO = 100.0  # of their priors' deviations: one log says nothing of another's zeros
_FORCELESS = 0.1  # static loads, rms, below which a log does not say
_ZEROS = [INDEX[name] for name in CHANGES]
_ROAD = INDEX["ln_road"]
Days: TypeAlias = Literal["found", "one", "each"]
_LASTS = 0.15  # [s] after which noise of a sedan's sensors is over, errors of its model are not


class _Fit(NamedTuple):
    """What logs taught: the model, the estimate behind it, and each block's own information.
    parts : when blocks begin, by the clock of their first log [s], and what they alone tell,
        zeros of a day of their own integrated out.
    """

    model: FittedModel
    posterior: Posterior
    parts: list[tuple[float, Information]]


@one_thread
def fit(
    recordings: Sequence[Recording],
    vehicle: Vehicle,
    priors: Priors | None = None,
    *,
    start: FittedModel | None = None,
    block: float = _BLOCK,
    coarse: bool = False,
    days: Days = "found",
    progress: Callable[[float], None] | None = None,
) -> _Fit:
    """Estimate the tires of a car from logs.
    recordings : logs of the car; a longer log is taken in blocks, and what these tell adds up.
    priors : beliefs; None takes those of the car.
    start : tires of this car from other logs: what these tell adds up with what the new ones do.
    block : longest time that is estimated at once [s].
    coarse : whether samples are averaged to twice the interval, as they are from ten minutes on.
    days : whether zeros of sensors are of all logs ("one"), of each ("each"), or of each where
        they clearly differ ("found").
    progress : called now and then with the share that is done, 0 to 1.

    Raises
    ------
    ValueError
        Where no sample is fast enough to count.
    RecordingError
        Where a log has neither v_y nor a_y.
    """
    before = priors or Priors.of(vehicle)
    parts: list[tuple[float, Information]] = []
    found: Posterior | None = None
    reach = Reach() if start is None else Reach(*start.reach[:5])
    earlier = Information.nothing() if start is None else _earlier(start, before)
    known, count, sd = Information.nothing(), 0.0, Priors.of(vehicle).sd
    total, done = sum(one.duration for one in recordings), 0.0
    coarse = coarse or total >= _LONG

    def went_on(seconds: float) -> None:
        nonlocal done
        done += seconds
        if progress is not None:
            progress(min(done / max(total, 1e-9), 1.0))

    measured = [one for one in recordings if one.logged_v_y is not None]
    if days == "each":
        measured = [part for one in measured for part in _alone(one, vehicle)]
    for drives in _blocks(measured, vehicle, block, coarse=coarse, alone=days == "each"):
        if not any(one.counts.any() for one in drives):
            continue
        last = found or start
        begin = None if last is None else last.p.copy()
        if begin is not None and (days == "each" or found is None):
            begin[[*_ZEROS, _ROAD]] = before.mean[[*_ZEROS, _ROAD]]
        enough = ENOUGH if begin is None else _ENOUGH_MORE
        share = MOST_COUNT / max(count, MOST_COUNT)
        beliefs = before.after(earlier + known.counted(share)) if last else before
        found = estimate(drives, vehicle, beliefs, begin, enough=enough)
        if not found.ended:
            _log.warning("%s: the descent ended at its limit, not where nothing was left to gain",
                        recordings[0].name)  # fmt: skip
        if start is not None and not parts and not start.covariance[_ROAD, _ROAD]:
            ratio = road_of(drives, vehicle, beliefs, found) or 1.0
            knows = all(one.identified for one in start.estimates() if one.title == GRIP)
            if ratio < 1.0 or (ratio > 1.0 and knows):  # a curve that goes on looks like more
                _log.warning("%s: its road has %.2f of the friction of the tires to begin with",
                             recordings[0].name, ratio)  # fmt: skip
                there = start.at_friction(ratio).band.on_another_road(ANOTHER_ROAD)
                return fit(recordings, vehicle, priors, start=there, block=block, coarse=coarse,
                           days=days)  # fmt: skip
        found, roads = with_roads(drives, vehicle, beliefs, found)
        here = _reach(drives, roads, found, vehicle)
        reach = reach.with_(here)
        part = Information.about(
            found.p, found.slope, found.curvature, sd, here.slip, found.seconds
        )
        part = part.of_one_day(_ANY_ZERO * sd[_ZEROS]) if days == "each" else part
        known, count = known + part, count + found.seconds / float(found.memory.min())
        parts.append((drives[0].begin, part))
        went_on(sum(len(one.signals) * one.dt for one in drives))
    share = MOST_COUNT / max(count, MOST_COUNT)
    parts = [(t, part.counted(share)) for t, part in parts]
    if found is not None and len(parts) > 1:
        p, covariance = settled(before.after(earlier + known.counted(share)), found.p)
        found = replace(found, p=p, covariance=covariance)
    if blinds := [one for one in recordings if one.logged_v_y is None]:
        last = found or (None if start is None else _next_day(start, sd))
        beliefs, blind = before if last is None else _after(before, last), joined(blinds)
        blind = replace(blind, delta_f=blind.delta_f - steering_zeros(blind, vehicle))
        off = accelerometer_off(blind, vehicle, latent_priors(vehicle, beliefs))
        sway, hard = float(beliefs.mean[INDEX["ln_sway"]]), hardest(blind, _BLIND)
        nodes = Nodes.of(blind, vehicle, hard, max(off.late, 0.0), sway)
        reach = reach.with_(Reach(a_y_late=off.late, a_y_place=off.place, a_y_instead=off.instead))
        if nodes.counts.any():
            learnt = learn_latent(nodes, vehicle, beliefs, off)
            found, reach = learnt.posterior, reach.with_(_reach_of_states(learnt))
        went_on(blind.duration)
    if found is None:
        raise ValueError(f"{recordings[0].name}: no sample is fast enough to learn from")
    model = FittedModel(vehicle=vehicle, p=found.p, covariance=found.covariance, reach=reach)
    soft = softness(found.p)[0][0] < -_SOFT  # as of wheels with play, or of zeros that differ
    if days == "found" and sum(len(_alone(one, vehicle)) for one in measured) > 1:

        def are_apart(by: FittedModel) -> bool:
            one_rate = len({one.dt for one in measured}) == 1
            return one_rate and bool(days_apart(joined(measured), vehicle, by.p, by.covariance))

        apart = are_apart(model)
        share = 0.0 if apart else _missed(measured, model)
        if apart or soft or share > _NOTHING_FITS:  # then tires tell no zeros apart
            each = fit(recordings, vehicle, priors, start=start, block=block, coarse=coarse,
                       days="each")  # fmt: skip
            if apart or _missed(measured, each.model) < _MUCH_LESS * share:
                return each
            if soft and are_apart(each.model):
                return each
    if soft and not before.moves[_PLAY]:
        loose = fit(recordings, vehicle, before.with_play(), start=start, block=block,
                    coarse=coarse, days=days)  # fmt: skip
        if loose.posterior.p[_PLAY] > _SURELY * loose.posterior.sd(NAMES[_PLAY]):
            return loose
    return _Fit(model, found, parts)


def _earlier(start: FittedModel, before: Priors) -> Information:
    """Return the information of the logs behind tires: what these are surer of than beliefs.

    Their sensors had zeros of their own, and another road that is doubted a friction of its own.
    """
    index, sd = np.flatnonzero(before.moves & (np.diag(start.covariance) > 0.0)), before.sd
    where, H = np.ix_(index, index), np.zeros_like(start.covariance)
    slope, curvature = around_beliefs(before, start.p)
    sure = np.linalg.inv((start.covariance + LEAST_DOUBT * np.diag(sd**2))[where])
    values, vectors = np.linalg.eigh(sure - curvature[where])
    H[where] = (vectors * np.maximum(values, 0.0)) @ vectors.T
    found = Information.about(start.p, -slope, H, sd, start.reach.slip, 0.0)
    found, doubt = found.of_one_day(sd[_ZEROS]), start.covariance[_ROAD, _ROAD]
    if doubt > 0.0:
        found = found.loosened(coordinates(start.p)[1][:, [_ROAD]], np.sqrt([doubt]))
    return found


def _next_day(start: FittedModel, sd: Array) -> FittedModel:
    """Return tires whose sensors are off by other zeros, on the road where they are."""
    covariance = start.covariance.copy()
    covariance[_ZEROS, _ZEROS] += sd[_ZEROS] ** 2 * (covariance[_ZEROS, _ZEROS] > 0.0)
    covariance[_ROAD, _ROAD] = 0.0
    return replace(start, covariance=covariance)


def _missed(recordings: Sequence[Recording], model: FittedModel) -> float:
    """Return the share of the force in the motion that tires miss of the worst axle and log."""
    shares = [0.0]
    for one in (part for whole in recordings for part in _alone(whole, model.vehicle)):
        drive = Drive.of(one, model.vehicle)
        v_x, r = drive.signals[drive.counts][:, [0, 2]].T
        rms = root_mean_square(v_x * r / GRAVITY)
        if rms <= _FORCELESS:
            continue
        for day in (None, model.on):  # its own zeros only where those of all do not do
            p = model.p if day is None else day(one).on(model.p)
            e = simulate(drive, p, model.vehicle)["residual"][drive.counts]
            share = float(np.sqrt(np.mean(e**2, axis=0)).max()) / rms
            if share <= _NOTHING_FITS:
                break
        shares.append(share)
    return max(shares)


def _alone(recording: Recording, vehicle: Vehicle) -> list[Recording]:
    """Return the segments of a log that are long enough for a day of their own, or the log."""
    long = long_segments(recording, vehicle)
    return [recording.taken(one) for one in long] if len(long) > 1 else [recording]


def _after(beliefs: Priors, found: Posterior | FittedModel) -> Priors:
    """Return what is believed after a block or of tires; what it does not tell stays as it was."""
    information, moves = beliefs.information.copy(), beliefs.moves.copy()
    index = np.flatnonzero(np.diag(found.covariance) > 0.0)
    information[index], information[:, index] = 0.0, 0.0
    where = np.ix_(index, index)
    information[where] = np.linalg.inv(found.covariance[where])
    moves[index] = True
    return replace(beliefs, mean=found.p, information=information, moves=moves, typed=(), data=None)


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


def _reach(
    drives: Sequence[Drive], roads: Roads | None, posterior: Posterior, vehicle: Vehicle
) -> Reach:
    """Return what drives reached, by the estimate of them."""
    found = Reach(segments=tuple(_segments(drives, roads)))
    later = _LASTS * min(vehicle.scale, 1.0)
    for i, one in enumerate(drives):
        on = one.counts
        if not on.any():
            continue
        if roads is not None:
            one = one.on(np.append(0.0, roads.ln_m)[roads.labels[i]])
        driven = simulate(one, posterior.p, vehicle)
        force = np.abs(one.signals[:, 0] * one.signals[:, 2]) / GRAVITY
        e = np.nan_to_num(driven["residual"] / error_size(force)[:, None])
        n = max(round(max(later, STRIDE) / one.dt), 1)
        together = on[n:] & on[:-n]
        slip, (speeds, a_x) = np.abs(driven["slip"][on]), _most(one.signals[on][:, [0, 5]])
        alike = (e[n:] * e[:-n])[together].sum(axis=0)
        pairs = float(np.count_nonzero(together))
        found = found.with_(Reach(_lasting(slip, one.dt), speeds, a_x, alike, pairs))
    return found


def _reach_of_states(learnt: Learnt) -> Reach:
    """Return what a drive without v_y reached, by its estimated states."""
    nodes, on = learnt.nodes, learnt.nodes.counts
    given, z = nodes.given[on], learnt.z[on]
    turning = np.abs(given[:, 0] * z[:, 1]) / GRAVITY
    speeds, a_x = _most(given[:, [0, 3]])
    return Reach(
        slip=_lasting(np.abs(z[:, 2:4]), nodes.dt),
        speeds=speeds,
        a_x=a_x,
        alike=np.sum((z[:, 4:6] / error_size(turning)[:, None]) ** 2, axis=0),
        pairs=float(len(z)),
        parted=learnt.parted,
    )


def _lasting(slip: Array, dt: float) -> Array:
    """Return the slip of each axle that is exceeded for `_REACHED`, (2,)."""
    k = min(max(round(_REACHED / dt), 1), len(slip))
    return np.partition(slip, len(slip) - k, axis=0)[-k]


def _most(signals: Array) -> Array:
    """Return the least and the largest of two signals but for outliers, (2, 2)."""
    return np.quantile(signals, [0.005, 0.995], axis=0).T


def _blocks(
    recordings: Sequence[Recording],
    vehicle: Vehicle,
    longest: float,
    *,
    coarse: bool,
    alone: bool = False,
) -> Iterator[list[Drive]]:
    """Yield drives that last no longer together.   alone : whether each is of one recording."""
    group: list[Drive] = []
    length = 0.0
    small = _COARSE * vehicle.scale < 1.0
    fastest = FASTEST * (_COARSE if coarse and not small else 1.0)
    for recording in recordings:
        n = max(round(longest / recording.dt), 1)
        count = -(-len(recording) // n)
        edges = np.linspace(0, len(recording), count + 1).astype(int)
        for begin, end in itertools.pairwise(edges):
            seconds = (end - begin) * recording.dt
            if (group and alone) or (group and length + seconds > longest):
                yield group
                group, length = [], 0.0
            part = slice(int(begin), int(end))
            group.append(Drive.of(recording, vehicle, part, fastest=fastest))
            length += seconds
    if group:
        yield group
