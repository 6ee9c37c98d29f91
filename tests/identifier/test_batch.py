"""Many methods at once find what each finds alone, bit for bit."""

from dataclasses import replace

import numpy as np
import pytest

import codegen.batch
from identifier.compare.batch import cross_replay_batch, identify_batch, replay_batch
from identifier.compare.course import Course, cross_replay, shares
from identifier.method import CannotFreezeError
from identifier.methods import METHODS, make_method
from identifier.paper.design import PaperIdentifier
from identifier.paper.network import NetworkModel
from identifier.reproducibility import axle_rms, counted_samples
from identifier.run import DivergedError, identify
from tests.identifier.conftest import felt

FREEZE = (4.0, 12.345)
QUICK = [name for name in METHODS if name != "concurrent"]  # which takes long to compile


def gain_sets(car, count):
    """Designs of one structure that differ in gains and seed."""
    base = PaperIdentifier.for_vehicle(car)
    return [
        replace(base, seed=k, gains=replace(base.gains, eta_W=base.gains.eta_W * (0.5 + 0.1 * k)))
        for k in range(count)
    ]


def require_the_same(run, history):
    """Bits of every carried value that was kept; the error to rounding, its sum has an order."""
    assert run.diverged_at == history.diverged_at
    for t, state in run.state.items():
        expected = history.state_at(min(t, history.recording.t[-1]))
        assert set(state) == set(expected)
        for port, value in expected.items():
            np.testing.assert_array_equal(state[port], value, err_msg=f"{port} at {t}")
    truth = history.recording.axle_force
    counts = counted_samples(history.recording, history.design.min_speed)
    error = axle_rms(history.axle_force - truth, counts)
    np.testing.assert_allclose(
        [run.online.front, run.online.rear], [error.front, error.rear], rtol=1e-12
    )


def test_many_gain_sets_have_the_bits_of_each_alone(car, drive):
    recording, designs = drive(), gain_sets(car, 19)
    runs = identify_batch(recording, car, designs, freeze_times=FREEZE)
    for design, run in zip(designs, runs, strict=True):
        assert run.design is design
        assert set(run.state) == {*FREEZE, np.inf}
        require_the_same(run, identify(recording, car, design))


def test_another_gain_set_is_noticed(car, drive):
    recording, (one, other) = drive(n=200), gain_sets(car, 2)
    (run,) = identify_batch(recording, car, [one])
    with pytest.raises(AssertionError):
        require_the_same(run, identify(recording, car, other))


def test_every_method_has_the_bits_of_its_run_alone(car, drive):
    recording = felt(drive(n=400))
    designs = [make_method(name, car, seed) for seed in (1, 2) for name in QUICK]
    runs = identify_batch(recording, car, designs, freeze_times=(2.0,))
    for design, run in zip(designs, runs, strict=True):
        require_the_same(run, identify(recording, car, design))


def test_each_method_may_have_its_own_car(car, drive):
    recording = drive(n=400)
    cars = [replace(car, mass=car.mass * (1.0 + 0.05 * k)) for k in range(9)]
    designs = [PaperIdentifier.for_vehicle(one) for one in cars]
    runs = identify_batch(recording, cars, designs)
    for one, design, run in zip(cars, designs, runs, strict=True):
        assert run.vehicle is one
        require_the_same(run, identify(recording, one, design))
    with pytest.raises(ValueError, match="9 designs need as many vehicles, there are 8"):
        identify_batch(recording, cars[:8], designs)


def test_without_a_compiler_the_numbers_are_the_same(car, drive, monkeypatch):
    recording, designs = drive(n=300), gain_sets(car, 3)
    monkeypatch.setattr(codegen.batch.BatchScan, "_loop", None)
    for design, run in zip(designs, identify_batch(recording, car, designs), strict=True):
        require_the_same(run, identify(recording, car, design))


def test_a_design_that_diverges_is_told_of_and_disturbs_no_neighbor(car, drive):
    recording, designs = drive(), gain_sets(car, 8)
    gains = designs[3].gains
    designs[3] = replace(designs[3], gains=replace(gains, eta_W=1000.0 * gains.eta_W))
    runs = identify_batch(recording, car, designs, freeze_times=(0.0, 14.0))
    alone = identify(recording, car, designs[3])
    assert [run.diverged_at is not None for run in runs] == [k == 3 for k in range(8)]
    assert runs[3].diverged_at == alone.diverged_at
    assert not np.isfinite(runs[3].online.both) or runs[3].online.both > car.weight
    assert isinstance(runs[3].freeze(0.0), NetworkModel)
    for t in (14.0, np.inf):
        with pytest.raises(DivergedError, match="the law diverged at"):
            runs[3].freeze(t)
    for k in (2, 4):
        require_the_same(runs[k], identify(recording, car, designs[k]))


def at_rest_for_a_while(recording):
    v_x = recording.v_x.copy()
    v_x[100:180] = 0.3
    return replace(recording, v_x=v_x)


def test_samples_at_rest_do_not_count(car, drive):
    recording = at_rest_for_a_while(drive(n=400))
    design = PaperIdentifier.for_vehicle(car)
    (run,) = identify_batch(recording, car, [design])
    history = identify(recording, car, design)
    require_the_same(run, history)
    error = axle_rms(history.axle_force - recording.axle_force)
    assert abs(error.front / run.online.front - 1.0) > 0.01
    (everywhere,) = identify_batch(recording, car, [design], min_speed=0.0)
    assert everywhere.online.front == pytest.approx(error.front, rel=1e-12)


def test_a_recording_without_truth_has_no_error(car, drive):
    recording = replace(drive(n=100), axle_force=None)
    (run,) = identify_batch(recording, car, [PaperIdentifier.for_vehicle(car)])
    assert run.online is None
    with pytest.raises(ValueError, match="has no true forces"):
        replay_batch(recording, [run.freeze()], counts=np.ones(100, dtype=bool))


def test_what_was_not_kept_cannot_be_frozen(car, drive):
    recording, design = drive(n=300), PaperIdentifier.for_vehicle(car)
    (run,) = identify_batch(recording, car, [design], freeze_times=(1.0,))
    with pytest.raises(ValueError, match=r"weights were kept at \[1.0, inf\] s, not at 2 s"):
        run.freeze(2.0)
    with pytest.raises(ValueError, match="the recording begins at 0 s"):
        identify_batch(recording, car, [design], freeze_times=(-1.0,))
    with pytest.raises(ValueError, match=r"sampled at 0\.01 s, the design at 0\.02 s"):
        identify_batch(recording, car, [replace(design, dt=0.02)])


def test_models_of_every_kind_replay_as_they_do_alone(car, drive):
    learnt, other = felt(drive(n=400)), at_rest_for_a_while(drive(n=400, amplitude=0.04))
    models = []
    methods = [make_method(name, car, seed) for seed in (1, 2) for name in QUICK]
    for run in identify_batch(learnt, car, methods):
        try:
            models.append(run.freeze())
        except CannotFreezeError:
            continue
    course = Course(vehicle=car, recordings=(other,), min_speed=1.0)
    found = replay_batch(other, models, counts=counted_samples(other, 1.0))
    for model, error in zip(models, found, strict=True):
        expected = course.error(other, model.axle_force(other))
        assert error.front == pytest.approx(expected.front, rel=1e-12)
        assert error.rear == pytest.approx(expected.rear, rel=1e-12)
    assert len({round(error.front, 6) for error in found}) > 10


@pytest.mark.parametrize("names", [("linear", "integral", "rls"), QUICK], ids=["three", "all"])
def test_many_methods_are_judged_as_each_alone(names, car, drive):
    slow, quick = felt(drive(n=400)), replace(felt(drive(n=400, amplitude=0.09)), name="quick")
    course = Course(vehicle=car, recordings=(slow, quick), min_speed=1.0)
    wild = replace(
        PaperIdentifier.for_vehicle(car),
        gains=replace(PaperIdentifier.for_vehicle(car).gains, eta_W=1e6),
    )
    methods = [*(make_method(name, car, seed) for name in names for seed in (1, 2)), wild]
    for method, trial in zip(methods, cross_replay_batch(methods, course), strict=True):
        alone = cross_replay(method, course)
        assert trial.diverged_at == alone.diverged_at
        assert (trial.frozen is None) == (alone.frozen is None)
        for share, expected in zip(shares(trial, course), shares(alone, course), strict=True):
            assert share is expected is None or share == pytest.approx(expected, rel=1e-12)
        assert set(trial.frozen or {}) == set(alone.frozen or {})
    assert set(cross_replay(wild, course).diverged_at) == {"drive", "quick"}
