"""Dugoff's tire: linear until half the friction is used, then a hyperbola; combined slip for free.

F_x = C_κ κ f(λ)/(1 + κ),   F_y = C_α tan α f(λ)/(1 + κ),   f(λ) = λ (2 - λ), λ < 1;   1 otherwise,
λ = μ F_z (1 + κ) / (2 |(C_κ κ, C_α tan α)|).
Source: Dugoff, Fancher and Segel, SAE 700377 (1970), constant friction coefficient.
"""

from dataclasses import dataclass

from models.rules import require_positive
from models.tires import constant_stiffness
from models.tires.forces import Expression, TireForces, positive, smaller
from models.tires.slips import slips


@dataclass(frozen=True, slots=True, kw_only=True)
class DugoffTire:
    """Friction-limited linear tire: |F| < μ F_z, reached only in the limit; camber does nothing.

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
        half = mu * self.friction * positive(F_z) / (2.0 * s.size)  # λ/(1 + κ)
        lam = smaller(half * s.rolling, 1.0)
        per_demand = smaller(half, 1.0 / s.rolling) * (2.0 - lam)  # f(λ)/(1 + κ), no 0/0 at lock
        return TireForces(s.p_x * per_demand, s.p_y * per_demand)

    slip_stiffness = constant_stiffness.slip_stiffness
    cornering_stiffness = constant_stiffness.cornering_stiffness
