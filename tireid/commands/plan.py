"""`tireid plan --vehicle car.toml`: which maneuver tells most of the tires, and its steering."""

import argparse
from collections.abc import Sequence
from typing import Any

import numpy as np

from identifier.frozen import vehicle_numbers
from identifier.plan import SHARE, TIME, PlanError, Planned, plan
from identifier.tire_model import AXLES, GRIP, RELAXATION, STIFFNESS
from models.files import digest
from tireid import __version__
from tireid.commands import options as shared
from tireid.figures.plan import plan_figure
from tireid.figures.style import save_figures
from tireid.output import text_table, write_csv, write_json
from tireid.progress import say, tell

CAUTION = (
    "The steering is open loop: nothing corrects the course, and the room is that of the likely "
    "tires. Use a closed field with room to spare, begin at a third of the amplitude, and do not "
    "go on where the car slides earlier than planned."
)
HEADER = (
    "maneuver", "m/s", "s", "room [m]", "a_y [m/s²]", "forces",
    "stiffness f/r", "grip f/r", "relaxation f/r",
)  # fmt: skip


def declare(new: Any) -> None:
    parser = new(
        description="Rank maneuvers by what one drive of each leaves: the expected error of the "
        "forces on another drive, random steering up to the same share of the grip, over their "
        "rms. Beside it stand the standard deviations of stiffness, grip and relaxation over their "
        "values. Each maneuver is steered as hard as --grip allows with the likely tires; "
        "steering.csv has the best. " + CAUTION,
    )
    shared.add_vehicle(parser, default="the sedan; with --weights that of the model")
    shared.add_weights(parser, "a fit; plan what it leaves open")
    text = "constant [m/s], one or several (2.5 and 4 times sqrt(g L))"
    parser.add_argument("--speed", metavar="V", nargs="+", type=float, help=text)
    text = "length and width of the field [m] (without limits)"
    parser.add_argument("--area", metavar=("L", "W"), nargs=2, type=float, help=text)
    numbers = {
        "--time S": (TIME, "length of a maneuver (%(default)g)"),
        "--mu MU": "friction of the road, a guess (0.85, or that of --weights)",
        "--grip PERCENT": (100.0 * SHARE, "share of the grip that is used at most (%(default)g)"),
        "--steering-ratio RATIO": "hand wheel over front wheels: adds it to steering.csv",
    }
    shared.add_options(parser, float, numbers)
    shared.add_seed(parser, "random steering")
    shared.add_output(parser, "plan")


def run(options: argparse.Namespace) -> None:
    ratio, seed = options.steering_ratio, shared.seed_of(options)
    if ratio is not None and not 1.0 <= ratio <= 100.0:
        raise ValueError(f"--steering-ratio must be 1 to 100, it is {ratio:g}")
    area = options.area
    model = shared.stored_model(options.weights)
    vehicle = shared.read_vehicle(options, model)
    numbers = {
        "speeds": options.speed, "time": options.time, "friction": options.mu,
        "share": 0.01 * options.grip, "seed": seed,
    }  # fmt: skip
    inputs = {"vehicle": vehicle_numbers(vehicle), "weights": str(options.weights), "area": area}
    inputs |= numbers
    with shared.folder_of(options) as folder:
        found = plan(vehicle, start=model, **numbers)
        listed = [_numbers(one, area) for one in found]
        fit = [one for one, known in zip(found, listed, strict=True) if known["fits"]]
        if not fit:
            raise PlanError("no maneuver fits into --area: give more room, less --time or --speed")
        best = fit[0]
        t, delta, v_x = best.log.t, best.log.delta_f, best.log.v_x
        columns = {"t_s": t, "delta_f_rad": delta, "v_x_m_s": v_x, "X_m": best.X, "Y_m": best.Y}
        if ratio is not None:
            columns["hand_wheel_deg"] = np.degrees(ratio * delta)
        write_csv(folder / "steering.csv", columns)
        facts = {"inputs": inputs, "hash": digest(inputs), "version": __version__}
        write_json(folder / "summary.json", {"maneuvers": listed, **facts})
        save_figures(folder, {"maneuver": plan_figure(best, ratio)})
    tell(
        f"{best.name} at {best.speed:.3g} m/s tells most: after one drive the expected error of "
        f"the forces on another drive is {100.0 * best.error:.1f} %.\n"
        f"{text_table([HEADER, *map(_row, listed)], '<>>>>>>>>')}\n{CAUTION}"
    )
    say(f"wrote {options.out}/")


def _numbers(one: Planned, area: Sequence[float] | None) -> dict[str, Any]:
    """Return what summary.json has of a maneuver."""
    return {
        "maneuver": one.name,
        "speed_m_s": one.speed,
        "duration_s": one.maneuver.duration,
        "length_m": one.length,
        "width_m": one.width,
        "fits": area is None or (one.length <= max(area) and one.width <= min(area)),
        "peak_lateral_acceleration_m_s2": float(np.abs(one.log.needed("a_y")).max()),
        "expected_error": one.error,
        "estimates": [
            {"title": e.title, "axle": e.axle, "value": e.value, "sd": e.sd, "unit": e.unit}
            for e in one.tire.estimates()
        ],
    }


def _row(one: dict[str, Any]) -> list[str]:
    """Return what the table has of a maneuver."""
    sd = {(e["title"], e["axle"]): 100.0 * e["sd"] / e["value"] for e in one["estimates"][:6]}
    axles = [
        " / ".join(f"{sd[title, axle]:.0f}" for axle in AXLES) + " %"
        for title in (STIFFNESS, GRIP, RELAXATION)
    ]
    room = f"{one['length_m']:.0f} x {one['width_m']:.0f}{'' if one['fits'] else ' (too large)'}"
    words = [f"{one[name]:.1f}" for name in ("speed_m_s", "duration_s")]
    a_y, error = one["peak_lateral_acceleration_m_s2"], 100.0 * one["expected_error"]
    return [one["maneuver"], *words, room, f"{a_y:.1f}", f"{error:.1f} %", *axles]
