import json
import math
from dataclasses import replace

import numpy as np
import pytest

import tireid as ti
from identifier.axle.slip import beyond_play
from models.friction import Friction, FrictionChange
from models.maneuvers import Slalom
from models.plant import Plant
from models.recordings.record import joined
from models.sensors import Sensor, Sensors
from tireid.live.live import LATELY, OLD, Live

ZERO, BIAS = 0.01, 0.1  # rad, m/s
DROP = 26.0  # s
TAPE = "tape_tiles_steer_neg03"
NOISY = Sensors(
    v_x=Sensor(noise=0.03), v_y=Sensor(noise=0.03), r=Sensor(noise=0.003), delta=Sensor(noise=5e-4)
)


@pytest.fixture(scope="module")
def car():
    return ti.sedan()


@pytest.fixture(scope="module")
def log():
    return ti.sample_recording(seed=1)


@pytest.fixture(scope="module")
def stored(log, car):
    return ti.identify(log, car, method="axle").freeze()


def fed(live, log, *, v_y=True, a_y=True, part=slice(None)):
    """Return the states of a log."""
    t, v_x, r, delta = (one[part].tolist() for one in (log.t, log.v_x, log.r, log.delta_f))
    rows = zip(
        t,
        v_x,
        r,
        delta,
        log.a_y[part].tolist() if a_y and log.a_y is not None else [None] * len(t),
        log.v_y[part].tolist() if v_y else [None] * len(t),
        strict=True,
    )
    return [state for row in rows if (state := live.feed(*row)) is not None]


def same_bits(model, other):
    pairs = ((one.W, one.covariance) for one in (model, other))
    return all(np.array_equal(a, b) for a, b in zip(*pairs, strict=True))


@pytest.mark.parametrize("method", ["axle", "inertial"])
def test_it_identifies_what_a_whole_log_does_bit_for_bit(car, log, method):
    live = Live(car)
    fed(live, log, v_y=method == "axle")
    given = log if method == "axle" else replace(log, v_y=None)
    offline = ti.identify(given, car, method=method).freeze()
    assert same_bits(live.identifier.model(), offline)


def test_a_gap_is_what_it_is_in_a_log(car, log):
    """Bits of a recording in two segments, the samples between them counted as lost."""
    first, second = log.taken(slice(0, 1000)), log.taken(slice(1300, 2000))
    live = Live(car)
    fed(live, log, part=slice(0, 1000))
    fed(live, log, part=slice(1300, 2000))
    offline = ti.identify(joined([first, second], "two"), car, method="axle").freeze()
    assert same_bits(live.identifier.model(), offline)
    assert (live.counts.samples, live.counts.lost) == (1700, 300)


@pytest.mark.parametrize("rate", [50.0, 400.0])
def test_another_rate_is_what_reading_such_a_log_makes_of_it(car, log, rate):
    whole = log.taken(slice(0, 1500))
    t = whole.t[0] + np.arange(round(15.0 * rate) - round(rate * 0.02)) / rate
    columns = {"t": t} | {
        column: np.interp(t, whole.t, getattr(whole, name))
        for column, name in (
            ("vx", "v_x"), ("vy", "v_y"), ("r", "r"), ("delta_f", "delta_f"), ("ay", "a_y"),
        )
    }  # fmt: skip
    read = ti.read_recording(columns)
    live = Live(car)
    names = ("t", "vx", "r", "delta_f", "ay", "vy")
    for row in zip(*(columns[name].tolist() for name in names), strict=True):
        live.feed(*row)
    offline = ti.identify(read, car, method="axle").freeze()
    found = live.identifier.model()
    assert abs(live.counts.samples - len(read)) <= 1
    np.testing.assert_allclose(found.stiffness, offline.stiffness, rtol=0.01)
    if rate < 100.0:  # straight lines between samples, to the last instant that is known
        assert same_bits(found, offline) or live.counts.samples < len(read)


def test_curves_reach_beyond_the_known_slip_and_grip_is_their_largest_force(car, log, stored):
    state = fed(Live(car, stored.at_friction(4.0)), log)[2]
    assert state.origin == "stored" and (state.known_slip > 0.2).any()
    assert state.slip[-1] > max(state.known_slip)
    loads = np.array(car.axle_loads)
    np.testing.assert_allclose(state.grip, state.force.max(axis=1) / loads)


def test_a_state_says_what_is_known_and_how_well(car, log, stored):
    states = fed(Live(car), log)
    assert np.allclose(np.diff([state.t for state in states]), 0.2)
    assert not states[5].valid and "force for" in states[5].reason
    last = states[-1]
    assert last.valid and (last.reason, last.origin, last.alarm) == ("", "live", "")
    np.testing.assert_allclose(last.stiffness, stored.stiffness, rtol=0.01)
    np.testing.assert_allclose(last.force[0], stored.force(last.slip, "front"), rtol=0.01)
    assert abs(last.side_slip - math.atan2(log.v_y[-1], log.v_x[-1])) < 5.0 * last.side_slip_sd
    assert 0.0 < last.understeer_sd < 0.002 and 5.0 < last.a_y_limit < 12.0
    assert last.friction == 1.0


def test_a_state_fits_its_schema_and_json(car, log):
    state = fed(Live(car), log, part=slice(0, 100))[-1]
    text = json.dumps(state.to_dict(), allow_nan=False)
    schema = ti.State.schema()
    assert list(json.loads(text)) == schema["required"] == list(schema["properties"])
    kinds = {"number": (int, float), "string": str, "boolean": bool, "array": list, "object": dict}
    for name, value in json.loads(text).items():
        types = np.atleast_1d(schema["properties"][name]["type"])
        assert (value is None and "null" in types) or isinstance(value, kinds[types[0]]), name


def test_zeros_of_the_sensors_are_those_of_the_day(car, log):
    """Shifted signals tell other zeros, and the same tires."""
    plain = fed(Live(car), log)[-1]
    shifted = replace(log, delta_f=log.delta_f - ZERO, v_y=log.v_y + BIAS)
    last = fed(Live(car), shifted)[-1]
    assert abs(last.steering_zero - plain.steering_zero - ZERO) < 4.0 * last.steering_zero_sd
    assert abs(last.v_y_bias - plain.v_y_bias - BIAS) < 4.0 * last.v_y_bias_sd
    np.testing.assert_allclose(last.stiffness, plain.stiffness, rtol=0.05)


def test_stored_tires_are_given_until_the_drive_says_more(car, log, stored):
    live = Live(car, stored)
    states = fed(live, log)
    assert (states[0].valid, states[0].origin) == (False, "stored")
    np.testing.assert_allclose(states[0].stiffness, stored.stiffness)
    assert (states[-1].valid, states[-1].origin) == (True, "live")
    old = live.state(age=OLD + 0.5)
    assert (old.valid, old.origin, old.side_slip) == (False, "stored", None)
    assert "nothing came for 1.5 s" in old.reason


def test_straight_ahead_for_long_nothing_is_valid_any_more(car, log):
    live = Live(car)
    t = fed(live, log)[-1].t
    states = [live.feed(t + 0.01 * k, 20.0, 0.0, 0.0, 0.0, 0.0) for k in range(1, 3200)]
    given = [state for state in states if state]
    assert given[0].valid and not given[-1].valid
    assert f"no force in the last {LATELY:g} s" in given[-1].reason


@pytest.fixture(scope="module")
def dropped(car):
    """A drive on a road that loses half of its friction at `DROP`."""
    return slalom(car, FrictionChange(scale=0.5, at_time=DROP))


def slalom(car, *changes, duration=29.0):
    steer = Slalom(amplitude=0.05, frequency=0.4, onset=0.5, rate_limit=1.0, duration=duration)
    run = Plant(car).simulate(steer, speed=20.0, friction=Friction(changes=changes))
    return run.recording(NOISY, np.random.default_rng(1))


@pytest.mark.parametrize("with_stored", [True, False])
def test_lost_friction_is_an_alarm_within_a_second(car, dropped, stored, with_stored):
    live = Live(car, stored if with_stored else None)
    states = fed(live, dropped)
    first = next(state for state in states if state.alarm)
    assert DROP < first.t < DROP + 1.0
    assert 0.35 < first.friction < 0.75
    assert DROP < first.friction_since <= first.t
    assert live.tires() is None or not states[-1].alarm


def test_a_real_car_that_comes_to_another_floor_is_an_alarm(shared_data):
    """A car of 1:10 on a grippy floor, and from one sample to the next on tape and tiles."""
    car = ti.Vehicle(
        name="1:10", mass=1.58, yaw_inertia=0.00481, l_f=0.0805, l_r=0.0930,
        cornering_stiffness_front=60.0, cornering_stiffness_rear=60.0,
    )  # fmt: skip
    path = shared_data / "dart_imu.csv.gz"
    floor, tape = (ti.read_recording(path, run) for run in ("free_10_12_05", TAPE))
    live = Live(car)
    assert not any(state.alarm for state in fed(live, floor.taken(slice(2000, 5000))))
    other = tape.taken(slice(3500, 4000))
    states = fed(live, replace(other, t=other.t - other.t[0] + floor.t[5000]))
    first = next(state for state in states if state.alarm)
    assert first.t < floor.t[5000] + 1.0
    assert 0.3 < first.friction < 0.7


def test_bad_numbers_are_counted_and_the_rest_goes_on(car, log):
    live = Live(car)
    rows = np.column_stack([log.t, log.v_x, log.r, log.delta_f, log.a_y, log.v_y])
    before = fed(live, log, part=slice(0, 2000))[-1]
    for bad in ((math.nan, 20, 0, 0, 0, 0), (20.005, math.inf, 0, 0, 0, 0),
                (20.0, 20, None, 0, 0, 0), (20.01, 20, 0, 0, 0, 1e9)):  # fmt: skip
        live.feed(*bad)
    assert live.counts.refused >= 3
    live.feed(*rows[1998])
    live.feed(*rows[2005])
    live.feed(*rows[2005])
    assert (live.counts.late, live.counts.doubled) == (2, 1)
    assert fed(live, log, part=slice(2006, 4000))[-1].valid
    assert before.valid


@pytest.mark.parametrize(
    "times",
    [
        [-1.7e308, 1.7e308, 1.0],
        [0.0, 5e-324, 2.0],
        [0.0, 1e4, 1e4 + 0.01],  # no time yet, then one
        [0.0, *(0.006 + 1e-9 * k for k in range(3000))],  # of a wrong unit
    ],
)
def test_no_time_stops_it_or_makes_samples_that_never_were(car, times):
    live = Live(car)
    for t in times:
        live.feed(t, 20.0, 0.0, 0.0, v_y=0.0)
    assert live.counts.samples <= 3 and len(live._clock._last) <= 5


def test_huge_numbers_are_none(car):
    live = Live(car)
    for k in range(40):
        live.feed(0.01001 * k, 20.0, (-1) ** k * 1e308, 0.0, v_y=(-1) ** k * 1.7e308)
    assert live.counts.refused >= 39 and live.counts.samples == 0


@pytest.mark.parametrize("times", [lambda k: 10.0 * k, lambda k: 0.01 * k + k % 2 * 1e3])
def test_samples_that_do_not_follow_each_other_are_said_to_be_so(car, log, times):
    live = Live(car)
    assert fed(live, log)[-1].valid
    states = [live.feed(1e4 + times(k), 20.0, 0.0, 0.0, v_y=0.0) for k in range(60)]
    (*_, last) = filter(None, states)
    assert not last.valid and "0.1 s apart" in last.reason and live.tires() is None


def test_a_clock_that_jumps_back_begins_states_anew_and_keeps_the_tires(car, log):
    live = Live(car)
    before = fed(live, log)[-1]
    first = fed(live, log, part=slice(0, 21))[0]
    assert live.counts.jumps == 1 and first.t < before.t
    np.testing.assert_allclose(first.stiffness, before.stiffness, rtol=0.02)
    assert first.stiffness_sd[0] < 1.2 * before.stiffness_sd[0]


def test_a_clock_that_jumps_back_in_an_alarm_is_no_end_of_it(car, dropped):
    live = Live(car)
    assert fed(live, dropped)[-1].alarm
    states = fed(live, dropped, part=slice(0, 300))
    assert live.counts.jumps == 1 and states[-1].t < 3.0


def test_stamps_of_a_clock_that_was_not_set_hold_nothing_up(car, log):
    """The first stamp 0 and the others those of an epoch; then times of no clock."""
    live = Live(car)
    live.feed(0.0, 20.0, 0.0, 0.0, 0.0, 0.0)
    later = replace(log, t=log.t + 1.7e9)
    assert len(fed(live, later, part=slice(0, 500))) == 25
    for t in (1.7e308, -1.7e308, 1.7e308):
        live.feed(t, 20.0, 0.0, 0.0, 0.0, 0.0)
    assert len(fed(live, later, part=slice(500, 1000))) == 25
    assert (live.counts.lost, live.counts.jumps, live.counts.refused) == (0, 1, 3)


def test_numbers_that_are_none_for_long_are_said_in_states(car, log):
    live = Live(car)
    t = fed(live, log)[-1].t
    given = [live.feed(t + 0.01 * k, 20.0, math.nan, 0.0, 0.0, 0.0) for k in range(1, 201)]
    last = [state for state in given if state][-1]
    assert (last.valid, last.side_slip) == (False, None) and "no numbers" in last.reason


def test_a_v_y_that_never_changes_is_never_valid(car, log):
    """As odometry of wheels sends it."""
    states = fed(Live(car), replace(log, v_y=np.zeros(len(log))))
    assert not any(state.valid for state in states) and "v_y never changes" in states[-1].reason


def test_play_of_the_steering_is_no_tire_and_stored_tires_are_given(car, log, stored):
    at, slip = np.linspace(-1.0, 1.0, 20001), log.alpha(car.l_f, car.l_r)[:, 0]
    loose = log.delta_f + np.interp(slip, beyond_play(at, 0.01), at) - slip
    states = fed(Live(car, stored), replace(log, delta_f=loose), part=slice(0, 2000))
    assert not any(state.valid for state in states) and states[-1].origin == "stored"
    assert "front curve is flat about zero slip" in states[-1].reason


def test_tires_that_miss_a_share_of_the_force_are_not_valid(car):
    """Those of a wet road, on a dry one, where they change too slowly."""
    wet, dry = Live(car), slalom(car, duration=14.0)
    assert fed(wet, slalom(car, FrictionChange(scale=0.5, at_time=0.0), duration=20.0))[-1].valid
    states, true = fed(Live(car, resume=wet.tires()), dry), fed(Live(car), dry)[-1].force[:, 8]
    assert all((abs(one.force[:, 8] / true - 1.0) < 0.15).all() for one in states if one.valid)


def test_without_v_y_a_car_that_stands_is_as_valid_as_before(car, log):
    live = Live(car)
    last = fed(live, log, v_y=False)[-1]
    given = [live.feed(last.t + 0.01 * k, 0.0, 0.0, 0.0, 0.0) for k in range(1, 101)]
    assert last.valid and [state for state in given if state][-1].reason == ""


def test_what_was_identified_before_is_gone_on_from(car, log):
    live = Live(car)
    fed(live, log)
    again = Live(car, resume=live.tires())
    first = fed(again, ti.sample_recording(seed=3), part=slice(0, 21))[0]
    np.testing.assert_allclose(first.stiffness, live.tires().stiffness, rtol=0.02)
    assert first.steering_zero_sd > 0.002  # of another day, perhaps


def test_without_v_y_side_slip_is_estimated(car, log, stored):
    last = fed(Live(car), log, v_y=False)[-1]
    assert abs(last.side_slip - math.atan2(log.v_y[-1], log.v_x[-1])) < 0.02
    assert last.v_y_bias is None and last.side_slip_sd < 0.02
    with pytest.raises(ValueError, match="v_y or a_y is needed"):
        fed(Live(car), log, v_y=False, a_y=False)


def test_tires_of_another_car_are_refused(car, stored):
    with pytest.raises(ValueError, match="of another car \\(mass"):
        Live(replace(car, mass=2.0 * car.mass, name="van"), stored)
