"""Which tire should be steered with: the one in use, the one learnt, or one of another friction."""

import math

import numpy as np

from codegen.arrays import Array
from identifier.method import CannotFreezeError
from identifier.run import DivergedError, OnlineIdentifier
from identifier.tire_model import TireModel
from models.bicycle import measured_slip
from models.vehicle import Vehicle
from mpc.handover.certificate import (
    LARGEST_SLIP,
    largest_push,
    law_complaint,
    tire_complaint,
)
from mpc.handover.judge import ChiSquare, Judge, Window
from mpc.handover.road import RoadWatch
from mpc.handover.rules import Decision, Rules, Verdict
from mpc.tires import PredictionTire, prediction_tire

_LEARNS = 0.005  # rad: below, a tire is a straight line in noise
_BEYOND = 1.2  # slip that is trusted over the largest one that was learnt from
_LOST = 5  # samples in a row after which a window is none


class Excitation:
    """What a drive had to teach: time of slip, and how much of it.
    dt : sampling interval [s].
    least_time : with slip at both axles before anything may be handed over [s].
    """

    def __init__(self, dt: float, vehicle: Vehicle, least_time: float) -> None:
        self._dt, self._vehicle, self._least_time = dt, vehicle, least_time
        self._time = np.zeros(2)
        self._largest = np.zeros(2)

    def add(self, v_x: float, v_y: float, r: float, delta: float) -> None:
        """Take a sample.

        v_x : longitudinal speed [m/s], positive.   v_y : lateral velocity [m/s].
        r : yaw rate [rad/s].   delta : angle of the front road wheels [rad].
        """
        size = np.abs(slips(np.array([[v_x, v_y, r, delta]]), self._vehicle))[0]
        self._time += self._dt * (size >= _LEARNS)
        self._largest += 0.1 * np.maximum(size - self._largest, 0.0)  # not of one noisy sample

    def complaint(self, model: TireModel, samples: Array) -> str | None:
        """Return why a model is not known well enough where the car is driven, or None.

        model : the candidate. One of axles knows where it was learnt; of any other it is taken to
        be known as far as the car slipped.
        samples : rows of v_x, v_y, r, δ_f: where it must be known, (n, 4 or more).
        """
        for axle, time in zip(("front", "rear"), self._time, strict=True):
            if not time >= self._least_time:
                return (
                    f"the {axle} axle was identified for {time:.1f} s, not {self._least_time:g} s"
                )
        if model.known_slip is not None:
            driven = np.quantile(np.abs(slips(samples, self._vehicle)), 0.95, axis=0)
            for i, axle in enumerate(("front", "rear")):
                known = _BEYOND * model.known_slip[i] + _LEARNS
                if driven[i] > known:
                    return (
                        f"the {axle} axle slips {driven[i]:.3f} rad, it is known to {known:.3f} rad"
                    )
        return None

    def trusted_slip(self, tire: PredictionTire) -> float:
        """Return up to which slip [rad] a tire is to be judged.

        Ladders saturate whatever they have seen; any other tire only as far as the car slipped.
        """
        if tire.structure.saturates:
            return LARGEST_SLIP
        return float(np.clip(_BEYOND * self._largest.min(), 2.0 * _LEARNS, LARGEST_SLIP))


def slips(samples: Array, vehicle: Vehicle) -> Array:
    """Return kinematic slip angles (n, 2) [rad], paper's sign.

    samples : rows of v_x (positive), v_y [m/s], r [rad/s], δ_f [rad], (n, 4 or more).
    """
    v_x, v_y, r, delta = samples[:, :4].T
    return measured_slip(vehicle.l_f, vehicle.l_r, v_x=v_x, v_y=v_y, r=r, delta_f=delta)


class Supervisor:
    """Watches an identifier learn and names the tire to be steered with, `target`.

    Two ways lead to another tire. The learnt one, where its law is certified, its forces are those
    of a tire, it was excited where the car is driven, and it explains the last seconds better than
    the one in use. And, for what cannot wait for seconds, the tire in use at another friction,
    where that explains the last moments far better; it is corrected as more is seen.

    Attributes: target; decisions, those that changed it, and the last one.
    in_use : the tire to begin with, one of this car: what it does not explain is the road.
    """

    def __init__(
        self,
        identifier: OnlineIdentifier,
        in_use: PredictionTire,
        rules: Rules | None = None,
    ) -> None:
        dt = identifier.method.dt
        self.identifier, self.target = identifier, in_use
        self.rules, self.judge = rules or Rules(), Judge(dt)
        complaint = law_complaint(identifier.method, identifier.vehicle)
        if complaint is not None:
            raise ValueError(complaint)
        learnt = prediction_tire(identifier.model()).structure
        if learnt != in_use.structure:
            raise ValueError(
                f"the identified tire ({learnt}) cannot replace the tracker's "
                f"({in_use.structure}): begin with a tire of the identifier"
            )
        longest = max(self.rules.seconds, self.rules.follow)
        self._window = Window(self.judge.lookback(longest), dt)
        self._excitation = Excitation(dt, identifier.vehicle, self.rules.learning_time)
        self._every = max(1, round(self.rules.every / dt))
        self._learnt_every = max(1, round(self.rules.learnt_every / dt))
        self._samples, self._dt = 0, dt
        self._sample, self._lost = (0.0, 0.0, 0.0, 0.0), 0
        self._watch = RoadWatch(in_use, self.rules)
        self._first, self._weighed, self._friction = largest_push(in_use), in_use, 1.0
        # What was steered with and what was learnt, and since when [s], to go back to.
        self._steered = [(-math.inf, in_use, self._watch.road)]
        self._models: list[tuple[float, TireModel | None]] = [(-math.inf, identifier.start)]
        self._agreed, self._trusted_since = True, -math.inf
        self.decisions: list[Decision] = []
        self.last = Decision(0.0, Verdict.KEEP, "no driving yet")

    @property
    def t(self) -> float:
        """Time since the first sample [s]."""
        return self._samples * self._dt

    @property
    def friction(self) -> float:
        """Friction of the road over that of the first tire in use, as it is known now [-].

        NaN while the sensors disagree.
        """
        if not self._agreed:
            return math.nan
        if self._weighed is not self.target:
            self._weighed = self.target
            self._friction = float((largest_push(self.target) / self._first).min())
        return self._friction

    def observe(
        self, v_x: float, v_y: float, r: float, delta: float, *, fault: str | None = None
    ) -> Decision | None:
        """Take a sample; return a decision where one was due.

        A sample with a sensor fault teaches nothing. Where a fault begins, what is steered with and
        what was learnt go back to what they were before its cause can have been at work. An
        identifier that is stale is a fault by itself.

        v_x : longitudinal speed [m/s].   v_y : lateral velocity [m/s].   r : yaw rate [rad/s].
        delta : angle of the front road wheels [rad].
        fault : why the sensors are not to be believed, in words; None where they are.
        """
        self._samples += 1
        if fault is None:
            self.identifier.update(np.array([v_y, r]), np.array([delta, 0.0]), v_x)
            if self.identifier.stale:
                fault = f"no sample could be taken for {self.identifier.stale_time:g} s"
        if fault is not None:
            return self._faulted(fault)
        if not self._agreed:
            self._agreed, self._trusted_since = True, self.t
        if self.identifier.limits.accept(v_x, v_y, r, delta, 0.0):
            self._lost = 0
            sample = (v_x, v_y, r, delta)
        else:
            self._lost += 1
            sample = self._sample  # for a moment the last one stands for it
        self._sample = sample
        if self._lost > _LOST or not sample[0] >= self.identifier.method.min_speed:
            self._window.clear()
            return None
        self._window.add(sample)
        self._excitation.add(*sample)
        if self._samples % self._every and self._samples % self._learnt_every:
            return None
        if not self._samples % self._learnt_every:
            self._remember()
        self.last = self._decide(sample[0])
        if self.last.verdict is not Verdict.KEEP:
            self.decisions.append(self.last)
            self._steered.append((self.t, self.target, self._watch.road))
        return self.last

    def _remember(self) -> None:
        """Keep what was learnt by now, and of what is older only the newest that may be needed."""
        try:
            model = self.identifier.model()
        except (DivergedError, CannotFreezeError, ValueError):
            return
        self._models.append((self.t, model))
        old = [one for one in self._models if one[0] <= self._trusted_until]
        self._models = self._models[max(len(old) - 1, 0) :]

    def _faulted(self, fault: str) -> Decision | None:
        """Take a sample with a fault; return the decision where the fault begins."""
        self._window.clear()
        if not self._agreed:
            return None
        self._agreed = False
        before = self._trusted_until
        self._steered = [one for one in self._steered if one[0] <= before]
        self._models = [one for one in self._models if one[0] <= before] or self._models[:1]
        _, self.target, self._watch.road = self._steered[-1]
        self.identifier.restart(self._models[-1][1])
        self.last = Decision(self.t, Verdict.FAULT, fault)
        self.decisions.append(self.last)
        return self.last

    @property
    def _trusted_until(self) -> float:
        """Time until which nothing was spoilt by a fault that would be noticed now [s]."""
        before = self.t - self.rules.revoke
        relapsed = self.t - self._trusted_since < self.rules.relapse
        return min(before, self._trusted_since) if relapsed else before

    def _keep(self, reason: str) -> Decision:
        return Decision(self.t, Verdict.KEEP, reason)

    def _decide(self, v_x: float) -> Decision:
        rules, judge = self.rules, self.judge
        if self._window.duration < judge.lookback(rules.last_moments):
            return self._keep("too few samples")
        trusted = self._excitation.trusted_slip(self.target)
        look = self._watch.look(judge, self.target, self._window, self.t, trusted)
        if look.suspected:
            return self._keep("friction is perhaps lost")
        if (change := look.change) is not None:
            self.target = change.tire
            return Decision(self.t, change.verdict, change.reason, change.road.ratio)
        if self._samples % self._learnt_every:
            return self._keep(self.last.reason)
        return self._learnt(look.now, v_x)

    def _learnt(self, now: ChiSquare, v_x: float) -> Decision:
        rules, judge, watch = self.rules, self.judge, self._watch
        seconds = min(rules.seconds, self.t - watch.road.changed_at)
        samples = self._window.last(judge.lookback(seconds))
        if seconds < rules.least_seconds or len(samples) * self._dt < rules.least_seconds:
            return self._keep("too few seconds to judge the identified tires")
        try:
            model = self.identifier.model()
        except (DivergedError, CannotFreezeError, ValueError) as error:
            return self._keep(str(error))
        complaint = self._excitation.complaint(model, samples)
        candidate = prediction_tire(model)
        trusted = self._excitation.trusted_slip(candidate)
        complaint = complaint or tire_complaint(candidate, v_x, trusted)
        if complaint is not None:
            return self._keep(complaint)
        weights = np.stack([self.target.weights, candidate.weights])
        before, after = judge.chi_squares(candidate, weights, samples)
        reason = f"chi-square of {seconds:.1f} s {before.total:.0f} -> {after.total:.0f}"
        if before.total - after.total < rules.evidence * watch.baseline:
            return self._keep(f"not better: {reason}")
        moments = self._window.last(judge.lookback(rules.last_moments))
        latest = judge.chi_square(candidate, moments)
        if latest.total > now.total + rules.correction * watch.baseline:
            return self._keep("worse in the last moments")
        self.target = candidate
        watch.road = watch.road.on(candidate)
        return Decision(self.t, Verdict.LEARNT, reason)
