"""`tireid lap WEIGHTS`: how fast identified tires let their car go along a path, and lap by lap."""

import argparse
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from identifier.motion.parameters import INDEX
from identifier.speed_limits import speed_limits
from identifier.tire_model import TireModel, load_model, stored_verdict
from models.files import digest
from models.logs.door import open_log
from models.logs.units import ACCELERATION, SPEED, to_si
from models.rules import require_within
from mpc.cars import BRAKES
from mpc.path import SpeedProfile, speed_profile
from mpc.path.speed import ENGINE, POWER, SHARE, TOP, Engine
from tireid import __version__
from tireid.commands import options as shared
from tireid.commands.drive import (
    ACCELERATIONS,
    BARE,
    CONFIRM,
    SHARES,
    V_MAX,
    add_path,
    parse_v_max,
    path_of,
    quantity,
)
from tireid.driving.laps import drive_laps
from tireid.driving.runs import FRICTIONS
from tireid.driving.setup import faster_than
from tireid.figures.lap import lap_figure, lap_gg_figure
from tireid.figures.style import save_figures
from tireid.output import write_json
from tireid.progress import say, tell
from tireid.report import Headline, Report, Section, Table, drawings, origin, write_report

_NOT_COMPLETED = 1
_BRAKING = INDEX["braking_f"]
_WIDE = 0.2  # its sd, half of that of its prior
_SUCH = {
    "share": "a share, 70% or 0.7",
    "engine": "an acceleration, 4m/s2 or 0.4g, or a table of speed and acceleration, engine.csv",
    "brakes": "a deceleration, 8m/s2 or 0.9g",
}


def declare(new: Any) -> None:
    parser = new(
        description="Plan the fastest speed along a path that identified tires and their doubt "
        "allow: lap time, speed and accelerations, and which axle limits them where, as "
        "report.html, lap.csv, raceline.csv (as planners of TUM write it) and summary.json. With "
        "--laps a simulated car drives it, learns from each lap, and goes again.",
        epilog="Exit code 1 where a lap of --laps was not completed.",
    )
    parser.add_argument("weights", type=Path, metavar="WEIGHTS", help="weights.json, as identified")
    add_path(parser, "course")
    words = {
        "--share SHARE": (str(SHARE), "of the limits that is used: 70%%, 0.7 (%(default)s)"),
        "--engine A|FILE": (
            str(ENGINE),
            "largest acceleration: 4m/s2, 0.4g, or a table of speed and acceleration, such as "
            "ax_max_machines.csv of TUM (%(default)s m/s²)",
        ),
        "--brakes A": f"largest {_SUCH['brakes'][2:]} (what the tires allow)",
        **V_MAX,
    }
    shared.add_options(parser, str, words)
    numbers = {
        "--friction RATIO": (1.0, "of this road over that of the log (%(default)g)"),
        "--confidence P": (0.95, "that a limit is right or too low (%(default)g)"),
        "--laps N": "drive a closed path N times with the simulated car, and learn from each lap",
        "--mu MU": "with --laps: true friction of the simulated road (1)",
    }
    shared.add_options(parser, float, numbers)
    shared.add_options(parser, bool, {"--confirm": f"with --laps: {CONFIRM}"})
    parser.set_defaults(confirm=None)
    shared.add_vehicle(parser, default="that of WEIGHTS")
    shared.add_seed(parser, "noise, with --laps")
    shared.add_output(parser, "lap")


def run(options: argparse.Namespace) -> int:
    """Run the command; return 1 where a lap was not completed."""
    source, n, ratio = options.weights, options.laps, options.friction
    require_within(ValueError, *FRICTIONS, **{"--friction": ratio})
    require_within(ValueError, 0.51, 0.999, **{"--confidence": options.confidence})
    share = _number(options, "share", SHARES, BARE)
    brakes = _number(options, "brakes", ACCELERATIONS, BARE)
    v_max = parse_v_max(options.v_max)
    table = Path(options.engine).is_file()
    engine = _engine(options.engine) if table else _number(options, "engine", ACCELERATIONS, BARE)
    planned = {"v_max": v_max, "engine": engine, "brakes": brakes}
    require_within(ValueError, 0.05, 1.0, **{"--share": share})
    if stored_verdict(source) is False:
        raise ValueError(
            f"{source} was not valid on its identification drive: `tireid plan --weights {source}` "
            "says what to drive"
        )
    tire = load_model(source)
    vehicle = shared.read_vehicle(options, tire)
    tire.require_car(vehicle, source, "leave --vehicle out")
    path = path_of(options, vehicle)
    try:
        limits = speed_limits(tire, confidence=options.confidence).scaled(ratio)
    except ValueError as error:
        remedy = "identify a log that slides, by the default method: tireid identify LOG"
        raise ValueError(f"{source}: no speed follows: {error}; {remedy}") from None
    if n is None:
        for word in ("confirm", "mu", "seed"):
            if getattr(options, word) is not None:
                raise ValueError(f"--{word} is of a car that drives: add --laps 1")
    elif n < 1.0 or n % 1.0:
        raise ValueError(f"--laps must be a whole number, 1 or more, it is {n:g}")
    elif not path.closed:
        raise ValueError(f"--laps N drives a closed path N times, {path.name!r} is open")
    with shared.folder_of(options) as folder:
        rows, completed = list[dict[str, float]](), True
        if n is None:
            profile = speed_profile(path, limits, share=share, **planned)
        else:
            planned["brakes"] = min(brakes or BRAKES, BRAKES)
            for lap in drive_laps(
                path, vehicle, tire, int(n), share=share, planned=planned, road=ratio,
                confidence=options.confidence, seed=shared.seed_of(options),
                confirm=bool(options.confirm), friction=1.0 if options.mu is None else options.mu,
            ):  # fmt: skip
                valid = bool(lap.learnt and lap.learnt.verdict.valid)
                profile, tire, drive = lap.profile, lap.tire, lap.driven.drive
                row = {
                    "lap": len(rows) + 1, "planned_s": profile.lap_time, "driven_s": drive.t[-1],
                    "share": lap.share, "a_y_limit_m_s2": lap.limits.a_y[0],
                    "off_path_m": lap.seen, "valid": valid,
                }  # fmt: skip
                rows.append(row)
                tell(
                    "lap {}: planned {:.2f} s, driven {:.2f} s, {:.2f} of the limits, limit of a_y "
                    "{:.2f} m/s²; {:.2f} m off the path".format(*row.values())
                    + ("" if valid else "; it taught nothing")
                )
                if lap.learnt and valid:
                    lap.learnt.tire.save(folder / "weights.json", valid=True)
            completed = lap.driven.scores.completed
        _write(folder, options, profile, tire, rows)
    say(f"wrote {options.out}/")
    return 0 if completed else _NOT_COMPLETED


def _number(options: argparse.Namespace, word: str, *units: Mapping[str, float]) -> Any:
    """Return what an option says in SI, None where it is not given."""
    text = getattr(options, word)
    if text is None:
        return None
    value, _ = quantity(text, *units)
    if math.isnan(value):
        raise ValueError(f"--{word.replace('_', '-')} wants {_SUCH[word]}, not {text!r}")
    return value


def _engine(file: str) -> Engine:
    """Return speeds and accelerations of a table."""
    log = open_log(file, rate=1.0, unnamed={2: ("v_mps", "ax_mps2")})
    found = log.headings()
    if len(found) != 2:
        raise ValueError(f"--engine {file}: two columns are needed, v_mps and ax_mps2")
    read = log.read([one.name for one in found])
    v, a = (
        to_si(one.unit, of, f"--engine {file}: {one.name}") * column.values
        for one, of, column in zip(found, (SPEED, ACCELERATION), read, strict=True)
    )
    return v, a


def _notes(profile: SpeedProfile, tire: TireModel, fastest: float) -> list[str]:
    """Return what a race engineer has to know before anybody drives.

    fastest : speed of the log [m/s].
    """
    notes, forward = [], tire.drives.lengthwise
    why = "its limits are used, downforce and drag unproven; drive faster, or add"
    if faster := faster_than(profile.v, fastest, why):
        notes.append(faster)
    if forward is None or forward[1][_BRAKING, _BRAKING] > _WIDE**2:
        notes.append(
            "braking and driving in turns were not identified, but are what is usual, with its "
            "doubt: identify a log that brakes and drives in turns"
        )
    notes.append(
        "friction is that of the log all the way: a drop within the lap needs a warning from "
        "outside; for another road add --friction RATIO"
    )
    return notes


def _write(
    folder: Path,
    options: argparse.Namespace,
    profile: SpeedProfile,
    tire: TireModel,
    laps: Sequence[Mapping[str, float]],
) -> None:
    """Write all files of a lap, and print what it is.

    profile : of the last lap.   tire : that it was planned on.
    """
    assert profile.planned is not None
    (planner, share), path, v = profile.planned, profile.path, profile.v
    profile.to_csv(folder / "lap.csv")
    profile.to_csv(folder / "raceline.csv", tum=True)
    limited: Counter[str] = Counter()
    for why, axle, dt in zip(profile.limited_by, profile.axle, np.diff(profile.t), strict=False):
        limited[why if why in (POWER, TOP) else f"{why}, {axle}"] += dt / profile.lap_time
    fastest = float(planner.limits.v[-1])
    notes = _notes(profile, tire, fastest)
    facts = {
        "lap_time_s": profile.lap_time, "length_m": path.length, "least_speed_m_s": v.min(),
        "top_speed_m_s": v.max(), "peak_a_y_m_s2": np.abs(profile.a_y).max(),
        "peak_braking_m_s2": -profile.a_x.min(), "share": share,
    }  # fmt: skip
    more = {
        "limited_by": limited, "laps": laps, "notes": notes, "command": options.words,
        "weights_hash": digest(tire.to_dict()), "version": __version__,
    }  # fmt: skip
    write_json(folder / "summary.json", {**facts, **more})
    figures = save_figures(folder, {"lap": lap_figure(profile), "lap_gg": lap_gg_figure(profile)})
    head = (
        "{}: {:.2f} s, {:.0f} m at {:.1f} to {:.1f} m/s; a_y up to {:.1f}, braking up to {:.1f} "
        "m/s²; {:.2f} of the limits"
    ).format(path.name, *facts.values())
    times = [(why, f"{100.0 * one:.0f} %") for why, one in limited.most_common()]
    tell(head, f"limited by {'; '.join(map(': '.join, times))}", *(f"note: {n}" for n in notes))
    why = times[0][0]
    captions = {
        "lap": f"Speed and accelerations along the path: slowest {v.min():.1f} m/s at "
        f"{path.s[v.argmin()]:.0f} m; {times[0][1]} of the time limited by: {why}.",
        "lap_gg": f"What the lap asks of the tires, a_y up to {facts['peak_a_y_m_s2']:.1f} and "
        f"braking up to {facts['peak_braking_m_s2']:.1f} m/s²; limits at its least and its top "
        "speed.",
    }
    tables = [Table("What limits the speed.", ("limited by", "of the time"), times)]
    if laps:
        cells = [list(row.values()) for row in laps]
        tables.append(Table("Laps; the figures show the plan of the last.", list(laps[0]), cells))
    sections = [
        Section("The lap", [*drawings(figures, captions), *tables]),
        origin(options.words, tire.vehicle, ()),
    ]
    faster = float((v > fastest).mean())
    numbers = [
        Headline(f"{profile.lap_time:.2f} s", "lap time, planned"),
        Headline(times[0][1], f"of the time limited by: {why}"),
        Headline(
            f"{100.0 * faster:.0f} %",
            f"of the way is faster than the log, {fastest:.1f} m/s",
            "doubt" if faster else "",
        ),
    ]
    report = Report(f"A lap of {path.name}", sections, f"{head}.", numbers, notes=notes)
    write_report(folder, report)
