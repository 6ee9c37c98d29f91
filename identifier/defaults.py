"""A design from the vehicle alone: sizes by similarity, gains by the margin of the learning loop.

Lengths scale with the wheelbase L and times with sqrt(L/g) (Froude), so that one rule serves a
passenger car and a 1:10 model.
"""

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from identifier.paper.design import Driving, PaperIdentifier, natural_force_unit
from identifier.paper.laws import DRIVING_ERRORS, Gains, diagonal
from identifier.paper.network import SIGNALS, Network
from identifier.stability.gain_design import decay_rate, design_gains
from identifier.stability.loop import linear_law
from identifier.stability.operation import Operation, minimal_decay, operation
from models.vehicle import Vehicle

REFERENCE_WHEELBASE = 2.7  # m: the car for which the scales of SIGNALS are meant
BANDWIDTH = 0.7  # Hz: a brisk slalom; the steering of a normal driver stays below 0.5 Hz
PHASE_MARGIN = 60.0  # deg
# Four standard deviations of a good inertial sensor and a steering encoder, m/s, rad/s, rad.
PEAK_NOISE = {"v_x": 0.12, "v_y": 0.12, "r": 0.012, "delta": 0.002}
LAWS: Mapping[str, str] = {  # name, and what a reader is told
    "integral": "integral",
    "instantaneous": "instantaneous",
    "instantaneous_scaled": "instantaneous at eta/lambda",
    "pi_lead": "PI-lead",
}


def natural_driving(vehicle: Vehicle, *, bandwidth: float = BANDWIDTH) -> Driving:
    """Return hard driving on a dry road: both axles slide, at 4 sqrt(g L) (20 m/s for a sedan).

    Parameters
    ----------
    vehicle : the car; the slip is twice that at which its linear tire reaches the friction limit.
    bandwidth : highest frequency of steering that matters [Hz].
    """
    stiffness = (vehicle.cornering_stiffness_front, vehicle.cornering_stiffness_rear)
    sliding = max(load / c for load, c in zip(vehicle.axle_loads, stiffness, strict=True))
    ratio = math.sqrt(vehicle.wheelbase / REFERENCE_WHEELBASE)
    return Driving(
        v_x=4.0 * vehicle.froude_speed,
        slip=2.0 * sliding,
        friction=1.0,
        bandwidth=bandwidth,
        noise_v_x=PEAK_NOISE["v_x"] * ratio,
        noise_v_y=PEAK_NOISE["v_y"] * ratio,
        noise_r=PEAK_NOISE["r"] / ratio,
        noise_delta=PEAK_NOISE["delta"],
    )


def natural_operation(
    design: PaperIdentifier, vehicle: Vehicle, driving: Driving | None = None
) -> Operation:
    """Return what a certificate of the design must know.

    Parameters
    ----------
    design : the design.
    vehicle : the car.
    driving : how hard it is driven; None takes what is stored in the design, else
        `natural_driving`.
    """
    return operation(design, vehicle, driving or design.driving or natural_driving(vehicle))


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


def design_for(
    vehicle: Vehicle,
    driving: Driving,
    *,
    law: str = "integral",
    network: Network | None = None,
    phase_margin: float = PHASE_MARGIN,
    input_source: str = "measured",
    integrator: str = "euler",
    dt: float = 0.01,
    seed: int = 0,
) -> PaperIdentifier:
    """Return a design whose learning loop has the wanted phase margin at the worst regressor.

    Parameters
    ----------
    vehicle : the car.
    driving : how hard it is driven; it is stored with the design.
    law : "integral", "instantaneous" or "pi_lead", which gets the lead τ = 1/a.
    network : structure; None takes `natural_network`.
    phase_margin : of the sampled loop [deg].
    input_source : "measured" or "estimated".
    integrator : "euler" or "rk4".
    dt : sampling interval [s].
    seed : seed of the initial weights.

    Raises
    ------
    DesignError
        Where the bandwidth is too high for the sampling, or the margin cannot be had.
    """
    network = network or natural_network(vehicle)
    frame = PaperIdentifier(
        gains=_placeholder(),
        network=network,
        law=law,
        input_source=input_source,
        integrator=integrator,
        dt=dt,
        force_unit=natural_force_unit(vehicle.mass),
        min_speed=vehicle.lowest_speed,
        seed=seed,
        driving=driving,
    )
    known = natural_operation(frame, vehicle, driving)
    feedback = known.input_feedback
    slowest = 0.0 if feedback is None else minimal_decay(feedback)
    lead = 1.0 / decay_rate(driving.bandwidth, slowest) if law == "pi_lead" else 0.0
    designed = design_gains(
        law=linear_law(DRIVING_ERRORS[law], lead),
        bandwidth=driving.bandwidth,
        dt=dt,
        n_h=network.hidden,
        x_bar_max=known.x_bar_max,
        disturbance=known.disturbance,
        needed_force=known.needed_force,
        V_max=known.V_start,
        phase_margin=phase_margin,
        integrator=integrator,
        minimal_decay=slowest,
    )
    return replace(frame, gains=replace(designed.gains, lead=lead))


def paper_identifier(
    vehicle: Vehicle,
    *,
    law: str = "integral",
    network: Network | None = None,
    seed: int = 0,
    dt: float = 0.01,
) -> PaperIdentifier:
    """Return a design for a vehicle.

    The two instantaneous laws have the gains of the integral law, one as they are and one with
    η/λ, since they are there to be compared with it.

    Parameters
    ----------
    vehicle : the car.
    law : "integral", "instantaneous", "instantaneous_scaled" (at η/λ) or "pi_lead".
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
    design = design_for(
        vehicle,
        natural_driving(vehicle),
        law="integral" if law.startswith("instantaneous") else law,
        network=network,
        seed=seed,
        dt=dt,
    )
    return with_law(design, law)


def with_law(design: PaperIdentifier, law: str) -> PaperIdentifier:
    """Return a design run by another law, to compare the two: its gains as they are, or with η/λ.

    Parameters
    ----------
    design : the design.
    law : one of `LAWS`; "instantaneous_scaled" is the instantaneous law with η/λ in place of η.
    """
    if law == "instantaneous_scaled":
        return replace(design, law="instantaneous", gains=design.gains.scaled_by_forgetting())
    return replace(design, law=law)


def _placeholder() -> Gains:
    """Gains that are replaced once the design around them is known."""
    return Gains(A_d=diagonal(1.0), forgetting=1.0, eta_W=0.0, eta_V=0.0, rho_W=0.0, rho_V=0.0)
