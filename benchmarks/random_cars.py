"""Random cars of four classes on random tires, their drives, and how such drives can begin.

Compact, sedan, race car and 1:10 model, each with its own load, grip, roll and relaxation; tires of
Fiala and Dugoff and a Magic Formula whose stiffness falls with load, others in front than behind.
Everything follows from a generator. Numbers of the identifier are chosen on seeds below
`FIRST_SEED`, benchmarks measure on seeds from there on.
A drive is straight for `lead` seconds, then it swings at random up to the limit: both axles reach
at least `REACHED` of their grip, and no car spins; a drive that does not is drawn again.
"""

import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import count
from typing import Any, NamedTuple

import numpy as np

from benchmarks.faults import Fault, Passing, Together
from codegen.arrays import Array
from models.faults import SensorFault
from models.maneuvers import RandomSteer
from models.plant import Plant, PlantError, PlantRun
from models.recordings import Recording
from models.sensors import Sensor, Sensors
from models.tires import DugoffTire, FialaTire, MagicFormula, Tire
from models.vehicle import FULL_SIZE, GRAVITY, Chassis, Vehicle, sedan

FIRST_SEED = 1000
LIKE = sedan()  # to whose size noise and faults are scaled
TIRES = ("fiala", "dugoff", "magic_formula")
LEAD, DRIVEN = 8.0, 30.0  # s straight, s of swings
REACHED, SPIN, SLOWED = 0.5, 0.45, 0.5  # of the grip; |v_y/v_x|; of the wanted speed
DRAWS = 200  # of a drive of one car, before another is drawn
Range = tuple[float, float]


class CarClass(NamedTuple):
    """From what to what the numbers of a class of cars go.

    Mass [kg], wheelbase L [m], l_f over L; stiffness of the front axle over its load [1/rad],
    friction of its tires; height of the center of gravity and relaxation length over L; yaw inertia
    over m l_f l_r, roll stiffness over the weight times its arm; frequency of the steering [Hz].
    """

    mass: Range
    wheelbase: Range
    front: Range
    stiffness: Range
    friction: Range
    height: Range
    relaxation: Range
    inertia: Range
    roll: Range
    frequency: Range


SEDAN = CarClass(
    mass=(1400.0, 2200.0),
    wheelbase=(2.6, 3.1),
    front=(0.40, 0.52),
    stiffness=(12.0, 20.0),
    friction=(0.75, 1.0),
    height=(0.17, 0.22),
    relaxation=(0.12, 0.3),
    inertia=(0.9, 1.1),
    roll=(6.0, 12.0),
    frequency=(0.4, 0.7),
)
CLASSES: Mapping[str, CarClass] = {
    "compact": SEDAN._replace(
        mass=(850.0, 1250.0),
        wheelbase=(2.3, 2.6),
        front=(0.38, 0.45),
        stiffness=(13.0, 20.0),
        height=(0.19, 0.24),
    ),
    "sedan": SEDAN,
    "race": SEDAN._replace(
        mass=(550.0, 900.0),
        wheelbase=(2.6, 3.2),
        front=(0.5, 0.6),
        stiffness=(18.0, 32.0),
        friction=(1.2, 1.8),
        height=(0.09, 0.12),
        relaxation=(0.06, 0.15),
        roll=(20.0, 40.0),
        frequency=(0.5, 1.0),
    ),
    "tenth": SEDAN._replace(
        mass=(1.2, 2.5),
        wheelbase=(0.16, 0.33),
        front=(0.42, 0.56),
        stiffness=(4.0, 9.0),
        friction=(0.5, 0.9),
        height=(0.12, 0.25),
        relaxation=(0.05, 0.25),
        inertia=(0.4, 1.0),
        frequency=(0.6, 1.5),
    ),
}


@dataclass(frozen=True, kw_only=True)
class RandomCar:
    """A car on its tires, and what is declared of it.

    Parameters
    ----------
    kind : one of `CLASSES`.
    vehicle : the car that drives, with chassis; its stiffnesses are those of its tires.
    declared : the same without chassis, its stiffnesses off by 0.7 to 1.4.
    tires : of the front and the rear wheels.
    friction : of the front and the rear tires [-].
    frequency : of its steering [Hz].
    """

    kind: str
    vehicle: Vehicle
    declared: Vehicle
    tires: tuple[Tire, Tire]
    friction: tuple[float, float]
    frequency: float

    @cached_property
    def plant(self) -> Plant:
        """The car, ready to drive."""
        return Plant(self.vehicle, self.tires[0], rear_tire=self.tires[1])

    @property
    def sensors(self) -> Sensors:
        """Good sensors of its size."""
        return good_sensors(self.vehicle)


def good_sensors(vehicle: Vehicle) -> Sensors:
    """Return sensors with the noise of good ones: 0.03 m/s and 0.003 rad/s in a sedan.

    Parameters
    ----------
    vehicle : by whose size the noise scales.
    """
    size = math.sqrt(vehicle.wheelbase / LIKE.wheelbase)
    speed = Sensor(noise=0.03 * size)
    return Sensors(v_x=speed, v_y=speed, r=Sensor(noise=0.003 / size), delta=Sensor(noise=5e-4))


def random_car(kind: str, rng: np.random.Generator) -> RandomCar:
    """Return a car of a class; its rear axle is stiffer for its load, as of cars that are sold.

    Parameters
    ----------
    kind : one of `CLASSES`.
    rng : source of randomness.
    """
    drawn = CLASSES[kind]
    mass, wheelbase = rng.uniform(*drawn.mass), rng.uniform(*drawn.wheelbase)
    l_f = rng.uniform(*drawn.front) * wheelbase
    l_r = wheelbase - l_f
    per_load = rng.uniform(*drawn.stiffness) * np.array([1.0, rng.uniform(1.05, 1.35)])
    friction = rng.uniform(*drawn.friction) * np.array([1.0, rng.uniform(1.0, 1.1)])
    load = mass * GRAVITY / wheelbase * np.array([l_r, l_f])
    plain = Vehicle(
        name=kind,
        mass=mass,
        yaw_inertia=mass * l_f * l_r * rng.uniform(*drawn.inertia),
        l_f=l_f,
        l_r=l_r,
        cornering_stiffness_front=per_load[0] * load[0],
        cornering_stiffness_rear=per_load[1] * load[1],
    )
    tire = str(rng.choice(TIRES))
    tires = [
        _tire(tire, 0.5 * C * F, 0.5 * F, mu)
        for C, F, mu in zip(per_load, load, friction, strict=True)
    ]
    front, rear = rng.uniform(0.7, 1.4, 2)
    return RandomCar(
        kind=kind,
        vehicle=replace(plain, chassis=_chassis(drawn, plain, rng)),
        declared=replace(
            plain,
            cornering_stiffness_front=front * plain.cornering_stiffness_front,
            cornering_stiffness_rear=rear * plain.cornering_stiffness_rear,
        ),
        tires=(tires[0], tires[1]),
        friction=(float(friction[0]), float(friction[1])),
        frequency=rng.uniform(*drawn.frequency),
    )


def _chassis(drawn: CarClass, car: Vehicle, rng: np.random.Generator) -> Chassis:
    L, height = car.wheelbase, rng.uniform(*drawn.height) * car.wheelbase
    return Chassis(
        track_front=0.57 * L,
        track_rear=0.57 * L,
        cg_height=height,
        roll_center_height_front=0.1 * height,
        roll_center_height_rear=0.2 * height,
        roll_stiffness=0.8 * height * car.weight * rng.uniform(*drawn.roll),
        roll_stiffness_front_share=rng.uniform(0.5, 0.62),
        roll_damping=0.09 * car.weight * height * car.froude_time * rng.uniform(3.0, 8.0),
        roll_inertia=0.05 * car.mass * L**2,
        roll_camber_front=0.0,
        roll_camber_rear=0.0,
        relaxation_length_front=rng.uniform(*drawn.relaxation) * L,
        relaxation_length_rear=rng.uniform(*drawn.relaxation) * L,
        steering_lag=0.03,
        drive_front_share=float(rng.choice([0.0, 0.5, 1.0])),
        brake_front_share=0.62 if L >= FULL_SIZE else 0.5,
    )


def _tire(name: str, C: float, load: float, friction: float) -> Tire:
    """One tire of stiffness C [N/rad] at a load [N]."""
    if name == "magic_formula":
        tire = MagicFormula.from_tir(str(LIKE.require_chassis().tire))
        c = replace(tire.coefficients, FNOMIN=load, LMUX=friction, LMUY=friction)
        stiffness = float(replace(tire, coefficients=c).cornering_stiffness(load))
        return replace(tire, coefficients=replace(c, LKY=C / stiffness), name="random")
    simple = FialaTire if name == "fiala" else DugoffTire
    return simple(C_alpha=C, C_kappa=1.5 * C, friction=friction)


# How a drive begins.

SPEEDS = ("steady", "standing", "reversing", "braking")
BEGINNINGS = (*("straight", "biased", "fading", "banked", "rough"), *SPEEDS[1:], "mixed")
PULL = 2.5  # m/s^2, pulling away and braking


@dataclass(frozen=True, slots=True, kw_only=True)
class Beginning:
    """What happens before and while the first corner comes.

    Parameters
    ----------
    kind : one of `BEGINNINGS`.
    lead : straight road before the corners [s].
    speed : one of `SPEEDS`: held; from rest; from reverse, by way of rest; 1.35 times it, braked.
    rest : time at rest or in reverse before [s]; 0 where the car rolls forward throughout.
    bank : angle of the road until it levels out in the last second of `lead` [rad].
    rough : noise of the sensors before the corners over their own [-].
    constant, fading : biases by channel, in its unit: those that stay, and those that are gone when
        the corners come.
    """

    kind: str = "straight"
    lead: float = LEAD
    speed: str = "steady"
    rest: float = 0.0
    bank: float = 0.0
    rough: float = 1.0
    constant: tuple[tuple[str, float], ...] = ()
    fading: tuple[tuple[str, float], ...] = ()

    @property
    def corner(self) -> float:
        """When the corners have begun [s], half a second into them."""
        return self.rest + self.lead + 0.5

    @property
    def faults(self) -> Fault:
        """What the sensors add."""
        stay = [SensorFault(channel=name, kind="biased", size=size) for name, size in self.constant]
        go = [
            Passing(
                fault=SensorFault(channel=name, kind="biased", size=size),
                until=self.rest + 0.5 * self.lead,
                fade=0.4 * self.lead,
            )
            for name, size in self.fading
        ]
        return Together(faults=(*stay, *go))


def random_beginning(kind: str, vehicle: Vehicle, rng: np.random.Generator) -> Beginning:
    """Return a beginning of a kind, its sizes scaled to the car.

    Parameters
    ----------
    kind : one of `BEGINNINGS`; "mixed" has several at once.
    vehicle : the car.
    rng : source of randomness.
    """
    mixed = kind == "mixed"

    def has(name: str) -> bool:
        return kind == name or (mixed and bool(rng.integers(2)))

    speed = str(rng.choice(SPEEDS)) if mixed else kind if kind in SPEEDS else "steady"
    stops = speed in ("standing", "reversing")
    return Beginning(
        kind=kind,
        lead=rng.uniform(2.0, 10.0),
        speed=speed,
        rest=0.01 * int(rng.integers(100, 400)) if stops else 0.0,
        bank=rng.choice([-1.0, 1.0]) * rng.uniform(0.01, 0.07) if has("banked") else 0.0,
        rough=rng.uniform(3.0, 8.0) if has("rough") else 1.0,
        constant=(_bias(vehicle, rng),) if has("biased") else (),
        fading=(_bias(vehicle, rng), _bias(vehicle, rng)) if has("fading") else (),
    )


def _bias(vehicle: Vehicle, rng: np.random.Generator) -> tuple[str, float]:
    """A channel and its bias; of v_y as often as of all others."""
    largest = {
        "v_y": 0.08 * vehicle.froude_speed,
        "r": 0.01 / vehicle.froude_time,
        "delta_f": 0.02,
        "a_y": 0.5,
    }
    channel = str(rng.choice(list(largest), p=[0.5, 0.2, 0.2, 0.1]))
    return channel, float(rng.choice([-1.0, 1.0]) * rng.uniform(0.2, 1.0) * largest[channel])


# Drives.


@dataclass(frozen=True, slots=True, kw_only=True)
class RandomDrive:
    """A drive of a random car.

    Parameters
    ----------
    car : that drove.
    beginning : how it began.
    exact : what sensors without noise show, with the forces of the axles.
    speed : that was wanted in the corners [m/s].
    """

    car: RandomCar
    beginning: Beginning
    exact: Recording
    speed: float

    def log(self, rng: np.random.Generator) -> Recording:
        """Return the drive as the car's sensors show it, with what is wrong with its beginning.

        Parameters
        ----------
        rng : source of the noise.
        """
        begin, good = self.beginning, self.car.sensors
        shown = good.apply(self.exact, rng)
        if begin.rough > 1.0:
            names = ("v_x", "v_y", "r")
            noise = {name: begin.rough * getattr(good, name).noise for name in names}
            noisier = {name: replace(getattr(good, name), noise=noise[name]) for name in names}
            rough = replace(good, **noisier).apply(self.exact, rng)
            before = self.exact.t < begin.rest + begin.lead
            mixed: dict[str, Any] = {
                name: np.where(before, getattr(rough, name), getattr(shown, name)) for name in names
            }
            shown = replace(shown, **mixed)
        return begin.faults.apply(shown)

    def cornering(self, recording: Recording) -> Recording:
        """Return a log of this drive from the first corner on.

        Parameters
        ----------
        recording : of this drive.
        """
        return recording.between(self.beginning.corner, math.inf)


def random_drive(
    car: RandomCar, rng: np.random.Generator, beginning: Beginning | None = None
) -> RandomDrive:
    """Return a drive that excites both axles and does not spin.

    Parameters
    ----------
    car : that drives.
    rng : source of speed and steering.
    beginning : None is a straight road of `LEAD` seconds.

    Raises
    ------
    PlantError
        Where none of `DRAWS` drives is such.
    """
    begin = beginning if beginning is not None else Beginning()

    def bank(t: Array) -> Array:
        return np.asarray(begin.bank * np.clip(begin.lead - t, 0.0, 1.0))

    found = _good_run(car, rng, begin, DRAWS, lambda: bank)
    if found is None:
        raise PlantError(f"{DRAWS} drives of a {car.kind} did not excite both axles without a spin")
    run, speed = found
    exact = _after_rest(run.recording(), begin)
    return RandomDrive(car=car, beginning=begin, exact=exact, speed=speed)


def _good_run(
    car: RandomCar,
    rng: np.random.Generator,
    begin: Beginning,
    draws: int,
    bank: Callable[[], Callable[[Array], Array]],
) -> tuple[PlantRun, float] | None:
    """A run, and its speed [m/s]; None where none of some draws is good."""
    for _ in range(draws):
        speed = rng.uniform(2.6, 4.5) * car.vehicle.froude_speed
        maneuver = random_steering(car, speed, begin.lead, rng)
        if maneuver is not None:
            over_time, name = _speed_over_time(begin, speed), f"{car.kind}, {begin.kind}"
            with suppress(PlantError):
                run = car.plant.simulate(maneuver, speed=over_time, bank=bank(), name=name)
                if is_good(car, run, begin, speed):
                    return run, speed
    return None


def steering_gradient(car: Vehicle, speed: float) -> float | None:
    """Return the steering per lateral acceleration [rad s^2/m]; None where it would be unstable.

    car : that drives.   speed : in the corners [m/s].
    """
    b, L = car.bicycle, car.wheelbase
    understeer = b.m * (b.l_r * b.C_r - b.l_f * b.C_f) / (b.C_f * b.C_r * L)
    return None if L + 1.3**2 * understeer * speed**2 <= 0.0 else L / speed**2 + understeer


def random_steering(
    car: RandomCar, speed: float, lead: float, rng: np.random.Generator
) -> RandomSteer | None:
    """Return swings up to the grip, or None where the car would be unstable at that speed.

    Parameters
    ----------
    car : that drives.
    speed : in the corners [m/s].
    lead : straight road before them [s].
    rng : source of the swings.
    """
    per_a_y = steering_gradient(car.vehicle, speed)
    if per_a_y is None:
        return None
    a_y = rng.uniform(0.7, 1.05) * min(car.friction) * GRAVITY
    amplitude = min(1.5 * a_y * per_a_y, 0.4)
    return RandomSteer(
        amplitude=amplitude,
        frequency=car.frequency,
        seed=int(rng.integers(1 << 30)),
        onset=lead,
        rate_limit=max(1.0, 2.02 * math.pi * car.frequency * amplitude),
        duration=0.01 * round(100.0 * (lead + DRIVEN)),
    )


def _speed_over_time(begin: Beginning, speed: float) -> Callable[[Array], Array]:
    if begin.speed == "braking":
        return lambda t: np.maximum(1.35 * speed - PULL * t, speed)
    if begin.speed in ("standing", "reversing"):
        return lambda t: np.minimum(0.05 * speed + PULL * t, speed)
    return lambda t: np.full(t.size, speed)


def is_good(car: RandomCar, run: PlantRun, begin: Beginning, speed: float) -> bool:
    """Return whether both axles were excited and nothing spun or stopped once corners came.

    Parameters
    ----------
    car : that drove.
    run : of its plant.
    begin : how it began.
    speed : wanted in the corners [m/s].
    """
    late = run.t >= begin.lead
    v_x, v_y = run.v_x[late], run.v_y[late]
    reach = np.abs(run.axle_force[late]).max(axis=0) / car.vehicle.axle_loads
    slowest = 0.05 if begin.speed in ("standing", "reversing") else SLOWED
    return bool(
        (reach / np.array(car.friction)).min() >= REACHED
        and v_x.min() >= 0.9 * slowest * speed
        and np.abs(v_y / np.maximum(v_x, 1e-3)).max() <= SPIN
    )


def _after_rest(recording: Recording, begin: Beginning) -> Recording:
    """The recording after the car stood or reversed on a straight road for `rest` seconds."""
    n = round(begin.rest / recording.dt)
    if n == 0:
        return recording
    first = float(recording.v_x[0])
    slowest = 0.0 if begin.speed == "standing" else -4.0 * first
    before = np.maximum(slowest, first - PULL * recording.dt * np.arange(n, 0, -1))
    assert recording.axle_force is not None
    longer: dict[str, Any] = {
        name: np.append(np.zeros(n), getattr(recording, name))
        for name in ("v_y", "r", "delta_f", "delta_r", "a_y")
    }
    return replace(
        recording,
        t=recording.dt * np.arange(n + len(recording), dtype=np.float64),
        v_x=np.append(before, recording.v_x),
        axle_force=np.vstack((np.zeros((n, 2)), recording.axle_force)),
        **longer,
    )


MakeBeginning = Callable[[Vehicle, np.random.Generator], Beginning]


def drawn(
    kind: str, seed: int, beginning: MakeBeginning | None = None, number: int = 0
) -> RandomDrive:
    """Return a drive of the car of a seed; where it has no good one, another car is drawn.

    Parameters
    ----------
    kind : class of the car.
    seed : of the car.
    beginning : makes one from car and generator; None is a straight road.
    number : of the drive, each another.
    """

    def drive(car: RandomCar, attempt: int) -> RandomDrive:
        rng = np.random.default_rng([seed, attempt, number, *kind.encode()])
        begin = None if beginning is None else beginning(car.vehicle, rng)
        return random_drive(car, rng, begin)

    return first_good(kind, seed, drive)


def first_good(kind: str, seed: int, drive: Callable[[RandomCar, int], RandomDrive]) -> RandomDrive:
    """Return the drive of the first car of a seed that has a good one.

    Parameters
    ----------
    kind : class of the car.
    seed : of the car.
    drive : of a car, and how many were drawn before.
    """
    for attempt in count():
        car = random_car(kind, np.random.default_rng([seed, attempt, *kind.encode()]))
        with suppress(PlantError):
            return drive(car, attempt)
    raise AssertionError("it counts for ever")


# Drives without a sensor of v_y, on banked roads, as inertial sensors show them.

BANKS = (0.0, 2.0, 6.0)  # degrees
INERTIAL_DRAWS = 60  # of a drive of one car, before another is drawn


class InertialDrive(NamedTuple):
    """A drive: the car as declared, what its sensors show, the truth, where inertial ones sit [m].

    kind : class of the car.   shown : with a good sensor of v_y.
    """

    kind: str
    declared: Vehicle
    shown: Recording
    exact: Recording
    position: tuple[float, float]


def random_bank(rng: np.random.Generator, duration: float) -> Callable[[Array], Array]:
    """Return the angle of a road over time [rad]: it changes every 4 to 9 seconds, smoothly.

    Parameters
    ----------
    rng : source of randomness.
    duration : of the drive [s].
    """
    steepest = math.radians(rng.choice(BANKS, p=(0.2, 0.4, 0.4)))
    step = rng.uniform(4.0, 9.0)
    heights = rng.uniform(-steepest, steepest, math.ceil(duration / step) + 2)

    def bank(t: Array) -> Array:
        k = np.clip((t / step).astype(np.int64), 0, heights.size - 2)
        part = 0.5 - 0.5 * np.cos(np.pi * (t / step - k))
        return np.asarray(heights[k] + (heights[k + 1] - heights[k]) * part)

    return bank


def inertial_drive(kind: str, seed: int) -> InertialDrive:
    """Return a random drive of a random car, as inertial sensors show it.

    Parameters
    ----------
    kind : one of `CLASSES`.
    seed : of everything.

    Raises
    ------
    PlantError
        Where no car of this seed keeps on the road.
    """
    rng = np.random.default_rng(seed)
    for _ in range(20):
        car = random_car(kind, rng)
        found = _inertial(car, rng)
        if found is not None:
            return found
    raise PlantError(f"no {kind} of seed {seed} drives without a spin")


def _inertial(car: RandomCar, rng: np.random.Generator) -> InertialDrive | None:
    found = _good_run(
        car, rng, Beginning(), INERTIAL_DRAWS, lambda: random_bank(rng, LEAD + DRIVEN)
    )
    if found is None:
        return None
    run, _ = found
    exact, L = run.recording(), car.vehicle.wheelbase
    size = math.sqrt(L / 2.7)
    t, n = exact.t, len(exact)
    x, y = rng.uniform(-0.15, 0.15) * L, rng.uniform(-0.05, 0.05) * L
    felt = run.a_y * np.cos(run.roll) + GRAVITY * np.sin(run.roll)
    felt = felt + x * np.gradient(run.r, t) - y * run.r**2
    bias_a, bias_r, zero = rng.normal(0, 0.15), rng.normal(0, 0.003) / size, rng.normal(0, 0.003)
    late_r, late_a = rng.uniform(-0.005, 0.005, 2)
    shown = replace(
        exact,
        v_x=exact.v_x * (1 + rng.normal(0, 0.005)) + 0.03 * size * rng.normal(size=n),
        v_y=exact.needed("v_y") + 0.03 * size * rng.normal(size=n),  # for learning with v_y alone
        r=np.interp(t - late_r, t, exact.r) + bias_r + 0.003 / size * rng.normal(size=n),
        a_y=np.interp(t - late_a, t, felt) + bias_a + rng.uniform(0.05, 0.3) * rng.normal(size=n),
        delta_f=exact.delta_f - zero + 5e-4 * rng.normal(size=n),
        axle_force=None,
    )
    position = (x + 0.01 * L * rng.normal(), y + 0.01 * L * rng.normal())
    return InertialDrive(car.kind, car.declared, shown, exact, position)
