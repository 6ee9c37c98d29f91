"""Equations (1)-(7) reached by other roads: Newton-Euler by hand, derivatives, substitution."""

import casadi as ca
import numpy as np
import pytest

from models.bicycle import BicycleParameters, bicycle, slip_angles

RESIDUAL = 1e-12


@pytest.fixture
def case(rng):
    """A random car and a random state; ten of them in a row would behave alike."""
    m, I_z = rng.uniform(800, 3000), rng.uniform(1000, 5000)
    l_f, l_r = rng.uniform(0.8, 2.0, 2)
    C_f, C_r = rng.uniform(4e4, 2e5, 2)
    p, v_x, s = (
        BicycleParameters(m, I_z, l_f, l_r, C_f, C_r),
        rng.uniform(8, 40),
        rng.normal(size=6),
    )
    return p, v_x, s[:2], 0.1 * s[2:4], 1000 * s[4:]


def newton_euler(p, v_x, x, u, f):
    """(1)-(3), (5) by hand: forces on two axles, their sum and their moments."""
    (v_y, r), (delta_f, delta_r) = x, u
    F_yf = p.C_f * (delta_f - (v_y + p.l_f * r) / v_x) + f[0]
    F_yr = p.C_r * (delta_r - (v_y - p.l_r * r) / v_x) + f[1]
    return np.array([(F_yf + F_yr) / p.m - v_x * r, (p.l_f * F_yf - p.l_r * F_yr) / p.I_z])


def numbers(matrix):
    return np.array(ca.DM(matrix))


def relative(residual, scale):
    return np.abs(residual).max() / np.abs(scale).max()


def require_newton_and_euler(model, p, v_x, x, u, f):
    x_dot = numbers(model.A) @ x + numbers(model.B) @ u + numbers(model.K) @ f
    expected = newton_euler(p, v_x, x, u, f)
    assert relative(x_dot - expected, expected) < RESIDUAL


def require_input_matrix_of_the_stiffnesses(model, p, *_):
    B = numbers(model.K) @ np.diag([p.C_f, p.C_r])
    assert relative(B - numbers(model.B), numbers(model.B)) < RESIDUAL


def require_closed_form_inverse(model, *_):
    np.testing.assert_allclose(numbers(model.K) @ numbers(model.K_inv), np.eye(2), atol=RESIDUAL)


def require_decoupled_axle_forces(model, p, v_x, x, u, f):
    K_inv = np.linalg.inv(numbers(model.K))
    xi_dot = K_inv @ newton_euler(p, v_x, x, u, f)
    decoupled = numbers(model.A_xi) @ (K_inv @ x) + numbers(model.B_xi) @ u + f  # (7)
    assert relative(decoupled - xi_dot, xi_dot) < RESIDUAL


REQUIREMENTS = (
    require_newton_and_euler,
    require_input_matrix_of_the_stiffnesses,
    require_closed_form_inverse,
    require_decoupled_axle_forces,
)


@pytest.mark.parametrize("require", REQUIREMENTS)
def test_bicycle_obeys_its_equations(case, require):
    require(bicycle(*case[:2]), *case)


@pytest.mark.parametrize("require", REQUIREMENTS)
def test_the_printed_transpose_of_K_is_caught(case, require):
    model = bicycle(*case[:2])
    with pytest.raises(AssertionError):
        require(model._replace(K=model.K.T), *case)


def test_matrices_are_the_jacobians_of_newton_and_euler(case):
    p, v_x, *_ = case
    x, u, f = ca.SX.sym("x", 2), ca.SX.sym("u", 2), ca.SX.sym("f", 2)
    alpha = slip_angles(p.l_f, p.l_r, v_x, x, u)
    F = ca.vertcat(p.C_f * alpha[0], p.C_r * alpha[1]) + f  # (3), (5)
    x_dot = ca.vertcat((F[0] + F[1]) / p.m - v_x * x[1], (p.l_f * F[0] - p.l_r * F[1]) / p.I_z)
    model = bicycle(p, v_x)
    for symbol, matrix in ((x, model.A), (u, model.B), (f, model.K)):
        jacobian = numbers(ca.evalf(ca.jacobian(x_dot, symbol)))
        assert relative(numbers(matrix) - jacobian, jacobian) < RESIDUAL


def test_symbols_and_numbers_give_the_same_matrices(case):
    p, v_x, *_ = case
    symbols = BicycleParameters(*(ca.SX.sym(name) for name in p._fields))
    speed = ca.SX.sym("v_x")
    evaluate = ca.Function("matrices", [*symbols, speed], list(bicycle(symbols, speed)))
    for symbolic, numeric in zip(evaluate(*p, v_x), bicycle(p, v_x), strict=True):
        np.testing.assert_allclose(numbers(symbolic), numbers(numeric), rtol=RESIDUAL)
