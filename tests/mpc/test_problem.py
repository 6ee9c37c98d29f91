import numpy as np
import pytest

from mpc.problem import Limits, Problem


@pytest.mark.parametrize(
    ("kind", "given", "said"),
    [
        (Limits, {"steering": 0.0}, "steering must be positive and finite"),
        (Limits, {"steering_rate": -1.0}, "steering_rate must be positive and finite"),
        (Limits, {"e_y": np.nan}, "e_y must be positive and finite"),
        (Limits, {"soft_slip": np.inf}, "soft_slip must be positive and finite"),
        (Limits, {"slip": (0.1,)}, "slip must be two positive numbers"),
        (Limits, {"slip": (0.1, 0.0)}, "slip must be two positive numbers"),
        (Limits, {"slip": (0.1, np.nan)}, "slip must be two positive numbers"),
        (Problem, {"horizon": 1}, "horizon must be"),
        (Problem, {"dt": 0.0}, "dt must be"),
        (Problem, {"dt": np.nan}, "dt must be"),
    ],
)
def test_what_is_no_limit_or_has_no_future_is_refused_by_name(kind, given, said):
    with pytest.raises(ValueError, match=said):
        kind(**given)
