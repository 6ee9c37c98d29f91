import numpy as np
import pytest

from mpc.problem import Limits, Problem


@pytest.mark.parametrize(
    ("name", "value"),
    [("steering", 0.0), ("steering_rate", -1.0), ("e_y", np.nan), ("soft_slip", np.inf)],
)
def test_a_limit_that_is_none_is_refused_by_name(name, value):
    with pytest.raises(ValueError, match=f"{name} must be positive and finite"):
        Limits(**{name: value})


@pytest.mark.parametrize("slip", [(0.1,), (0.1, 0.0), (0.1, np.nan)])
def test_both_axles_need_a_limit_of_slip(slip):
    with pytest.raises(ValueError, match="slip must be two positive numbers"):
        Limits(slip=slip)


@pytest.mark.parametrize(("horizon", "dt"), [(1, 0.05), (40, 0.0), (40, np.nan)])
def test_a_problem_without_a_future_is_refused(horizon, dt):
    with pytest.raises(ValueError, match="must be"):
        Problem(horizon=horizon, dt=dt)
