"""A folded step against the method that it came from."""

from dataclasses import replace
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest

from codegen import Scan
from identifier.baselines import LaggedEkf
from identifier.export.layout import Member, covariance_order
from identifier.export.specialize import Signal, SpecializedStep, specialize
from identifier.methods import METHODS, make_method
from identifier.run import identify
from identifier.setup import COVARIANCE
from models.vehicle import sedan
from tests.rivals import rival

CAR = sedan()


def run_folded(specialized: SpecializedStep, recording):
    over = ("x", "u", "v_x", *["a_y"] * specialized.reads_a_y)
    scan = Scan(specialized.function, carry=tuple(specialized.carry), over=over)
    carry = dict(specialized.carry)
    if specialized.rests_first:
        names = list(carry)
        rested = specialized.function(*carry.values(), recording.x[0], recording.u[0], 0.0)
        carry = dict(zip(names, map(np.array, rested[: len(names)]), strict=True))
    signals = {port: getattr(recording, port) for port in over}
    return scan(recording.t.size, {**carry, **signals})["axle_force"]


@pytest.mark.sweep("integral", "linear")
@pytest.mark.parametrize("law", [*(law for law in METHODS if law != "fit"), rival("linear_kf")])
def test_the_folded_step_is_the_method_up_to_rounding(law, slalom):
    method = make_method(law, CAR)
    specialized = specialize(method, CAR)
    shown = slalom if specialized.reads_a_y else replace(slalom, a_y=None)
    expected = identify(shown, CAR, method).axle_force
    error = np.abs(run_folded(specialized, slalom) - expected).max()
    assert error <= 1e-6  # N, of 5000; the tires' own sin, cos and exp are far from exact


def test_a_step_that_solves_a_problem_is_not_exported(monkeypatch):
    x = ca.MX.sym("x")
    solving = SimpleNamespace(scan=SimpleNamespace(step=ca.Function("solves", [x], [x])))
    monkeypatch.setattr(LaggedEkf, "setup", lambda *_: solving)
    with pytest.raises(ValueError, match="LaggedEkf cannot be exported: its step solves"):
        specialize(make_method("lagged_ekf", CAR), CAR)


def test_a_y_is_an_input_of_methods_that_need_it_and_of_others_where_it_is_asked_for():
    inputs = [port.name for port in specialize(make_method("axle", CAR), CAR).inputs]
    assert inputs == ["v_x", "v_y", "r", "delta_f", "delta_r"]
    for specialized in (
        specialize(make_method("inertial", CAR), CAR),
        specialize(make_method("axle", CAR), CAR, with_a_y=True),
    ):
        assert [port.name for port in specialized.inputs] == [*inputs, "a_y"]
        assert specialized.inputs[-1].unit == "m/s^2"
    for law in ("integral", "linear"):
        with pytest.raises(ValueError, match="has no use for a_y"):
            specialize(make_method(law, CAR), CAR, with_a_y=True)


def test_a_method_that_tells_v_y_says_so_of_its_inputs():
    """v_y stays an input: where it is measured, it may be given."""
    told, given = (specialize(make_method(law, CAR), CAR) for law in ("inertial", "axle"))
    assert told.tells_v_y and not given.tells_v_y
    assert "NaN where there is none" in told.inputs[1].description
    assert "NaN" not in given.inputs[1].description
    names = [port.name for port in told.outputs]
    assert names == ["axle_force", "v_y", "v_y_sd", "side_slip_observable"]


def test_a_forgotten_constant_would_be_noticed(slalom):
    other = make_method("integral", CAR, seed=1)
    expected = identify(slalom, CAR, make_method("integral", CAR)).axle_force
    assert np.abs(run_folded(specialize(other, CAR), slalom) - expected).max() > 1.0


def test_what_is_learnt_is_told_apart_from_filters():
    assert specialize(make_method("integral", CAR), CAR).learnt == ("W", "V")
    assert "filters" not in specialize(make_method("axle", CAR), CAR).learnt


@pytest.mark.sweep("axle", "integral")
@pytest.mark.parametrize("law", ["integral", "axle", "lagged_ekf", "inertial"])
def test_every_port_has_a_unit_and_words(law):
    specialized = specialize(make_method(law, CAR), CAR)
    assert [signal.name for signal in specialized.state] == list(specialized.carry)
    for signal in (*specialized.inputs, *specialized.outputs, *specialized.state):
        assert signal.unit
        assert signal.description
    assert specialized.outputs[0].name == "axle_force"


def test_covariances_of_two_sizes_among_the_weights_are_refused():
    """The C that checks them knows one size."""
    sizes = [Signal("P", "-", "of two", size=4, rule=COVARIANCE)]
    member = Member(sizes[0], (2, 2), learnt=True)
    larger = Member(sizes[0]._replace(name="Q", size=9), (3, 3), learnt=True)
    assert covariance_order([member, member]) == 2
    with pytest.raises(ValueError, match="one size"):
        covariance_order([member, larger])
