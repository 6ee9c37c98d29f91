"""Lateral motion between two instants, where the lateral velocity is a state that nobody measures.

State z = [v_y, r, x_f, x_r, e_f, e_r, p, p']: lateral velocity [m/s], yaw rate [rad/s], lagged
slips [rad], what the curves miss [static axle loads], sine of the bank of the road and its rate.
Tires, slip, load and ellipse are those of `motion.model`; the sway follows the accelerometer:
ρ'' = ω² (a_y - ρ) - 2 ζ ω ρ'.
F_i/F_z,i = λ_i G_i φ_i(x_i) cos δ_i + e_i,   a = g Σ share_i F_i/F_z,i
v_y' = a - v_x r + g p,   r' = m g l_f l_r/(L I_z) (F_f/F_z,f - F_r/F_z,r),   e' = -e/T_e,
p'' = -2 p'/T_p - p/T_p²: trapezoids; x_i as in `motion.model`, its stiffness of the middle.
Measured: r + b_r,   a + x_a r' + roll ρ + g b_a - τ_a a'.
"""

from functools import cache
from typing import Any

import casadi as ca

from codegen import Scan
from codegen.compiler import FLAGS
from identifier.axle.car import step_function, symbols
from identifier.axle.slip import SHORTEST, beyond_play
from identifier.motion.model import (
    CarNumbers,
    Columns,
    carcass_curve,
    load_and_ellipse,
    pushed_names,
)
from identifier.motion.parameters import NAMES, curve_names
from models.vehicle import GRAVITY

# Parts of the matrix are thousands of lines: to optimize them further takes the compiler longer
# than they run.
_QUICK = tuple("-O1" if flag == "-O2" else flag for flag in FLAGS)

STATES = ("v_y", "r", "x_f", "x_r", "e_f", "e_r", "bank", "bank_rate")
GIVEN = ("v_x", "delta_f", "delta_r", "a_x", "turning", "rho", "rho_rate", "jerk")
ACCELEROMETER = ("a_y_bias", "roll", "a_y_delay", "a_y_lever")  # [g], [-], [s], [m]
MEASURED = ("r", "a_y")
TIMES = ("error", "bank")  # T_e and T_p [s]
LATENT_NAMES = (*NAMES, *ACCELEROMETER)


@cache
def node_scan(columns: Columns = ()) -> Scan:
    """Return the motion from a node to the next, compiled over nodes.

    Its ports: `z` and `z_next` (8,), `given` and `given_next` (8,) have a row a node, `parameters`
    (p,), `accelerometer` (4,), `car` (7,), `times` (2,) and `dt` are constant. `moves` (8,), what
    the step to the next node misses, `shows` (2,), what sensors show, `begins` (8,), what the
    first node misses, and `force` (2,) [static loads] without e come out. Where slopes are asked
    for, `measured` (2,) and the weights `of_moves` (8,), `of_shows` (2,) and `of_begins` (8,) have
    a row a node, too, and parts of Gauss-Newton's matrix come out: of the node, of the next, of
    both, with the parameters, the gradient, and of the parameters alone as sums that are carried,
    of the matrix its lower half.
    columns : names of the parameters over which slopes are asked for, (n,), those of the
        accelerometer among them.
    """
    over: tuple[str, ...] = ("z", "z_next", "given", "given_next")
    ports, s = symbols(
        z=len(STATES),
        z_next=len(STATES),
        given=len(GIVEN),
        given_next=len(GIVEN),
        parameters=len(NAMES),
        accelerometer=len(ACCELEROMETER),
        car=CarNumbers,
        times=len(TIMES),
        dt=1,
    )
    z, p = s.z, ca.vertcat(s.parameters, s.accelerometer)
    by_name = dict(zip(LATENT_NAMES, ca.vertsplit(p), strict=True))
    now, then = (
        _Instant(z, s.given, by_name, s.car),
        _Instant(s.z_next, s.given_next, by_name, s.car),
    )
    moves = ca.vertcat(*_moves(now, then, by_name, s.times, s.dt))
    a, turns = now.accelerations
    felt = a + by_name["a_y_lever"] * turns + by_name["roll"] * now.given["rho"]
    felt += GRAVITY * by_name["a_y_bias"]
    shows = ca.vertcat(now.r + by_name["r_bias"], felt - by_name["a_y_delay"] * now.given["jerk"])
    begins = ca.vertcat(z[0], 0, z[2:4] - ca.vertcat(*now.alpha), z[4:])
    carry: tuple[str, ...] = ()
    force = ca.vertcat(*now.force) - z[4:6]
    out = {"moves": moves, "shows": shows, "begins": begins, "force": force}
    if columns:
        m = len(columns)
        sums, slopes = ca.SX.sym("sums", m, m), ca.SX.sym("slopes", m)
        weighed = {"of_moves": moves, "of_shows": shows, "of_begins": begins}
        weights = {name: ca.SX.sym(name, one.numel()) for name, one in weighed.items()}
        measured = ca.SX.sym("measured", len(MEASURED))
        residual = ca.vertcat(moves, shows - measured, begins)
        w = ca.vertcat(*weights.values())
        over = (*over, "measured", *weights)
        carry = ("sums", "slopes")
        ports |= {"measured": measured, **weights, "sums": sums, "slopes": slopes}
        of = ca.vertcat(*(by_name[name] for name in columns))
        J, K, P = (ca.jacobian(residual, one) for one in (z, s.z_next, of))
        wJ, wK, wP = (ca.diag(w) @ one for one in (J, K, P))
        out = {
            **{"now": J.T @ wJ, "next": K.T @ wK, "both": K.T @ wJ},
            **{"border": J.T @ wP, "border_next": K.T @ wP},
            **{"slope": wJ.T @ residual, "slope_next": wK.T @ residual},
            "shows_z": ca.jacobian(shows, z),
            **{"sums_next": ca.tril(sums + P.T @ wP), "slopes_next": slopes + wP.T @ residual},
        }  # fmt: skip
    dense = {name: ca.densify(one) for name, one in out.items()}
    step = step_function(f"nodes_{len(columns)}", ports, {}, dense)
    return Scan(step, carry=carry, over=over, flags=_QUICK)


class _Instant:
    """Slips, forces and accelerations at a node, as expressions."""

    def __init__(self, z: Any, given: Any, p: dict[str, Any], car: CarNumbers) -> None:
        self.z, self.p, self.car = z, p, car
        self.given = dict(zip(GIVEN, ca.vertsplit(given), strict=True))
        self.v_y, self.r = z[0], z[1]
        self.L = car.l_f + car.l_r
        self.arms = car.l_f - p["cg_shift"], -(car.l_r + p["cg_shift"])

    @property
    def delta(self) -> tuple[Any, Any]:
        """Angles of the road wheels."""
        gain, zero = self.p["steering_gain"], self.p["steering_zero"]
        return (1 + gain) * self.given["delta_f"] + zero, self.given["delta_r"]

    @property
    def alpha(self) -> list[Any]:
        """Slip angles of both axles."""
        omega = self.car.omega * ca.exp(self.p["ln_sway"])
        v_x, sway = self.given["v_x"], -self.given["rho_rate"] / (omega**2 * self.given["v_x"])
        front, rear = (
            delta - ca.atan((self.v_y + arm * self.r) / v_x) + self.p[f"sway_share_{axle}"] * sway
            for axle, delta, arm in zip("fr", self.delta, self.arms, strict=True)
        )
        return [beyond_play(front, self.p["steering_play"]), rear]

    def curve(self, axle: str, x: Any) -> tuple[Any, Any]:
        """Return φ and the slope of the curve at a slip, at least what the carcass keeps."""
        numbers = [self.p[name] for name in curve_names(axle)]
        return carcass_curve(*numbers, self.p["ln_road"], x)

    @property
    def force(self) -> list[Any]:
        """Lateral forces of both axles over their static loads, across the body."""
        p, v_x = self.p, self.given["v_x"]
        a_x = self.given["a_x"] - self.given["turning"] * self.v_y * self.r
        found = []
        for i, axle in enumerate("fr"):
            numbers = [p[name] for name in pushed_names(axle)]
            load, left = load_and_ellipse(axle, self.car, numbers, a_x, v_x)
            phi, _ = self.curve(axle, self.z[2 + i])
            found.append(phi * load * left * ca.cos(self.delta[i]) + self.z[4 + i])
        return found

    @property
    def accelerations(self) -> tuple[Any, Any]:
        """What tires push sideways [m/s²], and how they turn the car [rad/s²]."""
        front, rear = self.force
        l_f, l_r = self.arms[0], -self.arms[1]
        across = GRAVITY * (l_r * front + l_f * rear) / self.L
        J = self.car.inertia * ca.exp(self.p["ln_inertia"])
        return across, l_f * l_r / (self.L * J) * (front - rear)


def _moves(now: _Instant, then: _Instant, p: dict[str, Any], times: Any, dt: Any) -> list[Any]:
    """Return what the step from a node to the next misses, by state."""
    rates = []
    for one in (now, then):
        a, turns = one.accelerations
        bank = one.z[6] + p["bank"]
        rates.append((a - one.given["v_x"] * one.r + GRAVITY * bank, turns))
    residual = [
        then.z[i] - now.z[i] - dt * (before + after) / 2
        for i, (before, after) in enumerate(zip(*rates, strict=True))
    ]
    for i, (axle, a0, a1) in enumerate(zip("fr", now.alpha, then.alpha, strict=True)):
        x0, x1 = now.z[2 + i], then.z[2 + i]
        _, slope = now.curve(axle, (x0 + x1) / 2)
        sigma = p[f"compliance_{axle}"] * slope + SHORTEST * now.L
        h = (now.given["v_x"] + then.given["v_x"]) / 2 * dt / sigma
        e = ca.exp(-h)
        residual.append(x1 - e * x0 - (1 - e) * a0 - (1 - (1 - e) / h) * (a1 - a0))
    T_e, T_p = times[0], times[1]
    residual += [then.z[i] - ca.exp(-dt / T_e) * now.z[i] for i in (4, 5)]
    p0, v0, p1, v1 = now.z[6], now.z[7], then.z[6], then.z[7]
    residual.append(p1 - p0 - dt * (v0 + v1) / 2)
    residual.append(v1 - v0 + dt * ((v0 + v1) / T_p + (p0 + p1) / (2 * T_p**2)))
    return residual
