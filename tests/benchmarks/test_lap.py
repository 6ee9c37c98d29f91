"""Cars of the lap benchmark are the ones it says, and its searches find what drives would show."""

from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks import lap
from benchmarks.lap import A_Y_STEP, WITHIN, courses, fastest_given, is_safe, lap_car, last_safe
from models.tires import DugoffTire, FialaTire, MagicFormula


def test_cars_have_three_layouts_and_tires_of_three_shapes_on_two_courses():
    cars = [lap_car(number) for number in range(24)]
    assert {type(car.tires[0]) for car in cars} == {FialaTire, DugoffTire, MagicFormula}
    assert {car.vehicle.chassis.drive_front_share for car in cars} == {0.0, 0.5, 1.0}
    assert {car.course for car in cars} == set(courses())
    for car in cars:
        simple = not isinstance(car.tires[0], MagicFormula)
        own = car.tires[0].friction if simple else car.tires[0].coefficients.LMUY
        assert 0.45 <= own * car.friction <= 1.0
        assert 500.0 < car.course.length < 850.0
    assert lap_car(3) == lap_car(3)
    tire, friction = lap_car(3, friction=1.0).tires[0], lap_car(3, friction=1.0).friction
    assert tire == lap_car(3).tires[0]
    assert friction != lap_car(3).friction


@pytest.mark.parametrize("guess", range(-9, 20, 4))
def test_the_last_safe_step_is_found_wherever_the_search_begins(guess):
    asked = []

    def safe(k):
        asked.append(k)
        return k <= 5

    assert last_safe(safe, guess) == 5
    assert len(asked) == len(set(asked)) <= 9


def test_a_car_is_safe_that_ends_its_lap_within_half_a_meter():
    def lap_of(completed, peak):
        return SimpleNamespace(scores=SimpleNamespace(completed=completed, peak_e_y_m=peak))

    assert is_safe(lap_of(True, WITHIN))
    assert not is_safe(lap_of(True, WITHIN + 0.01))
    assert not is_safe(lap_of(False, 0.1))


def test_the_fastest_given_acceleration_keeps_every_car(monkeypatch):
    """Cars leave at some share of their limit, one of them much earlier than the others."""
    cars = [SimpleNamespace(car=k, tire=None, limit=4.6 + 0.1 * k) for k in range(20)]

    def given_lap(given):
        number, _, a_y = given
        return a_y <= cars[number].limit * (0.45 if number == 13 else 0.9), 100.0 + number

    monkeypatch.setattr(lap, "given_lap", given_lap)
    a_y, times = fastest_given(SimpleNamespace(map=map), cars)
    assert a_y == pytest.approx(5 * A_Y_STEP)
    assert np.array_equal(times, 100.0 + np.arange(20))
