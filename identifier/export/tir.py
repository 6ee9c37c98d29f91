"""The curve of an axle as the nearest Magic Formula, and as a tire property file (PAC2002).

In axle loads: φ(α) = μ sin(C atan(B α - E (B α - atan B α))), B = K/(C μ). Two tires share the
load and the force of an axle, so that these are the numbers of one tire over its own load too.
Numbers of equations: Pacejka, Tire and Vehicle Dynamics (2012), 4.3.2.
"""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from codegen.arrays import Array
from codegen.escape import visible
from identifier.measured import as_printed, with_doubt
from identifier.tire_model import AXLES, RELAXATION, Axle, TireModel

_WIDEST = 0.6  # rad, slip up to which curves are compared
_BEYOND = 0.02  # weight of slip past what is known
_LEAST_REACH = 0.032  # rad, slip that is followed at least
_REACH = 0.1  # rad, slip that is followed where nothing is said of what is known
_LOW = (0.0, -4.0, 1.0001, -5.0)  # of ln K, ln μ, C, E, at least
_HIGH = (6.0, 2.0, 2.4, 0.95)  # of ln K, ln μ, C, E, at most
_WORST = 5.0  # power of the errors whose squares are summed at last: near to the largest one
_LARGEST_MISFIT = 0.1  # of the peak: past that a curve is no Magic Formula
_RADIUS = 0.12  # of a wheel, in wheelbases: of a sedan, and within a quarter of a car of 1:10
_PROPORTIONAL = 100.0  # PKY2: stiffness goes with load, within 0.1 % up to twice the nominal one


class _MagicCurve(NamedTuple):
    """The Magic Formula nearest to the curve of an axle.

    numbers : K [axle loads/rad], μ, C, E (4,).   sd : of them (4,).   reach : slip up to which it
    follows the curve [rad].   missed : its largest error up to there over the largest force there.
    """

    numbers: Array
    sd: Array
    reach: float
    misfit: float


def magic_curve(model: TireModel, axle: Axle, drawn: Sequence[TireModel] = ()) -> _MagicCurve:
    """Return the Magic Formula nearest to an axle's curve, within `_LARGEST_MISFIT`."""
    i, known = AXLES.index(axle), model.known_slip
    reach = _REACH if known is None else max(_LEAST_REACH, float(known[i]))
    beyond = np.linspace(reach, max(_WIDEST, 1.5 * reach), 60)
    side = np.concatenate([np.linspace(0.0, reach, 60)[1:], beyond])
    slip = np.concatenate([side, -side])
    inside = np.abs(slip) <= reach
    weight, load = np.where(inside, 1.0, _BEYOND), model.vehicle.axle_loads[i]
    phi = model.force(slip)[:, i] / load
    peak = float(np.abs(phi[inside]).max())

    def errors(z: Array, power: float = 1.0, size: float = 1.0) -> Array:
        e = weight * (formula(slip, z) - phi) / (size * peak)
        return np.sign(e) * np.abs(e) ** power

    stiff, most = math.log(max(phi[0] / slip[0], 1.1)), math.log(max(float(phi.max()), 0.05))
    squares = [_solved(errors, (stiff, most, 1.35, E)) for E in (0.0, -1.5)]
    best = min(squares, key=lambda z: float(np.sum(errors(z) ** 2)))
    z = _solved(errors, best, _WORST, max(float(np.abs(errors(best)).max()), 1e-9))
    misfit = float(np.abs(errors(z))[inside].max())
    if not misfit <= _LARGEST_MISFIT:
        raise ValueError(
            f"the curve of the {axle} axle is no Magic Formula: the nearest one is off by "
            f"{100.0 * misfit:.2g} % of its peak ({100.0 * _LARGEST_MISFIT:g} % are allowed)"
        )
    moved = [formula(slip, z + h) - formula(slip, z - h) for h in 1e-5 * np.eye(4)]
    step = np.linalg.pinv(weight[:, None] * np.column_stack(moved) / 2e-5, rcond=1e-6) * weight
    steps = [step @ (one.force(slip)[:, i] / load - phi) for one in drawn]
    scale = np.array([*np.exp(z[:2]), 1.0, 1.0])
    sd = scale * np.std(steps, axis=0) if steps else np.zeros(4)
    return _MagicCurve(np.array([*scale[:2], *z[2:]]), sd, reach, misfit)


def formula(slip: Array, z: Array) -> Array:
    """Return φ of the Magic Formula at slips (k,) [rad].   z : ln K, ln μ, C, E (4,)."""
    K, mu, C, E = math.exp(z[0]), math.exp(z[1]), z[2], z[3]
    Bx = K / (C * mu) * slip
    return mu * np.sin(C * np.arctan(Bx - E * (Bx - np.arctan(Bx))))


def _solved(errors: Callable[..., Array], begin: Sequence[float] | Array, *of: float) -> Array:
    inside = np.clip(begin, np.array(_LOW) + 1e-6, np.array(_HIGH) - 1e-6)
    scale = (0.1, 0.1, 0.1, 0.5)
    return np.array(least_squares(errors, inside, bounds=(_LOW, _HIGH), x_scale=scale, args=of).x)


def tire_properties(model: TireModel, axle: Axle, verdict: str = "") -> str:
    """Return the tire property file of one tire of an axle: lateral force in pure slip.

    verdict : what was judged of the model, and on which drive, in one line.

    D_y = PDY1 F_z (4.E22) and K_y = PKY1 F_z0 sin(2 atan(F_z/(PKY2 F_z0))) (4.E25), PKY2 being
    large, go with the load, as they do in the model. The relaxation length of PAC2002,
    σ = PTY1 sin(2 atan(F_z/(PTY2 F_z0))) R_0, is the model's at F_z0 and, PTY2 being 1, hardly
    another around it.
    """
    found, i = magic_curve(model, axle), AXLES.index(axle)
    K, mu, C, E = (float(one) for one in found.numbers)
    load, u = 0.5 * model.vehicle.axle_loads[i], 1.0 / _PROPORTIONAL
    known = found.reach if model.known_slip is None else float(model.known_slip[i])
    valid = known if known > 0.0 else found.reach
    slips = valid * np.array([0.25, 0.5, 0.75, 1.0])
    radius = _RADIUS * model.vehicle.wheelbase
    numbers = [e for e in model.estimates() if e.axle == axle]
    lag = next((e.value for e in numbers if e.title == RELAXATION), 0.0)
    error = 0.0 if model.model_error is None else float(model.model_error[i])
    lines = [f"Verdict: {visible(verdict)}."] * bool(verdict)
    for one in numbers:
        (e,) = as_printed([one.with_model_error(error)])
        state = "" if e.identified else ": not identified (default value)"
        said = f"{e.title} {with_doubt(e.value, e.sd)} {e.unit}{state}"
        lines.append(said.replace("±", "+-"))
    judged = "".join(f"$ {line}\n" for line in lines)
    force, band = model.force(slips), "the model cannot tell how sure it is"
    if model.band is not None:
        half = model.band.half(slips)
        band = ", ".join(
            f"{with_doubt(F, h)} N at {a:.3g} deg"
            for a, F, h in zip(np.degrees(slips), 0.5 * force[:, i], 0.5 * half[:, i], strict=True)
        ).replace("±", "+-")
    return f"""\
$ One {axle} tire of {visible(model.vehicle.name)}, by tireid from a driving log.
{judged}\
$ Is: lateral force in pure slip, of an axle over its slip angle, shared by two tires. In it are the
$ friction of the road that was driven, load transfer between left and right, toe and compliance.
$ Is not: a measured tire. Longitudinal and combined slip, camber and aligning moment are not in it;
$ the longitudinal coefficients repeat the lateral ones, since readers ask for them.
$ The relaxation length is PTY1 times UNLOADED_RADIUS, which is a guess.
$ Load: force is proportional to it, as in the model.
$ Identified up to a slip of {math.degrees(known):.3g} deg, beyond that extrapolated; up to
$ {math.degrees(found.reach):.3g} deg it differs from the model by at most \
{100.0 * found.misfit:.2g} % of the largest force there.
$ Band of 90 % at the nominal load: {band}.
[MDI_HEADER]
FILE_TYPE = 'tir'
FILE_FORMAT = 'ASCII'
[UNITS]
LENGTH = 'meter'
FORCE = 'newton'
ANGLE = 'radian'
MASS = 'kg'
TIME = 'second'
[MODEL]
PROPERTY_FILE_FORMAT = 'PAC2002'
USE_MODE = {12 if lag > 0.0 else 2}
TYRESIDE = 'LEFT'
[DIMENSION]
UNLOADED_RADIUS = {radius:.10g}
[VERTICAL]
FNOMIN = {load:.10g}
[SLIP_ANGLE_RANGE]
ALPMIN = {-valid:.10g}
ALPMAX = {valid:.10g}
[VERTICAL_FORCE_RANGE]
FZMIN = {0.2 * load:.10g}
FZMAX = {2.0 * load:.10g}
[LONGITUDINAL_COEFFICIENTS]
PCX1 = {C:.10g}
PDX1 = {mu:.10g}
PKX1 = {K:.10g}
[LATERAL_COEFFICIENTS]
PCY1 = {C:.10g}
PDY1 = {mu:.10g}
PEY1 = {E:.10g}
PKY1 = {-K * (1.0 + u**2) / (2.0 * u):.10g}
PKY2 = {_PROPORTIONAL:.10g}
PTY1 = {lag / radius:.10g}
PTY2 = 1
"""
