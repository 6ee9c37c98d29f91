"""An identifier as clean C, and beside it as FMU, as ONNX and with a tracker: into one folder."""

from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from identifier.export.package import Package, build_package, readme
from identifier.export.processor import Cost, figures_text, measure, with_figures
from identifier.method import CannotFreezeError, Method
from identifier.methods import continuing
from identifier.run import History
from identifier.tire_model import TireModel
from models.vehicle import Vehicle, sedan
from tireid.output import output_folder

IDENTIFIER = "identifier"  # folder of the package where a tracker lies beside it


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Exported:
    """What was written.

    Parameters
    ----------
    folder : that was written.
    package : of the identifier.
    costs : on the processors that could be measured here.
    told : what is to be said of the tracker, line by line.
    """

    folder: Path
    package: Package
    costs: tuple[Cost, ...]
    told: tuple[str, ...]

    def __str__(self) -> str:
        lines = []
        for cost in self.costs:
            kind = "float" if cost.single else "double"
            lines.append(
                f"{cost.processor}, {kind}: {cost.replay.instructions} instructions a step, "
                f"{cost.flash} B flash, {cost.ram} B RAM, {cost.replay.stack} B stack"
            )
        wrote = f"wrote {self.folder}/, hash {self.package.about['hash']}"
        return "\n".join([*lines, *self.told, wrote])

    def __repr__(self) -> str:
        return f"<Exported {self.package.specialized.name} in {self.folder}>"


def export(
    source: History | TireModel | Method,
    folder: str | PathLike[str],
    *,
    vehicle: Vehicle | None = None,
    name: str = "tireid",
    single: bool = False,
    fmu: bool = False,
    onnx: bool = False,
    mpc: bool = False,
    overwrite: bool = False,
) -> Exported:
    """Write an identifier as C that goes on learning where the source ended.

    Parameters
    ----------
    source : a run, whose method goes on from its end; a tire model, from which the method that
        made it goes on; or a method, which begins afresh.
    folder : to write.
    vehicle : the car; None takes that of the run or the model, for a method the sedan.
    name : prefix of every symbol.
    single : float unless the build says double.
    fmu : also FMUs 2.0 and 3.0 for Co-Simulation.
    onnx : also the model, frozen, as ONNX.
    mpc : also a tracker that steers by what is learnt.
    overwrite : replace the folder if it exists.

    Raises
    ------
    ValueError
        Where no method goes on from the model, or what is asked for cannot be made of the method.
    FileExistsError
        Where the folder is not empty and is not to be replaced.
    OSError
        Where it cannot be written.
    """
    target = Path(folder)
    if not overwrite and target.is_dir() and any(target.iterdir()):
        raise FileExistsError(f"{target} is not empty: overwrite=True replaces it")
    start: TireModel | None = None
    if isinstance(source, History):
        method, car = source.design, vehicle or source.vehicle
        try:
            start = source.freeze()
        except CannotFreezeError:  # a filter of forces learns nothing that a run could begin with
            start = None
    elif isinstance(source, TireModel):
        start, car = source, vehicle or source.vehicle
        method = continuing(source, car)
    else:
        method, car = source, vehicle or sedan()
    return export_method(
        method,
        car,
        start,
        target,
        name=name,
        single=single,
        fmu=fmu,
        onnx=onnx,
        mpc=mpc,
        overwrite=overwrite,
    )


def export_method(
    method: Method,
    vehicle: Vehicle,
    start: TireModel | None,
    folder: Path,
    *,
    name: str,
    single: bool,
    fmu: bool,
    onnx: bool,
    mpc: bool,
    overwrite: bool,
) -> Exported:
    """Write a method as C.

    Parameters
    ----------
    method : the method.
    vehicle : the car.
    start : model to begin with; None begins afresh.
    folder : to write.
    name : prefix of every symbol.
    single : float unless the build says double.
    fmu : also FMUs 2.0 and 3.0.
    onnx : also the model, frozen, as ONNX.
    mpc : also a tracker.
    overwrite : replace the folder if it exists.

    Raises
    ------
    ValueError
        Where what is asked for cannot be made of the method.
    OSError
        Where the folder cannot be written.
    """
    package = build_package(method, vehicle, start, name=name, single=single)
    with output_folder(folder, force=overwrite) as scratch:
        costs = measure(package)
        place = scratch / IDENTIFIER if mpc else scratch
        write_files(place, package, figures_text(costs), costs)
        told = _write_tracker(scratch, package, single) if mpc else []
        if fmu:
            from identifier.export.fmu import export_fmu

            for version in (2, 3):
                export_fmu(
                    package.specialized,
                    scratch / f"{package.specialized.name}_fmi{version}.fmu",
                    version,
                )
        if onnx:
            _write_onnx(scratch, method, vehicle, package, start)
    return Exported(folder=folder, package=package, costs=tuple(costs), told=tuple(told))


def write_files(folder: Path, package: Package, figures: str, costs: Sequence[Cost] = ()) -> None:
    """Write a package.

    Parameters
    ----------
    folder : an empty folder.
    package : the package.
    figures : what it costs, as Markdown.
    costs : what it costs, for the JSON file.
    """
    manifest = f"{package.specialized.name}.json"
    texts = {**package.files, "README.md": readme(package, figures)}
    for path, text in {**texts, manifest: with_figures(texts[manifest], costs)}.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text, encoding="utf-8")


def _write_tracker(folder: Path, package: Package, single: bool) -> list[str]:
    from tireid.commands.export import write_tracker

    return write_tracker(folder, package, single=single)


def _write_onnx(
    folder: Path, method: Method, vehicle: Vehicle, package: Package, start: TireModel | None
) -> None:
    from identifier.export.onnx import export_onnx

    try:
        model = start or method.frozen(vehicle, package.specialized.carry)
    except CannotFreezeError as error:
        raise ValueError(f"--onnx: {error}") from error
    export_onnx(model, folder / f"{package.specialized.name}.onnx")
