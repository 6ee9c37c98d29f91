"""Tires of few numbers: the linear one, Fiala's brush, Dugoff's hyperbola."""

from models.tires.forces import (
    NO_FORCE,
    BrushTire,
    ConstantStiffness,
    Expression,
    Slips,
    TireForces,
    positive,
    smaller,
)


class LinearTire(ConstantStiffness):
    """F_x = C_κ κ, F_y = C_α α while the wheel touches the ground.

    Load only decides about contact; friction and camber do nothing: no limit, by definition.
    Stiffnesses are those of `ConstantStiffness`.
    """

    __slots__ = ()

    def forces(
        self,
        alpha: Expression,
        kappa: Expression,
        gamma: Expression,
        F_z: Expression,
        mu: Expression = 1.0,
    ) -> TireForces:
        """Longitudinal and lateral force in the wheel frame [N].
        gamma : camber [rad]; without effect.
        mu : friction of the road over that of the measurement [-]; without effect.
        """
        del gamma, mu
        return TireForces(self.slip_stiffness(F_z) * kappa, self.cornering_stiffness(F_z) * alpha)


# Fiala's brush tire in combined slip: parabolic pressure, one friction coefficient.
#
# A tread that never slides would give γ = |(C_κ σ_x, C_α σ_y)|, σ = [κ, tan α]/(1 + κ). Sliding
# starts at the rear edge of the contact and takes all of it at γ = 3 μ F_z:
#     F = γ - γ²/(3 μ F_z) + γ³/(27 μ² F_z²),   γ < 3 μ F_z;   F = μ F_z otherwise,
# along (C_κ σ_x, C_α σ_y).
# Source: Pacejka, Tyre and Vehicle Dynamics, ch. 3.2-3.3; Fiala, VDI-Z 96 (1954).


class FialaTire(BrushTire):
    """Brush tire: |F| <= μ F_z exactly, smooth into full sliding; camber does nothing.

    Stiffnesses and friction are those of `BrushTire`.
    """

    __slots__ = ()

    def per_demand(self, s: Slips, F_z: Expression, mu: Expression) -> Expression:
        """Force over the demand of a tread that never slides [-]."""
        sliding = 3.0 * mu * self.friction * positive(F_z)  # demand at which all contact slides
        demand = s.size / s.rolling
        x = smaller(demand / (sliding + NO_FORCE), 1.0)
        return (1.0 - x + x**2 / 3.0) * smaller(1.0 / s.rolling, sliding / s.size)


# Dugoff's tire: linear until half the friction is used, then a hyperbola; combined slip for free.
#
# F_x = C_κ κ f(λ)/(1 + κ),   F_y = C_α tan α f(λ)/(1 + κ),   f(λ) = λ (2 - λ), λ < 1;   1
# otherwise, λ = μ F_z (1 + κ) / (2 |(C_κ κ, C_α tan α)|). Source: Dugoff, Fancher and Segel, SAE
# 700377 (1970), constant friction coefficient.


class DugoffTire(BrushTire):
    """Friction-limited linear tire: |F| < μ F_z, reached only in the limit; camber does nothing.

    Stiffnesses and friction are those of `BrushTire`.
    """

    __slots__ = ()

    def per_demand(self, s: Slips, F_z: Expression, mu: Expression) -> Expression:
        """Force over the demand of a tread that never slides [-]."""
        half = mu * self.friction * positive(F_z) / (2.0 * s.size)  # λ/(1 + κ)
        lam = smaller(half * s.rolling, 1.0)
        return smaller(half, 1.0 / s.rolling) * (2.0 - lam)  # f(λ)/(1 + κ), no 0/0 at lock
