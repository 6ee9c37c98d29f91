"""Drives that try to break what is certified of the axle identifier: raw signals, and drops.

Everything follows from a generator; cars are those of `benchmarks.random_cars`.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from benchmarks.random_cars import CLASSES, FIRST_SEED, random_car
from benchmarks.targets import Targets
from codegen.arrays import Array
from identifier.axle import AxleIdentifier
from identifier.axle.car import car_numbers
from identifier.axle.prior import fiala_force
from identifier.certificate import Certificate
from models.recordings import Recording
from models.vehicle import GRAVITY, Vehicle

SAMPLES = 500
STEPS = (0.005, 0.01, 0.02, 0.05)  # s
SLIPS = np.linspace(0.0, 1.0, 4001)  # rad, at which the curve of a tire is inverted
IMPOSSIBLE = 9e3  # SI
CORNER, AFTER = 3.0, 2.0  # s, steady before friction drops and after it


class Hostile(NamedTuple):
    """A design, its car and what its step is shown: v_x, v_y, r, δ_f, δ_r, a_y (n, 6)."""

    vehicle: Vehicle
    design: AxleIdentifier
    samples: Array


def told_car(rng: np.random.Generator) -> Vehicle:
    """Return what is told of a random car of any class.

    Parameters
    ----------
    rng : source of randomness.
    """
    return random_car(str(rng.choice(list(CLASSES))), rng).told


def hostile(rng: np.random.Generator, vehicle: Vehicle | None = None) -> Hostile:
    """Return a drive that no car makes: swings, on which sensors fail in any way, some at once.

    Parameters
    ----------
    rng : source of randomness.
    vehicle : the car; None draws one, and a sampling interval.
    """
    car = told_car(rng) if vehicle is None else vehicle
    dt = float(rng.choice(STEPS)) if vehicle is None else 0.01
    design = AxleIdentifier.for_vehicle(car, dt=dt)
    p, L, U = design.plausibility, car.wheelbase, car.froude_speed
    t = np.arange(SAMPLES) * dt

    def swings(size: float) -> Array:
        frequency = 2.0 * np.pi * np.exp(rng.uniform(np.log(0.05), np.log(0.3 / dt), 3))
        waves = np.sin(np.outer(t, frequency) + rng.uniform(0.0, 2.0 * np.pi, 3))
        return np.asarray(size * waves @ rng.dirichlet(np.ones(3)))

    speed = U * rng.uniform(0.2, 6.0)
    columns = [
        np.full(SAMPLES, speed) + swings(rng.uniform(0.0, 0.5) * speed),
        swings(rng.uniform(0.0, 0.4) * speed),
        swings(rng.uniform(0.0, 1.5) * U / L),
        swings(rng.uniform(0.0, 0.4)),
        swings(rng.choice([0.0, 0.1])),
        swings(rng.uniform(0.0, 2.0) * GRAVITY),
    ]
    samples = np.column_stack(columns)
    if rng.random() < 0.5:
        samples[:, 5] = np.nan
    sizes = np.array([U, U, U / L, 0.3, 0.1, GRAVITY])
    jumps = np.array([p.jump, p.jump, p.yaw_jump, p.steering_jump, p.steering_jump, GRAVITY])
    for _ in range(rng.integers(1, 6)):
        first, length = rng.integers(SAMPLES), rng.integers(1, SAMPLES)
        part, k = slice(first, first + length), rng.integers(6)
        samples[part, k] = _failed(samples[part, k], float(sizes[k]), float(jumps[k]), rng)
    return Hostile(car, design, samples)


def _failed(signal: Array, size: float, jump: float, rng: np.random.Generator) -> Array:
    """Return a signal of a sensor that fails in some way."""
    n = signal.size
    white = rng.standard_normal(n)
    ways = (
        lambda: np.full(n, signal[0]),
        lambda: np.zeros(n),
        lambda: -signal,
        lambda: signal * rng.uniform(-4.0, 4.0),
        lambda: signal + rng.uniform(-1.0, 1.0) * size,
        lambda: signal + np.cumsum(0.01 * white) * size,
        lambda: signal + rng.uniform(0.0, 1.0) * size * white,
        lambda: signal + np.where(rng.random(n) < 0.1, 1e4 * white, 0.0),
        lambda: signal[0] + 0.99 * jump * rng.choice([-1.0, 1.0], n),
        lambda: signal[0] + np.cumsum(rng.uniform(-1.0, 1.0, n) * jump),
        lambda: np.where(rng.random(n) < 0.3, np.nan, signal),
        lambda: np.where(rng.random(n) < 0.3, np.inf, signal),
        lambda: 1e-12 * white,
        lambda: np.full(n, rng.choice([1e300, -1e300, 1e-300])),
    )
    return np.asarray(ways[rng.integers(len(ways))](), dtype=np.float64)


class Drop(NamedTuple):
    """A steady corner in which friction falls to half.

    force : of the axles (n, 2) [static axle loads].   delta : angles of the wheels (n, 2) [rad].
    at : sample of the drop.   level : force before it [static axle loads].
    """

    vehicle: Vehicle
    recording: Recording
    force: Array
    delta: Array
    at: int
    level: float


def drop(rng: np.random.Generator) -> Drop:
    """Return swings that teach both axles, then a corner at the limit, and the drop in it.

    The motion is chosen, forces follow from it exactly, slip from the forces by the curves of brush
    tires, and the steering from slip and motion. Slip stays through the drop: the car slides out.

    Parameters
    ----------
    rng : source of randomness.
    """
    real = random_car(str(rng.choice(list(CLASSES))), rng)
    car, dt = real.told, 0.01
    arm, _, inertia, loads = car_numbers(car).T
    stiffness = np.array(real.vehicle.bicycle[4:]) / loads
    friction = rng.uniform(0.6, 1.2)
    v_x = rng.uniform(3.0, 5.0) * car.froude_speed
    learnt = round(rng.uniform(12.0, 25.0) / dt)
    at = learnt + round(CORNER / dt)
    t = dt * np.arange(at + round(AFTER / dt), dtype=np.float64)
    swings = np.sin(2.0 * np.pi * rng.uniform(0.3, 0.7) * t) * np.clip(0.5 * t, 0.0, 1.0)
    blend = np.clip(t - t[learnt], 0.0, 1.0)
    blend = blend**2 * (3.0 - 2.0 * blend)
    r = rng.uniform(0.93, 0.98) * friction * GRAVITY / v_x * (swings * (1.0 - blend) + blend)
    force = _forces(r, v_x, dt, inertia, at)
    r *= min(1.0, 0.99 * friction / np.abs(force).max())
    force = _forces(r, v_x, dt, inertia, at)
    slips = [_slip(one, c, friction) for one, c in zip(force.T, stiffness, strict=True)]
    alpha = np.column_stack(slips)
    level = float(force[at - 1].mean())
    force[at:] = 0.5 * level
    alpha[at:] = alpha[at - 1]
    v_y = np.where(t >= t[at], (t - t[at]) * GRAVITY * -0.5 * level, 0.0)
    delta = alpha + np.arctan((v_y[:, None] + arm * r[:, None]) / v_x)
    noise = 1e-4 * car.froude_speed * rng.uniform(-1.0, 1.0, (2, t.size))
    recording = Recording(
        t=t,
        v_x=np.full(t.size, v_x),
        v_y=v_y + noise[0],
        r=r + 0.3 * noise[1] / car.wheelbase,
        delta_f=delta[:, 0],
        delta_r=delta[:, 1],
        name="drop",
    )
    return Drop(car, recording, force, delta, at, level)


def _forces(r: Array, v_x: float, dt: float, inertia: Array, at: int) -> Array:
    """Return the axle forces of a motion without v_y (n, 2) [static axle loads]."""
    rate = np.gradient(r, dt)
    rate[at - 2 :] = 0.0
    return np.asarray(v_x * r[:, None] / GRAVITY + inertia * rate[:, None])


def _slip(force: Array, stiffness: float, friction: float) -> Array:
    """Return the slip at which a brush tire has a force [rad]."""
    curve = fiala_force(SLIPS, stiffness, friction)
    sliding = int(np.argmax(curve >= friction * (1.0 - 1e-9)))
    return np.asarray(np.sign(force) * np.interp(np.abs(force), curve[:sliding], SLIPS[:sliding]))


def faster(design: AxleIdentifier) -> AxleIdentifier:
    """Return a design whose learning may jump as it likes: a planted violation.

    Parameters
    ----------
    design : as certified.
    """
    return replace(design, regression=replace(design.regression, rate=1e9))


def blind(design: AxleIdentifier) -> AxleIdentifier:
    """Return a design that sees no change of friction: a planted violation.

    Parameters
    ----------
    design : as certified.
    """
    return replace(design, change=replace(design.change, evidence=1e9))


class Case(NamedTuple):
    """A hostile drive, what is certified of its design, and its state.

    state : by port, carried values in effect at each sample and after the last (n + 1, ...).
    """

    drive: Hostile
    certificate: Certificate
    state: Mapping[str, Array]

    @property
    def vehicle(self) -> Vehicle:
        """The car, as it is told."""
        return self.drive.vehicle

    @property
    def design(self) -> AxleIdentifier:
        """The identifier that is certified."""
        return self.drive.design


def ran(drive: Hostile, design: AxleIdentifier | None = None) -> dict[str, Array]:
    """Return the state of the compiled step over a drive, by port (n + 1, ...).

    Parameters
    ----------
    design : that runs; None is that of the drive.
    """
    setup = (design or drive.design).setup(drive.vehicle)
    v_x, x, u, a_y = np.split(drive.samples, [1, 3, 5], axis=1)
    signals = {"x": x, "u": u, "v_x": v_x[:, 0], "a_y": a_y[:, 0]}
    record = setup.scan(len(v_x), {**setup.carry, **signals, **setup.constants}, every=1)
    return {port: np.array(record[f"{port}_all"]) for port in setup.scan.carry}


def recording_of(drive: Hostile) -> Recording:
    """Return the signals of a drive as a recording, with speeds of no car where none is possible.

    Parameters
    ----------
    drive : a hostile one.
    """
    samples = np.clip(np.nan_to_num(drive.samples, nan=IMPOSSIBLE), -IMPOSSIBLE, IMPOSSIBLE)
    v_x, v_y, r, delta_f, delta_r, a_y = samples.T
    t = drive.design.dt * np.arange(len(v_x), dtype=np.float64)
    return Recording(
        t=t,
        v_x=v_x,
        v_y=v_y,
        r=r,
        delta_f=delta_f,
        delta_r=delta_r,
        a_y=a_y if np.isfinite(drive.samples[:, 5]).all() else None,
        name="hostile",
    )


def cases(kind: int, drives: int) -> Iterator[Case]:
    """Yield hostile drives that the certified design ran over.

    Parameters
    ----------
    kind : of the property, so that each has drives of its own.
    drives : how many.
    """
    for number in range(drives):
        drive = hostile(np.random.default_rng([31, kind, FIRST_SEED + number]))
        yield Case(drive, drive.design.certify(drive.vehicle), ran(drive))


def told(t: Targets, name: str, drives: int, violated: int, plants: int, missed: int) -> None:
    """Print and keep what came of a property.

    Parameters
    ----------
    t : takes the numbers.
    name : of the property.
    drives, violated : how many drives, and on how many it did not hold.
    plants, missed : how many violations were planted, and how many of these were not found.
    """
    t.record(f"{name}/drives", drives)
    t.record(f"{name}/planted", plants)
    t.at_most(f"{name}: violated, of {drives} drives", violated, 0, "", f"{name}/violated")
    t.at_most(f"{name}: not found, of {plants} planted", missed, 0, "", f"{name}/missed")
