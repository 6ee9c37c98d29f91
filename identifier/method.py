"""What every way to identify has in common: a compiled step, where it starts, what it freezes to.

The laws of the paper, the better laws and the baselines run, are recorded, frozen and compared by
the same code; they differ in the `Method` that is handed over.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple, Protocol

import numpy as np

from codegen import Scan
from codegen.arrays import Array
from identifier.tire_model import TireModel
from models.recordings import Recording
from models.rules import LARGEST_FORCE
from models.schema import Table
from models.vehicle import Vehicle

SLIP = 0.02  # rad, below the peak of every tire
SLIDE = 300  # samples of 10 ms: after them a lag of the force is over


class CannotFreezeError(ValueError):
    """The method estimates a signal: there is no model of the tire to freeze."""


def steady_stiffness(model: TireModel, v_x: float) -> Array:
    """Return the slope of both axle forces over slip between two steady slides, (2,) [N/rad].

    Parameters
    ----------
    model : frozen.
    v_x : speed of the slides [m/s], without yawing or steering.
    """
    t, zeros = np.arange(SLIDE) / 100.0, np.zeros(SLIDE)
    right, left = (
        model.axle_force(
            Recording(
                name="a steady slide",
                t=t,
                v_x=np.full(SLIDE, v_x),
                v_y=np.full(SLIDE, -v_x * np.tan(alpha)),
                r=zeros,
                delta_f=zeros,
                delta_r=zeros,
            )
        )[-1]
        for alpha in (-SLIP, SLIP)
    )
    return np.asarray((left - right) / (2.0 * SLIP))


class Setup(NamedTuple):
    """A run, ready to go: the compiled step, the values it carries at the start, its constants.

    The step reads x = [v_y, r] (2,), u = [δ_f, δ_r] (2,) and v_x sample by sample, SI, and has an
    output axle_force (2,) [N].
    """

    scan: Scan
    carry: Mapping[str, Array]
    constants: Mapping[str, Array]

    def run(self, recording: Recording) -> dict[str, Array]:
        """Return what the compiled step records over a recording, by port.

        Parameters
        ----------
        recording : its signals are the input; its forces are not looked at.
        """
        signals = {"x": recording.x, "u": recording.u, "v_x": recording.v_x}
        sampled = {name: signals[name] for name in self.scan.over}
        return self.scan(len(recording), {**self.carry, **sampled, **self.constants})


class Method(Protocol):
    """A way to identify axle forces: everything that is chosen before the car drives."""

    @property
    def dt(self) -> float:
        """Sampling interval [s]."""

    @property
    def min_speed(self) -> float:
        """Below this speed [m/s] learning rests and forces read zero."""

    def setup(
        self, vehicle: Vehicle, recording: Recording, start: TireModel | None = None
    ) -> Setup:
        """Return what a run needs.

        Parameters
        ----------
        vehicle : the car.
        recording : what it drove; the run begins at its first sample.
        start : model whose weights the run begins with; None begins with those of the method.
        """

    def frozen(self, vehicle: Vehicle, state: Mapping[str, Array]) -> TireModel:
        """Return the model that carried values make.

        Parameters
        ----------
        vehicle : the car.
        state : values of the carried ports at one instant.

        Raises
        ------
        CannotFreezeError
            For a method that estimates a signal.
        """


# The format of stored frozen models, and the error of a file that does not keep it.

FORMAT = "tireid frozen model 1"


class FrozenModelError(ValueError):
    """A file does not hold a frozen model; the message names the file and what is wrong."""


DEAD = 0.02  # of the stiffness told, below which an axle does not push
PROBE = 0.02  # rad, a slip at which every tire pushes back
WIDE = 0.3  # rad, beyond the slip of every tire's peak
PROBE_SPEED = 10.0  # m/s
LARGEST_MIN_SPEED = 50.0  # m/s: above it, a car would have forces on motorways only

VEHICLE_KEYS = (
    "name",
    "mass",
    "yaw_inertia",
    "l_f",
    "l_r",
    "cornering_stiffness_front",
    "cornering_stiffness_rear",
)


def vehicle_numbers(vehicle: Vehicle) -> dict[str, Any]:
    """Return the name and the six numbers of the bicycle by the words of a vehicle file, SI.

    Where some of them are estimated, `estimated` lists which.

    Parameters
    ----------
    vehicle : the car.
    """
    numbers = {key: getattr(vehicle, key) for key in VEHICLE_KEYS}
    return numbers | ({"estimated": list(vehicle.estimated)} if vehicle.estimated else {})


def vehicle_from(data: Mapping[str, Any]) -> Vehicle:
    """Return the car that `vehicle_numbers` describes.

    Parameters
    ----------
    data : as from `vehicle_numbers`.

    Raises
    ------
    ValueError
        Where a key is missing or unknown, or a value has a wrong type or is impossible.
    """
    table = Table(data, "", FrozenModelError, "vehicle.")
    return Vehicle(**table.record(Vehicle, skip=("chassis",)))


class SteadyTires(Protocol):
    """What has steady axle forces at slip angles, and knows the linear tires of its car."""

    @property
    def vehicle(self) -> Vehicle:
        """The car, with the cornering stiffnesses that it is told."""

    def force_at(self, alpha: Array) -> Array:
        """Return the steady axle forces at slip angles, (k, 2) [N].

        Parameters
        ----------
        alpha : slip angles in the paper's sign [rad], (k,).
        """


def require_alive(refusal: type[ValueError], tires: SteadyTires) -> None:
    """Refuse tires that no road has: forces that are not finite or too large, or a dead axle.

    Parameters
    ----------
    refusal : class of the error to raise.
    tires : both axles.

    Raises
    ------
    ValueError
        Of that class, with the forces or the stiffness.
    """
    force = np.asarray(tires.force_at(np.array([-WIDE, -PROBE, PROBE, WIDE])))
    if not (np.abs(force) <= LARGEST_FORCE).all():
        raise refusal(
            f"axle forces must be finite and below {LARGEST_FORCE:g} N, at {WIDE} rad of slip and "
            f"less they reach {np.abs(force).max():g} N"
        )
    if not (force[2] > force[1]).all():
        raise refusal(
            f"axle forces must rise with slip, at {-PROBE} and {PROBE} rad they are "
            f"{force[1].tolist()} and {force[2].tolist()} N: check units, the order of inputs, "
            "and the sign of slip (slip_sign)"
        )
    slope = (force[2] - force[1]) / (2.0 * PROBE)
    for axle, here, told in zip(("front", "rear"), slope, tires.vehicle.bicycle[4:], strict=True):
        if not here >= DEAD * told:
            raise refusal(
                f"the {axle} axle does not push: it has {here:.4g} N/rad, its vehicle {told:.4g}; "
                "check the units of force and slip"
            )


def require_min_speed(speed: float) -> None:
    """Refuse a lowest speed [m/s] that is not positive, or that no car drives at.

    Parameters
    ----------
    speed : below which forces read zero.

    Raises
    ------
    ValueError
        Where it is not above zero, or above `LARGEST_MIN_SPEED`.
    """
    if not 0.0 < speed <= LARGEST_MIN_SPEED:
        raise ValueError(
            f"min_speed must be positive and at most {LARGEST_MIN_SPEED:g} m/s, it is {speed:g}"
        )
