"""The supervisor names another tire where, and only where, that explains the car better."""

from dataclasses import replace

import numpy as np
import pytest

from identifier.axle import AxleIdentifier
from identifier.methods import make_method
from identifier.run import OnlineIdentifier
from models.friction import Friction, FrictionChange
from models.maneuvers import RandomSteer
from mpc.handover import road as road_module
from mpc.handover.judge import ChiSquare, Judge
from mpc.handover.road import Change
from mpc.handover.rules import Rules, Verdict
from mpc.handover.supervisor import Supervisor
from mpc.tires import prediction_tire
from tests.mpc.handover.conftest import DROP, Told, drive, samples_of


def supervisor_of(car, start=None, *, in_use=None, rules=None):
    identifier = OnlineIdentifier(AxleIdentifier.for_vehicle(car), car, 0.01, start)
    in_use = prediction_tire(identifier.model()) if in_use is None else in_use
    return Supervisor(identifier, in_use, rules)


def watched(supervisor, recording):
    for row in samples_of(recording):
        supervisor.observe(*row)
    return supervisor


def test_a_friction_drop_is_believed_within_the_first_bend(car, learnt, dropped):
    supervisor = watched(supervisor_of(car, learnt), dropped[1])
    first = next(d for d in supervisor.decisions if d.verdict is Verdict.FRICTION)
    assert DROP < first.t < DROP + 0.6
    assert 0.4 < first.friction < 0.7
    before = [d for d in supervisor.decisions if d.t < DROP]
    assert all(d.verdict is Verdict.LEARNT for d in before)


@pytest.mark.parametrize(("looks", "lost"), [((20,), False), ((20, 22), False), ((20, 21), True)])
def test_friction_is_lost_where_two_looks_in_a_row_say_so(
    car, learnt, dry, monkeypatch, looks, lost
):
    supervisor, seen = supervisor_of(car, learnt), []

    def looked(road, tire, *_, **__):
        seen.append(1)
        there = Change(Verdict.FRICTION, road._replace(ratio=0.5), tire, 10.0, 1.0)
        return there if len(seen) in looks else None

    monkeypatch.setattr(road_module, "look_at_road", looked)
    watched(supervisor, dry[1].between(0.0, 3.0))
    assert len(seen) > max(looks)
    assert (Verdict.FRICTION in [d.verdict for d in supervisor.decisions]) == lost


def test_from_nothing_the_learnt_tire_takes_over_and_is_better(car, dry):
    supervisor = supervisor_of(car)
    begun = supervisor.target
    watched(supervisor, dry[1])
    first = supervisor.decisions[0]
    assert first.verdict is Verdict.LEARNT
    assert 0.5 < first.t < 6.0
    judge, late = Judge(0.01), samples_of(dry[1])[-300:]
    assert judge.chi_square(supervisor.target, late).total < judge.chi_square(begun, late).total


def test_a_friction_that_comes_back_is_regained_up_to_what_was_learnt(car, learnt):
    """Begun on the low friction that was found, on a road that is dry again."""
    steer = RandomSteer(
        amplitude=0.06, frequency=0.5, seed=5, onset=0.2, rate_limit=1.0, duration=8.0
    )
    changes = (FrictionChange(scale=0.5, at_time=0.5), FrictionChange(scale=1.0, at_time=4.0))
    _, recording = drive(steer, friction=Friction(changes=changes))
    rules = Rules(learning_time=1e3)  # nothing that is learnt is handed over
    supervisor = watched(supervisor_of(car, learnt, rules=rules), recording)
    lost = [d for d in supervisor.decisions if d.verdict is Verdict.FRICTION]
    back = [d for d in supervisor.decisions if d.verdict is Verdict.RECOVERY]
    assert lost
    assert back
    assert 4.0 < back[0].t < 6.0
    assert supervisor.decisions[-1].friction > 0.7
    assert max(d.friction for d in supervisor.decisions) <= 1.0


def test_what_is_not_better_is_not_handed_over(car, learnt, dry):
    """An identifier that begins with the tire in use, on the road that it was learnt on."""
    supervisor = watched(supervisor_of(car, learnt, rules=Rules(evidence=1e3)), dry[1])
    assert supervisor.decisions == []
    assert "not better" in supervisor.last.reason


def test_what_was_not_excited_is_not_handed_over(car, learnt):
    straight = np.tile([20.0, 0.0, 0.0, 0.0], (400, 1))
    straight[:, 1] += np.random.default_rng(0).normal(0.0, 0.03, 400)
    supervisor = supervisor_of(car, learnt, in_use=prediction_tire(learnt))
    for row in straight:
        supervisor.observe(*row)
    assert supervisor.decisions == []
    assert "axle was identified for" in supervisor.last.reason


@pytest.mark.parametrize("broken", [np.full(4, np.nan), np.zeros(4)])
def test_many_lost_samples_and_standing_still_decide_nothing(car, learnt, dropped, broken):
    supervisor = supervisor_of(car, learnt)
    for k, row in enumerate(samples_of(dropped[1])):
        supervisor.observe(*(broken if k % 30 < 10 else row))
    assert supervisor.decisions == []
    assert supervisor.last.reason == "too few samples"


@pytest.mark.parametrize("broken", [np.nan, np.inf, 1e308])
def test_a_stale_identifier_is_a_fault_and_the_last_good_tire_stays(car, learnt, dropped, broken):
    supervisor = supervisor_of(car, learnt)
    first = supervisor.target
    rows = samples_of(dropped[1])
    for k, row in enumerate(rows[:400]):
        supervisor.observe(*(np.full(4, broken) if 100 <= k < 300 else row))
        if k == 140:
            assert supervisor.decisions == []  # 0.4 s: not yet
    faults = [one for one in supervisor.decisions if one.verdict is Verdict.FAULT]
    assert len(faults) == 1
    assert faults[0].t == pytest.approx(1.5)
    assert faults[0].reason == "no sample could be taken for 0.5 s"
    assert supervisor.target is first
    assert not supervisor.identifier.stale


class Given(Told):
    """A judge whose mean chi-squares are given: of the tire in use, and of any other."""

    def __init__(self, in_use, mean, *, better=0.0, worse_lately=0.0):
        self.in_use, self._mean = in_use, mean
        self._better, self._worse_lately = better, worse_lately

    def chi_squares(self, tire, weights, samples):
        total = 20.0 * self._mean
        other = total - self._better if len(samples) > 50 else total + self._worse_lately
        totals = [total if np.array_equal(w, self.in_use.weights) else other for w in weights]
        return [ChiSquare(total, 20.0, np.zeros(2)) for total in totals]


@pytest.mark.parametrize("mean", [0.3, 1.0, 3.0, 100.0])
def test_the_baseline_follows_what_is_seen_slowly_and_not_a_change(
    car, learnt, dry, monkeypatch, mean
):
    """A low-pass over `baseline_time` from 1 on, of at most four times itself, never below 1."""
    baseline = []
    monkeypatch.setattr(
        road_module, "look_at_road", lambda *_, **given: baseline.append(given["baseline"])
    )
    supervisor = supervisor_of(car, learnt, rules=Rules(learning_time=1e3))
    supervisor.judge = Given(supervisor.target, mean)
    watched(supervisor, dry[1].between(0.0, 4.0))
    n, share = np.arange(len(baseline)), 0.05 / 10.0
    assert n.size > 70
    wanted = {
        0.3: np.ones(n.size),
        1.0: np.ones(n.size),
        3.0: 3.0 - 2.0 * (1.0 - share) ** n,
        100.0: (1.0 + 3.0 * share) ** n,
    }
    np.testing.assert_allclose(baseline, wanted[mean], rtol=1e-9)


@pytest.mark.sweep(
    "40.0-2.2-False-3.0", "40.0-1.8-True-1.0", "3.6-0.0-False-1.0", "4.4-0.0-True-3.0"
)
@pytest.mark.parametrize("baseline", [1.0, 3.0])
@pytest.mark.parametrize(
    ("better", "worse_lately", "taken"),
    [(4.4, 0.0, True), (3.6, 0.0, False), (40.0, 1.8, True), (40.0, 2.2, False)],
)
def test_a_learnt_tire_is_taken_by_evidence_in_parts_of_the_baseline(
    car, learnt, dry, monkeypatch, baseline, better, worse_lately, taken
):
    """4 better over seconds, no more than 2 worse in the last moments; on a bad road thrice it."""
    supervisor = supervisor_of(car, learnt, rules=Rules(baseline_time=0.05))
    monkeypatch.setattr(road_module, "look_at_road", lambda *_, **given: None)
    supervisor.judge = Given(
        supervisor.target, baseline, better=baseline * better, worse_lately=baseline * worse_lately
    )
    watched(supervisor, dry[1].between(0.0, 6.0))
    assert [d.verdict for d in supervisor.decisions[:1]] == [Verdict.LEARNT] * taken
    reason = "not better" if better < 4.0 else "worse in the last moments"
    assert taken or reason in supervisor.last.reason


def test_another_structure_and_an_unproven_law_are_refused_at_the_start(car):
    with pytest.raises(ValueError, match="begin with a tire of the identifier"):
        supervisor_of(car, in_use=prediction_tire(car))
    design = make_method("integral", car)
    wild = replace(design, gains=replace(design.gains, eta_W=100.0 * design.gains.eta_W))
    good, unproven = (OnlineIdentifier(one, car, 0.01) for one in (design, wild))
    assert Supervisor(good, prediction_tire(good.model())).decisions == []
    with pytest.raises(ValueError, match="certificate fails"):
        Supervisor(unproven, prediction_tire(unproven.model()))


def test_a_fault_takes_back_what_was_handed_over_just_before_and_teaches_nothing(
    car, learnt, dropped
):
    """A friction that was believed a moment before the sensors disagree may be their fault."""
    supervisor, rows = supervisor_of(car, learnt), samples_of(dropped[1])
    k = 0
    while not any(d.verdict is Verdict.FRICTION for d in supervisor.decisions):
        supervisor.observe(*rows[k])
        k += 1
    before = [d for d in supervisor.decisions if d.t <= supervisor.t - supervisor.rules.revoke]
    samples, wet = supervisor.identifier.counts.samples, supervisor.target
    decision = supervisor.observe(*rows[k], fault="sensors disagree")
    assert (decision.verdict, decision.reason) == (Verdict.FAULT, "sensors disagree")
    assert supervisor.target is not wet
    if not before:
        np.testing.assert_array_equal(supervisor.target.weights, prediction_tire(learnt).weights)
    for row in rows[k + 1 : k + 60]:
        assert supervisor.observe(*row, fault="sensors disagree") is None
    assert supervisor.identifier.counts.samples == samples
    assert supervisor.t == pytest.approx(0.01 * (k + 60))
