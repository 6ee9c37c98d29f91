"""What lies between two samples of a line, from their values, slopes and second derivatives."""

from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias

Pair: TypeAlias = tuple[Any, Any]  # at both ends of a step, numbers or arrays


class Ends(NamedTuple):
    """Both ends of a step: X, Y [m], ψ [rad], κ [1/m]; numbers, or arrays for many steps."""

    X: Pair
    Y: Pair
    psi: Pair
    kappa: Pair

    def between(
        self, u: Any, h: float, cos: Callable[[Any], Any], sin: Callable[[Any], Any]
    ) -> tuple[Any, Any, Any, Any]:
        """Return X, Y [m], ψ [rad], κ [1/m] inside the step.

        Parameters
        ----------
        u : place in the step, 0 to 1 [-].
        h : length of the step [m].
        cos : cosine, for what the ends are made of.
        sin : sine.
        """
        (psi_0, psi_1), (kappa_0, kappa_1) = self.psi, self.kappa
        cos_0, cos_1, sin_0, sin_1 = cos(psi_0), cos(psi_1), sin(psi_0), sin(psi_1)
        return (
            quintic(u, h, self.X, (cos_0, cos_1), (-kappa_0 * sin_0, -kappa_1 * sin_1)),
            quintic(u, h, self.Y, (sin_0, sin_1), (kappa_0 * cos_0, kappa_1 * cos_1)),
            cubic(u, h, self.psi, self.kappa),
            kappa_0 + u * (kappa_1 - kappa_0),
        )


def cubic(u: Any, h: float, p: Pair, d: Pair) -> Any:
    """Return the cubic that has values and slopes given at both ends of a step.

    Parameters
    ----------
    u : place in the step, 0 to 1 [-].
    h : length of the step.
    p : values at u = 0 and 1.
    d : slopes there, per unit of h.
    """
    chord = p[1] - p[0]
    bend_0, bend_1 = h * d[0] - chord, chord - h * d[1]
    return p[0] + u * chord + u * (1.0 - u) * ((1.0 - u) * bend_0 + u * bend_1)


def quintic(u: Any, h: float, p: Pair, d: Pair, dd: Pair) -> Any:
    """Return the quintic that has values, slopes and second derivatives given at both ends.

    Parameters
    ----------
    u : place in the step, 0 to 1 [-].
    h : length of the step.
    p : values at u = 0 and 1.
    d : slopes there, per unit of h.
    dd : second derivatives there, per unit of h².
    """
    chord = p[1] - p[0]
    bend_0, bend_1 = h * d[0] - chord, chord - h * d[1]
    more_0 = 0.5 * h * h * dd[0] + 2.0 * bend_0 - bend_1  # beyond those of the cubic
    more_1 = 0.5 * h * h * dd[1] - bend_0 + 2.0 * bend_1
    lack = u * (1.0 - u) * ((1.0 - u) * more_0 + u * more_1)
    return cubic(u, h, p, d) + u * (1.0 - u) * lack
