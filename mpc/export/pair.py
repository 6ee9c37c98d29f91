"""Identifier and tracker together: both packages, what hands tires over, and a car to drive."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from codegen.template import Words, filled
from identifier.axle.model import AxleModel
from identifier.axle.slip import SHORTEST
from identifier.export.package import Package
from identifier.method import CannotFreezeError
from identifier.paper.network import NetworkModel
from identifier.tire_model import TireModel
from models.vehicle import GRAVITY
from mpc.export.package import MpcPackage, build_mpc_package
from mpc.problem import Problem
from mpc.tires import prediction_tire

# C that turns what an identifier has learnt into the weights of the prediction.

TEMPLATES = Path(__file__).parent / "pair"


class NoHandoverError(ValueError):
    """What a method learns cannot be handed over in C."""


def frozen_start(package: Package) -> TireModel:
    """Return the model that an exported identifier begins with.

    Parameters
    ----------
    package : of the identifier.

    Raises
    ------
    NoHandoverError
        Where the method learns neither a network nor axle curves.
    """
    specialized = package.specialized
    try:
        model = specialized.method.frozen(specialized.vehicle, specialized.carry)
    except CannotFreezeError as error:
        raise NoHandoverError(f"no tire to hand over: {error}") from error
    if model.kind not in HANDOVERS:
        kind = type(model).__name__
        raise NoHandoverError(f"only networks and axle curves are handed over in C, not {kind}")
    return model


class Handover(NamedTuple):
    """C that turns one kind of model into weights of the prediction.

    values : of its template.   conversion : the template.   slope_rule : what else is refused.
    adapt : C that goes before it.
    """

    values: Mapping[str, Any]
    conversion: str
    slope_rule: str = ""
    adapt: str = ""


def _axle_handover(model: AxleModel, tracker: MpcPackage) -> Handover:
    return Handover(
        {
            "units": len(model.ladder),
            "sway": repr(GRAVITY / model.sway.frequency**2),
            "shortest": repr(SHORTEST * model.vehicle.wheelbase),
            "load": _numbers(model.vehicle.axle_loads),
            "ladder": _numbers(model.ladder),
            "max_slip": _numbers(tracker.problem.limits.slip),
        },
        "axle.c",
        ",\n * or force that does not rise with slip",
        (TEMPLATES / "adapt_axle.c").read_text(encoding="utf-8"),
    )


def _network_handover(model: NetworkModel, tracker: MpcPackage) -> Handover:
    del tracker
    return Handover(
        {
            "units": model.network.hidden,
            "inputs": len(model.network.inputs),
            "force_unit": repr(float(model.force_unit)),
            "stiffness": _numbers(model.vehicle.bicycle[4:]),
            "scale": _numbers(model.network.scale),
        },
        "network.c",
    )


HANDOVERS: Mapping[str, Callable[[Any, MpcPackage], Handover]] = {
    AxleModel.kind: _axle_handover,
    NetworkModel.kind: _network_handover,
}


def handover_sources(identifier: Package, tracker: MpcPackage) -> dict[str, str]:
    """Return header and source by path.

    Parameters
    ----------
    identifier : package of the identifier.
    tracker : package of the tracker, `<name>_mpc`, for the tire of `frozen_start`.

    Raises
    ------
    NoHandoverError
        Where the method learns neither a network nor axle curves.
    """
    name, model = identifier.specialized.name, frozen_start(identifier)
    about = {
        "name": name,
        "NAME": name.upper(),
        "version": identifier.about["version"],
        "max_force": repr(round(identifier.specialized.limits.force, 1)),
    }
    values, conversion, slope_rule, adapt = HANDOVERS[model.kind](model, tracker)
    text = filled(TEMPLATES / conversion, {**about, **{k: str(v) for k, v in values.items()}})
    body = {
        **about,
        "include": "#include <math.h>\n" if adapt else "",
        "conversion": text,
        "adapt": adapt,
        "slope_rule": slope_rule,
    }
    return {
        f"include/{name}_handover.h": filled(TEMPLATES / "handover.h", body),
        f"src/{name}_handover.c": filled(TEMPLATES / "handover.c", body),
    }


def _numbers(values: Any) -> str:
    return ", ".join(f"(real){float(value)!r}" for value in values)


EXAMPLES = (
    "closed_loop.c",
    "simulated_car.c",
    "simulated_car.h",
    "lane_changes.c",
    "lane_changes.h",
)
LEARNT_PEAK = "0.15"  # m, of the example in its last pass: a few centimeters are usual
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
    delay: float = DELAY,
    single: bool = False,
) -> Pair:
    """Return the tracker that goes with an identifier, one step a sample, and what joins them.

    Parameters
    ----------
    identifier : package of the identifier; its weights are the tire that is begun with.
    problem : of the tracker.
    delay : from a measurement until its command acts [s].
    single : whether float is the default precision of the tracker.

    Raises
    ------
    NoHandoverError
        Where the method learns neither a network nor axle curves.
    NoCompilerError
        Where there is no C compiler.
    """
    specialized = identifier.specialized
    tracker = build_mpc_package(
        prediction_tire(frozen_start(identifier)),
        problem,
        period=specialized.dt,
        delay=delay,
        name=f"{specialized.name}_mpc",
        single=single,
    )
    values: dict[str, str | Words] = {
        "name": specialized.name,
        "NAME": specialized.name.upper(),
        "version": identifier.about["version"],
        "vehicle": Words(specialized.vehicle.name),
        "identifier_hash": identifier.about["hash"],
        "mpc_hash": tracker.about["hash"],
        "learnt_peak": LEARNT_PEAK,
    }
    files = {f"examples/{path}": filled(TEMPLATES / path, values) for path in EXAMPLES}
    files |= {path: filled(TEMPLATES / path, values) for path in ("CMakeLists.txt", "README.md")}
    return Pair(identifier, tracker, files | handover_sources(identifier, tracker))
