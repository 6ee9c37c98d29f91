import numpy as np
import pytest
from scipy.integrate import quad

from mpc.path.courses import Straight, Turn, line_along

RIGHT = Turn(radius=20.0, angle=-1.2, easing=8.0)


def test_a_turn_turns_by_its_angle_and_reaches_its_radius():
    s = np.linspace(0.0, RIGHT.length, 5001)
    psi, kappa = RIGHT.heading(s)
    assert psi[[0, -1]] == pytest.approx([0.0, -1.2])
    assert kappa.min() == pytest.approx(-1 / 20.0)
    assert kappa[[0, -1]] == pytest.approx(0.0)
    assert np.gradient(psi, s)[1:-1] == pytest.approx(kappa[1:-1], abs=1e-6)


def test_sections_end_where_quadrature_says():
    line = line_along([Straight(length=10.0), RIGHT, Straight(length=5.0)])

    def heading(s):
        return (
            float(RIGHT.heading(np.array([s - 10.0]))[0][0])
            if 10.0 < s < 10.0 + RIGHT.length
            else 0.0
        )

    X = 10.0 + quad(lambda s: np.cos(heading(s)), 10.0, 10.0 + RIGHT.length)[0] + 5.0 * np.cos(-1.2)
    Y = quad(lambda s: np.sin(heading(s)), 10.0, 10.0 + RIGHT.length)[0] + 5.0 * np.sin(-1.2)
    assert (line.X[-1], line.Y[-1]) == pytest.approx((X, Y), abs=1e-7)
    assert line.s[-1] == pytest.approx(10.0 + RIGHT.length + 5.0)
