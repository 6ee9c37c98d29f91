"""The fork server: one warm process that forks for every case and limits what the fork may take.

What takes long, imports and compiled steps, is done once. A fork has its own working folder, limits
of memory, of processor time and of time, and tells what it saw in a file of notes: numbers that
were not finite before they were written, and the stiffness of what was frozen.
"""

import contextlib
import csv
import faulthandler
import json
import os
import resource
import select
import signal
import sys
import time
import traceback
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import numpy as np
from matplotlib.figure import Figure

import tireid.cli
import tireid.output
from codegen.arrays import Array
from identifier.tire_model import TireModel, load_model
from models.recordings import Recording
from tireid.figures import style

MEMORY = 3 << 30  # more than the warm process has [bytes]
CPU = 20  # s
WALL = 20.0  # s on a machine that has a core for it, or twice that
SILENCE = 10.0  # s without a word of how far it came: whoever waits believes that it hangs
FILE = 200 << 20  # bytes
CRASHED = 70  # exit code of a fork that ended by an exception


class Ended(NamedTuple):
    """How a case ended: exit code (negative: its signal), output, notes, processor time [s].

    A case that was stopped at its limit hung if nothing was heard of it any more.
    """

    code: int
    out: str
    err: str
    trace: str
    notes: Mapping[str, Any]
    cpu: float
    stopped: bool
    hung: bool


def run(words: Sequence[str], folder: Path, *, aside: Path, drawn: bool) -> Ended:
    """Run a command in a fork.

    Parameters
    ----------
    words : of the command.
    folder : its working folder.
    aside : folder for its output and notes.
    drawn : whether figures are put on paper.
    """
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    child = os.fork()
    if child == 0:
        _child(list(words), folder, aside, drawn)
    handle = os.pidfd_open(child)
    try:
        poll = select.poll()
        poll.register(handle, select.POLLIN)
        late = not poll.poll(1e3 * patience())
        if late:
            os.killpg(child, signal.SIGKILL)
        _, status, usage = os.wait4(child, 0)
        with contextlib.suppress(ProcessLookupError):
            os.killpg(child, signal.SIGKILL)  # what it began and did not wait for
    finally:
        os.close(handle)
    code = os.waitstatus_to_exitcode(status)
    spent = usage.ru_utime + usage.ru_stime
    # Telling the stack at the limit, in the midst of anything, may itself end in a signal.
    stopped = late or code == -signal.SIGXCPU or (code < 0 and spent >= CPU)
    silent = time.time() - (aside / "stderr").stat().st_mtime
    out, err, trace = (_read(aside / name) for name in ("stdout", "stderr", "trace"))
    return Ended(
        code,
        out,
        err,
        trace,
        _notes(aside / "notes"),
        spent,
        stopped,
        stopped and silent > SILENCE,
    )


def patience() -> float:
    """Return how long a case may last by the clock, beside the other work of this machine [s]."""
    return WALL * max(2.0, 2.0 * os.getloadavg()[0] / (os.cpu_count() or 1))


def _read(path: Path) -> str:
    with path.open("rb") as file:  # its beginning, and its end, where a traceback ends
        size = path.stat().st_size
        head = file.read(100_000)
        file.seek(max(size - 100_000, len(head)))
        return (head + file.read()).decode("utf-8", "surrogateescape")


def _notes(path: Path) -> dict[str, Any]:
    if not path.exists():
        return {}
    told: dict[str, Any] = {}
    for line in path.read_text(encoding="utf-8").splitlines():
        with contextlib.suppress(ValueError):  # cut off where it was killed
            told.update(json.loads(line))
    return told


def _child(words: list[str], folder: Path, aside: Path, drawn: bool) -> NoReturn:
    """Run the command as a process of its own would, and end."""
    code = CRASHED
    try:
        os.setsid()
        for number, name in ((1, "stdout"), (2, "stderr")):
            os.dup2(os.open(aside / name, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), number)
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        sys.stdout, sys.stderr = (os.fdopen(number, "w", closefd=False) for number in (1, 2))
        os.chdir(folder)
        trace = (aside / "trace").open("w", encoding="utf-8")
        faulthandler.enable(trace)
        faulthandler.register(signal.SIGXCPU, trace, chain=True)
        faulthandler.dump_traceback_later(patience() - 2.0, file=trace)
        notes = (aside / "notes").open("w", encoding="utf-8")
        warnings.resetwarnings()  # as a process of its own has them
        _limit()
        _listen(lambda key, value: print(json.dumps({key: value}), file=notes, flush=True))
        with contextlib.nullcontext() if drawn else undrawn():
            code = _entered(words)
        if code in (0, 1):
            print(json.dumps({"frozen": _frozen(folder)}), file=notes, flush=True)
    except BaseException:
        traceback.print_exc()
        code = CRASHED
    finally:
        with contextlib.suppress(BaseException):
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(code)


def _no_paper(figure: Figure, *, resolution: int = 0) -> bytes:
    del figure, resolution
    return b"\x89PNG\r\n\x1a\n"


@contextlib.contextmanager
def undrawn() -> Iterator[None]:
    """Make figures as ever, but do not put them on paper, which takes longest."""
    paper, style.figure_png = style.figure_png, _no_paper
    try:
        yield
    finally:
        style.figure_png = paper


def _entered(words: list[str]) -> int:
    sys.argv = ["tireid", *words]
    try:
        tireid.cli.entry()
    except SystemExit as ended:
        return ended.code if isinstance(ended.code, int) else int(ended.code is not None)


def _limit() -> None:
    pages = int(Path("/proc/self/statm").read_text(encoding="utf-8").split()[0])
    memory = pages * resource.getpagesize() + MEMORY
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    resource.setrlimit(resource.RLIMIT_CPU, (CPU, CPU + 5))
    resource.setrlimit(resource.RLIMIT_FSIZE, (FILE, FILE))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _listen(note: Callable[[str, Any], None]) -> None:
    """Note where a number in a JSON file was not finite: what is written is null."""
    clean = tireid.output.finite

    def listened(data: Any) -> Any:
        found = sorted(set(_not_finite(data, "")))
        if found:
            note("not finite", found[:20])
        return clean(data)

    tireid.output.write_json.__globals__["finite"] = listened


def _not_finite(data: Any, place: str) -> list[str]:
    if isinstance(data, Mapping):
        return [one for key in data for one in _not_finite(data[key], f"{place}/{key}")]
    if isinstance(data, list | tuple):
        return [one for item in data for one in _not_finite(item, place)]
    if isinstance(data, float | np.floating) and not np.isfinite(data):
        return [place]
    return []


def _frozen(folder: Path) -> dict[str, list[float]]:
    """Return by frozen model that was written: stiffness of both axles over the linear ones."""
    return {path.name: stiffness_shares(path) for path in sorted(folder.glob("out/weights*.json"))}


def stiffness_shares(path: Path) -> list[float]:
    """Return the stiffness of both axles of a frozen model, each over that of its linear tire.

    Parameters
    ----------
    path : the model, as a command wrote it; beside it the forces of the drive, at whose speed the
        axles are asked.
    """
    model, forces = load_model(path), path.with_name("forces.csv")
    speed = SPEED
    if forces.is_file():
        with forces.open(encoding="utf-8", newline="") as file:
            driven = [float(row["v_x_m_s"]) for row in csv.DictReader(file)]
        speed = float(np.mean([v_x for v_x in driven if v_x >= model.min_speed]))
    car = model.vehicle
    linear = np.array([car.cornering_stiffness_front, car.cornering_stiffness_rear])
    return [float(one) for one in steady_stiffness(model, speed) / linear]


SPEED = 20.0  # m/s of an axle that is asked, where no drive is known
SLIP = 0.02  # rad, below the peak of every tire
SLIDE = 300  # samples of 10 ms: after them a lag of the force is over


def steady_stiffness(model: TireModel, v_x: float) -> Array:
    """Return the slope of both axle forces over slip between two steady slides, (2,) [N/rad].

    Parameters
    ----------
    v_x : speed of the slides [m/s], without yawing or steering.
    """
    t, zeros = np.arange(SLIDE) / 100.0, np.zeros(SLIDE)
    right, left = (
        model.predict(
            Recording(
                name="a steady slide",
                t=t,
                v_x=np.full(SLIDE, v_x),
                v_y=np.full(SLIDE, -v_x * np.tan(alpha)),
                r=zeros,
                delta_f=zeros,
                delta_r=zeros,
            )
        )[-1]
        for alpha in (-SLIP, SLIP)
    )
    return np.asarray((left - right) / (2.0 * SLIP))


def only_compiler(folder: Path) -> None:
    """Let PATH hold the compiler alone: costs on boards, which take long, are not measured.

    Parameters
    ----------
    folder : which becomes PATH.
    """
    import shutil

    folder.mkdir(parents=True, exist_ok=True)
    for tool in ("gcc", "cc", "as", "ld", "collect2"):
        found = shutil.which(tool)
        if found and not (folder / tool).exists():
            (folder / tool).symlink_to(Path(found).resolve())
    os.environ["PATH"] = str(folder)
