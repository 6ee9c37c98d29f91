"""`--network FILE.onnx`: a tire network of one's own in place of one that was learnt."""

import argparse
from pathlib import Path

from identifier.network import SIGNALS
from identifier.onnx_model import OnnxModel
from models.vehicle import Vehicle

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
