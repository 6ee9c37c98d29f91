"""Symmetric positive definite matrices in straight-line code, without pivots or branches."""

from typing import Any

import casadi as ca


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
