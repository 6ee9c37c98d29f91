"""Long recordings: block by block the bits of one piece, and memory that does not grow with them.

What is long is made short here: a few hundred samples are a block.
"""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from codegen import arrays
from identifier.axle import AxleIdentifier
from identifier.methods import make_method
from identifier.prediction import predict
from identifier.reproducibility import beyond_known, reproduce
from identifier.rerun import Recalled
from identifier.run import identify, learn
from identifier.verdict import judge
from models.recordings import Recording, check_against_vehicle, evidence, portion
from models.recordings.checks import check_physics
from models.recordings.record import joined
from tests.identifier.conftest import CAR, drive

N = 1500


@pytest.fixture(scope="module")
def whole():
    """A drive, with an accelerometer and a gap in it."""
    recording = drive(n=N)
    a_y = np.gradient(recording.v_y, 0.01) + recording.v_x * recording.r
    gone = np.r_[0:700, 760:N]
    return replace(recording, a_y=a_y).taken(gone)


@pytest.fixture
def in_blocks(monkeypatch):
    monkeypatch.setattr(arrays, "LONG", 400)
    monkeypatch.setattr(arrays, "BLOCK", 128)
    monkeypatch.setattr(arrays, "IN_MEMORY", 8 * 100)


def tiled(recording, times):
    """The drive over and over: its signals jump where it begins anew, its time does not."""
    n = times * len(recording)
    signals = ("v_x", "v_y", "r", "delta_f", "delta_r")
    return Recording(
        name="long",
        t=0.01 * np.arange(n),
        axle_force=np.tile(recording.axle_force, (times, 1)),
        **{name: np.tile(getattr(recording, name), times) for name in signals},
    )


def assert_same(expected, found, at=()):
    for port, values in expected.items():
        np.testing.assert_array_equal(values, np.asarray(found[port])[at], err_msg=port)


@pytest.mark.sweep("axle", "integral")
@pytest.mark.parametrize("method", ["axle", "integral", "lagged_ekf"])
def test_a_run_in_blocks_has_the_bits_of_one_in_a_piece(whole, method, request):
    design = make_method(method, CAR)
    piece = identify(whole, CAR, design)
    request.getfixturevalue("in_blocks")
    blocks = identify(whole, CAR, design)
    assert isinstance(blocks.state, Recalled)
    assert len(blocks.state.run.parts) > 10
    np.testing.assert_array_equal(piece.axle_force, blocks.axle_force)
    assert list(piece.state) == list(blocks.state)
    assert_same(piece.state, blocks.state)
    assert_same(piece.outputs, blocks.outputs)
    for k, track in enumerate(piece.tracks_over(next(piece.blocks()))):
        parts = [blocks.tracks_over(block)[k].values for block in blocks.blocks()]
        np.testing.assert_array_equal(track.values, np.concatenate(parts))


def test_a_freeze_within_a_block_or_at_its_ends_is_that_of_one_piece(whole, request):
    design = AxleIdentifier.for_vehicle(CAR)
    piece = identify(whole, CAR, design)
    model = piece.freeze(7.0)
    request.getfixturevalue("in_blocks")
    blocks = identify(whole, CAR, design)
    for index in (0, 1, 127, 128, 129, 699, 700, 701, len(whole) - 2, len(whole) - 1):
        t = float(whole.t[index])
        assert_same(piece.state_at(t), blocks.state_at(t))
    assert blocks.freeze(7.0).to_dict() == model.to_dict()
    assert learn(whole, CAR, design, t=7.0).to_dict() == model.to_dict()
    np.testing.assert_array_equal(model.predict(whole), piece.freeze(7.0).predict(whole))


@pytest.mark.sweep("integral")
@pytest.mark.parametrize("method", ["axle", "integral"])
def test_the_parts_of_a_run_over_two_logs_are_those_of_one_in_a_piece(whole, method, request):
    logs = [whole.between(0.0, 6.5), whole.between(8.0, 11.0), whole.between(11.5, 15.0)]
    drive, design = joined(logs), make_method(method, CAR)
    run = identify(drive, CAR, design)
    pieces = run.parts(logs)
    assert len(run.state.run.parts) == 1
    assert_same(identify(logs[0], CAR, design).state, pieces[0].state)  # the first, as if alone
    frozen = [one.freeze().to_dict() for one in pieces]
    request.getfixturevalue("in_blocks")
    blocks = identify(drive, CAR, design).parts(logs)
    for one, other, log in zip(pieces, blocks, logs, strict=True):
        assert len(other.state.run.parts) > 10
        np.testing.assert_array_equal(one.axle_force, other.axle_force)
        assert_same(one.state, other.state)
        assert_same(one.outputs, other.outputs)
        for run in (one, other):  # after the last sample, not after the rest before the next log
            assert_same(run.state_at(float(log.t[-1])), one.state, -1)
    assert [one.freeze().to_dict() for one in blocks] == frozen


def test_only_blocks_that_are_asked_for_are_computed_again_or_given_of_a_run_in_memory(
    whole, request
):
    run = identify(whole, CAR, AxleIdentifier.for_vehicle(CAR))
    piece = replace(run, state=dict(run.state), outputs=dict(run.outputs))
    request.getfixturevalue("in_blocks")
    again, asked = identify(whole, CAR, AxleIdentifier.for_vehicle(CAR)), np.array([130, 1000])
    assert isinstance(again.state, Recalled) and not isinstance(piece.state, Recalled)
    for one in (again, piece):
        for block, k in zip(one.blocks(asked), asked, strict=True):
            assert block.part.start <= k < block.part.stop
            for port, values in piece.state.items():
                np.testing.assert_array_equal(block.state[port][k - block.part.start], values[k])
        assert list(one.blocks(asked[:0])) == []


def test_what_was_asked_for_of_one_block_is_computed_together_of_the_next(
    whole, in_blocks, monkeypatch
):
    """Weights, then a step's own numbers: twice over the first block, once over every other."""
    blocks = identify(whole, CAR, AxleIdentifier.for_vehicle(CAR))
    ran = []
    scan = type(blocks.state.run.setup.scan)
    call = scan.__call__
    monkeypatch.setattr(
        scan,
        "__call__",
        lambda self, *a, ports, **k: ran.append(ports) or call(self, *a, ports=ports, **k),
    )
    for block in blocks.blocks():
        assert len(block.state["W"]) == len(block.before["own"]) + 1
    assert ran[:2] == [{"W"}, {"own"}]
    assert ran[2:] == [{"W", "own"}] * (len(blocks.state.run.parts) - 1)


def test_of_a_run_of_one_block_what_was_asked_for_is_kept_and_nothing_else(whole):
    run = identify(whole, CAR, AxleIdentifier.for_vehicle(CAR))
    assert run.state["W"] is run.state["W"]
    (found,) = run.state.run._found.values()
    assert set(found.values["state"]) == {"W"} and not found.values["outputs"]
    assert set(run.outputs) == set(run.state.run.ports("outputs"))
    with pytest.raises(KeyError):
        run.state["no such port"]


def test_errors_over_blocks_are_those_over_the_whole(whole, request):
    design = AxleIdentifier.for_vehicle(CAR)
    run = identify(whole, CAR, design)
    piece, t = reproduce(run, 9.0), 9.0
    asked, known = predict(run.freeze(t), whole), beyond_known(run.freeze(t), whole)
    request.getfixturevalue("in_blocks")
    blocks, again = reproduce(run, t), predict(run.freeze(t), whole)
    sides, others = piece.reproduction, blocks.reproduction
    for one, other in (
        (piece.against_truth, blocks.against_truth),
        (sides.past_against_online, others.past_against_online),
        (sides.after_against_truth, others.after_against_truth),
    ):
        assert (other.front, other.rear) == pytest.approx((one.front, one.rear), rel=1e-12)
    assert again.motion.explained == pytest.approx(asked.motion.explained, rel=1e-12)
    assert beyond_known(run.freeze(t), whole) == known


def test_a_law_that_diverges_is_noticed_in_the_block_where_it_does(whole, in_blocks):
    run = identify(whole, CAR, AxleIdentifier.for_vehicle(CAR))
    assert run.diverged_at is None
    force = np.array(run.axle_force)
    force[903:, 1] = np.nan
    assert replace(run, axle_force=force).diverged_at == whole.t[903]


# Verdicts on long drives: by a portion.


@pytest.fixture
def short_portions(monkeypatch, in_blocks):
    monkeypatch.setattr(portion, "LONG", 4000)
    monkeypatch.setattr(portion, "_SEGMENT", 5.0)


@pytest.fixture(scope="module")
def long_drive():
    """A slalom of fifteen seconds sixteen times, slower in between."""
    return tiled(drive(n=N), 16)


def test_a_portion_is_bounded_spread_and_at_rest_where_it_is_joined(long_drive, short_portions):
    asked = portion.portion(long_drive)
    assert len(asked.recording) == asked.samples.size <= 4000
    thirds = np.histogram(asked.samples, 4, (0, len(long_drive)))[0]
    assert thirds.min() >= 900
    ends = [piece.stop - 1 for piece in asked.recording.segments]
    assert len(ends) == 8
    assert not asked.recording.v_x[ends].any()
    moving = asked.recording.v_x > 0.0
    np.testing.assert_array_equal(asked.recording.r[moving], long_drive.r[asked.samples][moving])


def test_a_portion_takes_where_the_car_is_turned_and_not_where_a_sensor_breaks(
    long_drive, short_portions
):
    straight = np.ones(len(long_drive), dtype=bool)
    straight[9000:9600] = False
    r = np.where(straight, 0.0, long_drive.r)
    r[[8500, 11000]] = 5000.0
    samples = portion.portion(replace(long_drive, r=r)).samples
    assert np.isin(np.arange(9000, 9600), samples).sum() > 400  # of a segment of 500


@pytest.mark.parametrize(("dt", "lasts"), [(0.01, 5.0), (0.02, 5.0), (0.00625, 5.0), (0.001, 1.0)])
def test_segments_of_a_portion_last_as_long_at_every_rate(long_drive, short_portions, dt, lasts):
    same = replace(long_drive, t=dt * np.arange(len(long_drive)))
    asked = portion.portion(same, 12_000)
    pieces = asked.recording.segments
    assert len(pieces) >= 4 and len(asked.recording) <= 4000
    shortest = min(piece.stop - piece.start for piece in pieces)
    assert shortest * dt == pytest.approx(lasts, rel=0.01)


def test_half_of_a_portion_lies_before_the_freeze(long_drive, short_portions):
    asked = portion.portion(long_drive, 6000)
    assert asked.place(6000) == pytest.approx(2000, abs=500)


def test_a_short_recording_is_its_own_portion(whole):
    assert portion.portion(whole).recording is whole


@pytest.mark.sweep("0.0")
@pytest.mark.parametrize("lever", [0.0, 2.0])
def test_the_verdict_on_a_long_drive_is_of_a_portion_and_finds_a_sensor_that_is_off(
    long_drive, short_portions, rng, lever
):
    v_y = long_drive.v_y - lever * long_drive.r + 0.005 * rng.standard_normal(len(long_drive))
    shown = replace(long_drive, v_y=v_y)
    verdict = judge(identify(shown, CAR, AxleIdentifier.for_vehicle(CAR)))
    assert "portion" in [one.code for one in verdict.findings]
    assert verdict.valid == (lever == 0.0), verdict.findings


# Memory.


def peak_of(recording):
    """Return the most memory that learning, judging and replaying take beside the recording."""
    tracemalloc.start()
    try:
        check_physics(recording)
        check_against_vehicle(recording, CAR)
        run = identify(recording, CAR, AxleIdentifier.for_vehicle(CAR))
        judge(run)
        reproduce(run, float(recording.t[-1]))
        beyond_known(run.freeze(), recording)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.fixture
def lengths(long_drive, short_portions, monkeypatch):
    """A long drive and one that is four times as long, after all is compiled and imported."""
    monkeypatch.setattr(arrays, "LONG", 4000)
    monkeypatch.setattr(arrays, "BLOCK", 2000)
    monkeypatch.setattr(evidence, "LONG", 4000)
    peak_of(long_drive)
    return long_drive, tiled(long_drive, 4)


@pytest.mark.heavy
def test_memory_does_not_grow_with_the_recording(lengths):
    """By less than one number a sample: what is carried into each block is kept."""
    short, long = map(peak_of, lengths)
    assert long - short < 8 * (len(lengths[1]) - len(lengths[0]))


@pytest.mark.heavy
def test_memory_that_grows_would_be_noticed(lengths, monkeypatch):
    short = peak_of(lengths[0])
    monkeypatch.setattr(arrays, "IN_MEMORY", 1e12)
    assert peak_of(lengths[1]) - short > 8 * (len(lengths[1]) - len(lengths[0]))
