"""From a sample to the axle forces of given weights: what learning and the frozen model share.

Carried: gate (9,), sway (3,), slip (2, 4).   W (2, n) [static axle loads].
own (2, 3) = [compliance s [m], sway share k [-], offset: δ₀ [rad] in front, b [m/s] at the rear].
"""

from typing import Any, NamedTuple

import casadi as ca

from identifier.axle.car import Car
from identifier.axle.gate import Gate, GateState, gate
from identifier.axle.piecewise import larger
from identifier.axle.ports import axle_port, named_port
from identifier.axle.slip import Hold, SlipState, hold, kinematic_slip, lagged_slip
from identifier.axle.sway import SwayNumbers, SwayState, sway
from identifier.axle.units import Curve, curve

CARRY = ("gate", "sway", "slip")
OVER = ("x", "u", "v_x")
CONSTANTS = ("dt", "car", "scales", "plausibility", "roll")
PLAUSIBILITY = 15  # numbers of `Plausibility`


class Forward(NamedTuple):
    """Symbols of the forward part and what it computes.

    ports : every input by name.   car, dt, scales : constants.   last_sway, last_slip : states.
    seen : the gate.   sway, hold, curve and the slip angles alpha and x [rad] : at this sample.
    size : of slip, the larger of with and without lag and sway [rad], (2,).
    axle_force : (2,) [N].   carried : next states by name.
    """

    ports: dict[str, Any]
    car: Car
    last_sway: SwayState
    last_slip: SlipState
    seen: Gate
    sway: SwayState
    hold: Hold
    alpha: Any
    x: Any
    size: Any
    curve: Curve
    cos_delta: Any
    axle_force: Any
    carried: dict[str, Any]


def forward(steps: tuple[int, ...]) -> Forward:
    """Return the forward part as CasADi expressions of fresh symbols.

    Parameters
    ----------
    steps : doublings between the units.
    """
    n = len(steps) + 1
    W, own, dt = ca.SX.sym("W", 2, n), ca.SX.sym("own", 2, 3), ca.SX.sym("dt")
    x, u, v_x = ca.SX.sym("x", 2), ca.SX.sym("u", 2), ca.SX.sym("v_x")
    scales, plausibility = ca.SX.sym("scales", 1, n), ca.SX.sym("plausibility", PLAUSIBILITY)
    gate_port, last_gate = named_port(GateState, "gate")
    sway_port, last_sway = named_port(SwayState, "sway")
    slip_port, last_slip = axle_port(SlipState, "slip")
    car_port, car = axle_port(Car, "car")
    roll_port, roll = named_port(SwayNumbers, "roll")
    compliance, share, offset = ca.horzsplit(own)

    seen = gate(plausibility, dt, last_gate, x, u, v_x)
    body = sway(
        roll,
        car,
        dt,
        last_sway,
        first=seen.first,
        v_x=seen.v_x,
        r=seen.r,
        force=last_slip.force,
        slope=last_slip.slope,
        share=share,
    )
    kinematic = kinematic_slip(car, seen, offset)
    alpha = kinematic + share * body.slip
    step = hold(car, seen.v_x, dt, compliance, last_slip.slope)
    lagged = lagged_slip(step, last_slip, alpha, seen.first)
    at_x = curve(lagged, W, scales, steps)
    cos_delta = 1 - seen.delta**2 / 2 + seen.delta**4 / 24  # 2e-5 off at 0.5 rad, no call
    ports = {
        "gate": gate_port,
        "sway": sway_port,
        "slip": slip_port,
        "W": W,
        "own": own,
        "x": x,
        "u": u,
        "v_x": v_x,
        "dt": dt,
        "car": car_port,
        "scales": scales,
        "plausibility": plausibility,
        "roll": roll_port,
    }
    return Forward(
        ports=ports,
        car=car,
        last_sway=last_sway,
        last_slip=last_slip,
        seen=seen,
        sway=body,
        hold=step,
        alpha=alpha,
        x=lagged,
        size=larger(ca.fabs(kinematic), ca.fabs(lagged)),
        curve=at_x,
        cos_delta=cos_delta,
        axle_force=ca.if_else(seen.on, at_x.force * cos_delta * car.load, 0),
        carried={
            "gate": seen.state,
            "sway": ca.vertcat(*body),
            "slip": ca.horzcat(lagged, alpha, at_x.carcass_slope, at_x.force),
        },
    )


def build_frozen(steps: tuple[int, ...]) -> ca.Function:
    """Return the frozen model as a step: weights in, axle_force [N], slips [rad] out, (2,).

    Parameters
    ----------
    steps : doublings between the units.
    """
    f = forward(steps)
    return ca.Function(
        "_".join(["axle_frozen", *map(str, steps)]),
        list(f.ports.values()),
        [*f.carried.values(), f.axle_force, f.x, f.size],
        list(f.ports),
        [*(f"{name}_next" for name in f.carried), "axle_force", "lagged_slip", "slip_size"],
        {"cse": True},
    )
