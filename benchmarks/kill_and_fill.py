"""Runs that are killed, that find the disk full, and that write one folder at once: what is lost?

`tireid export DIR --force` is run again and again, each time in a process of its own: killed at a
random moment, half of the time around the final rename; with a limit on the size of files, and on
a disk that is too small; twenty times at once. After each the folder must be whole, the old one or
the new one, with the user's files beside it, and what was said must be one clear line.

    python -m benchmarks.kill_and_fill [KILLS] [--record]
"""

import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

from benchmarks.targets import Targets, keeps
from codegen import find_compiler
from tireid.cli import main as tireid
from tireid.output import MARKER, foreign

KILLS, RUNS = 200, 20
SIZES = (0, 1, 100, 1000, 4096, 8192, 20_000)  # of a file [bytes]
PAGES, SPARE = 200, 24  # of the small disk, and of those the most that are left of it
SEED = 7
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
    """

    def __init__(self, words: list[str], limit: int | None = None) -> None:
        self._said, says = os.pipe()
        self.child = os.fork()
        if self.child:
            os.close(says)
            return
        code = 70
        try:
            os.dup2(says, 1)
            os.dup2(says, 2)
            os.environ["PATH"] = ""  # no compilers for boards: nothing is measured on them
            if limit is not None:
                resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
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


class Bench:
    """A folder with the user's files and `out`, which runs replace."""

    def __init__(self, place: Path) -> None:
        self.place, self.out = place, place / "out"
        for name, text in NOTES.items():
            (place / name).parent.mkdir(parents=True, exist_ok=True)
            (place / name).write_text(text)

    def words(self, name: str) -> list[str]:
        """Return the command, whose package has another name each time."""
        return ["export", str(self.out), "--paper", "--force", "--name", name]

    def lost(self) -> str:
        """Return what of the user's or of the last whole folder is not there; nothing if all is."""
        for name, text in NOTES.items():
            if not (self.place / name).is_file() or (self.place / name).read_text() != text:
                return name
        if not (self.out / MARKER).is_file():
            return "out"
        return f"out/{foreign(self.out)}" if foreign(self.out) else ""

    def left(self) -> list[Path]:
        """Return the scratch folders that lie beside the folder."""
        return sorted(self.place.glob(".out-*.part"))


def kill(bench: Bench, count: int, rng: random.Random) -> dict[str, int]:
    """Kill runs; return how many lost something, and at which stage they were."""
    start = time.perf_counter()
    assert Run(bench.words("first")).end().code == 0
    lasts = time.perf_counter() - start
    seen = dict.fromkeys(("lost", "unsaid", "before", "writing", "at the rename", "after"), 0)
    for number in range(count):
        was = (bench.out / MARKER).stat().st_ino
        run = Run(bench.words(f"run{number}"))
        if number % 2:  # around the rename: from the marker on, which is written last
            while not any((path / "new" / MARKER).exists() for path in bench.left()):
                if (bench.out / MARKER).stat().st_ino != was:
                    break
            time.sleep(rng.uniform(0.0, 0.01))
        else:
            time.sleep(rng.uniform(0.0, 1.1 * lasts))
        run.kill()
        run.end()
        left = bench.left()
        replaced = (bench.out / MARKER).is_file() and (bench.out / MARKER).stat().st_ino != was
        if replaced:
            seen["after"] += 1
        elif not left:
            seen["before"] += 1
        else:
            last = any((path / "new" / MARKER).exists() for path in left)
            seen["at the rename" if last else "writing"] += 1
        seen["lost"] += bool(bench.lost())
        if left and number % 10 == 0:  # the next run says what the last one left
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
    for _ in SIZES:
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
    find_compiler()
    with tempfile.TemporaryDirectory() as scratch:
        place = Path(scratch)
        bench = Bench(place / "killed")
        seen = kill(bench, count, rng)
        print(f"{count} runs killed: " + ", ".join(f"{n} {where}" for where, n in seen.items()))
        targets.at_most("killed: lost or partial", seen["lost"], 0, "", key="killed/lost")
        targets.at_most("killed: scratch not said", seen["unsaid"], 0, "", key="killed/unsaid")
        targets.record("killed/runs", count)
        for stage in ("before", "writing", "at the rename", "after"):
            targets.record(f"killed/{stage.replace(' ', '_')}", seen[stage])
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
