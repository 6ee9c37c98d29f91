"""The plant one period at a time."""

from dataclasses import dataclass

import numpy as np
import pytest

from models.friction import Friction, FrictionChange
from models.plant import Plant, StepwisePlant
from models.vehicle import sedan

PERIOD = 0.01
PERIODS = 150


@dataclass(frozen=True)
class Staircase:
    """Steering that is held over each period, as a controller's is."""

    angles: tuple[float, ...]

    @property
    def duration(self):
        return PERIOD * len(self.angles)

    def steering(self, t):
        row = np.minimum((t / PERIOD + 1e-9).astype(int), len(self.angles) - 1)
        return np.column_stack([np.array(self.angles)[row], np.zeros(len(t))])


def wanted(k):
    return 20.0 + 0.5 * (k // 40)


@pytest.fixture(scope="module")
def angles():
    generator = np.random.default_rng(1)
    return tuple(np.cumsum(generator.normal(0.0, 0.004, PERIODS)))


@pytest.mark.parametrize(
    "friction",
    [
        Friction(),
        Friction(scale=0.9, changes=(FrictionChange(scale=0.4, at_time=0.7, width=0.2),)),
        Friction(changes=(FrictionChange(scale=0.5, at_place=12.0, width=3.0),)),
    ],
)
def test_the_same_commands_give_the_same_run_bit_for_bit(angles, friction):
    plant = Plant(sedan())
    run = plant.simulate(
        Staircase(angles),
        speed=lambda t: np.array([wanted(k) for k in (t / PERIOD + 1e-9).astype(int)]),
        friction=friction,
    )
    stepwise = StepwisePlant(plant, friction=friction, period=PERIOD)
    state = stepwise.start(20.0)
    for k, angle in enumerate(angles):
        columns = (run.v_x, run.v_y, run.r, run.roll, run.roll_rate, run.X, run.Y, run.psi)
        assert np.array_equal(state.x[:8], [column[k] for column in columns])
        assert np.array_equal(state.alpha, run.alpha[k])
        assert np.array_equal(state.F_z, run.F_z[k])
        if k == 0 or wanted(k) == wanted(k - 1):  # else the drive force has jumped since
            assert np.array_equal(state.axle_force, run.axle_force[k])
            assert np.array_equal(state.acceleration, [run.a_x[k], run.a_y[k]])
        state = stepwise.step(state, np.array([angle, 0.0]), wanted(k))
    assert state.x[5] == run.X[PERIODS]


def test_a_step_changes_nothing_but_gives_the_next_state():
    stepwise = StepwisePlant(Plant(sedan()))
    state = stepwise.start(15.0)
    before = state.x.copy()
    first = stepwise.step(state, np.array([0.03, 0.0]), 15.0)
    second = stepwise.step(state, np.array([0.03, 0.0]), 15.0)
    assert np.array_equal(state.x, before)
    assert np.array_equal(first.x, second.x)
    assert first.steps == 10
