"""What the paper prints in its Tables I and II: RMSE of the axle force [kN].

Its gains, its car and its simulator are not public: these numbers stand beside ours, they are not
reproduced.
"""

from collections.abc import Mapping

PAPER: Mapping[str, Mapping[str, Mapping[str, float]]] = {
    "step_steer": {  # Table I
        "instantaneous": {"online": 0.2690, "32": 0.6506, "35": 0.6488},
        "integral": {"online": 0.4077, "32": 0.5562, "35": 0.5015},
    },
    "slalom": {  # Table II
        "instantaneous": {"online": 0.3388, "32": 1.4529, "40": 1.5332},
        "integral": {"online": 0.3386, "32": 0.4247, "40": 0.4300},
    },
}
