"""The tires while the car drives: samples in, a state out every 0.2 s.

The recursion is that of `tireid.identify`, `axle` where v_y is measured and `inertial` where not,
and gives the same bits for the same samples. Beside it another friction of the road is looked for
(`mpc.handover.road`), against reference tires: stored ones, then those that were identified live.
"""

import math
from collections import deque
from dataclasses import replace
from typing import Any

import numpy as np

from codegen.arrays import Array
from identifier.axle.car import car_numbers
from identifier.axle.curve import unit_matrix
from identifier.axle.model import AxleModel, begun
from identifier.band import LEVEL, normal_quantile
from identifier.day import NUMBERS, usual_errors
from identifier.inertial import InertialIdentifier
from identifier.methods import LIVE as AXLE
from identifier.methods import make_method
from identifier.run import DivergedError, OnlineIdentifier
from identifier.tire_model import AXLES, STIFFNESS, TireModel, require_band
from identifier.verdict.judging import RULES
from identifier.verdict.verdict import LARGEST_MODEL_ERROR, PERCENT
from models.bicycle import measured_slip
from models.recordings.map import LONGEST_GAP
from models.rules import require_kind
from models.vehicle import GRAVITY, Vehicle
from mpc.handover.certificate import LARGEST_SLIP
from mpc.handover.judge import Judge, Window
from mpc.handover.road import RoadWatch, at_friction, fit_friction
from mpc.handover.rules import Rules
from mpc.tires import PredictionTire, prediction_tire
from tireid.live.clock import DT, Clock, Instant
from tireid.live.state import LIVE, REACH, SLIPS, STORED, Counts, Point, State

EVERY = 20  # instants between two states
AT_ONCE = 5  # samples that are taken together
LOOK = 10  # instants between two looks at the road; with twice the evidence that drives ask for
# recordings have half the false alarms, and of 48 halved frictions 94 % are still found within 1 s
RULES_OF_ROAD = Rules(every=LOOK * DT, friction_evidence=16.0)
LATEST = 1e11  # s, no clock in seconds goes further: ms since 1970 are more
LARGEST = 1e9  # of a signal in SI, beyond which it is no number
OLD = 1.0  # s, age from which a sample says nothing of now
LATELY = 30.0  # s, in which the tires must have shown force
NEEDED = 4.0  # s with force at both axles, before tires are identified
STUCK = 10  # states of turning through which v_y was one number, and so was not measured
MISSED = 2.0 * LARGEST_MODEL_ERROR  # of the force, rms; noise is in it: .10 on 99 % of random cars
# standard deviations by which stiffness is above its bound, and no secant of a curve above it by
# more than curves may miss: refuses none of 52 random cars, and with 0.01 rad of play 91 % of the
# states that were valid
FLAT = 0.5
NOISE = 0.03  # m/s, of v_y as coupled receivers have it
LOST = 0.9  # of the friction of the reference, below which there is an alarm
REFERENCE = 1000  # instants, 10 s, through which tires explain the motion, to be the reference
PUSH = 1.5  # m/s² of braking or driving, beyond which another friction is not looked for
_BEYOND = 1.2  # of the known slip: to where curves reach
_LOST_SAMPLES = 5  # in a row, after which the road is looked at anew
_NO_POINT = np.zeros((3, 2))


class Live:
    """Identifies the tires of a car while it drives, and says what is known of it.

    Attributes: measures_v_y.

    Parameters
    ----------
    vehicle : the car.
    tire : stored tires of it, of a fit or the axle identifier: given while the drive does not show
        enough, the reference of friction until then, and what side slip follows from without v_y.
    resume : what was identified live before, to go on from.

    Raises
    ------
    ValueError
        Where tires are of another car, or cannot tell how sure they are.
    """

    def __init__(
        self, vehicle: Vehicle, tire: TireModel | None = None, *, resume: TireModel | None = None
    ) -> None:
        require_kind(Vehicle, "as of Vehicle.from_toml or sedan", vehicle=vehicle)
        for one in filter(None, (tire, resume)):
            one.require_car(vehicle, remedy="give that car, or another store or weights")
        self.vehicle, self._counts, self._tire, self._resume = vehicle, Counts(), tire, resume
        self._identifier: OnlineIdentifier | None = None
        self._method: Any = None
        self.measures_v_y = False
        self._stored = None if tire is None else _numbers(tire, tire.model_error)
        self._live: dict[str, Any] = {}
        self._model: AxleModel | None = None
        _, _, self._inertia, self._loads = car_numbers(vehicle).T
        self._clock, self._judge = Clock(DT, self._counts), Judge(DT)
        self._moments = self._judge.lookback(RULES_OF_ROAD.last_moments)
        self._window = Window(self._moments + RULES_OF_ROAD.follow, DT)
        reference = tire or resume
        self._watch = None if reference is None else self._watching(begun(reference))
        self._explained_since, self._friction_since = math.nan, math.nan
        # Of each state: slip, force by the motion, and as identified [static axle loads], (3, 2).
        self._points = deque[Array](maxlen=round(LATELY / (EVERY * DT)))
        self._states_with_force = np.zeros(2)
        self._missed = np.zeros(2)  # share of the force, lately
        self._complaint, self._stuck = "nothing was driven yet", 0
        self._steps, self._breaks = 0, 0  # instants; gaps and jumps since the last state
        self._waiting: list[tuple[float, ...]] = []  # samples, as they came
        self._due = False  # whether a state is
        self._begin()

    def _begin(self) -> None:
        """Forget the last moments."""
        self._window.clear()
        self._lost, self._v_y_sd = 0, math.nan
        self._v_x = self._v_y = self._r = math.nan  # newest, as they are read
        self._forces: list[Array] = []  # of the axles since the last state [N], (2,) each

    def _watching(self, tires: TireModel) -> RoadWatch:
        return RoadWatch(prediction_tire(tires, self.vehicle), RULES_OF_ROAD)

    def prepare(self, *, v_y: bool) -> None:
        """Compile what is needed before the first sample comes.

        Parameters
        ----------
        v_y : whether it is measured.
        """
        if v_y:
            method: Any = make_method(AXLE, self.vehicle)
            start = None if self._resume is None else _opened(begun(self._resume))
        else:
            method, start = InertialIdentifier.beginning_with(
                self._resume or self._tire, self.vehicle, dt=DT
            )
        self._identifier = OnlineIdentifier(method, self.vehicle, DT, start)
        self._identifier.prepare()
        straight = np.tile([2.0 * method.min_speed, 0.0, 0.0, 0.0], (round(self._moments / DT), 1))
        tire = prediction_tire(self._identifier.model(), self.vehicle)
        fit_friction(self._judge, tire, straight)  # compiles what looks at the road
        self._judge.chi_square(tire, straight)
        self._method, self._start, self.measures_v_y = method, start, v_y
        self._holds = getattr(method, "held", False)

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

        The first sample shows whether v_y is measured. Bad, late and doubled ones are counted.

        Parameters
        ----------
        t : time by the sender's clock [s].
        v_x : velocity at the center of gravity, forward [m/s].
        r : yaw rate, positive to the left [rad/s].
        delta_f : angle of the front road wheels, positive to the left [rad].
        a_y : of an accelerometer, positive to the left [m/s²]; needed where v_y is None.
        v_y : velocity at the center of gravity, to the left [m/s].

        Raises
        ------
        ValueError
            Where the first sample has neither v_y nor a_y.
        """
        if not abs(t) < LATEST:
            self._counts.refused += 1
            return None
        if self._identifier is None:
            if v_y is None and a_y is None:
                raise ValueError("v_y or a_y is needed, the sample has neither")
            self.prepare(v_y=v_y is not None)
        waiting = self._waiting
        signals = (v_x, v_y, r, delta_f, a_y)
        waiting.append((float(t), *(math.nan if one is None else float(one) for one in signals)))
        if (self._steps + len(waiting)) % AT_ONCE and abs(t - waiting[0][0]) < AT_ONCE * DT:
            return None
        self._catch_up()
        due, self._due = self._due, False
        return self.state() if due else None

    def _catch_up(self) -> None:
        """Take the samples that wait: one at a time costs twice as much, out of a cold cache."""
        waiting, self._waiting = self._waiting, []
        for t, *signals in waiting:
            values = np.array(signals, dtype=np.float64)
            values[np.abs(values) > LARGEST] = math.nan
            for instant in self._clock.add(t, values):
                self._take(instant)
                self._steps += 1
                if self._steps % LOOK == AT_ONCE:
                    self._look()
                if self._steps % EVERY == EVERY - AT_ONCE:  # a state comes the sooner
                    self._refresh()
                self._due |= self._steps % EVERY == 0

    def _take(self, instant: Instant) -> None:
        """Show the recursion an instant."""
        identifier = self._identifier
        assert identifier is not None
        if instant.jump or identifier.diverged:
            anew = identifier.diverged or self._holds
            identifier.restart(self._start if anew else self._model or self._start)
            self._begin()
        elif instant.gap:
            for _ in range(self._method.plausibility.rest(DT)):
                identifier.update(np.full(2, math.nan), np.zeros(2), math.nan)
            self._begin()
        self._breaks += instant.gap or instant.jump
        self._t = instant.t
        v_x, v_y, r, delta, a_y = instant.values.tolist()
        refused = identifier.counts.refused
        force = identifier.update(np.array([v_y, r]), np.array([delta, 0.0]), v_x, a_y)
        if identifier.counts.refused > refused:
            self._counts.refused += 1
            self._lost += 1
            if self._lost > _LOST_SAMPLES:
                self._begin()
            return
        self._counts.samples += 1
        self._lost = 0
        if not self.measures_v_y:
            found = {name: float(value.flat[0]) for name, value in identifier.outputs.items()}
            v_y = found["v_y"] if found["side_slip_observable"] > 0.0 else math.nan
            self._v_y_sd = found["v_y_sd"]
        moves = v_x >= self._method.min_speed
        self._v_x, self._v_y, self._r = (v_x if moves else math.nan), v_y, r
        if moves and math.isfinite(v_y):
            self._window.add((v_x, v_y, r, delta))
            self._forces.append(force)
        else:
            self._window.clear()
            self._forces.clear()

    def _true_v_y(self, model: AxleModel, v_x: Any, v_y: Any, r: Any) -> Any:
        """Return lateral velocities without errors of their sensor [m/s]."""
        return model.sensors.v_y(v_y, r, v_x) - model.offset[1] if self.measures_v_y else v_y

    def _point(self, model: AxleModel) -> Array:
        """Return the means since the last state; the force by dξ/dt = F/F_z - v_x r/g."""
        n, forces = len(self._forces), self._forces
        self._forces = []
        if n <= EVERY // 2:
            return _NO_POINT
        v_x, v_y, r, delta = self._window.last(n * DT).T
        stuck = not np.ptp(v_y)
        turning = float(np.mean(v_x * r)) / GRAVITY
        self._stuck = stuck * (self._stuck + int(abs(turning) >= RULES.force))
        slip = measured_slip(
            self.vehicle.l_f,
            self.vehicle.l_r,
            v_x=v_x,
            v_y=self._true_v_y(model, v_x, v_y, r),
            r=r,
            delta_f=model.sensors.steering(delta) + model.offset[0],
        )
        rate = (v_y[-1] - v_y[0]) / GRAVITY + self._inertia * (r[-1] - r[0])
        measured = rate / (DT * (n - 1)) + turning
        return np.array([slip.mean(axis=0), measured, np.mean(forces, axis=0) / self._loads])

    def _look(self) -> None:
        """Look at the road, with the zeros of the sensors as they are today."""
        watch, model = self._watch, self._model
        if watch is None or model is None or self._window.duration < self._moments:
            return
        v_x, v_y, r, _ = self._window.last(self._moments).T
        push = (v_x[-1] - v_x[0]) / (self._moments - DT) - float(np.mean(v_y * r))
        if abs(push) > PUSH:
            return
        watch.road = watch.road._replace(base=_with_zeros(watch.road.base, model))
        in_use = at_friction(watch.road.base, watch.road.ratio)
        t = DT * self._steps  # on no clock that jumps
        if watch.look(self._judge, in_use, self._window, t, LARGEST_SLIP).change is not None:
            self._friction_since = self._t

    def _refresh(self) -> None:
        """Bring what is identified up to date, with the mean of the samples since the last time."""
        identifier = self._identifier
        assert identifier is not None
        breaks, self._breaks = self._breaks, 0
        try:
            model: Any = identifier.model()
        except (DivergedError, ValueError) as error:
            self._complaint = f"no tires follow from what was driven: {error}"
            return
        point = self._point(model)  # its first forces are those of the prior
        self._points.append(_NO_POINT if self._model is None else point)
        self._model = model
        self._states_with_force += np.abs(self._points[-1][1]) >= RULES.force
        explains, self._complaint = self._judged(model, identifier.state())
        self._live = _numbers(model, self._missed)
        if breaks > EVERY // 2:
            self._complaint = f"samples are over {LONGEST_GAP:g} s apart (clock.unit?)"
        if not explains:
            self._explained_since = self._steps
        elif self._steps - self._explained_since >= REFERENCE and self._friction in (None, 1.0):
            self._watch, self._explained_since = self._watching(model), self._steps

    def _judged(self, model: AxleModel, state: dict[str, Array]) -> tuple[bool, str]:
        """Return whether tires explain the motion, and why they are not to be trusted."""
        if self._stuck >= STUCK:
            return False, "v_y never changes while the car turns: it is not measured"
        seconds = EVERY * DT * self._states_with_force
        if self._holds or not (seconds >= NEEDED).all():
            axle = AXLES[int(seconds.argmin())]
            few = f"the {axle} axle has had force for {seconds.min():.1f} s, not {NEEDED:g}"
            return False, "without v_y stored tires stay as they are" if self._holds else few
        slip, measured, identified = np.array(self._points).swapaxes(0, 1)
        power = np.maximum(np.sum(measured**2, axis=0), 1e-9)
        peak = np.abs(measured).max(axis=0)
        typical = np.sum(measured**2 * np.abs(slip), axis=0) / power
        doubt = np.diag(model.band.relative_sd(np.maximum(typical, 1e-4)))
        error = identified - measured
        rms = np.sqrt(np.sum(error**2, axis=0) / power)
        self._missed = np.where(peak >= RULES.force, rms, self._missed)
        mean = np.abs(np.sum(error * measured, axis=0)) / power  # a share with hardly any noise
        good = (rms <= MISSED) & (mean <= LARGEST_MODEL_ERROR)
        flat, reasons = _flat(model, self._method.bounds.least_stiffness), []
        for axle, force, sd, off, explained, soft in zip(
            AXLES, peak, doubt, rms, good, flat, strict=True
        ):
            if not force >= RULES.force:
                reasons.append(f"the {axle} axle had no force in the last {LATELY:g} s")
            elif not explained:
                words = f"{PERCENT * off:.0f} % of the force of the {axle} axle is not explained"
                reasons.append(f"{words}: check signs, units, steering ratio")
            elif not sd <= RULES.doubt:
                share = f"{PERCENT * sd:.0f} %"
                reasons.append(f"the doubt of the {axle} axle is {share} of what it was at first")
            elif soft:
                words = f"the {axle} curve is flat about zero slip, as by play of the steering"
                reasons.append(f"{words} or errors of v_y: give --weights of tireid identify")
        side_slip_sd = self._v_y_sd / self._v_x  # NaN where v_y is measured, or the car stands
        if side_slip_sd > RULES.side_slip:
            reasons.append(f"side slip is known to {math.degrees(side_slip_sd):.2g} deg")
        reached = self._method.limits.active(state)
        reasons += [f"{one.title} is at its bound: {one.meaning}" for one in reached if one.refuses]
        return bool((good & (peak >= RULES.force)).all()), reasons[0] if reasons else ""

    @property
    def counts(self) -> Counts:
        """What became of the samples."""
        self._catch_up()
        return self._counts

    @property
    def identifier(self) -> OnlineIdentifier | None:
        """The recursion, with all samples taken; None before the first."""
        self._catch_up()
        return self._identifier

    @property
    def _friction(self) -> float | None:
        return None if self._watch is None else self._watch.road.ratio

    def state(self, age: float = 0.0) -> State | None:
        """Return what is known now; None before there is anything.

        Parameters
        ----------
        age : of the newest sample [s].
        """
        self._catch_up()
        model, friction = self._model, self._friction
        if model is None or self._identifier is None:
            return None
        reason, alarm = self._complaint, ""
        if age > OLD:
            reason = f"nothing came for {age:.1f} s"
        elif self._identifier.stale:
            reason = "samples hold no numbers of a car"
        if friction is not None and friction < LOST:
            since = self._t - self._friction_since
            alarm = f"friction {friction:.2f} of the reference, for {since:.1f} s"
        stored = bool(reason) and self._stored is not None
        bias_sd = math.sqrt(model.covariance[1, -1, -1])
        v_y_sd = math.hypot(bias_sd, NOISE) if self.measures_v_y else self._v_y_sd
        v_y = self._true_v_y(model, self._v_x, self._v_y, self._r)
        slides = age <= OLD and not self._lost and math.isfinite(self._v_x * self._v_y)
        point = self._points[-1] if age <= OLD else _NO_POINT
        return State(
            t=self._t,
            age=age,
            valid=not reason,
            reason=reason,
            origin=STORED if stored else LIVE,
            alarm=alarm,
            **(self._stored or self._live if stored else self._live),
            friction=friction,
            friction_since=None if math.isnan(self._friction_since) else self._friction_since,
            side_slip=math.atan2(v_y, self._v_x) if slides else None,
            side_slip_sd=v_y_sd / self._v_x if slides else None,
            steering_zero=float(model.offset[0]),
            steering_zero_sd=math.sqrt(model.covariance[0, -1, -1]),
            v_y_bias=float(model.offset[1]) if self.measures_v_y else None,
            v_y_bias_sd=bias_sd if self.measures_v_y else None,
            point=None if point is _NO_POINT else Point(point[0], point[1] * self._loads),
            counts=replace(self._counts),
        )

    def tires(self) -> TireModel | None:
        """Return what is identified now; None where it is not to be trusted, or friction is low."""
        self._catch_up()
        friction = self._friction
        low = friction is not None and friction < LOST
        return None if self._complaint or low else self._model


def _flat(model: AxleModel, least: float) -> Any:
    """Return which curves are flat about zero slip, as no tire is, (2,).

    least : bound of their stiffness [static axle loads/rad].
    """
    slip, slope = np.linspace(0.0, REACH, SLIPS)[1:, None], 1.0 / np.array(model.ladder)
    P = model.covariance[:, : slope.size, : slope.size]
    steeper = unit_matrix(slip[:, 0], model.ladder) / slip - (1.0 + LARGEST_MODEL_ERROR) * slope
    along = np.vstack([-slope, steeper])
    over = along @ model.W.T - FLAT * np.sqrt(np.einsum("ki,aij,kj->ka", along, P, along))
    return (over[0] > -least) | ((over[1:] > 0.0) & (slip <= model.known_slip)).any(axis=0)


def _numbers(tires: TireModel, missed: Array | None) -> dict[str, Any]:
    """Return what a state gives of tires, by its fields.   missed : share of the force (2,)."""
    car, band = tires.vehicle, require_band(tires)
    known, both = tires.known_slip, np.arange(2)
    assert known is not None
    slip = np.linspace(0.0, max(REACH, _BEYOND * float(known.max())), SLIPS)
    loads, force = np.array(car.axle_loads), tires.force(slip)
    sd = band.half(slip) / normal_quantile(LEVEL)
    peak, stiffness = force.argmax(axis=0), tires.stiffness
    grip, grip_sd = force[peak, both] / loads, sd[peak, both] / loads
    weaker = int(grip.argmin())
    if isinstance(tires, AxleModel):  # sooner than by its estimates
        steep, n = 1.0 / np.array(tires.ladder), len(tires.ladder)
        variance = np.einsum("j,ijk,k->i", steep, tires.covariance[:, :n, :n], steep)
        stiffness_sd = loads * np.sqrt(variance)
    else:
        stiffness_sd = np.array([one.sd for one in tires.estimates() if one.title == STIFFNESS])
    if missed is not None:  # as `Estimate.with_model_error`
        stiffness_sd = np.hypot(stiffness_sd, missed * stiffness)
    each = car.mass / car.wheelbase * np.array([car.l_r, -car.l_f]) / stiffness
    return {
        "slip": slip,
        "force": force.T,
        "force_sd": sd.T,
        "known_slip": known,
        "stiffness": stiffness,
        "stiffness_sd": stiffness_sd,
        "grip": grip,
        "grip_sd": grip_sd,
        "understeer": float(each.sum()),
        "understeer_sd": float(np.linalg.norm(each * stiffness_sd / stiffness)),
        "a_y_limit": GRAVITY * float(grip[weaker]),
        "a_y_limit_sd": GRAVITY * float(grip_sd[weaker]),
    }


def _with_zeros(tire: PredictionTire, model: AxleModel) -> PredictionTire:
    """Return a tire that reads the sensors with their zeros of today."""
    weights = tire.weights.copy()
    weights[[0, 2]] = model.offset  # as of `mpc.tires.axles.CurveAxles`
    return tire._replace(weights=weights)


def _opened(tires: TireModel) -> TireModel:
    """Return tires of another day: zeros of the sensors are as unknown as on the first."""
    if not isinstance(tires, AxleModel):
        return tires
    usual, covariance = usual_errors(tires.vehicle), tires.covariance.copy()
    for i, name in enumerate(("steering_zero", "v_y_bias")):
        covariance[i, -1, -1] += usual[NUMBERS.index(name)] ** 2
    return replace(tires, covariance=covariance)
