"""Sizes of faults that fit best, by Gauss-Newton on the balance with what is believed beforehand.

J(θ) = Σ_e n_e/2 ln S_e(θ) + Σ_j (θ_j - θ̄_j)²/(2 s_j²), with the mean square S_e of what equation e
misses and the number n_e of its windows that do not overlap: its level is not known beforehand.
From S_e the noise is taken off as far as it changes with θ: a factor that merely makes noise
smaller, or a delay that lets the noise of two sides cancel, gains nothing by it.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from codegen.arrays import Array
from identifier.doctor.balance import Balance, Residual, Sizes
from identifier.doctor.suspects import NUISANCES, SUSPECTS, grown

FLOOR = (0.4, 0.4, 0.3)  # of S of each part: below it a residual tells nothing more
ODD = 4.0  # S from which what is left is no noise: windows that miss it are not independent
STEP = 0.02  # of a standard deviation, for slopes
ITERATIONS, CLOSE = 10, 0.01  # of J
TRIED = (-2.0, -1.0, -0.5, -0.2, 0.0, 0.2, 0.5, 1.0, 2.0)  # believed deviations
TRIES, DAMPED = 5, 0.1
OF_ONE = ("bank.", "downforce.")  # how several sizes of one suspect begin


@dataclass(frozen=True, slots=True, kw_only=True)
class Fit:
    """Sizes that fit best.

    Parameters
    ----------
    J : at them; smaller is better, by one for odds of e.
    covariance : of the sizes in the order of their keys (k, k), of white residuals.
    misses : mean square of each part.
    """

    sizes: Sizes
    J: float
    covariance: Array
    misses: tuple[float, ...]

    def deviation(self, key: str) -> float:
        """Return the standard deviation of a size."""
        place = list(self.sizes).index(key)
        return math.sqrt(max(float(self.covariance[place, place]), 0.0))


class Outlook(NamedTuple):
    """What a suspect promises.

    gain : of J.   left : of the standard deviation of what is believed of its size [-].
    """

    gain: float
    left: float


class Fitter:
    """What is believed of a car's faults, and the balance that judges them."""

    def __init__(self, balance: Balance) -> None:
        self.balance = balance
        self.mean: dict[str, float] = {}
        self.sd: dict[str, float] = {}
        for key, (mean, sd, grows) in NUISANCES.items():
            scale = grown(grows, balance.vehicle)
            self.mean[key], self.sd[key] = mean * scale, sd * scale
        for one in SUSPECTS:
            self.sd[one.key] = one.plausible * one.scale(balance.vehicle)
        self.trust = (1.0,) * (3 if balance.has_accelerometer else 2)
        self.usual = balance.residual(self.mean).noise

    def misses(self, found: Residual) -> list[float]:
        """Return S of each part."""
        return [
            max(float(part @ part) / part.size - noise + usual, 0.1 * usual) + floor
            for part, noise, usual, floor in zip(
                found.parts, found.noise, self.usual, FLOOR[: len(found.parts)], strict=True
            )
        ]

    def cost(self, found: Residual, sizes: Sizes) -> float:
        """Return J."""
        return self.cost_of(self.misses(found), sizes)

    def cost_of(self, misses: Iterable[float], sizes: Sizes) -> float:
        """Return J of mean squares.

        Parameters
        ----------
        misses : S of each part.
        """
        believed = sum(self._away(key, size) ** 2 for key, size in sizes.items())
        logs = sum(n * math.log(S) for n, S in zip(self.counts, misses, strict=True))
        return 0.5 * logs + 0.5 * believed

    @property
    def counts(self) -> list[float]:
        """How many independent windows each part counts for."""
        return [self.balance.independent * share for share in self.trust]

    def distrust(self, misses: Iterable[float]) -> None:
        """Count a part less, the more of it even the best fault leaves unexplained.

        Parameters
        ----------
        misses : S of each part with that fault.
        """
        left = (
            S - noise - floor for S, noise, floor in zip(misses, self.usual, FLOOR, strict=False)
        )
        self.trust = tuple(1.0 / (1.0 + max(one, 0.0) / ODD) for one in left)

    def _away(self, key: str, size: float) -> float:
        return (size - self.mean.get(key, 0.0)) / self._sd(key)

    def _sd(self, key: str) -> float:
        return self.sd[key.partition(".")[0] if key.startswith(OF_ONE) else key]

    def fit(self, keys: Iterable[str], start: Mapping[str, float]) -> Fit:
        """Return the sizes that fit best, from a start on.

        Parameters
        ----------
        keys : of the faults; the nuisances are always there.
        start : sizes to begin with; what is not named begins as it is believed.
        """
        names = list(dict.fromkeys([*NUISANCES, *keys]))
        sizes = {key: start.get(key, self.mean.get(key, 0.0)) for key in names}
        sd = np.array([self._sd(key) for key in names])
        found = self.balance.residual(sizes)
        J, damping = self.cost(found, sizes), 0.0
        H = np.eye(len(names))
        for _ in range(ITERATIONS):
            gradient, H = self._slopes(found, sizes, names, sd)
            better = None
            for _ in range(TRIES):
                step = -np.linalg.solve(H + damping * np.diag(np.diag(H)), gradient) * sd
                tried = {key: sizes[key] + d for key, d in zip(names, step.tolist(), strict=True)}
                there = self.balance.residual(tried)
                cost = self.cost(there, tried)
                if cost < J:
                    better = tried, there, cost
                    break
                damping = max(4.0 * damping, DAMPED)
            if better is None:
                break
            gained = J - better[2]
            sizes, found, J = better
            damping = damping / 4.0 if damping > 0.2 * DAMPED else 0.0
            if gained < CLOSE:
                break
        covariance = np.asarray(np.linalg.inv(H) * np.outer(sd, sd), dtype=np.float64)
        return Fit(sizes=sizes, J=J, covariance=covariance, misses=tuple(self.misses(found)))

    def best_start(self, sizes: Sizes, key: str) -> tuple[float, Sizes]:
        """Return J and the sizes with one more, of those in `TRIED` that fits best."""
        tried = [{**sizes, key: times * self._sd(key)} for times in TRIED]
        costs = [self.cost(self.balance.residual(one), one) for one in tried]
        best = int(np.argmin(costs))
        return costs[best], tried[best]

    def moved(self, fit: Fit, others: Mapping[str, float]) -> dict[str, float]:
        """Return how far sizes move that are estimated without others that are there, by key.

        Each of the others has the size that is told of it, of either sign: squares add.
        """
        here, names = list(fit.sizes), [*fit.sizes, *others]
        sizes = {**dict.fromkeys(names, 0.0), **fit.sizes}
        sd = np.array([self._sd(key) for key in names])
        _, H = self._slopes(self.balance.residual(sizes), sizes, names, sd)
        n = len(here)
        there = np.array([*others.values()]) / sd[n:]
        shifts = np.linalg.solve(H[:n, :n], H[:n, n:] * there) * sd[:n, None]
        return dict(zip(here, np.sqrt(np.sum(shifts**2, axis=1)).tolist(), strict=True))

    def outlook(self, fit: Fit, suspects: Mapping[str, list[str]]) -> dict[str, Outlook]:
        """Return what each suspect promises beside a fit, if all were straight lines."""
        sizes = dict(fit.sizes)
        here = list(sizes)
        for keys in suspects.values():
            sizes.update(dict.fromkeys(keys, 0.0))
        names = list(sizes)
        sd = np.array([self._sd(key) for key in names])
        gradient, H = self._slopes(self.balance.residual(sizes), sizes, names, sd)

        def solved(keys: list[str]) -> tuple[float, float]:
            at = [names.index(key) for key in keys]
            g, inverse = gradient[at], np.linalg.inv(H[np.ix_(at, at)])
            return 0.5 * float(g @ inverse @ g), math.sqrt(float(inverse[len(here), len(here)]))

        at = [names.index(key) for key in here]
        without = 0.5 * float(gradient[at] @ np.linalg.solve(H[np.ix_(at, at)], gradient[at]))
        found = {}
        for name, keys in suspects.items():
            gain, left = solved([*here, *keys])
            found[name] = Outlook(gain - without, left)
        return found

    def _slopes(
        self, found: Residual, sizes: Sizes, names: list[str], sd: Array
    ) -> tuple[Array, Array]:
        """Return gradient and curvature of J, per standard deviation of what is believed."""
        misses, counts = self.misses(found), self.counts
        weight = [
            math.sqrt(n / (part.size * S))
            for n, part, S in zip(counts, found.parts, misses, strict=True)
        ]

        def stacked(one: Residual) -> Array:
            return np.concatenate([w * part for w, part in zip(weight, one.parts, strict=True)])

        here = stacked(found)
        slopes, noise = np.empty((here.size, len(names))), np.empty(len(names))
        for k, key in enumerate(names):
            there = self.balance.residual({**sizes, key: sizes[key] + STEP * float(sd[k])})
            slopes[:, k] = (stacked(there) - here) / STEP
            more = zip(there.noise, found.noise, counts, misses, strict=True)
            noise[k] = sum(0.5 * n / S * (b - a) for b, a, n, S in more) / STEP
        away = np.array([self._away(key, sizes[key]) for key in names])
        return slopes.T @ here - noise + away, slopes.T @ slopes + np.eye(len(names))
