"""A specialized step as an FMU for Co-Simulation: description, sources, binaries in one file."""

import hashlib
import io
import logging
import platform
import shutil
import subprocess
import tempfile
import zipfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path, PurePosixPath
from typing import Literal, NamedTuple
from xml.etree.ElementTree import Element, indent, tostring

from codegen import CompilationError, find_compiler
from codegen.compiler import KEEP_GUARDS
from codegen.escape import visible
from codegen.package import c_files, header
from codegen.writing import write_file
from identifier.export.c_source import PREFIX, c_sources
from identifier.export.package import ingredients, summary
from identifier.export.specialize import SpecializedStep
from models.files import write_atomically

# Shared libraries of an FMU, for the machine at hand and, with MinGW, for Windows.

log = logging.getLogger("tireid.export")

MINGW = "x86_64-w64-mingw32-gcc"
# As elsewhere: no contraction, the same bits on every machine; guards against NaN stay.
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fno-math-errno", "-fvisibility=hidden")


class Target(NamedTuple):
    """A platform: its folder in FMI 2.0 and 3.0, ending of a library, and how it is built."""

    folder_2: str
    folder_3: str
    ending: str
    compiler: tuple[str, ...]
    flags: tuple[str, ...]


def targets() -> tuple[Target, ...]:
    """Return the platforms that can be built for here; none where there is no compiler."""
    found = []
    compiler = find_compiler()
    if compiler and (platform.system(), platform.machine()) == ("Linux", "x86_64"):
        found.append(
            Target("linux64", "x86_64-linux", ".so", compiler, ("-fPIC", "-shared", "-lm"))
        )
    mingw = shutil.which(MINGW)
    if mingw:
        flags = ("-shared", "-static-libgcc", "-Wl,--no-insert-timestamp", "-s")
        found.append(Target("win64", "x86_64-windows", ".dll", (mingw,), flags))
    return tuple(found)


Files = tuple[tuple[str, bytes], ...]  # content by name


def build_binary(
    target: Target, name: str, model: Mapping[str, bytes], around: Mapping[str, bytes]
) -> bytes:
    """Compile sources to a shared library and return its content.
    model : content by name of C files and headers that need no other: compiled once for both
        versions of FMI, since the equations take longest.
    """
    built = _objects(target, tuple(sorted(model.items())))
    with _folder_of({**model, **around, **dict(built)}) as folder:
        library = f"{name}{target.ending}"
        words = [*_c_files(around), *(file for file, _ in built), "-o", library]
        _compile(target, words, folder)
        log.info("compiled %s for %s", library, target.folder_2)
        return (folder / library).read_bytes()


@lru_cache(maxsize=4)
def _objects(target: Target, model: Files) -> Files:
    with _folder_of(dict(model)) as folder:
        sources = _c_files(dict(model))
        _compile(target, ["-c", *sources], folder)
        built = [Path(source).with_suffix(".o").name for source in sources]
        return tuple((file, (folder / file).read_bytes()) for file in built)


def _c_files(files: Iterable[str]) -> list[str]:
    return [file for file in files if file.endswith(".c")]


@contextmanager
def _folder_of(files: Mapping[str, bytes]) -> Iterator[Path]:
    """A folder that holds the files until the block ends."""
    with tempfile.TemporaryDirectory(prefix="tireid-") as scratch:
        for file, content in files.items():
            write_file(Path(scratch) / file, content)
        yield Path(scratch)


def _compile(target: Target, words: Sequence[str], folder: Path) -> None:
    command = [*target.compiler, *KEEP_GUARDS, *FLAGS, *words, *target.flags]
    answer = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if answer.returncode != 0:
        first_lines = "\n".join(answer.stderr.splitlines()[:5])
        raise CompilationError(f"{target.compiler[0]} refused the FMU's sources:\n{first_lines}")


# C source of a step for the FMU: the files of the C package, and those of c_fmu/ around them.
#
# What is simulated is what is shipped: the same equations, guards and status codes, in double.


TOKEN = "token.h"


def token_header(token: str, version: int) -> str:
    """Return token.h, which tells this FMU from every other one.
    token : GUID of FMI 2.0, instantiation token of FMI 3.0.   version : of FMI, 2 or 3.
    """
    standard = f"#ifndef MODEL_FMI\n#define MODEL_FMI {version} /* of the standard */\n#endif\n"
    return header(TOKEN, "Generated.", [f'#define MODEL_TOKEN "{token}"\n', standard])


def model_files(specialized: SpecializedStep) -> dict[str, str]:
    """Return header and sources of the C package by file name."""
    about = summary(specialized, ingredients(specialized, single=False))
    sources = c_sources(specialized, single=False, about=about)
    return {PurePosixPath(path).name: text for path, text in sources.items()}


# The variables of the FMU, the same in FMI 2.0 and 3.0.
#
# Value references and states are those of sources/memory.h.

# What a unit is made of in SI, as attributes of BaseUnit; a radian counts as one of its own.
UNITS: Mapping[str, Mapping[str, int]] = {
    "s": {"s": 1}, "m/s": {"m": 1, "s": -1}, "rad": {"rad": 1}, "rad/s": {"rad": 1, "s": -1},
    "m/s^2": {"m": 1, "s": -2}, "N": {"kg": 1, "m": 1, "s": -2},
}  # fmt: skip
INPUT_REFERENCES = {"v_x": 1, "v_y": 2, "r": 3, "delta_f": 4, "delta_r": 5, "a_y": 13}
DEGREES = 57.29577951308232  # of a radian: display units of angles

Kind = Literal["real", "integer", "boolean"]
Causality = Literal["input", "output", "parameter", "local"]


class Variable(NamedTuple):
    """One variable of modelDescription.xml.
    reference : value reference.   start : as text, empty where it is calculated.
    """

    reference: int
    name: str
    kind: Kind
    causality: Causality
    variability: Literal["continuous", "discrete", "tunable", "constant"]
    start: str
    unit: str
    description: str


def variables(specialized: SpecializedStep) -> tuple[Variable, ...]:
    """Return the variables of a step; an input that may be missing is NaN until it is set."""
    absent = ("a_y", *["v_y"] * specialized.tells_v_y)
    inputs = (
        Variable(
            INPUT_REFERENCES[port.name],
            port.name,
            "real",
            "input",
            "continuous",
            "NaN" if port.name in absent else "0",
            port.unit,
            port.description,
        )
        for port in specialized.inputs
    )
    side = "left positive, frame of the body"
    learnt = ", ".join(specialized.learnt) or "nothing: this method has no memory of the tire"
    return (
        *inputs,
        _output(6, "F_yf", "real", "N", f"lateral force of the front axle, {side}"),
        _output(7, "F_yr", "real", "N", f"lateral force of the rear axle, {side}"),
        _output(
            8,
            "status",
            "integer",
            "",
            "of the last sample: 0 taken; 1 below the minimum speed, forces are zero; 2 it is "
            "one that no car can be in, ignored; 3 an input or 4 a result is not finite or "
            "beyond what any car does, the weights stay; 6 that for half a second or more, "
            "forces are zero",
        ),
        _output(9, "samples", "integer", "", "number of samples taken, those ignored included"),
        Variable(
            10,
            "adaptation",
            "boolean",
            "parameter",
            "tunable",
            "true",
            "",
            f"whether it adapts; false freezes {learnt}",
        ),
        _constant(11, "sample_time", "s", specialized.dt, "sampling interval, inside and fixed"),
        _constant(
            12, "min_speed", "m/s", specialized.min_speed,
            "below it forces are zero, learning rests",
        ),
        *_side_slip(specialized),
        *_band(specialized),
    )  # fmt: skip


def _side_slip(specialized: SpecializedStep) -> Iterator[Variable]:
    """Yield what the step tells of v_y, which is the name of an input already."""
    names: Mapping[str, tuple[int, str, Kind]] = {
        "v_y": (14, "v_y_estimate", "real"),
        "v_y_sd": (15, "v_y_sd", "real"),
        "side_slip_observable": (16, "side_slip_observable", "boolean"),
    }
    ports = {port.name: port for port in specialized.outputs}
    for name in specialized.side_slip:
        reference, shown, kind = names[name]
        unit = ports[name].unit if kind == "real" else ""
        yield _output(reference, shown, kind, unit, ports[name].description)


def _band(specialized: SpecializedStep) -> Iterator[Variable]:
    """Yield half the width of the band of either axle, where the step tells it."""
    if specialized.tells_band:
        for reference, axle, letter in ((17, "front", "f"), (18, "rear", "r")):
            words = f"half the width of the 90 % band around F_y{letter} of the {axle} axle"
            name = f"F_y{letter}_half_band"
            yield _output(reference, name, "real", "N", f"{words}; 0 where forces read zero")


def _output(reference: int, name: str, kind: Kind, unit: str, description: str) -> Variable:
    return Variable(reference, name, kind, "output", "discrete", "", unit, description)


def _constant(reference: int, name: str, unit: str, value: float, description: str) -> Variable:
    return Variable(
        reference, name, "real", "local", "constant", repr(float(value)), unit, description
    )


# XML: elements with attributes in the order in which they are given.

DECLARATION = '<?xml version="1.0" encoding="UTF-8"?>\n'


def element(tag: str, attributes: Mapping[str, object], *children: Element) -> Element:
    """Return an element; attributes that are empty strings are left out.
    attributes : by name; True and False become true and false.
    """
    words = {name: _text(value) for name, value in attributes.items() if value != ""}
    made = Element(tag, words)
    made.extend(children)
    return made


def document(root: Element) -> str:
    """Return a whole XML file, indented."""
    indent(root)
    return f"{DECLARATION}{tostring(root, encoding='unicode')}\n"


def _text(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else visible(str(value))


# modelDescription.xml of FMI 2.0 and 3.0, and the list of sources for whoever builds it again.

TOOL = "tireid"


def description_2(specialized: SpecializedStep, token: str, sources: Sequence[str]) -> str:
    table = variables(specialized)
    unknowns = [
        element("Unknown", {"index": i})
        for i, variable in enumerate(table, start=1)
        if variable.causality == "output"
    ]
    simulation = element(
        "CoSimulation",
        {
            "modelIdentifier": specialized.name,
            "canHandleVariableCommunicationStepSize": True,
            "canNotUseMemoryManagementFunctions": True,
            "canGetAndSetFMUstate": True,
            "canSerializeFMUstate": True,
        },
        element("SourceFiles", {}, *(element("File", {"name": name}) for name in sources)),
    )
    structure = element("Outputs", {}, *unknowns), element("InitialUnknowns", {}, *unknowns)
    listed = map(_variable_2, table)
    return _description(specialized, ("2.0", "guid", token), simulation, listed, structure)


def description_3(specialized: SpecializedStep, token: str) -> str:
    table = variables(specialized)
    outputs = [variable for variable in table if variable.causality == "output"]
    time = element(
        "Float64",
        {"name": "time", "valueReference": 0, "causality": "independent", "unit": "s"}
        | {"variability": "continuous", "description": "simulation time"},
    )
    simulation = element(
        "CoSimulation",
        {
            "modelIdentifier": specialized.name,
            "canGetAndSetFMUState": True,
            "canSerializeFMUState": True,
            "canHandleVariableCommunicationStepSize": True,
        },
    )
    structure = [
        element(tag, {"valueReference": variable.reference})
        for tag in ("Output", "InitialUnknown")
        for variable in outputs
    ]
    said, listed = ("3.0", "instantiationToken", token), [time, *map(_variable_3, table)]
    return _description(specialized, said, simulation, listed, structure)


def _description(
    specialized: SpecializedStep,
    said: tuple[str, str, str],
    simulation: Element,
    listed: Iterable[Element],
    structure: Iterable[Element],
) -> str:
    """Return modelDescription.xml."""
    version, key, token = said
    table = variables(specialized)
    about = {
        "fmiVersion": version,
        "modelName": specialized.name,
        key: token,
        "description": _sentence(specialized),
        "generationTool": TOOL,
        "variableNamingConvention": "flat",
    }
    experiment = {"startTime": 0.0, "stopTime": 10.0, "stepSize": specialized.dt}
    model = element(
        "fmiModelDescription",
        about,
        simulation,
        _units(table),
        element("DefaultExperiment", experiment),
        element("ModelVariables", {}, *listed),
        element("ModelStructure", {}, *structure),
    )
    return document(model)


def build_description(specialized: SpecializedStep, sources: Sequence[str]) -> str:
    """Return sources/buildDescription.xml of FMI 3.0."""
    files = (element("SourceFile", {"name": name}) for name in sources)
    build = element(
        "fmiBuildDescription",
        {"fmiVersion": "3.0"},
        element(
            "BuildConfiguration",
            {"modelIdentifier": specialized.name},
            element("SourceFileSet", {"language": "C99"}, *files),
        ),
    )
    return document(build)


def _sentence(specialized: SpecializedStep) -> str:
    return (
        f"Lateral tire forces of a car, identified while it drives, every {specialized.dt:g} s. "
        "Outputs are those of the last sample; slip angles inside have the sign in which "
        "F_y = +C alpha."
    )


def _units(table: Sequence[Variable]) -> Element:
    used = {variable.unit for variable in table}
    angle = {"rad": ("deg", DEGREES), "rad/s": ("deg/s", DEGREES)}
    units = []
    for name, base in UNITS.items():
        if name not in used:
            continue
        children = [element("BaseUnit", dict(base))]
        if name in angle:
            shown, factor = angle[name]
            children.append(element("DisplayUnit", {"name": shown, "factor": factor}))
        units.append(element("Unit", {"name": name}, *children))
    return element("UnitDefinitions", {}, *units)


def _about(variable: Variable) -> dict[str, object]:
    return {
        "name": variable.name,
        "valueReference": variable.reference,
        "description": variable.description,
        "causality": variable.causality,
        "variability": variable.variability,
        "initial": _initial(variable),
    }


def _variable_2(variable: Variable) -> Element:
    tag = {"real": "Real", "integer": "Integer", "boolean": "Boolean"}[variable.kind]
    kind = element(tag, {"unit": variable.unit, "start": variable.start})
    return element("ScalarVariable", _about(variable), kind)


def _variable_3(variable: Variable) -> Element:
    tag = {"real": "Float64", "integer": "Int32", "boolean": "Boolean"}[variable.kind]
    return element(tag, {**_about(variable), "unit": variable.unit, "start": variable.start})


def _initial(variable: Variable) -> str:
    """Return what the standard wants to be said of an initial value; of an input, nothing."""
    if variable.causality == "input":
        return ""
    return "exact" if variable.start else "calculated"


Version = Literal[2, 3]
FMU = Path(__file__).parent / "c_fmu"
SHARED = ("model.h", "memory.h", "memory.c")
OF_VERSION: Mapping[Version, tuple[str, ...]] = {
    2: ("fmi2Functions.h", "fmi.c"),
    3: ("fmi3Functions.h", "fmi.c", "fmi3_stubs.c"),
}


def export_fmu(specialized: SpecializedStep, path: Path, version: Version = 2) -> None:
    """Write an FMU for Co-Simulation; the same step gives the same bytes.

    Inputs v_x, v_y, r, delta_f, delta_r and outputs F_yf, F_yr, SI; beside them a_y where the step
    reads it, v_y_estimate, v_y_sd and side_slip_observable as far as it tells them, F_yf_half_band
    and F_yr_half_band where it tells the band. Samples are taken at multiples of the step's
    interval after the start, whatever the communication step; a step from t to t + h takes those in
    [t, t + h).
    specialized : the step; its name is the model identifier.   version : of FMI, 2 or 3.
    """
    if version not in OF_VERSION:
        raise ValueError(f"version must be 2 or 3, it is {version}")
    built = targets()
    if not built:
        log.warning("no C compiler found: %s holds sources only", path)
    members = {name: text.encode("utf-8") for name, text in fmu_text(specialized, version).items()}
    sources = {
        name.removeprefix("sources/"): content
        for name, content in members.items()
        if name.endswith((".c", ".h"))
    }
    of_fmu = {*SHARED, *OF_VERSION[version], TOKEN}
    around = {name: content for name, content in sources.items() if name in of_fmu}
    model = {name: content for name, content in sources.items() if name not in of_fmu}
    for target in built:
        folder = target.folder_2 if version == 2 else target.folder_3
        library = f"binaries/{folder}/{specialized.name}{target.ending}"
        members[library] = build_binary(target, specialized.name, model, around)
    write_atomically(path, _archive(members))


def fmu_text(specialized: SpecializedStep, version: Version) -> dict[str, str]:
    """Return the text files of an FMU by their path inside it.   version : of FMI, 2 or 3."""
    shared = model_files(specialized)
    blank = _text_with(specialized, shared, version, "")
    content = "\0".join(f"{name}\0{text}" for name, text in sorted(blank.items()))
    return _text_with(specialized, shared, version, _token(content))


def _text_with(
    specialized: SpecializedStep, shared: Mapping[str, str], version: Version, token: str
) -> dict[str, str]:
    places = dict.fromkeys((*SHARED, *OF_VERSION[version]), ".")
    text = c_files(FMU, places, {PREFIX: specialized.name})
    text |= {**shared, TOKEN: token_header(token, version)}
    sources = sorted(name for name in text if name.endswith(".c"))
    members = {f"sources/{name}": content for name, content in text.items()}
    if version == 2:
        members["modelDescription.xml"] = description_2(specialized, token, sources)
    else:
        members["modelDescription.xml"] = description_3(specialized, token)
        members["sources/buildDescription.xml"] = build_description(specialized, sources)
    return members


def _token(content: str) -> str:
    """Return a GUID made of the content: another model has another."""
    digest = hashlib.sha256(content.encode("utf-8")).hexdigest()
    return f"{{{digest[:8]}-{digest[8:12]}-{digest[12:16]}-{digest[16:20]}-{digest[20:32]}}}"


def _archive(members: Mapping[str, bytes]) -> bytes:
    """Return a zip archive that depends on its members only, not on the time."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, content in sorted(members.items()):
            member = zipfile.ZipInfo(name)  # of 1980
            member.compress_type = zipfile.ZIP_DEFLATED
            member.external_attr = 0o644 << 16
            archive.writestr(member, content)
    return buffer.getvalue()
