"""What is not known of the tires, and what a cautious tracker does about it."""

import numpy as np
import pytest

from mpc.handover.road import at_friction
from mpc.prediction import build_axles, build_dynamics, build_rk4, state_size
from mpc.realtime import Measurement, Status, Tracker
from mpc.realtime.caution import GRIPS, N_GRIPS, SURPRISE
from mpc.tires.tire import ALL, DOUBT_STEP, N_DOUBTS, curves_at
from tests.mpc.realtime.conftest import PERIOD, PROBLEM
from tests.mpc.test_prediction import TIRES

V_X = 20.0
STEPS = 250


def slalom(tracker, road, *, zero=0.0, peak=0.012, bias=(0.0, 0.0), speed=1.0, off=None):
    """Drive a prediction along a sine of curvature; return grips that were planned with.

    bias: of the sensors of v_y [m/s] and yaw rate [rad/s].   speed: shown over the true one.
    off: takes the deviations [m].
    """
    step, n_x = build_rk4(road.structure), state_size(road.structure)
    x, waiting, grips = np.zeros(n_x), [0.0, 0.0], []
    shown = np.array([0.0, 0.0, *bias])
    for k in range(STEPS):
        t = PERIOD * k + tracker.times
        kappa = peak * np.sin(2.0 * np.pi * 0.4 * t)
        told = Measurement(*map(float, x[:4] + shown), kappa, np.full(t.size, speed * V_X))
        command = tracker.step(told)
        assert command.status <= Status.ITERATION_LIMIT
        grips.append(tracker.grip)
        if off is not None:
            off.append(x[0])
        waiting.append(command.steering)
        x[4] = waiting.pop(0) + zero
        for _ in range(4):
            x = np.asarray(
                step(x, 0.0, kappa[0], V_X, PERIOD / 4, road.car, road.weights, *ALL)
            ).ravel()
        x[4] -= zero
    return np.array(grips)


def make(tire, caution):
    return Tracker(tire, PROBLEM, period=PERIOD, delay=2 * PERIOD, caution=caution)


def test_without_caution_nothing_that_is_feared_is_read(lagging):
    plain, other = make(lagging, 0.0), make(lagging, 0.0)
    for name in ("doubt", "grips", "prior", "force_error"):
        other.instance.params[name] *= 0.3
    slalom(plain, lagging), slalom(other, lagging)
    assert plain.instance.state.tobytes() == other.instance.state.tobytes()
    assert plain.grip == 1.0


def test_a_road_of_half_the_friction_is_planned_for_and_the_dry_one_is_not_feared(lagging):
    dry = slalom(make(lagging, 1.0), lagging, peak=0.006)
    wet = slalom(make(lagging, 1.0), at_friction(lagging, 0.5), peak=0.01)
    assert dry.min() > 0.9
    assert 0.35 < wet[-1] < 0.75


@pytest.mark.sweep("bias0*")
@pytest.mark.parametrize(
    ("bias", "found"), [((0.3, 0.0), ("drift", -0.3)), ((0.0, 0.02), ("turning", -0.02))]
)
def test_what_v_y_and_yaw_rate_are_off_is_found_and_the_car_comes_back(lagging, bias, found):
    weights = lagging.weights.copy()
    weights[2] += bias[0]  # learnt by the same sensors
    deviations = []
    for caution in (0.0, 1.0):
        tracker, off = make(lagging._replace(weights=weights), caution), []
        slalom(tracker, lagging, peak=0.004, bias=bias, off=off)
        deviations.append(abs(np.mean(off[-125:])))
    name, value = found
    assert float(tracker.instance.state[name]) == pytest.approx(value, rel=0.1)
    assert deviations[1] < 0.3 * deviations[0] or deviations[0] < 0.01


@pytest.mark.parametrize(
    "fault",
    [{"bias": (0.4, 0.0)}, {"bias": (-0.4, 0.0)}, {"bias": (0.0, 0.08)}, {"speed": 0.75}],
    ids=str,
)
def test_sensors_that_contradict_the_position_are_not_taken_for_ice(lagging, fault):
    """The tires know nothing of the fault, and where nothing tells where the car is, it is ice."""
    seen = slalom(make(lagging, 1.0), lagging, peak=0.01, **fault)
    assert seen.min() > 0.8
    assert seen[60:].min() > 0.99


# What the C of the watch computes, in matrices, with forces from CasADi itself.

FOLLOWED, ALIKE, SETTLED, CLIP, REFUTED, MOVES = 0.2, 0.2, 0.4, 9.0, 2.7, 0.05
SHOWN, GOOD, MOST = np.array([0.14, 0.07]), np.array([0.2, 0.04]), np.array([1.0, 0.6])
ZEROS = ("zero", "drift", "turning", "stays", "apart", "last", "place")
BELIEFS = ("cost", "slips", "impulse", "grip", "watched", "gentle", "placed")


def share_of(told):
    return PERIOD / np.clip(told * PERIOD, 0.3, 3.0)


def watch(s, p, m, axles):
    """Return a state {name: value} after a measurement, by the equations of the C."""
    s, v_x, kappa = dict(s), m.v_x[0], m.kappa[0]
    along = v_x * np.cos(m.e_psi) - m.v_y * np.sin(m.e_psi)
    moves = np.array(
        [
            v_x * np.sin(m.e_psi) + m.v_y * np.cos(m.e_psi),
            m.r - kappa * along / (1.0 - kappa * m.e_y),
        ]
    )
    way, seen = 0.5 * PERIOD * (moves + s["apart"]), np.array([m.e_y, m.e_psi])
    error = seen - s["place"] - way
    begins = (np.abs(error) > 0.25) | (s["watched"] == 0)
    place = s["place"] + 2.0 * way + 2.0 * PERIOD / SHOWN * error
    s["place"] = np.where(begins, seen + way, place)
    apart = np.clip(s["apart"] + PERIOD / SHOWN**2 * error, -MOST, MOST)
    s["apart"] = np.where(begins, s["apart"], apart)
    small = np.clip(s["apart"] - s["stays"], -GOOD, GOOD)
    s["stays"] = s["stays"] + share_of(s["placed"]) * small
    s["drift"], s["turning"] = s["apart"] - small
    s["placed"] += 1
    change = np.abs([m.v_y - s["last"][0], m.r - s["last"][1]])
    jumps = s["watched"] > 0 and (change > np.array([0.2, 0.02]) + 10.0 * PERIOD).any()
    faulty = jumps or (np.abs(s["apart"]) > GOOD).any()
    s["last"] = np.array([m.v_y, m.r])

    mass, inertia, l_f, l_r = p["car"]
    masses = mass * np.array([l_r, l_f]) / (l_f + l_r)
    r = m.r + s["turning"]
    shown = masses * m.v_y + np.array([inertia, -inertia]) * r / (l_f + l_r)
    squares, missed, slips = (
        np.zeros(N_GRIPS),
        np.zeros((N_GRIPS, 2)),
        s["slips"].copy(),
    )
    impulse = s["impulse"].copy()
    for j, grip in enumerate(GRIPS):
        x = np.array([0.0, 0.0, m.v_y, r, s["wheels"] + s["zero"], *s["slips"][j]])
        told = axles(x, v_x, p["car"], p["weights"], p["max_slip"], p["rise"], grip)
        force, slip, lag = (np.asarray(one).ravel() for one in told)
        if s["watched"] == 0:
            impulse[j], slips[j] = shown, slip
            continue
        rate = force - masses * v_x * r
        missed[j] = (shown - impulse[j] - PERIOD * rate) / FOLLOWED
        at = np.abs(s["slips"][j]) / grip / DOUBT_STEP
        doubt = [
            np.interp(a, np.arange(N_DOUBTS), row) for a, row in zip(at, p["doubt"], strict=True)
        ]
        expected = p["force_error"] + np.array(doubt) * grip / 1.645
        squares[j] = np.minimum((missed[j] / expected) ** 2, CLIP).sum()
        impulse[j] += PERIOD * (rate + missed[j])
        slips[j] += PERIOD * v_x / (lag + PERIOD * v_x) * (slip - slips[j])
    front = s["slips"][:, 0]
    s["impulse"], s["slips"] = impulse, slips
    if faulty or not s["doubted"]:
        s["cost"] = p["prior"].copy()
    if faulty:
        s["watched"] = 0
    if s["watched"] * PERIOD > SETTLED:
        cost = s["cost"] + PERIOD / ALIKE * 2.0 / (2.0 + squares.min()) * squares
        s["cost"] = np.minimum(cost - cost.min(), SURPRISE)
        best = int(np.argmin(s["cost"]))
        if abs(front[best]) < 0.3 * GRIPS[best] * p["max_slip"][0]:
            moved = missed[best, 0] / p["stiffness"] * share_of(s["gentle"])
            s["zero"] = np.clip(s["zero"] + moved, -0.1, 0.1)
            s["gentle"] += 1
    best = int(np.argmin(s["cost"]))
    left = np.minimum(
        (SURPRISE - s["cost"][best + 1 :]) / (SURPRISE - REFUTED),
        1.0,
    )
    least = GRIPS[best] + np.cumprod(left) @ np.diff(GRIPS[best:])
    wanted = 1.0 - p["caution"] * (1.0 - least)
    grip = s["grip"] if s["doubted"] else wanted
    s["grip"] = grip + PERIOD / (PERIOD + MOVES) * (wanted - grip)
    s["watched"] += 1
    return s


def kept(tracker):
    state = tracker.instance.state
    values = {name: np.array(state[name]) for name in (*ZEROS, *BELIEFS, "doubted")}
    return {**values, "wheels": state["commands"][1]}  # the delay is two periods


@pytest.mark.parametrize("caution", [1.0, 0.6])
def test_the_watch_follows_its_equations(lagging, caution):
    """On moves that are no car's: sensors contradict each other, agree, jump, and make ice."""
    rng, tracker = np.random.default_rng(11), make(lagging, caution)
    axles, params = build_axles(lagging.structure), tracker.instance.params
    params["doubt"][1] *= 1.3  # axles are told apart
    met, e_y, e_psi = np.zeros(5, int), 0.0, 0.0
    for k in range(260):
        kappa, v_x, wild = 0.006 * np.sin(0.05 * k), 20.0 + 2.0 * np.sin(0.02 * k), 100 < k < 140
        r, v_y = kappa * v_x - 1.5 * e_psi - 0.1 * e_y, 0.3 * np.sin(0.07 * k)
        noise = rng.normal(0.0, [0.003, 0.0003, 0.01, 0.002]) + wild * np.array([0, 0, 0.6, 0.2])
        jump = 0.4 * (k == 200)
        told = np.array([e_y + jump, e_psi, v_y, r]) + noise
        m = Measurement(*map(float, told), np.full(21, kappa), np.full(21, v_x))
        expected = watch(kept(tracker), params, m, axles)
        assert tracker.step(m).status <= Status.QP_FAILED
        found = kept(tracker)
        for name in (*ZEROS, *BELIEFS):
            told = f"{name} of step {k}"
            np.testing.assert_allclose(found[name], expected[name], 1e-6, 1e-6, err_msg=told)
        judged = found["watched"] * PERIOD > SETTLED + PERIOD
        met += [found["watched"] == 1, judged, found["grip"] < 0.9, found["gentle"] > 0, jump > 0]
        e_y += PERIOD * (v_x * e_psi + v_y)
        e_psi += PERIOD * (r - kappa * v_x)
    assert (met > [20, 60, 10, 20, 0]).all()  # what is compared has happened


def test_a_friction_is_the_tire_with_weights_of_that_friction():
    rng = np.random.default_rng(3)
    for tire in TIRES.values():
        if tire.structure.at_friction(tire.weights, 0.6) is None:
            continue
        rates, n_x = build_dynamics(tire.structure), state_size(tire.structure)
        for x in rng.normal(0.0, 0.05, (20, n_x)):
            told = (0.1, 0.01, V_X, 0.05, tire.car)
            shared = rates(x, *told, tire.weights, *ALL[:2], 0.6)
            weights = tire.structure.at_friction(tire.weights, 0.6)
            np.testing.assert_allclose(
                np.array(shared), np.array(rates(x, *told, weights, *ALL)), rtol=1e-9, atol=1e-9
            )


def test_doubt_tightens_slip_along_the_plan(lagging):
    """The same turn is planned with less slip, where more force may be missing."""
    slips = []
    for share in (0.0, 0.3, 0.6):
        tire = lagging._replace(
            doubt=share
            * curves_at(
                lagging,
                DOUBT_STEP * np.arange(N_DOUBTS, dtype=np.float64),
            )
        )
        tracker = make(tire, 1.0)
        tracker.instance.params["grips"] = 1.0  # of the grip nothing is feared
        turn = Measurement(0.0, 0.0, 0.0, 0.02 * V_X, np.full(21, 0.02), np.full(21, V_X))
        for _ in range(30):  # sensors agree for 0.4 s first
            command = tracker.step(turn)
        x = command.plan_x[1:]
        slips.append(np.abs(x[:, 4] - (x[:, 2] + tire.car[2] * x[:, 3]) / V_X).mean())
    assert slips[1] < 0.95 * slips[0]
    assert slips[2] < 0.98 * slips[1]
