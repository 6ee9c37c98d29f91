"""The car as data: six numbers for the linear bicycle and, where a plant is wanted, its chassis.

SI units, ISO axes. The cornering stiffness is per axle (both tires), in the paper's sign
F_y = +C alpha with alpha = delta - atan2(v_y +- l r, v_x), the negative of the ISO 8855 slip angle.
"""

import os
from dataclasses import dataclass
from pathlib import Path

from models import vehicle_file
from models.bicycle import BicycleParameters
from models.chassis import Chassis, VehicleError
from models.doors import Table, read_toml, require_name
from models.files import write_atomically
from models.rules import require_positive, require_within

GRAVITY = 9.81  # standard acceleration of free fall, rounded as usual [m/s^2]

__all__ = ["GRAVITY", "BicycleParameters", "Chassis", "Vehicle", "VehicleError", "sedan"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Vehicle:
    """A car; `chassis` may be None where only the linear bicycle is needed.

    Parameters
    ----------
    name : what reports and figures call the car.
    mass : total mass [kg].
    yaw_inertia : moment of inertia about the vertical axis [kg m^2].
    l_f, l_r : distance from the center of gravity to the front and rear axle [m].
    cornering_stiffness_front, cornering_stiffness_rear : slope of the lateral force of the axle
        (both tires) over its slip angle at zero [N/rad].
    chassis : what the double-track plant needs, or None.

    Raises
    ------
    VehicleError
        For a value that is not positive and finite, for an inertia or a stiffness that no car of
        that mass has, or for springs too soft to carry the body.
    """

    name: str = "car"
    mass: float
    yaw_inertia: float
    l_f: float
    l_r: float
    cornering_stiffness_front: float
    cornering_stiffness_rear: float
    chassis: Chassis | None = None

    def __post_init__(self) -> None:
        require_name(VehicleError, "name", self.name)
        require_positive(
            VehicleError,
            mass=self.mass,
            yaw_inertia=self.yaw_inertia,
            l_f=self.l_f,
            l_r=self.l_r,
            cornering_stiffness_front=self.cornering_stiffness_front,
            cornering_stiffness_rear=self.cornering_stiffness_rear,
        )
        self._require_plausible()
        if self.chassis is not None:
            tipping = self.weight * self.roll_arm
            if not self.chassis.roll_stiffness > tipping:
                raise VehicleError(
                    f"roll_stiffness must exceed mass * g * roll arm = {tipping:.6g} N m/rad or "
                    f"the body tips over at rest, it is {self.chassis.roll_stiffness}"
                )

    def _require_plausible(self) -> None:
        """Refuse values that no car of any size has: a wrong unit, or a digit too many."""
        require_within(VehicleError, 1e-2, 1e6, mass=self.mass)  # a toy; a dump truck has 6e5
        require_within(VehicleError, 1e-3, 30.0, l_f=self.l_f, l_r=self.l_r)
        usual = self.mass * self.l_f * self.l_r  # about that; 0.4 times it in models
        if not 0.05 < self.yaw_inertia / usual < 20.0:
            raise VehicleError(
                f"yaw_inertia in kg m^2 must be 0.05 to 20 times mass * l_f * l_r = {usual:.4g}, "
                f"it is {self.yaw_inertia:g}: check the units"
            )
        for name, load in zip(("front", "rear"), self.axle_loads, strict=True):
            stiffness = getattr(self, f"cornering_stiffness_{name}")
            if not 0.5 < stiffness / load < 500.0:  # about 16 for a passenger car, 4 for models
                raise VehicleError(
                    f"cornering_stiffness_{name} in N/rad must be 0.5 to 500 times the static load "
                    f"of the axle, {load:.4g} N, it is {stiffness:g}: check the units"
                )

    @property
    def wheelbase(self) -> float:
        """Distance between the axles, l_f + l_r [m]."""
        return self.l_f + self.l_r

    @property
    def weight(self) -> float:
        """Weight m g [N]."""
        return self.mass * GRAVITY

    @property
    def axle_loads(self) -> tuple[float, float]:
        """Static vertical load of the front and the rear axle [N]."""
        return (
            self.weight * self.l_r / self.wheelbase,
            self.weight * self.l_f / self.wheelbase,
        )

    @property
    def roll_arm(self) -> float:
        """Height of the center of gravity above the roll axis [m].

        Raises
        ------
        VehicleError
            When the vehicle has no chassis.
        """
        chassis = self.require_chassis()
        front, rear = chassis.roll_center_height_front, chassis.roll_center_height_rear
        return chassis.cg_height - (self.l_r * front + self.l_f * rear) / self.wheelbase

    @property
    def bicycle(self) -> BicycleParameters:
        """The six numbers of the linear bicycle in the paper's letters."""
        return BicycleParameters(
            m=self.mass,
            I_z=self.yaw_inertia,
            l_f=self.l_f,
            l_r=self.l_r,
            C_f=self.cornering_stiffness_front,
            C_r=self.cornering_stiffness_rear,
        )

    def require_chassis(self) -> Chassis:
        """Return the chassis to who cannot do without.

        Raises
        ------
        VehicleError
            When the vehicle has none.
        """
        if self.chassis is None:
            raise VehicleError(f"vehicle '{self.name}' has no [chassis] table: a plant needs one")
        return self.chassis

    @classmethod
    def from_toml(cls, path: str | os.PathLike[str]) -> "Vehicle":
        """Read a vehicle from a TOML file: six flat keys, optional name and table [chassis].

        Parameters
        ----------
        path : the TOML file; a relative `tire` in [chassis] starts from its folder.

        Raises
        ------
        VehicleError
            One line with file, key and rule: key unknown or missing, type or value wrong.
        FileNotFoundError
            When there is no such file.
        """
        file = Path(path)
        data = read_toml(file, VehicleError)
        inner = data.pop("chassis", None)
        values = Table(data, f"{file}: ", VehicleError).record(cls, skip=("chassis",))
        if inner is not None:
            parts = Table(inner, f"{file}: ", VehicleError, "chassis.").record(Chassis)
        try:
            if inner is None:
                return cls(**values)
            if "tire" in parts:
                parts["tire"] = (file.parent / parts["tire"]).resolve()
            return cls(**values, chassis=Chassis(**parts))
        except (ValueError, RuntimeError) as error:  # RuntimeError: a link that leads to itself
            raise VehicleError(f"{file}: {error}") from None

    def to_toml(self, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
        """Write the vehicle so that `from_toml` gives back an equal one, bit for bit.

        Parameters
        ----------
        path : the file to write; a tire file is named relative to its folder.
        overwrite : replace a file that is already there.

        Raises
        ------
        FileExistsError
            When the file is there and `overwrite` is False.
        """
        file = Path(path)
        text = vehicle_file.text(self, folder=file.parent, table="chassis")
        if not overwrite and file.exists():
            raise FileExistsError(f"{file} exists; overwrite=True replaces it")
        write_atomically(file, text)


def sedan() -> Vehicle:
    """Return the documented mid-size sedan; its file says where each value comes from."""
    return Vehicle.from_toml(Path(__file__).parent / "data" / "sedan.toml")
