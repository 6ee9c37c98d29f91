"""Sizes of faults of a log and of what is told of its car, by the estimate of tires and motion.

Each suspect is believed wide, one at a time, beside the nominal estimate (`estimate.solve`): it
gains ΔJ, the misfit of the balance at its scale and memory, the prior's cost, and where there is
an accelerometer the misfit of

K - g sin β = a_y(t + τ)/c - b - x ṙ,   K = v̇_y + v_x r of the motion without its faults,

a line over [1, a_y, a_y', ṙ] with the noise of K on its other side. The best is taken in as long as
it gains enough, and the rest is asked beside it. What the nominal estimate has as a state (offsets,
angle, place) is taken where its size stands out. One Gauss-Newton step of all parameters together
ranks the suspects; only the best of them are fitted.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from codegen.arrays import Array
from identifier.doctor.finding import Finding
from identifier.doctor.pieces import stretches_of
from identifier.doctor.suspects import NOTES, SUSPECTS, TURNING, Suspect
from identifier.estimate.drive import SMOOTHED, Drive, box, gradient
from identifier.estimate.posterior import Posterior
from identifier.estimate.priors import SEDAN, Priors
from identifier.estimate.solve import (
    DELAYS,
    Problem,
    Residuals,
    around_beliefs,
    descend,
    normal,
    starts,
)
from identifier.motion.model import SENSORS, true_signals
from identifier.motion.parameters import INDEX
from models.recordings import Recording
from models.vehicle import GRAVITY, Vehicle

Widths = Mapping[str, float]  # standard deviation of what is believed wide, by suspect's parameter
BESIDE = {"ln_inertia": 0.1}  # believed of any car: what is told of it is an estimate
OF_A_Y = ("a_y.offset", "a_y.factor", "a_y.delay", "a_y.place", "a_y.lag")


@dataclass(frozen=True, slots=True, kw_only=True)
class Rules:
    """Limits of the search, chosen on random cars of the plant.

    interval : of samples that are looked at [s], of a sedan.
    longest, pieces : s that are looked at of a log, and from how many parts of a longer one.
    logs, log : most logs that are looked at as long, and what a stretch must last to be one [s].
    shortest : s that must be driven.
    margin : s at both ends of a stretch that do not count, as a delay may need them.
    gain : of J that a fault must bring [nats].
    state : the same over the value zero, of what the nominal estimate has as a state.
    telling : deviations, with the least size in them, that a size must have.
    against : nats by which the accelerometer may speak against a fault.
    alike : gain within which two cannot be told apart.
    fitted, most : suspects that are fitted in a round, and faults that are taken in.
    steps, enough : of Gauss-Newton for each, and the gain of a step that ends it.
    kept : deviations by which what was taken in may still move.
    temper : odds of e per this gain.
    sure, ahead, clear : gain of a sure fault, what it has over its rival, deviations of its size.
    better : share by which the repaired model must miss less of the force of a part left out.
    unexplained : share of the force missed with all found, from which nothing was understood.
    untold : of `wide`, what is left by a drive that does not tell a size.
    """

    interval: float = 0.02
    longest: float = 60.0
    pieces: int = 4
    logs: int = 3
    log: float = 10.0
    shortest: float = 5.0
    margin: float = 0.4
    gain: float = 12.0
    state: float = 8.0
    telling: float = 2.5
    against: float = 4.0
    alike: float = 4.0
    fitted: int = 4
    most: int = 3
    steps: int = 8
    enough: float = 0.3
    kept: float = 3.0
    temper: float = 2.0
    sure: float = 20.0
    ahead: float = 6.0
    clear: float = 3.5
    better: float = 0.03
    unexplained: float = 0.4
    untold: float = 0.6


RULES = Rules()
SLOW = "sizes of faults: the car hardly drives, or not fast enough"
UNEXPLAINED = (
    "sizes of faults: no tire explains the front axle, whichever of them is taken out: a steering "
    "angle that was commanded and not measured, play, or several faults at once",
    "sizes of faults: no tire explains the rear axle, whichever of them is taken out",
)


class Examination(NamedTuple):
    """Findings, what explains most first; what the log cannot tell; codes and channels taken in."""

    findings: tuple[Finding, ...] = ()
    unseen: tuple[str, ...] = ()
    taken: frozenset[tuple[str, str]] = frozenset()


class Line(NamedTuple):
    """What an accelerometer says of a motion: J [nats], its numbers as `OF_A_Y`, deviations."""

    cost: float
    numbers: Array
    deviations: Array


class Accelerometer:
    """a_y over the motion of drives."""

    FILTERED, STRIDE = 0.25, 0.1  # [s] of means, and between them
    ERROR, RELATIVE = 0.02, 0.03  # of g, and of the acceleration
    LEAST = 0.3  # of the scale of what is missed

    def __init__(
        self, stretches: Sequence[Recording], drives: Sequence[Drive], vehicle: Vehicle
    ) -> None:
        self.drives, L = drives, vehicle.wheelbase
        roll = 0.008 * float(np.sqrt(L / SEDAN))  # s, by which weight follows it
        self.mean = np.array([0.0, 0.97, 0.0, 0.0, 0.0])  # a body rolls by 0 to 6 degrees per g
        self.usual = np.array([0.04, 0.03, roll, 0.012 * L, 1e-6])
        self.memory = 0.0
        self.size: Array | None = None
        width = float(np.sqrt(L / SEDAN)) * SMOOTHED
        self.shown = [
            box(_averaged(one.needed("a_y"), drive.every), round(width / drive.dt) | 1)
            for one, drive in zip(stretches, drives, strict=True)
        ]

    def line(self, p: Array, wide: Widths) -> Line:
        """Return how well a_y follows from the motion without the sensors' faults p.

        Parameters
        ----------
        wide : standard deviations, by `OF_A_Y`, of what may be wrong with it.
        """
        sd = np.array([wide.get(name, one) for name, one in zip(OF_A_Y, self.usual, strict=True)])
        late = 0.0
        for _ in range(4 if "a_y.delay" in wide else 1):
            found, moved = self._line(p, sd, late)
            late += moved
        numbers = found.numbers.copy()
        numbers[2] = late
        return found._replace(numbers=numbers)

    def _line(self, p: Array, sd: Array, late: float) -> tuple[Line, float]:
        """Return the line where a_y is read later, and by how much more it is late."""
        y, X, seconds = [], [], 0.0
        for one, shown in zip(self.drives, self.shown, strict=True):
            v_x, v_y, r = _motion(one, p)
            count = self.FILTERED / one.dt
            K = box(gradient(box(v_y, count / 3), one.dt) + v_x * r, count)
            at = np.arange(shown.size)
            felt = box(np.interp(at + late / one.dt, at, shown), count)
            slope = gradient(felt, one.dt)
            turning = gradient(box(r, count), one.dt)
            columns = [-np.ones(K.size), felt, slope, -turning, slope]
            every = max(1, round(self.STRIDE / one.dt))
            kept = np.flatnonzero(one.counts[::every]) * every
            y.append((K - GRAVITY * p[INDEX["bank"]])[kept])
            X.append(np.column_stack(columns)[kept])
            seconds += kept.size * every * one.dt
        moved, rows = np.concatenate(y), np.concatenate(X)
        if self.size is None:  # of the motion as logged: to shrink it gains nothing
            self.size = GRAVITY * np.hypot(self.ERROR, self.RELATIVE * rows[:, 1] / GRAVITY)
        size = self.size
        moved, rows = moved / size, rows / size[:, None]
        mean = self.mean.copy()
        mean[2] = -late
        S2, w, theta = 1.0, np.ones(moved.size), mean
        for _ in range(5):
            n = seconds / max(self.memory, self.STRIDE) / moved.size  # of each residual
            H = n / S2 * (rows.T * w) @ rows + np.diag(sd**-2.0)
            g = n / S2 * (rows.T * w) @ (moved - rows @ mean)
            theta = mean + np.linalg.solve(H, g)
            e = moved - rows @ theta
            w = 5.0 / (4.0 + e**2 / S2)  # Student, 4 degrees
            S2 = max(float(np.mean(w * e**2)), self.LEAST**2)
        if not self.memory:
            self.memory = _memory(np.clip(e, -4.0, 4.0), self.STRIDE)
            n = seconds / self.memory / moved.size
        away = (theta - mean) / sd
        loss = 2.5 * np.log1p(e**2 / (4.0 * S2)).sum() + 0.5 * moved.size * math.log(S2)
        cost = float(n * loss + 0.5 * away @ away)
        return Line(cost, theta, np.sqrt(np.diag(np.linalg.inv(H)))), float(theta[2])


def _value(one: Suspect, line: Line) -> float:
    """Return what an accelerometer has of a suspect."""
    value = float(line.numbers[OF_A_Y.index(one.parameter)])
    return 1.0 / value - 1.0 if one.code == "factor" else value


def _motion(one: Drive, p: Array) -> tuple[Array, Array, Array]:
    """Return v_x, v_y and r without the sensors' faults, (n,) each."""
    late, q = p[DELAYS], p.copy()
    q[DELAYS] = 0.0
    read = one.on_time(late) if late.any() else one
    signals = [*read.signals[:, :4].T, *read.rates.T]
    v_x, v_y, r, _ = true_signals(signals, [q[INDEX[name]] for name in SENSORS])
    return v_x, v_y, r


def _averaged(signal: Array, every: int) -> Array:
    n = len(signal) // every * every
    mean: Array = signal[:n].reshape(-1, every).mean(axis=1)
    return mean


def _memory(e: Array, step: float) -> float:
    """Return the integrated autocorrelation time [s] of residuals."""
    spectrum = np.fft.rfft(e, 1 << (2 * e.size - 1).bit_length())
    rho = np.fft.irfft(np.abs(spectrum) ** 2)[: max(e.size // 3, 2)]
    rho = rho / max(rho[0], 1e-12)
    until = int(np.argmax(rho < 0.05)) or rho.size
    return max(step * (1.0 + 2.0 * float(rho[1:until].sum())), 0.25)


class Candidate(NamedTuple):
    """A suspect that was fitted beside what is there: its value, deviation and gain of J.

    shown : how much it brings over the value zero; of what is no state of the estimate, `gain`.
    felt : of the gain what the accelerometer says; negative where it speaks against it.
    """

    suspect: Suspect
    value: float
    deviation: float
    gain: float
    shown: float
    felt: float
    post: Posterior | None


def descended(cost: Callable[[float], float], width: float) -> tuple[float, float, float]:
    """Return where a function of one number is least, its curvature there, and its value.

    Parameters
    ----------
    width : of the parabola that bounds it from below; it begins at 0.
    """
    x, h, here = 0.0, 0.1 * width, cost(0.0)
    curvature = width**-2
    for _ in range(4):
        up, down = cost(x + h), cost(x - h)
        curvature = max((up + down - 2.0 * here) / h**2, width**-2)
        step = min(max((down - up) / (2.0 * h * curvature), -3.0 * width), 3.0 * width)
        for _ in range(3):
            there = cost(x + step)
            if there <= here:
                break
            step /= 3.0
        else:
            break
        x, gained, here = x + step, here - there, there
        h = min(h, max(0.5 * abs(step), 0.5 / math.sqrt(curvature)))
        if gained < 0.1:
            break
    return x, curvature, here


def twins(one: Suspect, other: Suspect) -> bool:
    """Return whether both say that a channel is late, by a delay and by a low pass."""
    return one.channel == other.channel and {one.code, other.code} == {"delay", "lag"}


class Taken(NamedTuple):
    """A fault that was taken in, those that this drive cannot tell from it, and if it is sure."""

    first: Candidate
    alike: tuple[Candidate, ...]
    sure: bool


@dataclass(slots=True, kw_only=True)
class Search:
    """The search for what is wrong with some stretches of a drive.

    Parameters
    ----------
    problem : of them, with slopes over all parameters.
    accelerometer : None where there is none.
    """

    problem: Problem
    accelerometer: Accelerometer | None
    wide: dict[str, float] = field(default_factory=dict)
    mean: dict[str, float] = field(default_factory=dict)
    found: list[Taken] = field(default_factory=list)

    @property
    def vehicle(self) -> Vehicle:
        """The car as it was told."""
        return self.problem.vehicle

    def priors(self, wide: Widths) -> Priors:
        """Return what is believed where some of it is believed wide.

        Without the tails of a typed number, which would be a suspect that is wide from the first.
        """
        apart = "v_y_bias" in wide or "v_y_angle" in wide
        of_model = BESIDE | {name: sd for name, sd in wide.items() if not name.startswith("a_y.")}
        if "downforce_f" in wide:
            of_model["downforce_r"] = wide["downforce_f"]
        priors = Priors.of(self.vehicle, wide=of_model, apart=apart)
        mean = priors.mean.copy()
        for name, value in self.mean.items():
            mean[INDEX[name]] = value
        return replace(priors, mean=mean, typed=())

    def nominal(self) -> Posterior:
        """Return the estimate before anything is searched."""
        problem = self.problem.under(self.priors(self.wide))
        found = [descend(problem, start, enough=RULES.enough) for start in starts(problem)]
        return min(found, key=lambda one: one.cost)

    def widened(self, one: Suspect) -> dict[str, float]:
        """Return what is believed wide with one more."""
        return {**self.wide, one.parameter: one.scaled(one.wide, self.vehicle)}

    def line(self, p: Array, wide: Widths) -> Line | None:
        """Return what the accelerometer says, None where there is none."""
        return None if self.accelerometer is None else self.accelerometer.line(p, wide)

    def promised(self, base: Posterior, at: Residuals) -> dict[str, tuple[float, float]]:
        """Return the gain of each suspect of the balance, if all were straight lines.

        Beside it where to begin: the value that the accelerometer asks for, as far as it does.

        Parameters
        ----------
        at : of all parameters, at the base.
        """
        H, g = normal(self.problem, at, base.scale**2, base.memory)
        before = self.priors(self.wide).cost(base.p)
        gains = {}
        for one in self.left(of_model=True):
            priors = self.priors(self.widened(one))
            some = np.flatnonzero(priors.moves)
            pull, P = around_beliefs(priors, base.p)
            slope = g[some] + pull[some]
            inside = (H + P)[np.ix_(some, some)]
            change = priors.cost(base.p) - 0.5 * float(slope @ np.linalg.solve(inside, slope))
            gains[one.parameter] = before - change, 0.0
        line = self.line(base.p, self.wide)
        for one in self.left(of_model=True) if line is not None else []:
            if one.parameter not in (*SENSORS, "bank") or one.code == "lag":
                continue
            k, width = INDEX[one.parameter], one.scaled(one.wide, self.vehicle)
            size = np.zeros(base.p.size)
            size[k] = width

            def cost(step: float, size: Array = size) -> float:
                moved = self.line(base.p + step * size, self.wide)
                assert moved is not None
                return 0.5 * step**2 + moved.cost

            step, _, least = descended(cost, 1.0)
            gain, value = cost(0.0) - least, width * step
            gains[one.parameter] = (
                gains[one.parameter][0] + gain,
                value if gain > 0.3 * RULES.gain else 0.0,
            )
        return gains

    def left(self, *, of_model: bool) -> list[Suspect]:
        """Return the suspects that were not taken in, of the balance or of the accelerometer."""
        return [
            one
            for one in SUSPECTS
            if one.parameter not in self.wide
            and one.parameter.startswith("a_y.") != of_model
            and (of_model or self.accelerometer is not None)
        ]

    def fitted(self, one: Suspect, base: Posterior, begin: float = 0.0) -> Candidate:
        """Return a suspect fitted beside what is there, beginning at a value away from it."""
        wide = self.widened(one)
        before = self.line(base.p, self.wide)
        if not one.parameters:
            assert before is not None
            after = self.line(base.p, wide)
            assert after is not None
            k = OF_A_Y.index(one.parameter)
            value = _value(one, after)
            gain = before.cost - after.cost
            return Candidate(one, value, float(after.deviations[k]), gain, gain, gain, None)
        problem = self.problem.under(self.priors(wide))
        start = base.p.copy()
        start[INDEX[one.parameter]] += begin
        post = descend(problem, start, base.memory, RULES.steps, RULES.enough)
        gain = base.cost - post.cost - one.price
        value, sd = post[one.parameter], post.sd(one.parameter)
        felt = 0.0
        if before is not None and one.code != "downforce":
            post, sd, line, moved = self.both(post, one.parameter)
            value, felt = post[one.parameter], before.cost - line
            gain += felt - moved
        if one.code == "downforce":
            shares = np.array(self.vehicle.axle_loads) / self.vehicle.weight
            value = float(shares @ [post[name] for name in one.parameters])
        shown = gain
        if base.sd(one.parameter) > 0.0:
            least = one.scaled(one.least, self.vehicle)
            shown = max(gain, 0.5 * value**2 / (sd**2 + least**2))
        return Candidate(one, value, sd, gain, shown, felt, post)

    def both(self, post: Posterior, name: str) -> tuple[Posterior, float, float, float]:
        """Return an estimate moved along a parameter to where a_y fits too; its sd and both J.

        The balance is a parabola of the parameter there, the others moving with it.
        """
        k, covariance = INDEX[name], post.covariance
        sd = math.sqrt(covariance[k, k])
        along = covariance[k] / covariance[k, k]

        def cost(step: float) -> float:
            line = self.line(post.p + step * along, self.wide)
            assert line is not None
            return 0.5 * (step / sd) ** 2 + line.cost

        step, curvature, best = descended(cost, sd)
        moved = replace(post, p=post.p + step * along)
        bent = 0.5 * (step / sd) ** 2
        return moved, 1.0 / math.sqrt(curvature), best - bent, bent

    def candidates(self, base: Posterior, at: Residuals) -> list[Candidate]:
        """Return the suspects that may be believed beside what is there, the best first."""
        promised = self.promised(base, at)
        listed = [self.fitted(one, base) for one in self.left(of_model=False)]
        standing, some = [], []
        for one in self.left(of_model=True):
            state, least = base.sd(one.parameter), one.scaled(one.least, self.vehicle)
            stands = state > 0.0 and abs(base[one.parameter]) > 2.0 * math.hypot(state, least)
            if stands:  # it promises no gain: the nominal estimate has it
                standing.append(one)
            elif one.code != "lag" and promised[one.parameter][0] > 0.3 * RULES.gain:
                some.append(one)
        some.sort(key=lambda one: -promised[one.parameter][0])
        listed += [
            self.fitted(one, base, promised[one.parameter][1])
            for one in (*standing, *some[: RULES.fitted])
        ]
        # A low pass is a delay but for its bend: it is asked where a delay is.
        best = max(listed, key=lambda one: one.gain, default=None)
        if best is not None and best.suspect.code == "delay" and best.gain > RULES.gain:
            twin = next(
                one for one in SUSPECTS if (one.code, one.channel) == ("lag", best.suspect.channel)
            )
            if twin.parameters and twin.parameter not in self.wide:
                listed.append(self.fitted(twin, base, max(best.value, 0.0)))
        return sorted(filter(self.believed, listed), key=lambda one: -one.gain)

    def believed(self, one: Candidate) -> bool:
        """Return whether a size stands out and is one that devices and cars have."""
        least = one.suspect.scaled(one.suspect.least, self.vehicle)
        telling = abs(one.value) > RULES.telling * math.hypot(one.deviation, least)
        most = 3.5 * one.suspect.scaled(one.suspect.wide, self.vehicle)
        possible = one.suspect.possible(one.suspect.size(one.value), self.vehicle)
        return telling and possible and abs(one.value) < most and one.felt > -RULES.against

    def run(self) -> Posterior:
        """Take in one fault after the other; return the estimate with all of them."""
        base = self.nominal()
        every = self.problem.under(_all_move(self.problem.priors))
        while len(self.found) < RULES.most:
            at = every.residuals(base.p)
            listed = self.candidates(base, at)
            chosen = [one for one in listed if one.gain > RULES.gain][:1]
            if not chosen:
                states = [one for one in listed if one.shown > max(one.gain, RULES.state)]
                chosen = sorted(states, key=lambda one: -one.shown)[:1]
            if not chosen:
                break
            best = chosen[0]
            others = [one for one in listed if one is not best]
            alike = tuple(
                one
                for one in others
                if self.in_place_of(best, one, base)
                and one.gain > 0.5 * best.gain
                and (one.gain > best.gain - RULES.alike or twins(one.suspect, best.suspect))
            )
            rival = next((one for one in others if not twins(one.suspect, best.suspect)), None)
            firm = all(one.sure for one in self.found)  # what is asked beside a doubt is in doubt
            sure = firm and self.stands(best, rival, base)
            self.wide = self.widened(best.suspect)
            if self.accelerometer is not None and len(best.suspect.parameters) == 1:
                # What the accelerometer said of it, the balance shall not forget.
                self.mean[best.suspect.parameter] = best.value
                self.wide[best.suspect.parameter] = RULES.kept * best.deviation
            self.found.append(Taken(best, alike, sure))
            problem = self.problem.under(self.priors(self.wide))
            start = base.p if best.post is None else best.post.p
            base = descend(problem, start, enough=RULES.enough)
        return base

    def in_place_of(self, best: Candidate, other: Candidate, base: Posterior) -> bool:
        """Return whether another explains what the best does: with it, the best is less needed."""
        left = base if other.post is None else other.post
        names = best.suspect.parameters[:1]
        return all(abs(left[name]) < 0.5 * abs(best.value) for name in names)

    def stands(self, best: Candidate, rival: Candidate | None, base: Posterior) -> bool:
        """Return whether a fault's repair makes the model better on a part left out.

        Each half is asked about a fault that the other half was fitted on.
        """
        suspect, wide = best.suspect, self.widened(best.suspect)
        lead = best.shown - (rival.gain if rival is not None else 0.0)
        deviation = math.hypot(best.deviation, suspect.scaled(suspect.least, self.vehicle))
        clear = abs(best.value) > RULES.clear * deviation and suspect.code not in NOTES
        # Factors of v_x and r change what the accelerometer must show: it has to agree.
        agreed = best.felt > (RULES.ahead if suspect.price else -1.0)
        if best.shown < RULES.sure or lead < RULES.ahead or not (clear and agreed):
            return False
        if best.post is None:  # of the accelerometer: it changes no tire
            return True
        parts = self.problem.halves()
        told = self.left_out(best.post, wide, parts)
        if best.gain < RULES.gain:  # the nominal estimate has it as a state
            plain = self.left_out(best.post, wide, parts, zero=suspect)
        else:
            plain = self.left_out(base, self.wide, parts)
        if not (told < (1.0 - RULES.better) * plain).any() or (told > 1.01 * plain).any():
            return False
        if rival is None or rival.post is None:
            return True
        other = self.left_out(rival.post, self.widened(rival.suspect), parts)
        return bool(np.hypot(*other) > (1.0 + RULES.better) * np.hypot(*told))

    def left_out(
        self,
        post: Posterior,
        wide: Widths,
        parts: tuple[Array, Array],
        zero: Suspect | None = None,
    ) -> Array:
        """Return the share of the force missed on each half by the model of the other half, (2,).

        The model of a half is one Gauss-Newton step from that of the whole.

        Parameters
        ----------
        parts : which residuals are of each half, (m,) each.
        zero : a suspect that is held at zero.
        """
        problem = self.problem.under(self.priors(wide))
        at = problem.residuals(post.p)
        pull, P = around_beliefs(problem.priors, post.p)
        pull, P = pull[problem.index], P[np.ix_(problem.index, problem.index)]
        shares = np.empty(2)
        for k, (learnt, asked) in enumerate(((parts[1], parts[0]), (parts[0], parts[1]))):
            half = problem.weighted(learnt)
            H, g = normal(half, at, post.scale**2, post.memory)
            H, g = H + P, g + pull
            step = np.zeros(problem.index.size)
            free = np.ones(step.size, dtype=bool)
            if zero is not None:
                held = np.isin(problem.index, [INDEX[name] for name in zero.parameters])
                free, step[held] = ~held, -post.p[problem.index[held]]
            rest = g[free] + H[np.ix_(free, ~free)] @ step[~free]
            step[free] = -np.linalg.solve(H[np.ix_(free, free)], rest)
            e = (at.e + at.slopes @ step) * problem.size[:, None]
            shares[k] = math.sqrt(float((asked @ e**2).mean() / (asked @ problem.force**2)))
        return shares


def _all_move(priors: Priors) -> Priors:
    return replace(priors, moves=np.ones(priors.moves.size, dtype=bool))


def examine(recording: Recording, vehicle: Vehicle) -> Examination:
    """Return the faults of a log and of what is told of its car, and what this drive cannot tell.

    Parameters
    ----------
    recording : as it was logged, of one drive or of several joined; of a long one lively stretches
        are looked at.
    vehicle : as it was told; its cornering stiffnesses are not looked at.
    """
    search = prepared(recording, vehicle)
    if search is None:
        return Examination(unseen=(SLOW,))
    post = search.run()
    taken = frozenset((one.first.suspect.code, one.first.suspect.channel) for one in search.found)
    worst = search.problem.share_missed(post.p)
    if worst.max() > RULES.unexplained:
        return Examination(unseen=(UNEXPLAINED[int(np.argmax(worst))],), taken=taken)
    return Examination(findings(search, post), unseen(search, post), taken)


def prepared(recording: Recording, vehicle: Vehicle) -> Search | None:
    """Return the search of a drive, None where too little is driven."""
    whole = sum((one.stop - one.start) * recording.dt > RULES.log for one in recording.stretches)
    logs = min(max(whole, 1), RULES.logs)
    stretches = stretches_of(
        recording, vehicle, longest=logs * RULES.longest, pieces=logs * RULES.pieces
    )
    has_a_y = recording.a_y is not None
    fastest = min(RULES.interval, RULES.interval * math.sqrt(vehicle.wheelbase / SEDAN) + 0.004)

    def read(some: Sequence[Recording]) -> list[Drive]:
        return [_inside(Drive.of(one, vehicle, fastest=fastest)) for one in some]

    bare = [replace(one, a_y=None) for one in stretches] if has_a_y else stretches
    drives = read(bare)
    if sum(np.count_nonzero(one.counts) * one.dt for one in drives) < RULES.shortest:
        return None
    accelerometer = None
    if has_a_y:
        accelerometer = Accelerometer(stretches, drives, vehicle)
        accelerometer.line(Priors.of(vehicle).mean, dict.fromkeys(OF_A_Y[:4], 1.0))
    problem = Problem(drives, vehicle, Priors.of(vehicle), every=True)
    return Search(problem=problem, accelerometer=accelerometer)


def _inside(drive: Drive) -> Drive:
    """Return a drive whose ends do not count."""
    n = min(round(RULES.margin / drive.dt), len(drive.signals) // 2)
    counts: NDArray[np.bool_] = drive.counts.copy()
    counts[:n], counts[counts.size - n :] = False, False
    return replace(drive, counts=counts)


def findings(search: Search, post: Posterior) -> tuple[Finding, ...]:
    """Return what was found: what explains most first, followed by what may be it instead."""
    listed: list[Finding] = []
    names: set[str] = set()
    line = search.line(post.p, search.wide)
    for one in search.found:
        first = one.first
        if first.suspect.parameters:
            value, sd = post[first.suspect.parameter], post.sd(first.suspect.parameter)
            if first.suspect.code == "downforce":
                value, sd = first.value, first.deviation
        else:
            assert line is not None
            k = OF_A_Y.index(first.suspect.parameter)
            value = _value(first.suspect, line)
            sd = float(line.deviations[k])
        alike = [other for other in one.alike if other.suspect.parameter not in search.wide]
        alike = [other for other in alike if other.suspect.parameter not in names]
        shares = np.exp(
            (np.array([RULES.gain / 2.0, first.shown, *(x.gain for x in alike)]) - first.shown)
            / RULES.temper
        )
        shares /= shares.sum()
        group = float(1.0 - shares[0])
        sure = one.sure and all(twins(x.suspect, first.suspect) for x in alike)
        best = first._replace(value=value, deviation=sd)
        for which, share, others in (
            (best, shares[1], alike),
            *((x, s, [first]) for x, s in zip(alike, shares[2:], strict=True)),
        ):
            names.add(which.suspect.parameter)
            listed.append(
                _finding(search, which, (float(share), group), others, sure and which is best)
            )
    if search.accelerometer is None:
        return tuple(listed)
    return tuple(_of_one_device(listed, search.vehicle))


def _finding(
    search: Search,
    one: Candidate,
    told: tuple[float, float],
    alike: Sequence[Candidate],
    sure: bool,
) -> Finding:
    suspect, vehicle = one.suspect, search.vehicle
    size = suspect.size(one.value)
    deviation = math.hypot(one.deviation, suspect.scaled(suspect.least, vehicle))
    text = suspect.words(size, deviation, vehicle)
    if alike:
        names = (f"{x.suspect.code} {x.suspect.channel}".strip() for x in alike)
        text += f"; this drive cannot tell it from: {', '.join(names)}"
    repair = suspect.repair(size, vehicle)
    real = math.erf(abs(one.value) / (math.sqrt(2.0) * deviation))
    return Finding(
        code=suspect.code,
        channel=suspect.channel,
        size=size,
        deviation=deviation,
        unit=suspect.unit,
        confidence=real * told[0],
        group=real * told[1],
        text=text,
        repair=repair,
        sure=sure and repair is not None,
        note=suspect.code in NOTES,
    )


def _of_one_device(listed: list[Finding], vehicle: Vehicle) -> list[Finding]:
    """Return findings with the lateness of an inertial unit as one, not of r and of a_y.

    To be late by as much are v_y and the steering early: clocks tell no more.
    """
    late = {one.channel: one for one in listed if one.code == "delay"}
    for names, sign in ((("r", "a_y"), 1.0), (("v_y", "delta_f"), -1.0)):
        if any(name not in late for name in names):
            continue
        one, other = (late[name] for name in names)
        size = sign * 0.5 * (one.size + other.size)
        if abs(one.size - other.size) > max(0.015, 0.2 * abs(size)):
            continue
        both = replace(
            one, channel=TURNING.channel, size=size, repair=TURNING.repair(size, vehicle),
            text=TURNING.words(size, one.deviation, vehicle), sure=one.sure and other.sure,
            confidence=min(one.confidence, other.confidence), group=max(one.group, other.group),
        )  # fmt: skip
        return [both if x is one else x for x in listed if x is not other]
    return listed


def unseen(search: Search, post: Posterior) -> tuple[str, ...]:
    """Return what this drive tells next to nothing of, beside what was found, a line each."""
    every = search.problem.under(_all_move(search.problem.priors))
    H, _ = normal(search.problem, every.residuals(post.p), post.scale**2, post.memory)
    lines = []
    for one in search.left(of_model=True):
        priors = search.priors(search.widened(one))
        some = np.flatnonzero(priors.moves)
        P = around_beliefs(priors, post.p)[1]
        covariance = np.linalg.inv((H + P)[np.ix_(some, some)])
        k = int(np.flatnonzero(some == INDEX[one.parameter])[0])
        left, wide = math.sqrt(covariance[k, k]), one.scaled(one.wide, search.vehicle)
        if left > RULES.untold * wide:
            name = f"{one.code.replace('_', ' ')} {one.channel}".strip()
            least = f"{left * one.per_unit:.2g}{one.shown}"
            if one.code in ("factor", "yaw_inertia"):
                least = f"a factor of {1.0 + left:.2g}"
            lines.append(f"{name}: {least} would not be seen on this drive")
    return tuple(lines)
