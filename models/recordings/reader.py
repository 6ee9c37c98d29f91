"""From a log, a file or arrays in memory, to a Recording: read, brought to a clock, judged."""

import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any

from codegen.escape import displayed
from models.logs.door import ENDINGS, open_log
from models.logs.log import LogFile, RecordingError, one_run
from models.logs.memory import open_arrays
from models.logs.signals import INSTEAD, Signal, signal_name
from models.recordings.assembly import recording_of
from models.recordings.checks import check_against_vehicle, check_physics
from models.recordings.choice import chosen_signals, declaration
from models.recordings.evidence import least_squares, pair, windows
from models.recordings.map import MEND, LogMap, given_channel, given_signals
from models.recordings.record import Recording
from models.recordings.repair import Repair
from models.vehicle import Vehicle, sedan

_NO_NAMES: Mapping[str, str] = {}
_DT = 0.01  # [s], the sample time of every method
_CHANGE = re.compile(r"change the sign of (\w+)")
_MOST_TRIED = 50  # channels that may be the lateral acceleration
_UNLIKE, _ALIKE = 0.3, 0.9  # correlation of a_y with v_x r, of another axis, and of it
_GivenMap = LogMap | str | PathLike[str] | None


def read_recording(
    source: Any,
    run: str | None = None,
    dt: float = _DT,
    *,
    name: str = "",
    check: bool = True,
    columns: Mapping[str, str] = _NO_NAMES,
    log_map: _GivenMap = None,
) -> Recording:
    """Read one run of a log, a file or arrays in memory, and bring it to a uniform sample time.

    Columns of standard names are in SI and ISO axes: t [s], vx, vy [m/s], r [rad/s], delta_f
    [rad]; if present also delta_r [rad] (else 0), wheel_fl, wheel_fr, wheel_rl, wheel_rr or wheel
    [m/s, or rad/s where the map tells a radius] where there is no vx, ay [m/s^2], Fyf and Fyr [N],
    run (text); a unit that the file tells is converted. Others are ignored. Where there are no Fyf
    and Fyr, the
    columns Fyf_inv and Fyr_inv (forces computed backwards from the motion) stand in for them.
    `columns` or a map declare signals of other names; where neither has them and names and
    units leave no doubt, they are taken and the recording's notes say so.

    Parameters
    ----------
    source : path of a log of any format; or a data frame, or a mapping of arrays of one length, by
        column. Times of the calendar and durations count from the first; where no column is the
        time, the index of a data frame is, if it rises.
    run : name of the run; may be left out when there is only one.
    dt : sample time T_s of the result [s].
    name : of the recording; empty takes that of the file, "recording" for arrays.
    check : whether to judge signs, axes and units by physics; turn it off for a log that is right
        and refused all the same. Where the map holds a repair, what it leaves is judged.
    columns : by our name of a column, its name in this file and, where it wants them, unit,
        factor, offset and ratio: {"vy": "Vel Lat [km/h]", "delta_f": "SteerAngle [deg] /14.6"}.
    log_map : how the log is read, or the path of a log.toml; its repair is not applied here, since
        it wants the car. `columns` hold where both tell a signal.

    Returns
    -------
    Recording
        Named "NAME:RUN", or "NAME" when there is one run without a name.

    Raises
    ------
    RecordingError
        One line: file and run, column, rule, value, remedy.
    """
    if isinstance(source, str | PathLike):
        given = with_columns(map_of(log_map), columns)
        name, log = name or _stem(Path(source)), given.opened(source)
        return _judged(log, name, given, run=run, dt=dt, check=check)
    name = name or "recording"
    try:
        given = with_columns(map_of(log_map), columns)
        clock, mend, rate = (given.clock, given.clock_unit), given.order == MEND, given.rate or 0.0
        log = open_arrays(name, source, *clock, mend=mend, rate=rate)
        read = _judged(log, name, replace(given, clock=""), run=run, dt=dt, check=check)
    except RecordingError as error:
        raise RecordingError(_in_python(str(error))) from None
    return replace(read, notes=tuple(map(_in_python, read.notes)))


def _in_python(text: str) -> str:
    """Return a text with the options of commands as arguments of `read_recording`."""

    def written(options: re.Match[str]) -> str:
        pairs = re.findall(r'"([^"=]+)=([^"]+)"', options[0])
        return "columns={" + ", ".join(f'"{a}": "{b}"' for a, b in pairs) + "}"

    text = re.sub(r'--columns( "[^"=]+=[^"]+")+', written, text).replace("--columns", "columns")
    return re.sub("--cut-holes, |tireid doctor LOG --vehicle FILE, or ", "", text)


def read_repaired(
    path: str | Path,
    vehicle: Vehicle,
    run: str | None = None,
    dt: float = _DT,
    *,
    check: bool = True,
    columns: Mapping[str, str] = _NO_NAMES,
    log_map: _GivenMap = None,
) -> tuple[Recording, Vehicle]:
    """Read one run of a log and take out what the map's repair says, of the log and of the car.

    Parameters
    ----------
    run, dt : as of `read_recording`.
    check : whether what contradicts physics or the car, after the repair, is refused.
    columns, log_map : as of `read_recording`.
    """
    given = with_columns(map_of(log_map), columns)
    given = replace(given, wheels=given.wheels.completed(given.repair.on(vehicle)))
    judged = check and not given.repair
    recording = read_recording(path, run, dt, check=judged, log_map=given)
    if given.repair:
        recording, vehicle = given.repair.apply(recording, vehicle)
        note = f"repaired by the map: {repair_text(given.repair)}"
        recording = replace(recording, notes=(*recording.notes, note))
        if check:
            check_physics(recording)
    if check:
        check_against_vehicle(recording, vehicle)
    return recording, vehicle


def repair_text(repair: Repair) -> str:
    """Return a repair as words: each number with its name."""
    words = []
    for name, value in repair.tables().items():
        inner = value if isinstance(value, dict) else {"": value}
        words += [f"{name}{'.' * bool(key)}{key} = {one:.4g}" for key, one in inner.items()]
    return ", ".join(words)


def map_of(given: _GivenMap) -> LogMap:
    """Return a map that may be given as a path; an empty one where there is none.
    given : a map, the path of a log.toml, or None.
    """
    if given is None:
        return LogMap()
    return given if isinstance(given, LogMap) else LogMap.from_toml(given)


def with_columns(given: LogMap, columns: Mapping[str, str]) -> LogMap:
    """Return a map with columns that are given beside it; "t" is the time."""
    if not isinstance(columns, Mapping):
        raise RecordingError(
            f'columns must be a mapping as {{"r": "yaw_rate"}}, it is {displayed(columns)}'
        )
    signals = {name: words for name, words in columns.items() if name != "t"}
    given = given.with_signals(given_signals([f"{a}={b}" for a, b in signals.items()]))
    if "t" not in columns:
        return given
    clock = given_channel(columns["t"])
    return replace(given, clock=" + ".join(clock.channel), clock_unit=clock.unit, rate=None)


def _judged(
    log: LogFile, name: str, given: LogMap, *, run: str | None, dt: float, check: bool
) -> Recording:
    recording = recording_of(log, name, given, run=run, dt=dt)
    other = _lateral(log, recording, given, run)
    recording = replace(recording, notes=(*recording.notes, other)) if other else recording
    if check:
        try:
            # Repaired; of the car only its size counts, for noise.
            repair = replace(given.repair, vehicle={})
            check_physics(repair.apply(recording, sedan())[0] if given.repair else recording)
        except RecordingError as error:
            label = f"{log.path}{recording.name.removeprefix(name)}"
            said = str(error).removeprefix(recording.name) + f"; {other}" * bool(other)
            if not given.repair:
                said = _CHANGE.sub(lambda found: _declared(found, log, given, run), said)
            raise RecordingError(label + said) from None
    return recording


def _declared(found: re.Match[str], log: LogFile, given: LogMap, run: str | None) -> str:
    """Return how a sign is changed: with the word of --columns, where one can say it."""
    run = one_run(log.path, log.runs(), run or given.run or None)
    signals = chosen_signals(log, log.headings(), given, run).signals
    ours = signal_name(found[1]) or ""
    name = ours if ours in signals else INSTEAD.get(ours, "")
    one = signals.get(name)
    if one is None or one.table:
        return found[0]
    if one.ratio != 1.0:
        turned = replace(one, ratio=-one.ratio)
    else:
        turned = replace(one, factor=-one.factor, offset=-one.offset)
    return f"{found[0]} (--columns {declaration(name, turned)})"


def _lateral(log: LogFile, recording: Recording, given: LogMap, run: str | None) -> str:
    """Return which channel is the lateral acceleration where a_y is none; "" where it is one."""
    if abs(_turning(recording)[1]) > _UNLIKE:
        return ""
    for one in log.headings()[:_MOST_TRIED]:
        read = given.with_signals({"a_y": Signal(channel=(one.name,))})
        with suppress(RecordingError):  # of a channel that is no acceleration
            slope, together = _turning(recording_of(log, "", read, run=run, dt=recording.dt))
            in_g = abs(slope) < 1.0 / 3.0
            if abs(together) > _ALIKE and 0.8 < abs(slope) * (9.81 if in_g else 1.0) < 1.25:
                words = f"{one.name}{' [g]' * in_g}{' *-1' * (slope < 0.0)}"
                said = f"ay does not go with vx r, {one.name} does (slope {slope:.3g})"
                return f'{said}: --columns "ay={words}", and ax likewise if they are exchanged'
    return ""


def _turning(recording: Recording) -> tuple[float, float]:
    """Return the slope of a_y on v_x r, and their correlation; 1 where nothing turns."""
    w = windows(recording)
    if w.a_y is None or not w.r.size:
        return 1.0, 1.0
    both = pair(w.v_x_r, w.a_y)
    slope = float(least_squares(w.v_x_r[:, None], w.a_y).theta[0])
    return slope, both.correlation if both.seconds >= 2.0 else 1.0


def runs(path: str | Path) -> list[str]:
    """List the runs of a log in their order; empty when it has none apart."""
    return list(open_log(path).runs())


def split_log_argument(argument: str) -> tuple[Path, str | None]:
    r"""Split "LOG:RUN" into file and run; a colon inside the path or after a drive stays.

    The whole argument wins when a file has that name. Else the split is after the ending of a log
    and a colon, so that runs and folders may hold colons too.

    argument : what was typed, for example "log.csv.gz:lap2" or "C:\logs\log.csv:lap2".
    """
    if Path(argument).is_file():
        return Path(argument), None
    splits = [k for k, letter in enumerate(argument) if letter == ":" and k != 1]
    for k in splits:
        if argument[:k].lower().endswith(ENDINGS) and argument[k + 1 :]:
            return Path(argument[:k]), argument[k + 1 :]
    return Path(argument), None


def _stem(path: Path) -> str:
    """File name without folder and known endings."""
    for ending in sorted(ENDINGS, key=len, reverse=True):
        if path.name.lower().endswith(ending):
            return path.name[: -len(ending)]
    return path.name
