"""The structures of the C tracker as NumPy types: Python writes and reads them in place."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mpc.cost import N_ERRORS
from mpc.problem import Problem
from mpc.realtime.fall_back import N_GAINS, N_SPEEDS
from mpc.realtime.guards import Guards

N_COMMANDS = 32
N_STATUSES = 9
TIMES = ("cost_rate", "stage_time", "period", "delay")
LIMITS = ("max_steering", "max_rate", "max_e_y", "max_slip", "rise", "soft_e_y", "soft_slip")
OF_AXLES = ("max_slip", "rise")
GUARDS = (
    *("widest_e_y", "widest_e_psi", "max_v_y", "max_yaw_rate", "min_speed"),
    *("max_speed", "max_curvature", "speeds", "gains", "hold_time"),
)


def params_type(n_weights: int, *, single: bool) -> np.dtype[np.void]:
    """Return the type of the parameters.

    Parameters
    ----------
    n_weights : numbers of the tire.
    single : whether numbers are float.
    """
    real = _real(single)
    names = [*TIMES, *LIMITS, *GUARDS, "tolerance"]
    shapes = {**dict.fromkeys(OF_AXLES, (2,)), "speeds": (N_SPEEDS,), "gains": (N_SPEEDS, N_GAINS)}
    numbers = [(name, real, shapes.get(name, ())) for name in names]
    arrays = [("car", 4), ("weights", n_weights), ("cost", N_ERRORS), ("cost_end", N_ERRORS)]
    return np.dtype(
        [(name, real, (size,)) for name, size in arrays]
        + numbers
        + [(name, np.uint32) for name in ("max_iterations", "linearizations")],
        align=True,
    )


def state_type(horizon: int, n_x: int, *, single: bool) -> np.dtype[np.void]:
    """Return the type of the state.

    Parameters
    ----------
    horizon : number of stages.
    n_x : states of the car.
    single : whether numbers are float.
    """
    real, counts = _real(single), ("iterations", "age", "planned", "guessed", "started")
    return np.dtype(
        [
            ("x", real, (horizon + 1, n_x)),
            ("u", real, (horizon,)),
            ("feedback", real, (horizon, n_x)),
            ("commands", real, (N_COMMANDS,)),
            ("lagged", real, (2,)),
            ("faults", np.uint32, (N_STATUSES,)),
            *((name, np.uint32) for name in counts),
        ],
        align=True,
    )


def input_type(horizon: int, *, single: bool) -> np.dtype[np.void]:
    """Return the type of a measurement.

    Parameters
    ----------
    horizon : number of stages.
    single : whether numbers are float.
    """
    real = _real(single)
    numbers = [(name, real) for name in ("e_y", "e_psi", "v_y", "r")]
    ahead = [(name, real, (horizon + 1,)) for name in ("kappa", "v_x")]
    return np.dtype([*numbers, *ahead], align=True)


def set_params(params: NDArray[Any], problem: Problem, guards: Guards) -> None:
    """Write what is to be solved and guarded; tire, timing, solver and gains of the fall-back stay.

    Parameters
    ----------
    params : of `params_type`, written in place.
    problem : cost and limits.
    guards : bounds and fall-back.
    """
    cost, limits = problem.cost, problem.limits
    params["cost"], params["cost_end"] = cost.numbers(), cost.terminal_numbers()
    params["cost_rate"], params["stage_time"] = cost.R, problem.dt
    params["max_steering"], params["max_rate"] = limits.steering, limits.steering_rate
    params["max_e_y"], params["max_slip"] = limits.e_y, limits.slip
    params["soft_e_y"], params["soft_slip"] = limits.soft_e_y, limits.soft_slip
    params["widest_e_y"], params["widest_e_psi"] = guards.e_y, guards.e_psi
    params["max_v_y"], params["max_yaw_rate"] = guards.v_y, guards.yaw_rate
    for name in ("min_speed", "max_speed", "max_curvature", "hold_time"):
        params[name] = getattr(guards, name)


def _real(single: bool) -> type[np.floating]:
    return np.float32 if single else np.float64
