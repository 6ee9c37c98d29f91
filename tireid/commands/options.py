"""Options that commands share, each declared once; what they read: methods, logs.

One word means one thing in every command: `--vehicle` the car, `--method`, `--paper` and `--design`
what learns, `--weights` what was learnt before, `--out` the folder that is written, `--force` that
what is there is replaced, `--seed` chance, `--jobs` processes.
"""

from argparse import ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Mapping
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path
from typing import Any

from identifier.estimate.model import FittedModel
from identifier.method import Method
from identifier.methods import (
    DEFAULT,
    LIVE,
    REFERENCE,
    draws_weights,
    make_method,
    methods,
    require_method,
)
from identifier.paper.design import read_design
from identifier.tire_model import TireModel, load_model
from identifier.verdict import Verdict
from models.recordings import LogMap, Recording, read_recording, read_repaired, split_log_argument
from models.recordings.map import CUT, MEND
from models.recordings.reader import map_of, with_columns
from models.vehicle import Vehicle, sedan
from tireid.commands import DONE, NOT_VALID
from tireid.learning import with_v_y
from tireid.output import output_folder
from tireid.progress import complain, say
from tireid.verdicts import stored_notes


def add_options(parser: Any, kind: type, table: Mapping[str, Any]) -> None:
    """Add options of one kind to a parser or to a group of it; bool is a flag.

    table : by "--word METAVAR" its help, or its default and its help.
    """
    for words, what in table.items():
        word, _, metavar = words.partition(" ")
        default, text = what if isinstance(what, tuple) else (None, what)
        if kind is bool:
            parser.add_argument(word, action="store_true", help=text)
        else:
            read = None if kind is str else kind
            parser.add_argument(word, type=read, help=text, default=default, metavar=metavar)


def add_vehicle(
    parser: ArgumentParser, *, required: bool = False, default: str = "the sedan"
) -> None:
    text = f"car as TOML, tireid init writes one ({'needed' if required else default})"
    parser.add_argument("--vehicle", required=required, type=Path, metavar="FILE", help=text)


def read_vehicle(options: Namespace, model: TireModel | None = None) -> Vehicle:
    """Return the car of --vehicle, without it that of a model or the sedan, as --log repairs it.

    What of it is estimated, unless the tires of the model were identified so, or repaired is said.
    """
    path: Path | None = options.vehicle
    if path is not None and path.suffix.lower() != ".toml":
        raise ValueError(
            f"--vehicle {path}: must be the .toml of a car, by its ending; tireid init writes one "
            "to fill in"
        )
    known = sedan() if model is None else model.vehicle
    vehicle = known if path is None else Vehicle.from_toml(path)
    if vehicle.estimates not in ("", known.estimates):
        say(f"{path}: {vehicle.estimates}")
    mended = _map_path(options)
    numbers: dict[str, Any] = dict(map_of(mended).repair.vehicle)
    if not numbers:
        return vehicle
    said = ", ".join(f"{name} = {value:.6g}" for name, value in numbers.items())
    say(f"{mended} repairs the car: {said}")
    return replace(vehicle, **numbers)


def add_output(parser: ArgumentParser, command: str | None) -> None:
    """Add --out and --force: the folder of results.

    command : its name, which the folder bears by default; None writes a folder only where asked.
    """
    folder = None if command is None else Path(f"tireid-{command}")
    declared = f"folder to write ({folder or 'only where asked'})"
    add_options(parser, Path, {"--out DIR": (folder, declared)})
    add_force(parser)


def folder_of(options: Namespace) -> AbstractContextManager[Path]:
    """Return the folder of --out, as `output_folder` makes it."""
    return output_folder(options.out, force=options.force)


def add_force(parser: ArgumentParser) -> None:
    add_options(parser, bool, {"--force": "replace what is there"})


def add_accept(parser: ArgumentParser) -> None:
    text = f"exit with 0 where the verdict is not valid, in place of {NOT_VALID}"
    add_options(parser, bool, {"--accept": text})


def stored_model(path: Path | None) -> TireModel | None:
    """Return a stored model, None where none is given; say where it was found not valid."""
    if path is None:
        return None
    model = load_model(path)
    for said in stored_notes(path):
        complain(f"warning: {said.text}")
    return model


def add_day(parser: ArgumentParser) -> None:
    text = (
        "log with the sensors as they are today, whose zeros are found from it (those of the log "
        "that identified the tires)"
    )
    add_options(parser, str, {"--day LOG[:RUN]": text})


def model_of_day(options: Namespace) -> TireModel | None:
    """Return the model of --weights with the sensors of --day, None where no model is given."""
    model = stored_model(options.weights)
    if options.day is None:
        return model
    if model is None:
        raise ValueError("--day is of a stored model: give --weights, too")
    if not isinstance(model, FittedModel):
        raise ValueError(f"--day is for tires of a fit, {options.weights} is a {model.kind}")
    path, named = split_log_argument(options.day)
    log = with_v_y(read_recording(path, run=named), model)
    say(f"read {log.name}: {log.t.size} samples, {log.duration:.1f} s")
    day = model.on(log)
    if not day.anew:
        complain(f"{log.name}: too short for its sensors, those of the identification drive stay")
    say(f"sensors of {log.name}: {day.line}")
    return model.of_day(day)


def host_and_port(text: str, option: str) -> tuple[str, int]:
    """Return what HOST:PORT names; without a host this machine, which others do not reach."""
    host, _, port = text.rpartition(":")
    if not (port.isascii() and port.isdigit() and int(port) < 65536):
        raise ValueError(f"{option} wants HOST:PORT, a port of 0 to 65535, not {text!r}")
    return host.strip("[]") or "127.0.0.1", int(port)


def require_toml(path: Path) -> None:
    if path.suffix.lower() != ".toml":
        raise ValueError(f"{path}: the name must end in .toml")


def exit_code(verdict: Verdict, options: Namespace) -> int:
    return NOT_VALID if verdict.judged and not (verdict.valid or options.accept) else DONE


def add_weights(parser: ArgumentParser, what: str) -> None:
    add_options(parser, Path, {"--weights FILE": f"stored model: {what}"})


def add_seed(parser: ArgumentParser, what: str) -> None:
    """Add --seed; None where it is not given."""
    add_options(parser, int, {"--seed N": f"of {what} (0)"})


def seed_of(options: Namespace) -> int:
    """Return --seed, 0 where it is not given."""
    seed = int(options.seed or 0)
    if seed < 0:
        raise ValueError(f"--seed must not be negative, it is {seed}")
    return seed


def method_name(text: str) -> str:
    """Return the name of a method, for argparse.

    Raises
    ------
    ArgumentTypeError
        Where there is none of that name.
    """
    try:
        require_method(text)
    except ValueError as error:
        raise ArgumentTypeError(str(error)) from error
    return text


def add_method(parser: ArgumentParser, usual: str = DEFAULT) -> None:
    """Add --method, --paper and --design, of which one is given or none.

    usual : the default.
    """
    text = f"what learns: {', '.join(methods())} (default: {usual})"
    parser.add_argument("--method", type=method_name, metavar="NAME", help=text)
    add_options(parser, bool, {"--paper": f"the paper's network and law: --method {REFERENCE}"})
    add_options(parser, Path, {"--design FILE": "design.toml, in place of --method"})


def require_one(options: Namespace, *words: str) -> bool:
    """Refuse more than one of some options; return whether there is one."""
    given = [word for word in words if getattr(options, word)]
    if len(given) > 1:
        raise ValueError(f"give only one of {', '.join('--' + word for word in given)}")
    return bool(given)


def method_is_given(options: Namespace) -> bool:
    """Return whether a command is given what learns."""
    return require_one(options, "method", "paper", "design")


def chosen_method(
    options: Namespace,
    vehicle: Vehicle,
    seed: int | None = None,
    *,
    online: bool = False,
) -> tuple[str, Method]:
    """Return what --method, --paper or --design say, by the name of its results, or the default.

    seed : of initial weights; None where nobody asks for one.
    online : whether the default is the one that learns sample by sample.
    """
    method_is_given(options)
    if options.design is not None:
        if seed is not None:
            raise ValueError(f"--seed is for a method: the seed of a design is in {options.design}")
        design = read_design(options.design)
        return design.law, design
    name = options.method or (REFERENCE if options.paper else LIVE if online else DEFAULT)
    if seed is not None and not draws_weights(name):
        raise ValueError(f"--seed is of random initial weights, and {name} begins with none")
    return name, make_method(name, vehicle, seed or 0)


def add_log_reading(parser: ArgumentParser) -> None:
    """Add --log, --columns and --no-check."""
    add_log_map(parser)
    add_options(parser, bool, {"--no-check": "accept a log that contradicts physics"})


def add_log_map(parser: ArgumentParser) -> None:
    """Add --log, --columns, --dbc, --rate, --cut-holes and --mend-clock: how a log is read."""
    parser.add_argument(
        "--log",
        dest="log_map",
        type=Path,
        metavar="FILE",
        help="log.toml, how the logs are read and repaired; tireid channels --write writes one",
    )
    parser.add_argument(
        "--columns",
        nargs="+",
        action="extend",
        default=[],
        metavar="NAME=COLUMN",
        help="read column COLUMN of the logs as NAME, for example r=yaw_rate; behind it a unit, "
        'factor, offset or steering ratio: "vy=Vel Lat [km/h]" "delta_f=SteerAngle [deg] /14.6"',
    )
    add_options(parser, str, {"--dbc FILE": "DBC with the signals in the frames of a CAN log"})
    add_options(
        parser, float, {"--rate HZ": "samples per second, where no column of the logs is a time"}
    )
    flags = {
        "--cut-holes": "drop samples without a value (NaN); else such logs are rejected",
        "--mend-clock": "sort samples by time, drop repeated stamps, and treat a clock that "
        "starts again as a gap; else such logs are rejected",
    }
    add_options(parser, bool, flags)


def _map_path(options: Namespace) -> Path | None:
    """Return the file of --log, which a log itself is not."""
    path: Path | None = getattr(options, "log_map", None)
    if path is not None and path.suffix.lower() != ".toml":
        raise ValueError(
            f"--log {path}: must be a log.toml, by its ending; give a log after the command"
        )
    return path


def given_map(options: Namespace) -> LogMap:
    """Return how logs are read by --log, and by the other options, which come first."""
    columns: dict[str, str] = {}
    for pair in options.columns:
        name, equals, column = pair.partition("=")
        if not (name and equals and column):
            raise ValueError(f"--columns wants NAME=COLUMN, not {pair!r}")
        if name in columns:
            raise ValueError(f"--columns gives {name} twice")
        columns[name] = column
    declared = with_columns(map_of(_map_path(options)), columns)
    if options.cut_holes:
        declared = replace(declared, holes=CUT)
    if options.mend_clock:
        declared = replace(declared, order=MEND)
    if options.rate is not None:
        declared = replace(declared, rate=options.rate, clock="", clock_unit="")
    return declared if options.dbc is None else replace(declared, dbc=options.dbc)


def read_log(
    log: str,
    vehicle: Vehicle,
    options: Namespace,
    *,
    check: bool = True,
    dt: float = 0.01,
) -> Recording:
    """Read a recording, repair it where the map says so, and say what was read and done.

    check : refuse what contradicts physics, without --no-check.
    dt : sampling interval that it is brought to [s].
    """
    declared, check = given_map(options), check and not options.no_check
    path, named = split_log_argument(log)
    recording, _ = read_repaired(path, vehicle, run=named, dt=dt, check=check, log_map=declared)
    say(f"read {recording.name}: {recording.t.size} samples, {recording.duration:.1f} s")
    for note in recording.notes:
        say(f"{recording.name}: {note}")
    return recording
