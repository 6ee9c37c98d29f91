"""The two slopes of a tire whose stiffness is the same at every load: methods of such tires."""

from typing import Protocol

from models.tires.forces import Expression


class ConstantStiffness(Protocol):
    """A tire with stiffnesses that do not depend on load."""

    @property
    def C_alpha(self) -> float:
        """Cornering stiffness of one tire [N/rad]."""

    @property
    def C_kappa(self) -> float:
        """Longitudinal slip stiffness of one tire [N]."""


def slip_stiffness(self: ConstantStiffness, F_z: Expression) -> Expression:
    """∂F_x/∂κ at zero slip [N]: C_κ, and 0 in the air.

    Parameters
    ----------
    F_z : wheel load [N].
    """
    return self.C_kappa * (F_z > 0)


def cornering_stiffness(self: ConstantStiffness, F_z: Expression) -> Expression:
    """∂F_y/∂α at zero slip [N/rad]: C_α, and 0 in the air.

    Parameters
    ----------
    F_z : wheel load [N].
    """
    return self.C_alpha * (F_z > 0)
