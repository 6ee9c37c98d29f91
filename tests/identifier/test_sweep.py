"""Random designs: the draws, the limit of stability they are measured by, divergence, the front."""

import numpy as np
import pytest

from identifier.compare.course import Course, Shares, cross_replay, shares
from identifier.compare.sweep import Candidate, best_candidate, pareto_front, random_values, sweep
from identifier.compare.tunables import (
    TUNABLES,
    largest_loop_gain,
    tunables,
    tuned_design,
    tuned_method,
)
from identifier.methods import METHODS, make_method
from identifier.stability.limits import instantaneous_euler_limit, integral_euler_limit
from identifier.tuning import SIZES
from models.maneuvers import Slalom
from models.plant import Plant
from models.vehicle import sedan


@pytest.fixture(scope="module")
def course():
    plant = Plant(sedan())
    recordings = tuple(
        plant.simulate(
            Slalom(
                amplitude=np.radians(3.0),
                frequency=frequency,
                onset=0.5,
                rate_limit=1.0,
                duration=4.0,
            ),
            speed=20.0,
            name=name,
        ).recording()
        for name, frequency in (("slow", 0.5), ("quick", 0.8))
    )
    return Course(vehicle=sedan(), recordings=recordings, min_speed=1.0)


def middle(ranges):
    return {name: span.at(0.5) for name, span in ranges.items()}


def test_a_longer_sweep_begins_with_the_designs_of_a_shorter_one():
    few = random_values(TUNABLES, 3, np.random.default_rng(5))
    many = random_values(TUNABLES, 20, np.random.default_rng(5))
    assert many[:3] == few
    for values in many:
        for name, span in TUNABLES.items():
            assert span.low <= values[name] <= span.high


def test_shares_of_the_limit_are_of_the_limits_in_closed_form():
    a, lam, dt = 7.0, 12.0, 0.01
    integral = largest_loop_gain("integral", a=a, lam=lam, lead=0.0, dt=dt)
    instantaneous = largest_loop_gain("instantaneous", a=a, lam=lam, lead=0.0, dt=dt)
    assert integral == pytest.approx(integral_euler_limit(a, lam, dt), rel=1e-3)
    assert instantaneous == pytest.approx(instantaneous_euler_limit(a, dt), rel=1e-3)


def test_the_scaled_law_gets_the_gains_of_the_integral_law_over_lambda():
    values = middle(TUNABLES)
    integral = tuned_design(sedan(), "integral", values)
    scaled = tuned_design(sedan(), "instantaneous_scaled", values)
    assert scaled.law == "instantaneous"
    assert scaled.gains.eta_W == pytest.approx(integral.gains.eta_W / values["forgetting"])
    assert {tuned_design(sedan(), "integral", {**values, "size": s}).network.hidden
            for s in (0.0, 1.5, 3.0)} == set(SIZES)  # fmt: skip


@pytest.mark.parametrize("name", METHODS)
def test_every_method_can_be_built_from_the_middle_and_the_ends_of_its_ranges(name):
    ranges = tunables(name, sedan())
    assert bool(ranges) == (name not in ("linear", "fit"))
    for share in (0.0, 0.5, 1.0):
        values = {key: span.at(share) for key, span in ranges.items()}
        method = tuned_method(name, sedan(), values)
        assert type(method) is type(make_method(name, sedan()))


def test_a_number_of_a_part_reaches_the_part():
    design = tuned_method("axle", sedan(), {"regression.memory": 3.0, "sway.frequency": 9.0})
    assert design.regression.memory == 3.0
    assert design.sway.frequency == 9.0


def test_a_design_beyond_its_limit_diverges_and_is_told_of(course):
    wild = {**middle(TUNABLES), "share_of_limit": 300.0, "V_to_W": 1e-5}
    trial = cross_replay(tuned_method("integral", sedan(), wild), course)
    assert set(trial.diverged_at) == {"slow", "quick"}
    assert shares(trial, course) == Shares(np.inf, np.inf, np.inf)


def test_processes_find_what_one_process_finds(course):
    names, said = ["linear", "stiffness_rls"], []
    alone = sweep(names, course, designs=4, seed=3, workers=1)
    spread = sweep(names, course, designs=4, seed=3, workers=2, progress=said.append)
    assert spread == alone
    assert [len(alone[name]) for name in names] == [1, 4]
    assert said == ["linear: 1 designs, 0 diverged", "stiffness_rls: 4 designs, 0 diverged"]


def candidate(online, other, diverged=()):
    shares = Shares(online, 1.0, other)
    return Candidate(values={}, shares=shares, diverged_on=diverged)


def test_the_front_is_what_nothing_beats(rng):
    cloud = [candidate(*point) for point in rng.integers(1, 30, (200, 2)).astype(float)]
    front = {c.shares for c in pareto_front(cloud)}
    for one in cloud:
        beaten = any(
            other.shares != one.shares
            and other.shares.online <= one.shares.online
            and other.shares.other <= one.shares.other
            for other in cloud
        )
        assert (one.shares in front) == (not beaten)


def test_what_diverged_is_neither_on_the_front_nor_the_best():
    wild = candidate(np.inf, np.inf, ("slow",))
    calm = candidate(20.0, 30.0)
    assert pareto_front([wild, calm]) == [calm]
    assert best_candidate([wild, calm]) is calm
    assert best_candidate([wild]) is None
    assert pareto_front([wild]) == []


def test_a_signal_is_judged_by_its_online_error():
    signals = [Candidate(values={}, shares=Shares(e, None, None), diverged_on=()) for e in (9, 4)]
    assert best_candidate(signals) is signals[1]
    assert pareto_front(signals) == []
