"""Learn the tires of a sedan on a slalom, freeze them, and predict a double lane change.

Run it with `python examples/learn_and_freeze.py`; it draws learn_and_freeze.png.
"""

from pathlib import Path

import numpy as np

from identifier.paper.design import PaperIdentifier
from identifier.reproducibility import replay
from identifier.run import identify
from models.maneuvers import DoubleLaneChange, Slalom
from models.plant import Plant
from models.vehicle import sedan
from tireid.figures.forces import prediction_figure
from tireid.figures.style import save_figure

EXPECTED_BELOW = 1.0  # kN
RATE_LIMIT = np.radians(30.0)  # rad/s


def main() -> float:
    """Return the RMSE of the frozen model on the maneuver it has not seen [kN]."""
    car = sedan()
    plant = Plant(car)
    slalom = Slalom(
        amplitude=np.radians(4.0), frequency=0.5, onset=1.0, rate_limit=RATE_LIMIT, duration=25.0
    )
    change = DoubleLaneChange(
        amplitude=np.radians(3.0),
        frequency=0.6,
        pause=1.0,
        onset=1.0,
        rate_limit=RATE_LIMIT,
        duration=8.0,
    )
    learnt = plant.simulate(slalom, speed=20.0).recording()
    unseen = plant.simulate(change, speed=20.0).recording()

    design = PaperIdentifier.for_vehicle(car)
    history = identify(learnt, car, design)  # learns sample by sample, in compiled code
    model = history.freeze(25.0)
    result = replay(model, identify(unseen, car, design))

    assert result.against_truth is not None
    error = result.against_truth.both / 1000.0
    print(f"frozen after the slalom, double lane change: {error:.3f} kN RMSE")
    save_figure(prediction_figure(result), Path("learn_and_freeze.png"))
    return error


if __name__ == "__main__":
    main()
