"""The curve of an axle as the nearest Magic Formula, and as a tire property file (PAC2002).

In static axle loads: φ(α) = μ sin(C atan(B α - E (B α - atan B α))), B = K/(C μ). Two tires share
the load of an axle and its force, so that the numbers are those of one tire over its own load.
Numbers of equations: Pacejka, Tire and Vehicle Dynamics (2012), 4.3.2.
"""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from codegen.arrays import Array
from codegen.escape import visible
from identifier.tire_model import AXLES, Axle, TireModel
from models.tires.magic_formula_coefficients import Coefficients

WIDEST, BEYOND = 0.6, 0.02  # slip up to which curves are compared [rad]; weight past what is known
LEAST_REACH = 0.032  # rad, up to which a curve is followed of which less is known
LOW, HIGH = (0.0, -4.0, 1.0001, -5.0), (6.0, 2.0, 2.4, 0.95)  # of ln K, ln μ, C, E
WORST = 10  # power of the errors that are summed at last: near to the largest one
MOST_MISSED = 0.05  # of the peak: past that a curve is no Magic Formula
PROPORTIONAL = 100.0  # PKY2: stiffness goes with load, within 0.1 % up to twice the nominal one
LOADS = (0.2, 2.0)  # over the nominal one, of the range in the file
NAMES = ("K", "mu", "C", "E")


class MagicCurve(NamedTuple):
    """The Magic Formula nearest to the curve of an axle.

    numbers : K [1/rad], μ, C, E (4,), forces in axle loads.   sd : of them (4,), zero where nobody
    drew.   reach : slip up to which it follows the curve [rad].   missed : its largest error up to
    there over the largest force there [-].
    """

    numbers: Array
    sd: Array
    reach: float
    missed: float


def magic_curve(model: TireModel, axle: Axle, drawn: Sequence[TireModel] = ()) -> MagicCurve:
    """Return the Magic Formula nearest to the curve of an axle.

    Errors are least squares at first, then their tenth power: near to the least largest one.

    Parameters
    ----------
    drawn : models whose spread is the doubt, by one linear step each.

    Raises
    ------
    ValueError
        Where it misses more than `MOST_MISSED` of the largest force.
    """
    i = AXLES.index(axle)
    limits = model.known_slip
    reach = max(LEAST_REACH, float(limits[i])) if limits is not None else 0.1
    slip = np.concatenate(
        [np.linspace(0.0, reach, 60)[1:], np.linspace(reach, max(WIDEST, 1.5 * reach), 60)]
    )
    weight = np.where(slip <= reach, 1.0, BEYOND)
    load = model.vehicle.axle_loads[i]
    both = np.concatenate([slip, -slip])

    def curve(one: TireModel) -> Array:
        force = one.force_at(both)[:, i] / load
        found: Array = 0.5 * (force[: slip.size] - force[slip.size :])
        return found

    phi = curve(model)
    peak = float(np.abs(phi[slip <= reach]).max())

    def errors(z: Array, power: float = 1.0, size: float = 1.0) -> Array:
        e = weight * (formula(slip, z) - phi) / (size * peak)
        signed: Array = np.sign(e) * np.abs(e) ** power
        return signed

    stiff = max(phi[0] / slip[0], 1.1)
    begins = [(math.log(stiff), math.log(max(phi.max(), 0.05)), 1.35, E) for E in (0.0, -1.5)]
    squares = [_solved(errors, begin) for begin in begins]
    best = min(squares, key=lambda z: float(np.sum(errors(z) ** 2)))
    z = _solved(errors, best, WORST / 2, max(float(np.abs(errors(best)).max()), 1e-9))
    J = np.column_stack(
        [(formula(slip, z + h) - formula(slip, z - h)) / 2e-5 for h in 1e-5 * np.eye(4)]
    )
    step = np.linalg.pinv(weight[:, None] * J, rcond=1e-6) * weight
    moved = np.array([step @ (curve(one) - phi) for one in drawn]).reshape(-1, 4)
    sd = np.std(moved, axis=0) if len(moved) else np.zeros(4)
    numbers, sd = np.array([*np.exp(z[:2]), *z[2:]]), sd * np.array([*np.exp(z[:2]), 1.0, 1.0])
    both_sides = model.force_at(both)[:, i] / load
    off = np.abs(both_sides - np.concatenate([formula(slip, z), -formula(slip, z)]))
    missed = float(off[np.abs(both) <= reach].max()) / peak
    if not missed <= MOST_MISSED:
        raise ValueError(
            f"the curve of the {axle} axle is no Magic Formula: the nearest one misses "
            f"{100.0 * missed:.2g} % of its peak ({100.0 * MOST_MISSED:g} % are allowed)"
        )
    return MagicCurve(numbers, sd, reach, missed)


def formula(slip: Array, z: Array) -> Array:
    """Return φ of the Magic Formula at slips (k,).

    z : ln K, ln μ, C, E (4,).
    """
    K, mu, C, E = math.exp(z[0]), math.exp(z[1]), z[2], z[3]
    Bx = K / (C * mu) * slip
    phi: Array = mu * np.sin(C * np.arctan(Bx - E * (Bx - np.arctan(Bx))))
    return phi


def _solved(errors: Callable[..., Array], begin: Sequence[float] | Array, *of: float) -> Array:
    inside = np.clip(begin, np.array(LOW) + 1e-6, np.array(HIGH) - 1e-6)
    found: Array = least_squares(
        errors, inside, bounds=(LOW, HIGH), x_scale=(0.1, 0.1, 0.1, 0.5), args=of
    ).x
    return found


def tire_properties(model: TireModel, axle: Axle) -> str:
    """Return the tire property file of one tire of an axle: lateral force in pure slip.

    D_y = PDY1 F_z, K_y = PKY1 F_z0 sin(2 atan(F_z/(PKY2 F_z0))) with a large PKY2: both go with
    the load, as they do in the model.

    Raises
    ------
    ValueError
        Where the curve is no Magic Formula, or no tire.
    """
    found, i = magic_curve(model, axle), AXLES.index(axle)
    K, mu, C, E = (float(one) for one in found.numbers)
    load, u = 0.5 * model.vehicle.axle_loads[i], 1.0 / PROPORTIONAL
    PKY1 = -K * (1.0 + u**2) / (2.0 * u)
    c = Coefficients(
        FNOMIN=load, PCX1=C, PDX1=mu, PKX1=K, PCY1=C, PDY1=mu, PEY1=E, PKY1=PKY1, PKY2=PROPORTIONAL
    )
    slips = found.reach * np.array([0.25, 0.5, 0.75, 1.0])
    half, force = model.half_band(slips), model.force_at(slips)
    known = f"{math.degrees(found.reach):.3g} deg"
    lines = [
        f"One {axle} tire of {visible(model.vehicle.name)}, by tireid from a driving log.",
        "Is: lateral force in pure slip, of an axle over its slip angle, shared by two tires. It",
        "holds the friction of the road that was driven, load transfer between left and right,",
        "toe, camber and compliance of the suspension.",
        "Is not: a measured tire. Longitudinal and combined slip, camber, aligning moment and",
        "relaxation are not in it. [LONGITUDINAL_COEFFICIENTS] repeat the lateral ones, since",
        "readers ask for them: do not use them.",
        "Load: the force goes in proportion, as in the model.",
        f"Identified up to a slip of {known}, beyond that extrapolated; differs from the model by",
        f"at most {100.0 * found.missed:.2g} % of its largest force there.",
    ]
    if half is None:
        lines.append("Band: the model cannot tell how sure it is.")
    else:
        lines.append(f"Band of 90 % around the force at a load of {load:.4g} N:")
        lines += [
            f"  {math.degrees(slip):.3g} deg  {F:.4g} +- {h:.3g} N"
            for slip, F, h in zip(slips, 0.5 * force[:, i], 0.5 * half[:, i], strict=True)
        ]
    sections: dict[str, dict[str, str | float]] = {
        "MDI_HEADER": {"FILE_TYPE": "'tir'", "FILE_FORMAT": "'ASCII'"},
        "UNITS": {
            "LENGTH": "'meter'",
            "FORCE": "'newton'",
            "ANGLE": "'radian'",
            "MASS": "'kg'",
            "TIME": "'second'",
        },
        "MODEL": {"PROPERTY_FILE_FORMAT": "'PAC2002'", "USE_MODE": 2, "TYRESIDE": "'LEFT'"},
        "VERTICAL": {"FNOMIN": load},
        "SLIP_ANGLE_RANGE": {"ALPMIN": -found.reach, "ALPMAX": found.reach},
        "VERTICAL_FORCE_RANGE": {"FZMIN": LOADS[0] * load, "FZMAX": LOADS[1] * load},
        "LONGITUDINAL_COEFFICIENTS": {name: getattr(c, name) for name in ("PCX1", "PDX1", "PKX1")},
        "LATERAL_COEFFICIENTS": {
            name: getattr(c, name) for name in ("PCY1", "PDY1", "PEY1", "PKY1", "PKY2")
        },
    }
    text = [f"$ {line}" for line in lines]
    for title, values in sections.items():
        text.append(f"[{title}]")
        for name, value in values.items():
            text.append(f"{name:20} = {value if isinstance(value, str) else f'{value:.10g}'}")
    return "\n".join(text) + "\n"
