"""Hostile files and words at every door of the commands: what do they break?

    python -m benchmarks.fuzz [--cases 20000] [--seed 2026] [--workers 2] [--minutes M] [--case N]

A case is a command whose files are right but for one to three mutations. Each runs in a fork of a
warm process with limits of memory and time. Found is a traceback, a crash, a hang, an exit code
that is not documented, a success with numbers that are not finite or an axle that no longer pushes,
a user's file that is not what it was, output of a command that failed, control characters for the
terminal, and an error of more than one line. `--case N` repeats one case of that seed. What is
found is made as small as its mutations allow and kept in OUT/found. Returns 1 where anything was
found.
"""

import argparse
import json
import os
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

from benchmarks.fuzz.cases import draw
from benchmarks.fuzz.doors import DOORS
from benchmarks.fuzz.session import Outcome, Session, everything

CASES, SEED = 20_000, 2026
EVERY = 500  # cases between two lines of progress
SHOWN = 40  # findings in the table


def parse(words: Sequence[str] | None = None) -> argparse.Namespace:
    """Return the options of the command.

    Parameters
    ----------
    words : None takes those of the process.
    """
    parser = argparse.ArgumentParser(prog="python -m benchmarks.fuzz", description=__doc__)
    parser.add_argument("--cases", type=int, default=CASES)
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--case", type=int, help="this one alone, whose folder is kept")
    parser.add_argument("--minutes", type=float, help="of cases, then end wherever it is")
    parser.add_argument("--out", type=Path, default=Path("out/fuzz"))
    return parser.parse_args(words)


def main(words: Sequence[str] | None = None) -> int:
    """Run the cases; return 1 where anything was found.

    Parameters
    ----------
    words : of the command; None takes those of the process.
    """
    options = parse(words)
    session = Session.begin(options.out.resolve(), DOORS)
    if options.case is not None:
        outcome = session.run(draw(options.seed, options.case), keep=True)
        print(json.dumps(outcome._asdict(), indent=1, ensure_ascii=False, default=list))
        return 1 if outcome.findings else 0
    print(f"warm after {session.seconds():.0f} s", flush=True)
    outcomes = list(_progress(options, session))
    return _report(outcomes, session.keep_smallest(outcomes))


def _progress(options: argparse.Namespace, session: Session) -> Iterator[Outcome]:
    began, seen = session.seconds(), set()
    cases = [draw(options.seed, number) for number in range(options.cases)]
    for count, outcome in enumerate(everything(session, cases, options.workers), 1):
        for finding in outcome.findings:
            if finding.key not in seen:
                seen.add(finding.key)
                told = " ".join(finding.told.split())[:160]
                where = f"case {outcome.number}, {outcome.door}"
                print(f"  {where}: {finding.kind}: {finding.place}: {told}", flush=True)
        if count % EVERY == 0 or count == options.cases:
            took = session.seconds() - began
            left = took / count * (options.cases - count)
            print(
                f"{count} of {options.cases}, {len(seen)} findings, {left / 60.0:.0f} min left",
                flush=True,
            )
        yield outcome
        if options.minutes is not None and session.seconds() - began > 60.0 * options.minutes:
            print(f"ended by the clock after {count} of {options.cases} cases", flush=True)
            return


def _report(outcomes: list[Outcome], found: dict[tuple[str, str], Path]) -> int:
    """Print what ended how by door, and what was found by kind; return the exit code."""
    heads = ("cases", "exit 0", "exit 1", "exit 2", "other", "found", "s each")
    print("\n" + f"{'door':28}" + "".join(f"{head:>8}" for head in heads))
    for door in DOORS:
        own = [outcome for outcome in outcomes if outcome.door == door.name]
        codes = Counter(outcome.code for outcome in own)
        known = codes[0], codes[1], codes[2]
        bad = sum(bool(outcome.findings) for outcome in own)
        each = sum(outcome.cpu for outcome in own) / max(len(own), 1)
        cells = (len(own), *known, len(own) - sum(known), bad)
        print(f"{door.name:28}" + "".join(f"{cell:8}" for cell in cells) + f"{each:8.2f}")
    for (kind, place), folder in list(found.items())[:SHOWN]:
        print(f"{kind}: {place}: {folder}")
    kinds = Counter(finding.kind for outcome in outcomes for finding in outcome.findings)
    said = ", ".join(f"{count} of {kind}" for kind, count in kinds.items())
    print(f"{len(outcomes)} cases at {len(DOORS)} doors: found {said or 'nothing'}")
    return 1 if kinds else 0


if __name__ == "__main__":
    sys.exit(main())
