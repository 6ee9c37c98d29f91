"""What is proven of the axle identifier along a drive: how wrong may its forces be after it?

Whatever the true parameters θ* are, ε := y - h'θ* (with the model's nonlinearity, noise, bias and
all that it leaves out) makes the errors θ̃ = θ - θ* obey, exactly, with all other letters known
from the run:

θ̃⁺ = (I - c K h') θ̃ + c K ε + m

K: gain.   c: share of the innovation that counts.   m: what bounds, the limited step and a road
that is believed to be another moved.   So the error of the force at a slip, t'θ̃ with the units
t = tanh(x/α_j), is p_0'θ̃_0 + Σ g_k ε_k + M, with the adjoint p of θ̃ run from the end to the
beginning, g = c p'K, M = Σ p'm. That is a worst case that is reached: by errors |ε_k| <= z σ_k with
the signs of g_k.
"""

from collections.abc import Mapping
from typing import NamedTuple, Protocol

import numpy as np

from codegen import Scan
from codegen.arrays import Array
from identifier.axle.certificate import Design, corners, curve_facts, jump_by_learning
from identifier.axle.chosen import CHOSEN
from identifier.axle.covariance import unpacked
from identifier.axle.curve import doublings
from identifier.axle.model import AxleModel
from identifier.axle.step import TAUGHT, build_taught
from identifier.certificate import Property, at_most, statement
from identifier.method import Run
from identifier.setup import Setup
from identifier.tire_model import AXLES, TireModel
from models.vehicle import Vehicle


class _Learner(Design, Protocol):
    """What of an `AxleIdentifier` a run is certified with."""

    def setup(self, vehicle: Vehicle, start: TireModel | None = None) -> Setup:
        """Return the compiled step, and where it starts."""

    def frozen(self, vehicle: Vehicle, values: Mapping[str, Array]) -> AxleModel:
        """Return the model of carried values."""


class Taught(NamedTuple):
    """What N samples taught, rows front and rear, as of `identifier.axle.step.build_taught`.
    theta : parameters before each sample and after the last (N + 1, 2, q).
    moved : m, what learning does not explain (N, 2, q).
    begin : covariance of the parameters before the first sample (2, q, q).
    """

    h: Array
    e: Array
    counts: Array
    gains: Array
    declared: Array
    theta: Array
    moved: Array
    begin: Array

    @property
    def left(self) -> Array:
        """Y - h'θ with the parameters at the end (N, 2): ε, as far as the drive shows it."""
        return np.asarray(self.e + (self.h * (self.theta[:-1] - self.theta[-1])).sum(axis=2))


class Adjoint(NamedTuple):
    """What reaches the force of an axle at m slips, static axle loads, rows front and rear.
    begin : p_0, of the first error of the parameters (2, m, q).   moved : M (2, m).
    g : of the error of y at each sample (N, 2, m).
    """

    begin: Array
    moved: Array
    g: Array


def taught_by(design: _Learner, history: Run) -> Taught:
    """Return what the samples of a run taught; of a long one those at its end."""
    setup = design.setup(history.vehicle, history.start)
    pressed, n = history.vehicle.has_downforce, len(history.recording)
    step = build_taught(doublings(design.ladder), pressed=pressed)
    over = tuple(port for port in step.name_in() if port not in setup.constants)
    scan, parts, theta, begin = Scan(step, carry=(), over=over), [], [], []
    constants = {port: setup.constants[port] for port in scan.constants}
    for block in history.blocks(np.arange(max(n - CHOSEN.most_samples, 0), n)):
        seen = setup.shown(history.recording, block.part)
        signals = {port: seen.of_recording(values) for port, values in seen.signals.items()}
        sampled = {port: _by_columns({**block.before, **signals}[port]) for port in over}
        parts.append(scan(len(sampled["v_x"]), {**constants, **sampled}))
        theta.append(np.concatenate([block.state["W"], block.state["own"]], axis=2))
        begin.append(block.state["UD"][0])
    h, e, counts, gains, declared = (
        np.concatenate([part[name] for part in parts]) for name in TAUGHT
    )
    path = np.concatenate([*(one[:-1] for one in theta), theta[-1][-1:]])
    learnt = path[:-1] + gains * (counts * e)[:, :, None]
    P = unpacked(begin[0], len(design.ladder) + 3)
    return Taught(h, e, counts, gains, declared, path, path[1:] - learnt, P)


def _by_columns(values: Array) -> Array:
    """Return values of samples (N, ...) as rows (N, k), matrices by columns."""
    apart = values.swapaxes(1, 2) if values.ndim == 3 else values
    return apart.reshape(len(values), -1)


def adjoint(taught: Taught, slips: Array, ladder: tuple[float, ...]) -> Adjoint:
    """Return what reaches the force of each axle after a drive, from its end to its beginning.
    slips : at which the force is looked at, of each axle (2, m) [rad].
    ladder : slip scales of the units [rad].
    """
    q, n = taught.h.shape[2], len(ladder)
    units = np.tanh(slips[:, :, None] / np.array(ladder))
    p = np.concatenate([units, np.zeros((*slips.shape, q - n))], axis=2)  # (2, m, q)
    moved = np.zeros(slips.shape)
    g = np.zeros((len(taught.e), *slips.shape))
    gains = taught.gains * taught.counts[:, :, None]
    for k in range(len(taught.e) - 1, -1, -1):
        moved += (p @ taught.moved[k, :, :, None])[:, :, 0]
        g[k] = (p @ gains[k, :, :, None])[:, :, 0]
        p = p - g[k, :, :, None] * taught.h[k, :, None]
    return Adjoint(p, moved, g)


def certified_along(design: _Learner, history: Run) -> tuple[Property, ...]:
    """Return what is proven of the curves that a drive taught."""
    model = design.frozen(history.vehicle, history.state_at(float(history.recording.t[-1])))
    taught = taught_by(design, history)
    known = np.asarray(model.known_slip)
    slips = (
        np.linspace(1.0 / CHOSEN.slips, 1.0, CHOSEN.slips)
        * np.maximum(known, CHOSEN.smallest)[:, None]
    )
    reach = adjoint(taught, slips, design.ladder)
    box = corners(design.bounds, design.ladder, design.rising_until)
    jump = np.abs(np.cumsum(np.diff(taught.theta[:, :, : len(design.ladder)], axis=0), axis=2))
    largest = float(jump.max(initial=0.0))
    limit = jump_by_learning(design)
    found = [
        Property(
            name="along/jump",
            title="largest jump of a force by learning",
            value=largest,
            limit=limit,
            margin=limit / max(largest, CHOSEN.along_tiny),
            status=at_most(
                largest,
                good=limit * (1.0 + CHOSEN.along_rounding),
                bad=limit * (1.0 + CHOSEN.along_rounding),
            ),
            unit="static loads",
            advice="weights were changed by something else than learning",
        )
    ]
    for i in range(len(AXLES)):
        found += _of_axle(i, model, taught, reach, slips[i], box)
    return tuple(found)


def _of_axle(
    i: int, model: AxleModel, taught: Taught, reach: Adjoint, slips: Array, box: Array
) -> tuple[Property, ...]:
    """Return what is proven of the curve of axle i.
    reach : of errors, at the slips of both axles (2, m).
    slips : [rad], up to the range that is known (m,).   box : corners of the set of weights (k, n).
    """
    axle, known = AXLES[i], float(model.known_slip[i])
    facts = curve_facts(model.W[i : i + 1], model.ladder, max(known, CHOSEN.smallest))
    at_slips = np.tanh(slips[:, None] / np.array(model.ladder))
    possible = np.abs((box - model.W[i]) @ at_slips.T).max(axis=0)
    g, sizes = reach.g[:, i], np.abs(reach.g[:, i])
    by_begin, by_bounds = begin_error(taught, reach)[i], np.abs(reach.moved[i])
    by_declared, by_left = taught.declared[:, i] @ sizes, np.abs(taught.left[:, i]) @ sizes
    error = by_begin + by_declared + by_bounds
    k = int(np.argmax(error / possible))
    span = f"{axle} axle, slip up to {known:.3g} rad"
    noise = np.sqrt((g**2).sum(axis=0))
    part = [
        ("declared", "of that by the declared errors", by_declared, "static loads"),
        ("begin", "of that by the beginning", by_begin, "static loads"),
        ("moved", "of that by bounds", by_bounds, "static loads"),
        ("error_gain", "force error per largest error of y", sizes.sum(axis=0), "-"),
        ("bias_gain", "force error per constant error of y", np.abs(g.sum(axis=0)), "-"),
        ("noise_gain", "deviation of force per deviation of white noise of y", noise, "-"),
    ]
    return (
        Property(
            name=f"along/{axle}/opposes",
            title=f"{span}: flattest secant",
            value=facts.flattest,
            limit=0.0,
            margin=facts.flattest,
            status="pass" if facts.flattest > 0.0 else "fail",
            unit="static loads/rad",
            advice="the force does not push against its slip within the identified range",
        ),
        statement(
            f"along/{axle}/steepest", f"{span}: steepest secant", facts.steepest, "static loads/rad"
        ),
        statement(f"along/{axle}/rises_until", f"{span}: rises until", facts.rises_until, "rad"),
        Property(
            name=f"along/{axle}/force_error",
            title=f"{span}: largest force error, with the declared errors of y",
            value=float(error[k]),
            limit=float(possible[k]),
            margin=float(possible[k] / error[k]),
            status=at_most(float(error[k]), good=float(possible[k]), bad=None),
            unit="static loads",
            advice="only the limits bound the error: drive with more slip",
        ),
        *(
            statement(f"along/{axle}/{name}", f"{span}: {title}", float(value[k]), unit)
            for name, title, value, unit in part
        ),
        Property(
            name=f"along/{axle}/left",
            title=f"{span}: largest force error, with the residuals of y",
            value=float(by_left[k]),
            limit=float(by_declared[k]),
            margin=float(by_declared[k] / max(float(by_left[k]), CHOSEN.along_tiny)),
            status=at_most(float(by_left[k]), good=float(by_declared[k]), bad=None),
            unit="static loads",
            advice="y errs by more than declared, and so may the force: check sensors, car and "
            "signs",
        ),
    )


def begin_error(taught: Taught, reach: Adjoint) -> Array:
    """Return the force error that the beginning leaves, within `CHOSEN.begin` deviations (2, m).
    reach : of errors, at m slips.
    """
    variance = np.einsum("ami,aij,amj->am", reach.begin, taught.begin, reach.begin)
    return np.asarray(CHOSEN.begin * np.sqrt(np.maximum(variance, 0.0)))
