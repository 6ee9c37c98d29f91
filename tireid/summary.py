"""The machine-readable result of `tireid identify`: summary.json, whose keys are stable."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, is_dataclass
from typing import Any, cast

from identifier.certification import certify
from identifier.design import Design
from identifier.history import History
from identifier.method import Method
from identifier.model_format import vehicle_numbers
from identifier.reproducibility import (
    AxleRmse,
    Replay,
    Reproduction,
    force_rms,
    freeze_key,
    online_error,
)
from models.vehicle import Vehicle
from tireid import __version__


def _axles(error: AxleRmse | None) -> dict[str, float] | None:
    return None if error is None else {"front": error.front, "rear": error.rear}


def _sides(sides: Reproduction) -> dict[str, dict[str, float] | None]:
    return {
        "past_against_online": _axles(sides.past_against_online),
        "past_against_truth": _axles(sides.past_against_truth),
        "after_against_truth": _axles(sides.after_against_truth),
    }


def method_numbers(design: Method) -> dict[str, Any]:
    """Return gains, network, the rest of the design, and the seed (None without random weights).

    A method that is not the paper's has all its numbers under "gains" and no network.

    Parameters
    ----------
    design : any method.
    """
    if isinstance(design, Design):
        return {
            "gains": asdict(design.gains),
            "network": asdict(design.network),
            "design": {
                "input_source": design.input_source,
                "integrator": design.integrator,
                "dt_s": design.dt,
                "force_unit_N": design.force_unit,
                "min_speed_m_s": design.min_speed,
            },
            "seed": design.seed,
        }
    numbers: dict[str, Any] = asdict(cast(Any, design)) if is_dataclass(design) else {}
    return {
        "gains": numbers,
        "network": numbers.get("network"),
        "design": {"dt_s": design.dt, "min_speed_m_s": design.min_speed},
        "seed": numbers.get("seed"),
    }


def certificate_numbers(design: Method, vehicle: Vehicle) -> dict[str, Any]:
    """Return the verdict on a method, and which bounds hold of it whatever is measured.

    Parameters
    ----------
    design : any method.
    vehicle : the car.
    """
    certificate = certify(design, vehicle)
    return {"verdict": certificate.verdict, "held_by_construction": certificate.held}


def summarize(
    *,
    law: str,
    learnt: History,
    others: Sequence[History],
    frozen: Mapping[float, Mapping[str, Replay]],
) -> dict[str, Any]:
    """Return what summary.json holds: errors by recording and freeze time, and all that went in.

    All sums, of forces and of errors, are over the samples above the design's minimum speed. Those
    of `frozen` and `frozen_against_online` are over the whole recording; `reproducibility` splits
    the recording that was learnt at the freeze, and its `past_against_online` is the measure of the
    paper's section IV-A.

    Parameters
    ----------
    law : the law as the user named it.
    learnt : the online run that the weights come from.
    others : online runs of the same design over the other recordings.
    frozen : freeze time [s] to recording name to replay.
    """
    by_key = {freeze_key(t): replays for t, replays in frozen.items()}
    return summarize_replays(law, [learnt, *others], by_key)


def summarize_replays(
    law: str, runs: Sequence[History], frozen: Mapping[str, Mapping[str, Replay]]
) -> dict[str, Any]:
    """Return the same of any replays.

    Parameters
    ----------
    law : the law as the user named it.
    runs : online runs of one design, the first the one that was learnt.
    frozen : key in the summary to recording name to replay.
    """
    learnt = runs[0]
    return {
        "rms_force_N": {h.recording.name: _axles(force_rms(h)) for h in runs},
        "rmse_N": {
            "online": {h.recording.name: _axles(online_error(h)) for h in runs},
            "frozen": {
                key: {name: _axles(r.against_truth) for name, r in replays.items()}
                for key, replays in frozen.items()
            },
            "frozen_against_online": {
                key: {name: _axles(r.against_online) for name, r in replays.items()}
                for key, replays in frozen.items()
            },
            "reproducibility": {
                key: {name: _sides(r.reproduction) for name, r in replays.items() if r.reproduction}
                for key, replays in frozen.items()
            },
        },
        "law": law,
        **method_numbers(learnt.design),
        "certificate": certificate_numbers(learnt.design, learnt.vehicle),
        "vehicle": vehicle_numbers(learnt.vehicle),
        "diverged_at_s": learnt.diverged_at,
        "version": __version__,
    }
