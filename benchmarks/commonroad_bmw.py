"""The BMW 320i of commonroad-vehicle-models: parameters, tire, and the car in our words."""

import copy
from dataclasses import asdict, dataclass
from typing import Any

import casadi as ca
from vehiclemodels.parameters_vehicle2 import parameters_vehicle2

from models.tires import TireForces
from models.vehicle import GRAVITY, Chassis, Vehicle


def bmw_320i() -> Any:
    """Return a copy of the parameters of their BMW 320i."""
    return copy.deepcopy(parameters_vehicle2())


def bmw_tire() -> dict[str, float]:
    """Return the coefficients of its tires by name, in their order and sign."""
    return {key: float(value) for key, value in asdict(bmw_320i().tire).items()}


def bmw_parameters(scale: float = 1.0, *, repaired: bool = False) -> Any:
    """Return their parameter set with friction scaled in both directions.

    Parameters
    ----------
    scale : friction over the tire's own [-].
    repaired : their axle loads put the center of gravity 16 mm behind the point about which their
        yaw moments are taken, because both axles have the same unsprung mass. True moves 6.6 kg
        of it from the rear to the front axle, so that the two points are one.
    """
    parameters = bmw_320i()
    if repaired:
        unsprung = parameters.m_uf + parameters.m_ur
        parameters.m_uf = unsprung * parameters.b / (parameters.a + parameters.b)
        parameters.m_ur = unsprung - parameters.m_uf
    scale_friction(parameters, bmw_tire(), scale)
    return parameters


def scale_friction(parameters: Any, tire: dict[str, float], scale: float) -> None:
    """Set the friction of a parameter set.

    Parameters
    ----------
    tire : the coefficients at scale 1.
    scale : friction over the tire's own [-].
    """
    parameters.tire.p_dy1 = scale * tire["p_dy1"]
    parameters.tire.p_dx1 = scale * tire["p_dx1"]


# The tire of commonroad-vehicle-models: a Magic Formula with every force proportional to load.
#
# Carried over on purpose: the sign of camber (their z axis points down), a camber shift that jumps
# with sign(γ), a vertical shift inside the sine, and no load sensitivity or relaxation.

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


# The car as a vehicle of ours, with its chassis.

INSTANT = 0.002  # what stands for "no lag": two steps of the integration [s]


def bmw() -> Vehicle:
    """Return the car, by formulas from their parameters."""
    p = bmw_320i()
    tire = CommonRoadTire.read()
    load = p.m * GRAVITY / (p.a + p.b)
    # Their body rolls on suspension and tire in series; the axle takes its share of the angle.
    springs = (0.5 * p.K_sf * p.T_f**2 - p.K_tsf, 0.5 * p.K_sr * p.T_r**2 - p.K_tsr)
    tires = (0.5 * p.K_zt * p.T_f**2, 0.5 * p.K_zt * p.T_r**2)
    of_springs = [k_t / (k + k_t) for k, k_t in zip(springs, tires, strict=True)]
    front, rear = (k * share for k, share in zip(springs, of_springs, strict=True))
    damping = 0.5 * (p.K_sdf * p.T_f**2 + p.K_sdr * p.T_r**2)
    roll_center = p.h_cg - p.m_s * p.h_s / p.m  # their sprung mass rolls about the ground
    chassis = Chassis(
        track_front=p.T_f,
        track_rear=p.T_r,
        cg_height=p.h_cg,
        roll_center_height_front=roll_center,
        roll_center_height_rear=roll_center,
        roll_stiffness=front + rear,
        roll_stiffness_front_share=front / (front + rear),
        roll_damping=damping,
        roll_inertia=p.I_Phi_s,
        roll_camber_front=1.0 + 0.5 * p.D_f * p.T_f * of_springs[0],
        roll_camber_rear=1.0 + 0.5 * p.D_r * p.T_r * of_springs[1],
        relaxation_length_front=0.05,
        relaxation_length_rear=0.05,
        steering_lag=INSTANT,
        drive_front_share=p.T_se,
        brake_front_share=p.T_sb,
    )
    return Vehicle(
        name="BMW 320i",
        mass=p.m,
        yaw_inertia=p.I_z,
        l_f=p.a,
        l_r=p.b,
        cornering_stiffness_front=float(tire.cornering_stiffness(load * p.b)),
        cornering_stiffness_rear=float(tire.cornering_stiffness(load * p.a)),
        chassis=chassis,
    )
