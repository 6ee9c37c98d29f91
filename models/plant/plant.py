"""A plant ready to drive: the car, its tires and the compiled loop over time."""

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from typing import NamedTuple

import casadi as ca
import numpy as np

from codegen import Scan, Stepper, compiler
from codegen.arrays import Array
from codegen.errors import TireidError
from codegen.graph import lifted
from models.friction import Friction
from models.maneuvers import Maneuver
from models.plant.dynamics import N_STATES, Driver, dynamics, runge_kutta
from models.recordings import Recording
from models.sensors import Sensors
from models.tires import MagicFormula, Tire, TirError
from models.vehicle import GRAVITY, Vehicle, VehicleError

_LEAST = 0.5  # stiffness over load [1/rad or -]: about 20 of real tires
_MOST = 500.0  # stiffness over load [1/rad or -]
_LEAST_GRIP = 0.05  # largest side force over load [-]: about 1 of real tires
_MOST_GRIP = 10.0  # largest side force over load [-]

# What a plant recorded: the motion, and the forces behind it, which no car measures.


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlantRun:
    """The truth of a run: n samples, SI, ISO axes; wheels in the order FL, FR, RL, RR.
    t : time [s], (n,).
    v_x, v_y : velocity of the center of gravity in the body frame [m/s], (n,).
    r : yaw rate [rad/s], (n,).
    a_x, a_y : what an accelerometer at the center of gravity feels [m/s^2], (n,); on a road that is
        not banked a_y = dv_y/dt + v_x r.
    command : steering asked for, [δ_f, δ_r] [rad], (n, 2).
    delta_f, delta_r : actual angles of the road wheels [rad], (n,).
    roll, roll_rate : of the body, positive when the right side dips [rad], [rad/s], (n,).
    X, Y, psi : position [m] and heading [rad], (n,).
    F_x, F_y : forces of the wheels in their own frame [N], (n, 4).
    F_z : loads of the wheels [N], (n, 4).
    alpha : slip angles of the wheels in the paper's sign, δ - atan2(v_y, v_x) [rad], (n, 4); the
        force follows them over the relaxation length.
    axle_force : sum of F_y cos δ + F_x sin δ over each axle [N], (n, 2).
    """

    name: str
    vehicle: Vehicle
    t: Array
    v_x: Array
    v_y: Array
    r: Array
    a_x: Array
    a_y: Array
    command: Array
    delta_f: Array
    delta_r: Array
    roll: Array
    roll_rate: Array
    X: Array
    Y: Array
    psi: Array
    F_x: Array
    F_y: Array
    F_z: Array
    alpha: Array
    axle_force: Array

    @classmethod
    def from_record(
        cls, name: str, vehicle: Vehicle, t: Array, command: Array, record: Mapping[str, Array]
    ) -> "PlantRun":
        """Name the columns of what the compiled loop recorded.
        t : time [s], (n,).   command : steering asked for [rad], (n, 2).
        record : state "x" (n, 18) in the order of `models.plant.dynamics`, and its outputs.
        """
        names = ("v_x", "v_y", "r", "roll", "roll_rate", "X", "Y", "psi")
        motion = dict(zip(names, record["x"].T, strict=False))
        delta_f, delta_r = record["x"][:, 12], record["x"][:, 13]
        a_x, a_y = record["acceleration"].T
        forces = {key: record[key] for key in ("F_x", "F_y", "F_z", "alpha", "axle_force")}
        return cls(
            name=name, vehicle=vehicle, t=t, a_x=a_x, a_y=a_y, command=command, delta_f=delta_f,
            delta_r=delta_r, **motion, **forces,
        )  # fmt: skip

    def recording(
        self, sensors: Sensors | None = None, rng: np.random.Generator | None = None
    ) -> Recording:
        """Return what a log of this run would hold, with the axle forces as truth.
        sensors : what the signals go through; None measures exactly.
        rng : source of the noise; needed when there are sensors.
        """
        exact = Recording(
            name=self.name, t=self.t, v_x=self.v_x, v_y=self.v_y, r=self.r, delta_f=self.delta_f,
            delta_r=self.delta_r, a_y=self.a_y, axle_force=self.axle_force,
        )  # fmt: skip
        if sensors is None:
            return exact
        if rng is None:
            raise ValueError("sensors need a random generator: pass rng")
        return sensors.apply(exact, rng)


_OverTime = float | Callable[[Array], Array]  # a number, or a function of the times (n,) [s]


class PlantError(TireidError, ArithmeticError):
    """The car left the range of its equations; the message says when."""


# -O1 builds a car a third sooner than -O2, whose steps are faster by so little that it is ahead
# after minutes of driving. The bits are the same.
_FLAGS = tuple("-O1" if flag == "-O2" else flag for flag in compiler.FLAGS)


class _CompiledLoop(NamedTuple):
    """A plant over time: library of cars that are built alike, and the numbers of this one."""

    scan: Scan
    constants: Array


@cache
def _compiled_loop(
    vehicle: Vehicle, tires: tuple[Tire, Tire], driver: Driver, dt: float
) -> _CompiledLoop:
    """Return the compiled loop of a plant over time, built once.
    dt : step of the integration [s].
    """
    car, constants = lifted(dynamics(vehicle, tires, driver))
    step = runge_kutta(car, dt)
    over = ("command", "v_ref", "mu", "slope")
    return _CompiledLoop(Scan(step, carry=("x",), over=over, flags=_FLAGS), constants)


_GRIP_SLIPS = np.geomspace(1e-3, 1.0, 60)  # rad


def tire_of(vehicle: Vehicle) -> MagicFormula:
    file = vehicle.require_chassis().tire
    if file is None:
        raise VehicleError(
            f"vehicle '{vehicle.name}' names no tire file and none was given: "
            'declare it by tire = "my_tire.tir" in its table [chassis]'
        )
    path = os.fspath(file)
    tire = MagicFormula.from_tir(path)
    for axle, load in zip(("front", "rear"), vehicle.axle_loads, strict=True):
        F_z = ca.DM(0.5 * load)
        grip = ca.mmax(tire.forces(ca.DM(_GRIP_SLIPS), 0.0, 0.0, F_z).F_y)
        for what, force, least, most in (
            ("cornering stiffness", tire.cornering_stiffness(F_z), _LEAST, _MOST),
            ("slip stiffness", tire.slip_stiffness(F_z), _LEAST, _MOST),
            ("largest side force", grip, _LEAST_GRIP, _MOST_GRIP),
        ):
            if not least <= (ratio := float(force / F_z) + 0.0) <= most:
                raise TirError(
                    f"{path}: {what} under a {axle} wheel of {vehicle.name}, {float(F_z):.4g} N, "
                    f"must be {least:g} to {most:g} times that load, it is {ratio:.3g} times: "
                    "check FNOMIN and [UNITS]"
                )
    return tire


class Plant:
    """A double-track car on its tires.
    vehicle : the car; it needs a chassis.
    tire : of all four wheels, a frozen record; None reads the file named by the chassis.
    rear_tire : of the two rear wheels, where they have another.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        tire: Tire | None = None,
        *,
        rear_tire: Tire | None = None,
        driver: Driver | None = None,
    ) -> None:
        vehicle.require_chassis()
        self.vehicle = vehicle
        self.tire: Tire = tire_of(vehicle) if tire is None else tire
        self.rear_tire: Tire = self.tire if rear_tire is None else rear_tire
        self.driver = driver or Driver()

    def simulate(
        self,
        maneuver: Maneuver,
        *,
        speed: _OverTime,
        friction: Friction | None = None,
        bank: _OverTime = 0.0,
        dt: float = 1e-3,
        sample_time: float = 0.01,
        name: str | None = None,
    ) -> PlantRun:
        """Drive a maneuver from straight ahead, with classical Runge-Kutta steps.
        speed : wanted speed [m/s], a number or a function of the times (n,) [s].
        friction : of the road; None is what the tire was measured on.
        bank : slope of the road across the car [rad], positive where it falls to the left; wheel
            loads stay those of a level road. A number or a function of the times.
        dt : step of the integration [s].
        sample_time : step of the record [s], a multiple of `dt`.
        name : of the run; None takes the name of the maneuver's class.

        The run at every `sample_time` from 0 to the maneuver's duration.
        """
        every = round(sample_time / dt) if dt > 0.0 else 0
        if not (every >= 1 and abs(every * dt - sample_time) < 1e-9 * sample_time):
            raise ValueError(f"sample_time {sample_time} must be a multiple of dt {dt}")
        n = every * round(maneuver.duration / sample_time) + 1
        t = dt * np.arange(n, dtype=np.float64)
        middle = t + 0.5 * dt  # inputs are held over a step: at its middle they are not late
        command = maneuver.steering(middle)
        v_ref, slope = (
            one(middle) if callable(one) else np.full(n, float(one)) for one in (speed, bank)
        )
        inputs = {"steering": command, "speed": v_ref, "bank": slope}
        for label, given in inputs.items():
            shape = (n, 2) if label == "steering" else (n,)
            if np.shape(given) != shape or not np.isfinite(given).all():
                raise ValueError(f"{label} must be finite and of shape {shape}")
        if not v_ref[0] > 0.0:
            raise ValueError(f"speed must be positive at the start, it is {v_ref[0]}")
        road = friction or Friction()
        start = np.zeros(N_STATES)
        start[0] = v_ref[0]
        values = {"x": start, "command": command, "v_ref": v_ref}
        values |= {"mu": road.over_time(middle), "places": road.over_place()}
        values["slope"] = GRAVITY * np.sin(slope)
        scan, values["constants"] = self.loop(dt)
        record = scan(n, values, every=every)
        finite = np.isfinite(record["x"]).all(axis=1)
        if not finite.all():
            raise PlantError(f"the car's state is not finite from t = {t[::every][~finite][0]} s")
        name = name if name is not None else type(maneuver).__name__
        t = t[::every]
        return PlantRun.from_record(name, self.vehicle, t, maneuver.steering(t), record)

    def loop(self, dt: float) -> _CompiledLoop:
        """Return the compiled loop over time.   dt : step of the integration [s]."""
        return _compiled_loop(self.vehicle, (self.tire, self.rear_tire), self.driver, dt)


# The plant one control period at a time: for a driver or a controller that looks before it steers.
#
# The same compiled loop as `Plant.simulate`, so that the same commands give the same numbers.


class PlantState(NamedTuple):
    """The plant at one instant; nothing changes it, `StepwisePlant.step` returns the next.

    Forces and acceleration are those under the inputs of the period that ends here.
    steps: of the integration since the start; x: state (18,) in the order of
    `models.plant.dynamics`; axle_force: to the side, front and rear, frame of the body, (2,) [N];
    acceleration: of the center of gravity along the axes of the body, (2,) [m/s^2]; alpha: slip
    angles of the wheels FL, FR, RL, RR in the paper's sign, (4,) [rad]; F_z: their loads, (4,) [N].
    """

    steps: int
    x: Array
    axle_force: Array
    acceleration: Array
    alpha: Array
    F_z: Array


class StepwisePlant:
    """A plant that is driven period by period.
    friction : of the road; None is what the tire was measured on.
    period : for which command and wanted speed are held [s], a multiple of `dt`.
    dt : step of the integration [s].
    """

    def __init__(
        self,
        plant: Plant,
        *,
        friction: Friction | None = None,
        period: float = 0.01,
        dt: float = 1e-3,
    ) -> None:
        every = round(period / dt)
        if not (dt > 0.0 and every >= 1 and abs(every * dt - period) < 1e-9 * period):
            raise ValueError(f"period {period} must be a multiple of dt {dt}")
        self.plant = plant
        self.friction = friction or Friction()
        self.period = period
        self.dt = dt
        self._every = every

    @cached_property
    def _steppers(self) -> tuple[Stepper, Stepper]:
        """Of the first instant, and of a period with the first step of the next one.
        That step is there for its outputs: they are those of the period's end.
        """
        scan, constants = self.plant.loop(self.dt)
        places = self.friction.over_place()
        values = {"x": np.zeros(N_STATES), "constants": constants, "places": places}
        return Stepper(scan, values), Stepper(scan, values, self._every + 1)

    def start(
        self, v_x: float, *, X: float = 0.0, Y: float = 0.0, psi: float = 0.0, kappa: float = 0.0
    ) -> PlantState:
        """Return the car rolling straight ahead, or turning without any force yet.
        v_x : speed [m/s].   X, Y : position of the center of gravity [m].   psi : heading [rad].
        kappa : curvature of its turn [1/m].
        """
        if not v_x > 0.0:
            raise ValueError(f"v_x must be positive at the start, it is {v_x}")
        x = np.zeros(N_STATES)
        x[[0, 5, 6, 7]] = v_x, X, Y, psi
        car = self.plant.vehicle
        x[[1, 2, 12]] = kappa * v_x * car.l_r, kappa * v_x, np.arctan(kappa * car.wheelbase)
        return self._run(self._steppers[0], 0, 1, x, np.array([x[12], 0.0]), v_x)

    def step(self, state: PlantState, command: Array, v_ref: float) -> PlantState:
        """Return the plant one period later.
        command : steering angles asked for, [δ_f, δ_r] [rad].   v_ref : wanted speed [m/s].
        """
        if not np.isfinite([*command, v_ref]).all():
            raise ValueError(f"command and v_ref must be finite, they are {command} and {v_ref}")
        n = self._every + 1
        return self._run(self._steppers[1], state.steps, n, state.x, command, v_ref)

    def _run(
        self, stepper: Stepper, start: int, n: int, x: Array, command: Array, v_ref: float
    ) -> PlantState:
        middle = self.dt * np.arange(start, start + n, dtype=np.float64) + 0.5 * self.dt
        stepper.begin("x", x)
        stepper.inputs["command"][:] = command
        stepper.inputs["v_ref"][:] = v_ref
        stepper.inputs["mu"][:] = self.friction.over_time(middle).reshape(n, 1)
        stepper.advance()
        now, x = start + n - 1, stepper.before("x")
        if not np.isfinite(x).all():
            raise PlantError(f"the car's state is not finite from t = {now * self.dt:.3f} s")
        outputs = (stepper.outputs[name].copy() for name in PlantState._fields[2:])
        return PlantState(now, x, *outputs)
