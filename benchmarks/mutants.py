"""Do the tests notice? Faults that a program draws and plants, and how many the tests catch.

`make mutants` draws 150 faults (benchmarks/mutation/draw.py) from all packages and C templates,
plants one after the other in a copy of the tree, and runs the tests that run its function, quick
ones first, until one fails. What none catches, and no test around it, survives. The seed is that
of the day: nobody has written tests for these faults. `--only identifier/plan` draws
from one package. Neither mutmut nor cosmic-ray
does this: the first leaves out C and everything outside functions and draws nothing, the second
runs the whole suite for each fault.
"""

import argparse
import json
import os
import sys
import time
import tomllib
from collections.abc import Sequence
from datetime import date
from pathlib import Path
from typing import Any

from benchmarks.mutation.draw import draw, faults_of, strata
from benchmarks.mutation.faults import Fault
from benchmarks.mutation.selection import Traced
from benchmarks.mutation.workshop import Answer, Workshop

ROOT = Path(__file__).resolve().parents[1]
PLANTED = ROOT / "tests" / "planted_faults.toml"
COUNT = 150
LEAST = 85.0  # percent that the tests must catch
CIRCLES = 2
UNKNOWN = 120.0  # s, for tests that were not traced


def main(argv: Sequence[str] | None = None) -> int:
    """Draw, plant, run and judge; return 1 where too few are caught.

    Parameters
    ----------
    argv : words of the command; None takes those of the process.
    """
    options = _parser().parse_args(argv)
    faults = _drawn(options)
    options.out.mkdir(parents=True, exist_ok=True)
    shop = Workshop(ROOT, options.out / "worker")
    traced = Traced(ROOT, options.out / "trace.json")
    good = True
    if not options.planted_only:
        _trace(shop, traced, options.out)
        results = _run_all(faults, shop, traced, options)
        good = _judge(results, traced, shop) >= LEAST
    if PLANTED.exists() and not options.only:
        good &= not _replay(shop, traced)
    return 0 if good else 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=date.today().toordinal())
    parser.add_argument("--count", type=int, default=COUNT)
    parser.add_argument("--only", metavar="PATH", help="draw from one file or folder")
    parser.add_argument("--planted-only", action="store_true", help="tests/planted_faults.toml")
    parser.add_argument("--out", type=Path, default=ROOT / "out" / "mutants")
    return parser


def _drawn(options: argparse.Namespace) -> list[Fault]:
    if options.only is None:
        return draw(ROOT, seed=options.seed, count=options.count)
    files = [file for some in strata(ROOT, options.only).values() for file in some]
    count = min(options.count, sum(len(faults_of(ROOT, file)) for file in files))
    return draw(ROOT, seed=options.seed, count=count, only=options.only)


def _trace(shop: Workshop, traced: Traced, out: Path) -> None:
    """Trace the files of tests that are new or changed; no fault is planted meanwhile."""
    files = traced.outdated()
    if files:
        print(f"tracing {len(files)} files of tests", flush=True)
        kept = out / "traced.json"
        kept.unlink(missing_ok=True)
        (out / "trace.txt").write_text(shop.trace(files, kept), encoding="utf-8")
        traced.learn(files, json.loads(kept.read_text(encoding="utf-8")))


def _run_all(
    faults: list[Fault], shop: Workshop, traced: Traced, options: argparse.Namespace
) -> list[dict[str, Any]]:
    """Return what became of each fault; a run that was interrupted goes on where it was.

    All faults meet the tests nearest to them before any meets a wider circle.
    """
    file = options.out / f"seed_{options.seed}.json"
    kept = json.loads(file.read_text(encoding="utf-8")) if file.exists() else {}
    state = traced.state()

    def one(fault: Fault, circle: int) -> dict[str, Any]:
        source = (ROOT / fault.file).read_bytes()
        key = fault.key(source)
        known = kept.get(key)
        if known and (known["caught"] or (known["tests"] == state and known["circle"] >= circle)):
            return dict(known)
        answer, asked = plant(shop, traced, fault, circle)
        result = {
            "kind": fault.kind,
            "place": f"{fault.file}:{fault.line(source)}",
            "diff": fault.diff(ROOT),
            "caught": answer.caught,
            "by": answer.by,
            "circle": circle,
            "tests_asked": asked,
            "seconds": round(answer.seconds, 1),
            "tests": state,
        }
        kept[key] = result
        scratch = file.with_suffix(".part")
        scratch.write_text(json.dumps(kept, indent=1, ensure_ascii=False), encoding="utf-8")
        scratch.replace(file)
        word = f"caught by {answer.by}" if answer.caught else f"NOT CAUGHT by {asked} tests"
        print(f"{answer.seconds:7.1f} s  {fault.kind}, {result['place']}: {word}", flush=True)
        if not answer.caught:
            print(result["diff"], flush=True)
        return result

    for circle in range(CIRCLES):
        results = [one(fault, circle) for fault in faults]
        print(f"circle {circle}: {sum(r['caught'] for r in results)} caught", flush=True)
    return results


def plant(shop: Workshop, traced: Traced, fault: Fault, circle: int) -> tuple[Answer, int]:
    """Run tests that may catch a fault; return the answer and how many were asked.

    Parameters
    ----------
    shop : where it is planted.
    traced : what each test runs.
    fault : of the tree.
    circle : 0 asks the tests that run its function, 1 those around them.
    """
    tests = traced.select(fault)[circle]
    if not tests:
        return Answer(False, "", 0.0, ""), 0
    return shop.run(tests, traced.seconds(tests), fault), len(tests)


def _judge(results: list[dict[str, Any]], traced: Traced, shop: Workshop) -> float:
    """Print survivors; return the share caught [%]: not by tests that fail without a fault."""
    catchers = sorted({r["by"] for r in results if r["caught"]} & set(traced.tests))
    false = set()
    while catchers:
        clean = shop.run(catchers, traced.seconds(catchers))
        if not clean.caught:
            break
        print(f"{clean.by} fails without a fault:\n{clean.text[-2000:]}")
        false.add(clean.by)
        catchers = [name for name in catchers if name != clean.by]
        if clean.by not in traced.tests:
            raise RuntimeError(f"the tests do not run on the unharmed tree: {clean.by}")
    survived = [r for r in results if not r["caught"] or r["by"] in false]
    print(f"\n{len(survived)} of {len(results)} survived")
    for result in survived:
        print(f"{result['kind']}, {result['place']}\n{result['diff']}")
    score = 100.0 * (1.0 - len(survived) / len(results))
    print(f"{score:.1f} % caught, {LEAST:g} % must be")
    return score


def _replay(shop: Workshop, traced: Traced) -> list[str]:
    """Plant the faults that once went through; return those that the tests they name miss."""
    faults = tomllib.loads(PLANTED.read_text(encoding="utf-8"))["fault"]
    named = list(dict.fromkeys(name for entry in faults for name in entry["tests"]))
    clean = shop.run(named, max(UNKNOWN, _time_of(named, traced)))
    if clean.caught:
        raise RuntimeError(f"{clean.by} fails without a fault:\n{clean.text[-2000:]}")
    lost = []
    for entry in faults:
        answer = shop.run(entry["tests"], _time_of(entry["tests"], traced), written_fault(entry))
        if not answer.caught:
            lost.append(entry["name"])
        word = f"caught by {answer.by}" if answer.caught else "SURVIVED"
        print(f"{answer.seconds:7.1f} s  {entry['name']}: {word}", flush=True)
    print(f"{len(lost)} of {len(faults)} planted faults survive")
    return lost


def _time_of(paths: Sequence[str], traced: Traced) -> float:
    """Return how long tests take, long where nobody traced them [s]."""
    known = [name for name in traced.tests if name.startswith(tuple(paths))]
    return traced.seconds(known) if known else UNKNOWN


def written_fault(entry: dict[str, Any], root: Path = ROOT) -> Fault:
    """Return a fault that somebody wrote down.

    Parameters
    ----------
    entry : name, file, old (text that stands there once) and new.
    root : of the tree.

    Raises
    ------
    ValueError
        Where the file holds the old text not exactly once: the list has to follow the code.
    """
    source, old = (root / entry["file"]).read_bytes(), entry["old"].encode()
    if source.count(old) != 1:
        raise ValueError(
            f"{entry['name']}: {entry['file']} must hold the old text once, "
            f"it holds it {source.count(old)} times"
        )
    start = source.index(old)
    return Fault(entry["file"], entry["name"], start, start + len(old), entry["new"])


if __name__ == "__main__":
    os.nice(10)
    began = time.perf_counter()
    code = main()
    print(f"{time.perf_counter() - began:.0f} s")
    sys.exit(code)
