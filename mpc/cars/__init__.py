"""Cars to drive that are not the prediction model; `mpc.cars.commonroad` needs an extra."""

from mpc.cars.car import Car, CarState, DoubleTrackCar

__all__ = ["Car", "CarState", "DoubleTrackCar"]
