"""Tables I and II as text: both measures of frozen weights, and the paper's values beside ours.

The paper's values of frozen weights stand beside the measure that its section IV-A defines, the
past against the online output.
"""

from collections.abc import Sequence

from identifier.defaults import LAWS as LAW_TITLES
from identifier.gains import Gains
from identifier.network import Network
from identifier.reproducibility import freeze_key
from tireid.paper_study import (
    AFTER,
    ALL,
    FREEZES,
    LAWS,
    ONLINE,
    PAST,
    PAST_ONLINE,
    Study,
    columns,
    frozen_column,
)
from tireid.paper_values import PAPER

TITLES = {
    "step_steer": "Table I, step steer: RMSE of the axle force [kN]",
    "slalom": "Table II, slalom: RMSE of the axle force [kN]",
}
MEASURES = {
    PAST_ONLINE: "past, against online (the paper's measure)",
    PAST: "past, against truth",
    AFTER: "after, against truth",
    ALL: "all, against truth",
}
MEASURES_MEAN = (
    "Frozen weights are measured in two ways. The paper's section IV-A compares the past, t < "
    "T_freeze, with what was identified online then: do the weights still say what they once said? "
    "The rows against truth ask whether it is right. They part where the online output was wrong: "
    "on the step steer the integral law lets the force overshoot before it has learnt that the "
    "tire saturates, and its frozen weights, which by then know, are far from that output and near "
    "the truth. The rows after the freeze ask for prediction: from 36 s on the step steer is at an "
    "angle that was not learnt."
)
MEANING = (
    "The third column is the conventional instantaneous law with its learning rates divided by "
    "lambda. Below lambda the filtered error is z = xi_tilde/lambda plus a lag, so the integral "
    "law at eta is this law with a filter in front. Where the third column is as good as the "
    "second, what helps is the lower learning rate, not the integral. The paper's gains are not "
    "published and its car is another: its numbers are quoted for the pattern, not reproduced."
)


def row_labels(maneuver: str) -> dict[str, str]:
    """Return the label of every row of a table, by its column in the study.

    Parameters
    ----------
    maneuver : "step_steer" or "slalom".
    """
    labels = {ONLINE: "online, against truth"}
    for t in FREEZES[maneuver]:
        for measure, words in MEASURES.items():
            labels[frozen_column(measure, t)] = f"frozen at {freeze_key(t)} s: {words}"
    return {name: labels[name] for name in columns(maneuver)}


def printed_values(maneuver: str) -> dict[str, dict[str, float]]:
    """Return what the paper prints by law and column, beside the measure that it defines [kN].

    Parameters
    ----------
    maneuver : "step_steer" or "slalom".
    """
    beside = {ONLINE: ONLINE}
    beside |= {freeze_key(t): frozen_column(PAST_ONLINE, t) for t in FREEZES[maneuver]}
    return {
        law: {beside[name]: value for name, value in row.items()}
        for law, row in PAPER[maneuver].items()
    }


def rows(maneuver: str, study: Study) -> list[list[str]]:
    """Return the cells of a table: the label, and ours and the paper's value for each law.

    Medians and quartiles are those of the seeds that did not diverge; the last row counts those
    that did.

    Parameters
    ----------
    maneuver : "step_steer" or "slalom".
    study : its errors over all seeds.
    """
    table, paper = study.tables()[maneuver], printed_values(maneuver)
    cells = []
    for name, label in row_labels(maneuver).items():
        row = [label]
        for law in LAWS:
            if table[law]:
                q = table[law][name]
                row.append(f"{q['median']:.3f} ({q['q25']:.3f}-{q['q75']:.3f})")
            else:
                row.append("diverged")
            printed = paper.get(law, {}).get(name)
            row.append("" if printed is None else f"{printed:.4f}")
        cells.append(row)
    lost = study.diverged()[maneuver]
    counts = [(f"{lost[law]} of {len(study.errors[maneuver][law])}", "") for law in LAWS]
    return [*cells, ["seeds that diverged", *(cell for pair in counts for cell in pair)]]


def header() -> list[str]:
    """Return the head of the table's columns."""
    names = ["condition"]
    for law in LAWS:
        names += [LAW_TITLES[law], "paper" if law != "instantaneous_scaled" else ""]
    return names


def table_text(maneuver: str, study: Study) -> str:
    """Return a table as lines of text, with the number of seeds.

    Parameters
    ----------
    maneuver : "step_steer" or "slalom".
    study : its errors over all seeds.
    """
    lines = [header(), *rows(maneuver, study)]
    width = [max(len(row[i]) for row in lines) for i in range(len(lines[0]))]
    seeds = len(study.errors[maneuver]["integral"])
    title = f"{TITLES[maneuver]}, median (quartiles) of {seeds} seeds"
    return "\n".join([title, *(_line(row, width) for row in lines), ""])


def _line(row: Sequence[str], width: Sequence[int]) -> str:
    cells = [cell.ljust(w) for cell, w in zip(row, width, strict=True)]
    return "  " + "  ".join(cells).rstrip()


def settings(gains: Gains, network: Network) -> str:
    """Return every gain in one paragraph, what the measures ask, and what the third column means.

    Parameters
    ----------
    gains : of both laws; the third column divides the learning rates by the forgetting factor.
    network : its size.
    """
    a = -gains.A_d[0][0]
    scaled = gains.scaled_by_forgetting()
    return (
        f"Gains: A_d = -{a:g} I 1/s, lambda = {gains.forgetting:g} 1/s, eta1 = {gains.eta_W:g}, "
        f"eta2 = {gains.eta_V:g} (third column {scaled.eta_W:.4g} and {scaled.eta_V:.4g}), rho1 = "
        f"{gains.rho_W:g}, rho2 = {gains.rho_V:g}, n_h = {network.hidden}, T_s = 0.01 s, explicit "
        f"Euler, forces in kN, inputs {', '.join(network.inputs)} over "
        f"{', '.join(f'{s:g}' for s in network.scale or ())}. Errors count from the onset of the "
        f"maneuver, both axles together.\n{MEASURES_MEAN}\n{MEANING}"
    )
