"""`tireid plan --area 40x40 --speed 15`: the maneuver that teaches most in the space there is."""

import argparse
import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from codegen.arrays import Array
from identifier.frozen import vehicle_numbers
from identifier.plan import STEERING_LAG, Plan, Rehearsal, Rival, hold_of
from identifier.plan.chosen import CHOSEN as PLAN_CHOSEN
from models.files import digest
from models.rules import require_positive, require_within
from models.vehicle import Vehicle
from tireid import __version__, planning
from tireid.commands import COMMANDS
from tireid.commands import options as shared
from tireid.commands.chosen import CHOSEN
from tireid.figures.plan import plan_area_figure, plan_band_figure, plan_steering_figure
from tireid.figures.style import save_figures
from tireid.output import output_folder, text_table, write_csv, write_json
from tireid.progress import Progress, say, tell
from tireid.report import Headline, Paragraph, Report, Section, Table, write_report
from tireid.reports.common import READ, REPORT, drawing, origin


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
        ("--grip", 20.0, 100.0 * PLAN_CHOSEN.rear),
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
        t = CHOSEN.period * np.arange(
            round(one.steering.duration / CHOSEN.period) + 1, dtype=np.float64
        )
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
    back = np.arange(round(CHOSEN.run_up / step), 0, -1) * step * found.space.speed
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


def plan_words(found: Plan, driven: Sequence[Rehearsal]) -> list[str]:
    """Return what to expect and what is safe, as sentences."""
    space, count = found.space, len(found.passes)
    each = found.time / count
    times = f"one pass of {each:.1f} s" if count == 1 else f"{count} passes of {each:.1f} s"
    said = [
        f"{times} at {space.speed:.3g} m/s in {space.length:g} x {space.width:g} m: the expected "
        f"error of the forces falls from {100.0 * found.error_before:.0f} to "
        f"{100.0 * found.error:.1f} % of the grip."
    ]
    slalom = found.rivals[0]
    said.append(_against(slalom, found))
    distance = space.speed**2 / (2.0 * CHOSEN.pull)
    said.append(
        f"Up to {found.lateral_acceleration:.1f} m/s² sideways, {100.0 * space.share:.0f} % of the "
        f"grip of the likely tires; the car stays {found.clearance:.2g} m from the edge with "
        f"every tire that it may have. It comes in at speed, about {distance:.0f} m of run-up, and "
        f"needs as much to stop behind the area."
    )
    if driven:
        side_slip = max(one.side_slip for one in driven)
        said.append(
            f"Rehearsed on the double-track car of the vehicle file: {_least(driven):.2g} m from "
            f"the edge, side slip up to {math.degrees(side_slip):.1f} degrees."
        )
    return said


def _least(driven: Sequence[Rehearsal]) -> float:
    """Return the least distance to the edge in rehearsals [m]."""
    return min(one.clearance for one in driven)


def _against(slalom: Rival, found: Plan) -> str:
    """Return what a slalom would need."""
    later = "is not as good in ten times of it"
    if math.isfinite(slalom.catches_up):
        length = slalom.length * slalom.catches_up / found.time
        later = f"is as good after {slalom.catches_up:.0f} s, {length:.0f} m"
    return (
        f"A slalom at the same share of the grip leaves {100.0 * slalom.error:.1f} % in that time, "
        f"and {later}."
    )


def write_plan_report(
    folder: Path,
    found: Plan,
    figures: Mapping[str, Figure],
    *,
    inputs: Mapping[str, Any],
    command: str,
    driven: Sequence[Rehearsal],
) -> None:
    words = plan_words(found, driven)
    report = Report(
        title=f"Maneuver in {found.space.length:g} x {found.space.width:g} m",
        summary=words[0],
        numbers=[
            Headline(f"{100.0 * found.error:.1f} %", "expected error of the forces over the grip"),
            Headline(f"{100.0 * found.error_before:.0f} %", "before it"),
            Headline(f"{100.0 * found.rivals[0].error:.1f} %", "after a slalom of that length"),
            Headline(f"{found.clearance:.2g} m", "least distance to the edge"),
        ],
        warnings=_plan_warnings(found, driven),
        sections=[
            Section(
                heading="Maneuver",
                blocks=[
                    drawing(figures["area"], "Passes in the area.", READ["plan_area"]),
                    drawing(figures["steering"], "Steering.", READ["plan_steering"]),
                    Paragraph(text=_how(found)),
                ],
            ),
            Section(
                heading="Expected gain",
                blocks=[
                    drawing(
                        figures["band"], "The band of 90 % before and after.", READ["plan_band"]
                    ),
                    Paragraph(text=words[1]),
                    Table(
                        caption="The plan and maneuvers of the same length at the same share of "
                        "the grip, error over the grip; their room is that on an open field, "
                        "without margins; random is the median of eight.",
                        header=RIVALS,
                        rows=rival_rows(found),
                    ),
                ],
            ),
            Section(heading="Safety", blocks=[Paragraph(text=text) for text in words[2:]]),
            origin(
                command,
                found.tires.vehicle,
                (),
                all_inputs=f"hash {digest(dict(inputs))}, listed in summary.json",
            ),
        ],
    )
    write_report(folder / REPORT, report)


def _plan_warnings(found: Plan, driven: Sequence[Rehearsal]) -> list[str]:
    said = [
        "Drive on a closed field only, at half the speed first: tires outside of what was taken "
        "for possible, a wet place or a lower speed change the way."
    ]
    if not found.space.held:
        said.append("Open loop: disturbances of the course are not corrected.")
    if driven and _least(driven) < 0.0:
        said.append(
            f"The double-track car of the vehicle file leaves the area by {-_least(driven):.2g} m: "
            "its tires are outside the planned set. Set --mu, or ask for less --grip."
        )
    return said


def _how(found: Plan) -> str:
    """Return how steering.csv is to be driven."""
    space, lag = found.space, 1e3 * float(found.tires.steering_lag[0])
    paths = "path.csv" if len(found.passes) == 1 else "path.csv, path_2.csv, ..."
    how = (
        "steering.csv has the front wheel angle [rad], to the left positive, over the time since "
        "the entry of each pass, and the course of the center of gravity that follows: X along "
        "the longer side of the area, Y to the left of it, both from the corner in which the "
        f"area begins, psi from X to the left. The wheels follow over {lag:.0f} ms. The speed is "
        f"constant. {paths}: the course with a straight run-up, as tireid drive --path path.csv "
        f"--speed {space.speed:g}m/s and other path trackers read it; who tracks it well steers "
        "much the same."
    )
    if not space.held:
        return how
    hold = hold_of(found.tires, space.speed)
    return (
        f"{how} The robot or driver of steering.csv also corrects the course, slowly: add "
        f"{hold.heading:.3g} rad per rad of heading that is missing and {hold.aside:.3g} rad per "
        "meter that the car is off to the right."
    )


RIVALS = ("maneuver", "time", "room", "expected error")


def rival_rows(found: Plan) -> list[list[str]]:
    """Return the plan beside slalom and random steering, under `RIVALS`."""
    space, time = found.space, f"{found.time:.1f} s"
    room = f"{space.length:g} x {space.width:g} m"
    rows = [["plan", time, room, f"{100.0 * found.error:.1f} %"]]
    for one in found.rivals:
        room = f"{one.length:.0f} x {one.width:.1f} m"
        rows.append([one.name, time, room, f"{100.0 * one.error:.1f} %"])
    return rows
