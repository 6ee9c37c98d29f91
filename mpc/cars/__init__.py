"""Cars to drive that are not the prediction model; `mpc.cars.commonroad` needs an extra."""

from mpc.cars.car import Car, CarState
from mpc.cars.double_track import DoubleTrackCar

__all__ = ["Car", "CarState", "DoubleTrackCar"]
