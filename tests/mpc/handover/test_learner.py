"""In the closed loop: the friction halves, and the car that learns stays on the path."""

from types import SimpleNamespace

import numpy as np
import pytest

from identifier.axle import AxleIdentifier
from identifier.run import OnlineIdentifier
from models.friction import Friction, FrictionChange
from mpc.cars import DoubleTrackCar
from mpc.handover import learner as learner_module
from mpc.handover.learner import Learner, blended
from mpc.handover.road import at_friction
from mpc.handover.supervisor import Supervisor
from mpc.loop.drive import drive
from mpc.loop.sensing import Measured, inertial_unit
from mpc.path import iso_3888_1
from mpc.realtime import Measurement, Tracker
from mpc.tires import prediction_tire

PLACE = 50.0  # m
SPEED = 27.5  # m/s, 96 % of the limit at friction 0.5


@pytest.fixture(scope="module")
def drives(car, learnt):
    """The lane change on the linear tire of the data sheet, and learning; jumps of the plan."""
    friction = Friction(changes=(FrictionChange(scale=0.5, at_place=PLACE),))
    identifier = OnlineIdentifier(AxleIdentifier.for_vehicle(car), car, 0.01, learnt)
    learner = Learner(Supervisor(identifier, prediction_tire(learnt)))
    found, jumps = [], []

    def noted(now, target, share, *, planned, most):
        tire = blended(now, target, share, planned=planned, most=most)
        jumps.append(abs(planned(tire) - planned(now)))
        return tire

    patch = pytest.MonkeyPatch()
    patch.setattr(learner_module, "blended", noted)
    for tire, beside in ((prediction_tire(car), None), (prediction_tire(learnt), learner)):
        tracker = Tracker(tire, period=0.01, delay=0.06)
        driven = drive(
            iso_3888_1(),
            DoubleTrackCar(car, friction=friction),
            tracker,
            speed=SPEED,
            sensors=inertial_unit(),
            delay=2,
            rng=np.random.default_rng(1),
            learner=beside,
        )
        found.append(driven)
    patch.undo()
    return (*found, jumps)


def test_the_learning_car_stays_where_the_linear_one_leaves(drives):
    linear, learning, _ = drives
    assert np.abs(linear.e_y).max() > 0.5
    assert learning.completed
    assert np.abs(learning.e_y).max() < 0.3


def test_the_drop_is_noted_in_time(drives):
    _, learning, _ = drives
    dropped_at = learning.t[np.argmax(learning.X > PLACE)]
    lost = [t for t, note in learning.notes if note.startswith("friction lost")]
    assert 0.0 < lost[0] - dropped_at < 0.7


def test_who_only_watches_finds_the_friction_and_leaves_the_tire(drives, car, learnt):
    """On the sensors of the car that learnt: half the friction behind the drop."""
    identifier = OnlineIdentifier(AxleIdentifier.for_vehicle(car), car, 0.01, learnt)
    watcher = Learner(Supervisor(identifier, prediction_tire(learnt)), steers=False)
    tracker = SimpleNamespace(delay=0.06, period=0.01, steering=0.0)  # whose tire nobody sets
    driven, found, said = drives[1], [], []
    for k in range(len(driven)):
        seen = Measured(**{name: float(values[k]) for name, values in driven.measured.items()})
        said.append(watcher.observe(seen, tracker))
        tracker.steering = float(driven.command[k])
        found.append(watcher.supervisor.friction)
    before = np.array(found)[driven.X < PLACE]
    assert (before > 0.85).all() and before[0] == 1.0
    assert 0.4 < min(found) < 0.65
    notes = {note.split(":")[0] for note in said if note}
    assert "friction lost" in notes and "learnt tire" not in notes


def test_no_handover_makes_the_plan_jump_more_than_noise_does(drives):
    _, learning, jumps = drives
    assert len(jumps) >= 5
    rates = np.diff(learning.command) / learning.period
    usual = np.percentile(np.abs(np.diff(rates)), 99)
    assert max(jumps) <= min(0.2, usual)


def test_a_preview_changes_nothing_and_tells_the_plan(car, learnt):
    """Two trackers that drift off a bend, one of them asked at every step what it would do."""
    tire = prediction_tire(learnt)
    asked, left_alone = (Tracker(tire, period=0.01, delay=0.02) for _ in range(2))
    kappa, v_x = (np.full(asked.times.size, value) for value in (0.01, 20.0))
    for k in range(30):
        measurement = Measurement(0.01 * k, 0.0, -0.1, 0.2, kappa, v_x)
        command = asked.step(measurement)
        assert command.steering == left_alone.step(measurement).steering
        same, other = (asked.previewed_rate(one) for one in (tire, at_friction(tire, 0.4)))
    assert abs(command.plan_u[0]) > 0.05
    assert same == pytest.approx(command.plan_u[0], rel=0.1)  # it is one iteration further
    assert abs(other - same) > 0.02
    assert asked.tire is tire
    with pytest.raises(ValueError, match="the tracker is built for"):
        asked.previewed_rate(prediction_tire(car))
