"""Coefficients of the force equations of the Magic Formula 5.2, under the names of the tire file.

They are dimensionless or in radian whatever the [UNITS] of the file; only FNOMIN has a unit there.
A missing coefficient is 0 and a missing scaling factor 1, which switches its effect off.
"""

import math
from dataclasses import dataclass, fields, replace
from typing import Self

from models.rules import require_within
from models.tires.forces import Expression

ESSENTIAL = ("FNOMIN", "PCX1", "PDX1", "PKX1", "PCY1", "PDY1", "PKY1", "PKY2")
# Conicity and ply-steer: these change sign when the tire is mounted on the other side
_ASYMMETRIC = ("PHY1", "PHY2", "PVY1", "PVY2", "PEY3", "RHX1", "RBY3", "RVY1", "RVY2")
_LARGEST = 1e5  # of a coefficient: those of real tires reach about 100
_MOST = {"FNOMIN": 1e7, "PDX1": 100.0, "PDY1": 100.0}  # N, and frictions
_POSITIVE = ("FNOMIN", "LFZO", "PKY2", "PDX1", "PDY1", "PKX1")
_POSITIVE_SCALES = ("LCX", "LMUX", "LKX", "LCY", "LMUY", "LKY")


@dataclass(frozen=True, slots=True, kw_only=True)
class Coefficients:
    """One tire, as its file has it.
    FNOMIN : nominal wheel load [N], > 0.
    PCX1, PDX1, PKX1 : shape, friction, slip stiffness over load of F_x, > 0.
    PCY1, PDY1 : shape and friction of F_y, > 0.
    PKY1 : greatest cornering stiffness over FNOMIN [1/rad], < 0: ISO axes.
    PKY2 : load of the greatest cornering stiffness over FNOMIN, > 0.
    """

    FNOMIN: float
    PCX1: float
    PDX1: float
    PKX1: float
    PCY1: float
    PDY1: float
    PKY1: float
    PKY2: float
    # F_x, pure: friction, curvature, stiffness over load; horizontal and vertical shift
    PDX2: float = 0.0
    PDX3: float = 0.0
    PEX1: float = 0.0
    PEX2: float = 0.0
    PEX3: float = 0.0
    PEX4: float = 0.0
    PKX2: float = 0.0
    PKX3: float = 0.0
    PHX1: float = 0.0
    PHX2: float = 0.0
    PVX1: float = 0.0
    PVX2: float = 0.0
    # F_x, weight by α
    RBX1: float = 0.0
    RBX2: float = 0.0
    RCX1: float = 0.0
    REX1: float = 0.0
    REX2: float = 0.0
    RHX1: float = 0.0
    # F_y, pure
    PDY2: float = 0.0
    PDY3: float = 0.0
    PEY1: float = 0.0
    PEY2: float = 0.0
    PEY3: float = 0.0
    PEY4: float = 0.0
    PKY3: float = 0.0
    PHY1: float = 0.0
    PHY2: float = 0.0
    PHY3: float = 0.0
    PVY1: float = 0.0
    PVY2: float = 0.0
    PVY3: float = 0.0
    PVY4: float = 0.0
    # F_y, weight by κ and force due to κ
    RBY1: float = 0.0
    RBY2: float = 0.0
    RBY3: float = 0.0
    RCY1: float = 0.0
    REY1: float = 0.0
    REY2: float = 0.0
    RHY1: float = 0.0
    RHY2: float = 0.0
    RVY1: float = 0.0
    RVY2: float = 0.0
    RVY3: float = 0.0
    RVY4: float = 0.0
    RVY5: float = 0.0
    RVY6: float = 0.0
    # relaxation: length of F_y over radius and load; radius [m]
    PTY1: float = 0.0
    PTY2: float = 0.0
    UNLOADED_RADIUS: float = 0.0
    # scaling factors: load, shape, friction, curvature, stiffness, shifts, camber, interaction
    LFZO: float = 1.0
    LCX: float = 1.0
    LMUX: float = 1.0
    LEX: float = 1.0
    LKX: float = 1.0
    LHX: float = 1.0
    LVX: float = 1.0
    LGAX: float = 1.0
    LCY: float = 1.0
    LMUY: float = 1.0
    LEY: float = 1.0
    LKY: float = 1.0
    LHY: float = 1.0
    LVY: float = 1.0
    LGAY: float = 1.0
    LKYG: float = 1.0  # camber force; Adams writes it LKYG or LKG, MF-Tyre 5.2 has none
    LXAL: float = 1.0
    LYKA: float = 1.0
    LVYKA: float = 1.0
    LSGAL: float = 1.0

    def __post_init__(self) -> None:
        for field in fields(self):
            if not math.isfinite(getattr(self, field.name)):
                raise ValueError(f"{field.name} must be finite, it is {getattr(self, field.name)}")
            most = _MOST.get(field.name, _LARGEST)
            require_within(ValueError, -most, most, **{field.name: getattr(self, field.name)})
        for name in (*_POSITIVE, "PCX1", "PCY1", *_POSITIVE_SCALES):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} must be positive, it is {getattr(self, name):g}")
        if not self.PKY1 < 0.0:
            raise ValueError(
                f"PKY1 must be negative, it is {self.PKY1:g}: the axes of the file are not ISO "
                "(F_y falls as the ISO slip angle grows)"
            )

    def load_increment(self, F_z: Expression) -> Expression:
        """df_z = (F_z - F_z0)/F_z0 with F_z0 = LFZO FNOMIN [-], (4.E2).   F_z : wheel load [N]."""
        F_z0 = self.FNOMIN * self.LFZO
        return (F_z - F_z0) / F_z0

    def mirrored(self) -> Self:
        """The same tire on the other side of the car: conicity and ply-steer change sign."""
        return replace(self, **{name: -getattr(self, name) for name in _ASYMMETRIC})

    def symmetric(self) -> Self:
        """The same tire without conicity and ply-steer."""
        return replace(self, **dict.fromkeys(_ASYMMETRIC, 0.0))
