"""Learn the tires of a sedan, export the identifier as C, and drive the compiled C beside Python.

The package goes on learning where Python stopped. It is compiled twice by the C compiler of this
machine, in double and in float, tested by the self-test that it brings along, and given a lane
change that neither has seen, sample by sample. `tireid export` writes the same package.
"""

from pathlib import Path

import numpy as np

from identifier.axle import AxleIdentifier
from identifier.export.compiled import CompiledPackage
from identifier.export.package import build_package
from identifier.run import identify
from models.maneuvers import DoubleLaneChange, Slalom
from models.plant import Plant
from models.recordings import Recording
from models.sensors import Sensor, Sensors
from models.vehicle import Vehicle, sedan
from tireid.exporting import self_test

EXPECTED_BELOW = 1.0  # N, of forces of 8 kN
SENSORS = Sensors(v_y=Sensor(noise=0.02), r=Sensor(noise=0.002))  # m/s and rad/s, rms


def drives(car: Vehicle) -> tuple[Recording, Recording]:
    """Return the drive to learn from and the one to go on with, as noisy sensors see them.

    Parameters
    ----------
    car : the car.
    """
    slalom = Slalom(amplitude=0.07, frequency=0.5, onset=1.0, rate_limit=0.5, duration=20.0)
    change = DoubleLaneChange(
        amplitude=0.06, frequency=0.6, pause=1.0, onset=1.0, rate_limit=0.5, duration=10.0
    )
    plant, rng = Plant(car), np.random.default_rng(1)
    first, second = (
        plant.simulate(maneuver, speed=20.0).recording(SENSORS, rng)
        for maneuver in (slalom, change)
    )
    return first, second


def main() -> float:
    """Return how far the C in float is from Python in double, at most over the lane change [N]."""
    car = sedan()
    design = AxleIdentifier.for_vehicle(car)
    slalom, change = drives(car)
    learnt = identify(slalom, car, design).freeze(t=20.0)

    folder = Path("identifier_c")
    folder.mkdir(exist_ok=True)
    package = build_package(design, car, learnt, name="tires")
    for path, text in package.files.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text, encoding="utf-8")
    print(f"{folder}/: {', '.join(sorted(package.files))}")

    expected = identify(change, car, design, learnt).axle_force
    differences = {}
    for precision in ("double", "float"):
        single = precision == "float"
        verdict = self_test(folder, "tires", single=single)
        assert verdict is not None, "needs a C compiler"
        run = CompiledPackage.from_folder(folder, single=single).run(change)
        differences[precision] = float(np.abs(run.axle_force - expected).max())
        print(
            f"{precision:6} self-test {verdict.verdict}, {np.count_nonzero(run.status)} of "
            f"{len(run.status)} samples refused, within {differences[precision]:.2g} N of Python"
        )
    assert differences["double"] < 1e-6  # rounding: the same algebra, in another order
    return differences["float"]


if __name__ == "__main__":
    main()
