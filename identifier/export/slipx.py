"""A car folder for the simulator slipx 0.2.0: tires by values and standard deviations.

Its schema describes cars of 1:10 in SI units and ISO 8855 axes. A tire is of a compound and a
surface; front and rear have names of their own here. Values that no drive shows are typical of the
class, and the notes of `provenance.yaml` list them; c_kappa is left out, so that the loader refuses
its double-track tier by name, as it does for any number that nobody identified.
"""

import json
from collections.abc import Sequence
from datetime import date
from typing import Any

import numpy as np

from codegen.escape import visible
from identifier.export.tir import magic_curve
from identifier.tire_model import AXLES, RELAXATION, Axle, TireModel

SCHEMA = "0.2.0"
DRAWN = 200  # models, for standard deviations
TYPICAL = {  # of the class, where the car does not say it
    "track": 0.24,  # m
    "cg_height": 0.06,  # m
    "wheel_radius": 0.05,  # m
    "width": 0.30,  # m
    "roll_resist": 0.015,
    "max_angle": 0.4,  # rad
    "accel_max": 8.0,  # m/s²
    "decel_max": 12.0,  # m/s²
    "v_max": 20.0,  # m/s
}
LENGTHS, WIDEST = (0.454, 0.654), 0.341  # m, of the class
OVERHANG = 1.7  # length over wheelbase
LARGEST = {"mass": 15.0, "yaw_inertia": 5.0, "l_f": 0.6, "l_r": 0.6, "wheelbase": LENGTHS[1]}
GUESSED = (
    "ixx, iyy, length, width, wheel_radius, differential, roll_resist, compound, all of limits.yaml"
    " and mu_x0, which repeats mu_y0; k_mu is 0, as forces go with load in the model"
)


def slipx_files(model: TireModel, rng: np.random.Generator, today: date) -> dict[str, str]:
    """Return the files of the folder by path.

    Raises
    ------
    ValueError
        Where the car is none of the class, or the model cannot tell how sure it is.
    """
    car = model.vehicle
    for name, largest in LARGEST.items():
        value = float(getattr(car, name))
        if value > largest or (name == "mass" and value <= 0.5):
            raise ValueError(
                f"slipx describes cars of 1:10, {name} within {0.5 if name == 'mass' else 0:g} and "
                f"{largest:g}: that of {car.name!r} is {value:.4g}"
            )
    drawn = model.samples(DRAWN, rng)
    guessed, chassis = [GUESSED], car.chassis
    tracks = [TYPICAL["track"]] * 2
    if chassis is None:
        guessed.append("tracks")
    else:
        tracks = [min(one, WIDEST) for one in (chassis.track_front, chassis.track_rear)]
    height, front = car.lengthwise("cg_height"), car.lengthwise("drive_front_share")
    if height is None:
        height = TYPICAL["cg_height"]
        guessed.append("h_cog")
    if front is None:
        guessed.append("layout")
    layout = "4WD" if front is None else {0.0: "2WD_rear", 1.0: "2WD_front"}.get(front, "4WD")
    origin = {
        "schema_version": SCHEMA,
        "label": "provisional",
        "source": f"Driving log of {visible(car.name)}.",
        "method": "Batch estimate of tire curves from a log by tireid.",
        "date": today.isoformat(),
    }
    notes = f"Not identified, typical of the class: {', '.join(guessed)}."
    documents: dict[str, dict[str, Any]] = {
        "car.yaml": {
            "schema_version": SCHEMA,
            "name": "tireid_car",
            "description": visible(car.name)[:1000],
            "dynamics": "dynamics.yaml",
            "limits": "limits.yaml",
            "provenance": "provenance.yaml",
        },
        "dynamics.yaml": {
            "schema_version": SCHEMA,
            "mass": car.mass,
            "inertia": {
                "ixx": 0.5 * car.yaw_inertia,
                "iyy": 0.9 * car.yaw_inertia,
                "izz": car.yaw_inertia,
            },
            "geometry": {
                "lf": car.l_f,
                "lr": car.l_r,
                "track_front": tracks[0],
                "track_rear": tracks[1],
                "h_cog": height,
                "wheel_radius": TYPICAL["wheel_radius"],
                "length": min(max(OVERHANG * car.wheelbase, LENGTHS[0]), LENGTHS[1]),
                "width": max(TYPICAL["width"], *tracks),
            },
            "tyres": {axle: _name(axle) for axle in AXLES},
            "drivetrain": {"layout": layout, "differential": "open"},
            "resistance": {
                "drag_coeff": car.drag * car.mass,
                "roll_resist": TYPICAL["roll_resist"],
            },
        },
        "limits.yaml": {
            "schema_version": SCHEMA,
            "steering": {"max_angle": TYPICAL["max_angle"]},
            "drivetrain": {name: TYPICAL[name] for name in ("accel_max", "decel_max", "v_max")},
        },
        "provenance.yaml": origin | {"notes": notes},
    }
    for axle in AXLES:
        values, residuals = _tire(model, axle, drawn)
        documents[f"tyres/rubber_{_name(axle)['surface']}.yaml"] = {
            "schema_version": SCHEMA,
            **_name(axle),
            **values,
            "provenance": origin | {"residuals": residuals, "notes": notes},
        }
    return {path: "\n".join(_yaml(one)) + "\n" for path, one in documents.items()}


def _name(axle: Axle) -> dict[str, str]:
    return {"compound": "rubber", "surface": f"as-driven-{axle}"}


def _tire(
    model: TireModel, axle: Axle, drawn: Sequence[TireModel]
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the blocks of a tire, and value and standard deviation of each number in them."""
    load = 0.5 * model.vehicle.axle_loads[AXLES.index(axle)]
    found = magic_curve(model, axle, drawn)
    scale = (load, 1.0, 1.0, 1.0)  # of one tire: N/rad, and frictions
    names = ("linear.c_alpha", "friction.mu_y0", "mf_lite.C", "mf_lite.E")
    units = ("N/rad", "-", "-", "-")
    residuals: dict[str, dict[str, Any]] = {
        name: {"value": float(k * value), "stddev": float(k * sd), "unit": unit}
        for name, unit, k, value, sd in zip(
            names, units, scale, found.numbers, found.sd, strict=True
        )
    }
    for one in model.estimates():
        if one.title == RELAXATION and one.axle == axle and one.sd is not None:
            residuals["relaxation.sigma"] = {"value": one.value, "stddev": one.sd, "unit": "m"}
    blocks: dict[str, Any] = {"nominal_load": load}
    for name, one in residuals.items():
        block, _, key = name.partition(".")
        blocks.setdefault(block, {})[key] = one["value"]
    blocks["friction"] |= {"mu_x0": blocks["friction"]["mu_y0"], "k_mu": 0.0}
    return blocks, residuals


def _yaml(value: dict[str, Any], indent: str = "") -> list[str]:
    """Return the lines of a mapping; a float has a point, or YAML 1.1 takes 1e-05 for a word."""
    lines = []
    for key, one in value.items():
        if isinstance(one, dict):
            lines += [f"{indent}{key}:", *_yaml(one, f"{indent}  ")]
        elif isinstance(one, str):
            lines.append(f"{indent}{key}: {json.dumps(one)}")
        else:
            text = f"{one:.9g}"
            lines.append(f"{indent}{key}: {text if '.' in text else text.replace('e', '.0e')}")
    return lines
