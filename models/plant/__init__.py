"""The plant: a double-track car with roll, load transfer, tire relaxation and combined slip."""

from models.plant.driver import Driver
from models.plant.run import PlantRun
from models.plant.simulate import Plant, PlantError
from models.plant.stepwise import PlantState, StepwisePlant

__all__ = ["Driver", "Plant", "PlantError", "PlantRun", "PlantState", "StepwisePlant"]
