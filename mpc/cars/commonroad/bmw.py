"""The BMW 320i of commonroad-vehicle-models as a vehicle of ours, with its chassis."""

from models.chassis import Chassis
from models.vehicle import GRAVITY, Vehicle
from mpc.cars.commonroad.package import bmw_320i
from mpc.cars.commonroad.tire import CommonRoadTire

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
