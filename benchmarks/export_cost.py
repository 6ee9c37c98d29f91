"""What the exported C costs: on this machine beside other ways to write it, and on Arm.

    python -m benchmarks.export_cost [--record]

One run of 45 s (4500 steps), the paper's network with 10 units and its integral law, on the sedan.
The package is built as its CMakeLists.txt says, its guards included; the literal CasADi algebra and
a hand-written loop, both without guards, with the same flags; packages of the default method and of
the one that tells v_y stand beside them, on the same run. All take turns on one core; times are of
this process, so that a busy machine does not count. Ratios: median over the turns, quartiles
in brackets. Forces must agree, those of the loop to rounding.
"""

import os
import platform
import subprocess
import sys
import time
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from benchmarks.arm_cost import print_arm_costs, print_tracker_costs
from benchmarks.c_loops import (
    Loop,
    hand_written_loop,
    literal_loop,
    package_loop,
    release_flags,
)
from benchmarks.literal_step import Carried, NumpyStep, casadi_step, signals
from benchmarks.targets import Targets, keeps
from codegen import find_compiler
from codegen.arrays import Array
from identifier.export.compiled import samples_of
from identifier.export.package import Package, build_package
from identifier.methods import LIVE, REFERENCE, WITHOUT_V_Y, make_method
from identifier.paper.design import PaperIdentifier, axle_impulse
from models.maneuvers import Slalom
from models.plant import Plant
from models.vehicle import sedan

SLALOM = Slalom(amplitude=np.radians(4.0), frequency=0.5, onset=1.0, rate_limit=1.0, duration=44.99)
TURNS = 200
FEW = 100  # samples of a turn of the NumPy step
PACKAGE, LITERAL, LOOP, NUMPY = "exported C", "literal CasADi, libm", "hand-written C", "NumPy"
ALLOWED = {  # largest difference of a force to that of the package, over the largest force
    "exported C, float": 1e-5,
    LITERAL: 1e-6,  # whose tanh differs by 1.9e-11
    NUMPY: 1e-6,
}
KEYS = {
    PACKAGE: "package",
    "exported C, float": "package_float",
    LITERAL: "literal",
    LOOP: "hand_written",
    "exported C, -march=native": "package_native",
    "hand-written C, -march=native": "hand_written_native",
    NUMPY: "numpy",
}
ROUNDING = 1e-9  # where the same is computed
OTHERS = (LIVE, WITHOUT_V_Y)  # methods beside the paper's
MOST = 5.0  # us of a step of the last of them


def steps(package: Package) -> dict[str, Loop]:
    """Return every way to write the step, by name; each takes samples and gives forces."""
    car, flags = sedan(), release_flags(package)
    design = make_method(REFERENCE, car)
    assert isinstance(design, PaperIdentifier)
    gains, network = design.gains, design.network
    assert network.scale is not None
    carry = package.specialized.carry
    W, V = carry["W"], carry["V"]
    rates = [gains.eta_W, gains.eta_V, gains.rho_W, gains.rho_V]
    sampling = [design.dt, design.force_unit]
    constants = np.array([*car.bicycle, *gains.matrix.ravel(), *rates, gains.forgetting, *sampling])
    scale = np.array(network.scale)
    decay = -gains.matrix[0, 0]
    assert np.array_equal(gains.matrix, -decay * np.eye(2))  # what the hand-written loop relies on
    numbers = np.array([*car.bicycle, decay, gains.forgetting, *rates, *sampling, *(1.0 / scale)])
    in_numpy = NumpyStep(car, scale, gains.matrix, np.array([*rates, gains.forgetting]), *sampling)

    def start(samples: Array) -> Carried:
        xi_hat = axle_impulse(samples[0, 1:3], car) / design.force_unit
        return Carried(xi_hat, np.zeros(2), W, V)

    def numpy_loop(samples: Array) -> Array:
        now, force = start(samples), np.empty((len(samples), 2))
        for k, (x, u, v_x) in enumerate(signals(samples)):
            now, force[k] = in_numpy(now, x, u, v_x)
        return force

    rest = np.zeros(4)  # the recording begins straight ahead: xi = 0, z = 0
    by_rows = np.concatenate([rest, W.ravel(), V.T.ravel()])
    by_columns = np.concatenate([rest, W.T.ravel(), V.T.ravel()])
    literal = casadi_step(network)
    return {
        PACKAGE: package_loop(package, single=False, flags=flags),
        "exported C, float": package_loop(package, single=True, flags=flags),
        LITERAL: literal_loop(literal, constants, by_columns, flags),
        LOOP: hand_written_loop(numbers, by_rows, flags),
        "exported C, -march=native": package_loop(
            package, single=False, flags=[*flags, "-march=native"]
        ),
        "hand-written C, -march=native": hand_written_loop(
            numbers, by_rows, [*flags, "-march=native"]
        ),
        NUMPY: numpy_loop,
    }


def check(ways: Mapping[str, Loop], samples: Array, targets: Targets) -> None:
    """Fail where two ways to write the step do not give the same forces."""
    expected = ways[PACKAGE](samples)
    largest = np.abs(expected).max()
    print(f"largest difference of a force over {len(samples)} steps, of {largest:.0f} N:")
    for name, way in ways.items():
        difference = np.abs(way(samples) - expected).max()
        print(f"  {name:32}{difference:12.2g} N")
        targets.record(f"difference/{KEYS[name]}", float(difference), "N")
        assert difference <= ALLOWED.get(name, ROUNDING) * largest, name
    targets.record("largest_force", float(largest), "N")


def times(ways: Mapping[str, Loop], samples: Array) -> dict[str, Array]:
    """Return the time of a step in every turn [s], by name; ways take turns."""
    parts = {name: samples[:FEW] if name == NUMPY else samples for name in ways}
    found: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(TURNS):
        for name, way in ways.items():
            begin = time.process_time()
            way(parts[name])
            found[name].append((time.process_time() - begin) / len(parts[name]))
    return {name: np.array(values) for name, values in found.items()}


def print_other_steps(targets: Targets) -> None:
    """Print what a step of the other methods takes, in double and float.

    Parameters
    ----------
    targets : record what is measured.
    """
    car = sedan()
    drive = replace(Plant(car).simulate(SLALOM, speed=20.0).recording(), axle_force=None)
    ways, samples = {}, {}
    for law in OTHERS:
        package = build_package(make_method(law, car), car)
        specialized = package.specialized
        shown = replace(drive, v_y=None) if specialized.tells_v_y else drive
        rows = samples_of(shown, [port.name for port in specialized.inputs])
        for single, key in ((False, law), (True, f"{law}_float")):
            ways[key] = package_loop(package, single=single, flags=release_flags(package))
            samples[key] = rows
    found: dict[str, list[float]] = {key: [] for key in ways}
    for _ in range(TURNS):
        for key, way in ways.items():
            begin = time.process_time()
            way(samples[key])
            found[key].append((time.process_time() - begin) / len(samples[key]))
    for key, values in found.items():
        print(f"  {key:36}{1e9 * min(values):12.1f}{1e9 * np.median(values):10.1f}")
        if key != WITHOUT_V_Y:
            targets.record(f"step/{key}", 1e9 * float(np.median(values)), "ns")
    label = f"a step of {WITHOUT_V_Y} in double"
    median = 1e6 * float(np.median(found[WITHOUT_V_Y]))
    targets.at_most(label, median, MOST, "us", key=f"step/{WITHOUT_V_Y}")


def _mid(ratios: Array) -> float:
    return float(np.median(ratios))


def _spread(ratios: Array) -> str:
    low, high = np.quantile(ratios, [0.25, 0.75])
    return f"[{low:.3g} ... {high:.3g}]"


def main() -> int:
    """Print the tables; 1 where a target is missed."""
    car, targets = sedan(), Targets("export_cost")
    samples = samples_of(Plant(car).simulate(SLALOM, speed=20.0).recording())
    assert not samples[0, 1:].any()  # straight ahead: every way starts from rest
    package = build_package(make_method(REFERENCE, car), car)
    compiler = find_compiler()
    assert compiler is not None
    version = subprocess.run([*compiler, "--version"], capture_output=True, text=True, check=True)
    print(f"{platform.machine()}, {os.cpu_count()} cores; {version.stdout.splitlines()[0]}")
    print(f"flags of the package: {' '.join(release_flags(package))}")
    ways = steps(package)
    check(ways, samples, targets)
    measured = times(ways, samples)
    print(f"time of a step over {TURNS} turns [ns]         least    median")
    for name, values in measured.items():
        print(f"  {name:36}{1e9 * values.min():12.1f}{1e9 * np.median(values):10.1f}")
        targets.record(f"step/{KEYS[name]}", 1e9 * float(np.median(values)), "ns")
    print_other_steps(targets)
    own, literal, loop = (measured[name] for name in (PACKAGE, LITERAL, LOOP))
    label = f"{PACKAGE} over {LITERAL} {_spread(own / literal)}"
    targets.at_most(label, _mid(own / literal), 0.7, "", key="ratio/literal")
    label = f"{PACKAGE} over {LOOP} {_spread(own / loop)}"
    targets.at_most(label, _mid(own / loop), 2.0, "", key="ratio/hand_written")
    slow = measured[NUMPY] / own
    label = f"{NUMPY} over {PACKAGE} {_spread(slow)}"
    targets.at_least(label, _mid(slow), 200.0, "", key="ratio/numpy")
    print_arm_costs(targets)
    print_tracker_costs(targets)
    return targets.finish(keep=keeps())


if __name__ == "__main__":
    sys.exit(main())
