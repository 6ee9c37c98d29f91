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
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from codegen import Scan
from codegen.arrays import Array, one_thread, root_mean_square
from identifier.estimate.day import steering_zeros
from identifier.estimate.drive import hardest
from identifier.estimate.nodes import JERKS, Nodes, earlier, low_passed
from identifier.estimate.posterior import Posterior
from identifier.estimate.priors import OF_AXLES, OF_CAR, Priors
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
_ANY_PLACE = 0.3  # [L], sd of a place of the accelerometer that is looked for
_MOST_PLACE = 1.0  # [L], the farthest: it is in the car
_LEFT_PLACE = 0.05  # [L], sd of what is left of a place that was found
_SURELY = 3.0  # sd of a delay or a place, above which it is taken out; a single step tells none
_GAINED = 8.0  # nats that a delay or a place gains, more where more is left (`Trust.usual`)
_SAME = 4.0  # nats within which the one is as likely as the other, more as above
_ALIKE = 1e-4  # probability from which another start's end counts
_STARTS = (-0.4, 0.4)  # of ln C: soft and stiff
_FIRM = 50.0  # times that beliefs hold parameters at first, where the states are far off
_NEAR = 0.1  # the same near an optimum
_RIDGE = 1e-12  # of what states tell: rounding leaves it positive
_TRIALS, _WHOLE = 10, 3  # of a step, and those before it is halved
_ITERATIONS = 25  # of a descent, at most
_ENOUGH = 0.02  # [nats] of improvement, below which it ends
_FEW = 2  # iterations that show whether a delay is to be looked for
_PROMISED = 2.0  # nats that it gains by then; of random cars on time at most 3.7, late at least 7
_NEARLY = 0.2  # [nats], the same of all descents but the last
_MOST_SLIP = 0.7  # |v_y/v_x|, at most
_MOST_LAGGED = 0.8  # lagged slip [rad], at most
_LOOKED = 0.25  # [s] over which what is left of a sensor is alike
_SHORTEST = 50  # nodes from which noise is learnt

N, P = len(STATES), len(NAMES)
OF_V_Y = ("v_y_bias", "v_y_angle", "v_y_lever")
FELT = {"a_y_bias": 0.015, "roll": 0.04, "a_y_delay": 0.0007, "a_y_lever": 0.01}  # sd; lever in L
_DELAY, _PLACE = (LATENT_NAMES.index(name) for name in ("a_y_delay", "a_y_lever"))
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
    steering_zero : at the first, found with it, and its standard deviation [rad], (2,).
    """

    v_y: Array
    sd: Array
    observable: NDArray[np.bool_]
    beside: Array
    steering_zero: Array


class _Around(NamedTuple):
    """Gauss-Newton's matrix and gradient: of states, of neighbors, border, of parameters."""

    A: Array
    O: Array  # noqa: E741  # the letters are those of the blocks
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


def latent_priors(vehicle: Vehicle, beliefs: Priors, off: "Off | None" = None) -> Priors:
    """Return beliefs with those of the accelerometer behind, and of yaw rate and inertia.
    beliefs : of the car, of one of these, or of a log that came before.
    off : what was found of the accelerometer, so that more of it may be left.
    """
    scale = vehicle.scale
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
    if off is not None and (off.late > 0.0 or off.instead):
        felt[2] = (_ANY_DELAY if off.instead else _LEFT_LATE) * scale
    if off is not None and (off.place or off.instead):
        felt[3] = (_ANY_PLACE if off.instead else _LEFT_PLACE) * vehicle.wheelbase
    place = 0.0 if off is None else off.place
    whole = np.zeros((P + len(felt),) * 2)
    whole[:P, :P] = information
    whole[range(P, len(whole)), range(P, len(whole))] = felt**-2
    far = np.full(len(felt), np.inf)
    return replace(
        beliefs,
        mean=np.concatenate([mean, [0.0, _ROLL, 0.0, place]]),
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
        self.moves = np.flatnonzero(priors.moves)
        self.index = self.moves if columns is None else columns
        self.free = np.flatnonzero(priors.moves[self.index])
        self.priors = priors
        self._car = car_numbers(vehicle)
        self.scale = s = vehicle.scale
        L = vehicle.wheelbase
        self._believed = np.diag(priors.information)[self.moves]
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

    def seen(self, z: Array, p: Array) -> dict[str, Array]:
        """Return what the model misses at a point, by port of `node_scan`; `shows` of sensors."""
        out = self._run(node_scan(), z, p, {})
        out["missed"] = self.nodes.measured - out["shows"]
        return out

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

    def weights(self, seen: dict[str, Array], R: Array) -> dict[str, Array]:
        """Return the weights of what is missed, by port of `node_scan`."""
        nodes, t = self.nodes, self.trust
        phi = np.abs(seen["force"])
        n = len(phi)
        sd = np.tile(self._sd, (n, 1))
        between = (phi + _next(phi)) / 2
        sd[:, 4:6] = (t.error + t.relative * between) * np.sqrt(1.0 - self._kept**2)
        variance = self.variance(R)
        off = np.abs(seen["missed"]) / np.sqrt(variance)
        counts = nodes.counts[:, None]
        first = np.column_stack(
            [
                t.side_slip * nodes.given[:, 0],
                np.full(n, np.inf),
                np.full((n, 2), 0.01),
                t.error + t.relative * phi,
                np.full(n, t.bank),
                np.full(n, t.bank / self._times[1]),
            ]
        )
        return {
            "of_moves": np.where(nodes.goes[:, None], sd**-2, 0.0),
            "of_shows": np.where(counts, np.minimum(1.0, t.clip / np.maximum(off, 1e-9)), 0.0)
            / variance,
            "of_begins": np.where(nodes.begins[:, None], first**-2, 0.0),
        }

    def cost(self, seen: dict[str, Array], p: Array, weights: dict[str, Array]) -> float:
        """Return J with weights that are fixed [nats]."""
        total = _misfit(seen, weights) + beliefs_cost(self.priors, p)
        return float(np.nan_to_num(total, nan=np.inf))

    def value(self, seen: dict[str, Array], p: Array, R: Array) -> float:
        """Return J with Huber's loss, by which optima are compared [nats].

        A residual of o > c deviations has the weight c/o in `cost`, in which c o/2 is left of
        c o - c²/2.
        """
        weights = self.weights(seen, R)
        share = weights["of_shows"] * self.variance(R)
        clipped = share[(share > 0.0) & (share < 1.0)]
        lost = 0.5 * self.trust.clip**2 * float(np.sum(1.0 / clipped - 1.0))
        return self.cost(seen, p, weights) + lost

    def around(
        self, z: Array, p: Array, weights: dict[str, Array], over: NDArray[np.intp]
    ) -> tuple[_Around, Array]:
        """Return matrix and gradient at a point, and the slopes of what sensors show (n, 2, 8).
        over : parameters, (m,).
        """
        m = len(over)
        sums = {"sums": np.zeros((m, m)), "slopes": np.zeros(m)}
        more = {"measured": self.nodes.measured, **weights, **sums}
        out = self._run(node_scan(tuple(LATENT_NAMES[k] for k in over)), z, p, more)
        A, B, g = out["now"], out["border"], out["slope"]
        A[1:] += out["next"][:-1]
        B[1:] += out["border_next"][:-1]
        g[1:] += out["slope_next"][:-1]
        A[~self.nodes.counts] = np.eye(N)
        gradient, curvature = around_beliefs(self.priors, p)
        half = out["sums_final"]
        C = half + np.tril(half, -1).T + curvature[np.ix_(over, over)]
        g_p = out["slopes_final"].ravel() + gradient[over]
        return _Around(A, out["both"][:-1], B, C, g, g_p), out["shows_z"]

    def _factor(self, at: _Around) -> Array:
        """Return L of the states' matrix L Lᵀ, its bands as rows (16, 8n)."""
        n = len(at.A)
        banded = np.zeros((2 * N, n * N), order="F")
        for i in range(N):
            for j in range(N):
                if i >= j:
                    banded[i - j, j::N] = at.A[:, i, j] * (1.0 + _RIDGE * (i == j))
                banded[N + i - j, j : (n - 1) * N : N] = at.O[:, i, j]
        from scipy.linalg import cholesky_banded  # takes long to import

        return cholesky_banded(banded, lower=True, check_finite=False, overwrite_ab=True)

    def _steps(self, at: _Around, p: Array, firm: float) -> Iterator[tuple[Array, Array, float]]:
        """Yield steps of states (n, 8) and of parameters that move, each smaller than the one
        before, and by how many times beliefs these are held where they are.
        """
        index, L = self.moves, self._factor(at)
        y, Y = _solved(L, at.g.ravel()), _solved(L, at.B.reshape(L.shape[1], -1))
        S, slope = at.C - Y.T @ Y, at.g_p - Y.T @ y
        low, high, held = self.priors.low[index], self.priors.high[index], self._believed
        for k in range(_TRIALS):
            dp = bounded_step((S + S.T) / 2 + firm * np.diag(held), slope, p[index], low, high)
            share = min(1.0, 2.0 ** (_WHOLE - k))
            yield -share * _solved(L, y + Y @ dp, "T").reshape(-1, N), share * dp, firm
            firm = max(8.0 * firm, 0.1)

    # The optimum.

    def begin(self, stiffer: float = 0.0, off: "Off | None" = None) -> tuple[Array, Array, float]:
        """Return states whose rear axle does not slip, the parameters that are believed, and how
        firmly.
        stiffer : by which ln C of both axles is larger.
        off : whose parameters are taken in their place, and its states if they are of these nodes.
        """
        if off is not None and np.array_equal(off.t, self.nodes.t):
            return off.z, off.p, _NEAR
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
        return z, p if off is None else off.p, _FIRM

    def descend(
        self,
        z: Array,
        p: Array,
        firm: float,
        R: Array,
        *,
        enough: float = _ENOUGH,
        most: int = _ITERATIONS,
    ) -> tuple[Array, Array, float]:
        """Return states, parameters and cost at an optimum.
        firm : times that beliefs hold the parameters where they are at first: where states are far
            off these diverge.
        enough : improvement of the cost, below which it ends [nats].   most : iterations.
        """
        index, most_z = self.moves, np.full(z.shape, np.inf)
        most_z[:, 0], most_z[:, 2:4] = _MOST_SLIP * self.nodes.given[:, 0], _MOST_LAGGED
        seen = self.seen(z, p)
        for _ in range(most):
            weights = self.weights(seen, R)
            cost = self.cost(seen, p, weights)
            at, _ = self.around(z, p, weights, index)
            for dz, dp, held in self._steps(at, p, firm):
                z_then, p_then = np.clip(z + dz, -most_z, most_z), p.copy()
                p_then[index] += dp
                then = self.seen(z_then, p_then)
                reached = self.cost(then, p_then, weights)
                if reached < cost:
                    z, p, seen, firm = z_then, p_then, then, max(held / 6.0, 1e-4)
                    break
            else:
                break
            if cost - reached < enough:
                break
        return z, p, self.value(seen, p, R)

    def _states(
        self, z: Array, p: Array, R: Array, over: NDArray[np.intp]
    ) -> tuple[_Around, Array, Array, Array]:
        """Return matrix and gradient, L, covariance of the states alone (n, 8, 8), and the slopes
        of what sensors show.
        """
        at, shows = self.around(z, p, self.weights(self.seen(z, p), R), over)
        L, n = self._factor(at), len(z)
        own = np.zeros((n, N, N))  # L of each node
        for i in range(N):
            for j in range(i + 1):
                own[:, i, j] = L[i - j, j::N]
        root = np.linalg.inv(own)
        inv = root.swapaxes(1, 2) @ root
        K = inv[:-1] @ at.O.swapaxes(1, 2)
        covariance = inv.copy()
        for k in range(n - 2, -1, -1):
            covariance[k] += K[k] @ covariance[k + 1] @ K[k].T
        return at, L, covariance, shows

    def spread(self, z: Array, p: Array, R: Array) -> tuple[Array, Array, Array]:
        """Return covariance of states alone (n, 8, 8), of parameters that move, and dz/dp of v_y
        (n, m).
        """
        at, L, covariance, _ = self._states(z, p, R, self.index)
        Y = _solved(L, at.B.reshape(L.shape[1], -1))
        believed = around_beliefs(self.priors, p)[1][np.ix_(self.index, self.index)]
        S = believed + (at.C - believed - Y.T @ Y) / self.trust.lasting
        slopes, free = -_solved(L, Y, "T").reshape(len(z), N, -1)[:, 0], self.free
        fixed = np.setdiff1d(np.arange(len(self.index)), free)
        inverse = np.asarray(np.linalg.inv(S[np.ix_(free, free)]), np.float64)
        if fixed.size:  # what moves makes up for a part of what is fixed
            slopes[:, fixed] -= slopes[:, free] @ inverse @ S[np.ix_(free, fixed)]
        return covariance, inverse, slopes

    def noise(self, residual: Array, covariance: Array, shows: Array, R: Array) -> Array:
        """Return R (2,) by what is left of each sensor (n, 2): its density at low frequency."""
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

    def smoothed(
        self, z: Array, p: Array, firm: float, R: Array | None = None, *, rounds: int = 2
    ) -> _Smoothed:
        """Return the optimum from a start, its noise learnt in some rounds.
        firm : as of `descend`.   R : to begin with (2,); None takes that of good sensors.
        """
        R = self.R if R is None else R
        for _ in range(rounds):
            z, p, _ = self.descend(z, p, firm, R, enough=_NEARLY)
            firm = _NEAR
            _, _, covariance, shows = self._states(z, p, R, self.moves)
            R = self.noise(self.seen(z, p)["missed"], covariance, shows, R)
        z, p, cost = self.descend(z, p, firm, R)
        covariance, P, slopes = self.spread(z, p, R)
        seen = self.seen(z, p)
        left = 2.0 * _misfit(seen, self.weights(seen, R)) / max(self.nodes.counts.sum(), 1)
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


def learn_latent(
    nodes: Nodes, vehicle: Vehicle, beliefs: Priors, off: "Off | None" = None
) -> Learnt:
    """Return what the nodes of a drive teach.

    It begins with soft and with stiff tires. Where they end elsewhere, the covariance has the
    distance between both, by how probable they are.
    beliefs : of the car, or what other drives of it left.
    off : of the drive, from whose end the soft start goes on; None begins afresh.
    """
    problem = _Latent(nodes, vehicle, latent_priors(vehicle, beliefs, off))
    first = problem.smoothed(*problem.begin(_STARTS[0], off))
    z, p, cost = problem.descend(*problem.begin(_STARTS[1]), first.R, enough=_NEARLY)
    best, other = first, (z, p, cost)
    if cost < first.cost - _NEARLY:
        best = problem.smoothed(z, p, _NEAR, first.R, rounds=0)
        other = (first.z, first.p, first.cost)
    on, v_x = nodes.counts, nodes.given[:, 0]
    apart = ((best.z - other[0])[:, 0] / v_x)[on]
    share = 1.0 / (1.0 + np.exp(min(other[2] - best.cost, 50.0)))
    alike = share > _ALIKE and bool(on.any())  # else one of them explains the drive far worse
    parted = root_mean_square(apart) if alike else 0.0
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


class Off(NamedTuple):
    """What is off with an accelerometer: by how much a_y is later than the yaw rate [s], and how
    far ahead of the center of gravity it is measured [m]; instead of the one the other where the
    drive cannot tell, else 0. With it were found states z (n, 8) at times t (n,), and all
    parameters p.
    """

    late: float
    place: float
    instead: float
    t: Array
    z: Array
    p: Array


def accelerometer_off(recording: Recording, vehicle: Vehicle, priors: Priors) -> Off:
    """Return what is off with the accelerometer of a log, where that is no small matter.

    A late a_y and one that is measured behind the center of gravity look much alike. The minute of
    hardest cornering is explained with either as a parameter that is hardly believed, and with
    both: what explains it best is taken, one of them where it does. A delay is taken out until
    nothing is left of it. Nothing is taken that gains too little or is hardly known. A delay is
    negative where a_y would have to be earlier, which no filter makes it: that is an error of the
    model, to be noted and never taken out.
    priors : as of `_Latent`.
    """
    part = hardest(recording, _LATE_SPAN)
    scale, dt, L = vehicle.scale, recording.dt, vehicle.wheelbase
    # Interpolation averages noise: what is smooth is not changed by it.
    smooth = low_passed(recording.needed("a_y"), JERKS / scale, dt)
    piece, small = replace(recording, a_y=smooth), _SMALL_DELAY * scale
    wide = {_DELAY: _ANY_DELAY * scale, _PLACE: _ANY_PLACE * L}

    def problem(late: float, mean: Array, *wanted: int) -> _Latent:
        sway, information = float(priors.mean[INDEX["ln_sway"]]), priors.information.copy()
        for k in wanted:
            information[k, k] = wide[k] ** -2
        nodes = Nodes.of(piece, vehicle, part, a_y_late=late, ln_sway=sway)
        return _Latent(nodes, vehicle, replace(priors, mean=mean, information=information))

    on_time = problem(0.0, priors.mean)
    t, R = on_time.nodes.t, on_time.R
    z, p, least = on_time.descend(*on_time.begin(_STARTS[0]), R, enough=_NEARLY)
    none = Off(0.0, 0.0, 0.0, t, z, p)
    _, _, promised = problem(0.0, priors.mean, *wide).descend(
        z, p, _NEAR, R, enough=_NEARLY, most=_FEW
    )
    if least - promised < _PROMISED:
        return none

    def explained(*wanted: int) -> tuple[float, Off]:
        """Return what is left with some of both, and what they are; 0 that is hardly known."""
        late, z, p = 0.0, none.z, none.p
        for _ in range(_LOOKS):
            z, p, _ = problem(late, priors.mean, *wanted).descend(z, p, _NEAR, R, enough=_NEARLY)
            more = float(p[_DELAY]) if _DELAY in wanted else 0.0
            p[_DELAY] -= more
            late = min(max(late + more, -_MOST_LATE * scale), _MOST_LATE * scale)
            if abs(more) < small:
                break
        then, mean = problem(late, priors.mean, *wanted), priors.mean.copy()
        sd = dict(zip(then.moves, np.sqrt(np.diag(then.spread(z, p, R)[1])), strict=True))
        mean[_PLACE] = p[_PLACE] if _PLACE in wanted else 0.0
        z, p, left = problem(late, mean).descend(z, p, _NEAR, R, enough=_NEARLY)
        known = abs(late) > max(small, _SURELY * sd[_DELAY] * (late > 0.0))
        placed = _SURELY * sd[_PLACE] < abs(mean[_PLACE]) < _MOST_PLACE * L
        surely = known >= (_DELAY in wanted) and placed >= (_PLACE in wanted)
        return left if surely else np.inf, Off(late, float(mean[_PLACE]), 0.0, t, z, p)

    more = max(1.0, 2.0 * promised / max(on_time.nodes.counts.sum(), 1) / TRUST.usual)
    either = [explained(_DELAY), explained(_PLACE)]
    (left, best), (other, second) = sorted(either, key=lambda one: one[0])
    if least - left < _GAINED * more:
        return none
    both, off = explained(_DELAY, _PLACE)
    if left - both > _GAINED * more and off.late > 0.0:
        return off
    if other - left < _SAME * more:
        best, second = (best, second) if best.late >= 0.0 else (second, best)
        return best._replace(instead=second.late or second.place)
    return best if best.late >= 0.0 else none._replace(late=best.late)


@one_thread
def estimate_v_y(
    recording: Recording, vehicle: Vehicle, p: Array, covariance: Array
) -> LateralVelocity:
    """Return the v_y of a drive on tires that are known, and how well.
    p, covariance : of the tires, as `motion.parameters` lists them (p,), (p, p).
    """
    again = np.array([LATENT_NAMES.index(name) for name in AGAIN])
    moves = np.isin(np.arange(len(LATENT_NAMES)), again)
    mean = np.where(moves[:P], 0.0, p)

    def fixed(off: Off | None = None) -> Priors:
        believed = latent_priors(vehicle, replace(Priors.of(vehicle), mean=mean), off)
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
    zeros = steering_zeros(recording, vehicle)
    recording = replace(recording, delta_f=recording.delta_f - zeros)
    off = accelerometer_off(recording, vehicle, fixed())
    for outer, inner in _blocks(recording):
        sway = float(p[INDEX["ln_sway"]])
        nodes = Nodes.of(recording, vehicle, outer, a_y_late=max(off.late, 0.0), ln_sway=sway)
        if not nodes.counts.any():
            continue
        problem = _Latent(nodes, vehicle, fixed(off), columns)
        found = problem.smoothed(*problem.begin(off=off), rounds=1)
        known = np.flatnonzero(~moves[columns])
        tires, free = found.slopes[:, known], found.slopes[:, problem.free]
        index = columns[known]
        doubt = covariance[np.ix_(index, index)]
        variance = found.covariance[:, 0, 0] + np.einsum("ni,ij,nj->n", tires, doubt, tires)
        variance += np.einsum("ni,ij,nj->n", free, found.P, free)
        if nodes.counts.sum() > longest:
            longest, k = nodes.counts.sum(), np.searchsorted(problem.moves, zero)
            found_v_y.steering_zero[:] = found.p[zero], np.sqrt(found.P[k, k])
        bias, roll = (found.p[LATENT_NAMES.index(name)] for name in ("a_y_bias", "roll"))
        turning = np.gradient(found.z[:, 1], nodes.dt)
        beside = bias + (roll * nodes.given[:, 5] + found.p[_PLACE] * turning) / GRAVITY
        _fill(found_v_y, recording, inner, nodes, found.z[:, 0], np.sqrt(variance), beside)
    for one in recording.segments if off.late > 0.0 else ():
        felt = recording.needed("a_y")[one]
        found_v_y.beside[one] += (felt - earlier(felt, off.late / recording.dt)) / GRAVITY
    found_v_y.steering_zero[0] -= (1.0 + p[INDEX["steering_gain"]]) * zeros[0]
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
        found_v_y.v_y[some] = _between(t, v_y[run], at, recording.t[some])
        found_v_y.sd[some] = np.interp(at, t, sd[run])
        found_v_y.beside[some] = np.interp(at, t, beside[run])
        found_v_y.observable[some] = found_v_y.sd[some] < TRUST.observable * recording.v_x[some]


def _between(t: Array, value: Array, at: Array, beyond: Array) -> Array:
    """Return a cubic through values at times t, and straight on where instants are beyond these."""
    rate = np.gradient(value, t)
    k = np.clip(np.searchsorted(t, at, side="right") - 1, 0, len(t) - 2)
    h = t[k + 1] - t[k]
    s, change = (at - t[k]) / h, value[k + 1] - value[k]
    bend = (1.0 - s) * (h * rate[k] - change) + s * (change - h * rate[k + 1])
    return value[k] + s * (change + (1.0 - s) * bend) + np.interp(at, t, rate) * (beyond - at)


def _misfit(seen: dict[str, Array], weights: dict[str, Array]) -> float:
    """Return J without what is believed [nats]."""
    parts = (("moves", "of_moves"), ("missed", "of_shows"), ("begins", "of_begins"))
    return 0.5 * sum(float(np.sum(weights[w] * seen[name] ** 2)) for name, w in parts)


def _solved(L: Array, right: Array, trans: str = "N") -> Array:
    """Return L⁻¹ of columns, or L⁻ᵀ; L as of `_factor`."""
    from scipy.linalg.lapack import dtbtrs

    return dtbtrs(L, right, uplo="L", trans=trans)[0]


def _next(values: Array) -> Array:
    return np.concatenate([values[1:], values[-1:]])
