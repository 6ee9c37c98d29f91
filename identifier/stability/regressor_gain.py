"""How large the loop gain G is: at the worst regressor, and along a recorded run.

G = η_W |s|² I + η_V |x_bar|² W (I - Λ)² Wᵀ, with s = tanh(V x_bar), Λ = diag(s²) of (13):
what one unit of A_d⁻ᵀ z moves the network's output p per second through (11) and (12).
Units: with the force unit U, z in U s² and A_d⁻¹ in s, p' in U/s asks for G and eta_W in 1/s⁴ for
the integral law (1/s³ for the instantaneous one) and for eta_V in 1/(U² s⁴) (1/(U² s³)).
"""

import math

import numpy as np
import numpy.typing as npt

from identifier.stability.lyapunov import Matrix


def worst_gain(
    *, eta_W: float, eta_V: float, n_h: int, x_bar_max: float = 0.0, W_max: float = 0.0
) -> float:
    """(n_h - 1) η_W + max(η_W, η_V x_bar_max² W_max²): no regressor, no |W| <= W_max exceeds it.

    A unit i adds η_W u + η_V |x_bar|² |W_i|² (1 - u)² with u = s_i² in [0, 1], convex in u and in
    W: the worst is at a corner, where every unit is saturated but perhaps the one that holds all
    of W. So V learns at no cost in margin while η_V x_bar_max² W_max² <= η_W.

    Parameters
    ----------
    eta_W : learning rate of (11).
    eta_V : learning rate of (12).
    n_h : hidden units; |s|² <= n_h.
    x_bar_max : bound on |x_bar|.
    W_max : bound on |W| (Frobenius) [U]; needed where V learns.

    Raises
    ------
    ValueError
        If a value is negative, or V learns and x_bar_max or W_max is missing or infinite.
    """
    if not (eta_W >= 0.0 and eta_V >= 0.0 and n_h >= 1):
        raise ValueError(f"eta_W, eta_V >= 0 and n_h >= 1, they are {(eta_W, eta_V, n_h)}")
    through_V = 0.0
    if eta_V > 0.0:
        through_V = eta_V * x_bar_max**2 * W_max**2
        if not (x_bar_max > 0.0 and W_max > 0.0 and math.isfinite(through_V)):
            raise ValueError(f"where V learns, give x_bar_max and W_max: {(x_bar_max, W_max)}")
    return (n_h - 1) * eta_W + max(eta_W, through_V)


def regressor_gains(
    *,
    eta_W: float,
    eta_V: float,
    s: npt.ArrayLike,
    x_bar: npt.ArrayLike,
    W: npt.ArrayLike,
) -> Matrix:
    """G along a run, (n, 2, 2).

    Parameters
    ----------
    eta_W : learning rate of (11).
    eta_V : learning rate of (12).
    s : (n, n_h) hidden units tanh(V x_bar).
    x_bar : (n, n_in) network input.
    W : (n, 2, n_h) or (2, n_h) output weights [U].

    Raises
    ------
    ValueError
        If the shapes disagree.
    """
    s, x_bar, W = np.atleast_2d(s), np.atleast_2d(x_bar), np.asarray(W, dtype=np.float64)
    n, n_h = s.shape
    if x_bar.shape[0] != n or W.shape[-2:] != (2, n_h) or (W.ndim == 3 and W.shape[0] != n):
        raise ValueError(f"shapes disagree: s {s.shape}, x_bar {x_bar.shape}, W {W.shape}")
    slope = np.broadcast_to(W, (n, 2, n_h)) * (1.0 - s**2)[:, None, :]  # W (I - Λ)
    through_W = eta_W * np.sum(s**2, axis=1)[:, None, None] * np.eye(2)
    through_V = eta_V * np.sum(x_bar**2, axis=1)[:, None, None]
    gains: Matrix = through_W + through_V * (slope @ slope.transpose(0, 2, 1))
    return gains


def strongest(gains: npt.ArrayLike) -> tuple[int, float]:
    """Index of the sample with the largest λ_max(G), and that value.

    Parameters
    ----------
    gains : (n, 2, 2) loop gains along a run.
    """
    largest = np.linalg.eigvalsh(np.asarray(gains))[:, -1]
    worst = int(np.argmax(largest))
    return worst, float(largest[worst])
