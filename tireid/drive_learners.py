"""What may change the tire of a tracker on the way: learning, or being told the true friction."""

from typing import Any

from identifier.method import FrozenModel
from identifier.methods import continuing
from identifier.online import OnlineIdentifier
from models.friction import Friction
from models.vehicle import Vehicle
from mpc.handover.learner import Learner
from mpc.handover.supervisor import Supervisor
from mpc.loop import Measured
from mpc.tires import tire_model
from tireid.drive_setup import PERIOD, Setup


class Informer:
    """Tells the tracker of an oracle the true tire of the road that the car is on.

    Parameters
    ----------
    setup : path, car and road.
    """

    def __init__(self, setup: Setup) -> None:
        self._setup, self._friction, self._mu = setup, setup.friction(), setup.mu

    def observe(self, measured: Measured, tracker: Any) -> str | None:
        """Change the tire where the friction has changed; return that it was done.

        Parameters
        ----------
        measured : by the sensors.
        tracker : which steers.
        """
        mu = friction_now(self._friction, measured)
        if mu == self._mu:
            return None
        self._mu = mu
        tracker.set_tire(self._setup.oracle(mu))
        return f"told of friction {mu:g}"


def friction_now(friction: Friction, measured: Measured) -> float:
    """Return the friction where the car is, of a road whose changes are steps [-].

    Parameters
    ----------
    friction : of the road.
    measured : time and place of the car.
    """
    mu = friction.scale
    for change in friction.changes:
        here = measured.t if change.at_time is not None else measured.X
        if here >= change.start:
            mu = change.scale
    return mu


def make_learner(learnt: FrozenModel, vehicle: Vehicle) -> Learner:
    """Return what goes on learning while the tracker drives, and hands over what is fit.

    Parameters
    ----------
    learnt : what the tracker is told at the start.
    vehicle : the car.

    Raises
    ------
    ValueError
        Where no method can go on from there, or its law has no certificate.
    """
    try:
        method = continuing(learnt, vehicle, PERIOD)
    except ValueError as error:
        raise ValueError(f"--tires learning: {error}") from None
    identifier = OnlineIdentifier(method, vehicle, PERIOD, learnt)
    return Learner(Supervisor(identifier, tire_model(learnt, vehicle)))
