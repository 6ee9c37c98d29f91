"""From a log file to a Recording: one run, rising time, finite values, uniform grid, physics."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from models.doors import require_few, shown
from models.recordings.checks import check_physics
from models.recordings.record import LARGEST, MINIMUM_SAMPLES, Array, Recording, RecordingError
from models.recordings.resampling import resample
from models.recordings.table import ENDINGS, NO_NAMES, Table, read_table

FIELDS = {"vx": "v_x", "vy": "v_y", "ay": "a_y", "Fyf": "axle_force", "Fyr": "axle_force"}
SOME = 30  # names in a message
LONGEST_GAP = 0.1  # [s]: a car can build up or lose all its lateral force meanwhile


def read_recording(
    path: str | Path,
    run: str | None = None,
    dt: float = 0.01,
    *,
    check: bool = True,
    columns: Mapping[str, str] = NO_NAMES,
) -> Recording:
    """Read one run of a log and bring it to a uniform sample time.

    Columns, SI and ISO axes: t [s], vx, vy [m/s], r [rad/s], delta_f [rad]; if present also
    delta_r [rad] (else 0), ay [m/s^2], Fyf and Fyr [N], run (text). Others are ignored. Where
    there are no Fyf and Fyr, the columns Fyf_inv and Fyr_inv (forces computed backwards from the
    motion) stand in for them.

    Parameters
    ----------
    path : a .csv, .csv.gz or .parquet file.
    run : name of the run; may be left out when the file has only one.
    dt : sample time T_s of the result [s].
    check : whether to judge signs, axes and units by physics; turn it off for a log that is right
        and refused all the same.
    columns : by our name of a column, the name that it has in this file, where they differ.

    Returns
    -------
    Recording
        Named "FILE:RUN", or "FILE" when there is no run column.

    Raises
    ------
    RecordingError
        One line: file and run, column, rule, value, remedy.
    """
    path = Path(path)
    _require_positive(str(path), dt)
    table = read_table(path, columns=columns)
    return recording_from_table(str(path), _stem(path), table, run=run, dt=dt, check=check)


def recording_from_table(
    source: str, name: str, table: Table, *, run: str | None, dt: float, check: bool
) -> Recording:
    """Return one run of a table, judged and brought to a uniform sample time.

    Parameters
    ----------
    source : where the table is from, for messages.
    name : of the recording, without its run.
    table : columns as they came.
    run : name of the run; None where there is only one.
    dt : sample time T_s of the result [s].
    check : whether to judge signs, axes and units by physics.

    Raises
    ------
    RecordingError
        One line: source and run, column, rule, value, remedy.
    """
    _require_positive(source, dt)
    table, run = _one_run(source, table, run)
    label = source if run is None else f"{source}:{run}"
    _check_values(label, table)
    _check_time(label, table)
    steps = (table.columns["t"][-1] - table.columns["t"][0]) / dt
    require_few(RecordingError, label, steps, "samples", f"steps of {dt:g} s")
    signals = dict(table.columns)
    t, signals = resample(signals.pop("t"), signals, dt)
    if t.size < MINIMUM_SAMPLES:
        raise RecordingError(
            f"{label}: the run lasts {t[-1] - t[0]:.4g} s, at least {MINIMUM_SAMPLES} steps of "
            f"{dt:g} s are needed"
        )
    force = np.column_stack([signals["Fyf"], signals["Fyr"]]) if "Fyf" in signals else None
    recording = Recording(
        name=name if run is None else f"{name}:{run}",
        t=t,
        v_x=signals["vx"],
        v_y=signals["vy"],
        r=signals["r"],
        delta_f=signals["delta_f"],
        delta_r=signals.get("delta_r", np.zeros(t.size)),
        a_y=signals.get("ay"),
        axle_force=force,
    )
    if check:
        try:
            check_physics(recording)
        except RecordingError as error:
            raise RecordingError(label + str(error).removeprefix(recording.name)) from None
    return recording


def runs(path: str | Path) -> list[str]:
    """List the runs of a log in their order; empty when it has no run column.

    Parameters
    ----------
    path : a .csv, .csv.gz or .parquet file.
    """
    run = read_table(Path(path), only_runs=True).run
    return [] if run is None else list(dict.fromkeys(run.tolist()))


def split_log_argument(argument: str) -> tuple[Path, str | None]:
    r"""Split "LOG:RUN" into file and run; a colon inside the path or after a drive stays.

    The whole argument wins when a file has that name. Else the split is after ".csv", ".csv.gz"
    or ".parquet" and a colon, so that runs and folders may hold colons too.

    Parameters
    ----------
    argument : what was typed, for example "log.csv.gz:lap2" or "C:\logs\log.csv:lap2".
    """
    if Path(argument).is_file():
        return Path(argument), None
    splits = [k for k, letter in enumerate(argument) if letter == ":" and k != 1]
    for k in splits:
        if argument[:k].lower().endswith(ENDINGS) and argument[k + 1 :]:
            return Path(argument[:k]), argument[k + 1 :]
    return Path(argument), None


def _require_positive(source: str, dt: float) -> None:
    if not (np.isfinite(dt) and dt > 0.0):
        raise RecordingError(f"{source}: the sample time dt must be positive, it is {dt}")


def _stem(path: Path) -> str:
    """File name without folder and known endings."""
    for ending in sorted(ENDINGS, key=len, reverse=True):
        if path.name.lower().endswith(ending):
            return path.name[: -len(ending)]
    return path.name


def _one_run(path: str, table: Table, run: str | None) -> tuple[Table, str | None]:
    """Keep the rows of the named run, or of the only one."""
    if table.run is None:
        if run is not None:
            raise RecordingError(f"{path}: there is no column run, so no run {run!r}; leave it out")
        return table, None
    names = list(dict.fromkeys(table.run.tolist()))
    if run is None and len(names) > 1:
        raise RecordingError(f"{path}: name one of its runs: {_some(names)}")
    if run is not None and run not in names:
        raise RecordingError(f"{path}: there is no run {shown(run)}, the runs are: {_some(names)}")
    run = names[0] if run is None else run
    keep = table.run == run
    columns = {name: value[keep] for name, value in table.columns.items()}
    return Table(columns, None, table.row[keep], table.unit), run


def _some(names: list[str]) -> str:
    """Return names, or the first of many."""
    return ", ".join(names[:SOME]) + (f", ... ({len(names)})" if len(names) > SOME else "")


def _check_values(label: str, table: Table) -> None:
    """Refuse NaN, infinity, empty cells, and sizes that no computation is asked to bear."""
    for name, value in table.columns.items():
        bad = np.flatnonzero(~np.isfinite(value))
        if bad.size:
            raise RecordingError(
                f"{label}: {name} must be finite, {bad.size} of {value.size} values are empty, NaN "
                f"or infinite, the first in {table.unit} {table.row[bad[0]]}; fill or cut them out"
            )
        most = LARGEST[FIELDS.get(name, name)]
        bad = np.flatnonzero(np.abs(value) > most)
        if bad.size:
            raise RecordingError(
                f"{label}: {name} must be of a car, within +-{most:g}, {table.unit} "
                f"{table.row[bad[0]]} has {value[bad[0]]:.4g}"
            )


def _check_time(label: str, table: Table) -> None:
    """Refuse time that does not rise, is not in seconds, is too coarse, or has gaps."""
    t: Array = table.columns["t"]
    if t.size < MINIMUM_SAMPLES:
        raise RecordingError(f"{label}: there are {t.size} rows, at least {MINIMUM_SAMPLES} needed")
    steps = np.diff(t)
    back = np.flatnonzero(~(steps > 0.0))
    if back.size:
        k = back[0]
        raise RecordingError(
            f"{label}: t must increase, {table.unit} {table.row[k + 1]} has {t[k + 1]:.9g} after "
            f"{t[k]:.9g}; several runs in one file need a column run"
        )
    typical = float(np.median(steps))
    limit = LONGEST_GAP * (1.0 + 1e-6)
    if typical > limit:
        raise RecordingError(
            f"{label}: t must be in s with at least 10 samples per second, its typical step is "
            f"{typical:.6g}" + ("; milliseconds? divide by 1000" if typical >= 1.0 else "")
        )
    longest = int(np.argmax(steps))
    if steps[longest] > max(limit, 2.5 * typical):
        raise RecordingError(
            f"{label}: t has a gap of {steps[longest]:.4g} s after {t[longest]:.6g} s "
            f"({table.unit} {table.row[longest + 1]}), above {max(limit, 2.5 * typical):.3g} s; "
            "cut the log into runs there"
        )
