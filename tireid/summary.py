"""The machine-readable result of `tireid identify`: summary.json, whose keys are stable."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from identifier.history import History
from identifier.reproducibility import AxleRmse, Replay, axle_rms, online_error
from models.vehicle import Vehicle


def program_version() -> str:
    """Return the version of tireid."""
    try:
        return version("tireid")
    except PackageNotFoundError:  # run from a checkout that is not installed
        return "unknown"


def _axles(error: AxleRmse | None) -> dict[str, float] | None:
    return None if error is None else {"front": error.front, "rear": error.rear}


def vehicle_numbers(vehicle: Vehicle) -> dict[str, Any]:
    """Return the name and the six numbers of the bicycle, SI.

    Parameters
    ----------
    vehicle : the car.
    """
    return {"name": vehicle.name, **vehicle.bicycle._asdict()}


def summarize(
    *,
    law: str,
    learnt: History,
    others: Sequence[History],
    frozen: Mapping[float, Mapping[str, Replay]],
) -> dict[str, Any]:
    """Return what summary.json holds: errors by recording and freeze time, and all that went in.

    Parameters
    ----------
    law : the law as the user named it.
    learnt : the online run that the weights come from.
    others : online runs of the same design over the other recordings.
    frozen : freeze time [s] to recording name to replay.
    """
    runs = [learnt, *others]
    truth = {h.recording.name: h.recording.axle_force for h in runs}
    gains = learnt.design.gains
    return {
        "rms_force_N": {
            name: None if force is None else _axles(axle_rms(force))
            for name, force in truth.items()
        },
        "rmse_N": {
            "online": {h.recording.name: _axles(online_error(h)) for h in runs},
            "frozen": {
                f"{t:g}": {name: _axles(r.against_truth) for name, r in replays.items()}
                for t, replays in frozen.items()
            },
            "frozen_against_online": {
                f"{t:g}": {name: _axles(r.against_online) for name, r in replays.items()}
                for t, replays in frozen.items()
            },
        },
        "law": law,
        "gains": asdict(gains),
        "network": asdict(learnt.design.network),
        "design": {
            "input_source": learnt.design.input_source,
            "integrator": learnt.design.integrator,
            "dt_s": learnt.design.dt,
            "force_unit_N": learnt.design.force_unit,
            "min_speed_m_s": learnt.design.min_speed,
        },
        "vehicle": vehicle_numbers(learnt.vehicle),
        "seed": learnt.design.seed,
        "diverged_at_s": learnt.diverged_at,
        "version": program_version(),
    }
