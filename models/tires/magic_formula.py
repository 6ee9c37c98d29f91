"""The Magic Formula 5.2 (PAC2002) as a tire of this package, read from a `.tir` file."""

from dataclasses import dataclass, replace
from os import PathLike
from typing import Literal, Self

from models.tires.forces import Expression, TireForces, folded, positive
from models.tires.magic_formula_coefficients import Coefficients
from models.tires.magic_formula_file import ValidRange, read_magic_formula
from models.tires.magic_formula_lateral import combined_lateral, lateral_slope
from models.tires.magic_formula_longitudinal import combined_longitudinal, longitudinal_slope


@dataclass(frozen=True, slots=True, kw_only=True)
class MagicFormula:
    """Steady-state Magic Formula 5.2 in combined slip with camber.

    Parameters
    ----------
    coefficients : force coefficients and scaling factors of the file.
    side : side of the car this tire belongs to, "left" or "right".
    valid_range : slips, camber and loads the file was measured for.
    name : where the tire comes from, for messages and tables.

    Raises
    ------
    ValueError
        The side is neither "left" nor "right".
    """

    coefficients: Coefficients
    side: Literal["left", "right"]
    valid_range: ValidRange
    name: str

    def __post_init__(self) -> None:
        _require_side(self.side)

    @classmethod
    def from_tir(cls, path: str | PathLike[str]) -> Self:
        """Read a tire property file (PAC2002 or MF-Tyre 5.2).

        Parameters
        ----------
        path : the `.tir` file.

        Raises
        ------
        TirError
            Another model, missing essential coefficients, or an impossible value.
        OSError
            The file cannot be read.
        """
        c, side, valid_range, name = read_magic_formula(path)
        return cls(coefficients=c, side=side, valid_range=valid_range, name=name)

    def forces(
        self,
        alpha: Expression,
        kappa: Expression,
        gamma: Expression,
        F_z: Expression,
        mu: Expression = 1.0,
    ) -> TireForces:
        """Longitudinal and lateral force in the wheel frame [N].

        Outside `valid_range` the formula extrapolates: finite, but nobody measured it.

        Parameters
        ----------
        alpha : slip angle, paper's sign [rad]; beyond ±π/2 the wheel rolls backwards.
        kappa : longitudinal slip [-].
        gamma : camber [rad], > 0 leans the top to the right.
        F_z : wheel load [N]; no force at F_z <= 0.
        mu : friction of the road over that of the measurement [-]; multiplies LMUX and LMUY.
        """
        c, load = self.coefficients, positive(F_z)
        alpha_iso = -folded(alpha)  # the file and its equations have the ISO sign
        return TireForces(
            combined_longitudinal(c, alpha_iso, kappa, gamma, load, mu),
            combined_lateral(c, alpha_iso, kappa, gamma, load, mu),
        )

    def slip_stiffness(self, F_z: Expression) -> Expression:
        """∂F_x/∂κ at zero slip and camber [N]; 0 in the air.

        Parameters
        ----------
        F_z : wheel load [N].
        """
        return longitudinal_slope(self.coefficients, positive(F_z))

    def cornering_stiffness(self, F_z: Expression) -> Expression:
        """∂F_y/∂α at zero slip and camber, paper's sign: positive [N/rad]; 0 in the air.

        Parameters
        ----------
        F_z : wheel load [N].
        """
        return -lateral_slope(self.coefficients, positive(F_z))

    def mirrored(self) -> Self:
        """The same tire for the other side of the car.

        Its forces are F_x(-α, κ, -γ) and -F_y(-α, κ, -γ) of this one, so that a car with one of
        each drives straight.
        """
        other: Literal["left", "right"] = "right" if self.side == "left" else "left"
        return replace(self, coefficients=self.coefficients.mirrored(), side=other)

    def mounted(self, side: Literal["left", "right"]) -> Self:
        """The tire for that side: itself where it belongs there, else mirrored.

        Parameters
        ----------
        side : "left" or "right".

        Raises
        ------
        ValueError
            The side is neither.
        """
        _require_side(side)
        return self if side == self.side else self.mirrored()


def _require_side(side: str) -> None:
    if side not in ("left", "right"):
        raise ValueError(f'side must be "left" or "right", it is {side!r}')
