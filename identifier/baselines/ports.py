"""What the steps of all baselines read, and the equation of motion that they share.

x = [v_y, r] [m/s, rad/s].   u = [δ_f, δ_r] [rad].   F: axle forces [N], frame of the body.
ẋ = K F - [v_x r, 0]; equation numbers: Hong and Choi.
The tire's lag is dα'/dt = v_x/σ (α - α'), σ the relaxation length (Pacejka, Tyre and Vehicle
Dynamics, 2nd ed., (7.7)): it is solved exactly for α linear over the step, so that no short σ makes
it unstable and σ = 0 is no lag at all.
"""

from typing import Any, NamedTuple

import casadi as ca

from identifier.baselines.chosen import CHOSEN
from identifier.setup import Port
from models.bicycle import BicycleParameters, bicycle

OVER = ("x", "u", "v_x")
WITH_A_Y = (*OVER, "a_y")
_SAMPLING = ("dt", "min_speed")


class Sample(NamedTuple):
    """Ports of one sample and of the car: symbols.

    x (2,), u (2,), v_x; vehicle (6,) = m, I_z, l_f, l_r, C_f, C_r; sampling (2,) = T_s [s] and the
    lowest speed [m/s]; the six numbers by letter.
    """

    x: Any
    u: Any
    v_x: Any
    vehicle: Any
    sampling: Any
    parameters: BicycleParameters

    @property
    def moving(self) -> Any:
        return self.v_x >= self.sampling[1]

    @property
    def speed(self) -> Any:
        """v_x, held at the lowest speed, so that slip angles stay finite [m/s]."""
        return ca.fmax(self.v_x, self.sampling[1])


def sample_ports() -> Sample:
    vehicle = ca.SX.sym("vehicle", 6)
    return Sample(
        x=ca.SX.sym("x", 2),
        u=ca.SX.sym("u", 2),
        v_x=ca.SX.sym("v_x"),
        vehicle=vehicle,
        sampling=ca.SX.sym("sampling", len(_SAMPLING)),
        parameters=BicycleParameters(*ca.vertsplit(vehicle)),
    )


class Given(NamedTuple):
    """A sample with a_y [m/s²], 0 where there is none.
    has_a_y : whether a_y is there, and one of a car.   a_y_port : the port itself, as it is.
    """

    sample: Sample
    a_y: Any
    has_a_y: Any
    a_y_port: Any

    @property
    def ports(self) -> list[Any]:
        """The ports of `WITH_A_Y`, then vehicle and sampling."""
        s = self.sample
        return [s.x, s.u, s.v_x, self.a_y_port, s.vehicle, s.sampling]

    @property
    def r(self) -> Any:
        """The measured yaw rate [rad/s]."""
        return self.sample.x[1]


def given_ports() -> Given:
    a_y = ca.SX.sym("a_y")
    has_a_y = ca.fabs(a_y) < CHOSEN.most_felt  # NaN is not
    return Given(sample_ports(), ca.if_else(has_a_y, a_y, 0), has_a_y, a_y)


def axle_loads(p: BicycleParameters, gravity: float) -> Any:
    """Return the static axle loads F_z (2,) [N].   gravity : g [m/s²]."""
    return p.m * gravity / (p.l_f + p.l_r) * ca.vertcat(p.l_r, p.l_f)


def motion_rate(p: BicycleParameters, v_x: Any, x: Any, F: Any) -> Any:
    """Return dx/dt of (1)-(2), (2,).
    v_x : longitudinal speed [m/s].   x : [v_y, r] (2,).   F : axle forces (2,) [N].
    """
    return bicycle(p, 1.0).K @ F - ca.vertcat(v_x * x[1], 0)


class LaggedSlip(NamedTuple):
    """What the lag keeps from one sample to the next: α' and α (2,) [rad], 1 once it has begun."""

    slip: Any
    alpha: Any
    begun: Any


LAG_PORTS = ("slip", "alpha", "begun")
LAG_DESCRIBED = (
    Port("slip", "rad", "lagged slip of what was measured, front and rear"),
    Port("alpha", "rad", "slip angles of the last sample, front and rear"),
    Port("begun", "-", "1 after a sample in motion, from which slip lags"),
)


def lag_symbols() -> LaggedSlip:
    return LaggedSlip(ca.SX.sym("slip", 2), ca.SX.sym("alpha", 2), ca.SX.sym("begun"))


def lagged_slip(last: LaggedSlip, alpha: Any, way: Any, sigma: Any) -> Any:
    """Return α' after a step (2,) [rad]; the first sample begins without lag.
    alpha : slip angles now (2,) [rad].   way : v_x T_s, what the tire has rolled [m].
    sigma : relaxation lengths (2,) [m], not negative.
    """
    e = ca.exp(-way / ca.fmax(sigma, CHOSEN.shortest))
    follow = e * (last.slip - last.alpha) - (1 - e) * sigma / way * (alpha - last.alpha)
    return alpha + ca.if_else(last.begun > 0.5, follow, 0)
