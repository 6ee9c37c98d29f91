"""The plant: a double-track car with roll, load transfer, tire relaxation and combined slip."""

from models.plant.dynamics import Driver
from models.plant.plant import Plant, PlantError, PlantRun, PlantState, StepwisePlant, tire_of

__all__ = ["Driver", "Plant", "PlantError", "PlantRun", "PlantState", "StepwisePlant", "tire_of"]
