"""The estimate where no sensor shows v_y: full information, v_y a state at every node.

Minimized over the states z_k of all nodes and the parameters p (`motion.nodes`):
Σ |moves(z_k, z_k+1, p)|²/Q + Σ ρ(|y_k - shows(z_k, p)|²/R) + Σ |begins(z, p)|²/P + prior(p),
ρ Huber's. Gauss-Newton: its matrix [A B; Bᵀ C], A of the states banded, C of the parameters, is
solved by banded Cholesky and Schur's complement S = C - Bᵀ A⁻¹ B.
A late a_y looks like a soft rear axle, and so does another yaw inertia: both are believed firmly.
R is learnt from what is left of r and a_y, as a density at low frequency. Covariances grow with
what is left of all of it, which is more on a real car than on a simulated one.
"""

from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from codegen import Scan
from codegen.arrays import Array
from identifier.estimate.drive import hardest
from identifier.estimate.nodes import JERKS, Nodes, low_passed
from identifier.estimate.posterior import Posterior
from identifier.estimate.priors import OF_AXLES, OF_CAR, SEDAN, Priors
from identifier.estimate.solve import around_beliefs, beliefs_cost, bounded_step, car_numbers
from identifier.motion.nodes import LATENT_NAMES, MEASURED, STATES, node_scan
from identifier.motion.parameters import INDEX, NAMES
from models.recordings import Recording
from models.vehicle import GRAVITY, Vehicle

_ROLL = 0.06  # by which a_y is larger in a car whose body rolls
_GYRO = 0.002  # sd of the bias of r of a sedan [rad/s]
_SWAY = 0.3  # sd of the share of the sway
_INERTIA = 0.007  # sd of ln I_z
_BLOCK = 600.0  # [s] that are smoothed at once
_BESIDE = 5.0  # [s] beside them that are smoothed, too
_LATE_SPAN = 60.0  # [s] of hardest cornering that tell the delay of a_y
_ANY_DELAY = 0.1  # [s] of a sedan, sd of a delay that is looked for
_MOST_LATE = 0.3  # [s] of a sedan, the largest delay
_SMALL_DELAY = 0.003  # [s] of a sedan, a delay that does not matter
_LOOKS = 4  # at a delay
_LEFT_LATE = 0.01  # [s] of a sedan, sd of what is left of a delay that was taken out
_SURELY_LATE = 3.0  # sd of a delay, above which it is taken out; a single step tells none
_GAINED = 8.0  # nats that a delay gains, more where more is left (`Trust.usual`)
_ALIKE = 1e-4  # probability from which another start's end counts
_STARTS = (-0.4, 0.4)  # of ln C: soft and stiff
_FIRM = 50.0  # times that beliefs count at first
_FEW = 8  # iterations of all descents but the last
_MOST_SLIP = 0.7  # |v_y/v_x|, at most
_MOST_LAGGED = 0.8  # lagged slip [rad], at most
_LOOKED = 0.25  # [s] over which what is left of a sensor is alike
_SHORTEST = 50  # nodes from which noise is learnt

N, P = len(STATES), len(NAMES)
OF_V_Y = ("v_y_bias", "v_y_angle", "v_y_lever")
FELT = {"a_y_bias": 0.015, "roll": 0.04, "a_y_delay": 0.0007, "a_y_lever": 0.01}  # sd; lever in L
AGAIN = ("steering_zero", "r_bias", "a_y_bias", "roll", "a_y_delay", "a_y_lever")  # of each log


@dataclass(frozen=True, slots=True, kw_only=True)
class _Trust:
    """How far curves, road and sensors are trusted; times and sensors as of a sedan.
    error, relative : what curves miss of a force [static axle loads], [-].
    error_time : for which it stays alike [s].
    bank, bank_time : sine of the bank of a road [-], and for which it lasts [s].
    push, turn : what no tire pushes: v_y [sqrt(g L)/sqrt(s)], r [(g/L)^(3/4)].
    lag : of lagged slip, from node to node [rad].   side_slip : at the first node [rad].
    r, a_y : what no noise explains of sensors [rad/s], [m/s²].
    a_y_share : the same of a_y over it [-].
    r_noise, a_y_noise : noise before it is learnt, in the same units.
    clip : standard deviations from which a residual counts less.
    parted : side slip by which two starts may part [rad].
    observable : largest standard deviation of side slip that is observed [rad].
    usual : mean of the squared residuals of a node, over their weights, from which covariances are
        those of the likelihood [-]; where more is left, they grow likewise.
    lasting : times by which drives tell less of parameters than their likelihood says [-]: what
        curves and roads miss lasts as long as a corner, and does not average out.
    """

    error: float = 0.01
    relative: float = 0.08
    error_time: float = 0.06
    bank: float = 0.04
    bank_time: float = 3.0
    push: float = 0.005
    turn: float = 0.02
    lag: float = 2e-4
    side_slip: float = 0.1
    r: float = 0.003
    a_y: float = 0.2
    a_y_share: float = 0.04
    r_noise: float = 0.003
    a_y_noise: float = 0.2
    clip: float = 3.0
    parted: float = 0.0035
    observable: float = 0.01
    usual: float = 0.25
    lasting: float = 2.0


TRUST = _Trust()


class LateralVelocity(NamedTuple):
    """v_y at each sample and its standard deviation [m/s], whether it is known, and what the
    accelerometer shows beside forces of tires [weights], (n,).
    steering_zero : found with it, and its standard deviation [rad], (2,).
    """

    v_y: Array
    sd: Array
    observable: NDArray[np.bool_]
    beside: Array
    steering_zero: Array


class _Around(NamedTuple):
    """Gauss-Newton's matrix and gradient: of states, of neighbors, border, of parameters."""

    A: Array
    O: Array  # noqa: E741
    B: Array
    C: Array
    g: Array
    g_p: Array


@dataclass(frozen=True, slots=True, eq=False)
class _Smoothed:
    """States (n, 8) and all parameters (p + 4,) at an optimum, its cost J [nats], R (2,), and
    covariances: of the states alone (n, 8, 8), of the parameters that move (m, m); dz/dp of v_y
    (n, m).
    """

    z: Array
    p: Array
    cost: float
    R: Array
    covariance: Array
    P: Array
    slopes: Array


def latent_priors(vehicle: Vehicle, beliefs: Priors, late: bool = False) -> Priors:
    """Return beliefs with those of the accelerometer behind, and of yaw rate and inertia.
    beliefs : of the car, of one of these, or of a log that came before.
    late : whether a delay of a_y was found and taken out, so that more of it may be left.
    """
    scale = float(np.sqrt(vehicle.wheelbase / SEDAN))
    information, moves = beliefs.information.copy(), beliefs.moves.copy()
    fixed = [INDEX[name] for name in ("ln_sway", *OF_V_Y)]
    information[fixed], information[:, fixed], moves[fixed] = 0.0, 0.0, False
    for axle in "fr":  # without v_y a sway at the usual frequency is all that is modeled
        k = INDEX[f"sway_share_{axle}"]
        information[k, k] += (_SWAY**-2 - OF_AXLES["sway_share"].sd ** -2) * moves[k]
    mean, bias, inertia = beliefs.mean.copy(), INDEX["r_bias"], INDEX["ln_inertia"]
    information[bias], information[:, bias], mean[bias] = 0.0, 0.0, 0.0  # another in each log
    information[bias, bias], moves[bias] = (_GYRO / scale) ** -2, True
    if not moves[inertia]:
        information[inertia, inertia], moves[inertia] = _INERTIA**-2, True
    felt = np.array(list(FELT.values())) * [1.0, 1.0, 1.0, vehicle.wheelbase]
    if late:
        felt[list(FELT).index("a_y_delay")] = _LEFT_LATE * scale
    whole = np.zeros((P + len(felt),) * 2)
    whole[:P, :P] = information
    whole[range(P, len(whole)), range(P, len(whole))] = felt**-2
    far = np.full(len(felt), np.inf)
    return replace(
        beliefs,
        mean=np.concatenate([mean, [0.0, _ROLL, 0.0, 0.0]]),
        low=np.concatenate([beliefs.low, -far]),
        high=np.concatenate([beliefs.high, far]),
        information=whole,
        moves=np.concatenate([moves, far > 0.0]),
    )


class _Latent:
    """The problem of a drive: its cost, and how it is minimized.
    priors : of `latent_priors`; what is fixed does not move.
    columns : which parameters slopes are taken over, (m,): those that move, and others whose doubt
        is to be given.
    """

    def __init__(
        self,
        nodes: Nodes,
        vehicle: Vehicle,
        priors: Priors,
        columns: NDArray[np.intp] | None = None,
        trust: _Trust = TRUST,
    ) -> None:
        self.nodes, self.vehicle, self.trust = nodes, vehicle, trust
        self.index = np.flatnonzero(priors.moves) if columns is None else columns
        self.free = np.flatnonzero(priors.moves[self.index])
        self.priors = priors
        self._slopes = node_scan(tuple(LATENT_NAMES[k] for k in self.index))
        self._plain = node_scan()
        self._car = car_numbers(vehicle)
        s, L = float(np.sqrt(vehicle.wheelbase / SEDAN)), vehicle.wheelbase
        self.scale = s
        self._times = np.array([trust.error_time * s, trust.bank_time * s])
        per = np.array([1.0 / s, 1.0])
        self._floor = per * (trust.r, trust.a_y)
        self.R = (per * (trust.r_noise, trust.a_y_noise)) ** 2
        dt, (T_e, T_p) = nodes.dt, self._times
        self._kept = np.exp(-dt / T_e)
        self._sd = np.array(
            [
                trust.push * vehicle.froude_speed * np.sqrt(dt / s),
                trust.turn * (GRAVITY / L) ** 0.75 * np.sqrt(dt),
                *(trust.lag, trust.lag, 1.0, 1.0, 1e-4),
                2.0 * trust.bank * np.sqrt(dt / T_p**3),
            ]
        )

    # The model over the nodes.

    def _run(self, scan: Scan, z: Array, p: Array, more: dict[str, Array]) -> dict[str, Array]:
        given = self.nodes.given
        with np.errstate(all="ignore"):
            return scan(
                len(z),
                {
                    **{"z": z, "z_next": _next(z), "given": given, "given_next": _next(given)},
                    **{"parameters": p[:P], "accelerometer": p[P:], "car": self._car},
                    **{"times": self._times, "dt": np.array(self.nodes.dt), **more},
                },
            )

    def variance(self, R: Array) -> Array:
        """Return the variance of what sensors show, (n, 2)."""
        found = np.tile(R + self._floor**2, (len(self.nodes.t), 1))
        found[:, 1] += (self.trust.a_y_share * self.nodes.given[:, 5]) ** 2
        return found

    def weights(self, z: Array, p: Array, R: Array) -> dict[str, Array]:
        """Return the weights of what is missed, by port of `node_scan`."""
        nodes, t = self.nodes, self.trust
        out = self._run(self._plain, z, p, {})
        phi = np.abs(out["force"])
        sd = np.tile(self._sd, (len(z), 1))
        between = (phi + _next(phi)) / 2
        sd[:, 4:6] = (t.error + t.relative * between) * np.sqrt(1.0 - self._kept**2)
        variance = self.variance(R)
        off = np.abs(nodes.measured - out["shows"]) / np.sqrt(variance)
        counts = nodes.counts[:, None]
        first = np.column_stack(
            [
                t.side_slip * nodes.given[:, 0],
                np.full(len(z), np.inf),
                np.full((len(z), 2), 0.01),
                t.error + t.relative * phi,
                np.full(len(z), t.bank),
                np.full(len(z), t.bank / self._times[1]),
            ]
        )
        return {
            "of_moves": np.where(nodes.goes[:, None], sd**-2, 0.0),
            "of_shows": np.where(counts, np.minimum(1.0, t.clip / np.maximum(off, 1e-9)), 0.0)
            / variance,
            "of_begins": np.where(nodes.begins[:, None], first**-2, 0.0),
        }

    def cost(self, z: Array, p: Array, weights: dict[str, Array]) -> float:
        """Return J with weights that are fixed [nats]."""
        total = self.misfit(z, p, weights) + beliefs_cost(self.priors, p)
        return float(np.nan_to_num(total, nan=np.inf))

    def value(self, z: Array, p: Array, R: Array) -> float:
        """Return J with Huber's loss, by which optima are compared [nats].

        A residual of o > c deviations has the weight c/o in `cost`, in which c o/2 is left of
        c o - c²/2.
        """
        weights = self.weights(z, p, R)
        share = weights["of_shows"] * self.variance(R)
        clipped = share[(share > 0.0) & (share < 1.0)]
        lost = 0.5 * self.trust.clip**2 * float(np.sum(1.0 / clipped - 1.0))
        return self.cost(z, p, weights) + lost

    def misfit(self, z: Array, p: Array, weights: dict[str, Array]) -> float:
        """Return J without what is believed [nats]."""
        out = self._run(self._plain, z, p, {})
        out["shows"] = out["shows"] - self.nodes.measured
        parts = (("moves", "of_moves"), ("shows", "of_shows"), ("begins", "of_begins"))
        return 0.5 * sum(float(np.sum(weights[w] * out[name] ** 2)) for name, w in parts)

    def around(self, z: Array, p: Array, weights: dict[str, Array]) -> tuple[_Around, Array]:
        """Return matrix and gradient at a point, and the slopes of what sensors show (n, 2, 8)."""
        m = len(self.index)
        sums = {"sums": np.zeros((m, m)), "slopes": np.zeros(m)}
        more = {"measured": self.nodes.measured, **weights, **sums}
        out = self._run(self._slopes, z, p, more)
        A, B, g = out["now"], out["border"], out["slope"]
        A[1:] += out["next"][:-1]
        B[1:] += out["border_next"][:-1]
        g[1:] += out["slope_next"][:-1]
        A[~self.nodes.counts] = np.eye(N)
        gradient, curvature = around_beliefs(self.priors, p)
        C = out["sums_final"] + curvature[np.ix_(self.index, self.index)]
        g_p = out["slopes_final"].ravel() + gradient[self.index]
        return _Around(A, out["both"][:-1], B, C, g, g_p), out["shows_z"]

    def _eliminated(self, at: _Around, damping: float) -> tuple[Array, Array]:
        """Return A⁻¹ g (8n,) and A⁻¹ B (8n, m)."""
        n = len(at.A)
        banded = np.zeros((2 * N, n * N))
        for i in range(N):
            for j in range(N):
                if i >= j:
                    banded[i - j, j::N] = at.A[:, i, j] * (1.0 + damping * (i == j))
                banded[N + i - j, j : (n - 1) * N : N] = at.O[:, i, j]
        from scipy.linalg import cho_solve_banded, cholesky_banded  # takes long to import

        factor = cholesky_banded(banded, lower=True, check_finite=False, overwrite_ab=True)
        right = np.hstack([at.g.reshape(-1, 1), at.B.reshape(n * N, -1)])
        X = cho_solve_banded((factor, True), right, overwrite_b=True, check_finite=False)
        return X[:, 0], X[:, 1:]

    def _step(self, at: _Around, p: Array, damping: float) -> tuple[Array, Array]:
        """Return the steps of states (n, 8) and of parameters that move."""
        x, X = self._eliminated(at, damping)
        free, index = self.free, self.index[self.free]
        B = at.B.reshape(len(X), -1)[:, free]
        S = at.C[np.ix_(free, free)] - B.T @ X[:, free]
        S += damping * np.diag(np.diag(at.C)[free])
        low, high = self.priors.low[index], self.priors.high[index]
        dp = bounded_step((S + S.T) / 2, at.g_p[free] - B.T @ x, p[index], low, high)
        return -(x + X[:, free] @ dp).reshape(-1, N), dp

    # The optimum.

    def begin(self, stiffer: float = 0.0) -> tuple[Array, Array]:
        """Return states whose rear axle does not slip, and the parameters that are believed.
        stiffer : by which ln C of both axles is larger.
        """
        v_x, delta = self.nodes.given[:, 0], self.nodes.given[:, 1]
        r = low_passed(self.nodes.measured[:, 0], 3.0 / self.scale, self.nodes.dt)
        l_f, l_r = self.vehicle.bicycle.l_f, self.vehicle.bicycle.l_r
        z, p = np.zeros((len(v_x), N)), self.priors.mean.copy()
        z[:, 0], z[:, 1] = l_r * r, r
        z[:, 2] = np.clip(delta - np.arctan((l_f + l_r) * r / v_x), -0.2, 0.2)
        z[~self.nodes.counts, 2:] = 0.0
        for axle in "fr":
            k = INDEX[f"ln_stiffness_{axle}"]
            p[k] += stiffer if self.priors.moves[k] else 0.0
        return z, p

    def settled(self, stiffer: float = 0.0) -> tuple[Array, Array]:
        """Return states and parameters near an optimum, where parameters do not run away."""
        firm = copy(self)
        firm.priors = replace(self.priors, information=_FIRM * self.priors.information)
        z, p, _ = firm.descend(*self.begin(stiffer), self.R, _FEW)
        return z, p

    def descend(self, z: Array, p: Array, R: Array, most: int = 25) -> tuple[Array, Array, float]:
        """Return states, parameters and cost at an optimum."""
        damping, v_x = 1e-4, self.nodes.given[:, 0]
        index = self.index[self.free]
        sd = np.diag(self.priors.information)[index] ** -0.5
        low, high = self.priors.low[index], self.priors.high[index]
        most_z = np.full(z.shape, np.inf)
        most_z[:, 0], most_z[:, 2:4] = _MOST_SLIP * v_x, _MOST_LAGGED
        for _ in range(most):
            weights = self.weights(z, p, R)
            cost = self.cost(z, p, weights)
            at, _ = self.around(z, p, weights)
            for _ in range(8):
                try:
                    dz, dp = self._step(at, p, damping)
                except np.linalg.LinAlgError:
                    damping = max(8.0 * damping, 1e-6)
                    continue
                z_then, p_then = np.clip(z + dz, -most_z, most_z), p.copy()
                p_then[index] = np.clip(p[index] + dp, low, high)
                reached = self.cost(z_then, p_then, weights)
                if reached < cost:
                    break
                damping = max(8.0 * damping, 1e-6)
            else:
                break
            moved = float(np.abs((z_then - z)[:, 0] / v_x).max())
            turned = float(np.abs((p_then - p)[index] / sd).max(initial=0.0))
            z, p, damping = z_then, p_then, max(damping / 6.0, 1e-9)
            if (moved < 3e-4 and turned < 0.05) or cost - reached < 0.02:
                break
        return z, p, self.value(z, p, R)

    def spread(self, z: Array, p: Array, R: Array) -> tuple[Array, Array, Array, Array]:
        """Return covariance of states alone (n, 8, 8), of parameters that move, dz/dp of v_y
        (n, m), and the slopes of what sensors show.
        """
        at, shows = self.around(z, p, self.weights(z, p, R))
        _, X = self._eliminated(at, 0.0)
        believed = around_beliefs(self.priors, p)[1][np.ix_(self.index, self.index)]
        measured = at.C - believed - at.B.reshape(len(X), -1).T @ X
        S = believed + measured / self.trust.lasting
        slopes, free = -X.reshape(len(z), N, -1)[:, 0], self.free
        fixed = np.setdiff1d(np.arange(len(self.index)), free)
        inverse: Array = np.asarray(np.linalg.inv(S[np.ix_(free, free)]), np.float64)
        if fixed.size:  # what moves makes up for a part of what is fixed
            slopes[:, fixed] -= slopes[:, free] @ inverse @ S[np.ix_(free, fixed)]
        n = len(z)
        M = at.A.copy()
        for k in range(n - 1):
            M[k + 1] -= at.O[k] @ np.linalg.solve(M[k], at.O[k].T)
        inv = np.linalg.inv(M)
        covariance = np.empty_like(inv)
        covariance[-1] = V = inv[-1]
        for k in range(n - 2, -1, -1):
            K = inv[k] @ at.O[k].T
            covariance[k] = V = inv[k] + K @ V @ K.T
        return covariance, inverse, slopes, shows

    def noise(self, z: Array, p: Array, covariance: Array, shows: Array, R: Array) -> Array:
        """Return R (2,) by what is left of each sensor: its density at low frequency."""
        residual = self.nodes.measured - self._run(self._plain, z, p, {})["shows"]
        doubt = np.einsum("nij,njk,nik->ni", shows, covariance, shows)
        found, on = R.copy(), self.nodes.counts
        lags = max(2, int(_LOOKED * self.scale / self.nodes.dt))
        if np.count_nonzero(on) < _SHORTEST:
            return found
        for i in range(len(MEASURED)):
            e = residual[on, i]
            most = 4.0 * float(np.median(np.abs(e))) / 0.6745
            e = np.clip(e, -most, most)
            power = max(float(np.mean(e**2)), 1e-18)
            alike = [
                2.0 * (1.0 - k / (lags + 1)) * float(np.mean(e[k:] * e[:-k])) / power
                for k in range(1, lags + 1)
            ]
            density = (power + float(np.mean(doubt[on, i]))) * max(1.0, 1.0 + sum(alike))
            known = self._floor[i] ** 2
            if i == 1:
                known += float(np.mean((self.trust.a_y_share * self.nodes.given[on, 5]) ** 2))
            found[i] = max(density - known, 1e-10)
        return found

    def smoothed(self, z: Array, p: Array, R: Array | None = None, rounds: int = 2) -> _Smoothed:
        """Return the optimum from a start, its noise learnt in some rounds.
        R : to begin with (2,); None takes that of good sensors.
        """
        R = self.R if R is None else R
        for _ in range(rounds):
            z, p, _ = self.descend(z, p, R, _FEW)
            covariance, _, _, shows = self.spread(z, p, R)
            R = self.noise(z, p, covariance, shows, R)
        z, p, cost = self.descend(z, p, R)
        covariance, P, slopes, _ = self.spread(z, p, R)
        left = 2.0 * self.misfit(z, p, self.weights(z, p, R)) / max(self.nodes.counts.sum(), 1)
        wider = max(1.0, left / self.trust.usual)
        return _Smoothed(z, p, cost, R, wider * covariance, wider * P, slopes)


class Learnt(NamedTuple):
    """What a drive without v_y taught: the posterior, where it is, and its states.
    parted : side slip by which the starts parted, rms [rad].
    """

    posterior: Posterior
    nodes: Nodes
    z: Array
    parted: float


def learn_latent(nodes: Nodes, vehicle: Vehicle, beliefs: Priors, *, late: bool = False) -> Learnt:
    """Return what the nodes of a drive teach.

    It begins with soft and with stiff tires. Where they end elsewhere, the covariance has the
    distance between both, by how probable they are.
    beliefs : of the car, or what other drives of it left.   late : as of `latent_priors`.
    """
    problem = _Latent(nodes, vehicle, latent_priors(vehicle, beliefs, late))
    first = problem.smoothed(*problem.settled(_STARTS[0]))
    z, p, cost = problem.descend(*problem.settled(_STARTS[1]), first.R)
    best, other = first, (z, p, cost)
    if cost < first.cost:
        best, other = problem.smoothed(z, p, first.R, 0), (first.z, first.p, first.cost)
    on, v_x = nodes.counts, nodes.given[:, 0]
    apart = ((best.z - other[0])[:, 0] / v_x)[on]
    share = 1.0 / (1.0 + np.exp(min(other[2] - best.cost, 50.0)))
    alike = share > _ALIKE and bool(on.any())  # else one of them explains the drive far worse
    parted = float(np.sqrt(np.mean(apart**2))) if alike else 0.0
    index = problem.index[problem.index < P]
    moved = problem.index < P
    away = (other[1] - best.p)[index]
    covariance = beliefs.covariance
    covariance[np.ix_(index, index)] = best.P[np.ix_(moved, moved)] + share * (
        1.0 - share
    ) * np.outer(away, away)
    return Learnt(
        Posterior(
            p=best.p[:P],
            covariance=covariance,
            slope=np.zeros(P),
            curvature=np.zeros((P, P)),
            seconds=float(np.count_nonzero(nodes.counts)) * nodes.dt,
            roads=np.zeros(0),
            road_sd=np.zeros(0),
            scale=np.ones(2),
            memory=np.full(2, TRUST.error_time),
            cost=best.cost,
        ),
        nodes,
        best.z,
        parted,
    )


def lateness(recording: Recording, vehicle: Vehicle, priors: Priors) -> float:
    """Return by how much a_y is later than the yaw rate [s], where that is no small matter.

    It is the delay with which the minute of hardest cornering is explained best, found as a
    parameter that is hardly believed, and taken out until nothing is left of it. 0 where it gains
    too little or is hardly known. Negative where a_y would have to be earlier, which no filter
    makes it: that is an error of the model, to be noted and never taken out.
    priors : as of `_Latent`.
    """
    part = hardest(recording, _LATE_SPAN)
    scale, dt = float(np.sqrt(vehicle.wheelbase / SEDAN)), recording.dt
    # Interpolation averages noise: what is smooth is not changed by it.
    smooth = low_passed(recording.needed("a_y"), JERKS / scale, dt)
    piece = replace(recording, a_y=smooth)
    delay = LATENT_NAMES.index("a_y_delay")
    information = priors.information.copy()
    information[delay, delay] = (_ANY_DELAY * scale) ** -2
    open_ = replace(priors, information=information)

    def problem(late: float, beliefs: Priors) -> _Latent:
        sway = float(priors.mean[INDEX["ln_sway"]])
        nodes = Nodes.of(piece, vehicle, part, a_y_late=late, ln_sway=sway)
        return _Latent(nodes, vehicle, beliefs)

    on_time = problem(0.0, priors)
    z, p, least = on_time.descend(*on_time.settled(), on_time.R)
    late = 0.0
    for _ in range(_LOOKS):
        z, p, _ = problem(late, open_).descend(z, p, on_time.R, _FEW)
        more, p[delay] = float(p[delay]), 0.0
        late = min(max(late + more, -_MOST_LATE * scale), _MOST_LATE * scale)
        if abs(more) < _SMALL_DELAY * scale:
            break
    if abs(late) < _SMALL_DELAY * scale:
        return 0.0
    found = problem(late, priors).descend(z, p, on_time.R)[2]
    count = max(on_time.nodes.counts.sum(), 1)
    enough = _GAINED * max(1.0, 2.0 * found / count / TRUST.usual)
    if least - found < enough:
        return 0.0
    then = problem(late, open_)
    variance = np.diag(then.spread(z, p, on_time.R)[1])[then.index[then.free] == delay]
    return late if late < 0.0 or late > _SURELY_LATE * np.sqrt(variance[0]) else 0.0


def estimate_v_y(
    recording: Recording, vehicle: Vehicle, p: Array, covariance: Array
) -> LateralVelocity:
    """Return the v_y of a drive on tires that are known, and how well.
    p, covariance : of the tires, as `motion.parameters` lists them (p,), (p, p).
    """
    again = np.array([LATENT_NAMES.index(name) for name in AGAIN])
    moves = np.isin(np.arange(len(LATENT_NAMES)), again)
    mean = np.where(moves[:P], 0.0, p)

    def fixed(late: bool) -> Priors:
        believed = latent_priors(vehicle, replace(Priors.of(vehicle), mean=mean), late)
        information = np.zeros_like(believed.information)
        information[again, again] = believed.information[again, again]
        return replace(believed, moves=moves, information=information)

    columns = np.flatnonzero(latent_priors(vehicle, Priors.of(vehicle)).moves)
    found_v_y = LateralVelocity(
        vehicle.bicycle.l_r * recording.r,
        TRUST.side_slip * np.maximum(recording.v_x, vehicle.lowest_speed),
        np.zeros(len(recording), dtype=bool),
        np.zeros(len(recording)),
        np.array([0.0, OF_CAR["steering_zero"].sd]),
    )
    longest, zero = 0, INDEX["steering_zero"]
    late = lateness(recording, vehicle, fixed(late=False))
    for outer, inner in _blocks(recording):
        sway = float(p[INDEX["ln_sway"]])
        nodes = Nodes.of(recording, vehicle, outer, a_y_late=max(late, 0.0), ln_sway=sway)
        if not nodes.counts.any():
            continue
        problem = _Latent(nodes, vehicle, fixed(late > 0.0), columns)
        found = problem.smoothed(*problem.begin(), rounds=1)
        known = np.flatnonzero(~moves[columns])
        tires, free = found.slopes[:, known], found.slopes[:, problem.free]
        index = columns[known]
        doubt = covariance[np.ix_(index, index)]
        variance = found.covariance[:, 0, 0] + np.einsum("ni,ij,nj->n", tires, doubt, tires)
        variance += np.einsum("ni,ij,nj->n", free, found.P, free)
        if nodes.counts.sum() > longest:
            longest, k = (
                nodes.counts.sum(),
                int(np.flatnonzero(problem.index[problem.free] == zero)[0]),
            )
            found_v_y.steering_zero[:] = found.p[zero], np.sqrt(found.P[k, k])
        bias, roll = (found.p[LATENT_NAMES.index(name)] for name in ("a_y_bias", "roll"))
        beside = bias + roll / GRAVITY * nodes.given[:, 5]
        _fill(found_v_y, recording, inner, nodes, found.z[:, 0], np.sqrt(variance), beside)
    for values in found_v_y:
        values.setflags(write=False)
    return found_v_y


def _blocks(recording: Recording) -> Iterator[tuple[slice, slice]]:
    """Yield parts of at most `_BLOCK`, with what is beside them, and alone."""
    n = max(round(_BLOCK / recording.dt), 1)
    beside = round(_BESIDE / recording.dt)
    for begin in range(0, len(recording), n):
        end = min(begin + n, len(recording))
        yield slice(max(begin - beside, 0), min(end + beside, len(recording))), slice(begin, end)


def _fill(
    found_v_y: LateralVelocity,
    recording: Recording,
    inner: slice,
    nodes: Nodes,
    v_y: Array,
    sd: Array,
    beside: Array,
) -> None:
    """Put v_y between nodes into its samples, run by run of nodes."""
    from scipy.interpolate import CubicSpline  # takes long to import

    firsts = np.flatnonzero(nodes.begins)
    lasts = np.flatnonzero(nodes.counts & ~nodes.goes)
    beyond = 1.5 * nodes.dt  # half a node, and what is left of a segment that makes none
    for first, last in zip(firsts, lasts, strict=True):
        if last - first < 3:
            continue
        run = slice(first, last + 1)
        t = nodes.t[run]
        a, b = np.searchsorted(recording.t, [t[0] - beyond, t[-1] + beyond])
        some = slice(max(int(a), inner.start), min(int(b), inner.stop))
        at = np.clip(recording.t[some], t[0], t[-1])
        spline = CubicSpline(t, v_y[run])
        found_v_y.v_y[some] = spline(at) + spline(at, 1) * (recording.t[some] - at)
        found_v_y.sd[some] = np.interp(at, t, sd[run])
        found_v_y.beside[some] = np.interp(at, t, beside[run])
        found_v_y.observable[some] = found_v_y.sd[some] < TRUST.observable * recording.v_x[some]


def _next(values: Array) -> Array:
    return np.concatenate([values[1:], values[-1:]])
