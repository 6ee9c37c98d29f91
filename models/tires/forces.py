"""What every tire answers, and the guards they share.

Wheel frame: x forward along the wheel, y to the left, z up. α has the paper's sign, the negative
of ISO 8855: F_y = +C α. κ = (ω R - V_x)/|V_x| > 0 when driving. γ > 0 turns about +x: the top of
the wheel leans to the right.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol, TypeAlias

import casadi as ca

from models.rules import Positive

_ROLLING_FLOOR = 1e-3  # 1 + κ of a locked wheel: slides in the same direction, divides by no zero
_COSINE_FLOOR = 1e-3  # |cos α| of a wheel that moves sideways
NO_FORCE = 1e-6  # N; rounds the root of a sum of squares at zero, so that its derivative exists


Expression: TypeAlias = Any  # float, casadi.DM, SX or MX; CasADi has no stubs


class TireForces(NamedTuple):
    """The force of the road on one wheel, in the wheel frame.
    F_x : longitudinal force, > 0 drives [N].   F_y : lateral force, > 0 to the left [N].
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
        alpha : slip angle, paper's sign [rad].   kappa : longitudinal slip [-].
        gamma : camber [rad].   F_z : wheel load [N]; no force at F_z <= 0.
        mu : friction of the road over that of the measurement [-].
        """
        ...

    def slip_stiffness(self, F_z: Expression) -> Expression:
        """∂F_x/∂κ at zero slip and camber [N].   F_z : wheel load [N]."""
        ...

    def cornering_stiffness(self, F_z: Expression) -> Expression:
        """∂F_y/∂α at zero slip and camber [N/rad].   F_z : wheel load [N]."""
        ...


def positive(x: Expression) -> Expression:
    """The number where it is above 0, else 0; NaN stays NaN, which fmax(x, 0) would hide.
    x : any number; for a wheel load [N], 0 means lifted off: a tire cannot pull.
    """
    return x * (x > 0)


def smaller(a: Expression, b: Expression) -> Expression:
    """The smaller of two finite numbers; NaN stays NaN, which fmin(a, b) would hide."""
    return a * (a <= b) + b * (b < a)


def folded(alpha: Expression) -> Expression:
    """The slip angle against the line of travel, in [-π/2, π/2] [rad].

    tan α is the sideways over the absolute forward speed, so a wheel that rolls backwards, with
    |α| > π/2, slips by π - α.
    alpha : slip angle [rad], any real number.
    """
    return ca.atan2(ca.sin(alpha), ca.fabs(ca.cos(alpha)))


# The slip of a tread element, common to the brush tires.
#
# σ = [κ, tan α]/(1 + κ): sliding over rolling speed (Pacejka, Tyre and Vehicle Dynamics, ch. 3).


class Slips(NamedTuple):
    """The demand of a tread that never slides, and the speed it refers to.
    p_x, p_y : C_κ κ and C_α tan α [N].   size : length of (p_x, p_y) [N], never zero.
    rolling : 1 + κ, rolling over forward speed [-], never zero.
    """

    p_x: Expression
    p_y: Expression
    size: Expression
    rolling: Expression


# What tires share whose stiffness is the same at every load.


@dataclass(frozen=True, slots=True, kw_only=True)
class ConstantStiffness(Positive):
    """A tire with stiffnesses that do not depend on load.
    C_alpha : cornering stiffness of one tire [N/rad], > 0, at every load.
    C_kappa : longitudinal slip stiffness of one tire [N], > 0, at every load.
    """

    C_alpha: float
    C_kappa: float

    def slip_stiffness(self, F_z: Expression) -> Expression:
        """∂F_x/∂κ at zero slip [N]: C_κ, and 0 in the air.   F_z : wheel load [N]."""
        return self.C_kappa * (F_z > 0)

    def cornering_stiffness(self, F_z: Expression) -> Expression:
        """∂F_y/∂α at zero slip [N/rad]: C_α, and 0 in the air.   F_z : wheel load [N]."""
        return self.C_alpha * (F_z > 0)


@dataclass(frozen=True, slots=True, kw_only=True)
class BrushTire(ConstantStiffness):
    """A tire of constant stiffness whose force points along the demand of its tread.
    friction : friction coefficient of the tire as measured [-], > 0.
    """

    friction: float

    def per_demand(self, s: Slips, F_z: Expression, mu: Expression) -> Expression:
        """Force over the demand of a tread that never slides [-]."""
        raise NotImplementedError

    def forces(
        self,
        alpha: Expression,
        kappa: Expression,
        gamma: Expression,
        F_z: Expression,
        mu: Expression = 1.0,
    ) -> TireForces:
        """Longitudinal and lateral force in the wheel frame [N].
        kappa : longitudinal slip [-]; below -1 the wheel counts as locked.
        gamma : camber [rad]; without effect.
        """
        del gamma
        p_x = self.C_kappa * kappa
        p_y = self.C_alpha * (ca.sin(alpha) / ca.fmax(ca.fabs(ca.cos(alpha)), _COSINE_FLOOR))
        size = ca.sqrt(p_x**2 + p_y**2 + NO_FORCE**2)
        s = Slips(p_x, p_y, size, ca.fmax(1.0 + kappa, _ROLLING_FLOOR))
        per_demand = self.per_demand(s, F_z, mu)
        return TireForces(s.p_x * per_demand, s.p_y * per_demand)
