"""What commands read: recordings that are judged against physics and the vehicle."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from identifier.own_network import OnnxModel
from identifier.paper.network import SIGNALS
from models.recordings import (
    Recording,
    check_against_vehicle,
    read_recording,
    split_log_argument,
)
from models.vehicle import Vehicle
from tireid.progress import say


def read_log(
    log: str,
    vehicle: Vehicle,
    *,
    run_name: str | None = None,
    columns: Sequence[str] = (),
    check: bool = True,
    dt: float = 0.01,
) -> Recording:
    """Read a recording and say what was read.

    Parameters
    ----------
    log : path, or path:run.
    vehicle : the car that is said to have driven.
    run_name : run of the file, if `log` does not name it.
    columns : NAME=COLUMN, each a column of the file to be read as NAME.
    check : whether a log that contradicts physics or the vehicle is refused.
    dt : sampling interval that it is brought to [s].

    Raises
    ------
    ValueError
        One line, where the words or the file are not right.
    """
    path, named = split_log_argument(log)
    if named is not None and run_name is not None and named != run_name:
        raise ValueError(f"{log} names the run {named}, --run names {run_name}: name one of them")
    recording = read_recording(
        path, run=run_name or named, dt=dt, check=check, columns=column_names(columns)
    )
    if check:
        check_against_vehicle(recording, vehicle)
    say(f"read {recording.name}: {recording.t.size} samples, {recording.duration:.1f} s")
    return recording


def column_names(pairs: Sequence[str]) -> dict[str, str]:
    """Return the columns of a file by the name that they are read as.

    Parameters
    ----------
    pairs : NAME=COLUMN.

    Raises
    ------
    ValueError
        Where a word is not such a pair.
    """
    columns = {}
    for pair in pairs:
        name, equals, column = pair.partition("=")
        if not (name and equals and column):
            raise ValueError(f"--columns wants NAME=COLUMN, not {pair!r}")
        columns[name] = column
    return columns


# `--network FILE.onnx`: a tire network of one's own in place of one that was learnt.

CONVENTIONS = (
    "A network of --network is static: its outputs are the lateral forces F_yf, F_yr of both tires "
    "of an axle [N], left positive, frame of the body; its inputs are slip angles alpha_f, alpha_r "
    "[rad] in the sign in which F_y = +C alpha, alpha = delta - (v_y +- l r)/v_x, or v_x, v_y "
    "[m/s], r [rad/s], delta_f, delta_r [rad], all SI, not scaled. Input tensors that bear the "
    "names of signals are taken by name, else two columns are alpha_f, alpha_r and five are v_x, "
    "v_y, r, delta_f, delta_r. Tensors are float32 or float64, (columns,) or (batch, columns)."
)


def add_network_arguments(parser: argparse.ArgumentParser, what: str) -> None:
    """Add the option and what belongs to it.

    Parameters
    ----------
    parser : of a command.
    what : what the command does with the network, for the help.
    """
    group = parser.add_argument_group("a tire network of your own", CONVENTIONS)
    group.add_argument("--network", type=Path, metavar="FILE.onnx", help=what)
    group.add_argument(
        "--network-inputs",
        nargs="+",
        metavar="SIGNAL",
        help=f"what its columns are, in order, of {', '.join(SIGNALS)}",
    )
    group.add_argument(
        "--network-iso",
        action="store_true",
        help="its slip angles have the sign of ISO 8855, in which F_y = -C alpha",
    )


def network_model(
    options: argparse.Namespace, vehicle: Vehicle, min_speed: float
) -> OnnxModel | None:
    """Return the network as a frozen model, None where there is none.

    Parameters
    ----------
    options : parsed arguments.
    vehicle : the car, which makes slip angles.
    min_speed : below this speed [m/s] the forces read zero.

    Raises
    ------
    ValueError
        Where the file cannot be used, or options belong to a network that is not given.
    """
    if options.network is None:
        if options.network_inputs or options.network_iso:
            raise ValueError("--network-inputs and --network-iso go with --network FILE.onnx")
        return None
    inputs = options.network_inputs
    return OnnxModel.from_onnx(
        options.network,
        vehicle,
        min_speed=min_speed,
        inputs=None if inputs is None else tuple(inputs),
        slip_sign=-1 if options.network_iso else 1,
    )
