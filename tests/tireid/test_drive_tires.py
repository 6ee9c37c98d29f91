"""The curves beside a drive: which tires are shown, under which name, and that they are theirs."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.mpc_cases import cornering_limit
from identifier.paper.network import Network, NetworkModel, Weights
from models.vehicle import sedan
from mpc.tires import prediction_tire
from mpc.tires.tire import curves_at
from tests.tireid.test_drive_setup import LANE, setup
from tireid.driving.results import _known_curves
from tireid.driving.runs import FROZEN, LEARNING, LINEAR, ORACLE, Known
from tireid.driving.setup import SpeedWish
from tireid.figures.drive import AT_THE_END

CAR = sedan()
ALPHA = np.linspace(-0.35, 0.35, 281)
SETUP = setup(LANE, SpeedWish(speed=16.0), ((60.0, 0.4),), mu=0.9)


def test_the_linear_tire_is_a_line_of_its_stiffness():
    force = curves_at(prediction_tire(CAR), ALPHA, 16.0).T
    slope = [CAR.cornering_stiffness_front, CAR.cornering_stiffness_rear]
    small = np.abs(ALPHA) < 0.02
    np.testing.assert_allclose(force[small], ALPHA[small, None] * slope, rtol=1e-6)


def test_the_true_tire_is_shown_on_the_first_and_on_the_last_friction():
    curves = {curve.label: curve for curve in _known_curves([], SETUP, None)}
    assert list(curves) == [LINEAR, ORACLE, ORACLE + AT_THE_END]
    most, last = (curves[name].force.max(axis=0) for name in (ORACLE, ORACLE + AT_THE_END))
    np.testing.assert_allclose(last / most, 0.4 / 0.9, rtol=0.1)
    assert most.sum() == pytest.approx(CAR.mass * cornering_limit(CAR, mu=0.9), rel=0.1)


def test_what_a_tracker_got_later_is_drawn_as_the_end_up_to_its_known_slip():
    first, soft = prediction_tire(CAR), prediction_tire(replace(CAR, cornering_stiffness_front=4e4))
    same = SimpleNamespace(label=FROZEN, model=soft, final=soft)
    known = [Known(0.0, first.weights, soft.weights, np.array([0.02, 0.03])),
             Known(1.0, soft.weights, soft.weights, np.array([0.101, np.nan]))]  # fmt: skip
    changed = SimpleNamespace(label=LEARNING, model=first, final=soft, known=known)
    curves = {curve.label: curve for curve in _known_curves([same, changed], SETUP, None)}
    assert FROZEN in curves and FROZEN + AT_THE_END not in curves
    assert LEARNING + AT_THE_END in curves and LEARNING not in curves
    drawn = np.isfinite(curves[LEARNING + AT_THE_END].force)
    np.testing.assert_array_equal(drawn[:, 0], np.abs(ALPHA) <= 0.101)
    assert drawn[:, 1].all()  # where nobody says how far it is known


@pytest.mark.parametrize("v_x", [8.0, 16.0])
def test_a_network_is_shown_sliding_sideways_as_fast_as_the_slip_says(v_x):
    """It looks at v_y = -v_x tan(alpha) and at nothing else; the linear tire below it has slip."""
    W, V = np.array([[2.0, -1.0], [0.5, 1.5]]), np.array([[1.0], [0.3]])
    model = NetworkModel(
        vehicle=CAR,
        network=Network(hidden=2, inputs=("v_y",), scale=(4.0,)),
        weights=Weights(W=W, V=V),
        force_unit=1500.0,
        min_speed=1.0,
    )
    v_y = -v_x * np.tan(ALPHA)
    slope = np.array([CAR.cornering_stiffness_front, CAR.cornering_stiffness_rear])
    learnt = 1500.0 * W @ np.tanh(V * v_y / 4.0)
    expected = ALPHA[:, None] * slope + learnt.T
    force = curves_at(prediction_tire(model), ALPHA, v_x).T
    np.testing.assert_allclose(force, expected, rtol=1e-6, atol=1e-3)
