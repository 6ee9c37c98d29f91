"""Where the model has been: how long it learnt, by range of slip.

Slip counts with the larger of its two sizes, without lag and sway and with them: the first is what
a reader of the recording sees, the second is what made the force.
"""

from typing import Any

import casadi as ca

from identifier.axle.piecewise import larger, smaller

EDGES = (0.0, 0.0025, 0.005, 0.01, 0.02, 0.04, 0.08, 0.16)  # rad


def excited(state: Any, size: Any, *, dt: Any, samples: Any, learns: Any) -> Any:
    """Return the next state (2, 1 + edges): largest slip [rad], then time above `EDGES` [s].

    Parameters
    ----------
    state : before the sample.
    size : of slip [rad], (2,).
    dt : sampling interval [s].
    samples : in which errors are correlated: one alone does not make a range known.
    learns : 1 where the axle learns, else 0, (2,).
    """
    largest = state[:, 0]
    largest += learns * smaller(1, 1 / samples) * larger(size - largest, 0)
    spent = dt * learns
    times = [state[:, 1 + k] + spent * (size >= edge) for k, edge in enumerate(EDGES)]
    return ca.horzcat(largest, *times)
