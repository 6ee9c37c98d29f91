"""One step of an ordinary differential equation, with its inputs held over the step."""

from collections.abc import Callable, Mapping
from typing import Any

Derivative = Callable[[list[Any]], list[Any]]
Projection = Callable[[list[Any]], list[Any]]
Integrator = Callable[[Derivative, list[Any], Any, Projection], list[Any]]


def _ahead(state: list[Any], rate: list[Any], h: Any) -> list[Any]:
    return [s + h * r for s, r in zip(state, rate, strict=True)]


def free(state: list[Any]) -> list[Any]:
    """Return the state as it is: nothing bounds it.

    Parameters
    ----------
    state : parts of the state.
    """
    return state


def euler(
    derivative: Derivative, state: list[Any], dt: Any, project: Projection = free
) -> list[Any]:
    """Return the state one explicit Euler step later.

    Parameters
    ----------
    derivative : time derivative of each part of the state.
    state : parts of the state, matrices of any shape.
    dt : step [s].
    project : puts a state back within its bounds; Euler has no inner stage that needs it.
    """
    del project
    return _ahead(state, derivative(state), dt)


def rk4(derivative: Derivative, state: list[Any], dt: Any, project: Projection = free) -> list[Any]:
    """Return the state one classical fourth-order Runge-Kutta step later.

    The inner stages are projected: else a high gain leaves the bounds within the step, and the
    slopes there carry it beyond them.

    Parameters
    ----------
    derivative : time derivative of each part of the state.
    state : parts of the state, matrices of any shape.
    dt : step [s].
    project : puts a state back within its bounds.
    """
    k1 = derivative(state)
    k2 = derivative(project(_ahead(state, k1, dt / 2)))
    k3 = derivative(project(_ahead(state, k2, dt / 2)))
    k4 = derivative(project(_ahead(state, k3, dt)))
    mean = [(a + 2 * b + 2 * c + d) / 6 for a, b, c, d in zip(k1, k2, k3, k4, strict=True)]
    return _ahead(state, mean, dt)


INTEGRATORS: Mapping[str, Integrator] = {"euler": euler, "rk4": rk4}
