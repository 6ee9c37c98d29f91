"""A car folder for the simulator slipx 0.2.0: tires by values and standard deviations.

Its schema describes cars of 1:10 in SI units and ISO 8855 axes. A tire is of a compound and a
surface; front and rear have surfaces of their own here. What no drive shows is typical of the
class, and `provenance.yaml` lists it; c_kappa is left out, so that the loader refuses its
double-track tier by name. In YAML 1.1 1e-05 is a word: numbers are written without an exponent.
"""

import json
from collections.abc import Sequence
from datetime import date
from textwrap import indent

import numpy as np

from codegen.escape import visible
from identifier.export.tir import magic_curve
from identifier.tire_model import AXLES, RELAXATION, Axle, TireModel, require_band

HEAD = 'schema_version: "0.2.0"\n'
DRAWN = 100  # models, for standard deviations
SIZES = {"mass": (0.5, 15.0), "yaw_inertia": (0.0, 5.0), "wheelbase": (0.0, 0.6)}  # SI
GUESSED = (
    "ixx, iyy, length, width, tracks, wheel_radius, differential, roll_resist, compound, mu_x0 (as "
    "mu_y0), k_mu (force goes with load), limits.yaml; unless the car file has them, h_cog, layout"
)


def slipx_files(model: TireModel, rng: np.random.Generator, today: date) -> dict[str, str]:
    """Return the files of the folder by path, of a car of the class and a model with a doubt."""
    car = model.vehicle
    for key, (low, high) in SIZES.items():
        if not low < (value := float(getattr(car, key))) <= high:
            rule = f"{key} within {low:g} and {high:g}"
            raise ValueError(f"slipx describes cars of 1:10, {rule}: {car.name!r} has {value:.4g}")
    drawn = require_band(model).samples(DRAWN, rng)
    height, front = car.lengthwise("cg_height"), car.lengthwise("drive_front_share")
    layout = "4WD" if front is None else {0.0: "2WD_rear", 1.0: "2WD_front"}.get(front, "4WD")
    origin = f"""\
label: provisional
source: "a driving log"
method: "Batch estimate of tire curves by tireid; standard deviations by models drawn from it."
date: "{today.isoformat()}"
notes: "Not identified, typical of the class: {GUESSED}."
"""
    files = {
        "car.yaml": f"{HEAD}name: tireid_car\ndescription: {json.dumps(visible(car.name))}\n"
        "dynamics: dynamics.yaml\nlimits: limits.yaml\nprovenance: provenance.yaml\n",
        "provenance.yaml": HEAD + origin,
        "limits.yaml": f"{HEAD}steering: {{max_angle: 0.4}}\n"
        "drivetrain: {accel_max: 8.0, decel_max: 12.0, v_max: 20.0}\n",
        "dynamics.yaml": f"""{HEAD}\
mass: {car.mass:.9f}
inertia:
  ixx: {0.5 * car.yaw_inertia:.9f}
  iyy: {0.9 * car.yaw_inertia:.9f}
  izz: {car.yaw_inertia:.9f}
geometry:
  lf: {car.l_f:.9f}
  lr: {car.l_r:.9f}
  track_front: 0.24
  track_rear: 0.24
  h_cog: {0.06 if height is None else height:.9f}
  wheel_radius: 0.05
  length: {min(max(1.7 * car.wheelbase, 0.454), 0.654):.9f}
  width: 0.3
tyres:
  front: {{compound: rubber, surface: as-driven-front}}
  rear: {{compound: rubber, surface: as-driven-rear}}
drivetrain: {{layout: {layout}, differential: open}}
resistance:
  drag_coeff: {car.drag * car.mass:.9f}
  roll_resist: 0.015
""",
    }
    for axle in AXLES:
        files[f"tyres/rubber_as-driven-{axle}.yaml"] = _tire(model, axle, drawn, origin)
    return files


def _tire(model: TireModel, axle: Axle, drawn: Sequence[TireModel], origin: str) -> str:
    load = 0.5 * model.vehicle.axle_loads[AXLES.index(axle)]
    found = magic_curve(model, axle, drawn)
    names = ("linear.c_alpha", "friction.mu_y0", "mf_lite.C", "mf_lite.E")
    units, scale = ("N/rad", "-", "-", "-"), np.array([load, 1.0, 1.0, 1.0])
    stiff, mu, C, E = scale * found.numbers
    rows = list(zip(names, scale * found.numbers, scale * found.sd, units, strict=True))
    relaxation = ""
    for one in model.estimates():
        if one.title == RELAXATION and one.axle == axle and one.sd is not None:
            relaxation = f"relaxation: {{sigma: {one.value:.9f}}}\n"
            rows.append(("relaxation.sigma", one.value, one.sd, "m"))
    residuals = "".join(
        f'    {name}: {{value: {value:.9f}, stddev: {sd:.9f}, unit: "{unit}"}}\n'
        for name, value, sd, unit in rows
    )
    return f"""{HEAD}\
compound: rubber
surface: as-driven-{axle}
# Differs from the curve of tireid by at most {100.0 * found.misfit:.2g} % of its largest force.
nominal_load: {load:.9f}
linear: {{c_alpha: {stiff:.9f}}}
friction: {{mu_y0: {mu:.9f}, mu_x0: {mu:.9f}, k_mu: 0.0}}
mf_lite: {{C: {C:.9f}, E: {E:.9f}}}
{relaxation}provenance:
{indent(HEAD + origin, "  ")}  residuals:
{residuals}"""
