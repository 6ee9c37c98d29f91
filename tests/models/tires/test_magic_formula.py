"""The Magic Formula by other roads: derivatives, mirror images, limits, the book retyped."""

from dataclasses import replace
from math import atan, cos, exp, inf, isfinite, nan, pi, sin
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import models
from models.tires import MagicFormula

SEDAN = MagicFormula.from_tir(Path(models.__file__).parent / "data" / "sedan.tir")
# the sedan's tire with a value for every coefficient, so that no term of the equations is asleep
LOPSIDED = replace(
    SEDAN,
    coefficients=replace(
        SEDAN.coefficients,
        PHX1=0.002, PHX2=-0.001, PVX1=0.01, PVX2=-0.02, PEX3=0.05, PEX4=0.1, PHY1=0.004,
        PHY2=-0.002, PVY1=0.02, PVY2=-0.01, PEY3=0.2, RHX1=0.01, RBY3=0.02, RVY1=0.03, RVY2=-0.02,
        RHY1=0.01, RHY2=-0.005, REX2=-0.1, REY2=0.1, LFZO=0.9, LCX=1.05, LMUX=0.95, LEX=0.9,
        LKX=1.1, LHX=0.8, LVX=1.2, LGAX=0.9, LCY=1.02, LMUY=0.97, LEY=1.1, LKY=0.9, LHY=1.3,
        LVY=0.7, LGAY=1.1, LKYG=0.9, LXAL=1.1, LYKA=0.9, LVYKA=1.2,
    ),
)  # fmt: skip
angles, slips = st.floats(-7.0, 7.0), st.floats(-3.0, 30.0)
cambers, loads = st.floats(-0.3, 0.3), st.floats(-1e4, 5e4)


def sgn(x):
    return float(np.sign(x))


def textbook(p, a, k, g, F_z, mu):
    """MF 5.2 retyped from the book in one piece, ISO sign of a."""
    c = {name: getattr(p, name) for name in p.__dataclass_fields__}
    F0 = c["LFZO"] * c["FNOMIN"]
    d = F_z / F0 - 1

    def curve(x, B, C, D, E, trig=sin):
        return D * trig(C * atan((1 - E) * B * x + E * atan(B * x)))

    gx, gy = g * c["LGAX"], g * c["LGAY"]
    mx, my = c["LMUX"] * mu, c["LMUY"] * mu
    kx = k + (c["PHX1"] + c["PHX2"] * d) * c["LHX"]
    Dx = F_z * (c["PDX1"] + c["PDX2"] * d) * (1 - c["PDX3"] * gx * gx) * mx
    Cx = c["PCX1"] * c["LCX"]
    Ex = (c["PEX1"] + c["PEX2"] * d + c["PEX3"] * d * d) * (1 - c["PEX4"] * sgn(kx)) * c["LEX"]
    Kx = F_z * (c["PKX1"] + c["PKX2"] * d) * exp(c["PKX3"] * d) * c["LKX"]
    Fx0 = curve(kx, Kx / Cx / Dx, Cx, Dx, min(Ex, 1))
    Fx0 += F_z * (c["PVX1"] + c["PVX2"] * d) * c["LVX"] * mx
    Bxa = c["RBX1"] * cos(atan(c["RBX2"] * k)) * c["LXAL"]
    Exa, S = min(c["REX1"] + c["REX2"] * d, 1), c["RHX1"]
    G = curve(a + S, Bxa, c["RCX1"], 1, Exa, cos) / curve(S, Bxa, c["RCX1"], 1, Exa, cos)
    Fx = G * Fx0

    ay = a + (c["PHY1"] + c["PHY2"] * d) * c["LHY"] + c["PHY3"] * gy * c["LKYG"]
    Dy = F_z * (c["PDY1"] + c["PDY2"] * d) * (1 - c["PDY3"] * gy * gy) * my
    Cy = c["PCY1"] * c["LCY"]
    Ey = (c["PEY1"] + c["PEY2"] * d) * (1 - (c["PEY3"] + c["PEY4"] * gy) * sgn(ay)) * c["LEY"]
    Ky = c["PKY1"] * F0 * sin(2 * atan(F_z / c["PKY2"] / F0)) * (1 - c["PKY3"] * abs(gy)) * c["LKY"]
    Sv = (c["PVY1"] + c["PVY2"] * d) * c["LVY"] + (c["PVY3"] + c["PVY4"] * d) * gy * c["LKYG"]
    Fy0 = curve(ay, Ky / Cy / Dy, Cy, Dy, min(Ey, 1)) + F_z * Sv * my
    Byk = c["RBY1"] * cos(atan(c["RBY2"] * (a - c["RBY3"]))) * c["LYKA"]
    Eyk, S = min(c["REY1"] + c["REY2"] * d, 1), c["RHY1"] + c["RHY2"] * d
    G = curve(k + S, Byk, c["RCY1"], 1, Eyk, cos) / curve(S, Byk, c["RCY1"], 1, Eyk, cos)
    Dv = Dy * (c["RVY1"] + c["RVY2"] * d + c["RVY3"] * g) * cos(atan(c["RVY4"] * a))
    return Fx, G * Fy0 + Dv * sin(c["RVY5"] * atan(c["RVY6"] * k)) * c["LVYKA"]


def test_every_term_and_scaling_factor_is_that_of_the_textbook(rng):
    for _ in range(300):
        a, k, g = rng.uniform(-0.5, 0.5), rng.uniform(-1.0, 1.0), rng.uniform(-0.1, 0.1)
        F_z, mu = rng.uniform(200.0, 9000.0), rng.uniform(0.2, 1.2)
        ours = LOPSIDED.forces(-a, k, g, F_z, mu)
        assert ours == pytest.approx(textbook(LOPSIDED.coefficients, a, k, g, F_z, mu), abs=1e-7)


def test_peak_of_the_curve_is_D():
    """Peak friction PDY1 + PDY2 df_z and PDX1 + PDX2 df_z, found by search."""
    for F_z, mu in ((2000.0, 1.0), (4000.0, 0.5), (8000.0, 1.0)):
        d = F_z / 4000.0 - 1.0
        F_y = SEDAN.forces(ca.DM(np.linspace(0.0, 0.5, 20001)), 0.0, 0.0, F_z, mu).F_y
        F_x = SEDAN.forces(0.0, ca.DM(np.linspace(0.0, 1.0, 20001)), 0.0, F_z, mu).F_x
        assert float(ca.mmax(F_y)) == pytest.approx(mu * (1.00 - 0.13 * d) * F_z, rel=1e-6)
        assert float(ca.mmax(F_x)) == pytest.approx(mu * (1.08 - 0.11 * d) * F_z, rel=1e-6)


@settings(max_examples=150, deadline=None)
@given(angles, slips, cambers, loads)
def test_the_mirrored_tire_answers_the_mirrored_wheel(alpha, kappa, gamma, F_z):
    left = LOPSIDED.forces(alpha, kappa, gamma, F_z)
    right = LOPSIDED.mirrored().forces(-alpha, kappa, -gamma, F_z)
    assert (right.F_x, -right.F_y) == pytest.approx(left, abs=1e-6)


@settings(max_examples=300, deadline=None)
@given(angles, slips, cambers, loads, st.floats(0.0, 2.0))
def test_forces_are_finite_everywhere_and_zero_in_the_air(alpha, kappa, gamma, F_z, mu):
    F = LOPSIDED.forces(alpha, kappa, gamma, F_z, mu)
    assert all(isinstance(f, float) and isfinite(f) for f in F)
    if F_z <= 0.0 or mu == 0.0:
        assert F == (0.0, 0.0)


def test_derivatives_are_finite_everywhere():
    x = ca.SX.sym("x", 5)
    F = ca.vertcat(*LOPSIDED.forces(*ca.vertsplit(x)))
    gradient = ca.Function("gradient", [x], [ca.jacobian(F, x)])
    for alpha in (0.0, 0.1, pi / 2, -pi / 2, 3.0):
        for kappa in (0.0, -1.0, 20.0):
            for F_z in (-1.0, 0.0, 1e-12, 1e-3, 4000.0, 1e5):
                for mu in (0.0, 1.0):
                    slope = np.array(gradient([alpha, kappa, 0.0, F_z, mu]))
                    assert np.isfinite(slope).all(), (alpha, kappa, F_z, mu)


def test_a_bad_load_is_not_hidden():
    assert all(not isfinite(f) for f in SEDAN.forces(0.1, 0.0, 0.0, nan))
    assert all(not isfinite(f) for f in SEDAN.forces(nan, 0.0, 0.0, 4000.0))
    assert all(not isfinite(f) for f in SEDAN.forces(0.1, 0.0, 0.0, inf))


def test_a_wheel_that_rolls_backwards_slips_by_the_angle_to_its_axis():
    forward = SEDAN.forces(0.05, 0.0, 0.0, 4000.0)
    backward = SEDAN.forces(pi - 0.05, 0.0, 0.0, 4000.0)
    assert backward == pytest.approx(forward, abs=1e-6)
    assert SEDAN.forces(pi, 0.0, 0.0, 4000.0).F_y == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("name", ["PEX1", "PEY1", "REX1", "REY1"])
def test_curvature_is_at_most_one(name):
    def force(E):
        c = replace(SEDAN.coefficients, PEX2=0.0, PEY2=0.0, PEY4=0.0, **{name: E})
        return replace(SEDAN, coefficients=c).forces(0.2, -0.3, 0.0, 4000.0)

    assert force(3.0) == force(1.0) != force(0.9)
