"""The words of `tireid drive` made into a case, and a case told in words and numbers."""

import argparse
import hashlib
import json
import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from identifier.method import FrozenModel
from identifier.model_format import vehicle_numbers
from models.doors import require_few
from models.vehicle import Vehicle
from tireid.drive_options import parse_drop, parse_fault, parse_speed, require_friction
from tireid.drive_runs import FROZEN, LEARNING, LINEAR, ORACLE, Conditions
from tireid.drive_setup import PERIOD, make_setup, named_path

ALL = "all"
LONGEST_DELAY = 100.0  # ms


def labels_of(words: Sequence[str]) -> list[str]:
    """Return the tires in order, each once; all begins with the frozen ones.

    Parameters
    ----------
    words : names of tires, or all.
    """
    wanted = [FROZEN, LINEAR, ORACLE, LEARNING] if ALL in words else list(words)
    return list(dict.fromkeys(wanted))


def conditions_of(options: argparse.Namespace) -> Conditions:
    """Return what is to be driven.

    Parameters
    ----------
    options : parsed arguments.

    Raises
    ------
    ValueError
        Where a word or a file is not right.
    """
    if options.seed < 0:
        raise ValueError(f"--seed must not be negative, it is {options.seed}")
    if not 0.0 < options.laps <= 100.0:
        raise ValueError(f"--laps must be positive and at most 100, it is {options.laps:g}")
    path = named_path(options.path)
    if options.laps != 1.0 and not path.closed:
        raise ValueError(f"--laps is for a closed path, {path.name} is not")
    _require_one_source(options)
    setup = make_setup(
        path,
        vehicle=options.vehicle,
        plant=options.plant,
        mu=require_friction("--mu", options.mu),
        drops=[parse_drop(text) for text in options.mu_drop],
        wish=parse_speed(options.speed),
    )
    hours = options.laps * setup.time_at(setup.path.s[-2]) / 3600.0
    require_few(ValueError, f"--path {path.name}", hours, "hours", "hours of driving")
    return Conditions(
        setup=setup,
        delay=_periods(options.delay),
        noise=options.noise,
        seed=options.seed,
        laps=options.laps,
        faults=tuple(parse_fault(text) for text in options.fault),
    )


def _periods(delay: float) -> int:
    periods = delay / (1e3 * PERIOD)
    if not (0.0 <= delay <= LONGEST_DELAY and abs(periods - round(periods)) < 1e-9):
        raise ValueError(
            f"--delay must be 0 to {LONGEST_DELAY:g} ms in steps of {1e3 * PERIOD:g} ms, it is "
            f"{delay:g}"
        )
    return round(periods)


def _require_one_source(options: argparse.Namespace) -> None:
    given = [name for name in ("weights", "network", "paper") if getattr(options, name)]
    if len(given) > 1:
        raise ValueError(f"give only one of {', '.join('--' + name for name in given)}")


def headline(conditions: Conditions) -> str:
    """Return a case in one line.

    Parameters
    ----------
    conditions : of the drives.
    """
    setup = conditions.setup
    v = setup.speeds()
    speed = f"{v.min():.1f} m/s" if np.ptp(v) < 0.05 else f"{v.min():.1f} to {v.max():.1f} m/s"
    wish = setup.wish.share
    share = "" if wish is None else f", {100.0 * wish:.0f} % of a grip of {setup.grip:.1f} m/s²"
    drops = "".join(f", {mu:g} from {s:g} m on" for s, mu in setup.drops)
    noise = "sensor noise" if conditions.noise else "no noise"
    noise += "".join(f", {fault}" for fault in conditions.faults)
    return (
        f"{setup.path.name} at {speed}{share}; friction {setup.mu:g}{drops}; "
        f"{setup.plant} {setup.vehicle.name}, {1e3 * PERIOD * conditions.delay:g} ms delay, "
        f"{noise}, seed {conditions.seed}"
    )


def inputs_of(
    conditions: Conditions, labels: Sequence[str], source: str, learnt: FrozenModel | None
) -> dict[str, Any]:
    """Return all that goes into drives, ready for JSON.

    Parameters
    ----------
    conditions : of the drives.
    labels : what the trackers are told.
    source : where the frozen tires come from.
    learnt : the frozen tires.
    """
    setup = conditions.setup
    v = setup.speeds()
    return {
        "path": setup.path.name,
        "path_hash": digest([setup.path.X.tolist(), setup.path.Y.tolist()]),
        "length_m": setup.path.length,
        "closed": setup.path.closed,
        "laps": conditions.laps,
        "speed": {"share": setup.wish.share, "m_s": setup.wish.speed},
        "speed_m_s": {"min": float(v.min()), "max": float(v.max())},
        "grip_m_s2": setup.grip,
        "mu": setup.mu,
        "mu_drops": [{"s_m": s, "mu": mu} for s, mu in setup.drops],
        "tires": list(labels),
        "frozen": source,
        "weights_hash": None if learnt is None else digest(learnt.to_dict()),
        "plant": setup.plant,
        "vehicle": vehicle_numbers(setup.vehicle),
        "chassis": _chassis(setup.vehicle),
        "delay_ms": 1e3 * PERIOD * conditions.delay,
        "period_ms": 1e3 * PERIOD,
        "noise": conditions.noise,
        "faults": [_finite(asdict(fault)) for fault in conditions.faults],
        "seed": conditions.seed,
    }


def _finite(numbers: dict[str, Any]) -> dict[str, Any]:
    """Return the numbers with null for what has no end, which JSON cannot say."""
    return {key: None if value == math.inf else value for key, value in numbers.items()}


def _chassis(vehicle: Vehicle) -> dict[str, Any]:
    """Return the chassis, with a hash in place of the file of its tire."""
    chassis = vehicle.require_chassis()
    tire = None if chassis.tire is None else digest(Path(chassis.tire).read_text(errors="replace"))
    return {**asdict(chassis), "tire": tire}


def digest(content: Any) -> str:
    """Return twelve characters that stand for a content.

    Parameters
    ----------
    content : ready for JSON.
    """
    text = json.dumps(content, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:12]
