"""What are identified tires worth? `tireid drive` near the limit of grip, on four tires.

    python -m benchmarks.mpc_worth [--quick] [--record]

ISO 3888-2 and the handling course at 90 % and 97 % of the limit, on friction 1.0 and 0.5. The limit
is the car's largest lateral acceleration in steady turning; `--speed` says the share of it. On the
linear tire of the data sheet; on the paper's network (`--paper`) and the default, identified and
frozen; on the true tire. Seeds are those of `--seed`. A drive that leaves the path by 2 m or spins
ends there and counts as it was until then.
"""

import sys
from collections import defaultdict
from collections.abc import Sequence
from itertools import product

from benchmarks.mpc_cases import Case, Score, all_driven, driven, median_cm, share_of_limit
from benchmarks.targets import Table, Targets, Values, parse

PATHS: Sequence[str] = ("iso-3888-2", "course")
SHARES: Sequence[int] = (90, 97)  # % of the limit
FRICTIONS: Sequence[float] = (1.0, 0.5)
TIRES = ("linear", "paper", "axle", "oracle")
SEEDS = 10
WITHIN = 1.1  # times the rms of the tracker with the true tire
VISIBLY_WRONG = 1.5  # times that rms, from which on the linear tire is


def judge(key: str, scores: dict[str, list[Score]], targets: Targets) -> None:
    """Print, record and judge a path at a share of the limit and a friction.

    Parameters
    ----------
    key : of the three.
    scores : by tires, one for each seed.
    targets : collects what is missed.
    """
    rms = {tires: median_cm(some) for tires, some in scores.items()}
    for tires, some in scores.items():
        completed, peak = sum(one.completed for one in some), max(one.peak for one in some)
        targets.record(f"{key}/{tires}/rms", rms[tires])
        targets.record(f"{key}/{tires}/completed", completed)
        failures = sum(one.failures for one in some)
        done = f"{completed} of {len(some)} completed, {failures} periods without a plan"
        print(f"{key:24} {tires:8} rms {rms[tires]:7.2f} cm, peak {peak:5.2f} m, {done}")
    best, oracle, linear = (rms[tires] for tires in ("axle", "oracle", "linear"))
    targets.at_most(f"{key}: identified over true", best / oracle, WITHIN, "-")
    if linear > VISIBLY_WRONG * oracle:
        targets.at_most(f"{key}: identified over linear", best / linear, 0.5, "-")
    pairs = zip(scores["axle"], scores["oracle"], strict=True)
    lost = sum(true.completed and not known.completed for known, true in pairs)
    targets.at_most(f"{key}: drives that only the true tire completes", lost, 0, "")


def canary() -> Values:
    """Return the deviation of one drive on identified tires [m]."""
    found = driven(Case("iso-3888-2", share_of_limit(97, 1.0), 1.0, "axle", 0))
    return {"rms": found.rms, "peak": found.peak}


def tables(v: Values) -> dict[str, Table]:
    """Return the table of the documents.

    Parameters
    ----------
    v : recorded values.
    """
    rows = []
    for path, share, mu in product(PATHS, SHARES, FRICTIONS):
        cells = []
        for tires in TIRES:
            key = f"{path}/{share}/{mu}/{tires}"
            lost = SEEDS - int(v[f"{key}/completed"])
            cells.append(f"{v[f'{key}/rms']:.1f}" + f", {lost} lost" * bool(lost))
        rows.append([path, f"{share} %", f"{mu:g}", *cells])
    header = ("path", "of the limit", "friction", f"linear; rms [cm], median of {SEEDS}",
              "paper's network", "default", "true tire")  # fmt: skip
    return {"mpc_worth": Table(header, rows)}


def main() -> int:
    """Drive and print; return 1 where a target was missed."""
    targets, options = Targets("mpc_worth"), parse("mpc_worth", __doc__)
    seeds, paths, shares, frictions = SEEDS, PATHS, SHARES, FRICTIONS
    if options.quick:
        seeds, paths, shares, frictions = 1, PATHS[:1], SHARES[1:], FRICTIONS[:1]
    words = {(share_of_limit(share, mu), mu): share for share, mu in product(shares, frictions)}
    cases = [
        Case(path, speed, mu, tires, seed)
        for seed, path, tires in product(range(seeds), paths, TIRES)
        for speed, mu in words
    ]
    found: dict[str, dict[str, list[Score]]] = defaultdict(lambda: defaultdict(list))
    for case, score in all_driven(cases):
        key = f"{case.path}/{words[case.speed, case.mu]}/{case.mu}"
        found[key][case.tires].append(score)
    for path, share, mu in product(paths, shares, frictions):
        key = f"{path}/{share}/{mu}"
        judge(key, found[key], targets)
    return targets.finish(canary, keep=options.record)


if __name__ == "__main__":
    sys.exit(main())
