"""Collecting a drive, period by period."""

import numpy as np

from models.vehicle import Vehicle
from mpc.cars import CarState
from mpc.loop.record import Array, Drive, Plan
from mpc.loop.sensing import Measured
from mpc.path.path import Path
from mpc.path.projection import Projection
from mpc.realtime.messages import Command

OF_THE_CAR = ("t", "X", "Y", "psi", "v_x", "v_y", "r", "a_x", "a_y", "delta")


class Recorder:
    """What was driven so far.

    Parameters
    ----------
    plan_every : periods between two plans that are kept; 0 keeps none.
    """

    def __init__(self, plan_every: int) -> None:
        self._plan_every = plan_every
        self._cars: list[CarState] = []
        self._measured: list[Measured] = []
        self._others: list[tuple[float, ...]] = []
        self._plans: list[Plan] = []
        self._notes: list[tuple[float, str]] = []

    def note(self, t: float, text: str | None) -> None:
        """Keep what the learner said.

        Parameters
        ----------
        t : time [s].
        text : nothing, or a note.
        """
        if text:
            self._notes.append((t, text))

    @property
    def plan_is_due(self) -> bool:
        """Whether the plan of this period is to be kept."""
        return self._plan_every > 0 and len(self._cars) % self._plan_every == 0

    def plan(self, command: Command, s: Array) -> None:
        """Keep the plan of this period.

        Parameters
        ----------
        command : of the tracker.
        s : where the states of the plan lie along the path [m], (N + 1,).
        """
        plan = Plan(len(self._cars), s, command.plan_x.copy(), command.plan_u.copy())
        self._plans.append(plan)

    def add(
        self,
        state: CarState,
        here: Projection,
        measured: Measured,
        v_ref: float,
        command: Command,
    ) -> None:
        """Keep a period.

        Parameters
        ----------
        state : the truth.
        here : where it is along the path.
        measured : what the sensors said.
        v_ref : wanted speed [m/s].
        command : of the tracker.
        """
        self._cars.append(state)
        self._measured.append(measured)
        e_psi = here.heading_error(state.psi)
        self._others.append(
            (
                *(here.s, here.e_y, e_psi, here.kappa, v_ref),
                *(command.steering, command.solve_time_s, float(command.status)),
            )
        )

    def drive(
        self,
        *,
        name: str,
        vehicle: Vehicle,
        path: Path,
        period: float,
        completed: bool,
        ending: str,
    ) -> Drive:
        """Return the drive.

        Parameters
        ----------
        name : what was driven.
        vehicle : the car as its tracker was told of it.
        path : that was followed.
        period : control period [s].
        completed : whether the car reached the end on the path and without spinning.
        ending : why the drive ended.
        """
        s, e_y, e_psi, kappa, v_ref, steering, solve_time, status = np.array(self._others).T
        samples = np.array(self._measured).T
        return Drive(
            name=name,
            vehicle=vehicle,
            path=path,
            period=period,
            **{key: np.array([getattr(car, key) for car in self._cars]) for key in OF_THE_CAR},
            axle_force=np.array([car.axle_force for car in self._cars]),
            s=s,
            e_y=e_y,
            e_psi=e_psi,
            kappa=kappa,
            v_ref=v_ref,
            command=steering,
            measured=dict(zip(Measured._fields, samples, strict=True)),
            status=status.astype(np.int64),
            solve_time=solve_time,
            plans=tuple(self._plans),
            notes=tuple(self._notes),
            completed=completed,
            ending=ending,
        )
