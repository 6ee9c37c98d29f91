"""What is no tire, and what was taught by an unproven law or by too little, never steers."""

import re
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
import pytest

from mpc.handover.certificate import tire_complaint
from mpc.handover.road import at_friction
from mpc.handover.supervisor import Excitation
from mpc.tires import PredictionTire, oracle_tire, prediction_tire
from mpc.tires.tire import TireStructure


def edited(tire, axle, change):
    """The tire with other w_j of one axle."""
    weights, n = tire.weights.copy(), tire.structure.units
    force = weights[4:].reshape(2, -1)[axle, -n:]
    force[:] = change(force)
    return tire._replace(weights=weights)


def test_true_and_learnt_tires_pass_on_every_road(car, tire):
    for mu in (0.3, 0.5, 1.0):
        assert tire_complaint(oracle_tire(car, mu=mu), 20.0) is None
        for v_x in (5.0, 20.0, 40.0):
            assert tire_complaint(at_friction(tire, mu), v_x) is None


@pytest.mark.parametrize(
    ("axle", "change", "complaint"),
    [
        (0, lambda w: np.nan * w, "a weight is not finite"),
        (0, lambda w: np.array([-0.097, 0.0, 0.0, 1.0]) * w.sum(), "front axle does not rise"),
    ],
)
def test_what_is_no_tire_is_refused(tire, axle, change, complaint):
    with np.errstate(invalid="ignore"):
        found = tire_complaint(edited(tire, axle, change), 20.0)
    assert re.search(complaint, str(found))


@dataclass(frozen=True)
class Spoiled(TireStructure):
    """A good tire but for one axle, one sign of its slip, and bends to one side (0: straight)."""

    axle: int
    sign: float
    turn: float
    kind: str
    n_weights: int = 1

    def force(self, slip, at):
        car = at.car
        weight = 9.81 * car.m / (car.l_f + car.l_r)
        loads = weight * car.l_r, weight * car.l_f
        told = [0.8 * load * ca.tanh(20.0 * a) for load, a in zip(loads, slip, strict=True)]
        a, good = slip[self.axle], told[self.axle]
        bad = {
            "none": good,
            "wrong way": -0.1 * good,
            "too much": 2.5 * good,
            "too little": 0.02 * good,
            "no number": good / 0.0,
        }[self.kind]
        turns = at.r * self.turn > 0.01 if self.turn else ca.fabs(at.r) < 0.01
        here = ca.logic_and(self.sign * a > 0.0, turns)
        told[self.axle] = ca.if_else(here, bad, good)
        return tuple(told)


@pytest.mark.parametrize(
    ("kind", "complaint"),
    [
        ("wrong way", "would push the wrong way by 0.08 of its load"),
        ("too much", r"would carry (1\.99|2\.00) times its load"),
        ("too little", "would slide at 0.02 of its load"),
        ("no number", "a force is not finite"),
    ],
)
@pytest.mark.parametrize("axle", [0, 1])
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("turn", [0.0, 1.0, -1.0])
def test_a_tire_that_is_none_at_one_sign_of_slip_or_bend_is_refused(
    car, axle, sign, turn, kind, complaint
):
    spoiled = PredictionTire(Spoiled(axle, sign, turn, kind), np.ones(1), car)
    found = tire_complaint(spoiled, 20.0)
    assert re.search(complaint, str(found))
    assert kind == "no number" or ("front", "rear")[axle] in found
    assert (
        tire_complaint(spoiled._replace(structure=Spoiled(axle, sign, turn, "none")), 20.0) is None
    )


@pytest.mark.parametrize("offset", [0.05, -0.05])
def test_a_learnt_tire_that_pushes_without_slip_is_refused_to_either_side(tire, offset):
    for place, axle in ((0, "front"), (1, "rear")):  # zero of the steering, bias of v_y
        weights = tire.weights.copy()
        weights[:2] = 0.0
        weights[place] = offset if place == 0 else 20.0 * offset
        found = tire_complaint(tire._replace(weights=weights), 20.0)
        assert "wrong way" in str(found)
        assert place == 1 or axle in found  # a bias of v_y is at both axles


def test_a_tire_must_be_known_where_the_car_is_driven(car, learnt, dry):
    excitation, samples = Excitation(0.01, car, 1.0), np.tile([20.0, 0.0, 0.0, 0.0], (100, 1))
    assert "the front axle was identified for 0.0 s, not 1 s" in excitation.complaint(
        learnt, samples
    )
    recording = dry[1]
    for row in zip(recording.v_x, recording.v_y, recording.r, recording.delta_f, strict=True):
        excitation.add(*row)
    assert excitation.complaint(learnt, samples) is None
    known = learnt.known_slip
    v_y = -20.0 * np.tan(1.5 * known.max())
    beyond = np.tile([20.0, v_y, 0.0, 0.0], (100, 1))
    assert "it is known to" in excitation.complaint(learnt, beyond)
    assert "it is known to" in excitation.complaint(learnt, -beyond * [-1.0, 1.0, 1.0, 1.0])
    turned = np.tile([20.0, 0.0, 0.0, -1.5 * known[0]], (100, 1))  # in front alone, to the right
    assert "the front axle slips" in excitation.complaint(learnt, turned)


def test_ladders_are_judged_far_others_as_far_as_the_car_slipped(car, tire):
    excitation = Excitation(0.01, car, 1.0)
    assert excitation.trusted_slip(tire) == 0.25
    assert excitation.trusted_slip(prediction_tire(car)) == 0.01
    right = Excitation(0.01, car, 1.0)
    for _ in range(100):
        excitation.add(20.0, -20.0 * np.tan(0.05), 0.0, 0.0)
        right.add(20.0, 20.0 * np.tan(0.05), 0.0, 0.0)
    for one in (excitation, right):
        assert one.trusted_slip(prediction_tire(car)) == pytest.approx(0.06, rel=1e-3)


def test_a_tire_of_a_car_with_downforce_is_judged_by_the_load_at_the_speed(car):
    racer = replace(car, downforce_area_front=4.0, downforce_area_rear=4.0)
    tire = oracle_tire(racer)
    for v_x in (10.0, 40.0, 70.0):
        assert tire_complaint(tire, v_x) is None
    assert "times its load" in tire_complaint(tire._replace(vehicle=car), 70.0)
