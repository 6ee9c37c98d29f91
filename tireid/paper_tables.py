"""Tables I and II as text: the paper's values beside ours, and what the third column means."""

from collections.abc import Sequence

from identifier.defaults import LAWS as LAW_TITLES
from identifier.gains import Gains
from identifier.network import Network
from identifier.reproducibility import freeze_key
from tireid.paper_study import FREEZES, LAWS, Study
from tireid.paper_values import PAPER

TITLES = {
    "step_steer": "Table I, step steer: RMSE of the axle force [kN]",
    "slalom": "Table II, slalom: RMSE of the axle force [kN]",
}
MEANING = (
    "The third column is the conventional instantaneous law with its learning rates divided by "
    "lambda. Below lambda the filtered error is z = xi_tilde/lambda plus a lag, so the integral "
    "law at eta is this law with a filter in front. Where the third column is as good as the "
    "second, what helps is the lower learning rate, not the integral. The paper's gains are not "
    "published and its car is another: its numbers are quoted for the pattern, not reproduced."
)


def row_names(maneuver: str) -> list[str]:
    """Return the rows of a table, "online" and the freeze times.

    Parameters
    ----------
    maneuver : "step_steer" or "slalom".
    """
    return ["online", *(freeze_key(t) for t in FREEZES[maneuver])]


def row_label(name: str) -> str:
    """Return the label of a row.

    Parameters
    ----------
    name : "online" or a freeze time.
    """
    return "online estimation" if name == "online" else f"frozen weights ({name} s)"


def rows(maneuver: str, study: Study) -> list[list[str]]:
    """Return the cells of a table: the label, and ours and the paper's value for each law.

    Medians and quartiles are those of the seeds that did not diverge; the last row counts those
    that did.

    Parameters
    ----------
    maneuver : "step_steer" or "slalom".
    study : its errors over all seeds.
    """
    table = study.tables()[maneuver]
    cells = []
    for name in row_names(maneuver):
        row = [row_label(name)]
        for law in LAWS:
            if table[law]:
                q = table[law][name]
                row.append(f"{q['median']:.3f} ({q['q25']:.3f}-{q['q75']:.3f})")
            else:
                row.append("diverged")
            printed = PAPER[maneuver].get(law, {}).get(name)
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
    """Return every gain in one paragraph, and what the third column means.

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
        f"maneuver, both axles together.\n{MEANING}"
    )
