"""A design from the vehicle alone: sizes by similarity, gains by the margin of the adaptive loop.

Lengths scale with the wheelbase L and times with sqrt(L/g) (Froude), so that one rule serves a
passenger car and a 1:10 model. The loop of the integral law with A_d = -a I and λ = a has a phase
margin of 60° where max|σ|² η1 + ... = 0.287 a⁴.
"""

import numpy as np

from identifier.design import Design, natural_force_unit
from identifier.gains import Gains, diagonal
from identifier.network import SIGNALS, Network
from models.vehicle import GRAVITY, Vehicle

REFERENCE_WHEELBASE = 2.7  # m: the car for which the scales of SIGNALS are meant
RATE = 10.0  # 1/s: a = λ, which is a T_s = 0.1 at 10 ms
LOOP_GAIN = 0.287 * RATE**4  # 1/s⁴: 60 degrees of phase margin
SHARE_OF_V = 0.2  # of the loop gain, for the V layer
LARGE_W = 5.0  # U: a norm of W that is large; with it the V layer takes its share
LEAKAGE = 0.1  # 1/(U s²)
LAWS = ("integral", "instantaneous", "instantaneous_scaled")


def natural_network(
    vehicle: Vehicle, *, hidden: int = 10, inputs: tuple[str, ...] = Network().inputs
) -> Network:
    """Return a network whose input scales fit the size of the car.

    Parameters
    ----------
    vehicle : its wheelbase sets the scales of speeds and yaw rate.
    hidden : number of hidden units.
    inputs : signals that the network reads.
    """
    ratio = np.sqrt(vehicle.wheelbase / REFERENCE_WHEELBASE)
    froude = {"v_y": ratio, "v_x": ratio, "r": 1 / ratio}
    scale = tuple(float(SIGNALS[name] * froude.get(name, 1.0)) for name in inputs)
    return Network(hidden=hidden, inputs=inputs, scale=scale)


def default_design(
    vehicle: Vehicle,
    *,
    law: str = "integral",
    network: Network | None = None,
    seed: int = 0,
    dt: float = 0.01,
) -> Design:
    """Return a design for a vehicle.

    Parameters
    ----------
    vehicle : the car.
    law : "integral", "instantaneous", or "instantaneous_scaled": the instantaneous law at η/λ.
    network : structure; None takes `natural_network`.
    seed : seed of the initial weights.
    dt : sampling interval [s].

    Raises
    ------
    ValueError
        Where the law is unknown.
    """
    if law not in LAWS:
        raise ValueError(f"law must be one of {list(LAWS)}, not {law!r}")
    network = network or natural_network(vehicle)
    gains = Gains(
        A_d=diagonal(RATE),
        forgetting=RATE,
        eta_W=(1 - SHARE_OF_V) * LOOP_GAIN / network.hidden,
        eta_V=SHARE_OF_V * LOOP_GAIN / (len(network.inputs) * LARGE_W**2),
        rho_W=LEAKAGE,
        rho_V=LEAKAGE,
    )
    return Design(
        gains=gains.scaled_by_forgetting() if law == "instantaneous_scaled" else gains,
        network=network,
        law="integral" if law == "integral" else "instantaneous",
        dt=dt,
        force_unit=natural_force_unit(vehicle.mass),
        min_speed=0.2 * float(np.sqrt(GRAVITY * vehicle.wheelbase)),
        seed=seed,
    )
