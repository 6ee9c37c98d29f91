"""A planned maneuver on a car whose tires nobody planned with: steered, and held on its course."""

from collections.abc import Callable
from typing import Any

import numpy as np

from codegen.arrays import Array
from identifier.plan.chosen import CHOSEN
from identifier.plan.motion import Hold
from models.maneuvers import Maneuver
from models.plant import Plant, StepwisePlant
from models.recordings import Recording

Course = Callable[
    [Array], Array
]  # times since the entry [s] (n,) -> X, Y [m], heading [rad] (n, 3)


def rehearse(
    plant: Plant, steering: Maneuver, course: Course, speed: float, hold: Hold
) -> tuple[Recording, Array]:
    """Return what exact sensors see of a maneuver, and the way of the center of gravity.

    speed : [m/s].

    The recording, from `CHOSEN.lead` seconds before the maneuver on, with true forces; X, Y [m] and
    heading [rad] of each of its samples (n, 3).
    """
    stepwise, before = (
        StepwisePlant(plant, period=CHOSEN.period),
        round(CHOSEN.lead / CHOSEN.period),
    )
    X, Y, psi = map(float, course(np.zeros(1))[0])
    state = stepwise.start(
        speed,
        X=X - CHOSEN.lead * speed * np.cos(psi),
        Y=Y - CHOSEN.lead * speed * np.sin(psi),
        psi=psi,
    )
    t = CHOSEN.period * np.arange(
        before + round(steering.duration / CHOSEN.period) + 1, dtype=np.float64
    )
    # Angles are held: at the middle of it they are not late.
    middle = t + 0.5 * CHOSEN.period - CHOSEN.lead
    planned = np.where(middle < 0.0, 0.0, steering.steering(np.maximum(middle, 0.0))[:, 0])
    wanted = course(np.maximum(t - CHOSEN.lead, 0.0))
    rows: list[Any] = []
    for k in range(t.size):
        x = state.x
        rows.append([*x[[0, 1, 2, 12, 5, 6, 7]], state.acceleration[1], *state.axle_force])
        added = hold.steering(tuple(wanted[k]), (x[5], x[6], x[7])) if k >= before else 0.0
        state = stepwise.step(state, np.array([planned[k] + added, 0.0]), speed)
    v_x, v_y, r, delta, X_, Y_, psi_, a_y, front, rear = np.array(rows).T
    recording = Recording(
        name="rehearsal",
        t=t,
        v_x=v_x,
        v_y=v_y,
        r=r,
        delta_f=delta,
        delta_r=np.zeros(t.size),
        a_y=a_y,
        axle_force=np.column_stack([front, rear]),
    )
    return recording, np.column_stack([X_, Y_, psi_])
