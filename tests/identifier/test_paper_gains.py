"""Gains of the paper's laws that follow from a car: each rule, by another road."""

from dataclasses import replace

import numpy as np
import pytest

from identifier.paper.gains import DesignError, gains_for
from identifier.paper.laws import LAWS
from identifier.stability.bounds import steady_capacity
from identifier.stability.loop import direction_matrix
from identifier.stability.margins import phase_margin
from identifier.stability.operation import proven_bounds, worst_loop
from identifier.stability.sampled_bound import Disturbance
from tests.identifier.stability.test_certificate import CITY as KNOWN


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_gains_keep_their_rules(law):
    gains = gains_for(law, KNOWN)
    error, D = law.error(gains.lead), direction_matrix(law, gains.matrix)
    a, lam = -gains.A_d[0][0], gains.forgetting
    assert np.degrees(2.0 * np.arctan(2 * np.pi * 0.7 / a)) == pytest.approx(45.0)
    assert lam == a and gains.lead == law.lead / a
    proven = proven_bounds(gains, error, KNOWN, D)
    loop = worst_loop(gains, error, KNOWN, D, proven.W)
    assert phase_margin(loop, 0.01) == pytest.approx(60.0, abs=1e-6)
    assert loop.G[0, 0] == pytest.approx(10.0 * gains.eta_W) and gains.eta_V > 0.0
    capacity = steady_capacity(
        D, law=error, forgetting=lam, eta_W=gains.eta_W, rho_W=gains.rho_W, n_h=10
    )
    assert capacity == pytest.approx(4.0 * 4.0)
    drive = gains.eta_V / a * proven.leakage.W * 2.5  # of V, at the bounds
    V = drive * (error.z / lam + error.xi_tilde) / gains.rho_V
    V += error.z * drive * proven.leakage.xi_tilde / lam**2
    assert pytest.approx(12.0) == V == pytest.approx(proven.V)


def test_a_bandwidth_that_the_sampling_cannot_follow_is_refused():
    with pytest.raises(DesignError, match=r"sample every 9\.42 ms"):
        gains_for(LAWS["integral"], replace(KNOWN, bandwidth=1.4))
    with pytest.raises(DesignError, match="leaks too much in 10 ms"):
        gains_for(LAWS["integral"], replace(KNOWN, disturbance=Disturbance(residual=1e4)))
