"""What `tireid drive` prints: one line a drive."""

from collections.abc import Sequence

from tireid.drive_runs import Run

COLUMNS = ("tires", "rms e_y", "peak e_y", "completed", "failures", "median", "p99", "max")


def drive_table(runs: Sequence[Run]) -> str:
    """Return the scores of drives as lines of text.

    Parameters
    ----------
    runs : the drives.
    """
    wide = max(9, *(len(_completed(run)) for run in runs))
    head = f"{'tires':10} {'rms e_y':>9} {'peak e_y':>9}  {'completed':{wide}} {'failures':>9}"
    lines = [f"{head}   {'wall time: median / p99 / max':>32}"]
    for run in runs:
        score = run.scores
        failures = ", ".join(f"{n} {name}" for name, n in score.failures.items()) or "0"
        times = " / ".join(f"{score.solve_ms[key]:.3f}" for key in ("median", "p99", "max"))
        lines.append(
            f"{run.label:10} {score.rms_e_y_m:7.3f} m {score.peak_e_y_m:7.3f} m  "
            f"{_completed(run):{wide}} {failures:>9}   {times:>29} ms"
        )
    for run in runs:
        lines += [f"{run.label} at {t:.2f} s: {note}" for t, note in run.drive.notes]
    return "\n".join(lines)


def _completed(run: Run) -> str:
    if run.scores.completed:
        return "yes"
    return f"no: {run.drive.ending} at {run.drive.s[-1]:.0f} m"
