"""Cars to drive that are not the prediction model: a state, and a step of one control period."""

from typing import Any, NamedTuple

import numpy as np

from codegen.arrays import Array
from models.friction import Friction
from models.plant import Driver, Plant, PlantState, StepwisePlant
from models.tires import Tire
from models.vehicle import Vehicle


class CarState(NamedTuple):
    """The truth about a car at one instant, SI, ISO axes; nothing changes it.

    t : since the start [s].   X, Y : position of the center of gravity [m].   psi : heading, not
    wrapped [rad].   v_x, v_y : velocity of the center of gravity along the body and to the left
    [m/s].   r : yaw rate [rad/s].   delta : actual angle of the front road wheels [rad].
    a_x, a_y : acceleration of the center of gravity, a_y = dv_y/dt + v_x r [m/s^2].
    roll : angle of the body against the road, positive where its right side dips [rad].
    axle_force : side force of the front and the rear axle, frame of the body, (2,) [N].
    inner : what only the car itself reads.
    """

    t: float
    X: float
    Y: float
    psi: float
    v_x: float
    v_y: float
    r: float
    delta: float
    a_x: float
    a_y: float
    roll: float
    axle_force: Array
    inner: Any


BRAKES = 9.0  # m/s²: hardest braking and driving of who holds the speed
SPEED_GAIN = 4.0  # 1/s: acceleration that the driver asks for, per error of the speed
# Without an integral, which would lag behind a profile.
_HOLDING = Driver(gain=SPEED_GAIN, integral_gain=0.0, acceleration_limit=BRAKES)


class DoubleTrackCar:
    """A car of `models.plant` on a road, driven by steering angle and wanted speed.

    Attributes: vehicle, as a controller knows it; tire, which only an oracle is given; friction;
    period; speed_gain, acceleration that the driver asks for, per error of the speed [1/s].
    vehicle : the car; it needs a chassis.
    tire, rear_tire : of the front and the rear wheels, as of `Plant`.
    friction : of the road; None is what the tire was measured on.
    period : for which the inputs are held [s].
    dt : step of the integration [s], a divisor of the period.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        tire: Tire | None = None,
        *,
        rear_tire: Tire | None = None,
        friction: Friction | None = None,
        period: float = 0.01,
        dt: float = 1e-3,
    ) -> None:
        plant = Plant(vehicle, tire, rear_tire=rear_tire, driver=_HOLDING)
        self._plant = StepwisePlant(plant, friction=friction, period=period, dt=dt)
        self.vehicle = vehicle
        self.tire = plant.tire
        self.friction = self._plant.friction
        self.period = period
        self.speed_gain = SPEED_GAIN

    def start(
        self, v_x: float, *, X: float = 0.0, Y: float = 0.0, psi: float = 0.0, kappa: float = 0.0
    ) -> CarState:
        """Return the car rolling straight ahead, or turning without any force yet.
        v_x : speed [m/s].   X, Y : position of the center of gravity [m].   psi : heading [rad].
        kappa : curvature of its turn [1/m].
        """
        return self._state(self._plant.start(v_x, X=X, Y=Y, psi=psi, kappa=kappa))

    def step(self, state: CarState, command: float, v_ref: float) -> CarState:
        """Return the car one period later.
        command : angle asked of the front road wheels [rad].   v_ref : wanted speed [m/s].
        """
        return self._state(self._plant.step(state.inner, np.array([command, 0.0]), v_ref))

    def _state(self, plant: PlantState) -> CarState:
        v_x, v_y, r, roll, _, X, Y, psi = (float(value) for value in plant.x[:8])
        a_x, a_y = (float(value) for value in plant.acceleration)
        t, delta = plant.steps * self._plant.dt, float(plant.x[12])
        force = plant.axle_force
        return CarState(t, X, Y, psi, v_x, v_y, r, delta, a_x, a_y, roll, force, plant)
