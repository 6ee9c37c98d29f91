"""What is believed of the road, on chi-squares that are told by a formula of the friction."""

import math
from itertools import product

import numpy as np
import pytest

from mpc.handover.judge import ChiSquare, Window
from mpc.handover.road import Road, at_friction, look_at_road
from mpc.handover.rules import Rules, Verdict
from tests.mpc.handover.conftest import Told

COUNT = 10.0  # independent errors, whatever the samples


class Formula(Told):
    """Mean chi-square = size (least + slope (ln μ - ln μ_true)²) of a tire of friction μ."""

    def __init__(self, tire, *, true, least, slope, size=1.0, count=COUNT):
        self._grip, self._count = grip(tire.weights, tire), count
        self._true, self._least, self._slope, self._size = true, least, slope, size

    def chi_squares(self, tire, weights, samples):
        del samples
        away = [np.log(grip(w, tire) / self._grip / self._true) for w in weights]
        means = [self._size * (self._least + self._slope * a**2) for a in away]
        return [ChiSquare(self._count * mean, self._count, np.zeros(2)) for mean in means]


def grip(weights, tire):
    """Saturated force of both axles of a ladder [static axle loads]."""
    axles = weights[4:].reshape(2, -1)
    return axles[:, 0] @ axles[:, -tire.structure.units :].sum(axis=1)


def look(road, in_use, judge, *, baseline, t=10.0):
    window = Window(4.0, 0.01)
    for _ in range(400):
        window.add((20.0, 0.0, 0.0, 0.0))
    return look_at_road(
        road,
        in_use,
        window,
        t=t,
        baseline=baseline,
        trusted=0.2,
        judge=judge,
        rules=Rules(),
    )


def believed(change):
    """The verdict, or none, and the friction."""
    return (None, 0.0) if change is None else (change.verdict, change.road.ratio)


GRID = product(
    (1.0, 0.5), (1.0, math.inf), (0.3, 0.6, 0.95), (0.5, 1.2, 2.0), (0.5, 2.0, 5.0, 20.0)
)
EDGE = [(1.0, math.inf, 0.4, 0.3, slope) for slope in (1.3, 1.4, 1.5)]  # mean about 1.5
CASES = [
    dict(zip(("known", "since", "true", "least", "slope"), case, strict=True))
    for case in (*GRID, *EDGE)
]


def test_a_road_on_which_all_tires_fit_worse_is_judged_as_any_other(tire):
    """Chi-squares and their baseline thrice as large: the same estimates, to the last digit."""
    found = {}
    for case in CASES:
        told = {name: case[name] for name in ("true", "least", "slope")}
        road = Road(tire, case["known"], 10.0 - case["since"])
        in_use = at_friction(tire, case["known"])
        one, three = (
            believed(look(road, in_use, Formula(tire, **told, size=size), baseline=size))
            for size in (1.0, 3.0)
        )
        assert one[0] is three[0], case
        assert one[1] == pytest.approx(three[1], rel=1e-9), case
        found.setdefault(one[0], []).append(case)
    assert set(found) == {None, Verdict.FRICTION, Verdict.CORRECTION, Verdict.RECOVERY}
    assert min(map(len, found.values())) >= 3


def test_a_lower_friction_must_explain_well_and_not_only_better(tire):
    """As badly as before at every friction, or well at one: the usual size says what well is."""
    change = look(Road(tire), tire, Formula(tire, true=0.4, least=1.4, slope=9.0), baseline=1.0)
    assert change.verdict is Verdict.FRICTION
    # ln μ that is least: total/usual + (ln μ/0.7)², its minimum by hand
    steep = COUNT * 9.0
    assert math.log(change.road.ratio) == pytest.approx(
        steep * math.log(0.4) / (steep + 1 / 0.49), abs=0.03
    )
    assert change.tire.weights == pytest.approx(at_friction(tire, change.road.ratio).weights)
    badly = Formula(tire, true=0.4, least=1.6, slope=9.0)
    assert look(Road(tire), tire, badly, baseline=1.0) is None
    assert look(Road(tire), tire, badly, baseline=1.2).verdict is Verdict.FRICTION


@pytest.mark.parametrize("least", [0.1, 1.1])  # mean in use 0.6, below its baseline, and 1.6
def test_a_new_friction_is_corrected_by_little_evidence_and_only_for_a_while(tire, least):
    """5 is enough while it is followed, the time of the change stays; later 16 are asked for."""
    wet, road = at_friction(tire, 0.5), Road(tire, 0.5, changed_at=9.0)
    slope = 5.0 / COUNT / math.log(0.7 / 0.5) ** 2
    judge = Formula(tire, true=0.7, least=least, slope=slope)
    change = look(road, wet, judge, baseline=1.0)
    assert change.verdict is Verdict.CORRECTION
    assert (change.road.base, change.road.changed_at) == (tire, 9.0)
    assert 0.6 < change.road.ratio < 0.75
    assert look(road, wet, judge, baseline=1.0, t=9.0 + 2.1) is None
    weak = Formula(tire, true=0.7, least=least, slope=0.3 * slope)
    assert look(road, wet, weak, baseline=1.0) is None
    clear = Formula(tire, true=0.7, least=1.1, slope=4.0 * slope)
    back = look(road, wet, clear, baseline=1.0, t=9.0 + 2.1)
    assert (back.verdict, back.road.changed_at) == (Verdict.RECOVERY, 9.0 + 2.1)


@pytest.mark.parametrize("size", [1.0, 3.0])
def test_the_road_before_comes_back_where_it_explains_enough_more(tire, size):
    """16 more than the tire in use, in parts of what is usual; else it stays forgotten."""
    wet = at_friction(tire, 0.5)
    for evidence, comes_back in ((15.0, False), (17.0, True)):
        slope = evidence / COUNT / math.log(0.5) ** 2
        judge = Formula(tire, true=1.0, least=1.0, slope=slope, size=size)
        change = look(Road(wet, before=tire), wet, judge, baseline=size)
        assert (change is not None) == comes_back
        assert look(Road(wet), wet, judge, baseline=size) is None  # there was no road before
    assert change.verdict is Verdict.RECOVERY
    assert change.tire is tire
    assert change.road == Road(tire, changed_at=10.0)
    assert change.before - change.after == pytest.approx(17.0 * size)


def test_the_road_before_does_not_come_back_where_chi_square_is_at_its_baseline(tire):
    wet = at_friction(tire, 0.5)
    judge = Formula(tire, true=1.0, least=0.1, slope=10.0, count=40.0)  # mean in use 4.9
    assert look(Road(wet, before=tire), wet, judge, baseline=2.0).verdict is Verdict.RECOVERY
    assert look(Road(wet, before=tire), wet, judge, baseline=5.0) is None


def test_the_first_base_is_remembered_and_only_where_friction_was_lost(tire):
    first, second, third = (tire._replace(weights=share * tire.weights) for share in (1, 0.9, 0.8))
    assert Road(first).on(second) == Road(second)  # nothing was lost
    lost = Road(first, ratio=0.5, changed_at=3.0).on(second)
    assert lost == Road(second, before=first, changed_at=3.0)
    assert lost._replace(ratio=0.7).on(third).before is first  # lost twice: the first road


def test_a_drop_is_sought_down_to_ice_and_in_the_last_moments_alone(tire):
    lengths = []

    class Watching(Formula):
        def chi_square(self, tire, samples):
            lengths.append(len(samples))
            return super().chi_square(tire, samples)

    change = look(Road(tire), tire, Watching(tire, true=0.16, least=1.0, slope=90.0), baseline=1.0)
    assert change.verdict is Verdict.FRICTION
    assert 0.15 <= change.road.ratio < 0.18
    assert lengths[0] == pytest.approx(Rules().last_moments / 0.01, abs=1)


@pytest.mark.parametrize("true", [0.237, 0.411, 0.683])
def test_a_friction_is_found_finer_than_the_grid_of_the_first_look(tire, true):
    judge = Formula(tire, true=true, least=1.0, slope=900.0)
    change = look(Road(tire), tire, judge, baseline=1.0)
    assert change.road.ratio == pytest.approx(true, rel=0.02)
