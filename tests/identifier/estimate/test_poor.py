"""A v_y that is rare, late or noisy teaches as a good one, and a good one stays as it is."""

from dataclasses import replace

import numpy as np
import pytest

import tireid as ti
from identifier.estimate.fit import fit
from identifier.estimate.poor import _Kinematics, _new_values, _Sensor, on_time
from models.recordings.record import joined
from tests.identifier.conftest import missed

from .conftest import driven

CAR = ti.sedan()
LATE = 0.15  # s


def received(log, between=10, late=LATE, how="held", lost=(300, 420)):
    """A receiver: a value every few samples, late, none for a while; between them held or lines."""
    at = np.arange(0, len(log), between)
    at = at[(at < lost[0]) | (at >= lost[1])]
    values = np.interp(log.t[at] - late, log.t, log.v_y)
    if how == "lines":
        return replace(log, v_y=np.interp(log.t, log.t[at], values))
    last = np.searchsorted(at, np.arange(len(log)), side="right") - 1
    if how == "held":
        return replace(log, v_y=values[last])
    slope = np.diff(values, prepend=values[0]) / np.diff(at, prepend=-between)
    ahead = np.minimum(np.arange(len(log)) - at[last], between)
    return replace(log, v_y=values[last] + slope[last] * ahead)


@pytest.fixture(scope="module")
def log():
    return driven(3)


def off(found, log):
    return float(np.std((found.v_y - log.v_y)[100:]))


def test_of_a_good_signal_all_are_new(log):
    assert len(_new_values(log.v_y)) == len(log)
    assert len(_new_values(np.where(log.t < 2.0, 0.0, log.v_y))) == len(log)
    assert len(_new_values(np.zeros(100))) == 100
    t = np.arange(0.0, 60.0, 0.01)
    slow = np.sin(0.3 * t) * np.sin(2.0 * t) * (np.sin(0.2 * t) > 0.0)
    for digits in (4, 3, 2):
        assert len(_new_values(np.round(slow, digits))) == len(t), "rounded, it rests"


@pytest.mark.parametrize("how", ["held", "ahead", "lines"])
def test_rare_and_late_values_are_found_and_brought_on_time(log, how):
    shown = received(log, how=how)
    at = np.arange(0, len(log), 10)
    at = at[(at < 300) | (at >= 420)]
    new = _new_values(shown.v_y)
    assert np.isin(new, at if how != "ahead" else np.append(at, 300)).all()
    assert len(new) > 0.9 * len(at)
    found = on_time(shown, CAR)
    assert off(found, log) < 0.04 < 0.1 < off(shown, log)
    assert "every 100 ms" in found.notes[-1] and "ay" in found.notes[-1]


@pytest.mark.parametrize("late", [0.063, 0.137])
def test_the_delay_of_rare_values_is_found_to_milliseconds(log, late):
    note = on_time(received(log, late=late), CAR).notes[-1]
    found = float(note.split("ms, ")[1].split(" ms late")[0])
    assert found == pytest.approx(1e3 * late, abs=4.0)


def test_a_good_v_y_stays_as_it_is(log):
    for one in (log, replace(log, a_y=None), replace(log, v_y=None)):
        assert on_time(one, CAR) is one
    with_a_lateness = replace(log, v_y=np.interp(log.t - 0.1, log.t, log.v_y))
    assert on_time(with_a_lateness, CAR) is with_a_lateness  # it is the doctor's


def test_noise_of_a_sensor_that_is_fast_enough_is_smoothed_with_all_of_its_samples(log):
    noisy = replace(log, v_y=log.v_y + 0.15 * np.random.default_rng(4).standard_normal(len(log)))
    held = replace(noisy, v_y=noisy.v_y[np.arange(len(log)) // 2 * 2])
    for one in (noisy, held):
        found = on_time(one, CAR)
        assert off(found, log) < 0.5 * off(one, log)
        assert "every 10 ms" in found.notes[-1]


def test_a_single_wrong_value_does_not_move_it(log):
    shown = received(log)
    v_y = shown.v_y.copy()
    v_y[1000:1010] += 3.0
    found = on_time(replace(shown, v_y=v_y), CAR)
    assert off(found, log) < 0.06


def test_a_drive_of_two_pieces_is_two_problems(log):
    pieces = [log.between(0.0, 9.0), driven(5).between(3.0, 12.0)]
    exact = joined(pieces)
    shown = [received(one) for one in pieces]
    found = on_time(joined(shown), CAR)
    assert np.std(found.v_y - exact.v_y) < 0.05
    parts = ti.identify(joined(shown), CAR, check=False).history.parts(shown)
    np.testing.assert_array_equal(np.concatenate([one.recording.v_y for one in parts]), found.v_y)


def test_a_user_learns_from_a_receiver_nearly_as_well(log, caplog):
    other = driven(8)
    best = missed(ti.identify(log, CAR, check=False).freeze(), other).max()
    poor = received(log)
    run = ti.identify(poor, CAR, check=False)
    assert missed(run.freeze(), other).max() < 1.3 * best + 0.005
    assert run.verdict.valid and "every 100 ms" in caplog.text
    assert missed(fit([poor], CAR).model, other).max() > 3.0 * best  # as it is
    prediction = ti.replay(received(other), run.freeze())
    assert prediction.verdict.valid


def test_what_noise_and_delay_leave_of_v_y_is_known_and_refused_where_it_is_too_much(log):
    rng = np.random.default_rng(2)
    for sd, code, valid in ((0.1, False, True), (1.5, True, False)):
        noisy = received(replace(log, v_y=log.v_y + sd * rng.standard_normal(len(log))))
        run = ti.identify(noisy, CAR, check=False)
        assert 0.4 < off(run.recording, log) / run.recording.v_y_sd < 2.5
        codes = [one.code for one in run.verdict.findings]
        assert ("v_y_unsure" in codes, run.verdict.valid) == (code, valid)
    assert ti.identify(log, CAR, check=False).recording.v_y_sd == 0.0


@pytest.mark.parametrize("late", [0.0, 0.013])
def test_the_motion_between_values_is_that_of_dense_least_squares(log, late):
    """Of two segments: v_y, what it misses of values, and the likelihood up to a constant."""
    short = joined([log.between(3.0, 3.4), log.between(6.0, 6.3)])
    n, dt, new = len(short), short.dt, np.append(np.arange(0, len(short) - 1, 3), len(short) - 1)
    s = _Sensor(0.03, late=late, noise=0.02, push=0.01, wanders=0.005)
    v, residual, cost, _ = _Kinematics(short, new).solved(s, 1.0)
    (edge,) = short.breaks
    goes = [k for k in range(n - 1) if k + 1 != edge]
    felt, turned = short.a_y, short.a_y - short.v_x * short.r
    rows, right, kept = [], [], []  # unknowns: v (n), b (n), ρ

    def add(size, value, **at):
        row = np.zeros(2 * n + 1)
        for name, (place, factor) in at.items():
            row[place + (n if name.startswith("b") else 0)] += factor
        rows.append(row / size)
        right.append(value / size)

    for k in goes:
        half = 0.5 * dt
        add(np.sqrt(s.push * dt), half * (turned[k] + turned[k + 1]),
            v0=(k, -1.0), v1=(k + 1, 1.0), b0=(k, half), b1=(k + 1, half),
            roll=(2 * n, half * (felt[k] + felt[k + 1])))  # fmt: skip
        add(np.sqrt(s.wanders * dt), 0.0, b0=(k, -1.0), b1=(k + 1, 1.0))
    for k in (0, edge):
        add(100.0, 0.0, v0=(k, 1.0))
        add(0.15, 0.0, b0=(k, 1.0))
    add(0.04, 0.05, roll=(2 * n, 1.0))
    for j, k in enumerate(new):
        at = k - s.late / dt
        i, first = min(int(np.floor(at)), n - 2), 0 if k < edge else edge
        if k * dt >= s.late and i >= first:
            kept.append(j)
            share = at - i
            add(s.noise, short.v_y[k], v0=(i, 1.0 - share), v1=(i + 1, share))
    A, b = np.array(rows), np.array(right)
    x = np.linalg.lstsq(A, b, rcond=None)[0]
    np.testing.assert_allclose(v, x[:n], atol=1e-6)
    residuals = np.zeros(len(new))
    residuals[kept] = s.noise * (A @ x - b)[-len(kept) :]
    np.testing.assert_allclose(residual, residuals, atol=1e-6)
    squares = np.sum((A @ x - b) ** 2) - np.sum((x[[0, edge]] / 100.0) ** 2)
    logs = np.linalg.slogdet(A.T @ A)[1] + len(kept) * np.log(s.noise**2)
    logs += len(goes) * np.log(s.push * s.wanders)
    assert cost == pytest.approx(0.5 * (squares + logs), rel=1e-6)
