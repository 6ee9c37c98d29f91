"""What is recorded is what the code does now: the quick ones of the benchmarks, once more.

Where one fails because behavior was meant to change, run `python -m benchmarks.run_all --record`.
"""

import pytest

from benchmarks import recorded_cars
from benchmarks.documents import recorded
from benchmarks.targets import Targets
from identifier.compare.course import Course
from identifier.methods import LIVE, make_method
from identifier.run import identify
from models.vehicle import sedan
from tireid.commands.demo_story import plant_recordings


@pytest.mark.heavy
def test_the_errors_on_recorded_cars_are_those_recorded():
    if not recorded_cars.DATA.is_dir():
        pytest.skip(f"the recordings are not there: {recorded_cars.DATA}")
    targets = Targets("recorded_cars")
    recorded_cars.measure(targets)
    assert targets.values == pytest.approx(recorded()["recorded_cars"], rel=1e-3)


def test_what_the_default_method_learns_on_the_plant_is_that_recorded():
    car = sedan()
    slalom, method = plant_recordings(car)[0], make_method(LIVE, car)
    course = Course(vehicle=car, recordings=(slalom,), min_speed=method.min_speed)
    model = identify(slalom, car, method).freeze(float(slalom.t[-1]))
    error = course.error(slalom, model.predict(slalom))
    found = recorded()["learn_and_extrapolate"]["plant/in_sample/exact"]
    assert max(error.front, error.rear) / 1e3 == pytest.approx(found, rel=1e-3)
