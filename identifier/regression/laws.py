"""The laws by name: two kinds of statistics with two ways down, and least squares."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from codegen.arrays import Array

# How recursive least squares forgets: what becomes of P (n_h, n_h) [1/s] after each pair.
#
# keep = exp(-λ T) <= 1. P is the inverse of the information; forgetting makes it larger.

Forgetting = Callable[[Any, Any, Any, Any], Any]


def exponential(P: Any, s: Any, keep: Any, bound: Any) -> Any:
    """Forget everything at one rate: P grows without bound where s does not excite; (n_h, n_h).

    Parameters
    ----------
    P : after the pair (n_h, n_h).
    keep : exp(-λ T).
    """
    del s, bound
    return P / keep


def bounded_trace(P: Any, s: Any, keep: Any, bound: Any) -> Any:
    """Forget everything at one rate, as far as trace(P) stays within its bound; (n_h, n_h).

    Parameters
    ----------
    P : after the pair (n_h, n_h).
    keep : exp(-λ T).
    bound : largest trace [1/s].
    """
    del s
    return P * ca.fmin(1 / keep, ca.fmax(1, bound / ca.trace(P)))


def directional(P: Any, s: Any, keep: Any, bound: Any) -> Any:
    """Forget only along s, what the new pair can replace, within the bound; (n_h, n_h).

    Kulhavý's P⁻¹ + β s sᵀ T, β = keep - (1 - keep)/(sᵀ P s T), with P before the pair, reads in P
    after it as a growth by 1/keep of what s sees, P s; what s does not see stays as it is.

    Parameters
    ----------
    P : after the pair (n_h, n_h).
    s : regressor (n_h,).
    keep : exp(-λ T).
    bound : largest trace [1/s].
    """
    Ps = P @ s
    variance = ca.fmax(s.T @ Ps, 1e-300)  # s = 0: nothing is seen, nothing grows
    room = ca.fmax(0, bound - ca.trace(P)) * variance / ca.fmax(ca.sumsqr(Ps), 1e-300)
    return P + ca.fmin(1 / keep - 1, room) * (Ps @ Ps.T) / variance


# Symmetric positive definite matrices in straight-line code, without pivots or branches.


def symmetric(A: Any) -> Any:
    """Return the matrix that has the upper triangle of A on both sides, symmetric to the bit.

    What only the lower triangle would have needed is then not computed.

    Parameters
    ----------
    A : symmetric up to round-off (n, n).
    """
    return ca.triu2symm(ca.triu(A))


def whiten(A: Any, right: Any) -> Any:
    """Return R⁻ᵀ B with Rᵀ R = A, so that its columns have the inner products Bᵀ A⁻¹ B; (n, m).

    Parameters
    ----------
    A : positive definite (n, n).
    right : B (n, m).
    """
    return ca.solve(ca.chol(A).T, right)


def solve_definite(A: Any, right: Any) -> Any:
    """Return A⁻¹ B by Cholesky; (n, m).

    Parameters
    ----------
    A : positive definite (n, n).
    right : B (n, m).
    """
    return ca.solve(ca.chol(A), whiten(A, right))


# The filtered regression y = W s of dξ/dt = b + W σ: the residual force without a derivative.
#
# ξ (2,) [U s]: axle impulse.   b = A_ξ ξ + B_ξ u (2,) [U]: its rate without the network. σ (n_h,)
# [-]: hidden layer.   κ [1/s]: rate of the filters.   U: force unit. In the Laplace domain y = κ/(s
# + κ) (s ξ - b) and s = κ/(s + κ) σ, so that y = W s for a constant W; s ξ is never formed, since κ
# s/(s + κ) ξ = κ (ξ - ξ_f).
#
# Sampled at T, with e = exp(-κ T) and the mean of b and σ over a step by the trapezoidal rule,
#     s⁺ = e s + (1 - e) (σ + σ⁺)/2,     y⁺ = e y + (1 - e) [(ξ⁺ - ξ)/T - (b + b⁺)/2].
# The mean of dξ/dt over a step is (ξ⁺ - ξ)/T whatever it does in between: only the trapezoidal rule
# is approximate (T²), and where it holds, y = W s holds to round-off. `target_lag` and
# `regressor_lag` are what both recursions carry, chosen such that no difference of samples is
# taken.


class Pair(NamedTuple):
    """One sample of y = W s + error: regressor s (n_h,) [-] and target y (2,) [U]."""

    s: Any
    y: Any


class Lags(NamedTuple):
    """What the filters carry: target_lag (2,) [U] and regressor_lag (n_h,) [-]."""

    target_lag: Any
    regressor_lag: Any


def filtered_pair(
    lags: Lags, fresh: Any, *, xi: Any, b: Any, sigma: Any, filter_rate: Any, dt: Any
) -> tuple[Pair, Lags]:
    """Return the pair of this sample and the lags of the next.

    Parameters
    ----------
    fresh : not zero where nothing was carried: the filters then begin here, at y = 0 and s = 0.
    xi : axle impulse (2,) [U s].
    b : rate of ξ that is known, A_ξ ξ + B_ξ u (2,) [U].
    sigma : hidden layer (n_h,).
    filter_rate : κ [1/s].
    dt : sampling interval T [s].
    """
    e = ca.exp(-filter_rate * dt)
    c, half = (1 - e) / dt, (1 - e) / 2
    p = ca.if_else(fresh, c * xi - half * b, lags.target_lag)
    q = ca.if_else(fresh, -half * sigma, lags.regressor_lag)
    pair = Pair(s=q + half * sigma, y=c * xi - p - half * b)
    next_lags = Lags(
        target_lag=e * p + c * (1 - e) * xi + (1 + e) * half * b,
        regressor_lag=e * q + (1 + e) * half * sigma,
    )
    return pair, next_lags


# A memory of M pairs that excite the most: a new pair takes the place that gains the most.
#
# S (n_h, M) and Z (2, M) [U]: stored regressors and targets, zero where nothing is stored yet.
# Excitation is the determinant of G = ω S Sᵀ + δ I, ω [s] being what one pair counts for. s in the
# place of s_j multiplies it by (1 + a)(1 - b_j) + c_j², with a = ω sᵀ G⁻¹ s, b_j = ω s_jᵀ G⁻¹ s_j
# and c_j = ω s_jᵀ G⁻¹ s. For an empty place that is 1 + a, which no stored pair can exceed: the
# memory fills first.

WORTH = 1.01  # a pair is stored where it multiplies the determinant by more than this


class Memory(NamedTuple):
    """Stored regressors S (n_h, M) and targets Z (2, M) [U]."""

    S: Any
    Z: Any


def determinant_gains(S: Any, s: Any, weight: Any, ridge: Any) -> Any:
    """Return by what the determinant would be multiplied, for s in each of the M places; (M,).

    Parameters
    ----------
    S : stored regressors (n_h, M).
    s : the new one (n_h,).
    weight : ω [s].
    ridge : δ [s].
    """
    G = weight * symmetric(S @ S.T) + ridge * ca.SX.eye(S.shape[0])
    whitened = whiten(G, ca.sqrt(weight) * ca.horzcat(S, s))
    stored, new = whitened[:, :-1], whitened[:, -1]
    b, c = ca.sum1(stored**2).T, stored.T @ new
    return (1 + ca.sumsqr(new)) * (1 - b) + c**2


def remember(memory: Memory, pair: Pair, *, weight: Any, ridge: Any, allowed: Any) -> Memory:
    """Return the memory with the pair in its best place, or unchanged where it is not worth it.

    Parameters
    ----------
    memory : S and Z.
    weight : what one pair counts for, ω [s].
    ridge : δ [s].
    allowed : zero where nothing may be stored.
    """
    gains = determinant_gains(memory.S, pair.s, weight, ridge)
    best, place = gains[0], 0
    for j in range(1, gains.numel()):
        better = gains[j] > best
        best, place = ca.if_else(better, gains[j], best), ca.if_else(better, j, place)
    stored = ca.logic_and(allowed, best > WORTH)
    columns = range(memory.S.shape[1])
    here = ca.horzcat(*(ca.logic_and(stored, place == j) for j in columns))
    return Memory(
        S=memory.S + (pair.s - memory.S) * ca.repmat(here, memory.S.shape[0], 1),
        Z=memory.Z + (pair.y - memory.Z) * ca.repmat(here, memory.Z.shape[0], 1),
    )


# What a law is: where its statistics start, and how one pair moves them and the weights.
#
# W (2, n_h) [U]: weights.   s (n_h,), y (2,) [U]: the pair of `filtered`.   U: force unit.

State = Mapping[str, Any]


class Numbers(NamedTuple):
    """The numbers of a law, CasADi symbols inside the step.

    filter_rate: κ [1/s].   forgetting: λ [1/s].   learning_rate: η [1/s].   ridge: δ [s], the
    information in seconds of |s| = 1 that the first weights count for.   quiet: learning rests
    where the root mean square of s is below [-].   W_max: radius of the projection [U].
    """

    filter_rate: Any
    forgetting: Any
    learning_rate: Any
    ridge: Any
    quiet: Any
    W_max: Any


class Weights(NamedTuple):
    """Weights now, and those that the law falls back to where it knows nothing; both (2, n_h)."""

    now: Any
    first: Any


class Law(NamedTuple):
    """A law: `start(n_h, memory, ridge)` and `update(state, weights, pair, numbers, ahead)`.

    `start` returns the statistics by name, before any pair. `update` returns the statistics and W
    after this pair; `ahead` is T_s [s], or 0 where learning rests and nothing may change.
    """

    start: Callable[[int, int, float], dict[str, Array]]
    update: Callable[[State, Weights, Pair, Numbers, Any], tuple[dict[str, Any], Any]]


# Recursive least squares on y = W s, with the way of forgetting as an argument.
#
# P (n_h, n_h) [1/s] is the inverse of the information Ω + δ I of `descent`, carried instead of
# solved for; without forgetting W is the ridge regression of all pairs so far, ridge δ about W_0.


def start_squares(n_h: int, memory: int, ridge: float) -> dict[str, Array]:
    """Return P = I/δ.

    Parameters
    ----------
    n_h : number of hidden units.
    ridge : δ [s].
    """
    del memory
    return {"P": np.eye(n_h) / ridge}


def update_squares(
    state: State, weights: Weights, pair: Pair, numbers: Numbers, ahead: Any, *, forget: Forgetting
) -> tuple[dict[str, Any], Any]:
    """Return P and W after a pair; the trace of P is never let grow above that of the start.

    Parameters
    ----------
    state : P.
    weights : W now; what W was at the start is in it already.
    numbers : of the law; the learning rate is not read.
    ahead : T_s [s], or 0 where learning rests.
    """
    P, W, (s, y) = state["P"], weights.now, pair
    gain = ahead * P @ s / (1 + ahead * s.T @ P @ s)
    keep, bound = ca.exp(-numbers.forgetting * ahead), P.shape[0] / numbers.ridge
    W_next = W + (y - W @ s) @ gain.T
    P_next = forget(symmetric(P - gain @ (P @ s).T), s, keep, bound)
    return {"P": symmetric(P_next)}, W_next


def least_squares(forget: Forgetting) -> Law:
    """Return the law."""
    return Law(start=start_squares, update=partial(update_squares, forget=forget))


# Two ways down the quadratic cost J(W) = tr[W Ω Wᵀ/2 - W Yᵀ] + δ |W - W_0|²/2.
#
# Ω (n_h, n_h) [s]: information.   Y (2, n_h) [U s].   δ [s]: ridge.   W_0: weights at the start.
# For Ω = Σ s sᵀ T and Y = Σ y sᵀ T this is the cost Σ |y - W s|² T/2, up to a constant. The ridge
# is the leakage: with no information left, W returns to W_0. `share` = 1 - exp(-η T) is in [0, 1)
# for every η, and neither step can overshoot.

Descent = Callable[[Weights, Any, Any, Any, Any], Any]


def gradient(weights: Weights, Omega: Any, Y: Any, ridge: Any, share: Any) -> Any:
    """Return W after a step against dJ/dW, normalized by trace(Ω + δ I); (2, n_h).

    Parameters
    ----------
    weights : W and W_0, (2, n_h).
    Omega : information (n_h, n_h).
    Y : (2, n_h).
    ridge : δ, positive.
    share : of the way along the steepest direction there can be.
    """
    W, W_0 = weights
    slope = W @ Omega - Y + ridge * (W - W_0)
    return W - share * slope / (ca.trace(Omega) + Omega.shape[0] * ridge)


def newton(weights: Weights, Omega: Any, Y: Any, ridge: Any, share: Any) -> Any:
    """Return W after going a share of the way to the minimum, weighted least squares; (2, n_h).

    Parameters
    ----------
    weights : W and W_0, (2, n_h).
    Omega : information (n_h, n_h).
    Y : (2, n_h).
    ridge : δ, positive: Ω + δ I is then positive definite.
    """
    W, W_0 = weights
    minimum = solve_definite(Omega + ridge * ca.SX.eye(Omega.shape[0]), (Y + ridge * W_0).T).T
    return W - share * (W - minimum)


# Kreisselmeier's statistics: with them the exact gradient of the paper's cost (9) is at hand.
#
# J = ∫ exp(-λ (t - τ)) |y(τ) - W s(τ)|²/2 dτ for the weights of *now*, not those of τ, has the
# gradient dJ/dW = W Ω - Y with dΩ/dt = -λ Ω + s sᵀ and dY/dt = -λ Y + y sᵀ. The integral law (11)
# takes the regressor out of the integral and so lags; this one does not. Sampled: Ω⁺ = exp(-λ T) Ω
# + T s sᵀ, exactly the gradient of Σ exp(-λ T (k - j)) |y_j - W s_j|² T/2.


def start_averages(n_h: int, memory: int, ridge: float) -> dict[str, Array]:
    """Return no information: Omega = 0 (n_h, n_h) [s] and Y = 0 (2, n_h) [U s].

    Parameters
    ----------
    n_h : number of hidden units.
    """
    del memory, ridge
    return {"Omega": np.zeros((n_h, n_h)), "Y": np.zeros((2, n_h))}


def update_averages(
    state: State, weights: Weights, pair: Pair, numbers: Numbers, ahead: Any, *, descent: Descent
) -> tuple[dict[str, Any], Any]:
    """Return statistics and W after a pair.

    Parameters
    ----------
    state : Omega and Y.
    weights : W now and at the start.
    ahead : T_s [s], or 0 where learning rests.
    """
    keep, share = ca.exp(-numbers.forgetting * ahead), 1 - ca.exp(-numbers.learning_rate * ahead)
    Omega = symmetric(keep * state["Omega"] + ahead * pair.s @ pair.s.T)
    Y = keep * state["Y"] + ahead * pair.y @ pair.s.T
    return {"Omega": Omega, "Y": Y}, descent(weights, Omega, Y, numbers.ridge, share)


def kreisselmeier(descent: Descent) -> Law:
    """Return the law.

    Parameters
    ----------
    descent : the way down the cost, `gradient` or `newton`.
    """
    return Law(start=start_averages, update=partial(update_averages, descent=descent))


# Concurrent learning: the present pair and a memory of exciting ones, learnt from together.
#
# Ω = ω (S Sᵀ + s sᵀ) and Y = ω (Z Sᵀ + y sᵀ), ω = 1/κ: a filtered pair stands for the time its
# filter looks back. Stored pairs fade, s_j and y_j alike, so that y_j = W s_j stays true while a
# newer pair takes the place of an old one more easily.


def start_memory(n_h: int, memory: int, ridge: float) -> dict[str, Array]:
    """Return an empty memory: S = 0 (n_h, M) and Z = 0 (2, M).

    Parameters
    ----------
    n_h : number of hidden units.
    memory : number of places M.
    """
    del ridge
    return {"S": np.zeros((n_h, memory)), "Z": np.zeros((2, memory))}


def update_memory(
    state: State, weights: Weights, pair: Pair, numbers: Numbers, ahead: Any, *, descent: Descent
) -> tuple[dict[str, Any], Any]:
    """Return memory and W after a pair.

    Parameters
    ----------
    state : S and Z.
    weights : W now and at the start.
    numbers : of the law; the forgetting is the rate at which the weight of a stored pair fades.
    ahead : T_s [s], or 0 where learning rests.
    """
    weight, fade = 1 / numbers.filter_rate, ca.exp(-numbers.forgetting * ahead / 2)
    S, Z = fade * state["S"], fade * state["Z"]
    Omega = weight * (symmetric(S @ S.T) + symmetric(pair.s @ pair.s.T))
    Y = weight * (Z @ S.T + pair.y @ pair.s.T)
    share = 1 - ca.exp(-numbers.learning_rate * ahead)
    memory = remember(Memory(S, Z), pair, weight=weight, ridge=numbers.ridge, allowed=ahead > 0)
    return memory._asdict(), descent(weights, Omega, Y, numbers.ridge, share)


def concurrent(descent: Descent) -> Law:
    """Return the law.

    Parameters
    ----------
    descent : the way down the cost, `gradient` or `newton`.
    """
    return Law(start=start_memory, update=partial(update_memory, descent=descent))


LAWS: Mapping[str, Law] = {
    "kreisselmeier": kreisselmeier(gradient),
    "kreisselmeier_newton": kreisselmeier(newton),
    "rls": least_squares(directional),
    "rls_bounded_trace": least_squares(bounded_trace),
    "rls_exponential": least_squares(exponential),  # for comparison: its P is not bounded
    "concurrent": concurrent(gradient),
    "concurrent_newton": concurrent(newton),
}
