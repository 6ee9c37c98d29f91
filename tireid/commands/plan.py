"""`tireid plan --area 40x40 --speed 15`: the maneuver that teaches most in the space there is."""

import argparse
import math
import re
from pathlib import Path
from typing import Any

import numpy as np

from codegen.arrays import Array
from identifier.frozen import vehicle_numbers
from identifier.plan import STEERING_LAG, Plan, hold_of
from identifier.plan.search import REAR
from models.files import digest
from models.rules import require_positive, require_within
from models.vehicle import Vehicle
from tireid import __version__, planning
from tireid.commands import COMMANDS
from tireid.commands import options as shared
from tireid.figures.plan import plan_area_figure, plan_band_figure, plan_steering_figure
from tireid.figures.style import save_figures
from tireid.output import output_folder, text_table, write_csv, write_json
from tireid.progress import Progress, say, tell
from tireid.reports.plan import RIVALS, plan_words, rival_rows, write_plan_report

_PERIOD = 0.01  # s, of steering.csv
_RUN_UP = 1.0  # s straight ahead, before each pass


def add_parser(commands: Any) -> None:
    parser = commands.add_parser(
        "plan",
        help=COMMANDS["plan"],
        description="Plan the steering that narrows the band of the tires' forces most, within an "
        "area, with a margin, for every tire that the car may have (stiffness and grip within "
        "30 %, or what a model leaves open); write steering.csv, a path for tireid drive, figures "
        "and report.html, which compares it with a slalom and with random steering.",
    )
    shared.add_vehicle(parser, default="the sedan; with --after that of the model")
    needed = {"required": True}
    parser.add_argument("--area", metavar="LxW", help="length and width [m], as 40x40", **needed)
    text = "constant: 15 or 15m/s, 54km/h"
    parser.add_argument("--speed", metavar="V", help=text, **needed)
    of_steering = "of steering, over as many passes as the area takes (%(default)g)"
    lag = (
        "time constant from the command to the front wheel angle, a guess within "
        f"30 %% (the vehicle file's, {STEERING_LAG:g} where it has none)"
    )
    rate = math.degrees(planning.RATE)
    numbers: dict[str, Any] = {
        "--time S": (planning.TIME, of_steering),
        "--mu MU": f"friction, a guess within 30 %% ({planning.FRICTION:g})",
        "--grip PERCENT": (
            100.0 * planning.SHARE,
            "share of the grip that is used at most (%(default)g)",
        ),
        "--margin M": f"from the car to the edge of the area ({planning.MARGIN:g} wheelbases)",
        "--steering-rate DEG/S": f"largest, of the front wheels ({rate:.0f} over sqrt(L/g))",
        "--steering-angle DEG": (30.0, "largest, of the front wheels (%(default)g)"),
        "--steering-lag S": lag,
        "--steering-ratio RATIO": "hand wheel over front wheels: adds it to steering.csv",
    }
    shared.add_options(parser, float, numbers)
    text = "weights.json, as identified: plan what is still unknown"
    shared.add_options(parser, Path, {"--after FILE": text})
    text = "open loop: steering without course correction; takes more room"
    shared.add_options(parser, bool, {"--blind": text})
    shared.add_seed(parser, "the search")
    shared.add_output(parser, "plan")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    area, speed = _parse_area(options.area), _parse_speed(options.speed)
    ratio, rate = options.steering_ratio, options.steering_rate
    if ratio is not None and not 1.0 <= ratio <= 100.0:
        raise ValueError(f"--steering-ratio must be 1 to 100, it is {ratio:g}")
    _require_ranges(options)
    seed, model = shared.seed_of(options), shared.stored_model(options.after)
    vehicle = shared.read_vehicle(options, model, options.after)
    with output_folder(options.out, force=options.force) as folder:
        with Progress("planning") as progress:
            found = planning.plan(
                vehicle,
                area=area,
                speed=speed,
                time=options.time,
                after=model,
                friction=options.mu,
                share=0.01 * options.grip,
                margin=options.margin,
                rate_limit=None if rate is None else math.radians(rate),
                max_angle=math.radians(options.steering_angle),
                steering_lag=options.steering_lag,
                held=not options.blind,
                seed=seed,
                progress=progress,
            )
        driven, inputs = planning.rehearsals(found), _inputs_of(options, vehicle, area, speed)
        write_csv(folder / "steering.csv", _steering_columns(found, ratio))
        for k in range(len(found.passes)):
            name = "path.csv" if k == 0 else f"path_{k + 1}.csv"
            write_csv(folder / name, _path_columns(found, k))
        write_json(folder / "summary.json", _summary(found, inputs))
        figures = {
            "area": plan_area_figure(found),
            "steering": plan_steering_figure(found, ratio),
            "band": plan_band_figure(found),
        }
        save_figures(folder, figures)
        write_plan_report(
            folder, found, figures, inputs=inputs, command=options.words, driven=driven
        )
    tell("\n".join([*plan_words(found, driven), text_table([RIVALS, *rival_rows(found)], "<>>>")]))
    say(f"wrote {options.out}/")


def _require_ranges(options: argparse.Namespace) -> None:
    """Refuse by their words, in the units of the command, what no plan is made with."""
    for word, low, high in (
        ("--mu", 0.05, 3.0),
        ("--grip", 20.0, 100.0 * REAR),
        ("--margin", 0.0, 1e3),
        ("--steering-angle", 1.0, 60.0),
        ("--steering-lag", planning.SHORTEST_LAG, planning.LONGEST_LAG),
    ):
        value = vars(options)[word.removeprefix("--").replace("-", "_")]
        if value is not None:
            require_within(ValueError, low, high, **{word: value})
    if options.steering_rate is not None:
        require_positive(ValueError, **{"--steering-rate": options.steering_rate})


def _parse_area(text: str) -> tuple[float, float]:
    """Return length and width [m] of --area.

    text : such as 40x40 or 60x20.5m.
    """
    found = re.fullmatch(r"\s*([\d.]+)\s*m?\s*[xX×*]\s*([\d.]+)\s*m?\s*", text, re.ASCII)
    try:
        sides = (float(found[1]), float(found[2])) if found else ()
    except ValueError:
        sides = ()
    if len(sides) != 2:
        raise ValueError(f"--area wants length x width in meters (40x40), not {text!r}")
    if not all(0.1 <= side <= 5000.0 for side in sides):
        raise ValueError(f"--area must have sides of 0.1 to 5000 m, it is {text.strip()}")
    return sides[0], sides[1]


def _parse_speed(text: str) -> float:
    """Return the speed [m/s] of --speed: 15, 15m/s or 54km/h."""
    value, unit = shared.number_with_unit(text, "m/s", "km/h")
    speed = value / (3.6 if unit == "km/h" else 1.0)
    if not 0.1 <= speed <= 100.0:
        raise ValueError(f"--speed wants 0.1 to 100 m/s (15, 15m/s, 54km/h), not {text!r}")
    return speed


def _inputs_of(
    options: argparse.Namespace, vehicle: Vehicle, area: tuple[float, float], speed: float
) -> dict[str, Any]:
    """Return all that went into a plan, ready for JSON.

    area : length and width [m].   speed : [m/s].
    """
    return {
        "vehicle": vehicle_numbers(vehicle),
        "area_m": list(area),
        "speed_m_s": speed,
        "time_s": options.time,
        "after": None if options.after is None else str(options.after),
        "friction": options.mu,
        "grip_percent": options.grip,
        "margin_m": options.margin,
        "steering_rate_deg_s": options.steering_rate,
        "steering_angle_deg": options.steering_angle,
        "steering_lag_s": options.steering_lag,
        "blind": options.blind,
        "seed": shared.seed_of(options),
    }


def _steering_columns(found: Plan, ratio: float | None) -> dict[str, Array]:
    """Return the columns of steering.csv: pass by pass from its entry on, with the course.

    ratio : hand wheel over front wheels; None gives no hand wheel.
    """
    rows = []
    for k, one in enumerate(found.passes):
        t = _PERIOD * np.arange(round(one.steering.duration / _PERIOD) + 1, dtype=np.float64)
        delta = one.steering.steering(t)[:, 0]
        r = np.interp(t, one.t, one.motion.r[:, 0, 0])
        held = np.full(t.size, found.space.speed)
        rows.append(np.column_stack([np.full(t.size, k + 1), t, delta, one.course(t), r, held]))
    names = ("pass", "t_s", "delta_f_rad", "X_m", "Y_m", "psi_rad", "r_expected_rad_s", "v_x_m_s")
    columns = dict(zip(names, np.vstack(rows).T, strict=True))
    if ratio is not None:
        columns["hand_wheel_deg"] = np.degrees(ratio * columns["delta_f_rad"])
    return columns


def _path_columns(found: Plan, k: int) -> dict[str, Array]:
    """Return way-points of a pass for `tireid drive --path`, with its straight run-up.

    k : which pass, from 0.
    """
    one, car = found.passes[k], found.tires.vehicle
    step = 0.4 * car.wheelbase / found.space.speed
    t = np.linspace(0.0, one.steering.duration, max(8, round(one.steering.duration / step)))
    X, Y, psi = one.course(t).T
    back = np.arange(round(_RUN_UP / step), 0, -1) * step * found.space.speed
    before = X[0] - back * np.cos(psi[0]), Y[0] - back * np.sin(psi[0])
    return {"X_m": np.append(before[0], X), "Y_m": np.append(before[1], Y)}


def _summary(found: Plan, inputs: dict[str, Any]) -> dict[str, Any]:
    slips, before, after = found.deviations()
    hold = hold_of(found.tires, found.space.speed)
    return {
        "passes": len(found.passes),
        "time_s": found.time,
        "expected_error_before": found.error_before,
        "expected_error": found.error,
        "rivals": {
            one.name: {
                "expected_error": one.error,
                "length_m": one.length,
                "width_m": one.width,
                "catches_up_s": one.catches_up if math.isfinite(one.catches_up) else None,
            }
            for one in found.rivals
        },
        "least_distance_to_edge_m": found.clearance,
        "peak_lateral_acceleration_m_s2": found.lateral_acceleration,
        "steering_lag_s": float(found.tires.steering_lag[0]),
        "hold_rad_per_rad": hold.heading if found.space.held else None,
        "hold_rad_per_m": hold.aside if found.space.held else None,
        "band": {
            "slip_rad": slips.tolist(),
            "sd_before_N": before.tolist(),
            "sd_after_N": after.tolist(),
        },
        "inputs": inputs,
        "hash": digest(inputs),
        "version": __version__,
    }
