"""What a drive was: all signals over time, what the tracker planned, and how it ended."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from codegen.arrays import Array, root_mean_square
from models.recordings import Recording
from models.vehicle import Vehicle
from mpc.cars import CarState, DoubleTrackCar
from mpc.loop.lateral import LateralEstimate
from mpc.loop.sensing import Measured
from mpc.path.path import Path, Projection
from mpc.realtime.instance import Command, Status

COMPLETED = "reached the end"


class Plan(NamedTuple):
    """What the tracker meant to do, as seen at one period.

    period: row of the drive's signals at which it was made; s (N + 1,): where along the path [m];
    x (N + 1, n_x): states; u (N,): steering rates [rad/s].
    """

    period: int
    s: Array
    x: Array
    u: Array

    def line(self, path: Path) -> tuple[Array, Array]:
        """Return X and Y [m] of the plan, (N + 1,) each."""
        X, Y, psi = path.pose(self.s)
        return X - self.x[:, 0] * np.sin(psi), Y + self.x[:, 0] * np.cos(psi)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Drive:
    """A drive of n periods along a path; signals without another word are the truth, SI, ISO axes.
    period : control period [s].
    t : time [s], (n,).
    X, Y, psi : position [m] and heading [rad], (n,).
    v_x, v_y, r : velocity in the frame of the body [m/s] and yaw rate [rad/s], (n,).
    a_x, a_y : acceleration along the axes of the body [m/s^2], (n,).
    delta : actual angle of the front road wheels [rad], (n,).
    axle_force : side force of the axles, frame of the body [N], (n, 2).
    s, e_y, e_psi, kappa : arc length [m], deviation to the left [m], heading against the path
        [rad] and curvature of the path [1/m], (n,).
    e_y_seen : deviation as the car measured it, (n,) [m].
    v_ref : wanted speed [m/s], (n,).
    command : steering angle decided on at this period, which acts `delay` periods later [rad],
        (n,).
    measured : what the sensors said, by the names of `Measured`, (n,) each; v_y is not among them
        where nothing measures it.
    estimates : v_y in its place, by the names of `LateralEstimate`, (n,) each; empty where v_y is
        measured.
    status : of the tracker, by its number, (n,).
    solve_time : of the tracker [s], (n,).
    notes : what the learner said and when [s].
    completed : whether the car reached the end on the path, without spinning and by new plans in
        90 % of the steps.
    """

    name: str
    vehicle: Vehicle
    path: Path
    period: float
    t: Array
    X: Array
    Y: Array
    psi: Array
    v_x: Array
    v_y: Array
    r: Array
    a_x: Array
    a_y: Array
    delta: Array
    axle_force: Array
    s: Array
    e_y: Array
    e_psi: Array
    kappa: Array
    e_y_seen: Array
    v_ref: Array
    command: Array
    measured: Mapping[str, Array]
    estimates: Mapping[str, Array] = field(default_factory=dict)
    status: NDArray[np.int64]
    solve_time: Array
    plans: tuple[Plan, ...]
    notes: tuple[tuple[float, str], ...]
    completed: bool
    ending: str

    def __len__(self) -> int:
        return len(self.t)

    def recording(self) -> Recording:
        """Return what an identifier would read of it: measured signals, axle forces as truth.

        Where nothing measures v_y, it is what was given, and marked as that: no method is shown it.
        """
        return Recording(
            name=self.name,
            t=self.t,
            v_x=self.measured["v_x"],
            v_y=self.measured["v_y"] if "v_y" in self.measured else self.estimates["v_y"],
            r=self.measured["r"],
            delta_f=self.measured["delta"],
            delta_r=np.zeros_like(self.t),
            a_y=self.measured["a_y"],
            axle_force=self.axle_force,
            estimated=("v_y",) if self.estimates else (),
        )


_OF_THE_CAR = ("t", "X", "Y", "psi", "v_x", "v_y", "r", "a_x", "a_y", "delta", "axle_force")
_OTHERS = ("s", "e_y", "e_psi", "kappa", "e_y_seen", "v_ref", "command", "solve_time", "status")


class Recorder:
    """What was driven so far.
    plan_every : periods between two plans that are kept; 0 keeps none.
    """

    def __init__(self, plan_every: int) -> None:
        self._plan_every = plan_every
        self._cars: list[CarState] = []
        self._measured: list[Measured] = []
        self._estimates: list[LateralEstimate] = []
        self._others: list[tuple[float, ...]] = []
        self._plans: list[Plan] = []
        self._notes: list[tuple[float, str]] = []

    def note(self, t: float, text: str | None) -> None:
        """Keep what the learner said.

        t : time [s].
        """
        if text:
            self._notes.append((t, text))

    @property
    def steps(self) -> int:
        """How many periods were kept."""
        return len(self._cars)

    @property
    def plan_is_due(self) -> bool:
        """Whether the plan of this period is to be kept."""
        return self._plan_every > 0 and self.steps % self._plan_every == 0

    def plan(self, command: Command, s: Array) -> None:
        """Keep the plan of this period.

        s : where the states of the plan lie along the path [m], (N + 1,).
        """
        plan = Plan(len(self._cars), s, command.plan_x.copy(), command.plan_u.copy())
        self._plans.append(plan)

    def add(
        self,
        state: CarState,
        here: Projection,
        measured: Measured,
        e_y_seen: float,
        v_ref: float,
        command: Command,
        given: LateralEstimate | None = None,
    ) -> None:
        """Keep a period.

        e_y_seen : deviation as it was measured [m].   v_ref : wanted speed [m/s].
        """
        if given is not None:
            self._estimates.append(given)
        self._cars.append(state)
        self._measured.append(measured)
        e_psi = here.heading_error(state.psi)
        self._others.append(
            (
                *(here.s, here.e_y, e_psi, here.kappa, e_y_seen, v_ref),
                *(command.steering, command.solve_time_s, float(command.status)),
            )
        )

    def drive(self, name: str, path: Path, car: DoubleTrackCar, ending: str) -> Drive:
        """Return the drive; its control period is given in s."""
        others = dict(zip(_OTHERS, np.array(self._others).T, strict=True))
        measured = dict(zip(Measured._fields, np.array(self._measured).T, strict=True))
        given: dict[str, Array] = {}
        if self._estimates:
            given = dict(zip(LateralEstimate._fields, np.array(self._estimates).T, strict=True))
            del measured["v_y"]
        return Drive(
            name=name,
            vehicle=car.vehicle,
            path=path,
            period=car.period,
            **{key: np.array([getattr(car, key) for car in self._cars]) for key in _OF_THE_CAR},
            status=others.pop("status").astype(np.int64),
            **others,
            measured=measured,
            estimates=given,
            plans=tuple(self._plans),
            notes=tuple(self._notes),
            completed=ending == COMPLETED,
            ending=ending,
        )


class Scores(NamedTuple):
    """Deviation from the path and cost of steering; `to_dict` is ready for JSON.

    rms_e_y_m, peak_e_y_m : root mean square and largest magnitude of the true deviation [m].
    completed : whether the car reached the end on the path.   failures : periods in which the
    tracker reported other than success, by status.   solve_ms : time of the tracker's step: median,
    p99 and max [ms].
    """

    rms_e_y_m: float
    peak_e_y_m: float
    completed: bool
    failures: Mapping[str, int]
    solve_ms: Mapping[str, float]


def scores(drive: Drive) -> Scores:
    values, counts = np.unique(drive.status, return_counts=True)
    failures = {
        Status(int(value)).name: int(count)
        for value, count in zip(values, counts, strict=True)
        if value != Status.OK
    }
    solve_ms = 1e3 * drive.solve_time
    return Scores(
        rms_e_y_m=root_mean_square(drive.e_y),
        peak_e_y_m=float(np.abs(drive.e_y).max()),
        completed=drive.completed,
        failures=failures,
        solve_ms={
            "median": float(np.median(solve_ms)),
            "p99": float(np.percentile(solve_ms, 99.0)),
            "max": float(solve_ms.max()),
        },
    )


class EstimateScores(NamedTuple):
    """Errors of the lateral velocity that was estimated, against the truth.

    rms_error_m_s, rms_error_deg : root mean square of the error of v_y [m/s] and of side slip
    [deg].   rms_deg : of the true side slip [deg].   within_two_sd : share of the samples whose
    error lies within two standard deviations.   inertial_rms_error_m_s : of the identifier alone,
    without position [m/s].
    """

    rms_error_m_s: float
    rms_error_deg: float
    rms_deg: float
    within_two_sd: float
    inertial_rms_error_m_s: float


def estimate_scores(drive: Drive) -> EstimateScores | None:
    """Return how right the v_y was that was given over a drive; None where sensors showed it."""
    if not drive.estimates:
        return None

    def rms(values: Array) -> float:
        return float(np.sqrt(np.nanmean(values**2)))

    error, sd = drive.estimates["v_y"] - drive.v_y, drive.estimates["v_y_sd"]
    known = np.isfinite(error)
    return EstimateScores(
        rms_error_m_s=rms(error),
        rms_error_deg=float(np.rad2deg(rms(error / drive.v_x))),
        rms_deg=float(np.rad2deg(rms(np.arctan2(drive.v_y, drive.v_x)))),
        within_two_sd=float(np.mean(np.abs(error[known]) <= 2.0 * sd[known])),
        inertial_rms_error_m_s=rms(drive.estimates["inertial_v_y"] - drive.v_y),
    )
