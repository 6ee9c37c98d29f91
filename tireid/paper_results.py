"""The files of `tireid paper`: tables as JSON and text, seeds that diverged, Figs. 1-5 as PNG."""

from pathlib import Path

from identifier.defaults import LAWS as LAW_TITLES
from identifier.reproducibility import freeze_key
from models.vehicle import sedan
from tireid.certificate_table import certificate_of, verdict_line
from tireid.figures import comparison_figure, force_figure, save_figure, scheme_figure
from tireid.output import write_json
from tireid.paper_study import (
    ALL,
    FREEZES,
    GAINS,
    LAWS,
    NETWORK,
    ONLINE,
    ONSETS,
    PAST_ONLINE,
    Study,
    frozen_column,
    paper_design,
)
from tireid.paper_tables import printed_values, settings, table_text
from tireid.progress import say

SCHEME = "fig1_scheme.png"
FIGURES = {  # number of the paper's figure, by maneuver and law
    ("step_steer", "instantaneous"): "fig2",
    ("step_steer", "integral"): "fig3",
    ("slalom", "instantaneous"): "fig4",
    ("slalom", "integral"): "fig5",
}


def study_text(study: Study) -> str:
    """Return the tables, every gain, and the verdict of each law's certificate as lines of text.

    Parameters
    ----------
    study : its errors over all seeds.
    """
    tables = [table_text(maneuver, study) for maneuver in study.errors]
    return "\n".join([*tables, settings(GAINS, NETWORK), *verdicts()])


def verdicts() -> list[str]:
    """Return for each law one line with the verdict on the gains of the study."""
    return [
        f"{LAW_TITLES[law]}: {verdict_line(certificate_of(paper_design(law, seed=0), sedan()))}"
        for law in LAWS
    ]


def write_study(folder: Path, study: Study) -> None:
    """Write tables.json, diverged.json, tables.txt and the figures of a study.

    Parameters
    ----------
    folder : where to.
    study : its errors over all seeds.
    """
    write_json(folder / "tables.json", study.tables())
    write_json(folder / "diverged.json", study.diverged())
    (folder / "tables.txt").write_text(study_text(study) + "\n")
    say("drawing figures")
    save_figure(scheme_figure(), folder / SCHEME)
    for maneuver in study.errors:
        _draw(folder, study, maneuver)


def _draw(folder: Path, study: Study, maneuver: str) -> None:
    """Draw what did not diverge."""
    labels = _compared(maneuver)
    results = {
        law: {labels[n]: (q["median"], q["q25"], q["q75"]) for n, q in row.items() if n in labels}
        for law, row in study.tables()[maneuver].items()
    }
    printed = {
        law: {labels[name]: value for name, value in row.items()}
        for law, row in printed_values(maneuver).items()
    }
    if any(results.values()):
        save_figure(comparison_figure(results, printed), folder / f"{maneuver}_errors.png")
    onset = ONSETS[maneuver]
    window = (onset - 1.0, float(study.recordings[maneuver].t[-1]))
    for law in LAWS:
        trial = study.typical(maneuver, law)
        if trial is None:
            say(f"{maneuver}: the {law} law diverged on every seed, no figure")
            continue
        label = FIGURES.get((maneuver, law), "control")
        figure = force_figure(trial.history, trial.replays, window=window, since=onset)
        save_figure(figure, folder / f"{label}_{maneuver}_{law}.png")


def _compared(maneuver: str) -> dict[str, str]:
    """Return the columns of the figure, both measures side by side, with their labels."""
    labels = {ONLINE: "online,\nto truth"}
    for t in FREEZES[maneuver]:
        frozen = f"frozen at {freeze_key(t)} s,"
        labels[frozen_column(PAST_ONLINE, t)] = f"{frozen}\npast to online"
        labels[frozen_column(ALL, t)] = f"{frozen}\nall to truth"
    return labels
