"""An identifier as clean C, and beside it as FMU, as ONNX and with a tracker: into one folder."""

import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import NamedTuple

from codegen import find_compiler
from codegen.compiler import NoCompilerError
from codegen.errors import TireidError
from codegen.processor import Cost, with_figures
from codegen.writing import write_file
from identifier.export.package import Package, build_package, readme
from identifier.export.processor import figures_text, measure
from identifier.method import CannotFreezeError, Method
from identifier.methods import continuing
from identifier.tire_model import TireModel
from models.vehicle import Vehicle, sedan
from mpc.export.package import mpc_readme
from mpc.export.pair import build_pair, frozen_start
from mpc.export.processor import measure_mpc, mpc_figures_text, time_here
from tireid.output import output_folder
from tireid.progress import Progress
from tireid.run import Run

_IDENTIFIER = "identifier"  # folder of the package where a tracker lies beside it
_COSTS, _TRACKING, _UNITS, _NETWORK = "costs on Arm processors", "the tracker", "FMUs", "ONNX"
_BESIDE = (".fmu", ".onnx")  # of the package
UNCALIBRATED = (
    "the band assumes the declared sensor errors: begin with the model of a drive to calibrate it"
)
_PARTS = (  # of an export: about how long each takes, and the option that asks for it
    ("the identifier", 1.0, ""),
    (_NETWORK, 1.0, "onnx"),
    (_COSTS, 17.0, ""),
    (_TRACKING, 17.0, "mpc"),
    (_UNITS, 8.0, "fmu"),
)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Exported:
    """What was written."""

    folder: Path
    package: Package
    costs: tuple[Cost, ...]
    notes: tuple[str, ...]

    def __str__(self) -> str:
        lines = [f"{cost.processor}, {cost.precision}: {cost.words}" for cost in self.costs]
        wrote = f"wrote {self.folder}/, hash {self.package.about['hash']}"
        step = self.package.specialized
        needs = [port.name for port in step.inputs if port.name != "v_y" or not step.tells_v_y]
        reads = f"{type(step.method).__name__} reads {', '.join(needs)}"
        reads += "; v_y is an output" if step.tells_v_y else ""
        reads += f"; one step each {1e3 * step.dt:g} ms"
        files = [path.name for path in sorted(self.folder.glob("*.*")) if path.suffix in _BESIDE]
        warnings = [UNCALIBRATED] if step.tells_band and step.band is None else []
        wrote = ", ".join([wrote, *files])
        return "\n".join([*lines, *self.notes, reads, *warnings, wrote])

    def __repr__(self) -> str:
        return f"<Exported {self.package.specialized.name} in {self.folder}>"


def export(
    source: Run | TireModel | Method,
    folder: str | PathLike[str],
    *,
    start: TireModel | None = None,
    vehicle: Vehicle | None = None,
    name: str = "tireid",
    single: bool = False,
    with_a_y: bool = False,
    band: bool = False,
    fmu: bool = False,
    onnx: bool = False,
    mpc: bool = False,
    caution: float = 0.0,
    overwrite: bool = False,
) -> Exported:
    """Write an identifier as C that goes on learning where the source ended.

    Parameters
    ----------
    source : a run, whose method goes on from its end; a tire model, from which the method that
        made it goes on; or a method, which begins afresh. From a fit the axle identifier goes on.
    folder : to write.
    start : model that a method begins with; None begins afresh.
    vehicle : the car; None takes that of the run or the model, for a method the sedan.
    name : prefix of every symbol.
    single : float unless the build says double.
    with_a_y : a_y of an accelerometer is an input too, of a method that can go without it.
    band : half the width of the band of 90 % around each force is an output too; of a run it is
        calibrated, of a model as far as that is.
    fmu : also FMUs 2.0 and 3.0 for Co-Simulation.
    onnx : also the model, frozen, as ONNX.
    mpc : also a tracker that steers by the identified tires.
    caution : of that tracker, from 0 to 1, as `drive` has it.
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
    if isinstance(source, Run):
        method, car = source.method, vehicle or source.vehicle
        try:
            start = source.tire if band else source.freeze()
        except CannotFreezeError:  # a filter of forces learns nothing that a run could begin with
            start = None
        if method.whole and start is not None:
            measured = source.recording.logged_v_y is not None
            method = continuing(start, car, method.dt, v_y=measured)
    elif isinstance(source, TireModel):
        start, car = source, vehicle or source.vehicle
        method = continuing(source, car)
    else:
        method, car = source, vehicle or sedan()
    parts = [word for word, on in (("mpc", mpc), ("fmu", fmu), ("onnx", onnx)) if on]
    lasts = {title: seconds for title, seconds, wanted in _PARTS if wanted in ("", *parts)}
    with output_folder(target, force=overwrite) as scratch:
        progress = Progress("export", lasts, long=True)
        package = build_package(
            method, car, start, name=name, single=single, with_a_y=with_a_y, with_band=band
        )
        if onnx:  # what cannot be made is refused before costs are measured
            progress.begin(_NETWORK)
            from identifier.export.onnx import onnx_bytes

            try:
                model = start or method.frozen(car, package.specialized.carry)
            except CannotFreezeError as error:
                raise ValueError(f"--onnx: {error}") from error
            write_file(scratch / f"{name}.onnx", onnx_bytes(model, with_band=band))
        if mpc:
            frozen_start(package)  # likewise
        costs = measure(package, progress.begin(_COSTS))
        texts = {**package.files, "README.md": readme(package, figures_text(costs))}
        _write_package(scratch / _IDENTIFIER if mpc else scratch, name, texts, costs)
        notes = []
        if mpc:
            progress.begin(_TRACKING)
            notes = write_tracker(scratch, package, single=single, caution=caution)
        if fmu:
            progress.begin(_UNITS)
            from identifier.export.fmu import export_fmu

            for version in (2, 3):
                export_fmu(package.specialized, scratch / f"{name}_fmi{version}.fmu", version)
                progress.step(2)
    return Exported(folder=target, package=package, costs=tuple(costs), notes=tuple(notes))


def _write_package(
    folder: Path, name: str, texts: Mapping[str, str], costs: Sequence[Cost]
) -> None:
    manifest = f"{name}.json"
    _write_texts(folder, {**texts, manifest: with_figures(texts[manifest], costs)})


def _write_texts(folder: Path, texts: Mapping[str, str]) -> None:
    for path, text in texts.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        write_file(folder / path, text)


def write_tracker(folder: Path, package: Package, *, single: bool, caution: float) -> list[str]:
    """Write the tracker and what joins it with the identifier; return what to say about it.

    single : whether float is the default precision.   caution : of the tracker, from 0 to 1.
    """
    try:
        pair = build_pair(package, single=single, caution=caution)
    except NoCompilerError as error:
        raise ValueError(f"--mpc: {error}") from error
    tracker = pair.tracker
    costs, times = measure_mpc(tracker), time_here(tracker)
    texts = {**tracker.files, "README.md": mpc_readme(tracker, mpc_figures_text(costs, times))}
    _write_texts(folder, pair.files)
    _write_package(folder / "mpc", tracker.name, texts, costs)
    return [
        *(f"{one.processor}, {one.precision}: {tracker.name} takes {one.words}" for one in costs),
        f"this machine: {tracker.name} takes {times.median:.0f} us a step, hash "
        f"{tracker.about['hash']}",
    ]


_FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fno-math-errno", "-Iinclude", "-Isrc")


class SelfTestError(TireidError, RuntimeError):
    """A package does not compile or fails its own test; the message holds what was printed."""


class Verdict(NamedTuple):
    """What a self-test printed: version and precision, the largest difference, "passed"."""

    version: str
    difference: str
    verdict: str


def self_test(folder: Path, name: str, *, single: bool) -> Verdict | None:
    """Compile and run the self-test of a package; None where there is no C compiler."""
    compiler = find_compiler()
    if compiler is None:
        return None
    sources = [str(p.relative_to(folder)) for p in sorted((folder / "src").glob("*.c"))]
    with tempfile.TemporaryDirectory(prefix="tireid-") as scratch:
        program = Path(scratch) / "self_test"
        options = [f"-D{name.upper()}_SINGLE={int(single)}", *sources, f"tests/test_{name}.c"]
        build = [*compiler, *_FLAGS, *options, "-o", str(program), "-lm"]
        for command in (build, [str(program)]):
            answer = subprocess.run(
                command, cwd=folder, capture_output=True, text=True, check=False
            )
            if answer.returncode != 0:
                lines = (answer.stdout + answer.stderr).splitlines()
                raise SelfTestError(f"the package {folder} fails its self-test: {lines[:5]}")
    return Verdict(*answer.stdout.splitlines()[-3:])
