"""A run of many cases: warm the process, run each in a fork, keep the smallest of what is found."""

import io
import os
import shlex
import shutil
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import redirect_stderr, redirect_stdout
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple

from benchmarks.fuzz import server
from benchmarks.fuzz.cases import Case, clear, draw, lay_out
from benchmarks.fuzz.doors import Door
from benchmarks.fuzz.judge import Finding, files_of, judge, writable
from benchmarks.fuzz.seeds import write_seeds
from tireid.cli import main as tireid

CHUNK = 4  # cases that a worker takes at once


class Outcome(NamedTuple):
    """How a case ended: door, exit code, findings, words, processor time [s]."""

    number: int
    seed: int
    door: str
    code: int
    findings: list[Finding]
    words: list[str]
    cpu: float
    said: str


class BrokenDoorError(RuntimeError):
    """A door fails where all of its input is right."""


class Session(NamedTuple):
    """A warm process.

    Parameters
    ----------
    place : folder of the run.
    seeds : files that are right, by name.
    allowed : by door, what it shows where all of its input is right.
    began : clock at the start [s].
    """

    place: Path
    seeds: Mapping[str, bytes]
    allowed: Mapping[str, frozenset[str]]
    began: float

    @classmethod
    def begin(cls, place: Path, doors: Iterable[Door]) -> "Session":
        """Write the seeds, and go through every door once with all input right.

        Parameters
        ----------
        place : folder of the run.
        doors : the commands.

        Raises
        ------
        BrokenDoorError
            Where a door fails then: nothing can be said of what is mutated.
        """
        began = time.perf_counter()
        os.environ.setdefault("TIREID_CACHE", str(place / "cache"))
        (place / "cache").mkdir(mode=0o700, parents=True, exist_ok=True)
        server.only_compiler(place / "bin")
        doors = list(doors)
        needed = {name for door in doors for name in door.files}
        seeds = write_seeds(clear(place / "seeds"), needed)
        clear(place / "work")
        session = cls(place, seeds, {}, began)
        allowed = {}
        for door in doors:
            case = Case(-1, 0, door, (), "none", drawn=False)
            session._warm(case)
            outcome = session.run(case)
            bad = [one for one in outcome.findings if one.kind != "not finite"]
            if (outcome.code not in (0, 1, 3) and "--seeds" not in door.words) or bad:
                raise BrokenDoorError(
                    f"{door.name}: exit code {outcome.code}: {outcome.said} {bad}"
                )
            allowed[door.name] = frozenset(one.place for one in outcome.findings)
        return session._replace(allowed=allowed)

    def _warm(self, case: Case) -> None:
        """Run a command in this process, for what it imports, builds and compiles."""
        folder, home = clear(self.place / "work" / "warm"), Path.cwd()
        words = lay_out(case, self.seeds, folder)
        os.chdir(folder)
        try:
            with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()), server.undrawn():
                tireid(words)
        finally:
            os.chdir(home)

    def seconds(self) -> float:
        """Return the time since the start [s]."""
        return time.perf_counter() - self.began

    def run(self, case: Case, *, keep: bool = False) -> Outcome:
        """Run a case and judge it.

        Parameters
        ----------
        case : what is tried.
        keep : whether its folder stays.
        """
        room = clear(self.place / "work" / f"{os.getpid()}")
        folder, aside = clear(room / "here" / "case"), clear(room / "aside")
        words = lay_out(case, self.seeds, folder)
        before = files_of(folder)
        ended = server.run(words, folder, aside=aside, drawn=case.drawn)
        writable(folder)
        found = judge(words, folder, before, ended, self.allowed.get(case.door.name, ()))
        if keep:
            again = clear(self.place / "case")
            shutil.copytree(room, again, dirs_exist_ok=True, symlinks=True, ignore=_pipes)
        shutil.rmtree(room, ignore_errors=True)
        said = ended.err[-300:]
        return Outcome(
            case.number, case.seed, case.door.name, ended.code, found, words, ended.cpu, said
        )

    def keep_smallest(self, outcomes: Sequence[Outcome]) -> dict[tuple[str, str], Path]:
        """Keep the smallest case of each finding; return the folders by finding.

        Parameters
        ----------
        outcomes : of all cases.
        """
        first: dict[tuple[str, str], Outcome] = {}
        for outcome in sorted(outcomes, key=lambda one: one.cpu):
            for finding in outcome.findings:
                first.setdefault(finding.key, outcome)
        kept = {}
        clear(self.place / "found")
        for number, (key, outcome) in enumerate(sorted(first.items(), key=lambda item: item[0])):
            case = self._smaller(draw(outcome.seed, outcome.number), key)
            again = self.run(case, keep=True)
            folder = self.place / "found" / f"{number:03}"
            shutil.copytree(self.place / "case", folder, symlinks=True, ignore=_pipes)
            told = next((one.told for one in outcome.findings if one.key == key), "")
            lines = (
                f"{key[0]}: {key[1]}",
                told,
                f"case {outcome.number} of seed {outcome.seed}, door {outcome.door}, "
                f"mutations {', '.join(map(str, case.steps))}, around: {case.around}",
                f"cd here/case; tireid {shlex.join(again.words)}",
                again.said,
            )
            (folder / "README").write_text(
                "\n".join(lines) + "\n", errors="backslashreplace", encoding="utf-8"
            )
            kept[key] = folder
        return kept

    def _smaller(self, case: Case, key: tuple[str, str]) -> Case:
        """Return the case with fewer mutations, and nothing around, if it still shows a finding."""
        if key[0] == "hang":  # each try would take as long
            return case
        tries = [case._replace(steps=(step,), around="none") for step in case.steps]
        for one in [*tries, case._replace(around="none")]:
            if any(finding.key == key for finding in self.run(one).findings):
                return one
        return case


def _pipes(folder: str, names: list[str]) -> set[str]:
    """Return what cannot be copied."""
    found = (Path(folder) / name for name in names)
    return {
        path.name for path in found if not (path.is_symlink() or path.is_dir() or path.is_file())
    }


def everything(session: Session, cases: Sequence[Case], workers: int) -> Iterator[Outcome]:
    """Run cases in several processes, which share what is warm.

    Parameters
    ----------
    session : warm.
    cases : to run.
    workers : processes.
    """
    with ProcessPoolExecutor(workers, mp_context=get_context("fork")) as pool:
        yield from pool.map(partial(_run, session), cases, chunksize=CHUNK)


def _run(session: Session, case: Case) -> Outcome:
    return session.run(case)
