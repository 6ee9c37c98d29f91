"""What `tireid identify --network` finds: a network of one's own over recordings.

summary.json has the keys of a learnt model; in place of a freeze time stands "network". What the
identifier finds online over the same recordings stands beside it.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

from identifier.history import History
from identifier.onnx_model import OnnxModel
from identifier.reproducibility import Replay, force_rms, online_error, replay
from tireid.figures import inputs_figure, prediction_figure, save_figure, slip_figure
from tireid.identify_results import error_cells, file_name, force_columns
from tireid.output import write_csv, write_json
from tireid.progress import say
from tireid.summary import summarize_replays

NETWORK = "network"


def write_network_results(
    folder: Path, file: Path, law: str, model: OnnxModel, histories: Sequence[History]
) -> Mapping[str, Replay]:
    """Write everything that is known of a network into a folder; return replays by recording.

    Parameters
    ----------
    folder : an empty folder.
    file : where the network came from.
    law : what learns beside it, as the user named it.
    model : the network.
    histories : what was identified online over each recording.
    """
    replays = {history.recording.name: replay(model, history) for history in histories}
    about = {
        "file": file.name,
        "inputs": list(model.signals),
        "slip_sign": model.slip_sign,
    }
    summary = summarize_replays(law, histories, {NETWORK: replays})
    write_json(folder / "summary.json", {**summary, NETWORK: about})
    model.save(folder / "weights.json")
    say("drawing figures")
    for history in histories:
        recording = history.recording
        name, own = file_name(recording), replays[recording.name]
        last = "" if history is histories[0] else f"_{name}"
        write_csv(folder / f"forces{last}.csv", force_columns(history, {NETWORK: own}))
        save_figure(slip_figure(model, recording, history), folder / f"slip{last}.png")
        save_figure(prediction_figure(own, history), folder / f"replay_{name}.png")
    save_figure(inputs_figure(histories[0].recording), folder / "inputs.png")
    return replays


def network_table(law: str, histories: Sequence[History], replays: Mapping[str, Replay]) -> str:
    """Return the errors of the network, and of what was learnt online beside it, as text.

    Parameters
    ----------
    law : what learns beside it.
    histories : what was identified online over each recording.
    replays : of the network, by recording.
    """
    lines = [f"{'':24} {'replayed on':40} {'front':>16} {'rear':>16}"]
    for history in histories:
        name, size, online = history.recording.name, force_rms(history), online_error(history)
        own = replays[name]
        rows = [(NETWORK, own.against_truth or own.against_online)]
        rows += [] if online is None else [(f"{law}, learning online", online)]
        note = "  (against online, no truth)" if size is None else ""
        for title, error in rows:
            front, rear = error_cells(error, size)
            lines.append(f"{title:24} {name:40} {front:>16} {rear:>16}{note}")
    return "\n".join(lines)
