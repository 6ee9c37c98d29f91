"""What every method answers: its ports, a setup without a recording, where observers begin."""

import pickle
from dataclasses import fields, is_dataclass, replace
from itertools import product

import casadi as ca
import numpy as np
import pytest

from identifier.driving import natural_driving
from identifier.export.specialize import specialize
from identifier.methods import METHODS, certify, make_method
from identifier.run import identify
from models.bicycle import bicycle
from models.vehicle import sedan
from tests.identifier.conftest import felt

CAR = sedan()
ONLINE = [name for name in METHODS if not make_method(name, CAR).whole]
OBSERVING = {"integral", "instantaneous", "instantaneous_scaled", "pi_lead"}


@pytest.mark.parametrize("name", ONLINE)
def test_a_setup_carries_what_its_step_asks_for(name):
    setup = make_method(name, CAR).setup(CAR)
    step = setup.scan.step
    given = {**setup.carry, **setup.constants}
    assert set(given) == set(step.name_in()) - set(setup.scan.over)
    for port, value in given.items():
        assert np.asarray(value).size == step.numel_in(port), port
    assert (setup.observe is not None) == (name in OBSERVING)


@pytest.mark.parametrize("name", sorted(OBSERVING))
def test_an_observer_begins_at_the_first_measurement(name, drive):
    still, method = drive(n=60), make_method(name, CAR)
    recording = replace(still, v_y=still.v_y + 0.3, r=still.r + 0.1)
    setup = method.setup(CAR)
    assert not setup.carry["xi_hat"].any()
    begun = setup.begin(recording.x[0]).carry
    K = np.array(ca.DM(bicycle(CAR.bicycle, 20.0).K))
    np.testing.assert_allclose(K @ begun["xi_hat"] * method.force_unit, recording.x[0], rtol=1e-12)
    history = identify(recording, CAR, method)
    np.testing.assert_array_equal(history.state["xi_hat"][0], begun["xi_hat"])
    assert not history.outputs["xi_tilde"][0].any()  # it agrees with what it began at
    assert history.outputs["xi_tilde"][1].any()


@pytest.mark.parametrize("name", sorted(set(ONLINE) - OBSERVING))
def test_a_method_without_an_observer_begins_alike_wherever_it_begins(name):
    setup = make_method(name, CAR).setup(CAR)
    assert setup.begin(np.array([1.0, 1.0])) is setup


@pytest.mark.parametrize("name", METHODS)
def test_a_run_goes_to_another_process_and_tells_the_same_there(name, drive):
    run = identify(felt(drive(n=300)), CAR, make_method(name, CAR))
    forces = run.axle_force.copy()
    there = pickle.loads(pickle.dumps(run))
    np.testing.assert_array_equal(there.axle_force, forces)
    for ours, theirs in ((run.state, there.state), (run.outputs, there.outputs)):
        assert set(ours) == set(theirs)
        for port, values in ours.items():
            np.testing.assert_array_equal(theirs[port], values)


@pytest.mark.parametrize("name", ONLINE)
def test_a_method_describes_every_output_and_state_of_its_step_and_no_more(name):
    method = make_method(name, CAR)
    setup = method.setup(CAR)
    told = [*setup.scan.outputs, *setup.carry]
    described = [port.name for port in method.ports]
    assert set(told) == set(described)
    assert len(described) == len(set(described))
    assert described[0] == "axle_force"
    for port in map(method.port, told):
        assert port.unit and port.words
        assert "U" not in port.unit.split()
    learnt = {port.name for port in method.ports if port.learnt} & set(setup.carry)
    assert not learnt & set(setup.scan.outputs)


def test_the_force_unit_of_a_method_stands_in_the_units_of_its_ports():
    design = make_method("integral", CAR)
    assert (design.force_unit, design.port("z").unit) == (1000.0, "kN s^2")
    assert replace(design, force_unit=1.0).port("z").unit == "N s^2"
    assert replace(design, force_unit=20.0).port("W").unit == "20 N"
    with pytest.raises(KeyError, match="PaperIdentifier has no port 'zeta'"):
        design.port("zeta")


def test_a_step_with_an_output_or_state_that_nobody_describes_is_not_exported(monkeypatch):
    method = make_method("lagged_ekf", CAR)
    ports = tuple(port for port in method.ports if port.name != "estimate")
    monkeypatch.setattr(type(method), "ports", ports)
    with pytest.raises(KeyError, match="estimate"):
        specialize(method, CAR)


def numbers_of(record, before=()):
    """Where a record and those in it hold numbers."""
    for field in fields(record):
        value, here = getattr(record, field.name), (*before, field.name)
        if is_dataclass(value):
            yield from numbers_of(value, here)
        elif isinstance(value, float):
            yield here


def changed(record, place, value):
    name, *rest = place
    return replace(record, **{name: changed(getattr(record, name), rest, value) if rest else value})


@pytest.mark.parametrize("name", METHODS)
def test_a_number_that_no_method_has_is_refused_by_its_name(name):
    method = make_method(name, CAR)
    for place, value in product(numbers_of(method), (np.nan, np.inf, -1e9)):
        with pytest.raises(ValueError, match=place[-1]):
            changed(method, place, value)


@pytest.mark.parametrize("name", METHODS)
def test_every_method_answers_what_is_proven_of_it(name):
    method = make_method(name, CAR)
    found = certify(method, CAR)
    assert found == method.certify(CAR)
    assert bool(found.properties) == (name in (*OBSERVING, "axle"))
    assert bool(found.limits) == (name in ("axle", "inertial"))
    assert (found.verdict == "not certified") == (name not in (*OBSERVING, "axle"))


def test_a_certificate_is_of_the_driving_that_is_asked_for_then_of_the_one_designed_for():
    design, easy = make_method("integral", CAR), natural_driving(CAR, bandwidth=0.2)
    hard = natural_driving(CAR, bandwidth=2.0)
    assert replace(design, driving=hard).certify(CAR) == design.certify(CAR, hard)
    assert replace(design, driving=None).certify(CAR) == design.certify(CAR, natural_driving(CAR))
    assert replace(design, driving=hard).certify(CAR, easy) == design.certify(CAR, easy)
    assert design.certify(CAR, easy) != design.certify(CAR, hard)
