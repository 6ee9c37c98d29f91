"""Files and drawings of long recordings: nothing that reaches far is lost, and no byte changes."""

import io
from dataclasses import replace

import numpy as np
import pytest

from codegen import arrays
from identifier.axle import AxleIdentifier
from models.recordings import Recording
from models.vehicle import sedan
from tireid.figures import thinned
from tireid.figures.forces import inputs_figure
from tireid.figures.thinned import cloud, drawn_of_run, drawn_samples, drawn_times
from tireid.learning import identify
from tireid.output import write_csv, write_long_csv
from tireid.report import _recording_digest

N = 500_000


@pytest.fixture
def signal(rng):
    return rng.standard_normal(N)


def test_all_samples_of_a_short_recording_are_drawn():
    t = 0.01 * np.arange(1000)
    within = np.flatnonzero((t >= 1.0) & (t <= 2.0))
    np.testing.assert_array_equal(drawn_samples(t, (1.0, 2.0)), within)


def test_no_peak_is_lost_and_few_points_are_drawn(signal, rng):
    t = 0.01 * np.arange(N)
    spikes = rng.choice(N, 20, replace=False)
    signal[spikes] = rng.choice([-1.0, 1.0], 20) * rng.uniform(8.0, 9.0, 20)
    other = np.column_stack([signal[::-1], np.zeros(N)])
    part = drawn_samples(t, (t[0], t[-1]), signal, other)
    assert len(part) < 8 * thinned.COLUMNS
    assert (np.diff(part) > 0).all()
    assert (part[0], part[-1]) == (0, N - 1)
    assert np.isin(spikes, part).all()
    assert np.isin(N - 1 - spikes, part).all()
    evenly = np.arange(0, N, N // len(part))
    assert not np.isin(spikes, evenly).all()  # as samples that are merely spread would


def test_a_window_of_a_long_recording_is_drawn_within_its_ends(signal):
    t = 0.01 * np.arange(N)
    few, many = (drawn_samples(t, (10.0, end), signal) for end in (20.0, 3010.0))
    np.testing.assert_array_equal(few, np.arange(1000, 2001))
    assert (many[0], many[-1]) == (1000, 301_000)


def test_no_line_is_drawn_over_a_gap(signal):
    t = np.delete(0.01 * np.arange(400), slice(200, 250))
    zeros = np.zeros(t.size)
    log = Recording(
        name="gap", t=t, v_x=zeros + 20.0, v_y=signal[: t.size], r=zeros, delta_f=zeros,
        delta_r=zeros, breaks=(200,),
    )  # fmt: skip
    told = drawn_times(log, t)
    assert np.flatnonzero(np.isnan(told)).tolist() == [200]
    np.testing.assert_array_equal(np.delete(told, 200), np.delete(t, 200))
    some = np.array([10, 150, 220, 300])  # of a long log: its first sample there may not be drawn
    np.testing.assert_array_equal(np.isnan(drawn_times(log, t[some])), [False, False, True, False])
    for axes in inputs_figure(log).axes:
        line = axes.lines[0].get_xydata()
        assert not np.isfinite(line).all(axis=1)[200]
        assert np.isfinite(np.delete(line, 200, axis=0)).all()
    np.testing.assert_array_equal(
        drawn_times(replace(log, t=0.01 * np.arange(350), breaks=()), t), t
    )


def test_a_cloud_shows_what_is_outermost(rng):
    slip = 0.1 * rng.standard_normal((N, 2))
    force = np.tanh(10.0 * slip) + 0.01 * rng.standard_normal((N, 2))
    moving = np.arange(N) > 1000
    part = cloud(0.01 * np.arange(N), slip, force)
    part = part[moving[part]]
    assert len(part) < N / 5
    assert part.min() > 1000
    for values in (slip, force):
        np.testing.assert_array_equal(values[part].max(axis=0), values[moving].max(axis=0))
        np.testing.assert_array_equal(values[part].min(axis=0), values[moving].min(axis=0))


@pytest.fixture(scope="module")
def drive():
    t = 0.01 * np.arange(3000)
    delta = 0.03 * np.sin(2.0 * t) * np.sin(0.3 * t)
    zeros = np.zeros(t.size)
    v_x = np.full(t.size, 20.0)
    return Recording(name="d", t=t, v_x=v_x, v_y=zeros, r=5.0 * delta, delta_f=delta, delta_r=zeros)


def test_what_a_run_recorded_is_drawn_with_its_peaks(drive, monkeypatch):
    history = identify(drive, sedan(), AxleIdentifier.for_vehicle(sedan()), check=False).history

    def tell(block):
        return [track.values for track in history.tracks_over(block)]

    _, whole = drawn_of_run(history, tell)
    for module in (arrays, thinned):
        monkeypatch.setattr(module, "LONG", 500)
    monkeypatch.setattr(arrays, "BLOCK", 170)
    monkeypatch.setattr(thinned, "COLUMNS", 30)
    t, some = drawn_of_run(history, tell)
    assert (np.diff(t) > 0.0).all()
    assert t.size < 0.5 * len(drive)
    for one, all_of_it in zip(some, whole, strict=True):
        assert (one.max(), one.min()) == (all_of_it.max(), all_of_it.min())


def test_curves_in_parts_are_the_bytes_of_one_table(tmp_path, rng):
    columns = {
        "t_s": 1.7e9 + 0.01 * np.arange(9000),
        "a": 10.0 ** rng.uniform(-12, 12, 9000),
        "b": np.where(rng.uniform(size=9000) < 0.1, np.nan, -np.inf),
    }
    whole, parts, expected = tmp_path / "whole.csv", tmp_path / "parts.csv", io.StringIO()
    write_csv(whole, columns)
    cuts = (slice(0, 4000), slice(4000, 8200), slice(8200, 9000))
    write_long_csv(parts, ({k: v[cut] for k, v in columns.items()} for cut in cuts))
    np.savetxt(
        expected,
        np.column_stack(list(columns.values())),
        fmt=["%.15g", "%.9g", "%.9g"],
        delimiter=",",
        header="t_s,a,b",
        comments="",
    )
    assert whole.read_text() == parts.read_text() == expected.getvalue()


def test_the_hash_of_a_long_recording_tells_one_bit(drive, monkeypatch):
    monkeypatch.setattr("tireid.report.LONG", 100)
    monkeypatch.setattr(arrays, "LONG", 100)
    r = np.array(drive.r)
    r[2999] = np.nextafter(r[2999], 1.0)
    assert _recording_digest(drive) == _recording_digest(replace(drive))
    assert _recording_digest(drive) != _recording_digest(replace(drive, r=r))
