"""Cars of commonroad-vehicle-models, an independent program; the extra `commonroad` brings it."""

from mpc.cars.commonroad.bmw import bmw
from mpc.cars.commonroad.car import CommonRoadCar, CommonRoadError, drift_car, multi_body_car
from mpc.cars.commonroad.package import MissingCommonRoadError
from mpc.cars.commonroad.tire import CommonRoadTire

__all__ = [
    "CommonRoadCar",
    "CommonRoadError",
    "CommonRoadTire",
    "MissingCommonRoadError",
    "bmw",
    "drift_car",
    "multi_body_car",
]
