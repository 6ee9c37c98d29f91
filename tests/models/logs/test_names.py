"""What a channel is called by which logger, and what is proposed of it."""

from dataclasses import replace

import numpy as np
import pytest

from models.logs.log import Channel, Listed
from models.logs.names import HAND, RULES, SURE, Guess, name_confidence, propose, words_of

CALLED = {
    "v_x": ["vx", "VelForward", "Vel_Longitudinal", "Car.vx", "/odom/twist.twist.linear.x", "v_lon",
            "Velocity_X", "WheelBasedVehicleSpeed", "Längsgeschwindigkeit", "Ground Speed",
            "/vehicle/status/velocity_status/longitudinal_velocity"],
    "v_y": ["vy", "Vel Lat", "LatVel", "VelLateral", "Car.vy", "/odom/twist.twist.linear.y",
            "v_lat", "Quergeschwindigkeit", "lateral_velocity", "Correvit_vQuer"],
    "beta": ["beta", "Schwimmwinkel", "Slip_Angle", "SideSlipAngle", "Car.SideSlipAngle"],
    "r": ["r", "Car.YawRate", "Yaw_Rate", "Gyro Z", "AngRateZ", "Gierrate", "Giergeschwindigkeit",
          "/imu/angular_velocity.z", "psi_dot", "YAW_RATE", "ESP_YawRate", "Gyro Yaw Velocity"],
    "delta_f": ["delta_f", "RoadWheelAngle", "/ackermann_cmd/drive.steering_angle",
                "/vehicle/status/steering_status/steering_tire_angle", "Radlenkwinkel"],
    HAND: ["Steering Angle", "SteerAngle", "Steered Angle", "SWA", "Steering_Wheel_Angle",
           "Lenkradwinkel", "SAS_Angle", "LWS_Angle", "Steer.WhlAng", "HandwheelAngle"],
    "a_y": ["ay", "G Force Lat", "LateralAcc", "GPS LatAcc", "Acc_Y", "Querbeschleunigung",
            "Car.ay", "/imu/linear_acceleration.y", "AccelLateral", "Accel Y"],
    "delta_r": ["delta_r", "RearSteerAngle"],
    "Fyf": ["Fyf", "Fy_front"],
    "Fyr": ["Fyr", "Fy_rear"],
}  # fmt: skip
NO_SIGNAL = ["Engine RPM", "Wheel Speed FL", "Brake Pressure", "Yaw Rate Target", "Roll Rate",
             "Steering Wheel Torque", "Throttle", "/imu/orientation.z", "/odom/twist.covariance[0]",
             "Longitudinal Acceleration",
             "Fuel Level", "Gear", "GPS Latitude", "Steering Wheel Speed", "vy_std"]  # fmt: skip


@pytest.mark.parametrize(("signal", "name"), [(s, n) for s, all_ in CALLED.items() for n in all_])
def test_a_name_of_a_logger_is_that_signal_before_any_other(signal: str, name: str) -> None:
    found = {one: name_confidence(one, name) for one in RULES}
    assert found[signal] >= SURE
    assert all(value < found[signal] for one, value in found.items() if one != signal)


@pytest.mark.parametrize("name", NO_SIGNAL)
def test_a_name_of_something_else_is_no_signal(name: str) -> None:
    assert not any(name_confidence(one, name) for one in RULES)


def test_names_are_cut_into_words() -> None:
    assert words_of("Car.YawRate") == ("car", "yaw", "rate")
    assert words_of("IMU01_gyro_z [deg/s]") == ("imu", "01", "gyro", "z")
    assert words_of("Längsgeschw.") == ("laengsgeschw",)


class Log:
    """Channels in memory, each with a unit: name, unit, values."""

    def __init__(self, *channels: tuple[str, str, np.ndarray]) -> None:
        self.channels = {name: (unit, np.asarray(values)) for name, unit, values in channels}

    def listed(self) -> tuple[Listed, ...]:
        return tuple(
            Listed(name=name, unit=unit, samples=values.size, rate=100.0)
            for name, (unit, values) in self.channels.items()
        )

    def runs(self) -> tuple[str, ...]:
        return ()

    def read(self, names, run=None) -> tuple[Channel, ...]:
        return tuple(
            Channel(
                name=name,
                unit=self.channels[name][0],
                t=0.01 * np.arange(self.channels[name][1].size),
                values=self.channels[name][1],
                place="sample",
                rows=np.arange(self.channels[name][1].size),
            )
            for name in names
        )


WAVE = np.sin(np.arange(200.0))


def proposed(*channels):
    log = Log(*channels)
    return propose(log, log.listed())


def test_a_log_with_units_is_proposed_whole() -> None:
    found = proposed(
        ("Ground Speed", "km/h", 70 + WAVE),
        ("Vel Lat", "km/h", WAVE),
        ("Yaw Rate", "deg/s", 20 * WAVE),
        ("RoadWheelAngle", "deg", 5 * WAVE),
        ("Lateral Acceleration", "g", WAVE),
    )
    assert found.unsure() == ()
    signals = found.signals()
    assert signals["v_y"].channel == ("Vel Lat",) and signals["v_y"].unit == "km/h"
    assert set(signals) == {"v_x", "v_y", "r", "delta_f", "a_y"}


def test_units_at_the_end_of_names_hide_no_signal() -> None:
    found = proposed(
        ("vehicle_speed_mps", "m/s", 20 + WAVE),
        ("vy_mps", "m/s", WAVE),
        ("yaw_rate_radps", "rad/s", 0.3 * WAVE),
        ("road_wheel_angle_rad", "rad", 0.1 * WAVE),
        ("lat_accel_mps2", "m/s^2", WAVE),
    )
    assert found.unsure() == ()
    assert {one.channel[0].split("_")[0] for one in found.signals().values()} == {
        *("vehicle", "vy", "yaw", "road", "lat"),
    }


def test_of_two_that_are_equal_none_is_taken() -> None:
    found = proposed(("GPS Speed", "km/h", WAVE), ("Ground Speed", "km/h", WAVE))
    assert not found.is_sure("v_x") and "v_x" in found.unsure()
    assert {one.channel[0] for one in found.rivals["v_x"]} == {"GPS Speed", "Ground Speed"}
    better = proposed(("GPS Speed", "km/h", WAVE), ("Velocity Forward", "km/h", WAVE))
    assert better.is_sure("v_x") and better.guesses["v_x"].channel == ("Velocity Forward",)


def test_of_two_that_are_equal_the_one_with_more_samples_per_second_is_named_first() -> None:
    class Rates(Log):
        def read(self, names, run=None):
            steps = {"Ground Speed": 0.01, "GPS Speed": 0.1}
            found = super().read(names, run)
            return tuple(replace(one, t=100 * steps[one.name] * one.t) for one in found)

    for order in (("GPS Speed", "Ground Speed"), ("Ground Speed", "GPS Speed")):
        log = Rates(*((name, "km/h", WAVE) for name in order))
        found = propose(log, log.listed())
        assert not found.is_sure("v_x")
        assert [one.channel[0] for one in found.rivals["v_x"]] == ["Ground Speed", "GPS Speed"]
        assert found.guesses["v_x"].channel == ("Ground Speed",)


def test_a_unit_of_something_else_takes_a_channel_out() -> None:
    found = proposed(("Yaw Rate", "bar", WAVE), ("Gyro Z", "deg/s", WAVE))
    assert found.guesses["r"].channel == ("Gyro Z",) and found.is_sure("r")
    assert proposed(("Yaw Rate", "bar", WAVE)).guesses.get("r") is None


def test_without_a_unit_nothing_but_our_own_names_is_sure() -> None:
    assert not proposed(("Yaw Rate", "", WAVE)).is_sure("r")
    assert proposed(("Yaw Rate", "", WAVE)).guesses["r"].why == "no unit in the file"
    assert proposed(("r", "", WAVE)).is_sure("r")


def test_a_channel_that_never_changes_gives_way() -> None:
    found = proposed(("Yaw Rate", "deg/s", 0 * WAVE), ("ESP_YawRate", "deg/s", WAVE))
    assert found.guesses["r"].channel == ("ESP_YawRate",)


def test_an_angle_that_goes_farther_than_road_wheels_is_that_of_the_hand_wheel() -> None:
    far = proposed(("RoadWheelAngle", "deg", 400 * WAVE)).guesses["delta_f"]
    assert far.hand and "hand wheel" in far.why
    near = proposed(("RoadWheelAngle", "deg", 20 * WAVE)).guesses["delta_f"]
    assert not near.hand
    named = proposed(("Steering Wheel Angle", "deg", 20 * WAVE))
    assert named.guesses["delta_f"].hand and not named.is_sure("delta_f")


def test_two_wheels_of_an_axle_are_taken_together() -> None:
    found = proposed(
        ("Car.SteerAngleFL", "rad", 0.1 * WAVE),
        ("Car.SteerAngleFR", "rad", 0.1 * WAVE),
        ("FyFL", "N", WAVE),
        ("FyFR", "N", WAVE),
        ("FyRL", "N", WAVE),
        ("FyRR", "N", WAVE),
    )
    assert found.guesses["delta_f"].channel == ("Car.SteerAngleFL", "Car.SteerAngleFR")
    assert found.guesses["Fyf"].channel == ("FyFL", "FyFR")
    assert found.guesses["Fyr"].channel == ("FyRL", "FyRR")
    assert {"Fyf", "Fyr"} <= set(found.signals())


def test_sideslip_stands_in_for_lateral_velocity_where_there_is_none() -> None:
    beta = ("Schwimmwinkel", "deg", WAVE)
    assert "beta" in proposed(beta).signals() and proposed(beta).beta_stands_in
    both = proposed(beta, ("Vel Lat", "km/h", WAVE))
    assert "beta" not in both.signals() and not both.beta_stands_in


def test_a_guess_that_cannot_be_read_is_none() -> None:
    class Broken(Log):
        def read(self, names, run=None):
            from models.logs.log import RecordingError

            if "Yaw Rate" in names:
                raise RecordingError("a cell of it is no number")
            return super().read(names, run)

    log = Broken(("Yaw Rate", "deg/s", WAVE), ("Vel Lat", "km/h", WAVE))
    found = propose(log, log.listed())
    assert "r" not in found.guesses and found.is_sure("v_y")
    assert isinstance(found.guesses["v_y"], Guess)
