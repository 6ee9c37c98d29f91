"""The tracker's C, iterated to convergence, against IPOPT on the same problem.

The two share the equations of motion and nothing else: exact derivatives of a nonlinear program
with slack variables here, our own tanh, hand-chained sensitivities, Gauss-Newton and a Riccati
interior point there.
"""

import numpy as np
import pytest

from benchmarks.converged import build_errors, iterated, solve_converged
from models.vehicle import sedan
from mpc.problem import Cost, Limits, Problem
from mpc.realtime import Status, Tracker
from mpc.tires import prediction_tire
from mpc.tires.ladder import oracle_tire

PROBLEM = Problem(
    horizon=25,
    cost=Cost(e_psi=0.2, course=0.3, v_y=0.01, yaw_rate=0.02, steering=0.01, progress=0.05),
    limits=Limits(steering=0.12, steering_rate=0.6, e_y=0.4, slip=(0.08, 0.06), soft_e_y=300.0),
)
# e_y, e_psi, v_y, r, delta; speed; amplitude of the curvature
CASES = {
    "nothing is active": ([0.05, 0.0, 0.0, 0.0, 0.0], 20.0, 0.003),
    "rate and deviation are active": ([0.7, 0.05, 0.2, 0.0, 0.0], 20.0, 0.006),
    "angle and slip are active": ([-0.3, -0.1, 0.0, 0.1, 0.02], 12.0, 0.045),
}


@pytest.fixture(scope="module", params=["linear", "lagging curve"])
def tire(request):
    return prediction_tire(sedan()) if request.param == "linear" else oracle_tire(sedan())


@pytest.fixture(scope="module")
def tracker(tire):
    return Tracker(tire, PROBLEM, tolerance=1e-12, max_iterations=60)


def road(speed, amplitude):
    t = (np.arange(PROBLEM.horizon) + 0.5) * PROBLEM.dt
    return amplitude * np.sin(2.5 * t), speed + 0.5 * t


def start_of(tire, case):
    x0 = np.array(CASES[case][0])
    if tire.structure.lagged:
        x0 = np.append(x0, [x0[4], 0.0])
    return x0


def cost_of(tire, x, u, kappa, v_x):
    """Return the cost of a plan, term by term from the words of `mpc.problem`."""
    errors, limits = build_errors(tire.structure), PROBLEM.limits
    q, q_end = PROBLEM.cost.numbers(), PROBLEM.cost.terminal_numbers()
    total = 0.5 * PROBLEM.cost.R * float(u @ u)
    for k in range(PROBLEM.horizon + 1):
        stage = min(k, PROBLEM.horizon - 1)
        told = errors(x[k], kappa[stage], v_x[stage], tire.car, tire.weights)
        y, slip = (np.asarray(value).ravel() for value in told)
        total += 0.5 * float((q if k < PROBLEM.horizon else q_end) @ y**2)
        if k > 0:
            over = np.maximum(np.abs([x[k, 0], *slip]) - [limits.e_y, *limits.slip], 0.0)
            Z = np.array([limits.soft_e_y, limits.soft_slip, limits.soft_slip])
            total += 0.5 * float(Z @ over**2)
    return total


@pytest.mark.sweep("linear-*", "lagging curve-angle*")
@pytest.mark.parametrize("case", CASES)
def test_iterated_to_the_end_the_tracker_finds_what_ipopt_finds(tire, tracker, case):
    kappa, v_x = road(*CASES[case][1:])
    x0 = start_of(tire, case)
    best = solve_converged(tire, PROBLEM, x0, kappa, v_x)
    found = iterated(tracker, x0, kappa, v_x)
    assert found.status == Status.OK
    ours = cost_of(tire, found.plan_x, found.plan_u, kappa, v_x)
    assert ours == pytest.approx(best.cost, rel=1e-6)
    assert cost_of(tire, best.x, best.u, kappa, v_x) == pytest.approx(best.cost, rel=1e-6)
    np.testing.assert_allclose(found.plan_u, best.u, atol=2e-4)
    np.testing.assert_allclose(found.plan_x, best.x, atol=1e-4)


def test_the_cases_press_against_what_they_say(tire, tracker):
    plans = {}
    for case, (_, *given) in CASES.items():
        plans[case] = iterated(tracker, start_of(tire, case), *road(*given))
    limits = PROBLEM.limits
    free, rate, angle = plans.values()
    assert np.abs(free.plan_u).max() < 0.9 * limits.steering_rate
    assert np.abs(rate.plan_u).max() > 0.999 * limits.steering_rate
    assert np.abs(rate.plan_x[1:, 0]).max() > limits.e_y
    assert np.abs(angle.plan_x[:, 4]).max() > 0.999 * limits.steering
