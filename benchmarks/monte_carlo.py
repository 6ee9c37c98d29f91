"""The proven bounds of a design against drives: how far does the identifier really go?

Each drive has its own road, steering and initial weights; the identifier runs over all of them at
one by one, and keeps nothing but the largest norms. Sensors err as much as is declared.
Only drives that break a declared condition (slip, speed, steering, yaw rate) are left out: a bound
that is passed is wrong.
"""

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from codegen import Scan
from codegen.arrays import Array
from identifier.certificate import Certificate
from identifier.driving import SPEED_SPREAD, Driving
from identifier.paper.design import PaperIdentifier
from identifier.paper.network import Weights
from identifier.paper.step import CARRY, GAINS, OVER, Structure, build_step
from identifier.stability.operation import declared_signals, largest_steering_rate
from models.bicycle import BicycleParameters, bicycle, slip_angles
from models.vehicle import GRAVITY, Vehicle

# Random smooth drives of a bicycle on saturating tires, in compiled code.
#
# The tire is F = μ F_z sin(1.5 atan(C α/(1.5 μ F_z))): the stiffness that the vehicle states, and
# the friction limit. The residual f that the identifier sees of a drive is known exactly: (ξ_{k+1}
# - ξ_k)/dt - A_ξ ξ_k - B_ξ u_k.

SUBSTEPS = 10  # of the plant in a sample
HARD = (0.6, 1.3)  # lateral acceleration that is asked of the linear car, over friction x g
UNDERSTEER = 0.05  # rad/g, up to which steering makes up for it


class Drives(NamedTuple):
    """Drives of n samples: v_x (N, n) [m/s], x = [v_y, r] and u = [δ_f, δ_r] (N, n, 2), SI."""

    v_x: Array
    x: Array
    u: Array


def smooth_steering(rng: np.random.Generator, t: Array, *, highest: float, peak: float) -> Array:
    """Return a sum of sines up to a frequency, faded in, (n, 2) [rad]; both axles may steer.

    Parameters
    ----------
    t : times [s].
    highest : largest frequency [Hz].
    peak : largest angle of the front axle [rad].
    """
    frequencies = rng.uniform(min(0.05, highest / 2), highest, 6)
    sines = np.sin(2 * np.pi * np.outer(t, frequencies) + rng.uniform(0, 2 * np.pi, 6))
    wave = sines @ rng.standard_normal(6) * np.clip(t, 0.0, 1.0) ** 2
    rear = rng.choice([0.0, rng.uniform(-0.15, 0.15)])
    angles: Array = peak * np.column_stack([wave, rear * wave]) / np.abs(wave).max()
    return angles


def random_drives(
    vehicle: Vehicle,
    rng: np.random.Generator,
    count: int,
    *,
    driving: Driving,
    duration: float,
    dt: float,
) -> Drives:
    """Return drives straight from rest in the car's frame (v_y = r = 0), some of them too hard.

    Parameters
    ----------
    count : number of drives N.
    driving : how hard; each drive has a friction from 0.3 times the declared one on.
    duration : of a drive [s].
    dt : sampling interval [s].
    """
    n = round(duration / dt)
    t: Array = np.arange(n, dtype=np.float64) * dt
    road = driving.friction * rng.uniform(0.3, 1.0, count)
    stiffness = np.array([vehicle.cornering_stiffness_front, vehicle.cornering_stiffness_rear])
    slips_at = driving.slip * float((stiffness / np.array(vehicle.axle_loads)).min())  # in g
    lateral = np.minimum(road, slips_at) * GRAVITY * rng.uniform(*HARD, count)
    peak = vehicle.wheelbase * lateral / driving.v_x**2
    peak = peak + lateral / GRAVITY * rng.uniform(0.0, UNDERSTEER, count)
    highest = driving.bandwidth * rng.uniform(0.3, 1.0, count)
    u = np.array(
        [smooth_steering(rng, t, highest=h, peak=p) for h, p in zip(highest, peak, strict=True)]
    )
    swing = np.sin(2 * np.pi * np.outer(rng.uniform(0.05, 0.1, count), t))
    speed = driving.v_x * (1.0 + SPEED_SPREAD * swing)
    return driven(vehicle, u, speed, road, dt)


def driven(vehicle: Vehicle, u: Array, speed: Array, road: Array, dt: float) -> Drives:
    """Drive the bicycle on saturating tires from v_y = r = 0.

    Parameters
    ----------
    u : steering (N, n, 2) [rad].
    speed : v_x (N, n) [m/s].
    road : friction (N,).
    dt : sampling interval [s].
    """
    plant, n, car = _plant(), speed.shape[1], np.array(vehicle.bicycle)
    x = [
        plant(
            n,
            {
                "x": np.zeros(2),
                "u": steering,
                "u_ahead": np.concatenate([steering[1:], steering[-1:]]),
                "v_x": v_x,
                "vehicle": car,
                "road": np.array([friction, dt]),
            },
        )["x"]
        for steering, v_x, friction in zip(u, speed, road, strict=True)
    ]
    return Drives(speed, np.stack(x), u)


def within(vehicle: Vehicle, drives: Drives, driving: Driving, dt: float) -> NDArray[np.bool_]:
    """Return which drives keep every condition but friction, the road's own, (N,).

    Parameters
    ----------
    dt : sampling interval [s].
    """
    most, rates = declared_signals(vehicle, driving), largest_steering_rate(vehicle, driving)
    speed = driving.v_x * (1.0 + SPEED_SPREAD * (1.0 + 1e-9))
    slowest = driving.v_x * (1.0 - SPEED_SPREAD * (1.0 + 1e-9))
    kept = (np.abs(slips(vehicle, drives)) <= driving.slip).all(axis=(1, 2))
    kept &= ((drives.v_x <= speed) & (drives.v_x >= slowest)).all(axis=1)
    kept &= (np.abs(np.diff(drives.v_x)) <= driving.friction * GRAVITY * dt).all(axis=1)
    for values, names in ((drives.x, ("v_y", "r")), (drives.u, ("delta_f", "delta_r"))):
        kept &= (np.abs(values) <= [most[name] for name in names]).all(axis=(1, 2))
    moved = np.abs(np.diff(drives.u, axis=1)) / dt
    kept &= (moved <= rates).all(axis=(1, 2))
    return np.asarray(kept)


def measured(drives: Drives, driving: Driving, rng: np.random.Generator) -> Drives:
    """Return what sensors within the declared errors tell of the drives.

    On each drive their errors are white, or as large as declared with a sign that stays, that
    turns at every sample, or that turns at random.
    """
    count, n = drives.v_x.shape
    kind = np.asarray(rng.integers(0, 4, count))[:, None, None]
    sign = np.where(rng.random((count, 1, 5)) < 0.5, -1.0, 1.0)
    turning = np.where(np.arange(n) % 2 == 0, 1.0, -1.0)[None, :, None]
    white = rng.uniform(-1.0, 1.0, (count, n, 5))
    pattern = np.choose(
        kind, [white, sign + 0.0 * white, sign * turning + 0.0 * white, np.sign(white)]
    )
    size = (driving.noise_v_x, driving.noise_v_y, driving.noise_r, *(driving.noise_delta,) * 2)
    errors = pattern * np.array(size)
    return Drives(
        drives.v_x + errors[..., 0], drives.x + errors[..., 1:3], drives.u + errors[..., 3:]
    )


def residuals(vehicle: Vehicle, drives: Drives, dt: float) -> Array:
    """Return what the samples show of f, (N, n - 1, 2) [N].

    Parameters
    ----------
    dt : sampling interval [s].
    """
    model = bicycle(vehicle.bicycle, 1.0)
    K_inv = np.array(ca.DM(model.K_inv))
    v_y, r = drives.x[..., 0], drives.x[..., 1]
    alpha = slips(vehicle, drives)
    linear = alpha * [vehicle.cornering_stiffness_front, vehicle.cornering_stiffness_rear]
    turning = np.stack([-drives.v_x * r, np.zeros_like(v_y)], axis=-1) @ K_inv.T
    known = linear + turning  # A_ξ ξ + B_ξ u of (7)
    found: Array = np.diff(drives.x @ K_inv.T, axis=1) / dt - known[:, :-1]
    return found


def slips(vehicle: Vehicle, drives: Drives) -> Array:
    """Return [α_f, α_r] of (3), small angles, (N, n, 2) [rad]."""
    lever = np.array([vehicle.l_f, -vehicle.l_r])
    v_y, r = drives.x[..., :1], drives.x[..., 1:]
    angles: Array = drives.u - (v_y + lever * r) / drives.v_x[..., None]
    return angles


@cache
def _plant() -> Scan:
    return Scan(saturating_bicycle(), carry=("x",), over=("u", "u_ahead", "v_x"))


def _magic(y: Any) -> Any:
    """sin(1.5 atan(y)) = 3 s - 4 s³ with s = sin(atan(y)/2)."""
    c = 1.0 / ca.sqrt(1.0 + y * y)
    s = y * c / ca.sqrt(2.0 + 2.0 * c)
    return s * (3.0 - 4.0 * s * s)


def saturating_bicycle() -> ca.Function:
    """Return a sample of the bicycle: x (2,), u and u_ahead (2,), v_x, vehicle (6,) -> x_next.

    Its input road = [μ, sampling interval [s]]; the steering moves from u to u_ahead meanwhile.
    """
    x, u, u_ahead, v_x = (
        ca.SX.sym(n, k) for n, k in (("x", 2), ("u", 2), ("u_ahead", 2), ("v_x", 1))
    )
    parameters, road = ca.SX.sym("vehicle", 6), ca.SX.sym("road", 2)
    p = BicycleParameters(*ca.vertsplit(parameters))
    friction, dt = ca.vertsplit(road)
    load = p.m * GRAVITY / (p.l_f + p.l_r)

    def rate(x: Any, u: Any) -> Any:
        alpha = slip_angles(p.l_f, p.l_r, v_x, x, u)
        peak = ca.vertcat(friction * load * p.l_r, friction * load * p.l_f)
        C = ca.vertcat(p.C_f, p.C_r)
        F = peak * _magic(C * alpha / (1.5 * peak))
        return ca.vertcat((F[0] + F[1]) / p.m - v_x * x[1], (p.l_f * F[0] - p.l_r * F[1]) / p.I_z)

    now = x
    for k in range(SUBSTEPS):
        h = dt / SUBSTEPS
        here = u + (k + 0.5) / SUBSTEPS * (u_ahead - u)
        middle = now + h / 2 * rate(now, here)
        now = now + h * rate(middle, here)
    return ca.Function(
        "saturating_bicycle",
        [x, u, u_ahead, v_x, parameters, road],
        [now],
        ["x", "u", "u_ahead", "v_x", "vehicle", "road"],
        ["x_next"],
    )


PEAKS = ("peak_xi_tilde", "peak_W", "peak_V")
DURATION = 15.0  # s
FEWEST = 256  # drives that are drawn at a time
TRIES = 20  # drives that are drawn for each that is wanted, before it is given up


class Observed(NamedTuple):
    """What happened on N drives.

    xi_tilde, W, V : largest norm on each drive (N,) [U s], [U], [-]; not finite: diverged.
    residual : sup|f| of each drive, without noise (N,) [U].
    outside : drives that were left out.
    """

    xi_tilde: Array
    W: Array
    V: Array
    residual: Array
    outside: int

    @property
    def diverged(self) -> int:
        """Drives on which the identifier diverged."""
        return int(np.count_nonzero(~np.isfinite(self.xi_tilde + self.W + self.V)))


class Beginning(NamedTuple):
    """Largest weights that a drive may begin with: |W_hat(0)| [U] and |V_hat(0)| [-]."""

    W: float
    V: float


def monte_carlo(
    design: PaperIdentifier,
    vehicle: Vehicle,
    driving: Driving,
    count: int,
    *,
    beginning: Beginning,
    rng: np.random.Generator,
    progress: Callable[[int], None] = lambda _: None,
) -> Observed:
    """Run the identifier over random drives that keep what was declared.

    Parameters
    ----------
    count : number of drives N.
    beginning : largest first weights; every second drive resumes with some W.
    rng : source of roads, steering, noise and initial weights.
    progress : told after each part how many drives are done.

    Raises
    ------
    ValueError
        Where hardly a drive keeps to what was declared.
    """
    size = max(FEWEST, count // 10)
    found: list[tuple[Array, ...]] = []
    done = outside = 0
    while done < count:
        drawn = random_drives(vehicle, rng, size, driving=driving, duration=DURATION, dt=design.dt)
        chosen = np.flatnonzero(within(vehicle, drawn, driving, design.dt))[: count - done]
        last = chosen[-1] + 1 if chosen.size else size
        outside += int(last - chosen.size)
        done += chosen.size
        if outside > TRIES * max(count, size):
            raise ValueError(
                f"of {done + outside} drives only {done} kept to a slip of {driving.slip:.3g} rad "
                f"at {driving.v_x:.3g} m/s and {driving.bandwidth:.3g} Hz: judge harder driving"
            )
        if chosen.size:
            kept = Drives(*(values[chosen] for values in drawn))
            residual = np.linalg.norm(residuals(vehicle, kept, design.dt), axis=2).max(axis=1)
            log = measured(kept, driving, rng)
            peaks = largest_norms(
                design, vehicle, log, first_weights(design, chosen.size, beginning, rng)
            )
            found.append((*peaks, residual / design.force_unit))
            progress(done)
    xi_tilde, W, V, residual = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return Observed(xi_tilde, W, V, residual, outside)


def first_weights(
    design: PaperIdentifier, count: int, beginning: Beginning, rng: np.random.Generator
) -> Weights:
    """Return first weights of N drives: W (N, 2, n_h), zero on every second, and V (N, n_h, n_in).

    Parameters
    ----------
    count : number of drives N.
    """
    V = np.stack([design.network.initial_weights(rng).V for _ in range(count)])
    W = rng.standard_normal((count, 2, design.network.hidden))
    share = rng.random(count) * (np.arange(count) % 2)
    W *= (share * beginning.W / np.linalg.norm(W, axis=(1, 2)))[:, None, None]
    V *= np.minimum(1.0, beginning.V / np.linalg.norm(V, axis=(1, 2)))[:, None, None]
    return Weights(W=W, V=V)


def largest_norms(
    design: PaperIdentifier, vehicle: Vehicle, drives: Drives, weights: Weights
) -> tuple[Array, Array, Array]:
    """Return the largest norms of ξ̃, W and V on each drive, (N,) each.

    Parameters
    ----------
    drives : as measured; the observer begins at the first sample.
    """
    count, n = drives.v_x.shape
    K_inv = np.array(ca.DM(bicycle(vehicle.bicycle, 1.0).K_inv)) / design.force_unit
    law, begun = _law(design.structure), drives.x[:, 0] @ K_inv.T
    shared = {
        "z": np.zeros(2),
        "vehicle": np.array(vehicle.bicycle),
        "A_d": design.gains.matrix,
        "gains": np.array([getattr(design.gains, name) for name in GAINS]),
        "sampling": np.array([design.dt, design.force_unit, design.min_speed]),
        **dict.fromkeys(PEAKS, np.zeros(())),
    }
    found = np.empty((len(PEAKS), count))
    for i in range(count):
        own = {"xi_hat": begun[i], "W": weights.W[i], "V": weights.V[i]}
        drive = {"x": drives.x[i], "u": drives.u[i], "v_x": drives.v_x[i]}
        record = law(n, {**shared, **own, **drive}, every=n, ports=())
        found[:, i] = [record[f"{name}_final"].item() for name in PEAKS]
    return found[0], found[1], found[2]


@cache
def _law(structure: Structure) -> Scan:
    return Scan(with_peaks(build_step(structure)), carry=(*CARRY, *PEAKS), over=OVER)


def with_peaks(step: ca.Function) -> ca.Function:
    """Return the step with further carried ports, the largest norms so far of ξ̃, W and V.

    What is not a number is taken over, so that it shows in the end.

    Parameters
    ----------
    step : of `identifier.paper.step`.
    """
    inputs = [ca.SX.sym(step.name_in(i), step.sparsity_in(i)) for i in range(step.n_in())]
    outputs = dict(zip(step.name_out(), step.call(inputs), strict=True))
    peaks = [ca.SX.sym(name) for name in PEAKS]
    norms = [ca.norm_fro(outputs[port]) for port in ("xi_tilde", "W_next", "V_next")]
    following = [
        ca.if_else(norm <= peak, peak, norm) for norm, peak in zip(norms, peaks, strict=True)
    ]
    return ca.Function(
        f"{step.name()}_peaks",
        [*inputs, *peaks],
        [*outputs.values(), *following],
        [*step.name_in(), *PEAKS],
        [*outputs, *(f"{name}_next" for name in PEAKS)],
    )


# The proven bounds beside what happened on random drives.

TOLERANCE = 1e-9  # of rounding, in parts of a bound
BOUNDS = (  # name in the certificate, what it bounds, and how a table calls it
    ("error_bound", "xi_tilde", "|xi - xi_hat|, by the leakage"),
    ("weight_bound", "W", "|W|, by the leakage"),
    ("V_bound", "V", "|V|"),
)


class Row(NamedTuple):
    """A bound beside what was seen.

    name, title, unit : of the bound.   bound : its value.   largest : seen on any drive.
    passed : drives on which it was exceeded.   tightness : bound over seen: least, median, 90 %.
    """

    name: str
    title: str
    unit: str
    bound: float
    largest: float
    passed: int
    tightness: tuple[float, float, float]


def bound_rows(certificate: Certificate, observed: Observed) -> list[Row]:
    """Return every proven bound that the certificate holds, beside what was seen."""
    known = {entry.name: entry for entry in certificate.properties}
    rows = []
    for name, what, title in BOUNDS:
        if name in known and np.isfinite(known[name].value):
            seen: Array = getattr(observed, what)
            bound = known[name].value
            passed = int(np.count_nonzero(~(seen <= bound * (1.0 + TOLERANCE))))
            ratio = bound / seen[np.isfinite(seen) & (seen > 0.0)]
            low, middle, high = np.quantile(ratio, [0.0, 0.5, 0.9]) if ratio.size else [np.nan] * 3
            largest = float(seen.max())
            tightness = float(low), float(middle), float(high)
            rows.append(Row(name, title, known[name].unit, bound, largest, passed, tightness))
    return rows
