"""Identifier and tracker together: both packages, what hands tires over, and a car to drive."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from codegen.errors import TireidError
from codegen.package import c_files, defines, generated, header
from codegen.template import Words, filled
from identifier.axle.model import AxleModel
from identifier.export.c_source import PREFIX
from identifier.export.package import Package
from identifier.inertial.motion import SENSORS
from identifier.method import CannotFreezeError
from identifier.paper.network import NetworkModel
from identifier.tire_model import TireModel
from models.vehicle import GRAVITY
from mpc.export.package import MpcPackage, build_mpc_package
from mpc.problem import Problem
from mpc.tires import prediction_tire

C = Path(__file__).parent / "pair"
_HANDOVER: Mapping[str, str] = {"tireid_handover.h": "include", "tireid_handover.c": "src"}
EXAMPLES: Mapping[str, str] = dict.fromkeys(
    ("closed_loop.c", "simulated_car.c", "simulated_car.h", "lane_changes.c", "lane_changes.h"),
    "examples",
)


class NoHandoverError(TireidError, ValueError):
    """What a method learns cannot be handed over in C."""


def frozen_start(package: Package) -> TireModel:
    specialized = package.specialized
    if specialized.vehicle.has_downforce:
        raise NoHandoverError(
            f"{specialized.vehicle.name} has downforce, which the handover in C does not model: "
            "export the identifier alone"
        )
    try:
        model = specialized.method.frozen(specialized.vehicle, specialized.carry)
    except CannotFreezeError as error:
        raise NoHandoverError(f"no tire to hand over: {error}") from error
    if model.kind not in _HANDOVERS:
        kind = type(model).__name__
        raise NoHandoverError(f"only networks and axle curves are handed over in C, not {kind}")
    return model


Numbers = dict[str, tuple[object, str]]
Arrays = dict[str, tuple[Sequence[float], str]]


def _of_curves(model: AxleModel, tracker: MpcPackage) -> tuple[Numbers, Arrays]:
    numbers = {
        "CURVES": (1, "identified are curves over slip; else a network"),
        "UNITS": (f"{len(model.ladder)}U", "of a curve"),
        "SWAY": (repr(GRAVITY / model.sway.frequency**2), "g over the roll's frequency^2 [m]"),
    }
    if model.tells_v_y:  # beside it the share of the sway is none of what is learnt
        share = repr(float(model.sway_share[0]))
        numbers |= {
            "SWAY_SHARE": (share, "of the sway of the body, not identified"),
            "STEERING": (f"{SENSORS.index('steering')}U", "which of the sensors' errors it is"),
        }
    return numbers, {"max_slip": (tracker.problem.limits.slip, "of the tracker, at most [rad]")}


def _of_network(model: NetworkModel, tracker: MpcPackage) -> tuple[Numbers, Arrays]:
    del tracker
    assert model.network.scale is not None, "an identified network has scales"
    numbers = {
        "CURVES": (0, "identified is a network; else curves over slip"),
        "UNITS": (f"{model.network.hidden}U", "of the hidden layer"),
        "INPUTS": (f"{len(model.network.inputs)}U", "of the network"),
        "FORCE_UNIT": (repr(float(model.force_unit)), "of the weights [N]"),
    }
    return numbers, {
        "stiffness": (model.vehicle.bicycle[4:], "of the tire that they correct [N/rad]"),
        "scale": (model.network.scale, "of the inputs [SI]"),
    }


DELAY = 0.03  # s, of the export; a number of the parameters


class Pair(NamedTuple):
    """Two packages and the files beside their folders `identifier/` and `mpc/`, by path."""

    identifier: Package
    tracker: MpcPackage
    files: Mapping[str, str]


def build_pair(
    identifier: Package,
    problem: Problem | None = None,
    *,
    single: bool = False,
    caution: float = 0.0,
) -> Pair:
    """Return the tracker that goes with an identifier, one step a sample, and what joins them.
    identifier : package of the identifier; its weights are the tire that is begun with.
    single : whether float is the default precision of the tracker.
    caution : of the tracker, from 0 to 1; a number of the parameters.
    """
    specialized, model = identifier.specialized, frozen_start(identifier)
    name = specialized.name
    tracker = build_mpc_package(
        prediction_tire(model),
        problem,
        period=specialized.dt,
        delay=DELAY,
        name=f"{name}_mpc",
        single=single,
        caution=caution,
    )
    values = {
        "name": name,
        "NAME": name.upper(),
        "version": identifier.about["version"],
        "vehicle": Words(specialized.vehicle.name),
        "identifier_hash": identifier.about["hash"],
        "mpc_hash": tracker.about["hash"],
    }
    files = {path: filled(C / path, values) for path in ("CMakeLists.txt", "README.md")}
    files |= c_files(C, EXAMPLES, {PREFIX: name})
    force = {"MAX_FORCE": (repr(round(specialized.limits.force, 1)), "of an axle [N]")}
    numbers, arrays = _HANDOVERS[model.kind](model, tracker)
    files |= c_files(C, _HANDOVER, {PREFIX: name})
    files[f"src/{name}_handover_tables.h"] = header(
        f"{name}_handover_tables.h",
        f"Numbers of the handover.\n\n{generated(identifier.about)}",
        [
            f'#include "{name}_mpc.h"\n',
            defines(f"{name}_handover", {**numbers, **force}),
            "".join(
                f"static const {name}_mpc_real {array}[{len(given)}] = {{ "
                f"{', '.join(f'({name}_mpc_real){float(value)!r}' for value in given)} }}; "
                f"/* {words} */\n"
                for array, (given, words) in arrays.items()
            ),
        ],
    )
    return Pair(identifier, tracker, files)


_HANDOVERS: Mapping[str, Callable[[Any, MpcPackage], tuple[Numbers, Arrays]]] = {
    AxleModel.kind: _of_curves,
    NetworkModel.kind: _of_network,
}
