"""The shipped C from Python: sample by sample, or a whole recording in one call."""

import ctypes
import json
import math
from collections.abc import Iterable, Mapping
from enum import IntEnum
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from codegen import load_library
from codegen.arrays import Array
from codegen.errors import TireidError
from codegen.escape import displayed
from codegen.package import NAME, c_files, one_file
from identifier.export.c_source import ORDER, PREFIX, C
from identifier.export.package import FORMAT, Package
from identifier.export.specialize import INPUTS
from identifier.refused import STALE_TIME, stale_samples, with_rests
from models.recordings import Recording
from models.schema import Table, read_json, read_text


class Status(IntEnum):
    """What a step did with its sample; see the README of the package."""

    OK = 0
    REST = 1
    IMPLAUSIBLE = 2
    BAD_INPUT = 3
    BAD_RESULT = 4
    BAD_CALL = 5
    STALE = 6


class NoCompilerError(TireidError, RuntimeError):
    """There is no C compiler to build the package with."""


class PackageFileError(TireidError, ValueError):
    """A folder does not hold a package."""


class _ShippedRun(NamedTuple):
    """A recording through the package: axle_force (n, 2) [N], every output by name, status (n,)."""

    axle_force: Array
    outputs: Mapping[str, Array]
    status: NDArray[np.int32]


class CompiledPackage:
    """One instance of the shipped C; attributes name, single, dt, inputs.
    manifest : content of <name>.json.
    single : whether to compute in float; None takes the package's default.
    """

    def __init__(
        self, manifest: Mapping[str, Any], files: Mapping[str, str], *, single: bool | None = None
    ) -> None:
        table = Table(manifest, "", PackageFileError)
        self.name = table.text("name")
        if not NAME.fullmatch(self.name):
            raise PackageFileError(f"the name of a package is no name in C: {displayed(self.name)}")
        self.single = table.text("precision") == "float" if single is None else single
        self.dt = table.number("sample_time_s")
        self.inputs = tuple(one.text("name") for one in table.tables("inputs"))
        self._outputs = {one.text("name"): one.whole("size") for one in table.tables("outputs")}
        learnt = [one for one in table.tables("carried") if one.value("learnt")]
        self._weights = {one.text("name"): one.wholes("shape") for one in learnt}
        texts = [files[path.format(self.name)] for path in ORDER]
        texts += c_files(C, {"glue.c": "."}, {PREFIX: self.name}).values()
        source = one_file(texts, defines={f"{self.name.upper()}_SINGLE": int(self.single)})
        library = load_library(source, f"{self.name}_package")
        if library is None:
            raise NoCompilerError("no C compiler found: the package cannot be built")
        self._library = library
        self._call("instance_size").restype = ctypes.c_size_t
        self._call("version").restype = ctypes.c_char_p
        self._call("instance_faults").restype = ctypes.c_uint
        self._instance = ctypes.create_string_buffer(self._call("instance_size")())
        self.init()

    @classmethod
    def of(cls, package: Package, *, single: bool | None = None) -> "CompiledPackage":
        """Return an instance of a package that was just built.
        single : whether to compute in float; None takes the package's default.
        """
        manifest = json.loads(package.files[f"{package.specialized.name}.json"])
        return cls(manifest, package.files, single=single)

    @classmethod
    def from_folder(cls, folder: Path, *, single: bool | None = None) -> "CompiledPackage":
        """Return an instance of a package that was exported.
        folder : what `tireid export` wrote.
        single : whether to compute in float; None takes the package's default.
        """
        for path in sorted(folder.glob("*.json")):
            manifest = read_json(path, PackageFileError)
            if isinstance(manifest, dict) and manifest.get("format") == FORMAT:
                parts = [*(folder / "include").glob("*.h"), *(folder / "src").glob("*.[ch]")]
                files = {
                    part.relative_to(folder).as_posix(): read_text(part, PackageFileError)
                    for part in parts
                }
                return cls(manifest, files, single=single)
        raise PackageFileError(f"{folder}: no package, a JSON file of format {FORMAT!r} is missing")

    def _call(self, function: str) -> Any:
        return getattr(self._library, f"{self.name}_{function}")  # which keeps it

    def init(self) -> None:
        """Begin as exported: weights, mode, faults."""
        self._call("instance_init")(self._instance)

    def reset(self) -> None:
        """Begin anew with the weights, the mode and the number of faults kept."""
        self._call("instance_reset")(self._instance)

    @property
    def version(self) -> str:
        """Name, hash and version of tireid."""
        text: bytes = self._call("version")()
        return text.decode()

    @property
    def faults(self) -> int:
        """Steps that were refused or implausible since `init`."""
        return int(self._call("instance_faults")(self._instance))

    @property
    def state(self) -> bytes:
        """The state as it lies in memory, with the parameters after it."""
        return self._instance.raw

    def step(
        self,
        v_x: float,
        v_y: float,
        r: float,
        delta_f: float,
        delta_r: float = 0.0,
        a_y: float = math.nan,
    ) -> tuple[Status, Array]:
        """Take one sample; return its status and the axle forces (2,) [N].
        v_x : longitudinal speed [m/s].   v_y : lateral velocity [m/s].   r : yaw rate [rad/s].
        delta_f : steering in front [rad].   delta_r : steering at the rear [rad].
        a_y : of an accelerometer [m/s²], NaN where there is none; not read where it is no input.
        """
        sample = [v_x, v_y, r, delta_f, delta_r, a_y]
        run = self.run_samples(np.array([sample[: len(self.inputs)]]))
        return Status(int(run.status[0])), run.axle_force[0]

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
        if rows.ndim != 2 or rows.shape[1] != len(self.inputs):
            wanted = len(self.inputs)
            raise ValueError(f"samples must have shape (n, {wanted}), not {rows.shape}")
        given = np.empty((len(rows), sum(self._outputs.values())))
        status = np.empty(len(rows), dtype=np.int32)
        pointers = (ctypes.c_void_p(array.ctypes.data) for array in (rows, given, status))
        self._call("instance_run")(self._instance, ctypes.c_long(len(rows)), *pointers)
        ends = np.cumsum(list(self._outputs.values()))[:-1]
        outputs = dict(zip(self._outputs, np.split(given, ends, axis=1), strict=True))
        return _ShippedRun(outputs["axle_force"], outputs, status)

    @property
    def weights(self) -> dict[str, Array]:
        """What is learnt, by name; empty for a method that estimates a signal."""
        if not self._weights:
            return {}
        ends = np.cumsum([math.prod(shape) for shape in self._weights.values()])
        flat = np.empty(ends[-1])
        self._call("instance_weights")(self._instance, ctypes.c_void_p(flat.ctypes.data))
        parts = zip(self._weights.items(), np.split(flat, ends[:-1]), strict=True)
        return {name: part.reshape(shape) for (name, shape), part in parts}

    def set_weights(self, weights: Mapping[str, Array]) -> None:
        """Go on with other weights.   weights : by name, in the shapes of `weights`."""
        shapes = {name: np.shape(value) for name, value in weights.items()}
        if shapes != self._weights:
            raise ValueError(f"weights must have the shapes {self._weights}, not {shapes}")
        flat = np.concatenate([np.asarray(weights[name]).ravel() for name in self._weights])
        flat = np.ascontiguousarray(flat, dtype=np.float64)
        answer = self._call("instance_take")(self._instance, ctypes.c_void_p(flat.ctypes.data))
        if answer != Status.OK:
            raise ValueError("weights must be finite, and covariances and errors not negative")

    def set_adaptation(self, adapts: bool) -> None:
        if not self._weights:
            raise ValueError(f"{self.name} estimates a signal: there is nothing to freeze")
        self._call("instance_adapt")(self._instance, int(adapts))


EVERY_STEP = tuple(port.name for port in INPUTS)  # has these inputs


def samples_of(recording: Recording, inputs: Iterable[str] = EVERY_STEP) -> Array:
    """Return a recording as samples (n, k) in the order of the inputs; NaN where it lacks one."""
    absent, logged = np.full(len(recording), np.nan), recording.as_logged()
    signals = (getattr(logged, name) for name in inputs)
    return np.column_stack([absent if signal is None else signal for signal in signals])
