"""Identify the tires of a sedan from a slalom, freeze them, and predict a double lane change.

Run it with `python examples/learn_and_freeze.py`; it draws learn_and_freeze.png.
"""

from pathlib import Path

import numpy as np

import tireid as ti
from models.maneuvers import DoubleLaneChange, Slalom
from models.plant import Plant
from tireid.figures.forces import prediction_figure
from tireid.figures.style import save_figures

EXPECTED_BELOW = 0.2  # kN
RATE_LIMIT = np.radians(30.0)  # rad/s


def main() -> float:
    """Return the RMSE of the frozen tires on the other maneuver [kN]."""
    car = ti.sedan()
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
    log = plant.simulate(slalom, speed=20.0).recording()
    other = plant.simulate(change, speed=20.0).recording()

    run = ti.identify(log, car)  # by the default method, from the whole log
    prediction = ti.replay(other, run.tire)
    print(*run.verdict.lines, sep="\n")
    print(run.tire.summary())
    print(prediction)

    assert prediction.against_truth is not None
    error = prediction.against_truth.both / 1000.0
    print(f"frozen after the slalom, double lane change: {error:.3f} kN RMSE")
    save_figures(Path(), {"learn_and_freeze": prediction_figure(prediction)})
    return error


if __name__ == "__main__":
    main()
