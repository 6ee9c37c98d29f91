"""Sizes of faults of a log and of the declaration of its car, by the estimate of tires and motion.

Each suspect is believed wide, one at a time, beside the nominal estimate (`estimate.solve`): it
gains ΔJ, the misfit of the balance at its scale and memory, the prior's cost, and where there is
an accelerometer its misfit (`accelerometer`). The best is taken in as long as it gains enough, and
the rest is asked beside it. What the nominal estimate has as a state (offsets, angle, place) is
taken where its size stands out. One Gauss-Newton step of all parameters together ranks the
suspects; only the best of them are fitted.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from codegen.arrays import Array
from identifier.day import ENOUGH, UNSEPARATED, sideways
from identifier.doctor.accelerometer import OF_A_Y, Accelerometer, Line, descended
from identifier.doctor.finding import Finding
from identifier.doctor.pieces import segments_of
from identifier.doctor.suspects import NOTES, SUSPECTS, TURNING, Suspect
from identifier.estimate.drive import Drive
from identifier.estimate.posterior import Posterior
from identifier.estimate.priors import Priors
from identifier.estimate.solve import Problem, around_beliefs, descend, normal, starts
from identifier.motion.model import SENSORS
from identifier.motion.parameters import INDEX
from models.recordings import Recording
from models.vehicle import Vehicle

_Widths = Mapping[str, float]  # standard deviation of what is believed wide, by suspect's parameter
BESIDE = {"ln_inertia": 0.1}  # believed of any car: a declared one is an estimate


@dataclass(frozen=True, slots=True, kw_only=True)
class _Rules:
    """Limits of the search, chosen on random cars of the plant."""

    interval: float = 0.02  # [s] between samples, of a sedan
    longest: float = 60.0  # [s] that are looked at of a log,
    pieces: int = 4  # and from how many parts of a longer one
    logs: int = 3  # that are looked at as long, of several,
    log: float = 10.0  # and what a segment must last to be one [s]
    shortest: float = 5.0  # [s] that must be driven
    margin: float = 0.4  # [s] at both ends of a segment that do not count: a delay may need them
    gain: float = 12.0  # [nats] that a fault must bring
    promise: float = 0.4  # of it, that one Gauss-Newton step must promise of what is fitted
    fitted: int = 4  # suspects in a round
    most: int = 3  # faults that are taken in
    steps: int = 8  # of Gauss-Newton for each
    enough: float = 0.3  # [nats] that a step must gain
    telling: float = 2.5  # deviations, with the least size in them, that a size must have
    unfelt: float = 0.04  # least size of a factor of v_x without a_y: roll that the model does not
    # have makes it 0.91 to 1.0 on 160 clean drives of random cars
    against: float = 4.0  # [nats] by which the accelerometer may speak against a fault
    alike: float = 4.0  # [nats] within which two are alike
    kept: float = 1.0  # deviations by which what was taken in may still move
    temper: float = 2.0  # [nats] for odds of e
    sure: float = 20.0  # [nats] of a sure fault,
    ahead: float = 6.0  # what it has over its rival,
    clear: float = 3.5  # deviations of its size,
    better: float = 0.03  # and share by which its model misses less of a part left out
    far: float = 2.0  # deviations `wide` by which no declared yaw inertia is wrong: the log is
    unexplained: float = 0.25  # share of the force missed, from which nothing was understood
    untold: float = 0.6  # of `wide`, what is left by a drive that does not tell a size


RULES = _Rules()
ANOTHER_R = "; try another channel of r, if the log has one"  # it may come on time
SLOW = "sizes of faults: the car hardly drives, or not fast enough"
_OF_ONE_LOG = (
    "sizes of faults but in the longest segment: no tire explains all with the same sensors"
)
_SIZES_BLIND = "sizes of faults: no tire explains the log"
UNEXPLAINED = (
    (
        "delta_f",
        "no tire explains the front axle, with any fault removed: a steering angle that was "
        "commanded and not measured, or several faults at once",
    ),
    (
        "",
        "no tire explains the rear axle, with any fault removed: several faults at once, or "
        "another car",
    ),
)


class Examination(NamedTuple):
    """Findings, what explains most first; what the log cannot tell; codes and channels taken in."""

    findings: tuple[Finding, ...] = ()
    unobservable: tuple[str, ...] = ()
    taken: frozenset[tuple[str, str]] = frozenset()


class Candidate(NamedTuple):
    """A suspect that was fitted beside what is there: its value, deviation and gain of J.
    brings : how much over the value zero; of what is no state of the estimate, `gain`.
    felt : of the gain what the accelerometer says; negative where it speaks against it.
    """

    suspect: Suspect
    value: float
    deviation: float
    gain: float
    brings: float
    felt: float
    post: Posterior | None

    def is_late_as(self, other: "Candidate") -> bool:
        """Return whether both say that a channel is late, by a delay and by a low pass."""
        one, two = self.suspect, other.suspect
        return one.channel == two.channel and {one.code, two.code} == {"delay", "lag"}


class _Taken(NamedTuple):
    """A fault that was taken in, those that this drive cannot tell from it, and if it is sure."""

    first: Candidate
    alike: tuple[Candidate, ...]
    sure: bool


@dataclass(slots=True, kw_only=True)
class Search:
    """The search for what is wrong with some segments of a drive.
    problem : of them, with slopes over all parameters.   accelerometer : None where there is none.
    """

    problem: Problem
    accelerometer: Accelerometer | None
    wide: dict[str, float] = field(default_factory=dict)
    mean: dict[str, float] = field(default_factory=dict)
    found: list[_Taken] = field(default_factory=list)

    @property
    def vehicle(self) -> Vehicle:
        return self.problem.vehicle

    def priors(self, wide: _Widths) -> Priors:
        """Return what is believed where some of it is believed wide.

        Without the tails of a typed number, which would be a suspect that is wide from the first.
        """
        apart = "v_y_bias" in wide or "v_y_angle" in wide
        of_model = BESIDE | {name: sd for name, sd in wide.items() if name not in OF_A_Y}
        if "downforce_f" in wide:
            of_model["downforce_r"] = wide["downforce_f"]
        priors = Priors.of(self.vehicle, wide=of_model, apart=apart)
        mean = priors.mean.copy()
        for name, value in self.mean.items():
            mean[INDEX[name]] = value
        return replace(priors, mean=mean, typed=())

    def nominal(self) -> Posterior:
        problem = self.problem.under(self.priors(self.wide))
        found = [descend(problem, start, enough=RULES.enough) for start in starts(problem)]
        return min(found, key=lambda one: one.cost)

    def least(self, one: Suspect) -> float:
        if one.parameter == "v_x_factor" and self.accelerometer is None:
            return RULES.unfelt
        return one.scaled(one.least, self.vehicle)

    def widened(self, one: Suspect) -> dict[str, float]:
        return {**self.wide, one.parameter: one.scaled(one.wide, self.vehicle)}

    def line(self, p: Array, wide: _Widths) -> Line:
        """Return what the accelerometer says, where there is one."""
        assert self.accelerometer is not None
        return self.accelerometer.line(p, wide)

    def misfit(self, p: Array) -> float:
        """Return J of the accelerometer [nats], 0 where there is none."""
        return 0.0 if self.accelerometer is None else self.line(p, self.wide).cost

    def left(self, *, of_model: bool) -> list[Suspect]:
        """Return the suspects that were not taken in, of the balance or of the accelerometer."""
        return [
            one
            for one in SUSPECTS
            if one.parameter not in self.wide
            and (one.parameter not in OF_A_Y) == of_model
            and (of_model or self.accelerometer is not None)
        ]

    def steps(self, base: Posterior) -> Iterator[tuple[Suspect, float, float, float]]:
        """Yield each suspect of the balance, and one Gauss-Newton step of all with it wide.

        That is the gain that it promises, its value, and its deviation.
        """
        moves = np.ones(self.problem.priors.moves.size, dtype=bool)
        all_move = replace(self.problem.priors, moves=moves)
        every = self.problem.under(all_move).residuals(base.p)
        H, g = normal(self.problem, every, base.scale**2, base.memory)
        before = self.priors(self.wide).cost(base.p)
        for one in self.left(of_model=True):
            priors = self.priors(self.widened(one))
            some = np.flatnonzero(priors.moves)
            pull, P = around_beliefs(priors, base.p)
            slope, k = g[some] + pull[some], int(np.searchsorted(some, INDEX[one.parameter]))
            covariance = np.linalg.inv((H + P)[np.ix_(some, some)])
            step = -covariance @ slope
            gain = before - priors.cost(base.p) - 0.5 * float(slope @ step)
            value = base[one.parameter] + float(step[k])
            if covariance[k, k] > 0.0:
                yield one, gain, value, math.sqrt(covariance[k, k])

    def promised(self, base: Posterior) -> list[tuple[float, Suspect, float]]:
        """Return what each suspect of the balance would bring, if all were straight lines.

        Beside it where to begin: the value that the accelerometer asks for, as far as it does.
        """
        least, found, senses = RULES.promise * RULES.gain, [], self.accelerometer is not None
        for one, of_balance, value, sd in self.steps(base):
            gain, begin = of_balance, 0.0
            if senses and one.parameter in (*SENSORS, "bank") and one.code != "lag":
                size = np.zeros(base.p.size)
                size[INDEX[one.parameter]] = one.scaled(one.wide, self.vehicle)

                def cost(step: float, size: Array = size) -> float:
                    return 0.5 * step**2 + self.misfit(base.p + step * size)

                step, _, there = descended(cost, 1.0)
                more = cost(0.0) - there
                gain, begin = gain + more, float(step * size.max()) if more > least else 0.0
            if base.sd(one.parameter) > 0.0:  # it may promise no gain: the estimate has it
                gain = max(gain, 0.5 * value**2 / (sd**2 + self.least(one) ** 2))
            if gain > least and one.code != "lag":
                found.append((gain, one, begin))
        return sorted(found, key=lambda one: -one[0])

    def fitted(self, one: Suspect, base: Posterior, begin: float = 0.0) -> Candidate:
        """Return a suspect fitted beside what is there, beginning at a value away from it."""
        wide, before = self.widened(one), self.misfit(base.p)
        if not one.parameters:
            after = self.line(base.p, wide)
            gain = before - after.cost
            return Candidate(one, *after.of(one.parameter), gain, gain, gain, None)
        problem = self.problem.under(self.priors(wide))
        start = base.p.copy()
        start[INDEX[one.parameter]] += begin
        post = descend(problem, start, base.memory, RULES.steps, RULES.enough)
        gain = base.cost - post.cost
        value, sd, felt = post[one.parameter], post.sd(one.parameter), 0.0
        if one.code == "downforce":
            shares = np.array(self.vehicle.axle_loads) / self.vehicle.weight
            value = float(shares @ [post[name] for name in one.parameters])
        elif self.accelerometer is not None:
            post, sd, line, moved = self.both(post, one.parameter)
            value, felt = post[one.parameter], before - line
            gain += felt - moved
        brings = gain
        if base.sd(one.parameter) > 0.0:
            brings = max(gain, 0.5 * value**2 / (sd**2 + self.least(one) ** 2))
        return Candidate(one, value, sd, gain, brings, felt, post)

    def both(self, post: Posterior, name: str) -> tuple[Posterior, float, float, float]:
        """Return an estimate moved along a parameter to where a_y fits too; its sd and both J.

        The balance is a parabola of the parameter there, the others moving with it.
        """
        k, covariance = INDEX[name], post.covariance
        if not covariance[k, k] > 0.0:  # singular but for rounding: it tells nothing
            return post, math.inf, math.inf, 0.0
        sd = math.sqrt(covariance[k, k])
        along = covariance[k] / covariance[k, k]

        def cost(step: float) -> float:
            return 0.5 * (step / sd) ** 2 + self.misfit(post.p + step * along)

        step, curvature, best = descended(cost, sd)
        p = np.clip(post.p + step * along, self.problem.priors.low, self.problem.priors.high)
        moved = replace(post, p=p)
        bent = 0.5 * (step / sd) ** 2
        return moved, 1.0 / math.sqrt(curvature), best - bent, bent

    def candidates(self, base: Posterior) -> list[Candidate]:
        """Return the suspects that may be believed beside what is there, the best first."""
        listed = [self.fitted(one, base) for one in self.left(of_model=False)]
        some = self.promised(base)[: RULES.fitted]
        listed += [self.fitted(one, base, begin) for _, one, begin in some]
        # A low pass is a delay but for its bend: it is asked where a delay is.
        enough = max(RULES.gain, 0.5 * max((one.gain for one in listed), default=0.0))
        late = {
            one.suspect.channel: max(one.value, 0.0)
            for one in listed
            if one.suspect.code == "delay" and one.gain > enough
        }
        listed += [
            self.fitted(one, base, late[one.channel])
            for one in self.left(of_model=True)
            if one.code == "lag" and one.channel in late
        ]
        return sorted(filter(self.believed, listed), key=lambda one: -one.gain)

    def believed(self, one: Candidate) -> bool:
        """Return whether a size stands out and is one that devices and cars have."""
        telling = abs(one.value) > RULES.telling * self.deviation(one)
        most = 3.5 * one.suspect.scaled(one.suspect.wide, self.vehicle)
        plausible = one.suspect.plausible(one.suspect.size(one.value), self.vehicle)
        return telling and plausible and abs(one.value) < most and one.felt > -RULES.against

    def deviation(self, one: Candidate) -> float:
        return math.hypot(one.deviation, self.least(one.suspect))

    def run(self) -> Posterior:
        """Take in one fault after the other; return the estimate with all of them."""
        base = self.nominal()
        while len(self.found) < RULES.most:
            listed = self.candidates(base)
            # What gains before what the estimate has anyhow, as a state that stands out.
            chosen = [one for one in listed if one.gain > RULES.gain] or sorted(
                (one for one in listed if one.brings > RULES.gain), key=lambda one: -one.brings
            )
            if not chosen:
                break
            best = chosen[0]
            others = [one for one in listed if one is not best]
            alike = tuple(
                one
                for one in others
                if self.in_place_of(best, one, base)
                and one.gain > 0.5 * best.gain
                and (one.gain > best.gain - RULES.alike or one.is_late_as(best))
            )
            rival = next((one for one in others if not one.is_late_as(best)), None)
            firm = all(one.sure for one in self.found)  # what is asked beside a doubt is in doubt
            sure = firm and self.stands(best, rival, base)
            self.wide = self.widened(best.suspect)
            if self.accelerometer is not None and len(best.suspect.parameters) == 1:
                # What the accelerometer said of it, the balance shall not forget.
                self.mean[best.suspect.parameter] = best.value
                self.wide[best.suspect.parameter] = RULES.kept * best.deviation
            self.found.append(_Taken(best, alike, sure))
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
        lead = best.brings - (rival.gain if rival is not None else 0.0)
        clear = abs(best.value) > RULES.clear * self.deviation(best) and suspect.code not in NOTES
        # A factor of v_x changes what the accelerometer must show: it has to agree.
        agreed = best.felt > (RULES.ahead if suspect.parameter == "v_x_factor" else -1.0)
        if best.brings < RULES.sure or lead < RULES.ahead or not (clear and agreed):
            return False
        if best.post is None:  # of the accelerometer: it changes no tire
            return True
        parts = self.problem.halves()
        given = self.left_out(best.post, wide, parts)
        if best.gain < RULES.gain:  # the nominal estimate has it as a state
            plain = self.left_out(best.post, wide, parts, zero=suspect)
        else:
            plain = self.left_out(base, self.wide, parts)
        if not (given < (1.0 - RULES.better) * plain).any() or (given > 1.01 * plain).any():
            return False
        if rival is None or rival.post is None:
            return True
        other = self.left_out(rival.post, self.widened(rival.suspect), parts)
        return bool(np.hypot(*other) > (1.0 + RULES.better) * np.hypot(*given))

    def left_out(
        self,
        post: Posterior,
        wide: _Widths,
        parts: tuple[Array, Array],
        zero: Suspect | None = None,
    ) -> Array:
        """Return the share of the force missed on each half by the model of the other half, (2,).

        The model of a half is one Gauss-Newton step from that of the whole.
        parts : which residuals are of each half, (m,) each.
        zero : a suspect that is fixed at zero.
        """
        problem = self.problem.under(self.priors(wide))
        at = problem.residuals(post.p)
        pull, P = around_beliefs(problem.priors, post.p)
        pull, P = pull[problem.index], P[np.ix_(problem.index, problem.index)]
        shares = np.empty(2)
        for k, (learnt, evaluated) in enumerate(((parts[1], parts[0]), (parts[0], parts[1]))):
            H, g = normal(problem.weighted(learnt), at, post.scale**2, post.memory)
            H, g = H + P, g + pull
            step = np.zeros(problem.index.size)
            free = np.ones(step.size, dtype=bool)
            if zero is not None:
                fixed = np.isin(problem.index, [INDEX[name] for name in zero.parameters])
                free, step[fixed] = ~fixed, -post.p[problem.index[fixed]]
            rest = g[free] + H[np.ix_(free, ~free)] @ step[~free]
            step[free] = -np.linalg.solve(H[np.ix_(free, free)], rest)
            e = (at.e + at.slopes @ step) * problem.size[:, None]
            shares[k] = math.sqrt(float((evaluated @ e**2).mean() / (evaluated @ problem.force**2)))
        return shares

    def findings(self, post: Posterior) -> Iterator[Finding]:
        """Yield what was found: what explains most first, followed by what may be it instead."""
        names: set[str] = set()
        for first, alike, sure in self.found:
            name = first.suspect.parameter
            if name in OF_A_Y:
                value, sd = self.line(post.p, self.wide).of(name)
            elif first.suspect.code == "downforce":
                value, sd = first.value, first.deviation
            else:
                value, sd = post[name], post.sd(name)
            best = first._replace(value=value, deviation=sd)
            left = [x for x in alike if x.suspect.parameter not in {*self.wide, *names}]
            brought = np.array([RULES.gain / 2.0, first.brings, *(one.gain for one in left)])
            shares = np.exp((brought - first.brings) / RULES.temper)
            shares /= shares.sum()
            sure = sure and all(one.is_late_as(first) for one in left)
            for one, share in zip((best, *left), shares[1:], strict=True):
                names.add(one.suspect.parameter)
                others = left if one is best else [first]
                likely = float(share), float(1.0 - shares[0])
                yield self.finding(one, likely, others, sure=sure and one is best)

    def finding(
        self, one: Candidate, likely: tuple[float, float], alike: Sequence[Candidate], *, sure: bool
    ) -> Finding:
        suspect, vehicle, deviation = one.suspect, self.vehicle, self.deviation(one)
        size = suspect.size(one.value)
        text = suspect.words(size, deviation, vehicle)
        if alike:
            others = ", ".join(x.suspect.name for x in alike)
            text += f"; this drive cannot separate it from: {others}"
        far = abs(one.value) > RULES.far * suspect.wide and suspect.code not in vehicle.estimated
        of_inertia = suspect.code == "yaw_inertia"
        repair = None if of_inertia and far else suspect.repair(size, vehicle)
        late_r = suspect.code in ("delay", "lag") and suspect.channel == "r"
        text += ANOTHER_R * (not sure and (late_r or of_inertia))
        real = math.erf(abs(one.value) / (math.sqrt(2.0) * deviation))
        return Finding(
            code=suspect.code,
            channel=suspect.channel,
            size=size,
            deviation=deviation,
            unit=suspect.unit,
            confidence=real * likely[0],
            group=real * likely[1],
            text=text,
            repair=repair,
            sure=sure and repair is not None and suspect.plausible(size, vehicle),
            note=suspect.code in NOTES,
        )

    def unobservable(self, post: Posterior) -> Iterator[str]:
        """Yield what this drive tells next to nothing of, beside what was found."""
        for one, _, _, left in self.steps(post):
            if left > RULES.untold * one.scaled(one.wide, self.vehicle):
                least = f"{left * one.per_unit:.2g}{one.text_unit}"
                if one.code in ("factor", "yaw_inertia"):
                    least = f"{100.0 * left:.2g} %"
                name = "steering ratio" if one.parameter == "steering_gain" else one.name
                yield f"{name}: an error of {least} is not observable on this drive"


def examine(recording: Recording, vehicle: Vehicle) -> Examination:
    """Return the faults of a log and of its declared car, and what this drive cannot tell.
    recording : as it was logged, of one drive or of several joined; of a long one lively segments
        are looked at.
    vehicle : as given; its cornering stiffnesses are not looked at.
    """
    search = prepared(recording, vehicle)
    if search is None:
        return Examination(unobservable=(SLOW,))
    post = search.run()
    taken = frozenset((one.first.suspect.code, one.first.suspect.channel) for one in search.found)
    worst = search.problem.model_error(post.p)
    if worst.max() > RULES.unexplained:
        alone = max(recording.segments, key=lambda part: part.stop - part.start)
        length = alone.stop - alone.start
        if length < len(recording) and length * recording.dt > ENOUGH:
            longest = examine(recording.taken(alone), vehicle)
            if not any(found.code == "no_tire" for found in longest.findings):
                return longest._replace(unobservable=(*longest.unobservable, _OF_ONE_LOG))
        channel, text = UNEXPLAINED[int(np.argmax(worst))]
        share = f"{100.0 * worst.max():.0f} % model error (typical: below 12 %)"
        one = Finding(code="no_tire", channel=channel, confidence=0.9, text=f"{text}; {share}")
        return Examination((one,), (_SIZES_BLIND,), taken)
    found = [*search.findings(post), *_sideways(search, post)]
    if search.accelerometer is not None:
        found = _of_one_device(found, vehicle)
    return Examination(tuple(found), tuple(search.unobservable(post)), taken)


def _sideways(search: Search, post: Posterior) -> Iterator[Finding]:
    """Yield a note on a v_y that is off at the median speed, with no bias and no angle found."""
    names = ("v_y_bias", "v_y_angle")
    if any(name in search.wide for name in names):
        return
    where = [INDEX[name] for name in names]
    on = np.concatenate([one.signals[one.counts, 0] for one in search.problem.drives])
    P, speed = post.covariance[np.ix_(where, where)], float(np.median(on))
    if found := sideways(post.p[where], P, speed):
        size, deviation, text = found
        yield Finding(
            code="v_y_reads", channel="v_y", size=size, deviation=deviation, unit="m/s",
            confidence=0.9, note=True, text=f"{text}{UNSEPARATED}",
        )  # fmt: skip


def prepared(recording: Recording, vehicle: Vehicle) -> Search | None:
    """Return the search of a drive, None where too little is driven."""
    whole = sum((one.stop - one.start) * recording.dt > RULES.log for one in recording.segments)
    logs = min(max(whole, 1), RULES.logs)
    segments = segments_of(
        recording, vehicle, longest=logs * RULES.longest, pieces=logs * RULES.pieces
    )
    fastest = min(RULES.interval, RULES.interval * vehicle.scale + 0.004)
    bare = [replace(one, a_y=None) for one in segments]
    drives = [_inside(Drive.of(one, vehicle, fastest=fastest)) for one in bare]
    if sum(np.count_nonzero(one.counts) * one.dt for one in drives) < RULES.shortest:
        return None
    priors, accelerometer = Priors.of(vehicle), None
    if recording.a_y is not None:
        accelerometer = Accelerometer(segments, drives, vehicle)
        accelerometer.line(priors.mean, dict.fromkeys(OF_A_Y[:4], 1.0))
    problem = Problem(drives, vehicle, priors, every=True)
    return Search(problem=problem, accelerometer=accelerometer)


def _inside(drive: Drive) -> Drive:
    """Return a drive whose ends do not count."""
    n = min(round(RULES.margin / drive.dt), len(drive.signals) // 2)
    counts = drive.counts.copy()
    counts[:n], counts[counts.size - n :] = False, False
    return replace(drive, counts=counts)


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
            text=TURNING.words(size, one.deviation, vehicle) + ANOTHER_R * (not one.sure),
            sure=one.sure and other.sure,
            confidence=min(one.confidence, other.confidence), group=max(one.group, other.group),
        )  # fmt: skip
        return [both if x is one else x for x in listed if x is not other]
    return listed
