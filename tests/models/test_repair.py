"""A fault that is applied and repaired gives the drive back, kind by kind."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.faults import (
    UNITS,
    Lagging,
    Late,
    Mirrored,
    Misaligned,
    SensorElsewhere,
    ShiftedCenter,
    SwappedAxles,
    Together,
    WrongNumber,
    WrongUnit,
)
from models.faults import SensorFault
from models.recordings import RecordingError, Repair
from models.recordings.record import CHANNELS
from models.schema import Table
from models.vehicle import VehicleError, sedan
from tests.made import made

CAR = sedan()


@pytest.fixture(scope="module")
def drive():
    """Smooth swings at a speed that varies."""
    t = 0.01 * np.arange(2000)

    def swing(late):
        return np.sin(2.0 * np.pi * 0.4 * (t - late)) * np.sin(0.2 * (t - late))

    return made(
        t,
        v_x=20.0 + 2.0 * np.sin(0.3 * t),
        v_y=0.5 * swing(0.15),
        r=0.3 * swing(0.1),
        delta_f=0.05 * swing(0.0),
        a_y=6.0 * swing(0.1),
        axle_force=np.column_stack([swing(0.0), swing(0.1)]),
    )


BIASED = SensorFault(channel="v_y", kind="biased", size=0.2)


REPAIRS = {
    "offset": (BIASED, Repair(offset={"v_y": 0.2})),
    "factor": (SensorFault(channel="r", kind="scaled", size=1.25), Repair(factor={"r": 0.8})),
    "steering wheel": (
        SensorFault(channel="delta_f", kind="scaled", size=16.0),
        Repair(factor={"delta_f": 1.0 / 16.0}),
    ),
    "sign": (Mirrored(channels=("v_y", "a_y")), Repair(factor={"v_y": -1.0, "a_y": -1.0})),
    "unit": (WrongUnit(channel="a_y", unit="g"), Repair(factor={"a_y": 1.0 / UNITS["g"]})),
    "misaligned": (Misaligned(angle=0.02), Repair(velocity_sensor_angle=0.02)),
    "ahead": (SensorElsewhere(sensor="velocity", x=0.7), Repair(velocity_sensor_x=0.7)),
    "accelerometer": (
        SensorElsewhere(sensor="accelerometer", x=-0.4),
        Repair(acceleration_sensor_x=-0.4),
    ),
    "order": (
        Together(
            faults=(
                SensorElsewhere(sensor="velocity", x=0.7),
                Misaligned(angle=0.02),
                Late(channels=("v_y",), delay=0.05),
                BIASED,
                SensorFault(channel="v_y", kind="scaled", size=-3.6),
            )
        ),
        Repair(
            velocity_sensor_x=0.7, velocity_sensor_angle=0.02, delay={"v_y": 0.05},
            offset={"v_y": 0.2}, factor={"v_y": -1.0 / 3.6},
        ),
    ),
}  # fmt: skip


def apart(one, other):
    """Return the largest difference of a channel over its size, where both have samples."""
    n = len(one)
    return max(
        np.abs(getattr(one, name) - getattr(other, name)[:n]).max()
        / max(np.abs(getattr(other, name)).max(), 1e-9)
        for name in CHANNELS
    )


@pytest.mark.parametrize("name", REPAIRS)
def test_what_is_applied_and_repaired_gives_the_drive_back(drive, name):
    fault, repair = REPAIRS[name]
    assert apart(fault.apply(drive), drive) > 0.02
    repaired, car = repair.apply(fault.apply(drive), CAR)
    # a misaligned sensor turns v_x too, and v_x is not late with v_y in the case of an order
    assert apart(repaired, drive) < (2e-3 if name == "order" else 1e-12)
    assert car is CAR
    np.testing.assert_array_equal(repaired.axle_force, drive.axle_force[: len(repaired)])


@pytest.mark.parametrize("delay", [0.05, 0.0333])
def test_a_delay_is_taken_out_and_the_end_that_nobody_measured_is_cut(drive, delay):
    late = Late(channels=("r", "a_y"), delay=delay).apply(drive)
    repaired, _ = Repair(delay={"r": delay, "a_y": delay}).apply(late, CAR)
    assert len(repaired) == len(drive) - int(np.ceil(delay / drive.dt))
    assert apart(repaired, drive) < 1e-3
    assert apart(late, drive) > 0.05


def test_a_channel_that_is_early_cuts_the_beginning(drive):
    others = Late(channels=("v_x", "v_y", "r", "delta_r", "a_y"), delay=0.05).apply(drive)
    repaired, _ = Repair(delay={"delta_f": -0.05}).apply(others, CAR)
    assert repaired.t[0] == pytest.approx(drive.t[0] + 0.05)
    np.testing.assert_allclose(repaired.delta_f, drive.delta_f[:-5], atol=1e-12)
    np.testing.assert_allclose(repaired.r, drive.r[:-5], atol=1e-12)


@pytest.mark.parametrize("lag", [0.05, 0.2])
def test_a_low_pass_is_taken_out(drive, lag):
    lagging = Lagging(channels=("v_y", "r"), time_constant=lag).apply(drive)
    repaired, _ = Repair(lag={"v_y": lag, "r": lag}).apply(lagging, CAR)
    assert apart(repaired, drive) < 0.015
    assert apart(lagging, drive) > 0.1


def test_noise_behind_a_low_pass_is_not_blown_up(drive):
    lagging = Lagging(channels=("v_y",), time_constant=0.2).apply(drive)
    noise = np.random.default_rng(0).normal(0.0, 0.03, len(drive))
    noisy = replace(lagging, v_y=lagging.v_y + noise)
    repaired, _ = Repair(lag={"v_y": 0.2}).apply(noisy, CAR)
    left = repaired.v_y - drive.v_y
    plain = noisy.v_y + 0.2 * np.gradient(noisy.v_y, drive.dt) - drive.v_y
    assert np.std(left) < 4.0 * 0.03
    assert np.std(plain) > 10.0 * 0.03


@pytest.mark.parametrize(
    "told", [SwappedAxles(), ShiftedCenter(share=0.05), WrongNumber(field="yaw_inertia", factor=2)]
)
def test_numbers_of_the_car_are_put_right(drive, told):
    right = {name: getattr(CAR, name) for name in ("yaw_inertia", "l_f", "l_r")}
    repaired, car = Repair(vehicle=right).apply(drive, told.tell(CAR))
    assert car == CAR
    assert told.tell(CAR) != CAR
    np.testing.assert_array_equal(repaired.v_y, drive.v_y)


def test_a_document_holds_a_repair_bit_for_bit():
    repair = Repair(
        factor={"delta_f": 1.0 / 15.9}, offset={"v_y": 0.1}, delay={"a_y": 0.09}, lag={"r": 0.02},
        velocity_sensor_x=0.3, vehicle={"l_f": 1.2},
    )  # fmt: skip
    assert Repair.of_table(Table(repair.tables(), "log.toml: ", RecordingError)) == repair
    assert Repair().tables() == {}


def test_repairs_that_were_estimated_together_merge():
    one = Repair(factor={"r": 2.0}, offset={"v_y": 0.1}, velocity_sensor_x=0.2)
    other = Repair(factor={"r": 0.5, "v_y": -1.0}, offset={"v_y": 0.1}, vehicle={"l_f": 1.2})
    assert one.merged(other) == Repair(
        factor={"r": 1.0, "v_y": -1.0},
        offset={"v_y": 0.2},
        velocity_sensor_x=0.2,
        vehicle={"l_f": 1.2},
    )
    assert one.merged(Repair()) == one == Repair().merged(one)


IN_SEQUENCE = {
    "offset, then factor": (Repair(offset={"r": 0.1}), Repair(factor={"r": 0.5})),
    "factors and offsets": (
        Repair(factor={"v_y": 2.0, "r": 3.0}, offset={"v_y": 0.3, "a_y": 1.0}),
        Repair(factor={"v_y": -0.4, "v_x": 0.4}, offset={"v_y": -0.2, "v_x": 0.5, "r": 0.1}),
    ),
    "a turn, then offsets": (
        Repair(velocity_sensor_angle=0.2, offset={"v_x": 0.5}),
        Repair(offset={"v_x": 0.7, "v_y": 0.4}, velocity_sensor_angle=-0.1),
    ),
    "a turn, then a sign": (
        Repair(velocity_sensor_angle=0.2),
        Repair(factor={"v_y": -1.0}, offset={"v_y": 0.4}),
    ),
    "a place, then factors": (
        Repair(velocity_sensor_x=0.5, acceleration_sensor_x=0.3),
        Repair(
            factor={"r": 2.0, "v_y": 0.5, "a_y": -1.0},
            offset={"r": 0.1},
            velocity_sensor_x=0.2,
            acceleration_sensor_x=0.1,
        ),
    ),
    "a turned sensor ahead, then an offset": (
        Repair(velocity_sensor_x=0.5, velocity_sensor_angle=0.1),
        Repair(offset={"r": 0.1, "v_y": 0.2}, velocity_sensor_x=0.3),
    ),
    "a sideslip angle, then an offset": (
        Repair(sideslip=True, factor={"v_y": 0.01}, offset={"v_y": 0.2}),
        Repair(offset={"v_y": 0.1}),
    ),
    "numbers of the car": (
        Repair(vehicle={"mass": 1400.0, "l_f": 1.3}),
        Repair(vehicle={"l_f": 1.2}),
    ),
}


@pytest.mark.parametrize("name", IN_SEQUENCE)
def test_two_repairs_in_sequence_are_one(drive, name):
    one, other = IN_SEQUENCE[name]
    at_once, car = one.then(other).apply(drive, CAR)
    in_sequence, its_car = other.apply(*one.apply(drive, CAR))
    assert apart(at_once, in_sequence) < 1e-12
    assert car == its_car
    alone, _ = other.apply(drive, CAR)
    assert "car" in name or apart(alone, in_sequence) > 0.02


def test_areas_of_downforce_come_into_the_car_and_may_be_of_lift(drive):
    areas = {"downforce_area_front": 1.2, "downforce_area_rear": -0.3}
    repair = Repair(vehicle=areas)
    kept = Repair.of_table(Table(repair.tables(), "", RecordingError, "repair."))
    _, car = kept.apply(drive, CAR)
    assert car == replace(CAR, **areas)
    with pytest.raises(VehicleError, match=r"downforce_area_rear in m² must lie between"):
        Repair(vehicle={"downforce_area_rear": -50.0}).apply(drive, CAR)


def test_what_cannot_be_applied_is_refused(drive):
    without = replace(drive, a_y=None)
    for repair in (Repair(delay={"a_y": 0.1}), Repair(acceleration_sensor_x=0.1)):
        with pytest.raises(RecordingError, match="has no a_y"):
            repair.apply(without, CAR)
    with pytest.raises(RecordingError, match="leave nothing"):
        Repair(delay={"r": 30.0}).apply(drive, CAR)
    with pytest.raises(VehicleError):
        Repair(vehicle={"mass": 1e-9}).apply(drive, CAR)
    with pytest.raises(RecordingError, match=r"repair\.lags"):
        Repair.of_table(Table({"lags": {}}, "", RecordingError, "repair."))


@pytest.mark.parametrize("name", REPAIRS)
def test_a_repair_in_blocks_has_the_bits_of_one_in_a_piece(drive, name, monkeypatch):
    _, repair = REPAIRS[name]
    piece, _ = repair.apply(drive, CAR)
    monkeypatch.setattr("codegen.arrays.LONG", 500)
    monkeypatch.setattr("codegen.arrays.BLOCK", 111)
    blocks, _ = repair.apply(drive, CAR)
    for channel in ("t", "v_x", "v_y", "r", "delta_f", "delta_r", "a_y", "axle_force"):
        np.testing.assert_array_equal(getattr(piece, channel), getattr(blocks, channel))


@pytest.fixture(scope="module")
def broken(drive):
    """The drive with two gaps: segments of 900, 15 and 800 samples."""
    return drive.taken(np.r_[0:900, 1000:1015, 1200:2000])


SHORT = slice(900, 915)


def test_a_segment_that_a_delay_leaves_nothing_of_is_left_out_and_told(broken):
    repaired, _ = Repair(delay={"r": 0.08}).apply(broken, CAR)
    assert repaired.breaks == (892,) and len(repaired) == 892 + 792
    assert repaired.notes == ("left out: 1 segment of which delays leave nothing",)
    np.testing.assert_array_equal(repaired.t[892:], broken.t[915:-8])
    np.testing.assert_allclose(repaired.r[892:], broken.r[923:], atol=1e-12)
    with pytest.raises(RecordingError, match="leave nothing of any segment"):
        Repair(delay={"r": 30.0}).apply(broken, CAR)


@pytest.mark.parametrize("name", [*REPAIRS, "low pass"])
def test_a_repair_of_a_segment_looks_at_no_other(drive, broken, name):
    repair = Repair(lag={"r": 0.1}) if name == "low pass" else REPAIRS[name][1]
    repaired, _ = repair.apply(broken, CAR)
    alone, _ = repair.apply(broken.taken(SHORT), CAR)
    middle = repaired.segments[1]
    assert len(repaired.segments) == 3
    for channel in ("t", "v_x", "v_y", "r", "delta_f", "a_y", "axle_force"):
        np.testing.assert_array_equal(getattr(repaired, channel)[middle], getattr(alone, channel))


def test_behind_a_low_pass_a_straight_line_stays_one_to_its_ends(drive):
    line = replace(drive, r=3.0 * drive.t + 1.0)
    repaired, _ = Repair(lag={"r": 0.1}).apply(line, CAR)
    np.testing.assert_allclose(repaired.r, line.r + 0.3, atol=1e-10)


@pytest.mark.parametrize("sideslip", [False, True])
def test_one_instant_is_repaired_to_the_bits_of_a_log(drive, sideslip):
    repair = Repair(
        sideslip=sideslip,
        factor={"v_x": 1.01, "v_y": 0.9, "a_y": -1.0},
        offset={"v_y": 0.03, "r": 0.01, "delta_f": -0.002},
        velocity_sensor_x=0.7,
        velocity_sensor_angle=-0.02,
    )
    repaired, _ = repair.apply(drive, CAR)
    for k in range(0, len(drive), 37):
        now = repair.at({name: float(getattr(drive, name)[k]) for name in CHANNELS})
        assert now == {name: getattr(repaired, name)[k] for name in CHANNELS}
