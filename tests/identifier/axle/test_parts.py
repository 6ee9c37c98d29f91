"""Each part of the axle identifier by another road."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from identifier.axle import covariance
from identifier.axle import curve as units
from identifier.axle import learning as rls
from identifier.axle import slip as sway
from identifier.axle.car import Car, car_numbers
from identifier.axle.curve import LADDER
from identifier.axle.prior import SLIPS, Prior, fiala_force, fiala_weights, friction_direction
from identifier.axle.slip import Sway, SwayState


def the_car(car):
    return Car(*ca.horzsplit(ca.SX(car_numbers(car))))


@pytest.mark.parametrize("ladder", [(), (0.1, 0.05), (0.01, 0.03), (0.0, 0.1), (0.1, 0.1)])
def test_a_ladder_that_cannot_be_climbed_is_refused(ladder):
    with pytest.raises(ValueError, match="ladder"):
        units.doublings(ladder)


def test_a_toy_rolls_as_fast_as_springs_allow_and_a_body_that_is_none_is_refused(car):
    toy = replace(
        car, l_f=0.01, l_r=0.01, mass=0.02, yaw_inertia=2e-6,
        cornering_stiffness_front=1.0, cornering_stiffness_rear=1.0,
    )  # fmt: skip
    assert Sway.for_vehicle(toy).frequency < 100.0 < 5.0 * np.sqrt(9.81 / toy.wheelbase)
    assert Sway.for_vehicle(car).frequency == 5.0 * np.sqrt(9.81 / car.wheelbase)
    for frequency, damping in ((546.0, 0.3), (0.0, 0.3), (10.0, -1.0), (float("nan"), 0.3)):
        with pytest.raises(ValueError, match="must lie between"):
            Sway(frequency=frequency, damping=damping)


def test_sway_settles_where_the_body_leans_and_a_step_swings(car):
    """Under a constant force it ends at the acceleration, after the overshoot of the books."""
    system = Sway(frequency=10.0, damping=0.3)
    numbers = system.numbers()
    force, loads = np.array([0.4, 0.3]), np.array(car.axle_loads)
    a = (force * loads).sum() / car.mass
    before = SwayState(*(ca.SX.sym(name) for name in SwayState._fields))
    after = sway.sway(
        numbers,
        the_car(car),
        0.002,
        before,
        first=0,
        v_x=20.0,
        r=0.1,
        force=ca.SX(force),
        slope=ca.SX.ones(2),
        share=ca.SX.zeros(2),
    )
    step = ca.Function("step", [ca.vertcat(*before)], [ca.vertcat(*after)])
    states = SwayState(*np.array(step.mapaccum(3000)(np.zeros(3))))
    path = states.rho
    assert path[-1] == pytest.approx(a, rel=1e-6)
    overshoot = np.exp(-0.3 * np.pi / np.sqrt(1 - 0.09))
    assert max(path) == pytest.approx(a * (1 + overshoot), rel=0.02)


def learnt(h, y, R, forgetting, P0):
    q = P0.shape[0]
    theta, P = ca.SX.sym("theta", q), ca.SX.sym("P", len(covariance.triangle(q)))
    regressor, e = ca.SX.sym("h", q), ca.SX.sym("e")
    factors = covariance.factors_of(ca.vertsplit(P), q)
    result = rls.update(
        ca.vertsplit(theta),
        factors,
        ca.vertsplit(regressor),
        innovation=e,
        R=R,
        forgetting=forgetting,
        spread=covariance.spread(factors, 1),
        limits=[1e-9] * q,
        learns=1.0,
    )
    step = ca.Function(
        "f",
        [theta, P, regressor, e],
        [ca.vertcat(*result.theta), ca.vertcat(*covariance.row_of(result.P))],
    )
    t, p = np.zeros(q), covariance.packed(np.stack([P0, P0]))[0]
    for row, value in zip(h, y, strict=True):
        t, p = (np.array(v).ravel() for v in step(t, p, row, value - row @ t))
    return t, covariance.unpacked(np.stack([p, p]), q)[0]


def test_without_forgetting_the_recursion_is_the_batch_solution(rng):
    h, true, R = rng.standard_normal((60, 3)), np.array([1.0, -2.0, 0.5]), 0.1
    y = h @ true + np.sqrt(R) * rng.standard_normal(60)
    P0 = np.diag([1.0, 4.0, 0.3])
    t, P = learnt(h, y, R, 0.0, P0)
    information = np.linalg.inv(P0) + h.T @ h / R
    np.testing.assert_allclose(P, np.linalg.inv(information), rtol=1e-8)
    np.testing.assert_allclose(t, np.linalg.solve(information, h.T @ y / R), rtol=1e-8)


def test_only_the_excited_direction_is_forgotten(rng):
    """A direction that is never excited keeps its variance; the excited one stays awake."""
    h = np.outer(rng.standard_normal(4000), [1.0, 1.0, 0.0])
    _, P = learnt(h, h @ np.array([1.0, 2.0, 3.0]), 0.1, 0.02, np.eye(3))
    across = np.array([1.0, -1.0, 0.0]) / np.sqrt(2)
    assert across @ P @ across == pytest.approx(1.0, rel=1e-9)
    assert P[2, 2] == 1.0
    assert np.linalg.eigvalsh(P).min() > 1e-4
    _, asleep = learnt(h, h @ np.array([1.0, 2.0, 3.0]), 0.1, 0.0, np.eye(3))
    assert P[0, 0] + P[0, 1] > 5 * (asleep[0, 0] + asleep[0, 1])


def test_prior_is_the_told_tire_and_unsure_of_what_cars_differ_in(car):
    prior = Prior(compliance=0.027, sd_compliance=0.027, sd_v_y=0.03)
    W0, own = prior.means(car, LADDER)
    T = np.tanh(SLIPS[:, None] / np.array(LADDER))
    for i, (c, load) in enumerate(
        zip((car.bicycle.C_f, car.bicycle.C_r), car.axle_loads, strict=True)
    ):
        force = fiala_force(SLIPS, c / load, 0.8)
        assert np.abs(T @ W0[i] - force).max() < 0.06
        P = prior.covariance(car, LADDER)[i]
        assert np.linalg.eigvalsh(P).min() > 0.0
        sd = np.sqrt(np.einsum("ki,ij,kj->k", T, P[:4, :4], T))
        assert 0.2 < sd[-1] / force[-1] < 0.6
    np.testing.assert_array_equal(own[:, 2], 0.0)


def test_friction_direction_stretches_the_curve():
    """One step along M w of a brush tire is the brush tire on another road."""
    w, w_icy = fiala_weights(15.0, 0.8, LADDER), fiala_weights(15.0, 0.76, LADDER)
    moved = friction_direction(LADDER) @ w * np.log(0.76 / 0.8)
    T = np.tanh(SLIPS[:, None] / np.array(LADDER))
    assert np.abs(T @ (moved - (w_icy - w))).max() < 0.25 * np.abs(T @ (w_icy - w)).max()


# Where an axle has been: the time above each edge of slip, and the largest slip, filtered.


DT = 0.02


def excitation(sizes, samples=1.0):
    state = ca.DM.zeros(2, 1 + len(units.EDGES))
    for size in sizes:
        state = units.excited(state, ca.DM(size), dt=DT, samples=samples, learns=ca.DM.ones(2))
    return np.array(state)


def test_times_are_counted_above_every_edge_and_for_each_axle_alone(rng):
    sizes = np.abs(rng.normal(scale=0.03, size=(200, 2)))
    found = excitation(sizes)
    for axle in (0, 1):
        expected = [DT * np.count_nonzero(sizes[:, axle] >= edge) for edge in units.EDGES]
        np.testing.assert_allclose(found[axle, 1:], expected, atol=1e-9)
        assert found[axle, 0] == pytest.approx(sizes[:, axle].max())


def test_one_sample_alone_does_not_make_a_range_known():
    assert excitation([[0.1, 0.1]], samples=4.0)[0, 0] == pytest.approx(0.025)
    assert excitation([[0.1, 0.1]] * 40, samples=4.0)[0, 0] == pytest.approx(0.1, rel=1e-3)
    assert excitation([[0.1, 0.1], [0.02, 0.02]], samples=0.5)[0, 0] == 0.1, "it never falls"
