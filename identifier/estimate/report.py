"""What a fit tells of itself: rows of a report, notes on its drives, and its file."""

import math
from functools import lru_cache
from typing import Any

import numpy as np

from codegen.arrays import Array
from identifier.estimate.latent import TRUST
from identifier.estimate.posterior import Reach, Segment
from identifier.estimate.priors import Priors
from identifier.frozen import FORMAT, vehicle_from, vehicle_numbers
from identifier.measured import with_doubt
from identifier.motion.parameters import INDEX, NAMES, UNITS, curve_index
from identifier.tire_model import AXLES, GRIP, RELAXATION, STIFFNESS, Axle, Estimate, Reached
from models.schema import Table
from models.vehicle import Vehicle

WIDEST = 0.6  # rad, within which the largest force is looked for
_DECIDED = 0.5  # standard deviation over the prior's, up to which drives decided a number
_SLOPE_STEP = 1e-4  # rad, over which a slope is taken
_WIDE, _WIDENED = 0.2, 1.5  # sd of a stiffness, of it, that a free ratio leaves; over the plain one
_SURELY = 3.0  # standard deviations of an error of the steering that is noted
_NOTED_GAIN = 0.08  # least error of the steering that is noted [-]
_NOTED_PLAY = 0.25  # [deg] of the steering, least play that is noted
_ADDED = ("steering_play",)  # parameters that older files do not hold, 0 in them
_LAST = ("parted_rad", "a_y_late_s", "a_y_place_m", "a_y_instead")  # of a reach, where not 0
_LARGEST = 1e6  # of the numbers in a file

BOUNDED = (("ln_stiffness", "cornering stiffness"), ("ln_grip", "grip"))


def estimates(model: Any) -> tuple[Estimate, ...]:
    """Return the numbers of the axles of a `FittedModel`, and which of them the drives decided."""
    before = model.band.prior_covariance
    given = model.vehicle.bicycle[4:]
    band, loads, lag = model.band, model.vehicle.axle_loads, model.relaxation_length
    stiff, sd_C, hidden = stiffness_doubt(model)
    stiffness = model.stiffness
    C = stiffness / loads
    slip = np.linspace(0.0, WIDEST, 201)
    slip = np.column_stack([slip, slip])
    phi = model.curve_at(slip)[0]
    peak = np.take_along_axis(slip, phi.argmax(axis=0)[None], axis=0)
    top, wide = phi.max(axis=0), [sd[0] for sd in band.of_phi(peak)]
    sd_top = np.hypot(wide[0], top * band.load_doubt)

    rows: list[tuple[str, Axle, float, float, str, float | None, bool]] = []
    for i, axle in enumerate(AXLES):
        k = INDEX[f"compliance_{axle[0]}"]
        now, prior = (math.sqrt(P[k, k]) for P in (model.covariance, before))
        known = [sd[0][i] <= _DECIDED * sd[1][i] for sd in (stiff, wide)]
        rows += [
            (
                *(STIFFNESS, axle, stiffness[i], sd_C[i] * loads[i], "N/rad", given[i]),
                known[0] and not hidden[i],
            ),
            (GRIP, axle, top[i], sd_top[i], "static load", None, known[1]),
            (RELAXATION, axle, lag[i], C[i] * now, "m", None, now <= _DECIDED * prior),
        ]
    return tuple(
        Estimate(title, axle, float(value), float(sd), unit, declared, bool(known))
        for title, axle, value, sd, unit, declared, known in rows
    )


@lru_cache(maxsize=4)  # a verdict asks for it many times
def stiffness_doubt(model: Any) -> tuple[list[Array], Array, Array]:
    """Return how unsure the stiffnesses of a `FittedModel` are [static loads/rad].

    Standard deviations of the fit and of the prior, (2,) each; that with a steering ratio that may
    be wrong and with the loads, (2,); whether the drive leaves it to the ratio, (2,).
    """
    at, C = np.full((1, 2), _SLOPE_STEP), model.stiffness / model.vehicle.axle_loads
    stiff = [sd[0] / _SLOPE_STEP for sd in model.band.of_phi(at)]
    opened, held = model.band.ratio_open
    free = opened.of_phi(at)[0][0] / _SLOPE_STEP
    plain, free = (np.hypot(sd, C * model.band.load_doubt) for sd in (stiff[0], free))
    J = model.curve_at(at)[2][:, 0]
    moved = [J[i] @ held[curve_index(axle)] / _SLOPE_STEP for i, axle in enumerate("fr")]
    return stiff, np.hypot(free, moved), (free > _WIDE * C) & (free > _WIDENED * plain)


def of_ratio(model: Any) -> tuple[tuple[str, str], ...]:
    """Return the note on stiffnesses that a wrong steering ratio would change."""
    _, sd, hidden = stiffness_doubt(model)
    shares = 100.0 * sd * model.vehicle.axle_loads / model.stiffness
    return tuple(
        (
            "steering_ratio",
            f"the {axle} cornering stiffness is not known: it rests on the given steering ratio "
            f"(± {share:.0f} % without it): measure the ratio, or drive a harder slalom",
        )
        for axle, share, one in zip(AXLES, shares, hidden, strict=True)
        if one
    )


def notes(reach: Reach, p: Array, covariance: Array) -> tuple[tuple[str, str], ...]:
    """Return what the identification drives had beside tires: code and one line of each.
    p, covariance : parameters and their covariance (p,), (p, p).
    """
    listed = [
        (
            "another_road",
            f"from {one.begin:.4g} to {one.end:.4g} s the friction was {one.ratio:.2f} ± "
            f"{one.sd:.2f} times that of the rest of the drive, for which the curves are given",
        )
        for one in reach.segments
    ]
    k = INDEX["steering_gain"]
    factor, sd = 1.0 + float(p[k]), float(np.sqrt(covariance[k, k]))
    if abs(factor - 1.0) > max(_SURELY * sd, _NOTED_GAIN):
        listed.append(
            (
                "steering_gain",
                f"the steering angle reads {with_doubt(1.0 / factor, sd / factor**2)} times the "
                "right value (± with the tires estimated): check the steering ratio, or multiply "
                f"delta_f by {factor:.3g}; the curves allow for it",
            )
        )
    k = INDEX["steering_play"]
    play, sd = np.degrees([p[k], np.sqrt(covariance[k, k])])
    if play > max(_SURELY * sd, _NOTED_PLAY):
        listed.append(
            (
                "steering_play",
                f"the steering has {play:.1f} ± {sd:.1f} deg of play to each side: the curves are "
                "those of the tires without it, forces allow for it",
            )
        )
    late, place = (one or reach.a_y_instead for one in (reach.a_y_late, reach.a_y_place))
    when = "late" if late > 0.0 else "early"
    delay = f"a_y is {1e3 * abs(late):.0f} ms {when} against the yaw rate"
    side = "behind" if place < 0.0 else "ahead of"
    arm = f"measured {abs(place):.2g} m {side} the center of gravity"
    if reach.a_y_instead:
        text = f"{delay}, or {arm}: this drive cannot tell; measure the place, or log v_y"
        listed.append(("a_y_place", text))
    elif reach.a_y_place:
        listed.append(("a_y_place", f"a_y is {arm}: the estimate allows for it"))
    if reach.a_y_late > 0.0 and not reach.a_y_instead:
        listed.append(
            (
                "a_y_late",
                f"{delay}, as behind a filter: it is read so much earlier; log it without the "
                "filter",
            )
        )
    if reach.a_y_late < 0.0:
        listed.append(
            (
                "a_y_early",
                f"an a_y that is {-1e3 * reach.a_y_late:.0f} ms earlier would explain the drive "
                "better, which no filter makes it: side slip and tires are doubtful; log v_y, or "
                "check steering and yaw rate for a delay",
            )
        )
    if reach.parted > TRUST.parted:
        listed.append(
            (
                "not_observable",
                "side slip is not observable without v_y: soft and stiff tires explain the "
                f"drive alike, {np.degrees(reach.parted):.2g} deg apart; the stiffness of the "
                "rear axle decides it",
            )
        )
    return tuple(listed)


def at_bounds(vehicle: Vehicle, p: Array) -> tuple[Reached, ...]:
    """Return the numbers of the tires that rest at the bounds of what tires have."""
    priors, listed = Priors.of(vehicle), []
    for i, axle in enumerate(AXLES):
        for name, title in BOUNDED:
            k = INDEX[f"{name}_{'fr'[i]}"]
            if priors.low[k] + 1e-6 < p[k] < priors.high[k] - 1e-6:
                continue
            listed.append(
                Reached(
                    axle,
                    title,
                    float(np.exp(p[k])),
                    "static loads" if name == "ln_grip" else "static loads per rad",
                    "beyond what tires have: check signs, units and the vehicle file",
                    True,
                )
            )
    return tuple(listed)


def to_dict(model: Any) -> dict[str, Any]:
    """Return a `FittedModel` as plain numbers and words, ready for JSON."""
    reach, error, variances = model.reach, model.model_error, np.diag(model.covariance)
    return {
        "format": FORMAT,
        "kind": model.kind,
        "vehicle": vehicle_numbers(model.vehicle.without_chassis()),
        "parameters": {
            name: {"value": float(value), "unit": unit, "sd": math.sqrt(max(variance, 0.0))}
            for (name, unit), value, variance in zip(UNITS.items(), model.p, variances, strict=True)
        },
        "covariance": model.covariance.tolist(),
        "driven_slip_rad": reach.slip.tolist(),
        "speeds_m_s": reach.speeds.tolist(),
        "a_x_m_s2": reach.a_x.tolist(),
        "unexplained": reach.unexplained.tolist(),
        **({} if error is None else {"force_missed": error.tolist()}),
        "segments": [one._asdict() for one in reach.segments],
        **{key: value for key, value in zip(_LAST, reach[-len(_LAST) :], strict=True) if value},
        "cornering_stiffness_N_rad": model.stiffness.tolist(),
        "relaxation_length_m": model.relaxation_length.tolist(),
        "known_slip_rad": model.known_slip.tolist(),
    }


def read(table: Table) -> dict[str, Any]:
    """Return the fields of the `FittedModel` that `to_dict` made."""
    parameters = table.table("parameters")

    def array(key: str, shape: tuple[int, ...] = (2,)) -> Array:
        value = table.array(key)
        if value.shape != shape:
            table.refuse(key, f"must hold {shape} numbers, it has {value.shape}")
        if np.abs(value).max(initial=0.0) > _LARGEST:
            table.refuse(key, f"must hold numbers below {_LARGEST:g}")
        return value

    last = (table.number(key) if key in table else 0.0 for key in _LAST)
    segments = table.tables("segments") if "segments" in table else []
    held = [k for k, name in enumerate(NAMES) if name in parameters or name not in _ADDED]
    p, covariance = np.zeros(len(NAMES)), np.zeros((len(NAMES), len(NAMES)))
    p[held] = [parameters.table(NAMES[k]).number("value") for k in held]
    covariance[np.ix_(held, held)] = array("covariance", (len(held), len(held)))
    return {
        "vehicle": vehicle_from(table.value("vehicle")),
        "p": p,
        "covariance": covariance,
        "reach": Reach(
            array("driven_slip_rad"),
            array("speeds_m_s"),
            array("a_x_m_s2"),
            array("unexplained") ** 2,
            1.0,
            tuple(Segment(*(one.number(name) for name in Segment._fields)) for one in segments),
            *last,
        ),
        "model_error": array("force_missed") if "force_missed" in table else None,
    }
