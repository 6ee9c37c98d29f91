"""Linear, Fiala and Dugoff tires: slopes, limits, and their integrals done another way."""

from math import atan, hypot, isfinite, nan, pi, tan

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from models.tires import DugoffTire, FialaTire, LinearTire
from tests.models.tires.test_magic_formula import LOPSIDED, SEDAN

LINEAR = LinearTire(C_alpha=60e3, C_kappa=80e3)
FIALA = FialaTire(C_alpha=60e3, C_kappa=80e3, friction=0.9)
DUGOFF = DugoffTire(C_alpha=60e3, C_kappa=80e3, friction=0.9)
SIMPLE = (LINEAR, FIALA, DUGOFF)
TIRES = pytest.mark.parametrize("tire", [*SIMPLE, SEDAN, LOPSIDED, LOPSIDED.mirrored()])
LIMITED = pytest.mark.parametrize("tire", [FIALA, DUGOFF], ids=["fiala", "dugoff"])


@TIRES
@pytest.mark.parametrize("F_z", [-100.0, 0.0, 1e-9, 300.0, 4000.0, 9000.0])
def test_stiffnesses_are_the_derivatives_at_zero_slip(tire, F_z):
    rel = 1e-9
    if tire in SIMPLE:
        rel, F_z = 1e-6, np.ceil(F_z)  # below a newton they have no slope at zero slip
    slip = ca.SX.sym("slip", 2)
    F = tire.forces(slip[0], slip[1], 0.0, F_z)
    J = np.array(ca.Function("J", [slip], [ca.jacobian(ca.vertcat(*F), slip)])([0.0, 0.0]))
    assert J[0, 1] == pytest.approx(tire.slip_stiffness(F_z), rel=rel, abs=1e-12)
    assert J[1, 0] == pytest.approx(tire.cornering_stiffness(F_z), rel=rel, abs=1e-12)
    if tire in SIMPLE:
        assert J[0, 0] == J[1, 1] == 0.0
        assert J[1, 0] == pytest.approx(60e3 if F_z > 0.0 else 0.0, rel=rel)


@LIMITED
@settings(max_examples=200, deadline=None)
@given(
    alpha=st.floats(-7.0, 7.0),
    kappa=st.floats(-3.0, 30.0),
    F_z=st.floats(-1e3, 2e4),
    mu=st.floats(0.0, 1.5),
)
def test_no_slip_leaves_the_friction_circle(tire, alpha, kappa, F_z, mu):
    F = tire.forces(alpha, kappa, 0.0, F_z, mu)
    assert all(isinstance(f, float) and isfinite(f) for f in F)
    assert hypot(*F) <= 0.9 * mu * max(F_z, 0.0) * (1.0 + 1e-9) + 1e-300  # subnormal digits


@LIMITED
def test_a_wheel_that_rolls_backwards_slips_by_the_angle_to_its_axis(tire):
    forward, backward = (tire.forces(alpha, 0.02, 0.0, 4000.0) for alpha in (0.05, pi - 0.05))
    assert backward == pytest.approx(forward, rel=1e-9)
    beyond = [tire.forces(alpha, 0.0, 0.0, 4000.0).F_y for alpha in (1.5, pi / 2, 1.6)]
    assert beyond == pytest.approx([0.9 * 4000.0] * 3, rel=0.01)


@LIMITED
@pytest.mark.parametrize("spoiled", range(5))
def test_a_number_that_is_none_is_not_hidden(tire, spoiled):
    point = [0.05, 0.02, 0.0, 4000.0, 1.0]
    point[spoiled] = nan
    finite = all(isfinite(f) for f in tire.forces(*point))
    assert finite == (spoiled == 2)  # camber has no effect


def test_fiala_is_the_integral_over_its_bristles():
    """Bristle deflection limited by μ times the parabolic pressure, summed along the contact."""
    F_z, C, mu = 4000.0, 60e3, 0.9
    front_to_rear = (np.arange(200_000) + 0.5) / 200_000
    pressure = 6.0 * F_z * front_to_rear * (1.0 - front_to_rear)
    for alpha in (0.01, 0.05, 0.1, 0.17, 0.178, 0.179, 0.3):
        adhesion = 2.0 * C * tan(alpha) * front_to_rear
        integral = np.minimum(adhesion, mu * pressure).mean()
        assert FIALA.forces(alpha, 0.0, 0.0, F_z).F_y == pytest.approx(integral, rel=1e-6)


def test_fiala_slides_at_three_mu_F_z_and_smoothly():
    alpha = ca.SX.sym("alpha")
    F_y = FIALA.forces(alpha, 0.0, 0.0, 4000.0).F_y
    slope = ca.Function("slope", [alpha], [F_y, ca.jacobian(F_y, alpha)])
    sliding = atan(3.0 * 0.9 * 4000.0 / 60e3)
    before, after = (slope(sliding + step) for step in (-1e-6, 1e-6))
    assert float(after[0]) == pytest.approx(0.9 * 4000.0, rel=1e-12)
    assert float(after[1]) == pytest.approx(0.0, abs=1e-6)
    assert float(before[1]) == pytest.approx(0.0, abs=1e-3)  # N/rad, of 60 000
    assert float(slope(0.9 * sliding)[1]) > 100.0


def test_fiala_in_combined_slip_is_fiala_along_the_demand():
    """With equal stiffnesses the force depends on |σ| alone and points along σ."""
    tire = FialaTire(C_alpha=60e3, C_kappa=60e3, friction=0.9)
    for alpha, kappa in ((0.05, 0.03), (0.02, -0.2), (0.3, 0.4)):
        sigma = np.array([kappa, tan(alpha)]) / (1.0 + kappa)
        size = float(np.hypot(*sigma))
        alone = tire.forces(atan(size), 0.0, 0.0, 4000.0).F_y
        F = tire.forces(alpha, kappa, 0.0, 4000.0)
        assert np.array(F) == pytest.approx(alone * sigma / size, rel=1e-9)


def test_dugoff_is_linear_while_less_than_half_the_friction_is_used():
    F = DUGOFF.forces(0.02, 0.0, 0.0, 4000.0)
    assert F.F_y == pytest.approx(60e3 * tan(0.02), rel=1e-12)
    assert F.F_x == 0.0
    both = DUGOFF.forces(0.01, 0.015, 0.0, 4000.0)
    expected = (80e3 * 0.015 / 1.015, 60e3 * tan(0.01) / 1.015)
    assert hypot(*both) < 0.5 * 0.9 * 4000.0
    assert both == pytest.approx(expected, rel=1e-12)
    beyond = DUGOFF.forces(0.04, 0.0, 0.0, 4000.0)
    assert beyond.F_y < 0.99 * 60e3 * tan(0.04)


@pytest.mark.parametrize("slip", [(0.1, 0.0), (0.1, 0.2), (-0.3, -0.4), (0.0, 0.5)])
def test_dugoff_is_its_published_formula(slip):
    alpha, kappa = slip
    demand = 2.0 * hypot(80e3 * kappa, 60e3 * tan(alpha))
    lam = 0.9 * 4000.0 * (1.0 + kappa) / demand
    f = (2.0 - lam) * lam if lam < 1.0 else 1.0
    expected = (80e3 * kappa / (1 + kappa) * f, 60e3 * tan(alpha) / (1 + kappa) * f)
    assert DUGOFF.forces(alpha, kappa, 0.0, 4000.0) == pytest.approx(expected, rel=1e-9, abs=1e-9)


@TIRES
@pytest.mark.parametrize("kind", [ca.SX, ca.MX, ca.DM])
def test_symbols_and_floats_give_the_same_force(tire, kind):
    point = (0.06, -0.04, 0.03, 3500.0, 0.8)
    if kind is ca.DM:
        values = result = tire.forces(*map(ca.DM, point))
    else:
        x = [kind.sym(name) for name in ("alpha", "kappa", "gamma", "F_z", "mu")]
        result = tire.forces(*x)
        values = ca.Function("f", x, list(result)).call(list(point))
    assert all(isinstance(value, kind) for value in result)
    assert [float(v) for v in values] == pytest.approx(tire.forces(*point), rel=1e-13)
