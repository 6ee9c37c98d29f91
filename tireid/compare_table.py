"""The tables of `tireid compare` as text: percent of the rms force and newtons, front and rear."""

import numpy as np

from identifier.cross_replay import Trial, where_learnt_and_elsewhere
from identifier.pareto import best_candidate, frozen_share, pareto_front
from identifier.reproducibility import AxleRmse
from tireid.compare_study import Comparison

HINDSIGHT = (
    "The best design of a sweep is chosen with the recordings that it is judged on, for every "
    "method alike."
)


def summary_table(comparison: Comparison) -> str:
    """Return the means over recordings of every method, best on other recordings first.

    Parameters
    ----------
    comparison : the methods.
    """
    n = len(comparison.names)
    lines = [["method", "online", "frozen, where learnt", "frozen, elsewhere", "step"]]
    for name in ranking(comparison):
        trial = comparison.trials[name]
        online = [(rec, error) for rec, error in trial.online.items()]
        time = f"{1e9 * comparison.step_times[name]:.0f} ns x{comparison.time_ratio(name):.2f}"
        cells = ["diverged" if trial.diverged_at else _mean(comparison, online)]
        lines.append([name, *cells, *_frozen_cells(comparison, trial), time])
    for name, frozen in comparison.floors.items():
        cells = [_mean(comparison, pairs) for pairs in where_learnt_and_elsewhere(frozen)]
        lines.append([f"floor, {name}", "", *cells, ""])
    title = f"Axle force RMSE, front / rear, % of rms (N), mean over {n} recordings"
    return _text(title, lines)


def pair_tables(comparison: Comparison) -> str:
    """Return one table for each recording learnt on and recording replayed.

    Parameters
    ----------
    comparison : the methods.
    """
    blocks = []
    for learnt in comparison.names:
        for replayed in comparison.names:
            lines = []
            for name in ranking(comparison):
                frozen = comparison.trials[name].frozen
                if frozen is not None:
                    error = frozen.get(learnt, {}).get(replayed)
                    cell = "diverged" if error is None else cell_text(comparison, replayed, error)
                    lines.append([name, cell])
            for name, frozen in comparison.floors.items():
                cell = cell_text(comparison, replayed, frozen[learnt][replayed])
                lines.append([f"floor, {name}", cell])
            blocks.append(_text(f"learnt on {learnt}, frozen, replayed on {replayed}", lines))
    return "\n".join(blocks)


def sweep_table(comparison: Comparison) -> str:
    """Return the best design of every method's sweep [% of rms, both axles].

    Parameters
    ----------
    comparison : with a sweep.
    """
    lines = [["method", "designs", "diverged", "default", "best", "online then", "on the front"]]
    for name, candidates in comparison.sweeps.items():
        best, own = best_candidate(candidates), frozen_share(comparison.shares(name))
        lost = sum(bool(candidate.diverged_on) for candidate in candidates)
        cells = ["signal", "signal", "signal"]
        if best is None:
            cells = [percent(own), "diverged", ""]
        elif own is not None:
            cells = [percent(own), percent(frozen_share(best.shares)), percent(best.shares.online)]
        elif frozen_share(best.shares) is None:
            cells = ["", "", percent(best.shares.online)]
        front = len(pareto_front(candidates))
        lines.append([name, str(len(candidates)), str(lost), *cells, str(front or "")])
    title = "Sweep: frozen error elsewhere, % of rms of both axles, mean over recordings"
    return _text(title, lines) + HINDSIGHT + "\n"


def ranking(comparison: Comparison) -> list[str]:
    """Return the methods, smallest frozen error elsewhere first; those that cannot freeze last.

    Parameters
    ----------
    comparison : the methods.
    """

    def key(name: str) -> tuple[bool, float]:
        found = comparison.shares(name)
        error = frozen_share(found)
        return (error is None, found.online if error is None else error)

    return sorted(comparison.trials, key=key)


def percent(value: float | None) -> str:
    """Return a share as text.

    Parameters
    ----------
    value : [%], infinite where a run diverged, None where there is none.
    """
    if value is None:
        return ""
    return f"{value:.1f} %" if np.isfinite(value) else "diverged"


def cell_text(comparison: Comparison, name: str, error: AxleRmse) -> str:
    """Return an error as percent of the rms force and in newtons, front / rear.

    Parameters
    ----------
    comparison : knows the true forces.
    name : of the recording.
    error : over it [N].
    """
    return _mean(comparison, [(name, error)])


def newton_text(value: float) -> str:
    """Return a force with three digits, more where it is above 1000 N.

    Parameters
    ----------
    value : [N].
    """
    return f"{value:.0f}" if value >= 100.0 else f"{value:.3g}"


def _frozen_cells(comparison: Comparison, trial: Trial) -> list[str]:
    if trial.frozen is None:
        return ["a signal, no model", ""]
    if trial.diverged_at:
        return ["diverged", "diverged"]
    return [_mean(comparison, pairs) for pairs in where_learnt_and_elsewhere(trial.frozen)]


def _mean(comparison: Comparison, pairs: list[tuple[str, AxleRmse]]) -> str:
    if not pairs:
        return ""
    sizes = {rec.name: comparison.course.size(rec) for rec in comparison.course.recordings}
    newtons = np.mean([(error.front, error.rear) for _, error in pairs], axis=0)
    if not np.isfinite(newtons).all():
        return "diverged"
    parts = np.mean(
        [(e.front / sizes[name].front, e.rear / sizes[name].rear) for name, e in pairs], axis=0
    )
    front, rear = (
        f"{100.0 * p:.1f} ({newton_text(n)})" for p, n in zip(parts, newtons, strict=True)
    )
    return f"{front} / {rear}"


def _text(title: str, lines: list[list[str]]) -> str:
    widths = [max(len(row[i]) for row in lines) for i in range(len(lines[0]))]
    rows = ["  ".join(c.ljust(w) for c, w in zip(row, widths, strict=True)) for row in lines]
    return "\n".join([title, *(f"  {row.rstrip()}" for row in rows), ""])
