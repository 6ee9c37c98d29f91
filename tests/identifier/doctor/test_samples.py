"""What is wrong with samples is found where it was planted, with its size, and nowhere else."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from identifier.doctor.samples import CERTAIN, _is_late, sample_findings
from models.recordings.evidence import computed_v_y
from models.recordings.samples import Runs, resolution
from tests.identifier.conftest import codes_of
from tests.made import made

DT = 0.01
T = np.arange(3000) * DT
NOISE = {"v_x": 0.03, "v_y": 0.02, "r": 0.004, "delta_f": 0.001, "a_y": 0.1}


def swing(rng, width=0.8):
    """A smooth motion of several periods."""
    waves = [(0.23, 1.0), (0.41, 0.8), (0.67, 0.5)]
    return width * sum(a * np.sin(2.0 * math.pi * f * T + rng.uniform(0.0, 6.0)) for f, a in waves)


@pytest.fixture(scope="module")
def smooth():
    rng = np.random.default_rng(5)
    r, v_x = swing(rng, 0.2), 20.0 + swing(rng, 1.0)
    v_y, delta_f = swing(rng, 0.4), swing(rng, 0.03)
    return made(T, v_x=v_x, v_y=v_y, r=r, delta_f=delta_f, a_y=v_x * r + swing(rng, 0.3))


@pytest.fixture(scope="module")
def noisy(smooth):
    rng = np.random.default_rng(6)
    return made(
        T, **{n: getattr(smooth, n) + s * rng.standard_normal(T.size) for n, s in NOISE.items()}
    )


def changed(recording, name, where, value):
    signal = getattr(recording, name).copy()
    signal[where] = value
    return replace(recording, **{name: signal})


def only(recording, code):
    (found,) = sample_findings(recording)
    assert codes_of([found]) == [code]
    return found


def test_a_log_without_a_fault_has_none(smooth, noisy):
    assert sample_findings(smooth) == [] == sample_findings(noisy)


@pytest.mark.parametrize("name", ["v_y", "r", "a_y", "delta_f"])
def test_a_channel_that_stops_for_a_while_is_frozen_there_for_so_long(smooth, noisy, name):
    still = changed(noisy, name, slice(1200, 1280), getattr(noisy, name)[1200])
    found = only(still, f"frozen {name}")
    assert found.unit == "s"
    assert found.size == pytest.approx(0.8)
    assert "from 12 s on for 0.8 s" in found.text
    assert sample_findings(changed(noisy, name, slice(1200, 1225), 0.01)) == [], "not for 0.3 s"
    exact = sample_findings(changed(smooth, name, slice(1200, 1280), getattr(smooth, name)[1200]))
    servo = name == "delta_f"  # which may stand still
    assert codes_of(exact) == [f"frozen {name}"] * (not servo)


def test_a_channel_that_stops_while_the_car_stands_is_not_frozen(noisy):
    here = slice(1200, 1280)
    standing = changed(changed(noisy, "r", here, 0.0), "v_x", here, 0.2)
    assert not [one for one in sample_findings(standing) if one.code == "frozen"]


@pytest.mark.parametrize("lasts", [2, 5])
def test_a_slow_channel_is_late_by_half_of_what_its_values_last(noisy, lasts):
    held = replace(noisy, r=noisy.r[np.arange(T.size) // lasts * lasts])
    found = only(held, "held r")
    assert found.size == pytest.approx(lasts * DT)
    assert found.repair.delay == {"r": pytest.approx(0.5 * (lasts - 1) * DT)} and found.sure


def test_samples_that_are_repeated_now_and_then_are_counted(noisy):
    signal = noisy.v_y.copy()
    for k in range(100, 2900, 100):
        signal[k : k + 3] = signal[k - 1]
    found = only(replace(noisy, v_y=signal), "held v_y")
    assert found.size == pytest.approx(0.04)
    assert "28 times" in found.text and "2.8 % of the log" in found.text


def test_samples_that_are_lost_are_counted_from_the_first_on(noisy):
    found = only(changed(noisy, "v_x", [500, 501, 900, 901, 902], 0.0), "dropout v_x")
    assert found.size == 5.0
    assert "for 5 of 3000 samples, first at 5 s" in found.text and found.confidence == CERTAIN


def test_one_sample_that_is_zero_is_no_dropout(noisy):
    assert sample_findings(changed(noisy, "v_x", 500, 0.0)) == []


@pytest.mark.parametrize("step", [0.3, 0.6, 1.0])
def test_rounding_makes_as_many_neighbors_alike_as_is_said(step):
    signal = step * np.round(np.random.default_rng(2).standard_normal(100_000) / step)
    assert resolution(signal) == pytest.approx(step)
    may, chance = Runs.of(signal).lost(signal, step)
    assert np.count_nonzero(may) == pytest.approx(chance, rel=0.15)


def driven(to, lasts=60.0, dt=DT):
    """A car without noise: straight ahead, in a turn that tightens evenly, in a sine of 7 s."""
    t, smooth = np.arange(0.0, lasts, dt), np.ones(round(1.0 / dt)) * dt
    turn = np.interp(t, [5.0, 15.0, 18.0, 20.0], [0.0, 1.0, 1.0, 0.0])
    turn = np.convolve(np.convolve(turn, smooth, "same"), smooth, "same")
    waves = np.clip((t - 25.0) / 5.0, 0.0, 1.0) ** 2 * np.sin(2.0 * math.pi * (t - 25.0) / 7.0)
    motion = dict(v_y=(-0.6, 0.2), r=(0.2, 0.1), delta_f=(0.03, 0.0), a_y=(4.0, 0.12))
    exact = {n: x * np.interp(t - late, t, turn + waves) for n, (x, late) in motion.items()}
    exact["v_x"] = 20.0 + 0.002 * t
    exact["v_y"] = exact["v_y"] + 1.5 * exact["r"]  # the rear axle slips
    return made(t, **{n: to(n, x) for n, x in exact.items()})


@pytest.mark.parametrize("per_unit", [1.0, 3.6])
@pytest.mark.parametrize("digits", [4, 3, 2])
def test_the_digits_of_a_file_are_no_fault(noisy, digits, per_unit):
    def to(_, signal):
        return np.round(per_unit * signal, digits) / per_unit

    names = {name: to(name, getattr(noisy, name)) for name in NOISE}
    for log in (driven(to), driven(to, dt=0.02), replace(noisy, **names)):
        found = sample_findings(log)
        assert {one.code for one in found} <= {"quantized"}
        assert not [one for one in found if one.matters]


def test_single_samples_far_off_are_spikes(noisy):
    at = np.array([400, 1100, 2000])
    spiky = changed(noisy, "r", at, noisy.r[at] + [1.0, -1.0, 1.0])
    found = only(spiky, "spikes r")
    assert found.size == 3.0
    assert "first at 4 s" in found.text
    two = changed(noisy, "r", at[:2], noisy.r[at[:2]] + 1.0)
    assert sample_findings(two) == [], "two are none"


def test_a_coarse_channel_is_told_with_its_step(noisy):
    found = only(replace(noisy, r=0.05 * np.round(noisy.r / 0.05)), "quantized r")
    assert (found.unit, found.note) == ("rad/s", True)
    assert found.size == pytest.approx(0.05)
    assert sample_findings(replace(noisy, r=0.02 * np.round(noisy.r / 0.02))) == []


@pytest.mark.parametrize(("factor", "words"), [(1.0, "is a copy of"), (-2.5, "is -2.5 times")])
def test_a_channel_that_is_another_is_told_with_its_factor(noisy, factor, words):
    found = only(replace(noisy, a_y=factor * noisy.r), "copied a_y")
    assert found.size == pytest.approx(factor) and f"a_y {words} r" in found.text


@pytest.mark.parametrize("most", [0.02, 0.05])
def test_samples_that_come_late_at_random_are_late_by_as_much(smooth, noisy, most):
    late = np.random.default_rng(1).uniform(0.0, most, T.size)
    moved = {n: np.interp(T - late, T, getattr(smooth, n)) for n in ("r", "delta_f")}
    quiet = {n: x + 2e-5 * np.sin(997.0 * np.arange(T.size) ** 2) for n, x in moved.items()}
    found = {one.channel: one for one in sample_findings(replace(noisy, **quiet))}
    assert set(found) == {"r", "delta_f"} and {one.code for one in found.values()} == {"jitter"}
    assert found["r"].size == pytest.approx(most, rel=0.3)
    alone = replace(noisy, v_y=np.interp(T - late, T, smooth.v_y))
    assert sample_findings(alone) == [], "noise of v_y may grow with slip"


def test_a_clock_that_jumps_is_told_where_and_by_how_much(noisy):
    def of(kept):
        return made(DT * np.arange(kept.size), **{n: getattr(noisy, n)[kept] for n in NOISE})

    found = only(of(np.r_[0:1500, 1540:3000]), "clock")
    assert found.unit == "s"
    assert found.size == pytest.approx(0.4, rel=0.3) and found.deviation == 0.5 * found.size
    assert float(found.text.split("at once at ")[1].split(" s")[0]) == pytest.approx(15.0, abs=0.06)
    twice = sample_findings(of(np.r_[0:1500, 1450:3000]))
    (found,) = [one for one in twice if one.code == "clock"]
    assert (found.size, found.deviation) == pytest.approx((-0.5, 0.0))
    assert found.confidence == CERTAIN
    assert "0.5 s before 15 s are logged twice" in found.text


def test_a_v_y_that_is_switched_off_is_told_with_its_share_and_speed(noisy):
    off = (T > 8.5) & (T < 11.5) | (T > 27.0)
    slow = replace(noisy, v_x=noisy.v_x - 10.0 * off)
    found = only(replace(slow, v_y=np.where(off, 0.0, slow.v_y)), "zero v_y")
    assert found.size == pytest.approx(DT * off.sum()) and "exactly 0 2 times" in found.text
    slowest = float(np.percentile(np.abs(slow.v_x[~off]), 5))
    assert f"where the car is slower than {slowest:.3g} m/s" in found.text


def test_a_channel_without_a_sensor_is_told_and_not_asked_further(noisy):
    found = only(replace(noisy, a_y=np.full(T.size, 0.25)), "frozen a_y")
    assert found.confidence == CERTAIN
    assert (
        found.size == pytest.approx(noisy.duration) and "a_y is 0.25 m/s² throughout" in found.text
    )


def test_samples_are_late_where_those_of_r_and_another_channel_are_alike():
    assert _is_late("r", {"r": 0.05, "delta_f": 0.04}, DT)
    assert _is_late("delta_f", {"r": 0.05, "delta_f": 0.04, "v_y": 0.2}, DT)
    for size in (0.02, 0.2):
        assert not _is_late("r", {"r": 0.05, "delta_f": size}, DT)
    assert not _is_late("v_y", {"v_y": 0.05, "a_y": 0.05}, DT), "without r"
    assert not _is_late("r", {"r": 0.006, "delta_f": 0.006}, DT), "within a sample"


def cornering(v_y=None):
    """A car of 3 m from axle to axle whose rear tires have 14 loads per rad, and its v_y or one."""
    rng = np.random.default_rng(8)
    r, v_x = swing(rng, 0.2), 18.0 + 4.0 * np.sin(0.3 * T)
    slip, times = np.zeros(T.size), v_x / (9.81 * 14.0)
    for k in range(1, T.size):
        late = times[k] * v_x[k] * r[k] - slip[k - 1]
        slip[k] = slip[k - 1] + DT / (times[k] + DT) * late
    true, delta_f = 1.5 * r - slip, 3.0 * r / v_x + 0.002 * v_x * r
    log = {"v_x": v_x, "v_y": true if v_y is None else v_y(r, v_x * delta_f), "r": r}
    log |= {"delta_f": delta_f, "a_y": v_x * r + np.gradient(true, DT)}
    noise = NOISE | {"v_y": 0.002, "delta_f": 0.0002}
    shown = {n: x + noise[n] * rng.standard_normal(T.size) for n, x in log.items()}
    return made(T, **shown)


@pytest.mark.parametrize(
    ("v_y", "said"),
    [
        (lambda r, _: 0.0 * r, "held near zero"),
        (lambda r, _: 1.5 * r, "computed from r (v_y = 1.50 r)"),
        (lambda r, _: -0.8 * r, "computed from r (v_y = -0.80"),
        (lambda r, _: lfilter([0.05], [1.0, -0.95], 1.5 * r), "computed from r (v_y = 1."),
        (lambda _, steered: 0.5 * steered, "computed from vx delta_f (v_y = 0.50"),
    ],
)
def test_a_v_y_that_was_computed_is_named_alone_with_what_it_follows_from(v_y, said):
    found = only(cornering(v_y), "computed v_y")
    assert found.confidence == CERTAIN
    assert said in found.text and "leave the column vy out of the log: ay is there" in found.text


@pytest.mark.parametrize("times", [1.0, 1.0 / 18.0, -1.0, 3.6])
def test_a_v_y_that_was_measured_is_none_whatever_its_unit(times):
    log = cornering()
    v_y = 1.5 * log.r + 0.02 * np.random.default_rng(4).standard_normal(T.size)
    slow = replace(log, v_x=0.1 * log.v_x, v_y=v_y, a_y=None)  # no tire slips there
    for one in (replace(log, v_y=times * log.v_y), slow):
        assert computed_v_y(one) is None
