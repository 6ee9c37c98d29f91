"""A specialized step as an FMU for Co-Simulation: description, sources, binaries in one file."""

import hashlib
import io
import logging
import platform
import shutil
import tempfile
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import Literal, NamedTuple
from uuid import UUID
from xml.etree.ElementTree import Element, indent, tostring

from codegen import find_compiler
from codegen.compiler import KEEP_GUARDS, run_compiler
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
_FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fno-math-errno", "-fvisibility=hidden")


class _Target(NamedTuple):
    """A platform: its folder in FMI 2.0 and 3.0, ending of a library, and how it is built."""

    folder_2: str
    folder_3: str
    ending: str
    compiler: tuple[str, ...]
    flags: tuple[str, ...]


def targets() -> tuple[_Target, ...]:
    """Return the platforms that can be built for here; none where there is no compiler."""
    found = []
    compiler = find_compiler()
    if compiler and (platform.system(), platform.machine()) == ("Linux", "x86_64"):
        found.append(
            _Target("linux64", "x86_64-linux", ".so", compiler, ("-fPIC", "-shared", "-lm"))
        )
    mingw = shutil.which(MINGW)
    if mingw:
        flags = ("-shared", "-static-libgcc", "-Wl,--no-insert-timestamp", "-s")
        found.append(_Target("win64", "x86_64-windows", ".dll", (mingw,), flags))
    return tuple(found)


def _build_binary(target: _Target, name: str, sources: Mapping[str, bytes]) -> bytes:
    """Compile sources, by name, to a shared library and return its content."""
    with tempfile.TemporaryDirectory(prefix="tireid-") as scratch:
        folder, library = Path(scratch), f"{name}{target.ending}"
        for file, content in sources.items():
            write_file(folder / file, content)
        words = [*(file for file in sources if file.endswith(".c")), "-o", library]
        command = [*target.compiler, *KEEP_GUARDS, *_FLAGS, *words, *target.flags]
        run_compiler(command, folder, "the FMU's sources")
        log.info("compiled %s for %s", library, target.folder_2)
        return (folder / library).read_bytes()


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


# The variables of the FMU, the same in FMI 2.0 and 3.0.
#
# Value references and states are those of sources/memory.h.

# What a unit is made of in SI, as attributes of BaseUnit; a radian counts as one of its own.
_UNITS: Mapping[str, Mapping[str, int]] = {
    "s": {"s": 1}, "m/s": {"m": 1, "s": -1}, "rad": {"rad": 1}, "rad/s": {"rad": 1, "s": -1},
    "m/s^2": {"m": 1, "s": -2}, "N": {"kg": 1, "m": 1, "s": -2},
}  # fmt: skip
_INPUTS = {"v_x": 1, "v_y": 2, "r": 3, "delta_f": 4, "delta_r": 5, "a_y": 13}
_SIDE_SLIP: Mapping[str, tuple[int, str]] = {  # v_y is the name of an input already
    "v_y": (14, "v_y_estimate"),
    "v_y_sd": (15, "v_y_sd"),
    "side_slip_observable": (16, "side_slip_observable"),
}
_DEGREES = 57.29577951308232  # of a radian: display units of angles


class _Variable(NamedTuple):
    """One variable of modelDescription.xml.
    reference : value reference.   start : as text, empty where it is calculated.
    """

    reference: int
    name: str
    description: str
    unit: str = ""
    kind: Literal["real", "integer", "boolean"] = "real"
    causality: Literal["input", "output", "parameter", "local"] = "output"
    variability: Literal["continuous", "discrete", "tunable", "constant"] = "discrete"
    start: str = ""


def _variables(step: SpecializedStep) -> tuple[_Variable, ...]:
    """Return the variables of a step; an input that may be missing is NaN until it is set."""
    absent = ("a_y", *["v_y"] * step.tells_v_y)
    side = "left positive, frame of the body"
    learnt = ", ".join(step.learnt) or "nothing: this method has no memory of the tire"
    every = "sampling interval, inside and fixed"
    below = "below it forces are zero, learning rests"
    dt, slow = repr(float(step.dt)), repr(float(step.min_speed))
    found = [
        _Variable(
            _INPUTS[port.name], port.name, port.description, port.unit, "real", "input",
            "continuous", "NaN" if port.name in absent else "0",
        )
        for port in step.inputs
    ]  # fmt: skip
    found += [
        _Variable(6, "F_yf", f"lateral force of the front axle, {side}", "N"),
        _Variable(7, "F_yr", f"lateral force of the rear axle, {side}", "N"),
        _Variable(
            8,
            "status",
            "of the last sample: 0 taken; 1 below the minimum speed, forces are zero; 2 it is "
            "one that no car can be in, ignored; 3 an input or 4 a result is not finite or "
            "beyond what any car does, the weights stay; 6 that for half a second or more, "
            "forces are zero",
            kind="integer",
        ),
        _Variable(9, "samples", "number of samples taken, those ignored included", kind="integer"),
        _Variable(
            10, "adaptation", f"whether it adapts; false freezes {learnt}", "", "boolean",
            "parameter", "tunable", "true",
        ),
        _Variable(11, "sample_time", every, "s", "real", "local", "constant", dt),
        _Variable(12, "min_speed", below, "m/s", "real", "local", "constant", slow),
    ]  # fmt: skip
    ports = {port.name: port for port in step.outputs}
    for name in step.side_slip:
        (reference, displayed), port = _SIDE_SLIP[name], ports[name]
        if name == "side_slip_observable":
            found.append(_Variable(reference, displayed, port.description, kind="boolean"))
        else:
            found.append(_Variable(reference, displayed, port.description, port.unit))
    for reference, axle, letter in ((17, "front", "f"), (18, "rear", "r")):
        if step.tells_band:
            words = f"half the width of the 90 % band around F_y{letter} of the {axle} axle"
            words += "; 0 where forces read zero"
            found.append(_Variable(reference, f"F_y{letter}_half_band", words, "N"))
    return tuple(found)


# XML: elements with attributes in the order in which they are given.


def _element(tag: str, attributes: Mapping[str, object], *children: Element) -> Element:
    """Return an element; attributes that are empty strings are left out.
    attributes : by name; True and False become true and false.
    """
    words = {
        name: str(value).lower() if isinstance(value, bool) else visible(str(value))
        for name, value in attributes.items()
        if value != ""
    }
    made = Element(tag, words)
    made.extend(children)
    return made


def _document(root: Element) -> str:
    """Return a whole XML file, indented."""
    indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{tostring(root, encoding="unicode")}\n'


# modelDescription.xml of FMI 2.0 and 3.0, and the list of sources for whoever builds it again.


def _description(
    step: SpecializedStep, version: "Version", token: str, sources: Sequence[str]
) -> str:
    """Return modelDescription.xml."""
    table = _variables(step)
    outputs = [(i, one) for i, one in enumerate(table, start=1) if one.causality == "output"]
    listed = [_described(one, version) for one in table]
    simulation = {"modelIdentifier": step.name}
    if version == 2:
        key, can = "guid", _CAN_2
        names = (_element("File", {"name": name}) for name in sources)
        files = [_element("SourceFiles", {}, *names)]
        known = [_element("Unknown", {"index": i}) for i, _ in outputs]
        structure = [_element(tag, {}, *known) for tag in ("Outputs", "InitialUnknowns")]
    else:
        time = {"name": "time", "valueReference": 0, "causality": "independent", "unit": "s"}
        time |= {"variability": "continuous", "description": "simulation time"}
        listed.insert(0, _element("Float64", time))
        key, can, files = "instantiationToken", _CAN_3, []
        structure = [
            _element(tag, {"valueReference": one.reference})
            for tag in ("Output", "InitialUnknown")
            for _, one in outputs
        ]
    about = {
        "fmiVersion": f"{version}.0",
        "modelName": step.name,
        key: token,
        "description": f"Lateral tire forces of a car, identified while it drives, every "
        f"{step.dt:g} s. Outputs are those of the last sample; slip angles inside have the sign in "
        "which F_y = +C alpha.",
        "generationTool": "tireid",
        "variableNamingConvention": "flat",
    }
    experiment = {"startTime": 0.0, "stopTime": 10.0, "stepSize": step.dt}
    model = _element(
        "fmiModelDescription",
        about,
        _element("CoSimulation", simulation | dict.fromkeys(can, True), *files),
        _units(table),
        _element("DefaultExperiment", experiment),
        _element("ModelVariables", {}, *listed),
        _element("ModelStructure", {}, *structure),
    )
    return _document(model)


_CAN_2: tuple[str, ...] = (
    "canHandleVariableCommunicationStepSize",
    "canNotUseMemoryManagementFunctions",
    "canGetAndSetFMUstate",
    "canSerializeFMUstate",
)
_CAN_3: tuple[str, ...] = (
    "canGetAndSetFMUState",
    "canSerializeFMUState",
    "canHandleVariableCommunicationStepSize",
)


def _units(table: Sequence[_Variable]) -> Element:
    used = {variable.unit for variable in table}
    angle = {"rad": ("deg", _DEGREES), "rad/s": ("deg/s", _DEGREES)}
    units = []
    for name in filter(used.__contains__, _UNITS):
        children = [_element("BaseUnit", dict(_UNITS[name]))]
        if name in angle:
            displayed, factor = angle[name]
            children.append(_element("DisplayUnit", {"name": displayed, "factor": factor}))
        units.append(_element("Unit", {"name": name}, *children))
    return _element("UnitDefinitions", {}, *units)


def _described(variable: _Variable, version: "Version") -> Element:
    kinds = {"real": ("Real", "Float64"), "integer": ("Integer", "Int32")}
    tag = kinds.get(variable.kind, ("Boolean", "Boolean"))[version - 2]
    initial = "exact" if variable.start else "calculated"
    about = {
        "name": variable.name,
        "valueReference": variable.reference,
        "description": variable.description,
        "causality": variable.causality,
        "variability": variable.variability,
        "initial": "" if variable.causality == "input" else initial,  # as the standard wants it
    }
    value = {"unit": variable.unit, "start": variable.start}
    if version == 2:
        return _element("ScalarVariable", about, _element(tag, value))
    return _element(tag, about | value)


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
    for target in built:
        folder = target.folder_2 if version == 2 else target.folder_3
        library = f"binaries/{folder}/{specialized.name}{target.ending}"
        members[library] = _build_binary(target, specialized.name, sources)
    write_atomically(path, _archive(members))


def fmu_text(specialized: SpecializedStep, version: Version) -> dict[str, str]:
    """Return the text files of an FMU by their path inside it.   version : of FMI, 2 or 3."""
    about = summary(specialized, ingredients(specialized, single=False))
    sources = c_sources(specialized, single=False, about=about)
    places = dict.fromkeys((*SHARED, *OF_VERSION[version]), ".")
    text = c_files(FMU, places, {PREFIX: specialized.name})
    text |= {PurePosixPath(path).name: content for path, content in sources.items()}
    names = sorted(name for name in text if name.endswith(".c"))

    def with_token(token: str) -> dict[str, str]:
        files = {**text, TOKEN: token_header(token, version)}
        members = {f"sources/{name}": content for name, content in files.items()}
        members["modelDescription.xml"] = _description(specialized, version, token, names)
        if version == 3:
            listed = (_element("SourceFile", {"name": one}) for one in names)
            built = _element("SourceFileSet", {"language": "C99"}, *listed)
            built = _element("BuildConfiguration", {"modelIdentifier": specialized.name}, built)
            built = _element("fmiBuildDescription", {"fmiVersion": "3.0"}, built)
            members["sources/buildDescription.xml"] = _document(built)
        return members

    members = sorted(with_token("").items())
    content = "\0".join(f"{name}\0{text}" for name, text in members)  # another model has another
    return with_token(f"{{{UUID(hashlib.sha256(content.encode()).hexdigest()[:32])}}}")


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
