"""What every tire answers, and the guards they share.

Wheel frame: x forward along the wheel, y to the left, z up. α has the paper's sign, the negative
of ISO 8855: F_y = +C α. κ = (ω R - V_x)/|V_x| > 0 when driving. γ > 0 turns about +x: the top of
the wheel leans to the right.
"""

from typing import Any, NamedTuple, Protocol, TypeAlias

import casadi as ca

Expression: TypeAlias = Any  # float, casadi.DM, SX or MX; CasADi has no stubs


class TireForces(NamedTuple):
    """The force of the road on one wheel, in the wheel frame.

    Attributes
    ----------
    F_x : longitudinal force, > 0 drives [N].
    F_y : lateral force, > 0 to the left [N].
    """

    F_x: Expression
    F_y: Expression


class Tire(Protocol):
    """A steady-state tire: slips, camber and load in, forces out.

    Floats in give floats out; casadi.DM, SX and MX give their own type, elementwise for vectors.
    """

    def forces(
        self,
        alpha: Expression,
        kappa: Expression,
        gamma: Expression,
        F_z: Expression,
        mu: Expression = 1.0,
    ) -> TireForces:
        """Longitudinal and lateral force in the wheel frame [N].

        Parameters
        ----------
        alpha : slip angle, paper's sign [rad].
        kappa : longitudinal slip [-].
        gamma : camber [rad].
        F_z : wheel load [N]; no force at F_z <= 0.
        mu : friction of the road over that of the measurement [-].
        """
        ...

    def slip_stiffness(self, F_z: Expression) -> Expression:
        """∂F_x/∂κ at zero slip and camber [N].

        Parameters
        ----------
        F_z : wheel load [N].
        """
        ...

    def cornering_stiffness(self, F_z: Expression) -> Expression:
        """∂F_y/∂α at zero slip and camber [N/rad].

        Parameters
        ----------
        F_z : wheel load [N].
        """
        ...


def positive(x: Expression) -> Expression:
    """The number where it is above 0, else 0; NaN stays NaN, which fmax(x, 0) would hide.

    Parameters
    ----------
    x : any number; for a wheel load [N], 0 means lifted off: a tire cannot pull.
    """
    return x * (x > 0)


def smaller(a: Expression, b: Expression) -> Expression:
    """The smaller of two finite numbers; NaN stays NaN, which fmin(a, b) would hide.

    Parameters
    ----------
    a, b : the numbers.
    """
    return a * (a <= b) + b * (b < a)


def folded(alpha: Expression) -> Expression:
    """The slip angle against the line of travel, in [-π/2, π/2] [rad].

    tan α is the sideways over the absolute forward speed, so a wheel that rolls backwards, with
    |α| > π/2, slips by π - α.

    Parameters
    ----------
    alpha : slip angle [rad], any real number.
    """
    return ca.atan2(ca.sin(alpha), ca.fabs(ca.cos(alpha)))
