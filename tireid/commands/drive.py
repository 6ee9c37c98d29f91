"""`tireid drive`: steer a car along a path on identified tires."""

import argparse
import math
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from identifier.tire_model import TireModel, stored_verdict
from models.faults import KINDS, SIZED, FaultError, SensorFault
from models.rules import require_within
from models.schema import require_few
from models.vehicle import GRAVITY, Vehicle, sedan
from mpc.loop.sensing import CarSensors, FaultySensors, imu_and_localization
from mpc.path import BUILT_IN, Path
from mpc.path.speed import SHARE
from mpc.problem import size_of
from tireid.commands import options as shared
from tireid.driving import runs as driving
from tireid.driving.learn import DURATION, learning_drive
from tireid.driving.results import NO_FILM, Drives, headline, write_drive_report
from tireid.driving.setup import BY_TIRES, Setup, SpeedWish, require_drivable, simulated
from tireid.figures.film import FORMATS
from tireid.learning import identify
from tireid.progress import say, tell
from tireid.verdicts import warn_of

_NOT_COMPLETED = 1
_SPEEDS = (3.0, 100.0)  # m/s, least and most for a full-size car
CONFIRM = (
    "earn the speed: begin at 45 %% of what the tires allow, and go on as the car holds it and "
    "nothing says that the friction is another"
)
_TELL = "no speed follows, tell one: --speed 0.4g, --speed 15m/s"
_EPILOG = (
    "Without --weights, frozen tires are identified first: the same car drives on "
    f"an open field for {DURATION:g} s, steered at random and ever harder until its "
    "sensors show that it slides, and the tires at the end are used. linear is the tire of the "
    "vehicle file, oracle the true tire of the plant, learning begins with "
    "the frozen tires and updates them while driving. "
    "Exit code 0 where the first of the cars reached the end of the path and its tracker planned "
    "in 90 % of the steps, else 1."
)


def declare(new: Any) -> None:
    parser = new(
        description="Learn the tires on one drive, freeze them, and let a model predictive "
        "tracker with them steer the car along a path; write report.html, summary.json, every "
        "signal as CSV, figures and a film.",
        epilog=_EPILOG,
    )
    add_path(parser, "iso-3888-2")
    given = {
        "--speed WHAT": (
            TIRES,
            f"{TIRES}: {100.0 * SHARE:.0f} %% of what the identified tires allow, braking for "
            "bends; 70%%: another share of that limit; or given: a lateral acceleration in the "
            "tightest bend (0.4g, 4m/s2), constant on an open path, or a speed (17m/s, 60km/h) "
            "(%(default)s)",
        ),
    }
    shared.add_options(parser, str, given | V_MAX)
    text = "friction from arc length S [m] on, known to oracle only; may be repeated"
    parser.add_argument("--mu-drop", action="append", default=[], metavar="S:MU", help=text)
    parser.add_argument(
        "--tires",
        nargs="+",
        choices=(*driving.TIRES, ALL),
        default=[driving.FROZEN],
        metavar="NAME",
        help=f"tires that the tracker plans with: {', '.join(driving.TIRES)}, or {ALL}; "
        f"the first leads ({driving.FROZEN})",
    )
    shared.add_weights(parser, "the frozen tires, as identified")
    shared.add_day(parser)
    shared.add_method(parser)
    shared.add_vehicle(parser)
    shared.add_options(parser, bool, {"--confirm": CONFIRM})
    numbers = {
        "--mu MU": (1.0, "friction of the road (%(default)s)"),
        "--delay MS": (
            20.0,
            "from a measurement until its command acts, a multiple of 10 ms (%(default)g)",
        ),
        "--caution SHARE": (
            0.0,
            "share of the tires' uncertainty that the tracker plans for: 0 none, 1 the least "
            "grip that the motion leaves possible (%(default)g)",
        ),
        "--laps N": (1.0, "of a closed path (%(default)g)"),
    }
    shared.add_options(parser, float, numbers)
    parser.add_argument(
        "--noise", action=argparse.BooleanOptionalAction, default=True, help="of the sensors (on)"
    )
    parser.add_argument(
        "--sensors",
        choices=driving.SENSORS,
        default=driving.FULL,
        metavar="NAME",
        help="full: v_y is measured; imu: yaw rate and a_y of an inertial unit on the body (0.003 "
        "rad/s and 0.1 m/s² of noise, biases of 0.001 and 0.05), wheel speed (0.03 m/s), steering, "
        "position (2 cm, of a model car less) and heading (0.1 degrees) of a localization, and no "
        "v_y: an identifier estimates it while driving (%(default)s)",
    )
    text = (
        f"a sensor that breaks on the path, times in s (v_y:biased:3:inf:0.5); kinds: "
        f"{', '.join(KINDS)}; may be repeated"
    )
    fault = "CHANNEL:KIND:START:DURATION[:SIZE]"
    parser.add_argument("--fault", action="append", default=[], metavar=fault, help=text)
    shared.add_seed(parser, "noise and learning")
    text = f"{', '.join(FORMATS)} or {NO_FILM} (%(default)s)"
    parser.add_argument(
        "--film", metavar="NAME", help=text, choices=(*FORMATS, NO_FILM), default=FORMATS[0]
    )
    shared.add_output(parser, "drive")


def run(options: argparse.Namespace) -> int:
    """Run the command; return 0 where the first car reached the end of the path, else 1."""
    every = (driving.FROZEN, driving.LINEAR, driving.ORACLE, driving.LEARNING)
    labels = list(dict.fromkeys(every if ALL in options.tires else options.tires))
    shared.require_one(options, "weights", "method", "paper", "design")
    stored = shared.model_of_day(options)
    driving.require_compiler()
    with shared.folder_of(options) as folder:
        conditions = conditions_of(options, stored)
        setup = conditions.setup
        if driving.ORACLE in labels:
            setup.oracle()  # what cannot be is said before the car drives
        source, learnt = frozen_tires(options, labels, conditions, stored)
        conditions = conditions.on(learnt)
        hours = options.laps * conditions.setup.time_at(setup.path.s[-2]) / 3600.0
        require_few(ValueError, f"--path {setup.path.name}", hours, "hours", "hours of driving")
        say(headline(conditions))
        if learnt is not None:
            learnt.save(folder / "weights.json")
        drives = Drives.driven(conditions, labels, learnt, source)
        figures = drives.write(folder, options.film)
        write_drive_report(folder, drives, figures, options.film, options.words)
        case, _, scores = drives.text().partition("\n")
    tell(f"{case}\ntires: {source}\n{scores}")
    say(f"wrote {options.out}/")
    return 0 if drives.runs[0].scores.completed else _NOT_COMPLETED


TIRES = "tires"
SPEEDS = {"m/s": 1.0, "km/h": 1.0 / 3.6}
ACCELERATIONS = {"g": GRAVITY, "m/s2": 1.0, "m/s²": 1.0}
BARE = {"": 1.0}  # without a unit
SHARES = {"%": 0.01}
V_MAX = {"--v-max V": "largest speed of the plan: 200km/h or 60m/s (none)"}


def quantity(text: str, *units: Mapping[str, float]) -> tuple[float, str]:
    """Return a positive number in SI and its unit; NaN of what is none with one of the units.

    units : by name, their factors to SI.
    """
    factors = {name: factor for table in units for name, factor in table.items()}
    names = "|".join(map(re.escape, factors))
    found = re.fullmatch(rf"\s*([-+.\deE]+?)\s*({names})\s*", text, re.ASCII)
    with suppress(ValueError):
        if found and 0.0 < float(found[1]) < math.inf:
            return float(found[1]) * factors[found[2]], found[2]
    return math.nan, ""


def _require_speed(size: float, **given: float) -> None:
    require_within(ValueError, *(round(v * math.sqrt(size), 2) for v in _SPEEDS), **given)


def _parse_speed(text: str, size: float = 1.0) -> SpeedWish:
    """Return what --speed says.

    text : tires, 70% of what they allow, 0.4g or 4m/s2, 17m/s or 60km/h.
    size : of the car, of `mpc.problem.size_of`.
    """
    if text.strip() == TIRES:
        return BY_TIRES
    value, unit = quantity(text, SPEEDS, ACCELERATIONS, SHARES, BARE)
    if math.isnan(value):
        raise ValueError(
            "--speed wants tires, a share of what they allow, an acceleration or a speed "
            f"({TIRES}, 70%, 0.4g, 17m/s), not {text!r}"
        )
    if not unit:
        raise ValueError(f"--speed {text} has no unit: write {text}%, {text}g or {text}m/s")
    if unit in SPEEDS:
        _require_speed(size, **{"--speed in m/s": value})
        return SpeedWish(speed=value)
    if unit in SHARES:
        require_within(ValueError, 5.0, 150.0, **{"--speed in %": 100.0 * value})
        return SpeedWish(share=value)
    require_within(ValueError, 0.2, 30.0, **{"--speed in m/s²": value})
    return SpeedWish(a_y=value)


def parse_v_max(text: str | None) -> float | None:
    """Return the speed of --v-max [m/s], None where it is not given.   text : such as 60m/s."""
    if text is None:
        return None
    value, _ = quantity(text, SPEEDS)
    if math.isnan(value):
        raise ValueError(f"--v-max wants a speed, 200km/h or 60m/s, not {text!r}")
    return value


def _parse_drop(text: str) -> tuple[float, float]:
    """Return the place [m] and the friction from there on [-] of --mu-drop S:MU.

    text : such as 60:0.5.
    """
    s = mu = math.nan
    with suppress(ValueError):
        s, mu = map(float, text.split(":"))
    if math.isnan(s) or math.isnan(mu):
        raise ValueError(f"--mu-drop wants S:MU, arc length [m] and friction, not {text!r}")
    if not 0.0 <= s < math.inf:
        raise ValueError(f"--mu-drop: the place must not be negative, it is {s:g} m")
    require_within(ValueError, *driving.FRICTIONS, **{"friction of --mu-drop": mu})
    return s, mu


def parse_fault(text: str, kind: str = driving.FULL) -> SensorFault:
    """Return what --fault says of a sensor.

    text : CHANNEL:KIND:START:DURATION[:SIZE], such as v_y:biased:3:inf:0.5.
    kind : of the sensors, of `SENSORS`.
    """
    words = text.split(":")
    try:
        channel, how, *numbers = words
        start, duration, *size = map(float, numbers)
        (most,) = size or [0.0]
    except ValueError:
        raise ValueError(
            f"--fault wants CHANNEL:KIND:START:DURATION[:SIZE], times in s, not {text!r}"
        ) from None
    try:
        fault = SensorFault(channel=channel, kind=how, start=start, duration=duration, size=most)
        sensors = imu_and_localization(None) if kind == driving.IMU else CarSensors()
        FaultySensors(sensors, [fault])  # refuses what is no channel
    except FaultError as error:
        raise ValueError(f"--fault {text}: {error}") from None
    if how in SIZED and not size:
        raise ValueError(f"--fault {text}: {how} needs a size")
    return fault


ALL = "all"


def add_path(parser: Any, default: str) -> None:
    text = f"{', '.join(BUILT_IN)}, or way-points with columns x and y, as x_m,y_m (%(default)s)"
    shared.add_options(parser, str, {"--path NAME|FILE.csv": (default, text)})


def path_of(options: argparse.Namespace, vehicle: Vehicle) -> Path:
    """Return the path of --path, which the car can drive."""
    name = options.path
    if name in BUILT_IN:
        return BUILT_IN[name]()
    if not FilePath(name).suffix:
        raise ValueError(f"--path: there is no path {name!r}; {', '.join(BUILT_IN)}, or FILE.csv")
    path = Path.from_csv(FilePath(name), minimum_radius=vehicle.wheelbase)
    require_drivable(path, vehicle)
    return path


def conditions_of(
    options: argparse.Namespace, stored: TireModel | None = None
) -> driving.Conditions:
    """Return what is to be driven; the car is by default that of stored tires.   stored : tires."""
    of_sedan = stored is None or stored.vehicle.moves_as(sedan())
    vehicle = shared.read_vehicle(options, None if of_sedan else stored)
    size, v_max = size_of(vehicle), parse_v_max(options.v_max)
    wish = _parse_speed(options.speed, size)
    if v_max is not None:
        _require_speed(size, **{"--v-max in m/s": v_max})
        wish = wish._replace(most=v_max)
    if stored is not None:
        stored.require_car(vehicle, options.weights, "leave --vehicle out")
    path = path_of(options, vehicle)
    vehicle, tires = simulated(vehicle, stored)
    setup = Setup(path, vehicle, options.mu, (), wish, tires=tires)
    if v_max is not None and setup.constant:
        raise ValueError(f"--v-max: --speed {options.speed} is constant on this path: lower that")
    drops = tuple(sorted(_parse_drop(text) for text in options.mu_drop))
    for s, _ in drops:
        if not setup.path.closed and s >= (length := setup.path.length):
            raise ValueError(f"--mu-drop {s:g} is beyond the path, which is {length:.0f} m")
    return driving.Conditions(
        setup=setup._replace(drops=drops),
        delay=driving.delay_periods(1e-3 * options.delay, "--delay"),
        noise=options.noise,
        seed=shared.seed_of(options),
        laps=options.laps,
        faults=tuple(parse_fault(text, options.sensors) for text in options.fault),
        caution=options.caution,
        kind=options.sensors,
        confirm=options.confirm,
    )


def frozen_tires(
    options: argparse.Namespace,
    labels: Sequence[str],
    conditions: driving.Conditions,
    stored: TireModel | None = None,
) -> tuple[str, TireModel | None]:
    """Return where frozen tires come from, and the model where one is needed."""
    setup = conditions.setup
    if not {driving.FROZEN, driving.LEARNING} & set(labels) and setup.wish.share is None:
        return "no tires were identified", None
    if stored is not None:
        if setup.wish.share is not None and stored_verdict(options.weights) is False:
            raise ValueError(f"{options.weights} was not valid when it was learnt: {_TELL}")
        return f"frozen ones from {options.weights}", stored
    law, method = shared.chosen_method(options, setup.vehicle)
    recording = learning_drive(
        setup.car(open_field=True),
        conditions.sensors,
        np.random.default_rng([conditions.seed, 1]),
        seed=conditions.seed,
        lateral=conditions.lateral(),
    )
    run = identify(recording, setup.vehicle, method, check=False)
    warn_of(run.verdict, f"the identification drive of {law}")
    if setup.wish.share is not None and not run.verdict.valid:
        raise ValueError(f"the tires are not valid: {_TELL}")
    assert recording.a_y is not None
    banded = conditions.caution > 0.0 or setup.wish.share is not None
    return (
        f"frozen ones identified by {law} on {recording.duration:.0f} s of random steering on an "
        f"open field, up to {np.abs(recording.a_y).max():.1f} m/s² sidewards"
    ), run.tire if banded else run.freeze()
