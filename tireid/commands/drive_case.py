"""The words of `tireid drive` made into a case: path, car, road, and where its tires are from."""

import argparse
import math
import re
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path as FilePath

import numpy as np

from identifier.frozen import VEHICLE_KEYS
from identifier.tire_model import TireModel
from models.faults import SIZED, FaultError, SensorFault
from models.rules import require_within
from models.schema import require_few
from models.vehicle import Vehicle
from mpc.loop.sensing import CarSensors, FaultySensors, imu_and_localization
from mpc.path import BUILT_IN, Path
from tireid.commands.options import (
    chosen_method,
    read_vehicle,
    require_one,
    seed_of,
    stored_model,
)
from tireid.driving import runs
from tireid.driving.chosen import CHOSEN as DRIVING_CHOSEN
from tireid.driving.learn import learning_drive
from tireid.driving.setup import Setup, SpeedWish
from tireid.learning import identify
from tireid.verdicts import warn_of

_PLAIN = 1.5  # a number without a unit up to here is a share of the grip


def _parse_speed(text: str) -> SpeedWish:
    """Return what --speed says.

    text : 90% or 0.9 of the grip, 17m/s or 60km/h.
    """
    found = re.fullmatch(r"\s*([-+.\deE]+?)\s*(%|m/s|km/h)?\s*", text, re.ASCII)
    value, unit = math.nan, None
    with suppress(ValueError):
        value, unit = (float(found[1]), found[2]) if found else (value, unit)
    if not 0.0 < value < math.inf:
        raise ValueError(f"--speed wants a share of the grip or a speed (90%, 17m/s), not {text!r}")
    if unit is None and value > _PLAIN:
        raise ValueError(f"--speed {text} has no unit: write {text}%, {text}m/s or {text}km/h")
    if unit in ("m/s", "km/h"):
        speed = value / (3.6 if unit == "km/h" else 1.0)
        if not 3.0 <= speed <= 100.0:
            raise ValueError(f"--speed must be 3 to 100 m/s, it is {speed:.3g} m/s")
        return SpeedWish(None, speed)
    share = value / (100.0 if unit == "%" else 1.0)
    if not 0.05 <= share <= _PLAIN:
        raise ValueError(f"--speed must be 5 to 150 % of the grip, it is {100.0 * share:.3g} %")
    return SpeedWish(share, None)


def _parse_drop(text: str) -> tuple[float, float]:
    """Return the place [m] and the friction from there on [-] of --mu-drop S:MU.

    text : such as 60:0.5.
    """
    s = mu = math.nan
    with suppress(ValueError):
        s, mu = map(float, text.split(":"))
    if math.isnan(s) or math.isnan(mu):
        raise ValueError(f"--mu-drop wants S:MU, arc length [m] and friction, not {text!r}")
    if not 0.0 <= s < math.inf:
        raise ValueError(f"--mu-drop: the place must not be negative, it is {s:g} m")
    require_within(ValueError, *DRIVING_CHOSEN.frictions, **{"friction of --mu-drop": mu})
    return s, mu


def parse_fault(text: str, kind: str = runs.FULL) -> SensorFault:
    """Return what --fault says of a sensor.

    text : CHANNEL:KIND:START:DURATION[:SIZE], such as v_y:biased:3:inf:0.5.
    kind : of the sensors, of `SENSORS`.
    """
    words = text.split(":")
    try:
        channel, how, *numbers = words
        start, duration, *size = map(float, numbers)
        (most,) = size or [0.0]
    except ValueError:
        raise ValueError(
            f"--fault wants CHANNEL:KIND:START:DURATION[:SIZE], times in s, not {text!r}"
        ) from None
    try:
        fault = SensorFault(channel=channel, kind=how, start=start, duration=duration, size=most)
        sensors = imu_and_localization(None) if kind == runs.IMU else CarSensors()
        FaultySensors(sensors, [fault])  # refuses what is no channel
    except FaultError as error:
        raise ValueError(f"--fault {text}: {error}") from None
    if how in SIZED and not size:
        raise ValueError(f"--fault {text}: {how} needs a size")
    return fault


ALL = "all"


def labels_of(words: Sequence[str]) -> list[str]:
    """Return the tires in order, each once; all begins with the frozen ones."""
    wanted = [runs.FROZEN, runs.LINEAR, runs.ORACLE, runs.LEARNING] if ALL in words else list(words)
    return list(dict.fromkeys(wanted))


def conditions_of(options: argparse.Namespace) -> runs.Conditions:
    if not 0.0 < options.laps <= 100.0:
        raise ValueError(f"--laps must be positive and at most 100, it is {options.laps:g}")
    require_within(ValueError, *DRIVING_CHOSEN.frictions, **{"--mu": options.mu})
    require_within(ValueError, 0.0, 1.0, **{"--caution": options.caution})
    name = options.path
    if name not in BUILT_IN and not FilePath(name).suffix:
        raise ValueError(f"--path: there is no path {name!r}; {', '.join(BUILT_IN)}, or FILE.csv")
    path = BUILT_IN[name]() if name in BUILT_IN else Path.from_csv(FilePath(name))
    if options.laps != 1.0 and not path.closed:
        raise ValueError(f"--laps is for a closed path, {path.name} is not")
    require_one(options, "weights", "method", "paper", "design")
    vehicle, wish = read_vehicle(options), _parse_speed(options.speed)
    vehicle.require_chassis()
    drops = tuple(sorted(_parse_drop(text) for text in options.mu_drop))
    for s, _ in drops:
        if not path.closed and s >= path.length:
            raise ValueError(f"--mu-drop {s:g} is beyond the path, which is {path.length:.0f} m")
    setup = Setup(path=path, vehicle=vehicle, mu=options.mu, drops=drops, wish=wish)
    hours = options.laps * setup.time_at(setup.path.s[-2]) / 3600.0
    require_few(ValueError, f"--path {path.name}", hours, "hours", "hours of driving")
    return runs.Conditions(
        setup=setup,
        delay=runs.delay_periods(1e-3 * options.delay, "--delay"),
        noise=options.noise,
        seed=seed_of(options),
        laps=options.laps,
        faults=tuple(parse_fault(text, options.sensors) for text in options.fault),
        caution=options.caution,
        kind=options.sensors,
    )


def frozen_tires(
    options: argparse.Namespace, labels: Sequence[str], conditions: runs.Conditions
) -> tuple[str, TireModel | None]:
    """Return where frozen tires come from, and the model where one is needed."""
    setup = conditions.setup
    if not {runs.FROZEN, runs.LEARNING} & set(labels):
        return "no tires were identified", None
    if options.weights is not None:
        model = stored_model(options.weights)
        assert model is not None
        _require_its_car(options, model.vehicle, setup)
        return f"frozen ones from {options.weights}", model
    law, method = chosen_method(options, setup.vehicle)
    recording = learning_drive(
        setup.car(open_field=True),
        conditions.sensors,
        np.random.default_rng([conditions.seed, 1]),
        grip=setup.grip,
        seed=conditions.seed,
        lateral=conditions.lateral(),
    )
    run = identify(recording, setup.vehicle, method, check=False)
    warn_of(run.verdict, f"the identification drive of {law}")
    assert recording.a_y is not None
    learnt = run.tire if conditions.caution > 0.0 else run.freeze()
    return (
        f"frozen ones identified by {law} on {recording.duration:.0f} s of random steering on an "
        f"open field, up to {np.abs(recording.a_y).max():.1f} m/s² sidewards"
    ), learnt


def _require_its_car(options: argparse.Namespace, learnt: Vehicle, setup: Setup) -> None:
    """Refuse tires that were learnt on another car than is driven, whatever either is called."""
    if learnt.bicycle == setup.vehicle.bicycle:
        return
    mine = f"{options.weights} was identified on the car {learnt.name!r}, driven is "
    driven = setup.vehicle
    apart = "; ".join(
        f"{key} {getattr(learnt, key):.6g} there, {getattr(driven, key):.6g} here"
        for key in VEHICLE_KEYS
        if key != "name" and getattr(learnt, key) != getattr(driven, key)
    )
    raise ValueError(
        f"{mine}{driven.name!r} ({apart}): give that car by --vehicle FILE, with its table "
        "[chassis] (tireid init writes one, see docs/driving.md), or leave --weights out to "
        "identify the driven car"
    )
