"""A folded step as an FMU for Co-Simulation: description, sources and binaries in one archive."""

import hashlib
import io
import logging
import zipfile
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import Literal

from identifier.export.fmu.binaries import build_binary, targets
from identifier.export.fmu.description import build_description, description_2, description_3
from identifier.export.fmu.model_source import model_files, model_header
from identifier.export.fold import FoldedStep
from models.files import write_atomically

log = logging.getLogger("tireid.export")

Version = Literal[2, 3]
SHARED = ("memory.h", "memory.c")
OF_VERSION: Mapping[Version, tuple[str, ...]] = {
    2: ("fmi2Functions.h", "fmi2.c"),
    3: ("fmi3Functions.h", "fmi3.c", "fmi3_stubs.c"),
}


def export_fmu(folded: FoldedStep, path: Path, version: Version = 2) -> None:
    """Write an FMU for Co-Simulation; the same step gives the same bytes.

    Inputs v_x, v_y, r, delta_f, delta_r and outputs F_yf, F_yr, SI; see
    `identifier.export.fmu.variables`. Samples are taken at multiples of the step's interval after
    the start, whatever the communication step; a step from t to t + h takes those in [t, t + h).

    Parameters
    ----------
    folded : the step; its name is the model identifier.
    path : the file, usually ending in .fmu.
    version : of FMI, 2 or 3.

    Raises
    ------
    ValueError
        Where the version is another, nothing is carried, or a carried value is not finite.
    CompilationError
        Where a compiler refuses the sources.
    OSError
        Where the file cannot be written.
    """
    if version not in OF_VERSION:
        raise ValueError(f"version must be 2 or 3, it is {version}")
    built = targets()
    if not built:
        log.warning("no C compiler found: %s holds sources only", path)
    members = {name: text.encode("utf-8") for name, text in fmu_text(folded, version).items()}
    sources = {
        name.removeprefix("sources/"): content
        for name, content in members.items()
        if name.endswith((".c", ".h"))
    }
    for target in built:
        folder = target.folder_2 if version == 2 else target.folder_3
        library = f"binaries/{folder}/{folded.name}{target.ending}"
        members[library] = build_binary(target, folded.name, sources)
    write_atomically(path, _archive(members))


def fmu_text(folded: FoldedStep, version: Version) -> dict[str, str]:
    """Return the text files of an FMU by their path inside it.

    Parameters
    ----------
    folded : the step.
    version : of FMI, 2 or 3.
    """
    shared = model_files(folded)
    blank = _text_with(folded, shared, version, "")
    content = "\0".join(f"{name}\0{text}" for name, text in sorted(blank.items()))
    return _text_with(folded, shared, version, _token(content))


def _text_with(
    folded: FoldedStep, shared: Mapping[str, str], version: Version, token: str
) -> dict[str, str]:
    templates = files(__package__) / "sources"
    text = {
        name: (templates / name).read_text(encoding="utf-8")
        for name in (*SHARED, *OF_VERSION[version])
    }
    text |= {**shared, "model.h": model_header(folded.name, token)}
    c_files = sorted(name for name in text if name.endswith(".c"))
    members = {f"sources/{name}": content for name, content in text.items()}
    if version == 2:
        members["modelDescription.xml"] = description_2(folded, token, c_files)
    else:
        members["modelDescription.xml"] = description_3(folded, token)
        members["sources/buildDescription.xml"] = build_description(folded, c_files)
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
