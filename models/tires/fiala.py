"""Fiala's brush tire in combined slip: parabolic pressure, one friction coefficient.

A tread that never slides would give γ = |(C_κ σ_x, C_α σ_y)|, σ = [κ, tan α]/(1 + κ). Sliding
starts at the rear edge of the contact and takes all of it at γ = 3 μ F_z:
    F = γ - γ²/(3 μ F_z) + γ³/(27 μ² F_z²),   γ < 3 μ F_z;   F = μ F_z otherwise,
along (C_κ σ_x, C_α σ_y).
Source: Pacejka, Tyre and Vehicle Dynamics, ch. 3.2-3.3; Fiala, VDI-Z 96 (1954).
"""

from dataclasses import dataclass

from models.rules import require_positive
from models.tires import constant_stiffness
from models.tires.forces import Expression, TireForces, positive, smaller
from models.tires.slips import NO_FORCE, slips


@dataclass(frozen=True, slots=True, kw_only=True)
class FialaTire:
    """Brush tire: |F| <= μ F_z exactly, smooth into full sliding; camber does nothing.

    Parameters
    ----------
    C_alpha : cornering stiffness of one tire [N/rad], > 0, at every load.
    C_kappa : longitudinal slip stiffness of one tire [N], > 0, at every load.
    friction : friction coefficient of the tire as measured [-], > 0.

    Raises
    ------
    ValueError
        A parameter is not positive and finite.
    """

    C_alpha: float
    C_kappa: float
    friction: float

    def __post_init__(self) -> None:
        require_positive(
            ValueError, C_alpha=self.C_alpha, C_kappa=self.C_kappa, friction=self.friction
        )

    def forces(
        self,
        alpha: Expression,
        kappa: Expression,
        gamma: Expression,  # noqa: ARG002
        F_z: Expression,
        mu: Expression = 1.0,
    ) -> TireForces:
        """Longitudinal and lateral force in the wheel frame [N].

        Parameters
        ----------
        alpha : slip angle, paper's sign [rad].
        kappa : longitudinal slip [-]; below -1 the wheel counts as locked.
        gamma : camber [rad]; without effect.
        F_z : wheel load [N]; no force at F_z <= 0.
        mu : friction of the road over that of the measurement [-].
        """
        s = slips(alpha, kappa, self.C_alpha, self.C_kappa)
        sliding = 3.0 * mu * self.friction * positive(F_z)  # demand at which all contact slides
        demand = s.size / s.rolling
        x = smaller(demand / (sliding + NO_FORCE), 1.0)
        per_demand = (1.0 - x + x**2 / 3.0) * smaller(1.0 / s.rolling, sliding / s.size)
        return TireForces(s.p_x * per_demand, s.p_y * per_demand)

    slip_stiffness = constant_stiffness.slip_stiffness
    cornering_stiffness = constant_stiffness.cornering_stiffness
