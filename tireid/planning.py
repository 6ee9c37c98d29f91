"""Planning what to drive next: the steering that teaches most in the space there is."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from identifier.axle import AxleModel
from identifier.axle.model import begun
from identifier.plan import Plan, PlanError, PlausibleTires, Rehearsal, Space, make_plan
from identifier.tire_model import TireModel
from models.plant import Plant, PlantError
from models.rules import require_within
from models.vehicle import Vehicle

TIME = 6.0  # s, of steering
SHARE = 0.9  # of the grip
MARGIN = 0.35  # wheelbases, 1 m for a sedan
RATE = 0.4  # over sqrt(L/g): 0.7 rad/s for a sedan
MAX_ANGLE = 0.5  # rad
FRICTION = 0.8
SHORTEST_LAG, LONGEST_LAG = 1e-3, 1.0  # s, of the steering


def plan(
    vehicle: Vehicle,
    *,
    area: tuple[float, float],
    speed: float,
    time: float = TIME,
    after: TireModel | None = None,
    friction: float | None = None,
    share: float = SHARE,
    margin: float | None = None,
    rate_limit: float | None = None,
    max_angle: float = MAX_ANGLE,
    steering_lag: float | None = None,
    held: bool = True,
    seed: int = 0,
    progress: Callable[[float], None] | None = None,
) -> Plan:
    """Return the maneuver that teaches the default identifier most about the tires of a car.

    Parameters
    ----------
    vehicle : the car; its stiffnesses are a first guess, within 30 %.
    area : length and width of what may be driven on [m].
    speed : that is held [m/s].
    time : of steering, over all passes through the area [s].
    after : a model so far, of a fit or the axle identifier; None: nothing is known.
    friction : prior of tires and road, within 30 % [-]; None takes 0.8. Not together with `after`.
    share : of the grip that is used at most, 0.2 to 0.97.
    margin : from the car to the edge of the area [m]; None takes 0.35 wheelbases.
    rate_limit : of the front wheels [rad/s]; None takes 0.4/sqrt(L/g).
    max_angle : of the front wheels [rad].
    steering_lag : time constant from the angle asked for to that of the front wheels, within 30 %
        [s]; None takes that of the vehicle's chassis, 0.04 where it has none.
    held : whether who steers also holds the planned course; else it is steered blindly.
    seed : of the search.
    progress : called with the share that is done.

    Raises
    ------
    PlanError
        Where the area, the speed or the time make no maneuver.
    ValueError
        Where a number is out of its range, or `after` does not know how sure it is or is that
        of another car.

    Examples
    --------
    >>> import tireid as ti
    >>> found = ti.plan(ti.sedan(), area=(60.0, 20.0), speed=12.0, time=2.0)
    >>> bool(found.error < 0.5 * found.error_before)
    True
    """
    long, wide = max(area), min(area)
    space = Space(
        length=long,
        width=wide,
        speed=speed,
        share=share,
        margin=MARGIN * vehicle.wheelbase if margin is None else margin,
        rate_limit=RATE / vehicle.froude_time if rate_limit is None else rate_limit,
        max_angle=max_angle,
        held=held,
    )
    if steering_lag is not None:
        require_within(PlanError, SHORTEST_LAG, LONGEST_LAG, steering_lag=steering_lag)
    rng = np.random.default_rng(seed)
    if after is None:
        believed = FRICTION if friction is None else friction
        if not 0.05 <= believed <= 3.0:
            raise PlanError(f"friction must be 0.05 to 3, it is {believed:g}")
        tires = PlausibleTires.declared(vehicle, believed, steering_lag=steering_lag)
    else:
        if friction is not None:
            raise PlanError("the model already has a friction: leave one of them out")
        tires = PlausibleTires.learnt(_of_car(after, vehicle), rng, steering_lag=steering_lag)
    return make_plan(tires, space, time, rng, progress)


def rehearsals(found: Plan) -> tuple[Rehearsal, ...]:
    """Return how the double-track car of the vehicle drives a plan; none where it has no tires."""
    tires = found.tires
    chassis = tires.vehicle.chassis
    if chassis is None or chassis.tire is None:
        return ()
    steered = replace(chassis, steering_lag=float(tires.steering_lag[0]))
    try:
        return found.rehearsed(Plant(replace(tires.vehicle, chassis=steered)))
    except PlantError as error:
        raise PlanError(f"the double-track car of the vehicle cannot drive it: {error}") from None


def _of_car(model: TireModel, vehicle: Vehicle) -> AxleModel:
    """Return the model in hidden units, judged."""
    kind = model.kind
    model = begun(model)
    if not isinstance(model, AxleModel):
        raise ValueError(
            "a plan needs a model with a covariance, of a fit or the axle identifier: this one "
            f"is of kind {kind!r}"
        )
    return model if model.vehicle == vehicle else model.mounted_on(vehicle)
