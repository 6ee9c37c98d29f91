"""From a tire property file to the Magic Formula 5.2: that model, complete, and possible."""

import re
from dataclasses import dataclass, fields, replace
from math import inf
from os import PathLike
from typing import Literal, NamedTuple

from models.tires.magic_formula_coefficients import ESSENTIAL, Coefficients
from models.tires.tir import TirFile, read_tir

FITTYPS = (5, 6, 21, 51, 52)  # MF-Tyre up to 5.2 under its several numbers; 60 and above is 6.x
FORMATS = ("PAC2002", "MF52", "MFTYRE", "MFTYRE52", "DELFTTYRE", "USER")
PRESSURE = ("PPX1", "PPX2", "PPX3", "PPX4", "PPY1", "PPY2", "PPY3", "PPY4")
MARKS_OF_6 = ("PKY4", "PKY6", "PPY5", "RBX3", "RBY4", "NOMPRES")


@dataclass(frozen=True, slots=True, kw_only=True)
class ValidRange:
    """What the tire was measured for, as (least, greatest); infinite where the file does not say.

    Parameters
    ----------
    alpha : slip angle, paper's sign [rad]; the file has the ISO sign, so its limits change places.
    kappa : longitudinal slip [-].
    gamma : camber [rad].
    F_z : wheel load [N].
    """

    alpha: tuple[float, float]
    kappa: tuple[float, float]
    gamma: tuple[float, float]
    F_z: tuple[float, float]

    def covers(self, alpha: float, kappa: float, gamma: float, F_z: float) -> bool:
        """Whether the formula interpolates there.

        Parameters
        ----------
        alpha : slip angle, paper's sign [rad].
        kappa : longitudinal slip [-].
        gamma : camber [rad].
        F_z : wheel load [N].
        """
        limits = (self.alpha, self.kappa, self.gamma, self.F_z)
        values = (alpha, kappa, gamma, F_z)
        return all(low <= x <= high for (low, high), x in zip(limits, values, strict=True))


class MagicFormulaFile(NamedTuple):
    """What a file tells about its tire.

    Attributes
    ----------
    coefficients : of the force equations, at the inflation pressure of the file.
    side : of the car the file is valid for.
    valid_range : of the measurement.
    name : file name without extension.
    """

    coefficients: Coefficients
    side: Literal["left", "right"]
    valid_range: ValidRange
    name: str


def read_magic_formula(path: str | PathLike[str]) -> MagicFormulaFile:
    """Read a PAC2002 or MF-Tyre 5.2 property file.

    Parameters
    ----------
    path : the `.tir` file.

    Raises
    ------
    TirError
        Another model, missing essential coefficients (all are named), or an impossible value.
    OSError
        The file cannot be read.
    """
    tir = read_tir(path)
    _require_mf52(tir)
    c = _inflated(_coefficients(tir), tir)
    side = tir.text("TYRESIDE", "LEFT").upper()
    if side not in ("LEFT", "RIGHT", "SYMMETRIC", "UNKNOWN"):
        raise tir.error(f"TYRESIDE must be LEFT, RIGHT or SYMMETRIC, it is {side!r}")
    if side == "SYMMETRIC":
        c = c.symmetric()
    return MagicFormulaFile(
        c, "right" if side == "RIGHT" else "left", _valid_range(tir), tir.path.stem
    )


def _require_mf52(tir: TirFile) -> None:
    """Refuse other models, whose coefficients have the same names and another meaning."""
    fittyp = tir.number("FITTYP")
    model = tir.text("PROPERTY_FILE_FORMAT", "")
    if fittyp is not None and fittyp not in FITTYPS:
        what = "Magic Formula 6.x" if fittyp >= 60 else "an unknown model"
        raise tir.error(
            f"FITTYP = {fittyp:g} is {what}; its equations differ, only MF 5.2 and PAC2002 are read"
        )
    plain = re.sub(r"[^A-Z0-9]", "", model.upper())
    if model and plain not in FORMATS:
        raise tir.error(
            f"PROPERTY_FILE_FORMAT = {model!r} is another tire model; only PAC2002 and MF 5.2 "
            "(MF-TYRE or USER with FITTYP 6, 21 or 52) are read"
        )
    marks = [key for key in MARKS_OF_6 if key in tir]
    if fittyp is None and plain != "PAC2002" and marks:
        raise tir.error(f"{', '.join(marks)} belong to Magic Formula 6.x, only MF 5.2 is read")


def _coefficients(tir: TirFile) -> Coefficients:
    values: dict[str, float] = {}
    for name in (field.name for field in fields(Coefficients)):
        value = tir.number(name)
        if name == "LKYG" and value is None:
            value = tir.number("LKG")
        if value is not None:
            values[name] = value
    if missing := [name for name in ESSENTIAL if name not in values]:
        raise tir.error(f"lacks {', '.join(missing)}, without which there is no Magic Formula 5.2")
    try:
        return Coefficients(**values)
    except ValueError as error:
        raise tir.error(str(error)) from None


def _inflated(c: Coefficients, tir: TirFile) -> Coefficients:
    """PAC2002's effect of inflation pressure, a constant of the file: scales eight coefficients."""
    p, p_0 = tir.number("IP"), tir.number("IP_NOM")
    if p is None or p_0 is None:
        return c
    if not (p > 0.0 and p_0 > 0.0):
        raise tir.error(f"IP and IP_NOM must be positive, they are {p:g} and {p_0:g}")
    scale = tir.number("LIP")
    dp = ((1.0 if scale is None else scale) * p - p_0) / p_0
    PPX1, PPX2, PPX3, PPX4, PPY1, PPY2, PPY3, PPY4 = (tir.number(name) or 0.0 for name in PRESSURE)
    K_x = 1.0 + PPX1 * dp + PPX2 * dp**2
    mu_x = 1.0 + PPX3 * dp + PPX4 * dp**2
    mu_y = 1.0 + PPY3 * dp + PPY4 * dp**2
    try:
        return replace(
            c,
            PKX1=c.PKX1 * K_x, PKX2=c.PKX2 * K_x,
            PDX1=c.PDX1 * mu_x, PDX2=c.PDX2 * mu_x,
            PDY1=c.PDY1 * mu_y, PDY2=c.PDY2 * mu_y,
            PKY1=c.PKY1 * (1.0 + PPY1 * dp), PKY2=c.PKY2 * (1.0 + PPY2 * dp),
        )  # fmt: skip
    except ValueError as error:
        raise tir.error(f"at its inflation pressure {error}") from None


def _valid_range(tir: TirFile) -> ValidRange:
    alpha = _limits(tir, "ALPMIN", "ALPMAX")
    return ValidRange(
        alpha=(-alpha[1], -alpha[0]),
        kappa=_limits(tir, "KPUMIN", "KPUMAX"),
        gamma=_limits(tir, "CAMMIN", "CAMMAX"),
        F_z=_limits(tir, "FZMIN", "FZMAX"),
    )


def _limits(tir: TirFile, least: str, greatest: str) -> tuple[float, float]:
    low, high = tir.number(least), tir.number(greatest)
    low, high = -inf if low is None else low, inf if high is None else high
    if not low < high:
        raise tir.error(f"{least} must be below {greatest}, they are {low:g} and {high:g}")
    return low, high
