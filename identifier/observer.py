"""The series-parallel observer (8), the error filter (10), and where the network reads the state.

ξ, ξ̂ [U s]: axle impulse, measured and estimated.   u = [δ_f, δ_r] [rad].   f̂ [U]: network output.
"""

from collections.abc import Callable, Mapping
from typing import Any

InputSource = Callable[[Any, Any], Any]


def observer_rate(A_d: Any, A_xi: Any, B_xi: Any, xi: Any, xi_hat: Any, u: Any, f_hat: Any) -> Any:
    """Return dξ̂/dt of (8), (2,) [U].

    Parameters
    ----------
    A_d : Hurwitz matrix (2, 2) [1/s].
    A_xi : A_ξ of (7) at the present speed (2, 2) [1/s].
    B_xi : B_ξ of (7) (2, 2) [U/rad].
    xi : measured axle impulse (2,).
    xi_hat : estimated axle impulse (2,).
    u : steering (2,) [rad].
    f_hat : network output (2,) [U].
    """
    return A_d @ xi_hat + (A_xi @ xi + B_xi @ u - A_d @ xi) + f_hat  # (8)


def filter_rate(forgetting: Any, z: Any, xi_tilde: Any) -> Any:
    """Return dz/dt of (10), (2,) [U s].

    Parameters
    ----------
    forgetting : λ [1/s].
    z : filtered error (2,) [U s²].
    xi_tilde : error (2,) [U s].
    """
    return -forgetting * z + xi_tilde  # (10)


def measured(xi: Any, xi_hat: Any) -> Any:
    """Read the network's input from the measured state, which opens the loop through x̂.

    Parameters
    ----------
    xi : measured axle impulse (2,).
    xi_hat : estimated axle impulse (2,).
    """
    del xi_hat
    return xi


def estimated(xi: Any, xi_hat: Any) -> Any:
    """Read the network's input from the estimated state, as (8) prints it.

    It closes a loop: A_d must then be fast against the slope of the tire.

    Parameters
    ----------
    xi : measured axle impulse (2,).
    xi_hat : estimated axle impulse (2,).
    """
    del xi
    return xi_hat


INPUT_SOURCES: Mapping[str, InputSource] = {"measured": measured, "estimated": estimated}
