"""The recording itself: shape rules, slices, slip angles, and what is written reads back."""

import gzip
import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from models.recordings import (
    LogMap,
    RecordingError,
    read_recording,
    write_recording,
)
from tests.made import made as recorded

N = 100
SIGNALS = ("v_x", "v_y", "r", "delta_f", "delta_r")


def recording(**change):
    t = 0.01 * np.arange(N)
    wave = np.sin(t)
    return recorded(t, **{"v_y": 0.1 * wave, "r": 0.2 * wave, "delta_f": 0.03 * wave, **change})


def noise(seed, t, *names, **more):
    """A recording of numbers at random, of more signals than all have by name."""
    rng = np.random.default_rng(seed)
    return recorded(t, **{name: rng.normal(size=t.size) for name in (*SIGNALS, *names)}, **more)


def test_signals_cannot_be_changed_and_do_not_follow_their_source():
    source = np.full(N, 20.0)
    made = recording(v_x=source)
    source[:] = 0.0
    assert np.all(made.v_x == 20.0)
    for array in (made.v_x, made.x, made.u):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0


def test_x_and_u_stack_the_papers_vectors():
    made = recording(delta_r=np.full(N, 0.01))
    assert np.array_equal(made.x, np.stack([made.v_y, made.r], axis=1))
    assert np.array_equal(made.u, np.stack([made.delta_f, made.delta_r], axis=1))
    assert made.dt == 0.01
    assert made.duration == pytest.approx(0.99)
    assert len(made) == N


@pytest.mark.parametrize(
    ("change", "rule"),
    [
        ({"r": np.zeros(N - 1)}, "r must have shape"),
        ({"axle_force": np.zeros(N)}, "axle_force must have shape"),
        ({"a_y": np.full(N, np.nan)}, "a_y must be finite, 100"),
        ({"t": 0.01 * np.arange(N)[::-1]}, "t must rise"),
        ({"t": 0.01 * np.arange(N) ** 1.01}, "t must rise in equal steps"),
        ({"t": np.zeros(5)}, "at least 10 samples"),
        *(({k: None}, f"{k} is needed, it is None$") for k in ("v_x", "r", "delta_f", "delta_r")),
    ],
)
def test_a_broken_recording_cannot_be_born(change, rule):
    with pytest.raises(RecordingError, match=f"^made: .*{rule}"):
        recording(**change)


def test_a_slice_keeps_both_ends_and_its_clock():
    part = recording(axle_force=np.ones((N, 2))).between(0.2, 0.5)
    assert part.t[0] == pytest.approx(0.2)
    assert part.t[-1] == pytest.approx(0.5)
    assert len(part) == 31
    assert part.axle_force is not None
    assert part.axle_force.shape == (31, 2)
    assert part.a_y is None
    with pytest.raises(RecordingError, match=r"runs from 0 to 0\.99"):
        recording().between(5.0, 6.0)


def in_three():
    """Samples 0 to 39, 40 to 69 and 70 to 99, each a second after those before."""
    t = 0.01 * np.arange(N)
    t[40:] += 1.0
    t[70:] += 1.0
    return recording(t=t, breaks=(40, 70))


LEFT_OUT = "left out: 1 segment of under 10 samples"


def test_all_or_an_open_part_of_a_drive_in_segments_may_be_taken():
    made = in_three()
    assert made.taken(slice(None)).breaks == (40, 70)
    assert made.taken(slice(20, None)).breaks == (20, 50)
    assert made.taken(slice(None, 60)).breaks == (40,)
    assert made.taken(slice(-30, None)).breaks == ()
    np.testing.assert_array_equal(made.taken(slice(None, 60)).t, made.t[:60])


@pytest.mark.parametrize(
    ("kept", "expected", "breaks"),
    [
        (slice(35, 100), slice(40, 100), (30,)), (slice(0, 75), slice(0, 70), (40,)),
        (slice(61, 79), None, ()), (np.r_[0:20, 25:30, 30:60], np.r_[0:20, 25:60], (20, 35)),
        (np.r_[0:5, 10:40, 70:100], np.r_[10:40, 70:100], (30,)), (np.r_[0:9, 50:59], None, ()),
    ],
)  # fmt: skip
def test_scraps_of_segments_are_left_out_and_told(kept, expected, breaks):
    made = in_three()
    if expected is None:
        with pytest.raises(RecordingError, match="at least 10 samples"):
            made.taken(kept)
        return
    part = made.taken(kept)
    np.testing.assert_array_equal(part.t, made.t[expected])
    assert part.breaks == breaks
    scraps = part.t.size < made.t[kept].size
    assert part.notes == ((LEFT_OUT,) if scraps else ())


def test_an_axle_that_rolls_without_slip_has_no_slip_angle():
    """On a circle of radius R about a point in line with the rear axle both slips vanish."""
    l_f, l_r, R, v = 1.2, 1.5, 30.0, 5.0
    ones = np.ones(N)
    made = recording(
        v_x=v * ones,
        v_y=l_r * v / R * ones,
        r=v / R * ones,
        delta_f=np.arctan((l_f + l_r) / R) * ones,
    )
    assert np.abs(made.alpha(l_f, l_r)).max() < 1e-15
    more = recording(v_x=made.v_x, v_y=made.v_y, r=made.r, delta_f=made.delta_f + 0.01)
    assert np.allclose(more.alpha(l_f, l_r), [0.01, 0.0])  # the paper's sign: rises with delta


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    dt=st.sampled_from([0.001, 0.005, 0.01, 0.02, 0.1]),
    start=st.floats(-1e3, 1e6),
    full=st.booleans(),
    ending=st.sampled_from([".csv", ".csv.gz"]),
)
def test_what_is_written_reads_back_bit_for_bit(tmp_path_factory, seed, dt, start, full, ending):
    more = ("a_y", "a_x") if full else ()
    force = np.random.default_rng(seed + 1).normal(size=(N, 2)) if full else None
    made = noise(seed, start + dt * np.arange(N), *more, axle_force=force)
    path = write_recording(made, tmp_path_factory.mktemp("back") / f"back{ending}")
    again = read_recording(path, dt=dt, check=False)
    assert again.name == "back"
    for name in ("t", *SIGNALS, "a_y", "a_x", "axle_force"):
        assert np.array_equal(getattr(again, name), getattr(made, name))
    assert (again.a_x is None) is (again.a_y is None) is (not full)


def test_writing_leaves_one_file_and_refuses_other_endings(tmp_path):
    path = write_recording(recording(), tmp_path / "a.csv.gz")
    first = path.read_bytes()
    write_recording(recording(), path)
    assert path.read_bytes() == first
    assert [p.name for p in tmp_path.iterdir()] == ["a.csv.gz"]
    with pytest.raises(RecordingError, match=r"must end in \.csv"):
        write_recording(recording(), tmp_path / "a.mat")


@pytest.mark.parametrize("gap", [0.105, 0.05])
def test_segments_are_read_back_where_gaps_are_long_or_the_map_says_so(tmp_path, gap):
    t = 0.01 * np.arange(300)
    t[150:] += gap
    made = noise(2, t, breaks=(150,))
    path = write_recording(made, tmp_path / "gap.csv")
    again = read_recording(path, check=False, log_map=LogMap(longest_gap=0.02))
    for name in ("t", *SIGNALS):
        assert np.array_equal(getattr(again, name), getattr(made, name))
    assert again.breaks == made.breaks
    bridged = read_recording(path, check=False)
    assert bridged.breaks == (made.breaks if gap > 0.1 else ())


@pytest.mark.sweep(".csv")
@pytest.mark.parametrize("ending", [".csv", ".csv.gz"])
def test_a_long_recording_is_written_by_blocks_with_the_bytes_of_one_piece(
    tmp_path, monkeypatch, ending
):
    made = noise(3, 0.01 * np.arange(20_000))
    piece = write_recording(made, tmp_path / f"piece{ending}").read_bytes()
    monkeypatch.setattr("codegen.arrays.LONG", 1000)
    monkeypatch.setattr("codegen.arrays.BLOCK", 500)
    tracemalloc.start()
    path = write_recording(made, tmp_path / f"blocks{ending}")
    held = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert path.read_bytes() == piece
    assert held < 0.5 * len(gzip.decompress(piece) if ending.endswith("gz") else piece)
