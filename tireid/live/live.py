"""The tires while the car drives: samples in, a state out every 0.2 s.

The recursion is that of `tireid.identify`, `axle` where v_y is measured and `inertial` where not,
and gives the same bits for the same samples. Beside it another friction of the road is looked for
(`mpc.handover.road`), against reference tires: stored ones, or what was identified live before.
"""

import math
from collections import deque
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from codegen.arrays import Array
from identifier.axle.car import car_numbers
from identifier.axle.model import AxleModel, begun
from identifier.band import LEVEL, normal_quantile
from identifier.day import NUMBERS, usual_errors
from identifier.inertial import InertialIdentifier
from identifier.methods import LIVE as AXLE
from identifier.methods import make_method
from identifier.run import DivergedError, OnlineIdentifier
from identifier.tire_model import AXLES, STIFFNESS, TireModel, require_band
from identifier.verdict.judging import RULES
from identifier.verdict.verdict import PERCENT
from models.rules import require_kind
from models.vehicle import GRAVITY, Vehicle
from mpc.handover.certificate import LARGEST_SLIP
from mpc.handover.judge import Judge, Window
from mpc.handover.road import RoadWatch, at_friction
from mpc.handover.rules import Rules
from mpc.tires import PredictionTire, prediction_tire
from tireid.live.clock import Clock, Instant
from tireid.live.state import LIVE, SLIP, STORED, Counts, Point, State

EVERY = 0.2  # s between two states
OLD = 1.0  # s, age from which a sample says nothing of now
LATELY = 30.0  # s, in which the tires must have shown force
NEEDED = 4.0  # s with force at both axles, before tires are identified
MISSED = 0.24  # of the force by the motion, rms: twice a verdict's, which takes noise off
NOISE = 0.03  # m/s, of v_y as coupled receivers have it
_LOST = 0.9  # of the friction of the reference, below which there is an alarm
_REFERENCE = 10.0  # s for which tires were valid live, before they are the reference
_PUSH = 1.5  # m/s² of braking or driving, beyond which another friction is not looked for
_LOST_SAMPLES = 5  # in a row, after which the road is looked at anew


class _Now(NamedTuple):
    """A point, and the axle forces that the recursion has there [static axle loads], (2,) each."""

    slip: Array
    measured: Array
    identified: Array


_NONE = _Now(np.zeros(2), np.zeros(2), np.zeros(2))


class _Sums:
    """Of the samples since the last state, what makes a point."""

    def __init__(self) -> None:
        self.n, self._slip, self._force, self._turning = 0, np.zeros(2), np.zeros(2), 0.0

    def add(self, impulse: Array, slip: Array, force: Array, turning: float) -> None:
        """Take a sample.

        Parameters
        ----------
        impulse : ξ [s], (2,).
        slip : [rad], (2,).
        force : that the recursion has [static axle loads], (2,).
        turning : v_x r/g [-].
        """
        if not self.n:
            self._first = impulse
        self.n, self._last = self.n + 1, impulse
        self._slip, self._force = self._slip + slip, self._force + force
        self._turning += turning

    def point(self, dt: float) -> _Now:
        """Return the means; the force by the motion, dξ/dt = F/F_z - v_x r/g."""
        rate = (self._last - self._first) / (dt * (self.n - 1))
        n = self.n
        return _Now(self._slip / n, rate + self._turning / n, self._force / n)


class _Numbers(NamedTuple):
    """What a state gives of tires, as its fields are."""

    force: Array
    force_sd: Array
    known_slip: Array
    stiffness: Array
    stiffness_sd: Array
    grip: Array
    grip_sd: Array
    understeer: float
    understeer_sd: float
    a_y_limit: float
    a_y_limit_sd: float

    @classmethod
    def of(cls, tires: TireModel) -> "_Numbers":
        car, band, known = tires.vehicle, require_band(tires), tires.known_slip
        assert known is not None
        loads = np.array(car.axle_loads)
        force = tires.force(SLIP)
        sd = band.half(SLIP) / normal_quantile(LEVEL)
        peak, both = force.argmax(axis=0), np.arange(2)
        grip, grip_sd = force[peak, both] / loads, sd[peak, both] / loads
        weaker = int(grip.argmin())
        stiffness = tires.stiffness
        found = {
            one.axle: one.sd or math.nan for one in tires.estimates() if one.title == STIFFNESS
        }
        stiffness_sd = np.array([found[axle] for axle in AXLES])
        each = car.mass / car.wheelbase * np.array([car.l_r, -car.l_f]) / stiffness
        return cls(
            force=force.T,
            force_sd=sd.T,
            known_slip=known,
            stiffness=stiffness,
            stiffness_sd=stiffness_sd,
            grip=grip,
            grip_sd=grip_sd,
            understeer=float(each.sum()),
            understeer_sd=float(np.linalg.norm(each * stiffness_sd / stiffness)),
            a_y_limit=GRAVITY * float(grip[weaker]),
            a_y_limit_sd=GRAVITY * float(grip_sd[weaker]),
        )


class Live:
    """Identifies the tires of a car while it drives, and says what is known of it.

    Attributes: counts, of what became of the samples; identifier, None before the first.

    Parameters
    ----------
    vehicle : the car.
    tire : stored tires of it, of a fit or the axle identifier: given while the drive does not show
        enough, the reference of friction until then, and what side slip follows from without v_y.
    resume : what was identified live before, to go on from.

    Raises
    ------
    ValueError
        Where tires are of another car.
    """

    dt = 0.01  # s between two instants of the recursion

    def __init__(
        self, vehicle: Vehicle, tire: TireModel | None = None, *, resume: TireModel | None = None
    ) -> None:
        require_kind(Vehicle, "as of Vehicle.from_toml or sedan", vehicle=vehicle)
        for one in (tire, resume):
            if one is not None and not vehicle.moves_as(one.vehicle):
                raise ValueError(f"the tires are of {one.vehicle.name!r}, not of {vehicle.name!r}")
        self.vehicle, self.counts, self._tire, self._resumed = vehicle, Counts(), tire, resume
        self._stored = None if tire is None else _Numbers.of(tire)
        self._car, self._rules = car_numbers(vehicle), Rules(every=0.1)
        self._judge, self._clock = Judge(self.dt), Clock(self.dt, self.counts)
        self._least = self._judge.lookback(self._rules.last_moments)
        longest = max(self._rules.follow + self._rules.last_moments, self._rules.recovery_seconds)
        self._window = Window(self._judge.lookback(longest), self.dt)
        self._look_every, self._state_every = (
            round(time / self.dt) for time in (self._rules.every, EVERY)
        )
        self.identifier: OnlineIdentifier | None = None
        self._method: Any = None
        reference = tire or resume
        self._watch = None if reference is None else self._watching(begun(reference))
        self._referred = math.nan
        self._friction_since: float | None = None
        self._points: deque[_Now] = deque(maxlen=round(LATELY / EVERY))
        self._seconds = np.zeros(2)  # with force at the axles
        self._model: AxleModel | None = None
        self._identified: _Numbers | None = None
        self._point: _Now | None = None
        self._doubts = "nothing was driven yet"
        self._begin(math.nan)

    def _begin(self, t: float) -> None:
        """Begin anew what is remembered of the last moments."""
        self._window.clear()
        self._steps = self._lost = 0
        self._t, self._sample = t, (math.nan,) * 4  # v_x, v_y, r, δ_f
        self._v_y_sd, self._sums = math.nan, _Sums()

    def _watching(self, tires: TireModel) -> RoadWatch:
        return RoadWatch(prediction_tire(tires, self.vehicle), self._rules)

    def prepare(self, *, v_y: bool) -> None:
        """Compile the recursion before the first sample comes.

        Parameters
        ----------
        v_y : whether there is a lateral velocity.
        """
        if v_y:
            method, start = make_method(AXLE, self.vehicle), self._resumed
            start = None if start is None else _opened(begun(start))
        else:
            known = self._resumed or self._tire
            method, start = InertialIdentifier.beginning_with(known, self.vehicle, dt=self.dt)
        identifier = OnlineIdentifier(method, self.vehicle, self.dt, start)
        identifier.prepare()
        self.identifier, self._method, self._measures_v_y = identifier, method, v_y
        self._start, self._holds = start, getattr(method, "held", False)

    def feed(
        self,
        t: float,
        v_x: float,
        r: float,
        delta_f: float,
        a_y: float | None = None,
        v_y: float | None = None,
    ) -> State | None:
        """Take a sample; return a state where one is due, every 0.2 s.

        The first sample tells whether v_y is measured. Numbers that are none, or of no car, are
        counted; so is what is late or doubled.

        Parameters
        ----------
        t : time by the sender's clock [s].
        v_x, v_y : velocity at the center of gravity, forward and to the left [m/s].
        r : yaw rate, positive to the left [rad/s].
        delta_f : angle of the front road wheels, positive to the left [rad].
        a_y : of an accelerometer, positive to the left [m/s²]; needed where v_y is None.

        Raises
        ------
        ValueError
            Where the first sample has neither v_y nor a_y.
        """
        if not math.isfinite(t):
            self.counts.refused += 1
            return None
        if self.identifier is None:
            if v_y is None and a_y is None:
                raise ValueError("v_y or a_y is needed, the sample has neither")
            self.prepare(v_y=v_y is not None)
        state = None
        for instant in self._clock.add(t, np.array([v_x, v_y, r, delta_f, a_y], dtype=np.float64)):
            self._take(instant)
            self._steps += 1
            if self._steps % self._look_every == self._look_every // 2:  # not beside a state
                self._look()
            if self._steps % self._state_every == 0:
                state = self._remember()
        return state

    def _take(self, instant: Instant) -> None:
        """Show the recursion an instant."""
        identifier = self.identifier
        assert identifier is not None
        if instant.jump or identifier.diverged:
            anew = identifier.diverged or self._holds or self._model is None
            identifier.restart(self._start if anew else self._model)
            self._begin(instant.t)
        elif instant.gap:
            for _ in range(self._method.plausibility.rest(self.dt)):
                identifier.update(np.full(2, math.nan), np.zeros(2), math.nan)
            self._begin(instant.t)
        self._t = instant.t
        v_x, v_y, r, delta, a_y = instant.values.tolist()
        refused = identifier.counts.refused
        force = identifier.update(np.array([v_y, r]), np.array([delta, 0.0]), v_x, a_y)
        if identifier.counts.refused > refused:
            self.counts.refused += 1
            self._lost += 1
            self._sums = _Sums()
            if self._lost > _LOST_SAMPLES:
                self._window.clear()
            return
        self.counts.samples += 1
        self._lost = 0
        if not self._measures_v_y:
            found = identifier.outputs
            v_y, self._v_y_sd = (float(found[name].item()) for name in ("v_y", "v_y_sd"))
            if not found["side_slip_observable"].item() > 0.0:
                v_y = math.nan
        self._sample = (v_x, v_y, r, delta)
        if not (v_x >= self._method.min_speed and math.isfinite(v_y)):
            self._sums = _Sums()
            self._window.clear()
            return
        self._window.add(self._sample)
        model = self._model
        if model is not None:
            true_v_y = self._v_y_of(model)
            arms, inertia, load = self._car[:, 0], self._car[:, 2], self._car[:, 3]
            slip = -np.arctan((true_v_y + arms * r) / v_x)
            slip[0] += model.sensors.steering(delta) + model.offset[0]
            self._sums.add(v_y / GRAVITY + inertia * r, slip, force / load, v_x * r / GRAVITY)

    def _v_y_of(self, model: AxleModel) -> float:
        """Return v_y of the newest sample without errors of its sensor [m/s]."""
        v_x, v_y, r, _ = self._sample
        if not self._measures_v_y:
            return v_y
        return float(model.sensors.v_y(v_y, r, v_x) - model.offset[1])

    def _look(self) -> None:
        """Look at the road, with the zeros of the sensors as they are today."""
        watch, model = self._watch, self._model
        if watch is None or model is None or self._window.duration < self._least:
            return
        v_x, v_y, r, _ = self._window.last(self._least).T
        push = (v_x[-1] - v_x[0]) / (self._least - self.dt) - float(np.mean(v_y * r))
        if abs(push) > _PUSH:
            return
        base = _with_zeros(watch.road.base, model)
        watch.road = watch.road._replace(base=base)
        ratio = watch.road.ratio
        in_use = base if ratio == 1.0 else at_friction(base, ratio)
        look = watch.look(self._judge, in_use, self._window, self._t, LARGEST_SLIP)
        if look.change is not None:
            self._friction_since = self._t

    def _remember(self) -> State | None:
        """Take the means since the last state, refresh what is identified, and return a state."""
        identifier = self.identifier
        assert identifier is not None
        point = self._sums.point(self.dt) if self._sums.n > self._state_every // 2 else None
        self._sums = _Sums()
        try:
            model: Any = identifier.model()
        except (DivergedError, ValueError) as error:
            self._doubts = f"no tires follow from what was driven: {error}"
            return self.state()
        self._model, self._point = model, point
        self._points.append(point or _NONE)
        self._seconds += EVERY * (np.abs(self._points[-1].measured) >= RULES.force)
        self._identified = _Numbers.of(model)
        self._doubts = self._complaint(model)
        if self._doubts:
            self._referred = self._t  # so that a reference is of steady knowledge
        elif self._t - self._referred >= _REFERENCE and self._friction in (None, 1.0):
            self._watch, self._referred = self._watching(model), self._t
        return self.state()

    def _complaint(self, model: AxleModel) -> str:
        """Return why what is identified is not to be trusted, empty where it is."""
        if self._holds:
            return "without v_y stored tires are used as they are"
        if not (self._seconds >= NEEDED).all():
            axle = AXLES[int(self._seconds.argmin())]
            return f"the {axle} axle has had force for {self._seconds.min():.1f} s, not {NEEDED:g}"
        slip, measured, identified = (np.array(one) for one in zip(*self._points, strict=True))
        power = np.maximum(np.sum(measured**2, axis=0), 1e-9)
        with_force = np.abs(measured).max(axis=0) >= RULES.force
        typical = np.sum(measured**2 * np.abs(slip), axis=0) / power
        doubt = np.diag(model.band.relative_sd(np.maximum(typical, 1e-4)))
        missed = np.sqrt(np.sum((measured - identified) ** 2, axis=0) / power)
        for axle, force, sd, error in zip(AXLES, with_force, doubt, missed, strict=True):
            if not force:
                return f"the {axle} axle had no force in the last {LATELY:g} s"
            if not sd <= RULES.doubt:
                return f"the {axle} axle is known to {PERCENT * sd:.0f} % of what was unknown"
            if not error <= MISSED:
                return f"{PERCENT * error:.0f} % of the force of the {axle} axle is not explained"
        sd = self._v_y_sd / max(self._sample[0], model.min_speed)
        if not self._measures_v_y and not sd <= RULES.side_slip:
            return f"side slip is known to {math.degrees(sd):.2g} deg"
        assert self.identifier is not None
        reached = self._method.limits.active(self.identifier.state())
        reached = [one for one in reached if one.refuses]
        return f"{reached[0].title} is at its bound: {reached[0].meaning}" if reached else ""

    def state(self, age: float = 0.0) -> State | None:
        """Return what is known now; None before there is anything.

        Parameters
        ----------
        age : of the newest sample [s].
        """
        model, live = self._model, self._identified
        if model is None or live is None or self.identifier is None:
            return None
        reason = self._doubts
        if age > OLD:
            reason = f"nothing came for {age:.1f} s"
        elif self.identifier.stale:
            reason = "samples hold no numbers of a car"
        given = live if not reason or self._stored is None else self._stored
        v_x = self._sample[0]
        moves = age <= OLD and v_x >= model.min_speed and not self._lost
        bias_sd = math.sqrt(model.covariance[1, -1, -1]) if self._measures_v_y else math.nan
        v_y_sd = math.hypot(bias_sd, NOISE) if self._measures_v_y else self._v_y_sd
        slides = moves and math.isfinite(self._sample[1])
        friction = self._friction
        point = self._point if age <= OLD else None
        loads = self._car[:, 3]
        return State(
            t=self._t,
            age=age,
            valid=not reason,
            reason=reason,
            origin=LIVE if given is live else STORED,
            alarm=self._alarm(friction),
            slip=SLIP,
            **given._asdict(),
            friction=friction,
            friction_since=self._friction_since,
            side_slip=math.atan2(self._v_y_of(model), v_x) if slides else None,
            side_slip_sd=v_y_sd / v_x if slides else None,
            steering_zero=float(model.offset[0]),
            steering_zero_sd=math.sqrt(model.covariance[0, -1, -1]),
            v_y_bias=float(model.offset[1]) if self._measures_v_y else None,
            v_y_bias_sd=bias_sd if self._measures_v_y else None,
            point=None if point is None else Point(point.slip, point.measured * loads),
            counts=replace(self.counts),
        )

    @property
    def _friction(self) -> float | None:
        return None if self._watch is None else self._watch.road.ratio

    def _alarm(self, friction: float | None) -> str:
        if friction is None or friction >= _LOST:
            return ""
        return f"friction {friction:.2f} of the reference, since {self._friction_since:.1f} s"

    def tires(self) -> TireModel | None:
        """Return what is identified now, where it may be trusted; None where not."""
        return None if self._doubts or self._alarm(self._friction) else self._model


def _with_zeros(tire: PredictionTire, model: AxleModel) -> PredictionTire:
    """Return a tire that reads the sensors with their zeros of today."""
    weights = tire.weights.copy()
    weights[[0, 2]] = model.offset  # as of `mpc.tires.axles.CurveAxles`
    return tire._replace(weights=weights)


def _opened(tires: TireModel) -> TireModel:
    """Return tires of another day: zeros of the sensors are as unknown as on the first."""
    if not isinstance(tires, AxleModel):
        return tires
    usual = usual_errors(tires.vehicle)
    covariance = tires.covariance.copy()
    for i, name in enumerate(("steering_zero", "v_y_bias")):
        covariance[i, -1, -1] += usual[NUMBERS.index(name)] ** 2
    return replace(tires, covariance=covariance)
