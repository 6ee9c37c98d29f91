import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import solve_continuous_lyapunov

from identifier.certificate import Certificate, Property, at_least, at_most
from identifier.paper.gains import gains_for
from identifier.paper.laws import LAWS, Gains, diagonal
from identifier.stability.certificate import certify
from identifier.stability.operation import Operation
from identifier.stability.sampled_bound import Disturbance
from tests.identifier.stability.limits import (
    instantaneous_damping,
    integral_euler_limit,
    integral_limit,
)

integral, instantaneous, lead_law = (
    LAWS[name] for name in ("integral", "instantaneous", "pi_lead")
)

CITY = Operation(
    n_h=10,
    dt=0.01,
    bandwidth=0.7,
    disturbance=Disturbance(residual=4.0),
    needed_force=4.0,
    x_bar_max=2.5,
    input_feedback=None,
    V_start=12.0,
)


def gains(a=8.0, lam=8.0, **changes):
    settings = {"eta_W": 50.0, "eta_V": 0.0, "rho_W": 0.1, "rho_V": 0.1}
    return Gains(A_d=diagonal(a), forgetting=lam, **{**settings, **changes})


@pytest.mark.parametrize("law", [integral, instantaneous])
def test_a_design_passes_its_own_certificate(law):
    certificate = certify(gains_for(law, CITY), law, CITY)
    assert certificate.verdict == "pass"
    assert certificate["phase_margin"].value == pytest.approx(60.0, abs=1e-6)


def test_the_margins_are_those_of_the_closed_forms():
    certificate = certify(gains(), integral, CITY)
    assert certificate["gain_continuous"].value == pytest.approx(500.0)
    assert certificate["gain_continuous"].limit == pytest.approx(integral_limit(8.0, 8.0))
    assert certificate["gain_sampled"].limit == pytest.approx(integral_euler_limit(8.0, 8.0, 0.01))
    damping = certify(gains(), instantaneous, CITY)["damping"].value
    assert damping == pytest.approx(instantaneous_damping(8.0, 500.0))


def test_a_gain_beyond_the_limit_fails_with_a_factor_that_repairs_it():
    wild = gains(eta_W=2.0 * integral_limit(8.0, 8.0) / 10)
    certificate = certify(wild, integral, CITY)
    assert certificate.verdict == "fail"
    entry = certificate["gain_sampled"]
    factor = float(entry.advice.split("by ")[1].split(";")[0])
    repaired = replace(wild, eta_W=factor * wild.eta_W)
    assert certify(repaired, integral, CITY)["gain_sampled"].margin == pytest.approx(2.0, rel=0.06)


def test_a_gain_that_only_the_sampling_makes_unstable_fails_only_there():
    between = (integral_limit(12.0, 12.0) + integral_euler_limit(12.0, 12.0, 0.01)) / 20
    certificate = certify(gains(12.0, 12.0, eta_W=between), integral, CITY)
    assert certificate["gain_continuous"].status == "warn"
    assert certificate["gain_sampled"].status == "fail"


def test_slow_poles_warn_of_drift_and_the_lead_takes_it_away():
    slow = gains(3.0, 3.0, eta_W=1.0)
    entry = certify(slow, integral, CITY)["drift"]
    assert entry.limit == pytest.approx(3.0 / (2 * np.pi))
    assert entry.status == "warn"
    assert entry.advice == "raise A_d and forgetting"
    assert certify(replace(slow, lead=1.0 / 3.0), lead_law, CITY)["drift"].status == "pass"


def test_each_weakness_is_named():
    def status(name, design, operation=CITY, law=integral):
        return certify(design, law, operation)[name].status

    assert status("sampling", gains(30.0)) == "warn"
    assert status("sampling", gains(210.0)) == "fail"
    assert status("small_gain", gains(eta_W=1000.0)) == "warn"
    assert status("capacity", gains(rho_W=50.0)) == "warn"
    assert status("leakage_step", gains(rho_W=200.0, eta_W=100.0)) == "warn"
    assert status("leakage_step", gains(rho_W=500.0, eta_W=100.0)) == "fail"
    assert status("leakage_step_V", gains(rho_V=3000.0)) == "fail"
    assert status("filter_step", gains(lam=99.0)) == "pass"
    assert status("filter_step", gains(lam=101.0)) == "fail"
    assert status("error_dynamics", gains(210.0)) == "fail"
    assert status("V_bound", gains(eta_V=1.0, rho_V=0.0)) == "warn"
    reads_estimate = replace(CITY, input_feedback=10.0 * np.eye(2))
    assert status("estimated_input", gains(), reads_estimate) == "fail"
    assert status("estimated_input", gains(16.0), reads_estimate) == "pass"


def test_leakage_is_judged_by_what_it_takes_in_one_sample():
    """ρ T |ξ̃|: a sixteenth of the sampling interval lets a sixteenth of it leak."""
    shares = []
    for dt in (0.016, 0.001):
        certificate = certify(gains(rho_W=2.0), integral, replace(CITY, dt=dt))
        entry = certificate["leakage_step"]
        assert entry.value == pytest.approx(2.0 * dt * certificate["error_bound"].value, rel=1e-6)
        shares.append(entry.value)
    assert shares[0] == pytest.approx(16.0 * shares[1], rel=1e-6)


def test_bounds_of_the_certificate_are_those_of_the_sampled_identifier():
    """Error dynamics that swing, sampled coarsely by Euler: every bound has its own γ."""
    A_d, dt = np.array([[-4.0, 30.0], [-6.0, -9.0]]), 0.04
    power, gamma = np.eye(2), 0.0
    for _ in range(1500):
        gamma, power = gamma + dt * np.linalg.norm(power, 2), power @ (np.eye(2) + dt * A_d)
    size = np.linalg.norm(np.linalg.inv(A_d), 2)
    wild = replace(gains(lam=3.0, eta_W=0.05, rho_W=0.5), A_d=tuple(map(tuple, A_d.tolist())))
    coarse = replace(CITY, dt=dt)
    certificate = certify(wild, instantaneous, coarse)
    root = np.sqrt(10.0)
    capacity = 0.05 * size * root / 0.5
    assert certificate["error_bound"].value == pytest.approx(gamma * (4.0 + root * capacity))
    theta = certify(wild, integral, coarse)["small_gain"].value
    assert theta == pytest.approx(gamma * 0.05 * size * 10 / 9.0)
    finely = certify(wild, integral, replace(CITY, dt=1e-4))["small_gain"].value
    assert theta > 1.3 * finely


def test_without_a_leakage_no_bound_of_the_error_is_stated_but_that_there_is_none():
    nothing = certify(gains(eta_W=1000.0, rho_W=0.0), integral, CITY)["error_bound"]
    assert (nothing.value, nothing.status) == (np.inf, "warn")


def test_bound_14_is_stated_with_its_shortcomings():
    entry = certify(gains(), integral, CITY)["printed_bound"]
    assert "does not cover" in entry.advice
    assert "above the trivial bound" in entry.advice
    assert "does not cover" not in certify(gains(), instantaneous, CITY)["printed_bound"].advice


def test_the_certificate_is_plain_json_even_where_a_limit_is_infinite():
    data = certify(gains_for(instantaneous, CITY), instantaneous, CITY).to_dict()
    again = json.loads(json.dumps(data, allow_nan=False))
    assert again["verdict"] == "pass"
    assert again["properties"]["gain_continuous"]["limit"] is None
    assert set(again["properties"]["damping"]) >= {"value", "limit", "margin", "status"}


def test_the_worst_status_is_the_verdict_and_nan_never_passes():
    def entry(status):
        return Property(
            name=status, title="", value=0.0, limit=None, margin=None, status=status, unit=""
        )

    assert Certificate(properties=(entry("pass"), entry("warn"))).verdict == "warn"
    assert Certificate(properties=(entry("fail"), entry("warn"))).verdict == "fail"
    assert at_most(np.nan, good=1.0, bad=2.0) == "fail"
    assert at_least(np.nan, good=1.0, bad=0.5) == "fail"


def test_where_V_learns_the_margins_hold_up_to_the_weights_that_are_kept():
    design = gains_for(integral, CITY)
    kept = certify(design, integral, CITY)["weight_range"].value
    assert certify(design, integral, CITY)["weight_range"].status == "pass"
    narrow = replace(CITY, W_large=kept / 2)
    assert certify(design, integral, narrow)["weight_range"].status == "pass"  # V costs nothing yet
    mild = replace(design, eta_V=4.5 * design.eta_V)  # now it does, but the margins bear it
    assert certify(mild, integral, narrow)["weight_range"].status == "pass"
    eager = replace(design, eta_V=100.0 * design.eta_V)
    assert certify(eager, integral, narrow)["weight_range"].status == "warn"
    free = replace(design, rho_W=0.0)  # nothing keeps W
    assert certify(free, integral, CITY)["weight_range"].status == "warn"


def test_a_margin_is_the_ratio_of_value_and_limit_and_one_is_the_limit():
    gentle, strong = (certify(gains(eta_W=eta), integral, CITY) for eta in (0.5, 50.0))
    for certificate in (gentle, strong):
        theta = certificate["small_gain"]
        assert theta.margin * theta.value == pytest.approx(1.0)
        assert (theta.margin > 1.0) == (theta.status == "pass")
    assert gentle["small_gain"].margin == pytest.approx(100.0 * strong["small_gain"].margin)
    quiet = certify(gains(eta_W=1e-15), integral, CITY)["small_gain"]
    assert quiet.status == "pass" and quiet.margin > 1e12


def test_the_lead_holds_a_force_along_its_own_direction():
    """P of A_dᵀ P + P A_d = -2 I; far from normal it is not as large as A_d⁻ᵀ."""
    A_d = np.array([[-4.0, 30.0], [-6.0, -9.0]])
    lead = replace(gains(lam=5.0, lead=0.4), A_d=tuple(map(tuple, A_d.tolist())))
    P = solve_continuous_lyapunov(A_d.T, -2.0 * np.eye(2))
    driven = 10 * lead.eta_W * np.linalg.norm(P, 2) * (1.0 / 5.0 + 0.4)
    entry = certify(lead, lead_law, CITY)["capacity"]
    assert entry.value == pytest.approx(driven / lead.rho_W)
    assert entry.margin == pytest.approx(driven / lead.rho_W / CITY.needed_force)


def test_a_small_phase_margin_comes_with_advice_that_repairs_it():
    poor = gains(eta_W=0.9 * integral_euler_limit(8.0, 8.0, 0.01) / 10)
    before = certify(poor, integral, CITY)["phase_margin"]
    assert (before.status, before.advice) == ("warn", "lower eta_W")
    after = certify(replace(poor, eta_W=0.05 * poor.eta_W), integral, CITY)["phase_margin"]
    assert after.value > 3.0 * before.value
    assert (after.status, after.advice) == ("pass", "")
