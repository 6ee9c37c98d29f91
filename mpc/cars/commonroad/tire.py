"""The tire of commonroad-vehicle-models: a Magic Formula with every force proportional to load.

Carried over on purpose: the sign of camber (their z axis points down), a camber shift that jumps
with sign(γ), a vertical shift inside the sine, and no load sensitivity or relaxation.
"""

from dataclasses import dataclass
from typing import Any

import casadi as ca

from models.tires import TireForces
from mpc.cars.commonroad.package import bmw_tire

SMOOTH_CAMBER = 1e-3  # |γ| below which our sign(γ) is a slope, so that it does not chatter [rad]


@dataclass(frozen=True, slots=True, kw_only=True)
class CommonRoadTire:
    """Their tire behind our call.

    Parameters
    ----------
    p : coefficients by name, in their order and sign.
    """

    p: tuple[tuple[str, float], ...]

    @classmethod
    def read(cls) -> "CommonRoadTire":
        """Take the coefficients from the package."""
        return cls(p=tuple(bmw_tire().items()))

    def forces(self, alpha: Any, kappa: Any, gamma: Any, F_z: Any, mu: Any = 1.0) -> TireForces:
        """Give F_x, F_y [N].

        Parameters
        ----------
        alpha : slip angle in the paper's sign [rad]; theirs is the opposite.
        kappa : longitudinal slip, positive driving [-]; theirs is the opposite.
        gamma : camber, top to the right [rad]; theirs is the opposite.
        F_z : load [N].
        mu : friction over the tire's own [-].
        """
        p, a, s, g = dict(self.p), -alpha, -kappa, -gamma
        sign = g / ca.sqrt(g**2 + SMOOTH_CAMBER**2)
        mu_x, mu_y = mu * p["p_dx1"] * (1 - p["p_dx3"] * g**2), mu * p["p_dy1"]
        mu_y *= 1 - p["p_dy3"] * g**2
        slip = a + sign * (p["p_hy1"] + p["p_hy3"] * ca.fabs(g))
        F_y = F_z * (
            _sine(slip, p["p_ky1"], mu_y, p["p_cy1"], p["p_ey1"])
            + sign * (p["p_vy1"] + p["p_vy3"] * ca.fabs(g))
        )
        inside = p["p_vx1"] * F_z  # their vertical shift stands inside the sine
        F_x = F_z * _sine(kappa + p["p_hx1"], p["p_kx1"], mu_x, p["p_cx1"], p["p_ex1"], inside)
        B_x = p["r_bx1"] * ca.cos(ca.atan(p["r_bx2"] * s))
        F_x *= _weight(a, p["r_hx1"], B_x, p["r_cx1"], p["r_ex1"])
        B_y = p["r_by1"] * ca.cos(ca.atan(p["r_by2"] * (a - p["r_by3"])))
        F_y *= _weight(s, p["r_hy1"], B_y, p["r_cy1"], p["r_ey1"])
        D_v = mu_y * F_z * (p["r_vy1"] + p["r_vy3"] * g) * ca.cos(ca.atan(p["r_vy4"] * a))
        return TireForces(F_x, F_y + D_v * ca.sin(p["r_vy5"] * ca.atan(p["r_vy6"] * s)))

    def slip_stiffness(self, F_z: Any) -> Any:
        """Give dF_x/dκ at zero [N].

        Parameters
        ----------
        F_z : load [N].
        """
        return dict(self.p)["p_kx1"] * F_z

    def cornering_stiffness(self, F_z: Any) -> Any:
        """Give dF_y/dα at zero [N/rad].

        Parameters
        ----------
        F_z : load [N].
        """
        return -dict(self.p)["p_ky1"] * F_z


def _sine(slip: Any, K: Any, D: Any, C: Any, E: Any, inside: Any = 0.0) -> Any:
    b = K / (C * D) * slip
    return D * ca.sin(C * ca.atan(b - E * (b - ca.atan(b))) + inside)


def _weight(slip: Any, shift: Any, B: Any, C: Any, E: Any) -> Any:
    def cosine(s: Any) -> Any:
        return ca.cos(C * ca.atan(B * s - E * (B * s - ca.atan(B * s))))

    return cosine(slip + shift) / cosine(shift)
