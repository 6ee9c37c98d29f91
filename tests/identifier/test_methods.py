"""Methods of other distributions are found by entry points, made, run and refused by name."""

from importlib import metadata

import numpy as np
import pytest

import tireid as ti
from identifier import methods
from identifier.baselines import LinearBaseline
from tireid.cli import build_parser

CAR = ti.sedan()
POINTS = """[tireid.methods]
mine = its_methods:make
linear = its_methods:make
broken = its_methods:fail
odd = its_methods:odd
"""
CODE = """from identifier.baselines import LinearBaseline

def make(vehicle, seed):
    return LinearBaseline(dt=0.01, min_speed=2.0 + seed)

def fail(vehicle, seed):
    raise RuntimeError("no licence\\nfor it")

def odd(vehicle, seed):
    return 3.0
"""


@pytest.fixture
def installed(distribution):
    distribution(POINTS, its_methods=CODE)


@pytest.mark.usefixtures("installed")
def test_an_installed_method_is_one_of_all_and_runs():
    assert {"mine", "broken", "odd"} <= set(ti.methods()) - set(methods.METHODS)
    assert ti.make_method("mine", CAR, 3) == LinearBaseline(dt=0.01, min_speed=5.0)
    log = ti.sample_recording(CAR)
    theirs, ours = (ti.identify(log, CAR, name, check=False) for name in ("mine", "linear"))
    fast = log.v_x > 3.0
    np.testing.assert_array_equal(theirs.force[fast], ours.force[fast])
    parser = build_parser(["identify"])
    assert parser.parse_args(["identify", "l", "--vehicle", "c", "--method", "mine"]).method


@pytest.mark.usefixtures("installed")
def test_a_name_of_tireid_stays_its_own():
    assert ti.make_method("linear", CAR) == LinearBaseline.for_vehicle(CAR)
    assert ti.methods().count("linear") == 1


@pytest.mark.usefixtures("installed")
@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("broken", r"method broken \(its_methods:fail\) cannot be made: no licence for it"),
        ("odd", r"method odd \(its_methods:odd\) is a float, no Method"),
        ("other", "method must be one of fit, .*, mine, .*not 'other'.*integral the paper's"),
    ],
)
def test_what_makes_no_method_is_one_line(name, said):
    with pytest.raises(ValueError, match=said):
        ti.make_method(name, CAR)


def test_without_another_distribution_the_methods_are_those_of_tireid():
    named = {point.name for point in metadata.entry_points(group=methods.GROUP)}
    assert set(ti.methods()) == {*methods.METHODS, *named}
    assert ti.methods()[: len(methods.METHODS)] == tuple(methods.METHODS)
    assert named in (set(), set(methods.RIVALS)), "installed are the rivals, or nothing"
