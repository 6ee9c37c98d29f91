"""The tire of the linear bicycle: force proportional to slip, without limit."""

from dataclasses import dataclass

from models.rules import require_positive
from models.tires import constant_stiffness
from models.tires.forces import Expression, TireForces


@dataclass(frozen=True, slots=True, kw_only=True)
class LinearTire:
    """F_x = C_κ κ, F_y = C_α α while the wheel touches the ground.

    Load only decides about contact; friction and camber do nothing: no limit, by definition.

    Parameters
    ----------
    C_alpha : cornering stiffness of one tire [N/rad], > 0.
    C_kappa : longitudinal slip stiffness of one tire [N], > 0.

    Raises
    ------
    ValueError
        A stiffness is not positive and finite.
    """

    C_alpha: float
    C_kappa: float

    def __post_init__(self) -> None:
        require_positive(ValueError, C_alpha=self.C_alpha, C_kappa=self.C_kappa)

    def forces(
        self,
        alpha: Expression,
        kappa: Expression,
        gamma: Expression,  # noqa: ARG002
        F_z: Expression,
        mu: Expression = 1.0,  # noqa: ARG002
    ) -> TireForces:
        """Longitudinal and lateral force in the wheel frame [N].

        Parameters
        ----------
        alpha : slip angle, paper's sign [rad].
        kappa : longitudinal slip [-].
        gamma : camber [rad]; without effect.
        F_z : wheel load [N]; no force at F_z <= 0.
        mu : friction of the road over that of the measurement [-]; without effect.
        """
        return TireForces(self.slip_stiffness(F_z) * kappa, self.cornering_stiffness(F_z) * alpha)

    slip_stiffness = constant_stiffness.slip_stiffness
    cornering_stiffness = constant_stiffness.cornering_stiffness
