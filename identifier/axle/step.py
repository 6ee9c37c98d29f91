"""The step of the axle identifier: one casadi.Function that is simulation, test and C source.

Carried, rows front and rear: W (2, n) and own (2, 3), what is learnt; UD (2, q (q + 1)/2) the
factors of its covariance P = U D U', D on the diagonal, q = n + 3; gate, sway, slip as in
`forward`; sensitivity (2, 3); filters (2, q + 2); errors (2, 4); excitation (2, 9); change (4,), of
another friction; bank (4,), of the accelerometer.
Of a car with downforce every force, slope and regressor is that of the load at v_x (`Curve.under`).
Sampled: x, u, v_x, and a_y [m/s²] of an accelerometer, NaN where there is none. Everything else is
a number that stays an input. Forces are given with the weights before the sample.
"""

from typing import Any, NamedTuple

import casadi as ca

from identifier.axle.band import AT_SPEEDS, CENTERS
from identifier.axle.band_step import AtSample, BandNumbers, half_band
from identifier.axle.bank import UNPROVEN, SlopeNumbers, SlopeState, road_push, slope_step
from identifier.axle.car import (
    Car,
    axle_impulse,
    axle_port,
    larger,
    named_port,
    reciprocal,
    smaller,
    within,
)
from identifier.axle.covariance import factors_of, inflated, row_of, spread, triangle
from identifier.axle.curve import EDGES, Curve, curve, excited
from identifier.axle.gate import Gate, GateNumbers, GateState, gate
from identifier.axle.learning import (
    LARGEST_Q,
    MOST_SLOW,
    SLOW_Q,
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

# From a sample to the axle forces of given weights: what learning and the frozen model share.
#
# Carried: gate (9,), sway (3,), slip (2, 4).   W (2, n) [static axle loads].
# own (2, 3) = [compliance s [m], sway share k [-], offset: δ₀ [rad] in front, b [m/s] at the rear].

FROZEN_CARRY = ("gate", "sway", "slip")
OVER = ("x", "u", "v_x")
CONSTANTS = ("dt", "car", "scales", "plausibility", "roll")


class Forward(NamedTuple):
    """Symbols of the forward part and what it computes.

    ports : every input by name.   car, dt, scales : constants.   last_sway, last_slip : states.
    gated : the gate.   sway, hold, curve and the slip angles alpha and x [rad] : at this sample.
    size : of slip, the larger of with and without lag and sway [rad], (2,).
    axle_force : (2,) [N].   next_state : by name.
    """

    ports: dict[str, Any]
    car: Car
    last_sway: SwayState
    last_slip: SlipState
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


def forward(steps: tuple[int, ...], *, pressed: bool = False) -> Forward:
    """Return the forward part as CasADi expressions of fresh symbols.

    Parameters
    ----------
    pressed : whether the load of the axles changes with speed; adds the input `downforce` (2,).
    """
    n = len(steps) + 1
    W, own, dt = ca.SX.sym("W", 2, n), ca.SX.sym("own", 2, 3), ca.SX.sym("dt")
    x, u, v_x = ca.SX.sym("x", 2), ca.SX.sym("u", 2), ca.SX.sym("v_x")
    scales = ca.SX.sym("scales", 1, n)
    limit_port, limits = named_port(GateNumbers, "plausibility")
    gate_port, last_gate = named_port(GateState, "gate")
    sway_port, last_sway = named_port(SwayState, "sway")
    slip_port, last_slip = axle_port(SlipState, "slip")
    car_port, car = axle_port(Car, "car")
    roll_port, roll = named_port(SwayNumbers, "roll")
    sensor_port, sensors = named_port(Sensors, "sensors")
    compliance, share, offset = ca.horzsplit(own)

    gated = gate(limits, dt, last_gate, x, u, v_x)
    gated = gated._replace(
        v_y=sensors.v_y(gated.v_y, gated.r, gated.v_x),
        delta=ca.vertcat(sensors.steering(gated.delta[0]), gated.delta[1]),
    )
    body = sway(
        roll,
        car,
        dt,
        last_sway,
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
    at_x = curve(lagged, W, scales, steps)
    cos_delta = 1 - gated.delta**2 / 2 + gated.delta**4 / 24  # 2e-5 off at 0.5 rad, no call
    ports = {
        "gate": gate_port,
        "sway": sway_port,
        "slip": slip_port,
        "W": W,
        "own": own,
        "x": x,
        "u": u,
        "v_x": v_x,
        "dt": dt,
        "car": car_port,
        "scales": scales,
        "plausibility": limit_port,
        "roll": roll_port,
        "sensors": sensor_port,
    }
    if pressed:
        ports["downforce"] = ca.SX.sym("downforce", 2)
        at_x = at_x.under(load_ratio(ports["downforce"], gated.v_x))
    return Forward(
        ports=ports,
        car=car,
        last_sway=last_sway,
        last_slip=last_slip,
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


def build_frozen(steps: tuple[int, ...], *, pressed: bool = False) -> ca.Function:
    """Return the frozen model as a step: weights in, axle_force [N], slips [rad] out, (2,)."""
    f = forward(steps, pressed=pressed)
    return ca.Function(
        _name("axle_frozen", steps, pressed=pressed),
        list(f.ports.values()),
        [*f.next_state.values(), f.axle_force, f.x, f.size],
        list(f.ports),
        [*(f"{name}_next" for name in f.next_state), "axle_force", "lagged_slip", "slip_size"],
        {"cse": True},
    )


def _name(kind: str, steps: tuple[int, ...], **parts: bool) -> str:
    """Return the name of a function of a structure, with the parts that it has beside."""
    return "_".join([kind, *map(str, steps), *(part for part, there in parts.items() if there)])


LEARNING_OVER = (*OVER, "a_y")
LEARNT = ("W", "own", "UD")
BESIDE = ("errors", "excitation", "change", "bank", "sensors")
CARRY = (*LEARNT, "gate", "sway", "slip", "sensitivity", "filters", *BESIDE)
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
    Port(
        "gate",
        "SI",
        "last good v_x, v_y, r, delta_f, delta_r; on; time of steady learning; bad and stuck "
        "samples in a row",
    ),
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
    Port(
        "excitation",
        "rad; s",
        "largest slip, then time of learning above each edge, per axle",
        learnt=True,
        rule=NOT_NEGATIVE,
    ),
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


class RegressionSample(NamedTuple):
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
    steps: tuple[int, ...], *, rises: bool = False, bands: bool = False, pressed: bool = False
) -> ca.Function:
    """Return the step; every number stays an input of it.

    Parameters
    ----------
    rises : whether curves are kept from falling at a slip; adds the input `rising` (n,).
    bands : whether half the width of the band is given, too; adds the output `half_band` (2,) [N]
        and the inputs that it needs.
    """
    n = len(steps) + 1
    f, ports = _symbols(steps, pressed=pressed)
    h, y, next_state = _regression(f, ports)
    y, next_state["bank"] = _without_bank(f, ports, y)
    sample, peak = _sample_of(f, ports, h, y)
    ports["bounds"], limits = named_port(BoundNumbers, "bounds")
    if rises:
        ports["rising"] = ca.SX.sym("rising", n)
    axles = [_learn(ports, sample, i) for i in (0, 1)]
    theta = ca.vertcat(*(_bounded(ports, limits, axles[i], i) for i in (0, 1)))
    next_state |= f.next_state
    next_state["sensors"] = ports["sensors"]
    next_state["W"], next_state["own"] = theta[:, :n], theta[:, n:]
    next_state["UD"] = ca.vertcat(*(ca.horzcat(*row_of(axle.P)) for axle in axles))
    next_state["filters"] = ca.horzcat(next_state["filters"], sample.force)
    unsure = ca.vertcat(*(axle.uncertainty for axle in axles))
    next_state |= _errors(f, ports, sample, h[:, :n], unsure, peak)
    outputs = {AXLE_FORCE.name: f.axle_force}
    if bands:
        outputs[HALF_BAND.name] = _half_band(f, ports)
    return ca.Function(
        _name("axle_step", steps, rising=rises, bands=bands, pressed=pressed),
        list(ports.values()),
        [*(next_state[name] for name in CARRY), *outputs.values()],
        list(ports),
        [*(f"{name}_next" for name in CARRY), *outputs],
        {"cse": True},
    )


def _half_band(f: Forward, ports: dict[str, Any]) -> Any:
    """Return half the width of the band around the force (2,) [N]; adds its ports."""
    n = f.curve.units.shape[1]
    ports["banding"], numbers = axle_port(BandNumbers, "banding")
    ports["slip_factors"] = ca.SX.sym("slip_factors", 2, len(CENTERS))
    ports["speed_factors"] = ca.SX.sym("speed_factors", 2, len(AT_SPEEDS))
    ports["prior"] = ca.SX.sym("prior", 2, len(triangle(n + 3)))
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
        P, prior = (factors_of(ca.horzsplit(ports[name][i, :]), n + 3) for name in ("UD", "prior"))
        mine = BandNumbers(*(column[i] for column in numbers))
        slips, speeds = (
            ca.horzsplit(ports[name][i, :]) for name in ("slip_factors", "speed_factors")
        )
        return half_band(at, P, prior, mine, slips, speeds)

    return ca.if_else(f.gated.on, ca.vertcat(of_axle(0), of_axle(1)) * f.car.load, 0)


LESSON = ("h", "e", "counts", "gains", "declared")


def build_lesson(steps: tuple[int, ...], *, pressed: bool = False) -> ca.Function:
    """Return what a sample teaches, of the ports of the step: the recursion that errors obey.

    Its outputs are the regressors h (2, q); e = y - h'w (2,), w before a change of the road;
    which share of e counts, after clipping; the gains K (2, q), 0 where nothing is learnt; and the
    declared standard deviation of y (2,), without what the means of squared errors add.
    """
    f, ports = _symbols(steps, pressed=pressed)
    h, y, _ = _regression(f, ports)
    y, _ = _without_bank(f, ports, y)
    sample, _ = _sample_of(f, ports, h, y)
    gains = [ca.horzcat(*_learn(ports, sample, i).gains) for i in (0, 1)]
    n = ports["W"].shape[1]
    e = sample.e + ca.sum2(sample.h[:, :n] * (sample.W - ports["W"]))
    counts = ca.if_else(e == 0, 1, sample.innovation / e)
    outputs = (sample.h, e, counts, ca.vertcat(*gains), sample.sigma)
    name = _name("axle_lesson", steps, pressed=pressed)
    return ca.Function(name, list(ports.values()), list(outputs), list(ports), list(LESSON))


def _symbols(steps: tuple[int, ...], *, pressed: bool) -> tuple[Forward, dict[str, Any]]:
    """Return the forward part, and its ports with those of the covariance."""
    n = len(steps) + 1
    f = forward(steps, pressed=pressed)
    ports = dict(f.ports)
    ports["UD"] = ca.SX.sym("UD", 2, len(triangle(n + 3)))
    ports["friction_direction"] = ca.SX.sym("friction_direction", n, n)
    ports["per_variance"] = ca.SX.sym("per_variance", 2, 4)
    return f, ports


def _regression(f: Forward, ports: dict[str, Any]) -> tuple[Any, Any, dict[str, Any]]:
    """Return h (2, q) and y (2,), and the states behind them; adds its ports."""
    q = f.curve.units.shape[1] + 3
    ports["sensitivity"], lasting = axle_port(SensitivityState, "sensitivity")
    ports["filters"] = ca.SX.sym("filters", 2, q + 2)
    ports["regression"], numbers = named_port(RegressionNumbers, "regression")
    gated = f.gated
    p_s, p_k = sensitivity(
        f.hold,
        f.last_slip,
        lasting,
        compliance=ports["own"][:, 0],
        alpha=f.alpha,
        first=gated.first,
        sway_before=f.last_sway.slip,
        sway_now=f.sway.slip,
        wheelbase=f.car.arm[0] - f.car.arm[1],
    )
    g = force_gradient(f.curve, p_s, p_k, f.cos_delta, gated.v_x)
    xi = numbers.bandwidth * axle_impulse(f.car, gated.v_y, gated.r)
    inputs = ca.horzcat(g, xi - gated.v_x * gated.r / GRAVITY)
    low, filters = filtered(numbers, ports["filters"][:, : q + 1], inputs, gated.first)
    next_state = {"sensitivity": ca.horzcat(p_s, p_k, f.curve.bend), "filters": filters}
    return low[:, :q], xi - low[:, q], next_state


def _without_bank(f: Forward, ports: dict[str, Any], y: Any) -> tuple[Any, Any]:
    """Return y without what the road pushes (2,), and the state behind it; adds its ports."""
    ports["bank"], state = named_port(SlopeState, "bank")
    ports["a_y"], (ports["road"], numbers) = ca.SX.sym("a_y"), named_port(SlopeNumbers, "road")
    regression = RegressionNumbers(*ca.vertsplit(ports["regression"]))
    after = slope_step(
        numbers,
        regression,
        state,
        a_y=ports["a_y"],
        motion=ca.dot(f.car.share, y),
        first=f.gated.first,
        on=f.gated.on,
        learns=f.gated.learns,
    )
    return y - road_push(numbers, state, UNPROVEN * regression.least_force), after


def _sample_of(f: Forward, ports: dict[str, Any], h: Any, y: Any) -> tuple[RegressionSample, Any]:
    """Return the sample of the regression, and the peak of the measured force; adds its ports."""
    ports["errors"], errors = axle_port(ErrorState, "errors")
    ports["change"], road = named_port(RoadState, "change")
    ports["changing"], changes = named_port(RoadNumbers, "changing")
    numbers = RegressionNumbers(*ca.vertsplit(ports["regression"]))
    learns, W = f.gated.learns, ports["W"]
    n = W.shape[1]
    M = ports["friction_direction"].T
    direction = W @ M
    change, inflation = believed(changes, road)
    change, inflation = learns * change, learns * inflation
    W = W + change * (direction + 0.5 * change * (direction @ M))  # exp(change M)
    y_hat = ca.sum2(W * h[:, :n])
    e = y - y_hat
    sigma = _deviation(f, numbers, y_hat)
    bound = numbers.clip * sigma * errors.slow
    force, peak = _recent_force(ports, numbers, y, errors.peak, learns)
    holds = peak >= numbers.least_force
    sample = RegressionSample(
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


def _recent_force(
    ports: dict[str, Any], numbers: RegressionNumbers, y: Any, last_peak: Any, learns: Any
) -> tuple[Any, Any]:
    """Return the mean of y over a moment and its recent peak, (2,) each."""
    last = ports["filters"][:, -1]
    force = last + learns * numbers.smooth * (y - last)
    peak = larger(ca.fabs(force), last_peak * numbers.decay)
    return force, ca.if_else(learns, peak, last_peak)


def _deviation(f: Forward, numbers: RegressionNumbers, y_hat: Any) -> Any:
    """Return the standard deviation that y is declared to have (2,).

    What the force is wrong by, and what slip is: by a force that is late, whose y changes by
    κ (φ cos δ - ŷ) a second, and by noise of v_y (effective variance, errors in variables).
    """
    late = ca.fabs(f.curve.force * f.cos_delta - y_hat)
    noisy = f.curve.carcass_slope * reciprocal(f.gated.v_x)
    of_force = numbers.error + numbers.relative_error * ca.fabs(y_hat)
    return of_force + numbers.lateness * late + numbers.noise * noisy


def _errors(
    f: Forward, ports: dict[str, Any], sample: RegressionSample, h: Any, unsure: Any, peak: Any
) -> dict[str, Any]:
    """Return means of errors, excitation and the evidence of another road.

    h : regressors of the weights (2, n).   unsure : variance of h'w by the weights (2,).
    """
    ports["excitation"] = ca.SX.sym("excitation", 2, 1 + len(EDGES))
    numbers = RoadNumbers(*ca.vertsplit(ports["changing"]))
    fast, trend, slow, _ = ca.horzsplit(ports["errors"])
    learns, declared = sample.learns, sample.sigma**2
    V = declared * slow + unsure
    q = smaller(sample.e**2 / V, LARGEST_Q)
    of_noise = smaller(sample.e**2 / declared, SLOW_Q * slow)
    means = fast + learns * numbers.fast * (q - fast)
    lasting = trend + learns * numbers.trend * (larger(q, 1) - trend)
    noise = within(slow + learns * numbers.slow * (of_noise - slow), 1, MOST_SLOW)
    road = evidence(
        numbers,
        RoadState(*ca.vertsplit(ports["change"])),
        sample.change,
        g=ca.sum2(h * sample.direction),
        e=sample.innovation,
        V=V,
        holds=sample.holds,
        learns=learns,
    )
    times = excited(
        ports["excitation"],
        f.size,
        dt=ports["dt"],
        samples=RegressionNumbers(*ca.vertsplit(ports["regression"])).samples,
        learns=learns * sample.holds,
    )
    return {"errors": ca.horzcat(means, lasting, noise, peak), "excitation": times, "change": road}


def _learn(ports: dict[str, Any], sample: RegressionSample, i: int) -> Learnt:
    """Return parameters, before they are bounded, and covariance of axle i after the sample."""
    w = ca.horzsplit(sample.W[i, :])
    theta = [*w, *ca.horzsplit(ports["own"][i, :])]
    n, q = len(w), len(theta)
    forgetting = RegressionNumbers(*ca.vertsplit(ports["regression"])).forgetting
    widest = ca.horzsplit(ports["per_variance"][i, :])
    P = factors_of(ca.horzsplit(ports["UD"][i, :]), q)
    before = spread(P, n)
    direction = ca.horzsplit(sample.direction[i, :])
    trace = before.trace + sum(sample.inflation * d * d for d in direction)
    fits = trace * widest[0] <= 1
    P = inflated(P, direction, ca.if_else(fits, sample.inflation, 0))
    now = before._replace(trace=ca.if_else(fits, trace, before.trace))
    return update(
        theta,
        P,
        ca.horzsplit(sample.h[i, :]),
        innovation=sample.innovation[i],
        R=sample.R[i],
        forgetting=forgetting,
        spread=now,
        limits=widest,
        learns=sample.learns,
    )


def _bounded(ports: dict[str, Any], limits: BoundNumbers, learnt: Learnt, i: int) -> Any:
    """Return the parameters of axle i after the sample, within their bounds (1, q)."""
    n = ports["W"].shape[1]
    offset = (limits.steering, limits.v_y)[i]
    slope = ca.vertsplit(ports["rising"]) if "rising" in ports else None
    theta = bounded(limits, learnt.theta, learnt.weights, offset=offset, slope=slope)
    per_step = RegressionNumbers(*ca.vertsplit(ports["regression"])).per_step
    w = limited(limits, per_step, ca.horzsplit(ports["W"][i, :]), theta[:n])
    return ca.horzcat(*w, *theta[n:])
