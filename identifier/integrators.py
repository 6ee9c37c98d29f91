"""One step of an ordinary differential equation, with its inputs held over the step."""

from collections.abc import Callable, Mapping
from typing import Any

Derivative = Callable[[list[Any]], list[Any]]
Integrator = Callable[[Derivative, list[Any], Any], list[Any]]


def _ahead(state: list[Any], rate: list[Any], h: Any) -> list[Any]:
    return [s + h * r for s, r in zip(state, rate, strict=True)]


def euler(derivative: Derivative, state: list[Any], dt: Any) -> list[Any]:
    """Return the state one explicit Euler step later.

    Parameters
    ----------
    derivative : time derivative of each part of the state.
    state : parts of the state, matrices of any shape.
    dt : step [s].
    """
    return _ahead(state, derivative(state), dt)


def rk4(derivative: Derivative, state: list[Any], dt: Any) -> list[Any]:
    """Return the state one classical fourth-order Runge-Kutta step later.

    Parameters
    ----------
    derivative : time derivative of each part of the state.
    state : parts of the state, matrices of any shape.
    dt : step [s].
    """
    k1 = derivative(state)
    k2 = derivative(_ahead(state, k1, dt / 2))
    k3 = derivative(_ahead(state, k2, dt / 2))
    k4 = derivative(_ahead(state, k3, dt))
    mean = [(a + 2 * b + 2 * c + d) / 6 for a, b, c, d in zip(k1, k2, k3, k4, strict=True)]
    return _ahead(state, mean, dt)


INTEGRATORS: Mapping[str, Integrator] = {"euler": euler, "rk4": rk4}
