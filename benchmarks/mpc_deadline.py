"""What the tracker's longest step costs a Cortex-M7, over the states of `mpc_stress`, in QEMU.

The states, roads and tires of `mpc_stress` are fed to the exported C in float, one after the other,
so that the car jumps where an episode ends. A cap on the solver's iterations bounds the step: it is
measured with the exported tolerance, and with one that no iteration reaches, where every step that
plans takes all its iterations: the worst case by construction. A processor at 480 MHz that does one
instruction a cycle has 4.8 million in 10 ms.
"""

import re
import sys
from collections.abc import Sequence

import numpy as np

from benchmarks.mpc_stress import DELAY, PERIOD, PROBLEM, stress, tires
from benchmarks.targets import Targets, keeps, show
from codegen.arrays import Array
from codegen.processor import Replay, missing_tools, replay
from mpc.export.package import MpcPackage, build_mpc_package
from mpc.export.processor import PROCESSOR, vectors_program
from mpc.realtime.instance import c_types
from mpc.tires import TireStructure

STEPS = 200  # of each tire
SEED = 1  # another than that of `mpc_stress`
CLOCK, DEADLINE = 480e6, 10e-3  # Hz, s
CAPS = {"network": 16, "lagging curve": 10}  # iterations, with 5 and 7 states
TOLERANCES = {"exported": None, "never met": "1e-30F"}


def measured_in(recorded: bytes, structure: TireStructure) -> list[Array]:
    """Return every input of `Stress.recorded`: 4 numbers of the car, then the road (86,)."""
    told, inputs = np.dtype((float, 3)).itemsize, []
    types = c_types(structure, PROBLEM.horizon, single=False)
    told_params, size, at = types["params"].itemsize, types["input"].itemsize, 0
    while at < len(recorded):
        does = np.frombuffer(recorded, count=1, offset=at)[0]
        at += told + (told_params if does else 0)
        inputs.append(np.frombuffer(recorded, count=size // 8, offset=at))
        at += size
    return inputs


def as_vectors(inputs: Sequence[Array]) -> str:
    """Return inputs as the header of vectors that the replay reads, a road of its own each."""
    n, stages = len(inputs), PROBLEM.horizon + 1
    car = [values[:4] for values in inputs]
    roads = np.array([values[4:].reshape(2, stages) for values in inputs])  # step, what, stage
    rows = roads.transpose(2, 0, 1).reshape(-1, 2)
    return "\n".join(
        [
            f"#define VECTORS {n}U",
            f"#define VECTOR_OFFSET {n}U",
            f"#define VECTOR_STRIDE {n}U",
            _table(f"vector_input[{n}][4]", car),
            _table(f"vector_road[{len(rows)}][2]", rows),
        ]
    )


def _table(name: str, rows: Sequence[Array] | Array) -> str:
    text = ",\n".join("{" + ", ".join(f"{float(x)!r}F" for x in row) + "}" for row in rows)
    return f"static const float {name} = {{\n{text}\n}};\n"


def replayed(
    package: MpcPackage, inputs: Sequence[Array], cap: int, tolerance: str | None
) -> Replay:
    """Return what the capped tracker of a package costs over inputs."""
    tables = package.files["src/tireid_mpc_tables.h"]
    changed = re.sub(r"(/\* max_iterations \*/ )\d+U", rf"\g<1>{cap}U", tables)
    assert changed != tables
    if tolerance is not None:
        changed, n = re.subn(r"(/\* tolerance \*/ )\w+", rf"\g<1>{tolerance}", changed)
        assert n == 1
    files = {
        **package.files,
        "src/tireid_mpc_tables.h": changed,
        "tests/tireid_mpc_vectors.h": as_vectors(inputs),
    }
    program = vectors_program(package._replace(files=files), steps=len(inputs))
    return replay(program, PROCESSOR, single=True)


def main(*, keep: bool = False) -> int:
    """Print instructions a step; return 1 where one is beyond the deadline.

    Parameters
    ----------
    keep : record the numbers for the documents.
    """
    absent = missing_tools()
    if absent:
        show("deadline on Arm", f"not measured, missing: {', '.join(absent)}")
        return 0
    targets = Targets("mpc_deadline")
    print("tire            tolerance   instructions a step, mean   largest")
    for name, cap in CAPS.items():
        choice = tires()[name]
        came = stress(choice, STEPS, np.random.default_rng(SEED))
        beyond = 100.0 * float(np.mean(came.iterations > cap))
        print(f"{name}: at most {cap} iterations, which {beyond:.1f} % of the steps would pass")
        key = name.replace(" ", "_")
        targets.record(f"{key}/cap", cap, "")
        targets.record(f"{key}/beyond", beyond, "%")
        inputs = measured_in(came.recorded, choice[0].structure)
        package = build_mpc_package(choice[0], PROBLEM, period=PERIOD, delay=DELAY)
        for kind, tolerance in TOLERANCES.items():
            run = replayed(package, inputs, cap, tolerance)
            print(f"{name:16}{kind:12}{run.instructions:25}{run.most_instructions:10}", flush=True)
            at = f"{key}/{kind.replace(' ', '_')}"
            targets.record(f"{at}/mean", run.instructions)
            label = f"{name}, tolerance {kind}: instructions in the longest step"
            most = CLOCK * DEADLINE
            targets.at_most(label, run.most_instructions, most, "", key=f"{at}/largest")
    return targets.finish(keep=keep)


if __name__ == "__main__":
    sys.exit(main(keep=keeps()))
