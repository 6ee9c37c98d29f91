"""Which friction a drive's road had, over that of the drive that taught the model.

On a road of μ times the friction a curve φ(α) becomes μ φ(α/μ): the stiffness stays, the force and
the slip of its peak change (similarity; Pacejka, Tire and Vehicle Dynamics, 3rd ed., section 4.1).
Windows of 0.3 s show the force of each axle without a tire. With a probability p_μ for each μ of a
grid, and one that no friction explains them, each window changes

    p ← [(1 - h) p + h p₀] L,     h = 1 - exp(-Δt/`_LASTS`),

scaled to a sum of one: a road goes on, or another begins, as likely as p₀ has it; L is how likely
its friction makes the measured force. The slip of each axle may be off by a zero, which each
friction estimates for itself and a road that begins takes over (interacting multiple models; Blom
and Bar-Shalom, IEEE Trans. Automatic Control 33, 1988): where tires do not slide, a friction tells
itself from a wrong zero by nothing. The answer at a time is from what came until then.
"""

import math
from typing import NamedTuple

import numpy as np

from codegen.arrays import Array
from identifier.band import LEVEL, normal_quantile
from identifier.evidence import evidence, modelled_force
from identifier.measured import with_doubt
from identifier.tire_model import GRIP, TireModel
from models.recordings import Recording
from models.recordings.portion import portion

_LEAST = 0.2  # of the grid of frictions, over that of the road that taught
_MOST = 2.5  # of the same grid
_FRICTIONS = 26  # frictions of the grid beside 1
_SPREAD = 0.7  # standard deviation of ln μ of another road
_LASTS = 60.0  # s: a road, on average
_AS_TAUGHT = 0.5  # probability that the drive begins on the road that taught
_UNEXPLAINED = 0.02  # of p₀, that no friction explains the force
_BESIDE = 0.02  # static axle loads: error of curves beside the band
_OF_FORCE = 0.07  # error of curves beside the band, over the force
_OF_ESTIMATE = 0.05  # static axle loads: by a v_y that was estimated with that model
_ZERO = 0.015  # rad: by so much the slip of another drive is off, as the zero of its steering is
_ANYTHING = 0.3  # static axle loads: of forces that no friction explains
_OVERLAP = 0.5  # of a window is new
_ANOTHER = 0.25  # |ln μ| from which a road counts as another
_SURE = 0.99  # probability from which another road is reported
_LIKELY = 0.5  # probability down to which it is taken to go on
_TWO_SIGMA = 2.0  # of its doubt: a friction nearer to that which taught is not reported
_SIMILAR = 0.1  # of ln μ: by so much roads of a tire are not similar


class Road(NamedTuple):
    """A segment of another friction than that of the drive that taught.
    first, last : from when to when it was reported, in the recording's own clock [s].
    ratio : friction over that of the drive that taught [-].   sd : standard deviation of it [-].
    """

    first: float
    last: float
    ratio: float
    sd: float

    @property
    def text(self) -> str:
        return (
            f"from {self.first:.4g} to {self.last:.4g} s the road has "
            f"{with_doubt(self.ratio, self.sd)} of the friction of the identification drive"
        )


class RoadFriction(NamedTuple):
    """Friction over that of the drive that taught, window by window of 0.3 s.
    t : end of the windows, in the recording's own clock [s], (m,).
    ratio : friction, mean of its logarithm [-], (m,).
    sd : standard deviation of the logarithm [-], (m,).
    another : probability that it is another, by more than a quarter, (m,).
    unexplained : probability that no friction explains the force, (m,).
    """

    t: Array
    ratio: Array
    sd: Array
    another: Array
    unexplained: Array

    @property
    def roads(self) -> tuple[Road, ...]:
        """Segments of another friction, each from when that is sure on until it is not likely."""
        likely = np.concatenate([[False], self.another >= _LIKELY, [False]])
        edges, found = np.flatnonzero(likely[1:] != likely[:-1]), []
        for begin, past in zip(edges[::2], edges[1::2], strict=True):
            sure = self.another[begin:past] >= _SURE
            if not sure.any():
                continue
            first = begin + int(np.argmax(sure))
            ln, sd = np.log(self.ratio[first:past]), self.sd[first:past]
            mean = float(np.average(ln, weights=1.0 / sd**2))
            doubt = math.hypot(float(np.median(sd)), _SIMILAR * mean)
            if abs(mean) > _TWO_SIGMA * doubt:
                ends = float(self.t[first]), float(self.t[past - 1])
                found.append(Road(*ends, math.exp(mean), math.exp(mean) * doubt))
        return tuple(found)

    @property
    def text(self) -> str:
        """The roads of another friction, or why none is reported."""
        if self.roads:
            return "; ".join(road.text for road in self.roads)
        most = int(self.another.argmax())
        sure = float(self.another[most])
        if sure < _LIKELY:
            return "no other road reported"
        why = "its friction is within two standard deviations of 1"
        if sure < _SURE:
            why = f"its probability is {sure:.2f}, {_SURE:g} is needed"
        return f"no other road reported (at {self.t[most]:.4g} s {why})"

    @property
    def unchanged(self) -> bool:
        """Whether the drive shows, somewhere, that its road has the friction that taught."""
        return bool((1.0 - self.another - self.unexplained >= _SURE).any())


def road_friction(
    model: TireModel, recording: Recording, road: Array | None = None
) -> RoadFriction | None:
    """Return the friction of a drive's road; None where nobody can tell.

    Nobody can of a model without a calibrated band, and of a drive of fewer than eight brisk
    windows. More friction is reported only for a model that learnt its grip. Of a long drive those
    parts are asked that the verdict asks.
    road : what a banked road pushes to the left at each sample of `portion(recording)`, taken off
        [weights]; None where nobody knows of it.
    """
    part = portion(recording)
    model = model.held_on(recording, part)
    band, found = model.band, evidence(model, part.recording, road)
    if band is None or not band.calibrated or found is None:
        return None
    windows = found.windows
    grid = np.log(np.geomspace(_LEAST, _MOST, _FRICTIONS))
    grid = np.insert(grid, np.searchsorted(grid, 0.0), 0.0)
    if not all(one.identified for one in model.estimates() if one.title == GRIP):
        grid = grid[grid <= 0.0]  # a curve that goes on looks like more friction
    away, slope = np.empty((2, grid.size, *found.measured.shape))
    for k, mu in enumerate(np.exp(grid)):
        tires = model.at_friction(float(mu))
        assert tires.band is not None
        away[k] = found.measured - modelled_force(tires, part.recording, windows)
        slope[k] = windows.mean(tires.band.slope_over(part.recording))
    half = band.of_curves(part.recording) / model.vehicle.axle_loads
    sd = windows.mean(half) / normal_quantile(LEVEL)
    beside = _BESIDE if recording.logged_v_y is not None else math.hypot(_BESIDE, _OF_ESTIMATE)
    variance = sd**2 + found.noise + beside**2 + (_OF_FORCE * found.measured) ** 2
    t = recording.t[part.samples[windows.starts + windows.n]]
    return filtered(t, grid, away, slope, variance)


def filtered(t: Array, grid: Array, away: Array, slope: Array, variance: Array) -> RoadFriction:
    """Return the friction that windows tell one after the other.
    t : end of the windows [s], rising, (m,).
    grid : ln μ of the frictions that are held for possible, rising, one of them 0, (k,).
    away : what each of them leaves of the measured force [static axle loads], (k, m, 2).
    slope : of its force over the slip [static axle loads/rad], (k, m, 2).
    variance : of what the right one leaves (m, 2).
    """
    same = int(np.argmin(np.abs(grid)))
    likely = np.exp(-0.5 * (grid / _SPREAD) ** 2)
    other = np.append((1.0 - _UNEXPLAINED) * likely / likely.sum(), _UNEXPLAINED)
    now = (1.0 - _AS_TAUGHT) * other
    now[same] += _AS_TAUGHT
    zero, doubt = np.zeros((grid.size, 2)), np.full((grid.size, 2), _ZERO**2)
    p = np.empty((t.size, now.size))
    for k, h in enumerate(1.0 - np.exp(-np.diff(t, prepend=t[0]) / _LASTS)):
        stays = (1.0 - h) * now
        before = stays + h * other
        zero, doubt = _mixed(now, zero, doubt, (stays / before)[:-1, None])
        off, wide = away[:, k] - slope[:, k] * zero, slope[:, k] ** 2 * doubt + variance[k]
        anything = variance[k] + _ANYTHING**2
        given = off**2 / wide + np.log(wide)
        chance = away[same, k] ** 2 / anything + np.log(anything)
        log = -0.5 * _OVERLAP * np.append(given.sum(axis=1), chance.sum())
        now = before * np.exp(log - log.max())
        now = now / now.sum()
        p[k] = now
        gain = doubt * slope[:, k] / (wide + (1.0 / _OVERLAP - 1.0) * variance[k])
        zero, doubt = zero + gain * off, doubt * (1.0 - gain * slope[:, k])
    of_friction = p[:, :-1] / np.maximum(1.0 - p[:, -1:], 1e-12)
    mean, cell = of_friction @ grid, float(np.diff(grid).max()) / math.sqrt(12.0)
    spread = np.sqrt(np.maximum(of_friction @ grid**2 - mean**2, 0.0))
    another = p[:, :-1] @ (np.abs(grid) > _ANOTHER)
    return RoadFriction(t, np.exp(mean), np.hypot(spread, cell), another, p[:, -1])


def _mixed(p: Array, zero: Array, doubt: Array, stays: Array) -> tuple[Array, Array]:
    """Return the zeros of the slip, and their variances, where a road may begin (k, 2).

    A road that begins takes over what is known of the zeros, whatever road was before.
    """
    share = p[:-1, None] / np.maximum(p[:-1].sum(), 1e-300)
    mean = np.sum(share * zero, axis=0)
    spread = np.sum(share * (doubt + (zero - mean) ** 2), axis=0)
    new = stays * zero + (1.0 - stays) * mean
    wide = stays * (doubt + (zero - new) ** 2) + (1.0 - stays) * (spread + (mean - new) ** 2)
    return new, wide
