"""`tireid compare LOG [LOG ...] --vehicle FILE --out DIR`: methods side by side."""

import argparse
from functools import partial
from typing import Any

import numpy as np

from identifier.compare.study import cannot_learn, run_comparison
from identifier.methods import DEFAULT, INSTALL, RIVALS, methods, require_method
from identifier.run import History
from identifier.verdict import Verdict, judge
from models.recordings import RecordingError
from tireid.commands import DONE
from tireid.commands import compare_results as results
from tireid.commands import options as shared
from tireid.commands.demo_story import plant_recordings
from tireid.progress import Progress, say, tell
from tireid.verdicts import verdicts_text

_FEW_PAIRS = 4  # of recordings learnt on and replayed, all of which are printed


def declare(new: Any) -> None:
    parser = new(
        description="Identify on each recording, freeze at its end and replay on all of them, "
        "with every method; write report.html, compare.json, compare.csv, tables.txt and "
        "figures. Methods that estimate lateral velocity are judged on side slip too. Where a "
        "recording has no true forces, all are judged by the force in the motion. Without a LOG "
        "the plant of the car drives slaloms, a step steer and a lane change with noisy sensors.",
        epilog=f"methods: {', '.join(methods())}",
    )
    parser.add_argument("logs", nargs="*", metavar="LOG[:RUN]", help="recordings")
    shared.add_vehicle(parser)
    parser.add_argument(
        "--method",
        nargs="+",
        action="extend",
        metavar="NAME",
        help="these only (all)",
    )
    shared.add_seed(parser, "sensor noise, and the weights of networks")
    shared.add_log_reading(parser)
    shared.add_accept(parser)
    shared.add_output(parser, "compare")


def run(options: argparse.Namespace) -> int:
    """Run the command; return 3 where what the default learns on a recording is not valid."""
    seed, names = shared.seed_of(options), list(dict.fromkeys(options.method or methods()))
    for name in names:
        require_method(name)
    absent = [name for name in RIVALS if name not in methods()]
    if absent and not options.method:
        say(f"without {', '.join(absent)}, which are not installed: {INSTALL}")
    if options.logs and options.vehicle is None:
        raise ValueError("--vehicle FILE is needed with a LOG: the car that drove it")
    vehicle = shared.read_vehicle(options)
    parts = {"methods": 9.0, "step times, tables and figures": 1.0}
    with shared.folder_of(options) as folder:
        work = Progress("compare", parts, long=True)
        recordings = [shared.read_log(log, vehicle, options) for log in options.logs]
        if not recordings:
            say(f"driving the plant of {vehicle.name} with noisy sensors")
            recordings = [*plant_recordings(vehicle, np.random.default_rng(seed))]
        for recording in recordings:
            recording.needed("v_y")  # of the slip at which every method is asked
        blind = [recording.name for recording in recordings if recording.axle_force is None]
        if blind:
            say(f"{', '.join(blind)}: no true forces; judged by the motion")
        left_out = cannot_learn(names, vehicle, recordings)
        for name, why in left_out.items():
            say(f"{name}: {why}")
        names = [name for name in names if name not in left_out]
        if not names:
            raise RecordingError("no method is left to compare: " + next(iter(left_out.values())))
        verdicts: dict[str, Verdict] = {}

        def seen(name: str, run: History) -> None:
            if name == DEFAULT:
                verdicts[run.recording.name] = judge(run)

        comparison = run_comparison(
            names,
            vehicle,
            recordings,
            seed=seed,
            progress=partial(work.step, len(names)),
            left_out=left_out,
            seen=seen,
        )
        work.begin("step times, tables and figures")
        figures = results.write_comparison(folder, comparison, verdicts)
        results.write_compare_report(folder, comparison, figures, verdicts, options.words)
        tables = [results.summary_table(comparison)]
        if len(comparison.names) ** 2 <= _FEW_PAIRS:
            tables.append(results.pair_tables(comparison))
    tables += [verdicts_text(verdicts, "default identified on")] if verdicts else []
    tell(*tables)
    say(f"wrote {options.out}/ in {work.seconds:.0f} s")
    return max((shared.exit_code(verdict, options) for verdict in verdicts.values()), default=DONE)
