"""A drive in segments: nothing is differenced from one to the next, and the weights stay."""

from dataclasses import replace

import numpy as np
import pytest

import tireid as ti
from identifier.axle.gate import GateState
from identifier.evidence import brisk_windows, motion_error
from identifier.methods import METHODS, make_method
from identifier.refused import GATE
from identifier.run import identify
from models.recordings import Recording, RecordingError, joined
from models.recordings.evidence import windows

CAR = ti.sedan()


@pytest.fixture(scope="module")
def log() -> Recording:
    return ti.sample_recording(CAR)


@pytest.fixture(scope="module")
def cut(log: Recording) -> Recording:
    """The same drive without two seconds in the middle of a corner."""
    n = len(log)
    return log.taken(np.r_[0 : n // 2, n // 2 + 200 : n])


def test_a_recording_counts_its_segments_and_not_the_gaps(log, cut) -> None:
    n = len(log)
    assert cut.breaks == (n // 2,) and len(cut) == n - 200 and cut.dt == log.dt
    assert cut.duration == pytest.approx(log.duration - 2.0 - log.dt)
    assert [piece.stop for piece in cut.segments] == [n // 2, n - 200]
    assert "in 2 segments" in repr(cut) and "segments" not in repr(log)
    again = cut.between(float(cut.t[100]), float(cut.t[-100]))
    assert again.breaks == (n // 2 - 100,)
    assert cut.between(0.0, 5.0).breaks == ()


@pytest.mark.parametrize(
    ("change", "rule"),
    [
        ({"breaks": (5,)}, "each segment of a recording needs at least 10 samples, it has 5"),
        ({"breaks": ()}, "t must rise in equal steps"),
        ({"breaks": (400,)}, "t must rise in equal steps"),
    ],
)
def test_segments_that_are_none_are_refused(cut, change, rule) -> None:
    with pytest.raises(RecordingError, match=rule):
        replace(cut, **change)


def test_time_must_rise_from_segment_to_segment(log) -> None:
    t = np.concatenate([log.t[:500], log.t[: len(log) - 500]])
    with pytest.raises(RecordingError, match="from one segment to the next"):
        replace(log, t=t, breaks=(500,))


def test_logs_are_joined_in_their_order_and_overlapping_clocks_are_moved(log) -> None:
    first, second = log.between(0.0, 5.0), log.between(3.0, 9.0)
    both = joined([first, replace(second, name="b")])
    assert both.breaks == (len(first),) and len(both) == len(first) + len(second)
    assert both.name == f"{log.name} + b"
    assert both.t[len(first)] == pytest.approx(float(first.t[-1]) + 1.0)
    assert "moved by" in both.notes[-1]
    later = joined([first, log.between(7.0, 9.0)])
    assert later.t[len(first)] == log.between(7.0, 9.0).t[0] and not later.notes
    with pytest.raises(RecordingError, match="one sampling interval"):
        joined([first, replace(second, t=2.0 * second.t)])


def glued(cut: Recording) -> Recording:
    """The same samples, as if there were no gap: what must not happen."""
    return replace(cut, t=cut.dt * np.arange(len(cut)), breaks=())


@pytest.mark.sweep("axle", "inertial", "instantaneous", "linear*")
@pytest.mark.parametrize("name", sorted({*METHODS} - {"fit"}))  # which learns from both segments
def test_what_is_learnt_stays_over_a_gap_and_the_rest_begins_anew(name, log, cut) -> None:
    method = make_method(name, CAR)
    whole, run = identify(log, CAR, method), identify(cut, CAR, method)
    k = cut.breaks[0]
    assert np.array_equal(run.axle_force[:k], whole.axle_force[:k])
    assert run.axle_force.shape == (len(cut), 2)
    for port in method.ports:
        if port.learnt and port.name in run.state:
            states = run.state[port.name]
            assert states.shape[0] == len(cut) + 1
            assert np.array_equal(states[k], whole.state[port.name][k]), port.name
    # the first force after the gap is that of a run that begins there with what was learnt
    assert np.isfinite(run.axle_force).all()
    lost = identify(glued(cut), CAR, method)
    if run.state:  # else it has no memory
        assert not np.array_equal(lost.axle_force[k + 1 :], run.axle_force[k + 1 :])


@pytest.mark.sweep("axle", "inertial", "instantaneous")
@pytest.mark.parametrize("name", sorted(METHODS))
def test_a_gate_is_off_at_each_break(name, log, cut) -> None:
    whole, run = (identify(one, CAR, make_method(name, CAR)) for one in (log, cut))
    if GATE in run.state:
        on, k = GateState._fields.index("on"), cut.breaks[0]
        assert run.state[GATE][k, on] == 0.0 and run.state[GATE][k - 1, on] == 1.0
        assert whole.state[GATE][k, on] == 1.0


@pytest.mark.parametrize("name", ["axle", "inertial"])
def test_a_step_that_judges_samples_must_tell_how_it_rests(name) -> None:
    setup = make_method(name, CAR).setup(CAR)
    assert setup.rest > 1
    with pytest.raises(ValueError, match="ends_run"):
        _ = setup._replace(ends_run=None).rest


def test_after_a_gap_a_frozen_model_starts_as_at_the_beginning(log, cut) -> None:
    tire = ti.identify(log, CAR).freeze().held_on(cut)
    second = cut.taken(cut.segments[1])
    alone, together = tire.predict(second), tire.predict(cut)
    assert np.array_equal(together[cut.breaks[0] :], alone)


def test_no_window_reaches_over_a_gap(cut) -> None:
    k, dt = cut.breaks[0], cut.dt
    found = brisk_windows(cut, 1.0)
    over = (found.starts < k) & (found.starts + found.n >= k)
    assert not over.any() and len(found) > 20
    assert len(brisk_windows(glued(cut), 1.0)) > len(found)
    assert windows(cut).r.size < windows(glued(cut)).r.size
    exact = replace(cut, v_y=np.where(np.arange(len(cut)) < k, 0.0, 5.0), r=np.zeros(len(cut)))
    counted = np.ones(len(cut), dtype=bool)
    rest = motion_error(np.zeros((len(cut), 2)), exact, CAR, counted)
    assert rest is not None and rest.lateral == 0.0
    jump = motion_error(np.zeros((len(cut), 2)), glued(exact), CAR, counted)
    assert jump is not None and jump.lateral > 5.0 * dt
