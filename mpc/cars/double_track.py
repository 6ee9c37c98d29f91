"""The double-track plant as a car to drive: roll, load transfer, relaxation, lagged steering."""

import numpy as np

from models.friction import Friction
from models.plant import Driver, Plant, PlantState, StepwisePlant
from models.tires import Tire
from models.vehicle import Vehicle
from mpc.cars.car import CarState

HOLDING = Driver(gain=2.0, integral_gain=0.0, acceleration_limit=4.0)


class DoubleTrackCar:
    """A car of `models.plant` on a road.

    Parameters
    ----------
    vehicle : the car; it needs a chassis.
    tire : of all four wheels; None reads the file named by the chassis.
    friction : of the road; None is what the tire was measured on.
    driver : who holds the speed; the default has no integral, which would lag behind a profile.
    period : for which the inputs are held [s].
    dt : step of the integration [s], a divisor of the period.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        tire: Tire | None = None,
        *,
        friction: Friction | None = None,
        driver: Driver = HOLDING,
        period: float = 0.01,
        dt: float = 1e-3,
    ) -> None:
        plant = Plant(vehicle, tire, driver=driver)
        self._plant = StepwisePlant(plant, friction=friction, period=period, dt=dt)
        self.vehicle = vehicle
        self.tire = plant.tire
        self.friction = self._plant.friction
        self.period = period
        self.speed_gain = driver.gain

    def start(self, v_x: float, *, X: float = 0.0, Y: float = 0.0, psi: float = 0.0) -> CarState:
        """Return the car rolling straight ahead.

        Parameters
        ----------
        v_x : speed [m/s].
        X, Y : position of the center of gravity [m].
        psi : heading [rad].
        """
        return self._seen(self._plant.start(v_x, X=X, Y=Y, psi=psi))

    def step(self, state: CarState, command: float, v_ref: float) -> CarState:
        """Return the car one period later.

        Parameters
        ----------
        state : now.
        command : angle asked of the front road wheels [rad].
        v_ref : wanted speed [m/s].

        Raises
        ------
        PlantError
            When a state stops being a finite number.
        """
        return self._seen(self._plant.step(state.inner, np.array([command, 0.0]), v_ref))

    def _seen(self, plant: PlantState) -> CarState:
        v_x, v_y, r, _, _, X, Y, psi = (float(value) for value in plant.x[:8])
        a_x, a_y = (float(value) for value in plant.acceleration)
        return CarState(
            t=plant.steps * self._plant.dt,
            X=X,
            Y=Y,
            psi=psi,
            v_x=v_x,
            v_y=v_y,
            r=r,
            delta=float(plant.x[12]),
            a_x=a_x,
            a_y=a_y,
            axle_force=plant.axle_force,
            inner=plant,
        )
