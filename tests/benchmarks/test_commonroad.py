"""The carried-over car against the package's own functions, and the repair of its equations."""

from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("vehiclemodels", reason="needs commonroad-vehicle-models")

from vehiclemodels import vehicle_dynamics_mb as program
from vehiclemodels.utils import tire_model

from benchmarks.commonroad_bmw import CommonRoadTire, bmw_parameters, bmw_tire
from benchmarks.commonroad_multibody import (
    V_X,
    V_Y,
    V_Y_FRONT,
    V_Y_REAR,
    YAW_RATE,
    MultiBody,
    SlipAtTheAxles,
)


def random_coefficients(rng):
    """The tire of the package with every coefficient awake."""
    return {
        name: value * rng.uniform(0.8, 1.2) + (0.02 * rng.normal() if abs(value) < 0.05 else 0.0)
        for name, value in bmw_tire().items()
    }


@pytest.mark.parametrize("case", range(8))
def test_the_tire_is_that_of_the_package_for_any_coefficients(case):
    rng = np.random.default_rng(case)
    coefficients = random_coefficients(rng)
    tire, p = CommonRoadTire(p=tuple(coefficients.items())), SimpleNamespace(**coefficients)
    for _ in range(10):
        alpha, kappa = rng.uniform(-0.4, 0.4), rng.uniform(-0.4, 0.4)
        gamma, F_z = rng.choice([-1.0, 1.0]) * rng.uniform(0.02, 0.1), rng.uniform(1e3, 7e3)
        a, s, g = -alpha, -kappa, -gamma
        F0_x = tire_model.formula_longitudinal(s, g, F_z, p)
        F0_y, mu_y = tire_model.formula_lateral(a, g, F_z, p)
        expected = (
            tire_model.formula_longitudinal_comb(s, a, F0_x, p),
            tire_model.formula_lateral_comb(s, a, g, mu_y, F_z, F0_y, p),
        )
        ours = tire.forces(alpha, kappa, gamma, F_z)
        np.testing.assert_allclose((float(ours.F_x), float(ours.F_y)), expected, rtol=2e-3)


def test_the_repair_moves_unsprung_mass_until_both_axles_balance():
    plain, repaired = bmw_parameters(), bmw_parameters(repaired=True)
    assert repaired.m_uf + repaired.m_ur == pytest.approx(plain.m_uf + plain.m_ur)
    assert repaired.m_uf * repaired.a == pytest.approx(repaired.m_ur * repaired.b)
    assert repaired.m_uf - plain.m_uf == pytest.approx(6.6, abs=0.1)


def test_a_tire_slips_by_the_velocity_of_its_axle():
    """Front pair, then rear pair: each is told what its axle moves sideways beside the body."""
    told = SimpleNamespace(
        formula_longitudinal=lambda kappa: kappa,
        formula_lateral=lambda alpha: alpha,
        formula_longitudinal_comb=lambda kappa, alpha: alpha,
        formula_lateral_comb=lambda kappa, alpha: alpha,
    )
    x, car = np.zeros(29), SimpleNamespace(a=1.2, b=1.6)
    x[[V_X, V_Y, YAW_RATE]] = 20.0, 0.5, 0.3
    x[V_Y_FRONT], x[V_Y_REAR] = 0.5 + 1.2 * 0.3 + 0.04, 0.5 - 1.6 * 0.3 - 0.06
    tires = SlipAtTheAxles(told, x, car)
    expected = pytest.approx([0.1 + 0.002] * 2 + [0.1 - 0.003] * 2)
    assert [tires.formula_lateral(0.1) for _ in range(4)] == expected
    assert [tires.formula_lateral_comb(0.0, 0.1) for _ in range(4)] == expected
    assert [tires.formula_longitudinal_comb(0.0, 0.1) for _ in range(4)] == expected
    assert tires.formula_longitudinal(0.2) == 0.2


def test_their_program_stays_as_it_is():
    """Once repaired, once not: the tires that others find in the package are the published ones."""

    before, tires, parameters = dict(vars(tire_model)), program.tireModel, bmw_parameters()
    found = []
    for repaired in (False, True, False):
        equations = MultiBody(repaired=repaired)
        x = equations.start([0.0, 0.0, 0.02, 20.0, 0.0, 0.1, 0.01], parameters)
        x[V_Y_FRONT] += 0.05
        found.append(equations.derivative(x, 0.0, 0.0, parameters))
    published, corrected, again = found
    assert np.array_equal(published, again)
    assert not np.allclose(published, corrected)
    assert vars(tire_model) == before
    assert program.tireModel is tires
