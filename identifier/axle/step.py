"""The step of the axle identifier: one casadi.Function that is simulation, test and C source.

Carried, rows front and rear: W (2, n) and own (2, 3), what is learnt; UD (2, q (q + 1)/2) the
factors of its covariance P = U D U', D on the diagonal, q = n + 3; gate, sway, slip as in
`_forward`; sensitivity (2, 3); filters (2, q + 2); errors (2, 4); excitation (2, 9); change (4,),
of another friction; bank (4,), of the accelerometer.
Of a car with downforce every force, slope and regressor is that of the load at v_x (`Curve.under`).
Sampled: x, u, v_x, and a_y [m/s²] of an accelerometer, NaN where there is none. Everything else is
a number that stays an input. Forces are given with the weights before the sample.
"""

from types import SimpleNamespace
from typing import Any, NamedTuple

import casadi as ca

from identifier.axle.band import AT_SPEEDS, CENTERS
from identifier.axle.band_step import AtSample, BandNumbers, half_band
from identifier.axle.bank import UNPROVEN, SlopeNumbers, SlopeState, road_push, slope_step
from identifier.axle.car import (
    Car,
    axle_impulse,
    larger,
    reciprocal,
    smaller,
    step_function,
    symbols,
    within,
)
from identifier.axle.certificate import MOST_SLOW, SLOW_Q
from identifier.axle.covariance import factors_of, inflated, row_of, spread, triangle
from identifier.axle.curve import EDGES, EXCITATION, Curve, curve, excited
from identifier.axle.gate import GATE_PORT, Gate, GateState, Plausibility, gate
from identifier.axle.learning import (
    BoundNumbers,
    ErrorState,
    Learnt,
    RegressionNumbers,
    RoadNumbers,
    RoadState,
    believed,
    bounded,
    evidence,
    filtered,
    limited,
    update,
)
from identifier.axle.slip import (
    Hold,
    SensitivityState,
    Sensors,
    SlipState,
    SwayNumbers,
    SwayState,
    force_gradient,
    hold,
    kinematic_slip,
    lagged_slip,
    sensitivity,
    sway,
)
from identifier.setup import AXLE_FORCE, FACTORS, HALF_BAND, NOT_NEGATIVE, Port
from models.vehicle import GRAVITY, load_ratio

_LARGEST_Q = 25.0  # of one outlier

# From a sample to the axle forces of given weights: what learning and the frozen model share.
#
# Carried: gate (9,), sway (3,), slip (2, 4).   W (2, n) [static axle loads].
# own (2, 3) = [compliance s [m], sway share k [-], offset: δ₀ [rad] in front, b [m/s] at the rear].

FROZEN_CARRY = ("gate", "sway", "slip")
OVER = ("x", "u", "v_x")


def _forward_ports(n: int, *, pressed: bool) -> dict[str, Any]:
    """Return the ports of the forward part for `symbols`.   pressed : as of `build_step`."""
    return {
        "gate": GateState,
        "sway": SwayState,
        "slip": (2, SlipState),
        "W": (2, n),
        "own": (2, 3),
        "x": 2,
        "u": 2,
        "v_x": 1,
        "dt": 1,
        "car": (2, Car),
        "scales": (1, n),
        "plausibility": Plausibility,
        "roll": SwayNumbers,
        "sensors": Sensors,
        **({"downforce": 2} if pressed else {}),
    }


class _Forward(NamedTuple):
    """What the forward part computes of a sample.
    gated : the gate.   sway, hold, curve and the slip angles alpha and x [rad] : at this sample.
    size : of slip, the larger of with and without lag and sway [rad], (2,).
    axle_force : (2,) [N].   next_state : by name.
    """

    gated: Gate
    sway: SwayState
    hold: Hold
    alpha: Any
    x: Any
    size: Any
    curve: Curve
    cos_delta: Any
    axle_force: Any
    next_state: dict[str, Any]


def _forward(s: SimpleNamespace, steps: tuple[int, ...]) -> _Forward:
    """Return the forward part as CasADi expressions.   s : symbols of `_forward_ports`."""
    car, dt, last_slip = s.car, s.dt, s.slip
    compliance, share, offset = ca.horzsplit(s.own)
    gated = gate(s.plausibility, dt, s.gate, s.x, s.u, s.v_x)
    gated = gated._replace(
        v_y=s.sensors.v_y(gated.v_y, gated.r, gated.v_x),
        delta=ca.vertcat(s.sensors.steering(gated.delta[0]), gated.delta[1]),
    )
    body = sway(
        s.roll,
        car,
        dt,
        s.sway,
        first=gated.first,
        v_x=gated.v_x,
        r=gated.r,
        force=last_slip.force,
        slope=last_slip.slope,
        share=share,
    )
    kinematic = kinematic_slip(car, gated, offset)
    alpha = kinematic + share * body.slip
    step = hold(car, gated.v_x, dt, compliance, last_slip.slope)
    lagged = lagged_slip(step, last_slip, alpha, gated.first)
    at_x = curve(lagged, s.W, s.scales, steps)
    cos_delta = 1 - gated.delta**2 / 2 + gated.delta**4 / 24  # 2e-5 off at 0.5 rad, no call
    if hasattr(s, "downforce"):
        at_x = at_x.under(load_ratio(s.downforce, gated.v_x))
    return _Forward(
        gated=gated,
        sway=body,
        hold=step,
        alpha=alpha,
        x=lagged,
        size=larger(ca.fabs(kinematic), ca.fabs(lagged)),
        curve=at_x,
        cos_delta=cos_delta,
        axle_force=ca.if_else(gated.on, at_x.force * cos_delta * car.load, 0),
        next_state={
            "gate": gated.state,
            "sway": ca.vertcat(*body),
            "slip": ca.horzcat(lagged, alpha, at_x.carcass_slope, at_x.force),
        },
    )


def build_frozen(steps: tuple[int, ...], *, pressed: bool) -> ca.Function:
    """Return the frozen model as a step: weights in, axle_force [N], slips [rad] out, (2,)."""
    ports, s = symbols(**_forward_ports(len(steps) + 1, pressed=pressed))
    f = _forward(s, steps)
    outputs = {"axle_force": f.axle_force, "lagged_slip": f.x, "slip_size": f.size}
    return step_function(_name("axle_frozen", steps, pressed=pressed), ports, f.next_state, outputs)


def _name(kind: str, steps: tuple[int, ...], **parts: bool) -> str:
    """Return the name of a function of a structure, with the parts that it has beside."""
    return "_".join([kind, *map(str, steps), *(part for part, there in parts.items() if there)])


LEARNING_OVER = (*OVER, "a_y")
LOAD = "static axle loads"
PORTS = (
    AXLE_FORCE,
    Port("W", LOAD, "weights of the units, rows front and rear", learnt=True),
    Port(
        "own",
        "m per load; -; rad and m/s",
        "compliance, sway share, offset of steering (front) and of v_y (rear)",
        learnt=True,
    ),
    Port(
        "UD",
        "of W and own",
        "covariance U D U' of W and own: D, and U above it, by rows; front and rear",
        learnt=True,
        rule=FACTORS,
    ),
    GATE_PORT,
    Port("sway", "m/s^2; m/s^3; rad", "roll: state, its rate, slip of the contact patch"),
    Port(
        "slip",
        "rad; rad; 1/rad; -",
        "lagged slip, slip, slope and force of the curve, per axle",
    ),
    Port(
        "sensitivity",
        "rad; rad; 1/rad^2",
        "of slip to compliance and sway share, bend, per axle",
    ),
    Port("filters", LOAD, "filters of the regressors and of the target; mean force; per axle"),
    Port(
        "errors",
        f"-; -; -; {LOAD}",
        "fast mean, trend and slow mean of squared errors, peak of the measured force, per axle",
        learnt=True,
        rule=NOT_NEGATIVE,
    ),
    EXCITATION,
    Port(
        "change",
        "-",
        "evidence of another friction: precision, mean times it, squared errors; ln of the "
        "friction over that at the start",
        learnt=True,
    ),
    Port(
        "bank",
        "-",
        "filter of a_y/g; slow means of what motion has more, and of motion; mean of what a_y "
        "explains of it",
    ),
    Port(
        "sensors",
        "rad; m; -",
        "errors that a fit found, which stay: angle and place of v_y, share of the steering",
    ),
)
CARRY = tuple(port.name for port in PORTS[1:])


def _learning_ports(n: int, *, pressed: bool) -> dict[str, Any]:
    """Return the ports of what a sample teaches, those of the forward part first."""
    q = n + 3
    return {
        **_forward_ports(n, pressed=pressed),
        "UD": (2, len(triangle(q))),
        "friction_direction": (n, n),
        "per_variance": (2, 4),
        "sensitivity": (2, SensitivityState),
        "filters": (2, q + 2),
        "regression": RegressionNumbers,
        "bank": SlopeState,
        "a_y": 1,
        "road": SlopeNumbers,
        "errors": (2, ErrorState),
        "change": RoadState,
        "changing": RoadNumbers,
    }


class _Sample(NamedTuple):
    """A sample of the regression, rows front and rear.
    h : regressor (2, q), zero but for the offset where there is no force to learn from.
    e : y - h'w (2,), w after what is believed of the road.   innovation : that, clipped (2,).
    R : its variance (2,).   sigma : standard deviation that y is declared to have (2,).
    learns : 1 or 0.   force : mean of y over a moment (2,).   holds : whether there is a force to
    learn from (2,).   W : weights to begin with (2, n).   direction : change of weights by ln μ.
    change, inflation : of ln μ that is believed, and its variance.
    """

    h: Any
    e: Any
    innovation: Any
    R: Any
    sigma: Any
    learns: Any
    force: Any
    holds: Any
    W: Any
    direction: Any
    change: Any
    inflation: Any


def build_step(
    steps: tuple[int, ...], *, bands: bool = False, pressed: bool = False
) -> ca.Function:
    """Return the step; every number stays an input of it.
    bands : whether half the width of the band is given, too; adds the output `half_band` (2,) [N]
        and the inputs that it needs.
    pressed : whether the load of the axles changes with speed; adds the input `downforce` (2,).
    """
    n = len(steps) + 1
    band: dict[str, Any] = {
        "banding": (2, BandNumbers),
        "slip_factors": (2, len(CENTERS)),
        "speed_factors": (2, len(AT_SPEEDS)),
        "prior": (2, len(triangle(n + 3))),
    }
    ports, s = symbols(
        **_learning_ports(n, pressed=pressed),
        bounds=BoundNumbers,
        rising=n,
        excitation=(2, 1 + len(EDGES)),
        **(band if bands else {}),
    )
    f = _forward(s, steps)
    h, y, next_state = _regression(f, s)
    next_state["bank"] = slope_step(
        s.road,
        s.regression,
        s.bank,
        a_y=s.a_y,
        motion=ca.dot(s.car.share, y),
        first=f.gated.first,
        on=f.gated.on,
        learns=f.gated.learns,
    )
    y -= road_push(s.road, s.bank, UNPROVEN * s.regression.least_force)
    sample, peak = _sample_of(f, s, h, y)
    axles = [_learn(s, sample, i) for i in (0, 1)]
    theta = ca.vertcat(*(_bounded(s, axles[i], i) for i in (0, 1)))
    unsure = ca.vertcat(*(axle.uncertainty for axle in axles))
    next_state |= f.next_state | _errors(f, s, sample, h[:, :n], unsure, peak)
    next_state |= {
        "sensors": ports["sensors"],
        "W": theta[:, :n],
        "own": theta[:, n:],
        "UD": ca.vertcat(*(ca.horzcat(*row_of(axle.P)) for axle in axles)),
        "filters": ca.horzcat(next_state["filters"], sample.force),
    }
    outputs = {AXLE_FORCE.name: f.axle_force}
    if bands:
        outputs[HALF_BAND.name] = _half_band(f, s)
    name = _name("axle_step", steps, rising=True, bands=bands, pressed=pressed)
    return step_function(name, ports, {port: next_state[port] for port in CARRY}, outputs)


def _half_band(f: _Forward, s: SimpleNamespace) -> Any:
    """Return half the width of the band around the force (2,) [N]."""
    per_v_x, slip = reciprocal(f.gated.v_x), ca.fabs(f.x)

    def of_axle(i: int) -> Any:
        at = AtSample(
            units=ca.horzsplit(f.curve.units[i, :]),
            slope=f.curve.slope[i],
            force=f.curve.force[i],
            slip=slip[i],
            per_v_x=per_v_x,
            e=f.hold.e[i],
            by_offset=(1, per_v_x)[i],
        )
        q = len(at.units) + 3
        P, prior = (factors_of(ca.horzsplit(one[i, :]), q) for one in (s.UD, s.prior))
        mine = BandNumbers(*(column[i] for column in s.banding))
        slips, speeds = (ca.horzsplit(one[i, :]) for one in (s.slip_factors, s.speed_factors))
        return half_band(at, P, prior, mine, slips, speeds)

    return ca.if_else(f.gated.on, ca.vertcat(of_axle(0), of_axle(1)) * s.car.load, 0)


def _regression(f: _Forward, s: SimpleNamespace) -> tuple[Any, Any, dict[str, Any]]:
    """Return h (2, q) and y (2,), and the states behind them."""
    gated, numbers = f.gated, s.regression
    p_s, p_k = sensitivity(
        f.hold,
        s.slip,
        s.sensitivity,
        compliance=s.own[:, 0],
        alpha=f.alpha,
        first=gated.first,
        sway_before=s.sway.slip,
        sway_now=f.sway.slip,
        wheelbase=s.car.arm[0] - s.car.arm[1],
    )
    g = force_gradient(f.curve, p_s, p_k, f.cos_delta, gated.v_x)
    q = g.shape[1]
    xi = numbers.bandwidth * axle_impulse(s.car, gated.v_y, gated.r)
    inputs = ca.horzcat(g, xi - gated.v_x * gated.r / GRAVITY)
    low, filters = filtered(numbers, s.filters[:, : q + 1], inputs, gated.first)
    next_state = {"sensitivity": ca.horzcat(p_s, p_k, f.curve.bend), "filters": filters}
    return low[:, :q], xi - low[:, q], next_state


def _sample_of(f: _Forward, s: SimpleNamespace, h: Any, y: Any) -> tuple[_Sample, Any]:
    """Return the sample of the regression, and the peak of the measured force."""
    numbers, errors, learns, W = s.regression, s.errors, f.gated.learns, s.W
    n = W.shape[1]
    M = s.friction_direction.T
    direction = W @ M
    change, inflation = believed(s.changing, s.change)
    change, inflation = learns * change, learns * inflation
    W = W + change * (direction + 0.5 * change * (direction @ M))  # exp(change M)
    y_hat = ca.sum2(W * h[:, :n])
    e = y - y_hat
    sigma = _deviation(f, numbers, y_hat)
    bound = numbers.clip * sigma * errors.slow
    last = s.filters[:, -1]
    force = last + learns * numbers.smooth * (y - last)  # mean over a moment, and its recent peak
    peak = ca.if_else(learns, larger(ca.fabs(force), s.errors.peak * numbers.decay), s.errors.peak)
    holds = peak >= numbers.least_force
    sample = _Sample(
        h=ca.horzcat(h[:, :-1] * holds, h[:, -1]),
        e=e,
        innovation=within(e, -bound, bound),
        R=sigma**2 * errors.slow * larger(errors.fast / errors.trend, 1) ** 2 * numbers.samples,
        sigma=sigma,
        learns=learns,
        force=force,
        holds=holds,
        W=W,
        direction=direction,
        change=change,
        inflation=inflation,
    )
    return sample, peak


def _deviation(f: _Forward, numbers: RegressionNumbers, y_hat: Any) -> Any:
    """Return the standard deviation that y is declared to have (2,).

    What the force is wrong by, and what slip is: by a force that is late, whose y changes by
    κ (φ cos δ - ŷ) a second, and by noise of v_y (effective variance, errors in variables).
    """
    late = ca.fabs(f.curve.force * f.cos_delta - y_hat)
    noisy = f.curve.carcass_slope * reciprocal(f.gated.v_x)
    of_force = numbers.error + numbers.relative_error * ca.fabs(y_hat)
    return of_force + numbers.lateness * late + numbers.noise * noisy


def _errors(
    f: _Forward, s: SimpleNamespace, sample: _Sample, h: Any, unsure: Any, peak: Any
) -> dict[str, Any]:
    """Return means of errors, excitation and the evidence of another road.
    h : regressors of the weights (2, n).   unsure : variance of h'w by the weights (2,).
    """
    numbers, (fast, trend, slow, _) = s.changing, s.errors
    learns, declared = sample.learns, sample.sigma**2
    V = declared * slow + unsure
    q = smaller(sample.e**2 / V, _LARGEST_Q)
    of_noise = smaller(sample.e**2 / declared, SLOW_Q * slow)
    means = fast + learns * numbers.fast * (q - fast)
    lasting = trend + learns * numbers.trend * (larger(q, 1) - trend)
    noise = within(slow + learns * numbers.slow * (of_noise - slow), 1, MOST_SLOW)
    road = evidence(
        numbers,
        s.change,
        sample.change,
        g=ca.sum2(h * sample.direction),
        e=sample.innovation,
        V=V,
        holds=sample.holds,
        learns=learns,
    )
    times = excited(
        s.excitation,
        f.size,
        dt=s.dt,
        samples=s.regression.samples,
        learns=learns * sample.holds,
    )
    return {"errors": ca.horzcat(means, lasting, noise, peak), "excitation": times, "change": road}


def _learn(s: SimpleNamespace, sample: _Sample, i: int) -> Learnt:
    """Return parameters, before they are bounded, and covariance of axle i after the sample."""
    w = ca.horzsplit(sample.W[i, :])
    theta = [*w, *ca.horzsplit(s.own[i, :])]
    widest = ca.horzsplit(s.per_variance[i, :])
    P = factors_of(ca.horzsplit(s.UD[i, :]), len(theta))
    before = spread(P, len(w))
    direction = ca.horzsplit(sample.direction[i, :])
    trace = before.trace + sum(sample.inflation * d * d for d in direction)
    fits = trace * widest[0] <= 1
    P = inflated(P, direction, ca.if_else(fits, sample.inflation, 0))
    return update(
        theta,
        P,
        ca.horzsplit(sample.h[i, :]),
        innovation=sample.innovation[i],
        R=sample.R[i],
        forgetting=s.regression.forgetting,
        spread=before._replace(trace=ca.if_else(fits, trace, before.trace)),
        limits=widest,
        learns=sample.learns,
    )


def _bounded(s: SimpleNamespace, learnt: Learnt, i: int) -> Any:
    """Return the parameters of axle i after the sample, within their bounds (1, q)."""
    n, limits = s.W.shape[1], s.bounds
    offset, slope = (limits.steering, limits.v_y)[i], ca.vertsplit(s.rising)
    theta = bounded(limits, learnt.theta, learnt.weights, offset=offset, slope=slope)
    last = ca.horzsplit(s.W[i, :])
    return ca.horzcat(*limited(limits, s.regression.per_step, last, theta[:n]), *theta[n:])
