"""The shipped C from Python: a whole recording in one call."""

import ctypes
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from codegen import load_library
from codegen.arrays import Array
from codegen.compiler import NoCompilerError
from codegen.errors import TireidError
from codegen.escape import displayed
from codegen.package import NAME, c_files, one_file
from identifier.export.c_source import ORDER, PREFIX, C
from identifier.export.package import FORMAT
from identifier.export.specialize import INPUTS
from identifier.refused import STALE_TIME, stale_samples, with_rests
from models.recordings import Recording
from models.schema import Table, read_json, read_text


class PackageFileError(TireidError, ValueError):
    """A folder does not hold a package."""


class _ShippedRun(NamedTuple):
    """A recording through the package: axle_force (n, 2) [N], every output by name, status (n,).

    status : 0 where a step took its sample, else why not; see the README of the package.
    """

    axle_force: Array
    outputs: Mapping[str, Array]
    status: NDArray[np.int32]


class CompiledPackage:
    """One instance of the shipped C; attributes name, single, dt, inputs.
    manifest : content of <name>.json.
    read : returns the text of a file of the package by its path.
    single : whether to compute in float; None takes the package's default.
    """

    def __init__(
        self, manifest: Mapping[str, Any], read: Callable[[str], str], *, single: bool | None = None
    ) -> None:
        table = Table(manifest, "", PackageFileError)
        self.name = table.text("name")
        if not NAME.fullmatch(self.name):
            raise PackageFileError(f"the name of a package is no name in C: {displayed(self.name)}")
        self.single = table.text("precision") == "float" if single is None else single
        self.dt = table.number("sample_time_s")
        self.inputs = tuple(one.text("name") for one in table.tables("inputs"))
        self._outputs = {one.text("name"): one.whole("size") for one in table.tables("outputs")}
        texts = [read(path.format(self.name)) for path in ORDER]
        texts += c_files(C, {"glue.c": "."}, {PREFIX: self.name}).values()
        source = one_file(texts, defines={f"{self.name.upper()}_SINGLE": int(self.single)})
        library = load_library(source, f"{self.name}_package")
        if library is None:
            raise NoCompilerError("no C compiler found: the package cannot be built")
        self._library = library
        self._call("instance_size").restype = ctypes.c_size_t
        self._instance = ctypes.create_string_buffer(self._call("instance_size")())
        self._call("instance_init")(self._instance)

    @classmethod
    def from_folder(cls, folder: Path, *, single: bool | None = None) -> Self:
        """Return an instance of a package that was exported.
        folder : what `tireid export` wrote.
        single : whether to compute in float; None takes the package's default.
        """
        for path in sorted(folder.glob("*.json")):
            manifest = read_json(path, PackageFileError)
            if isinstance(manifest, dict) and manifest.get("format") == FORMAT:
                return cls(
                    manifest, lambda part: read_text(folder / part, PackageFileError), single=single
                )
        raise PackageFileError(f"{folder}: no package, a JSON file of format {FORMAT!r} is missing")

    def _call(self, function: str) -> Any:
        return getattr(self._library, f"{self.name}_{function}")  # which keeps it

    def run(self, recording: Recording) -> _ShippedRun:
        """Run a whole recording, from the state that the instance is in.

        Between segments of it samples are missing, as they are on a car.
        """
        if abs(recording.dt - self.dt) > 1e-6 * self.dt:
            raise ValueError(
                f"{recording.name} is sampled at {recording.dt:g} s, the package at {self.dt:g} s"
            )
        missing = stale_samples(STALE_TIME, self.dt)
        rows, resting, at = with_rests(len(recording), recording.breaks, missing)
        samples = samples_of(recording, self.inputs)[rows]
        samples[resting] = np.nan
        ran = self.run_samples(samples)
        outputs = {name: values[at] for name, values in ran.outputs.items()}
        return _ShippedRun(ran.axle_force[at], outputs, ran.status[at])

    def run_samples(self, samples: Array) -> _ShippedRun:
        """Run samples, from the state that the instance is in.
        samples : (n, k): v_x, v_y, r, delta_f, delta_r and, where it is one of `inputs`, a_y, SI.
        """
        rows = np.ascontiguousarray(samples, dtype=np.float64)
        given = np.empty((len(rows), sum(self._outputs.values())))
        status = np.empty(len(rows), dtype=np.int32)
        pointers = (ctypes.c_void_p(array.ctypes.data) for array in (rows, given, status))
        self._call("instance_run")(self._instance, ctypes.c_long(len(rows)), *pointers)
        ends = np.cumsum(list(self._outputs.values()))[:-1]
        outputs = dict(zip(self._outputs, np.split(given, ends, axis=1), strict=True))
        return _ShippedRun(outputs["axle_force"], outputs, status)


EVERY_STEP = tuple(port.name for port in INPUTS)  # has these inputs


def samples_of(recording: Recording, inputs: Iterable[str] = EVERY_STEP) -> Array:
    """Return a recording as samples (n, k) in the order of the inputs; NaN where it lacks one."""
    absent, logged = np.full(len(recording), np.nan), recording.as_logged()
    signals = (getattr(logged, name) for name in inputs)
    return np.column_stack([absent if signal is None else signal for signal in signals])
