"""`tireid export DIR --mpc`: the tracker beside the identifier, and a car driven by both."""

from collections.abc import Mapping
from pathlib import Path

from identifier.export.package import Package
from mpc.export.figures import measure_mpc, mpc_figures_text, time_here, with_mpc_figures
from mpc.export.package import mpc_readme
from mpc.export.pair import build_pair
from mpc.realtime import NoCompilerError

TRACKER = "mpc"  # folder of the package; that of the identifier is `identifier`


def write_tracker(folder: Path, package: Package, *, single: bool) -> list[str]:
    """Write the tracker and what joins it with the identifier; return what to say about it.

    Parameters
    ----------
    folder : where the identifier lies in a folder of that name.
    package : of the identifier.
    single : whether float is the default precision.

    Raises
    ------
    ValueError
        Where what the method learns cannot be handed over, or there is no C compiler.
    """
    try:
        pair = build_pair(package, single=single)
    except NoCompilerError as error:
        raise ValueError(f"--mpc: {error}") from error
    tracker = pair.tracker
    costs, times = measure_mpc(tracker), time_here(tracker)
    manifest = f"{tracker.name}.json"
    texts = {**tracker.files, "README.md": mpc_readme(tracker, mpc_figures_text(costs, times))}
    texts[manifest] = with_mpc_figures(texts[manifest], costs)
    _write(folder, pair.files)
    _write(folder / TRACKER, texts)
    return [
        *(
            f"{cost.processor}, {'float' if cost.single else 'double'}: {tracker.name} takes "
            f"{cost.replay.instructions} instructions a step, {cost.flash} B flash, "
            f"{cost.replay.state + cost.replay.params + cost.replay.work} B RAM, "
            f"{cost.replay.stack} B stack"
            for cost in costs
        ),
        f"this machine: {tracker.name} takes {times.median:.0f} us a step, hash "
        f"{tracker.about['hash']}",
    ]


def _write(folder: Path, texts: Mapping[str, str]) -> None:
    for path, text in texts.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text, encoding="utf-8")
