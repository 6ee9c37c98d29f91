"""Runs that are killed, that find the disk full, and that write one folder at once: what is lost?

`tireid export --force` is run again and again, each time in a process of its own that starts
warm: killed at a random moment of its time, or before a random one of the system calls by which it
writes, or by which it renames and tidies up, which no load of the machine can hide; with a limit on
the size of files, and on a disk that is too small; twenty times at once. After each the folder must
be whole, the old one or the new one, with the user's files beside it; where there was none, whole
or not there; and what was said must be one clear line.

    python -m benchmarks.kill_and_fill [KILLS] [--record]
"""

import hashlib
import io
import json
import mmap
import os
import random
import resource
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import time
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import NamedTuple

from benchmarks.targets import Targets, keeps
from codegen import find_compiler
from tireid.cli import main as tireid
from tireid.output import MARKER

KILLS, RUNS = 200, 20
SIZES = (0, 1, 100, 1000, 4096, 8192, 20_000)  # of a file [bytes]
DISKS = 20
PAGES, SPARE = 200, 24  # of the small disk, and of those the most that are left of it
SEED = 7
NOTHING_THERE = 4  # of so many runs one finds no folder in its way
AUDITED = ("open", "os.", "ctypes.", "shutil.")  # of Python, before it asks the system
STAGES = ("before", "writing", "written", "renamed", "after")
NOTES = {"notes.txt": "beside", "old/data.csv": "1,2,3"}  # of the user


class Ended(NamedTuple):
    """How a run ended: exit code (negative: the signal), what it said, and what of it is wrong."""

    code: int
    said: str

    @property
    def clear(self) -> bool:
        """Whether it failed with one line that says why."""
        wrong = [line for line in self.said.splitlines() if "error" in line or "Trace" in line]
        return self.code == 2 and len(wrong) == 1 and wrong[0].startswith("tireid export: error: ")


class Run:
    """A run in a process of its own.

    Parameters
    ----------
    words : of the command.
    limit : on the size of a file that it writes [bytes]; None for none.
    steps : counts those of its writing, and may kill it at one of them.
    """

    def __init__(
        self, words: list[str], limit: int | None = None, steps: "Steps | None" = None
    ) -> None:
        self._said, says = os.pipe()
        self.child = os.fork()
        if self.child:
            os.close(says)
            return
        code = 70
        try:
            os.dup2(says, 1)
            os.dup2(says, 2)
            sys.stdout = os.fdopen(1, "w", buffering=1, closefd=False)  # nothing of the parent's
            sys.stderr = os.fdopen(2, "w", buffering=1, closefd=False)
            os.environ["PATH"] = ""  # no compilers for boards: nothing is measured on them
            if limit is not None:
                resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
            if steps is not None:
                sys.addaudithook(steps.hook)
            code = tireid(words)
        finally:
            os._exit(code)

    def kill(self) -> None:
        """End it at once."""
        os.kill(self.child, signal.SIGKILL)

    def end(self) -> Ended:
        """Wait for it."""
        with os.fdopen(self._said, errors="replace") as said:
            text = said.read()
        return Ended(os.waitstatus_to_exitcode(os.waitpid(self.child, 0)[1]), text)


class Steps:
    """Counts what a run asks of the system from its scratch folder on.

    Parameters
    ----------
    kill_at : the step before which the run is killed; 0 for none.
    """

    def __init__(self, kill_at: int = 0) -> None:
        self._kill_at = kill_at
        self._shared = mmap.mmap(-1, 8)  # which a child shares with its parent

    @property
    def count(self) -> int:
        """How many there were."""
        return int(struct.unpack_from("<i", self._shared, 0)[0])

    @property
    def marker(self) -> int:
        """At which of them the marker was opened, the last file that is written."""
        return int(struct.unpack_from("<i", self._shared, 4)[0])

    def hook(self, event: str, args: tuple[object, ...]) -> None:
        """Take a step; see `sys.addaudithook`."""
        begins = event == "tempfile.mkdtemp" and str(args[0]).endswith(".part")
        if not begins and not (self.count and event.startswith(AUDITED)):
            return
        struct.pack_into("<i", self._shared, 0, self.count + 1)
        if event == "open" and str(args[0]).endswith(MARKER) and not self.marker:
            struct.pack_into("<i", self._shared, 4, self.count)
        if self.count == self._kill_at:
            os.kill(os.getpid(), signal.SIGKILL)


class Bench:
    """A folder with the user's files and `out`, which runs replace."""

    def __init__(self, place: Path) -> None:
        self.place, self.out = place, place / "out"
        for name, text in NOTES.items():
            (place / name).parent.mkdir(parents=True, exist_ok=True)
            (place / name).write_text(text, encoding="utf-8")

    def words(self, name: str) -> list[str]:
        """Return the command, whose package has another name each time."""
        return ["export", "--out", str(self.out), "--paper", "--force", "--name", name]

    def clear(self) -> None:
        """Delete the folder."""
        shutil.rmtree(self.out)

    def lost(self, *, nothing_there: bool = False) -> str:
        """Return what of the user's or of a whole folder is not there; nothing if all is.

        Parameters
        ----------
        nothing_there : whether there may be no folder.
        """
        for name, text in NOTES.items():
            if (
                not (self.place / name).is_file()
                or (self.place / name).read_text(encoding="utf-8") != text
            ):
                return name
        if nothing_there and not self.out.exists():
            return ""
        return partial(self.out)

    def left(self) -> list[Path]:
        """Return the scratch folders that lie beside the folder."""
        return sorted(self.place.glob(".out-*.part"))

    @property
    def number(self) -> int:
        """What tells one folder from the next; 0 where there is none."""
        try:
            return (self.out / MARKER).stat().st_ino
        except FileNotFoundError:
            return 0

    def stage(self, was: int) -> str:
        """Return how far a run is, of `STAGES`.

        Parameters
        ----------
        was : number of the folder before it.
        """
        replaced, left = self.number not in (was, 0), self.left()
        if replaced:
            return "renamed" if left else "after"
        if not left:
            return "before"
        return "written" if any((path / "new" / MARKER).exists() for path in left) else "writing"


def partial(folder: Path) -> str:
    """Return a file that a folder should hold or should not; nothing where it is whole.

    Parameters
    ----------
    folder : any.
    """
    try:
        listed = json.loads((folder / MARKER).read_text(encoding="utf-8"))["files"]
    except (OSError, ValueError):
        return str(folder / MARKER)
    there = {
        path.relative_to(folder).as_posix(): path for path in folder.rglob("*") if path.is_file()
    }
    if set(there) != {*listed, MARKER}:
        return str(folder / min(set(there) ^ {*listed, MARKER}))
    for name, (size, digest) in listed.items():
        content = there[name].read_bytes()
        if len(content) != size or hashlib.sha256(content).hexdigest() != digest:
            return str(there[name])
    return ""


def warm(place: Path) -> None:
    """Run the command once in this process: those forked from it find its caches filled."""
    find_compiler()
    path, os.environ["PATH"] = os.environ["PATH"], ""
    try:
        with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
            code = tireid(Bench(place / "warm").words("warm"))
    finally:
        os.environ["PATH"] = path
    if code != 0:
        raise RuntimeError(f"the command ends with {code} before anything is done to it")


def kill(bench: Bench, count: int, rng: random.Random) -> dict[str, int]:
    """Kill runs; return how many lost something, and at which stage they were."""
    lasts, steps = 0.0, Steps()
    for name in ("first", "second"):
        start, steps = time.perf_counter(), Steps()
        code, said = Run(bench.words(name), steps=steps).end()
        lasts = time.perf_counter() - start
        if code != 0:
            raise RuntimeError(f"a run fails before anything is done to it: {said}")
    print(f"a run takes {lasts:.2f} s and {steps.marker} + {steps.count - steps.marker} steps")
    seen = dict.fromkeys(("lost", "unsaid", *STAGES), 0)
    for number in range(count):
        nothing_there = number % NOTHING_THERE == NOTHING_THERE - 1
        if nothing_there:
            bench.clear()
        was = bench.number
        words = bench.words(f"run{number}")
        match rng.randrange(3):
            case 0:
                run = Run(words)
                time.sleep(rng.uniform(0.0, lasts))
                run.kill()
            case 1:
                run = Run(words, steps=Steps(rng.randint(1, steps.marker)))
            case _:
                run = Run(words, steps=Steps(rng.randint(steps.marker + 1, steps.count)))
        run.end()
        seen[bench.stage(was)] += 1
        lost = bench.lost(nothing_there=nothing_there)
        seen["lost"] += bool(lost)
        if lost:
            print(f"run {number} lost {lost}", flush=True)
        left = bench.left()
        if left or not bench.out.exists():  # the next run says what the last one left
            code, said = Run(bench.words("after")).end()
            seen["unsaid"] += code != 0 or not all(str(path) in said for path in left)
        for path in left:
            shutil.rmtree(path)
    return seen


def fill(bench: Bench) -> tuple[int, int]:
    """Run into limits of files; return how many lost something, and were not clear."""
    ends = []
    lost = 0
    for size in SIZES:
        ends.append(Run(bench.words(f"size{size}"), size).end())
        lost += bool(bench.lost()) or bool(bench.left())
    return lost, sum(not end.clear for end in ends)


def fill_disk(place: Path, rng: random.Random) -> tuple[int, int] | None:
    """Run on small disks that fill; None where this user may not mount one."""
    disk = place / "disk"
    disk.mkdir()
    lost = unclear = 0
    mount = ["mount", "-t", "tmpfs", "-o", f"size={4096 * PAGES}", "tmpfs", str(disk)]
    for _ in range(DISKS):
        if subprocess.run(mount, capture_output=True, check=False).returncode != 0:
            return None
        try:
            bench = Bench(disk / "work")
            assert Run(bench.words("first")).end().code == 0
            filling = max(os.statvfs(disk).f_bavail - rng.randrange(1, SPARE), 0)
            with (disk / "filler").open("wb") as filler:
                filler.write(b"x" * (4096 * filling))
            end = Run(bench.words("second")).end()
            unclear += not (end.clear and "no space left" in end.said)
            lost += bool(bench.lost()) or bool(bench.left())
        finally:
            subprocess.run(["umount", str(disk)], check=True)
    return lost, unclear


def crowd(bench: Bench) -> tuple[int, int, int]:
    """Let many runs write one folder that is not there; return winners, not clear, lost."""
    words = [word for word in bench.words("crowd") if word != "--force"]
    runs = [Run(words) for _ in range(RUNS)]
    ends = [run.end() for run in runs]
    winners = sum(end.code == 0 for end in ends)
    unclear = sum(not end.clear for end in ends if end.code != 0)
    return winners, unclear, bool(bench.lost()) + len(bench.left())


def main() -> int:
    """Print and record what was lost; return 1 where anything was."""
    keep = keeps()
    count = int(sys.argv[1]) if len(sys.argv) > 1 else KILLS
    targets, rng = Targets("kill_and_fill"), random.Random(SEED)
    with tempfile.TemporaryDirectory() as scratch:
        place = Path(scratch)
        warm(place)
        bench = Bench(place / "killed")
        seen = kill(bench, count, rng)
        print(f"{count} runs killed: " + ", ".join(f"{n} {where}" for where, n in seen.items()))
        targets.at_most("killed: lost or partial", seen["lost"], 0, "", key="killed/lost")
        targets.at_most("killed: scratch not said", seen["unsaid"], 0, "", key="killed/unsaid")
        targets.record("killed/runs", count)
        for stage in STAGES:
            targets.record(f"killed/{stage}", seen[stage])
        around = seen["written"] + seen["renamed"]
        targets.at_least("killed around the rename, of the runs", around / count, 0.2, "")
        lost, unclear = fill(bench)
        targets.at_most("files limited: lost or partial", lost, 0, "", key="limited/lost")
        targets.at_most("files limited: not one line", unclear, 0, "", key="limited/unclear")
        full = fill_disk(place, rng)
        if full is None:
            print("  this user may not mount a small disk: not tried")
        else:
            targets.at_most("disk full: lost or partial", full[0], 0, "", key="full_disk/lost")
            targets.at_most("disk full: not one line", full[1], 0, "", key="full_disk/unclear")
        winners, unclear, lost = crowd(Bench(place / "crowd"))
        targets.at_most("20 at once: winners", winners, 1, "", key="crowd/winners")
        targets.at_least("20 at once: winners", winners, 1, "")
        targets.at_most("20 at once: not one line", unclear, 0, "", key="crowd/unclear")
        targets.at_most("20 at once: lost or partial", lost, 0, "", key="crowd/lost")
    return targets.finish(keep=keep)


if __name__ == "__main__":
    sys.exit(main())
