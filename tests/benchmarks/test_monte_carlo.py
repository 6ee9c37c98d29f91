"""Random drives against proven bounds: what is kept of a run, and when the alarm rings."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from benchmarks.monte_carlo import (
    Beginning,
    Drives,
    Observed,
    bound_rows,
    first_weights,
    largest_norms,
    monte_carlo,
    random_drives,
    residuals,
    saturating_bicycle,
)
from identifier.certificate import Certificate, statement
from identifier.driving import natural_driving
from identifier.methods import certify
from identifier.paper.design import PaperIdentifier
from identifier.paper.network import NetworkModel, Weights
from identifier.run import History, identify
from models.bicycle import bicycle
from models.recordings import Recording
from models.vehicle import sedan

CAR = sedan()
DRIVING = natural_driving(CAR)
COUNT, FRESH = 12, Beginning(W=0.0, V=13.0)


def draw(seed=3, dt=0.01):
    return random_drives(
        CAR,
        np.random.default_rng(seed),
        COUNT,
        driving=DRIVING,
        duration=8.0,
        dt=dt,
    )


@pytest.fixture(scope="module")
def drives():
    return draw()


def recording_of(drives, i):
    x, u = drives.x[i], drives.u[i]
    return Recording(
        name="drive",
        t=0.01 * np.arange(len(x)),
        v_x=drives.v_x[i],
        v_y=x[:, 0],
        r=x[:, 1],
        delta_f=u[:, 0],
        delta_r=u[:, 1],
    )


def learnt_alone(design: PaperIdentifier, drives: Drives, weights: Weights, i: int) -> History:
    """The same drive by the ordinary road, one run by itself."""
    start = NetworkModel(
        vehicle=CAR, network=design.network, weights=weights, force_unit=1000.0, min_speed=1.0
    )
    return identify(recording_of(drives, i), CAR, design, start)


@pytest.mark.sweep("integral", "instantaneous")
@pytest.mark.parametrize("law", ["integral", "instantaneous", "pi_lead"])
def test_the_largest_norms_are_those_of_the_same_run_alone(drives, law):
    design = PaperIdentifier.for_vehicle(CAR, law=law)
    begun = first_weights(design, COUNT, Beginning(W=3.0, V=12.0), np.random.default_rng(8))
    found = largest_norms(design, CAR, drives, begun)
    for i in range(COUNT):
        weights = Weights(W=begun.W[i], V=begun.V[i])
        history = learnt_alone(design, drives, weights, i)
        expected = (
            np.linalg.norm(history.outputs["xi_tilde"], axis=1).max(),
            np.linalg.norm(history.state["W"], axis=(1, 2)).max(),
            np.linalg.norm(history.state["V"][1:], axis=(1, 2)).max(),
        )
        np.testing.assert_allclose([values[i] for values in found], expected, rtol=1e-12)


def test_what_is_not_a_number_shows_in_the_end():
    design = PaperIdentifier.for_vehicle(CAR)
    wild = replace(design, gains=replace(design.gains, eta_W=1e9, rho_W=0.0, rho_V=0.0))
    found = monte_carlo(wild, CAR, DRIVING, 20, beginning=FRESH, rng=np.random.default_rng(0))
    assert found.diverged > 0


def test_residuals_are_those_of_the_sampled_model(drives):
    found, K_inv = residuals(CAR, drives, 0.01), np.array(ca.DM(bicycle(CAR.bicycle, 1.0).K_inv))
    for i, k in ((0, 100), (3, 500), (7, 711)):
        model = bicycle(CAR.bicycle, float(drives.v_x[i, k]))
        now, ahead = (K_inv @ drives.x[i, j] for j in (k, k + 1))
        known = ca.DM(model.A_xi) @ now + ca.DM(model.B_xi) @ drives.u[i, k]
        expected = (ahead - now) / 0.01 - np.array(known).ravel()
        np.testing.assert_allclose(found[i, k], expected, rtol=1e-9, atol=1e-6)


def test_the_plant_is_a_magic_formula_that_saturates_at_the_friction():
    """In steady state at a large slip both axles push with μ F_z, and in the linear range C α."""
    step = saturating_bicycle()
    vehicle, road = np.array(CAR.bicycle), np.array([0.5, 0.01])
    for slip, expected in ((1e-4, "linear"), (1.0, "curve")):
        x = np.array([-20.0 * slip, 0.0])
        x_next = np.array(step(x, np.zeros(2), np.zeros(2), 20.0, vehicle, road)).ravel()
        load = np.array(CAR.axle_loads)
        C = np.array([CAR.cornering_stiffness_front, CAR.cornering_stiffness_rear])
        curve = 0.5 * load * np.sin(1.5 * np.arctan(C * slip / (0.75 * load)))
        force = C * slip if expected == "linear" else curve
        lateral = (x_next[0] - x[0]) / 0.01
        assert lateral == pytest.approx(force.sum() / CAR.mass, rel=0.05)


def test_drives_stay_within_what_is_judged():
    design = PaperIdentifier.for_vehicle(CAR)
    operation = design.operation(CAR)
    found = monte_carlo(design, CAR, DRIVING, 300, beginning=FRESH, rng=np.random.default_rng(1))
    assert found.xi_tilde.shape == found.W.shape == found.residual.shape == (300,)
    assert found.residual.max() <= operation.disturbance.residual
    assert found.outside > 0
    assert found.diverged == 0


def observed(xi_tilde):
    ones = np.ones(len(xi_tilde))
    return Observed(np.array(xi_tilde), ones, ones, ones, 3)


BOUNDED = {"error_bound": "xi_tilde", "weight_bound": "W"}


@pytest.mark.parametrize("name", BOUNDED)
@pytest.mark.parametrize(("over", "passed"), [(0.999, 0), (1.001, 2), (1.9, 2), (np.inf, 2)])
def test_the_alarm_rings_right_at_the_bound(name, over, passed):
    """Two of three drives come to a share of the bound, each bound by its own signal."""
    values = dict.fromkeys(BOUNDED, 7.0)
    certificate = Certificate(
        properties=tuple(statement(key, "", value, "U s") for key, value in values.items())
    )
    drives = observed([0.5, 0.5, 0.5])
    seen = np.array([0.5, 7.0 * over, 7.0 * over])
    rows = bound_rows(certificate, drives._replace(**{BOUNDED[name]: seen}))
    (row,) = (row for row in rows if row.name == name)
    assert (row.bound, row.passed) == (7.0, passed)
    assert row.largest == 7.0 * over
    others = [row for row in rows if BOUNDED[row.name] != BOUNDED[name]]
    assert all(row.passed == 0 for row in others)


def test_every_row_is_passed_by_a_law_that_breaks_what_it_bounds():
    """The certificate of a sound design, beside drives of one whose layers leak wrongly."""
    vehicle, design = sedan(), PaperIdentifier.for_vehicle(sedan())
    driving = natural_driving(vehicle)
    passed = {}
    for name, changed in {
        "error_bound": {"eta_W": 3e5, "rho_W": 0.0},
        "weight_bound": {"eta_W": 3e5, "rho_W": 0.0},
        "V_bound": {"rho_V": 3e3},
    }.items():
        planted = replace(design, gains=replace(design.gains, **changed))
        beginning = Beginning(W=0.0, V=12.0)
        rng = np.random.default_rng(1)
        seen = monte_carlo(planted, vehicle, driving, 30, beginning=beginning, rng=rng)
        found = bound_rows(certify(design, vehicle), seen)
        passed[name] = {row.name: row.passed for row in found}[name]
    assert min(passed.values()) > 0, passed
