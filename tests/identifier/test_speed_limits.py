"""What tires allow over speed: by hand, by another reading of the model, and falling with doubt."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import tireid as ti
from identifier.estimate.solve import car_numbers
from identifier.motion.model import pushed_function
from identifier.speed_limits import SHARES
from models.vehicle import GRAVITY
from tests.identifier.export.test_emitted import NO_ELLIPSE, PRESSED, fitted, level


def test_tires_grip_lengthwise_as_sideways_by_hand():
    """Without load transfer and ellipse the friction circle is left: a_x² + a_y² = A²."""
    found = ti.speed_limits(level(load_transfer=0.0, **NO_ELLIPSE))
    np.testing.assert_allclose(found.a_y, 1.1 * GRAVITY, rtol=1e-3)
    for side in (found.push, found.brake):
        left = found.a_y[:, None] * np.sqrt(1.0 - SHARES**2)
        np.testing.assert_allclose(side.most, left, atol=0.01 * found.a_y[0])
        assert (np.diff(side.most, axis=1) < 0.0).all()


def test_an_axle_that_brakes_alone_limits_by_hand():
    """c = 2 of the rear axle: a_y = A sqrt(1 - (2 a_x/g)²), within the circle."""
    found = ti.speed_limits(level(load_transfer=0.0, **{**NO_ELLIPSE, "braking_r": 2.0}))
    circle, ellipse = 1.1 * np.sqrt(1.0 - SHARES**2), 0.5 * np.sqrt(1.0 - SHARES**2)
    np.testing.assert_allclose(found.brake.most[0], GRAVITY * ellipse, atol=0.05)
    np.testing.assert_allclose(found.push.most[0], GRAVITY * circle, atol=0.1)
    assert (found.brake.axle[0, 10:-1] == 1).all(), "the rear one"


def test_an_axle_that_drives_alone_pushes_no_more_than_its_own_grip():
    """F_z,f/W of the circle: φ_f = 1.1 is spent on a_x m = φ_f F_z,f sqrt(1 - (a_y/A)²)."""
    model = level(load_transfer=0.0, **NO_ELLIPSE)
    model = replace(model, vehicle=replace(model.vehicle, drive_front_share=1.0))
    found, car = ti.speed_limits(model), model.vehicle
    most = found.a_y[:, None] * car.l_r / car.wheelbase * np.sqrt(1.0 - SHARES**2)
    np.testing.assert_allclose(found.push.most, most, atol=0.01 * found.a_y[0])
    assert (found.push.axle[0, :-1] == 0).all() and found.brake.most[0, 0] > 1.5 * most[0, 0]


def test_what_is_allowed_both_axles_of_the_model_can_give():
    use = {"braking_f": 0.3, "braking_r": 0.9, "driving_f": 0.1, "driving_r": 0.8}
    model = fitted(PRESSED, sd=1e-6, load_transfer=0.35, **use)
    found = ti.speed_limits(model)
    slips = [np.linspace(0.0, 2.0 * known, 400) for known in model.known_slip]
    peak = np.array([model.force(alpha)[:, i].max() for i, alpha in enumerate(slips)])
    peak /= PRESSED.axle_loads
    for sign, side in ((1.0, found.push), (-1.0, found.brake)):
        for v, a_y, most in zip(found.v, found.a_y, side.most, strict=True):
            a_x = sign * most - PRESSED.drag * v**2
            ratio = pushed_function()(model.p, car_numbers(PRESSED), a_x[None], v)
            able = GRAVITY * (peak * np.array(ratio).T).min(axis=1)
            assert (SHARES * a_y <= 1.003 * able + 0.02).all()
            assert (most**2 + (SHARES * a_y) ** 2 <= (1.001 * a_y) ** 2).all()


def test_more_doubt_is_never_faster():
    sure, doubtful = fitted(sd=0.05), fitted(sd=0.22)
    path = ti.paths.handling_course()
    least = ti.speed_limits(doubtful)
    some = [ti.speed_limits(sure, confidence=sure_of, beyond=1.0) for sure_of in (0.6, 0.95, 0.999)]
    for more, less in pairwise(some):
        assert (less.a_y <= more.a_y).all() and (less.brake.most <= more.brake.most + 1e-9).all()
    assert (some[1].a_y <= ti.speed_limits(sure).a_y).all(), "farther than is known it is more"
    fast, slow = (
        ti.speed_profile(path, limits, v_max=30.0).v for limits in (ti.speed_limits(sure), least)
    )
    assert (slow <= fast * (1.0 + 1e-9)).all() and slow.min() < 0.99 * fast.min()


def test_limits_are_scaled_by_a_friction():
    found = ti.speed_limits(fitted(PRESSED))
    wet = found.scaled(0.6)
    for side in ("push", "brake"):
        ratio = getattr(wet, side).most[:, :-1] / getattr(found, side).most[:, :-1]
        np.testing.assert_allclose(ratio, 0.6)
    np.testing.assert_allclose(wet.a_y, 0.6 * found.a_y)
    assert found.at_most(5.0).a_y[0] == pytest.approx(5.0)
    assert found.at_most(50.0).a_y[0] == found.a_y[0]
    assert wet.drag == found.drag == PRESSED.drag
    assert "from standing; given to 30.0 m/s" in repr(found)


@pytest.mark.parametrize(
    ("made", "said"),
    [
        (lambda: ti.speed_limits(fitted(), confidence=0.5), "above 0.5 and below 1, it is 0.5"),
        (lambda: ti.speed_limits(fitted(), beyond=np.nan), "beyond must be 1 or more known slips"),
        (lambda: ti.speed_limits(unknown()), "rear axle is not known at any slip: drive harder"),
        (lambda: ti.SpeedLimits.ellipse(0.0), "a_y must be positive and finite"),
        (lambda: ti.SpeedLimits.ellipse(9.0).scaled(-1.0), "ratio must be positive"),
    ],
)
def test_what_are_no_limits_is_one_clear_line(made, said):
    with pytest.raises(ValueError, match=said) as caught:
        made()
    assert "\n" not in str(caught.value)


def unknown():
    model = fitted()
    return replace(model, reach=model.reach._replace(slip=np.array([0.1, 0.0])))
