"""Running an identifier over a recording, in compiled code."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from codegen import Scan
from identifier.design import Design
from identifier.gains import Gains
from identifier.history import History
from identifier.network import Network, Weights
from identifier.step import CARRY, OVER, build_step
from models.recordings import Recording
from models.vehicle import Vehicle


@cache
def _scan(network: Network, law: str, input_source: str, integrator: str, projects: bool) -> Scan:
    """One compiled loop for each structure; gains, vehicle and sampling are its inputs."""
    bound = 1.0 if projects else np.inf
    gains = Gains(
        A_d=((-1.0, 0.0), (0.0, -1.0)),
        forgetting=1.0,
        eta_W=1.0,
        eta_V=1.0,
        rho_W=1.0,
        rho_V=1.0,
        W_max=bound,
        V_max=bound,
    )
    design = Design(
        gains=gains, network=network, law=law, input_source=input_source, integrator=integrator
    )
    return Scan(build_step(design), carry=CARRY, over=OVER)


def identify(
    recording: Recording, vehicle: Vehicle, design: Design, weights: Weights | None = None
) -> History:
    """Run the identifier of a design over a recording.

    Parameters
    ----------
    recording : signals, sampled at the design's interval; its forces are not looked at.
    vehicle : the car as the identifier is told of it.
    design : network, law, gains and sampling.
    weights : weights to begin with; None draws them from the design's seed.

    Raises
    ------
    ValueError
        Where recording and design differ in their sampling interval.
    """
    if abs(recording.dt - design.dt) > 1e-6 * design.dt:
        raise ValueError(
            f"{recording.name} is sampled at {recording.dt:g} s, the design at {design.dt:g} s"
        )
    gains = design.gains
    scan = _scan(
        design.network, design.law, design.input_source, design.integrator, design.projects
    )
    start = weights or design.network.initial_weights(np.random.default_rng(design.seed))
    record = scan(
        recording.t.size,
        {
            "xi_hat": initial_impulse(recording, vehicle, design),
            "z": np.zeros(2),
            "W": start.W,
            "V": start.V,
            "x": recording.x,
            "u": recording.u,
            "v_x": recording.v_x,
            "vehicle": np.array(vehicle.bicycle),
            "A_d": gains.matrix,
            "gains": np.array(
                [
                    gains.eta_W,
                    gains.eta_V,
                    gains.rho_W,
                    gains.rho_V,
                    gains.forgetting,
                    gains.W_max,
                    gains.V_max,
                    gains.lead,
                ]
            ),
            "sampling": np.array([design.dt, design.force_unit, design.min_speed]),
        },
    )
    return History(
        vehicle=vehicle,
        design=design,
        recording=recording,
        axle_force=record["axle_force"],
        f_hat=record["f_hat"],
        xi_tilde=record["xi_tilde"],
        z=record["z"],
        W=record["W_all"],
        V=record["V_all"],
    )


def initial_impulse(recording: Recording, vehicle: Vehicle, design: Design) -> NDArray[np.float64]:
    """Return ξ at the first sample, (2,) [U s], at which the observer starts.

    Parameters
    ----------
    recording : the signals.
    vehicle : the car, which gives K.
    design : gives the force unit U.
    """
    v_y, r = recording.x[0]
    m, I_z, l_f, l_r = vehicle.mass, vehicle.yaw_inertia, vehicle.l_f, vehicle.l_r
    impulse = np.array([m * l_r * v_y + I_z * r, m * l_f * v_y - I_z * r]) / (l_f + l_r)
    return impulse / design.force_unit
