"""The tracker in C, from Python: compiled once for a structure, every number set at run time."""

import time
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from codegen.arrays import Array
from models.rules import require_within
from mpc.problem import Guards, Problem
from mpc.realtime.caution import set_caution
from mpc.realtime.fall_back import fall_back
from mpc.realtime.instance import N_COMMANDS, Command, Instance, Measurement, Status, set_params
from mpc.tires.tire import PredictionTire, valid_slip

TOLERANCE = {False: 1e-8, True: 1e-5}  # of the solver, by `single`


class Tracker:
    """Steers a car along a path by one iteration of the solver each period.

    The command of a step acts `delay` after its measurement, and is held for a period. What is
    steered is a ramp to the solver, so that it plans from half a period before.
    problem : what to minimize; None takes the default for a car of its size.
    period : between two steps [s], at most the stage's length.
    delay : from a measurement until its command acts on the wheels [s], lags included.
    guards : what is possible, and the fall-back; None takes the default for a car of its size.
    tolerance : of the solver, in parts: mean product of gap and multiplier against the largest
        multiplier, where gaps count limits as 1; None takes 1e-8, in float 1e-5.
    linearizations : a step; 1 in real time, some 10 to convergence.
    max_active_sets : sets of active limits that are tried before the interior point, each at most a
        third of its iteration; 0 takes that alone.
    caution : share of what is not known of the tires that is feared, from 0 to 1: see
        `mpc.realtime.caution`.
    clock : of the solve times [s].
    """

    def __init__(
        self,
        tire: PredictionTire,
        problem: Problem | None = None,
        *,
        period: float = 0.01,
        delay: float = 0.0,
        guards: Guards | None = None,
        tolerance: float | None = None,
        max_iterations: int = 50,
        linearizations: int = 1,
        max_active_sets: int = 16,
        single: bool = False,
        caution: float = 0.0,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        problem = problem or Problem.of(tire.vehicle, period)
        longest = (N_COMMANDS - 1) * period
        if not 0.0 < period <= problem.dt:
            raise ValueError(f"period must be positive and at most {problem.dt}, it is {period}")
        if not 0.0 <= delay <= longest:
            raise ValueError(f"delay must be between 0 and {longest:g} s, it is {delay}")
        solver = {
            "tolerance": TOLERANCE[single] if tolerance is None else tolerance,
            "max_iterations": max_iterations,
            "linearizations": linearizations,
        }
        for name, value in solver.items():
            if not value > 0:
                raise ValueError(f"{name} must be positive, it is {value}")
        if max_active_sets < 0:
            raise ValueError(f"max_active_sets must not be negative, it is {max_active_sets}")
        self.tire, self.problem, self.period, self.delay = tire, problem, period, delay
        require_within(ValueError, 0.0, 1.0, caution=caution)
        self.caution = caution
        self._clock = clock
        self.instance = Instance(tire.structure, problem.horizon, single=single)
        self._preview: Instance | None = None  # what would be planned with another tire
        params = self.instance.params
        guards = guards or Guards.of(tire.vehicle)
        set_params(params, problem, guards)
        table = fall_back(
            tire.vehicle, period=period, delay=delay, e_y=guards.fall_back_e_y,
            acceleration=guards.fall_back_acceleration,
        )  # fmt: skip
        params["speeds"], params["gains"] = table
        solver["max_active_sets"] = max_active_sets
        for name, value in {"period": period, "delay": delay, **solver}.items():
            params[name] = value
        self.set_tire(tire)

    @property
    def times(self) -> Array:
        """Times after a measurement at which to tell curvature and speed [s], (N + 1,)."""
        middles = np.arange(self.problem.horizon) + 0.5
        return np.append(0.0, self._ahead + self.problem.dt * middles)

    @property
    def plan_times(self) -> Array:
        """Times after a measurement of the states of the plan [s], (N + 1,)."""
        return self._ahead + self.problem.dt * np.arange(self.problem.horizon + 1.0)

    @property
    def _ahead(self) -> float:
        return max(self.delay - 0.5 * self.period, 0.0)

    @property
    def steering(self) -> float:
        """Angle that the last step asked for [rad]."""
        return float(self.instance.steering)

    @property
    def grip(self) -> float:
        """Friction that is planned with, over that of the tire [-]; 1 without caution."""
        return float(self.instance.state["grip"])

    @property
    def faults(self) -> dict[Status, int]:
        """Steps of each status since the tracker was made."""
        return {status: int(self.instance.state["faults"][status]) for status in Status}

    @property
    def params(self) -> NDArray[np.void]:
        """A copy of the numbers that the C reads, of `mpc.realtime.instance.c_types`."""
        return self.instance.params.copy()

    def set_tire(self, tire: PredictionTire) -> None:
        """Go on with other weights, the car that they are of and the slip that is of use to it."""
        self._write_tire(self.instance, tire)
        self.tire = tire

    def previewed_rate(self, tire: PredictionTire) -> float:
        """Return the first steering rate of the plan after one more iteration with a tire [rad/s].

        An instance of its own is asked, on the plan and the road of the last step; the one that
        steers is read and not written.
        """
        now = self.instance
        if self._preview is None:
            single = now.state["u"].dtype == np.float32
            self._preview = Instance(self.tire.structure, self.problem.horizon, single=single)
        preview = self._preview
        for there, here in zip(preview.numbers, now.numbers, strict=True):
            there[...] = here
        self._write_tire(preview, tire)
        preview.start[:] = now.state["x"][0]
        preview.solve()
        return float(preview.state["u"][0])

    def _write_tire(self, instance: Instance, tire: PredictionTire) -> None:
        """Write weights, car, and the slip that is of use; what was prepared is of another tire."""
        if tire.structure != self.tire.structure:
            raise ValueError(
                f"the tracker is built for {self.tire.structure}, not {tire.structure}"
            )
        weights, car, params = np.asarray(tire.weights), tire.car, instance.params
        if weights.shape != params["weights"].shape:
            raise ValueError(f"weights must be {params['weights'].size}, not {weights.shape}")
        if not (np.isfinite(weights).all() and np.isfinite(car).all()):
            raise ValueError("weights and car must be finite")
        params["weights"], params["car"] = weights, car
        valid = valid_slip(tire, self.problem.limits.slip)
        params["max_slip"], params["rise"] = valid.slip, valid.rise
        set_caution(params, tire, self.caution)
        instance.state["prepared"] = 0

    def reset(self, steering: float = 0.0) -> None:
        """Forget what was planned and steered; faults are kept.
        steering : angle of the wheels now [rad].
        """
        if self.instance.reset(steering) != Status.OK:
            most = self.problem.limits.steering
            raise ValueError(f"steering must be finite and at most {most:g} rad, it is {steering}")

    def prepare(self, kappa: ArrayLike, v_x: ArrayLike) -> float:
        """Do ahead of the next measurement what does not ask for it; return the time it took [s].

        The step is a sweep then: its `solve_time_s` is the latency from measurement to command. On
        another road than it is given with the measurement, or without a plan, it does all itself.
        kappa : curvature [1/m] that the next measurement will tell, at `times`, (N + 1,).
        v_x : speed [m/s] that it will tell, (N + 1,).
        """
        instance = self.instance
        instance.input["kappa"], instance.input["v_x"] = kappa, v_x
        start = self._clock()
        instance.prepare()
        return self._clock() - start

    def step(self, measurement: Measurement) -> Command:
        instance, ports = self.instance, self.instance.input
        ports["e_y"], ports["e_psi"], ports["v_y"], ports["r"] = measurement[:4]
        ports["kappa"], ports["v_x"] = measurement[4:6]
        start = self._clock()
        status = instance.step()
        return instance.command(float(instance.steering), status, self._clock() - start)
