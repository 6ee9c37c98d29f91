"""Where frozen tires come from: a file, a network of one's own, or a drive to learn on."""

import argparse
from collections.abc import Sequence

import numpy as np

from identifier.method import FrozenModel
from identifier.methods import DEFAULT, REFERENCE
from identifier.model_file import load_model
from identifier.model_format import vehicle_numbers
from tireid.drive_learn import learn, learning_drive
from tireid.drive_runs import FROZEN, LEARNING, Conditions
from tireid.network_option import network_model
from tireid.progress import Ticker, say


def frozen_tires(
    options: argparse.Namespace, labels: Sequence[str], conditions: Conditions
) -> tuple[str, FrozenModel | None]:
    """Return where frozen tires come from, and the model where one is needed.

    Parameters
    ----------
    options : parsed arguments.
    labels : what the trackers are told.
    conditions : of the drives.

    Raises
    ------
    ValueError
        Where a file cannot be used, or a law runs away.
    """
    setup = conditions.setup
    if not {FROZEN, LEARNING} & set(labels):
        return "nothing was learnt", None
    if options.weights is not None:
        model = load_model(options.weights)
        if vehicle_numbers(model.vehicle) != vehicle_numbers(setup.vehicle):
            say(f"{options.weights} is of the car {model.vehicle.name!r}, another than is driven")
        return f"frozen ones from {options.weights}", model
    network = network_model(options, setup.vehicle, 1.0)
    if network is not None:
        return f"frozen ones from {options.network}", network
    law = REFERENCE if options.paper else DEFAULT
    recording = learning_drive(
        setup.car(open_field=True),
        conditions.sensors,
        np.random.default_rng([conditions.seed, 1]),
        grip=setup.grip,
        seed=conditions.seed,
        progress=Ticker("the drive to learn on"),
    )
    model = learn(law, recording, setup.vehicle)
    assert recording.a_y is not None
    return (
        f"frozen ones learnt by {law} on {recording.duration:.0f} s of random steering on an open "
        f"field, up to {np.abs(recording.a_y).max():.1f} m/s² sidewards"
    ), model
