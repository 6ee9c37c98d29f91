"""What a channel is called by which logger, and what is proposed of it."""

from dataclasses import replace

import numpy as np
import pytest

from models.logs.log import Channel, Listed
from models.logs.names import (
    _HAND,
    _RULES,
    SURE,
    Guess,
    _name_confidence,
    _words_of,
    is_commanded,
    propose,
)
from models.logs.signals import NEEDED
from models.logs.spelling import unit_in_name, without_units


def names_of(some):
    """The names in a text, which stand apart by commas."""
    return [name.strip() for name in some.split(",")]


CALLED = {  # names apart by commas
    "v_x": """
vx, VelForward, Vel_Longitudinal, Car.vx, /odom/twist.twist.linear.x, v_lon, Velocity_X,
WheelBasedVehicleSpeed, carState.vEgo, vxCG, VelLong, Geschw, Längsgeschw.,
Fahrzeuggeschwindigkeit, Vitesse, vitesse_longitudinale, Velocità longitudinale, Velocidad,
Längsgeschwindigkeit, Ground Speed, /vehicle/status/velocity_status/longitudinal_velocity,
Ux, chassis_velocities.longitudinal, SpeedVeh, ESP_v_Signal
""",
    "v_y": """
vy, Vel Lat, LatVel, VelLateral, Car.vy, /odom/twist.twist.linear.y, Correvit.VelTrans,
VelTrans, Quergeschw, v_transversal, Transverse Velocity, vyCG, vitesse latérale,
Velocità trasversale, velocidad_lateral, v_lat, Quergeschwindigkeit, Uy,
chassis_velocities.lateral, lateral_velocity, Correvit_vQuer
""",
    "beta": """
beta, Schwimmwinkel, Slip_Angle, SideSlipAngle, Car.SideSlipAngle, sideSlip,
angle de dérive caisse, Slip_COG
""",
    "r": """
r, Car.YawRate, Yaw_Rate, Gyro Z, AngRateZ, Gierrate, Giergeschwindigkeit,
/imu/angular_velocity.z, psi_dot, YAW_RATE, ESP_YawRate, Gyro Yaw Velocity, AVz,
chassis_velocities.yaw, Gyr_Z, Gyroscope z (rad/s), VehYaw_W_Actl, carState.yawRate,
livePose.angularVelocityDevice.z, Ist-Gierrate, Vitesse de lacet, Velocità di imbardata,
velocidad_guiñada, omega, Angular Velocity
""",
    "delta_f": """
delta_f, RoadWheelAngle, /ackermann_cmd/drive.steering_angle, /drive/drive.steering_angle,
/vehicle/status/steering_status/steering_tire_angle, Radlenkwinkel, roadwheelAngle,
Delta_Wheel
""",
    _HAND: """
Steering Angle, SteerAngle, Steered Angle, SWA, Steering_Wheel_Angle, Lenkradwinkel,
SAS_Angle, LWS_Angle, Steer.WhlAng, HandwheelAngle, handwheelAngle, carState.steeringAngle,
/steering_angle/data, Angle volant, Angolo volante, ángulo_volante, delta_h, Steering Pos,
Steer_SW, SAS_SteerAgl, swAngle, StWhl_Angl
""",
    "a_y": """
ay, G Force Lat, LateralAcc, GPS LatAcc, Acc_Y, Querbeschleunigung, Querbeschl, ayCG,
Accélération transversale, Accelerazione laterale, aceleración lateral, Car.ay,
/imu/linear_acceleration.y, AccelLateral, Accel Y, alHori, LATERALG,
chassis_accelerations.lateral, ALAT
""",
    "a_x": """
ax, Longitudinal Acceleration, Längsbeschl, axCG, accélération longitudinale, G Force Long,
Acc_X, /imu/linear_acceleration.x, AccelForward, LongAcc
""",
    "delta_r": "delta_r, RearSteerAngle",
    "Fyf": "Fyf, Fy_front",
    "Fyr": "Fyr, Fy_rear",
}
NO_SIGNAL = names_of("""
Engine RPM, Wheel Speed FL, Brake Pressure, Yaw Rate Target, Roll Rate,
Steering Wheel Torque, Throttle, /imu/orientation.z, /odom/twist.covariance[0], Fuel Level,
Gear, GPS Latitude, Steering Wheel Speed, vy_std, carState.aEgo, Vertikalbeschl, Acc_Z,
Accelerator Pedal, Soll-Längsbeschl, GPS Longitude, Sollquerbeschl, Querbeschl_Soll,
Gierrate Sollwert, actuators.steeringAngle, carState.cruiseState.speed, steeringRate,
/steering_cmd/data, /target_steering_angle/data, HA_Lenkwinkel, Lenkradmoment,
Lenkradwinkelgeschw, Gierbeschleunigung, Raddrehzahl VL, vitesse_roue_FL,
Lateral Wind Speed, Yaw Rate Setpoint, couple volant, Motordrehzahl, engine_omega, omega_fl,
consigne de vitesse, radar.LateralVelocity, Obj01_vLat, lead.vRel, DAS_setSpeed,
KBI_angez_Geschw, SAS_Speed, Seitenwind, local_ang_vel_y, motor_omega, Steer_L1, Steer_R1,
LWI_VZ_Lenkradwinkel, ESP_VZ_Gierrate, yaw_rate_sign,
/drive/drive.speed, /drive/speed, /car/ackermann_cmd/drive.speed, /cmd_vel/linear.x,
/cmd_vel/angular.z
""")


def each_of(called):
    """Run a test for every name with its signal."""
    told = [(s, n) for s, some in called.items() for n in names_of(some)]
    return pytest.mark.parametrize(("signal", "name"), told)


@each_of(CALLED)
def test_a_name_of_a_logger_is_that_signal_before_any_other(signal, name):
    found = {one: _name_confidence(one, name) for one in _RULES}
    assert found[signal] >= SURE
    assert all(value < found[signal] for one, value in found.items() if one != signal)


@pytest.mark.parametrize("name", NO_SIGNAL)
def test_a_name_of_something_else_is_no_signal(name):
    assert not any(_name_confidence(one, name) for one in _RULES)


def test_names_are_cut_into_words():
    assert _words_of("Car.YawRate") == ("car", "yaw", "rate")
    assert _words_of("IMU01_gyro_z [deg/s]") == ("imu", "01", "gyro", "z")
    assert _words_of("Längsgeschw.") == ("laengsgeschw",)
    assert _words_of("Accélération") == ("acceleration",)
    assert _words_of("LÄNGS") == _words_of("LA\u0308NGS") == ("laengs",)


class Log:
    """Channels in memory, each with a unit: name, unit, values."""

    def __init__(self, *channels):
        self.channels = {name: (unit, np.asarray(values)) for name, unit, values in channels}

    def listed(self):
        return tuple(
            Listed(name, unit, values.size, 100.0) for name, (unit, values) in self.channels.items()
        )

    def runs(self):
        return ()

    def read(self, names, run=None):
        return tuple(
            Channel(
                name=name,
                unit=unit,
                t=0.01 * np.arange(values.size),
                values=values,
                place="sample",
                rows=np.arange(values.size),
            )
            for name in names
            for unit, values in [self.channels[name]]
        )


WAVE = np.sin(np.arange(200.0))


def proposed(*channels):
    log = Log(*channels)
    return propose(log, log.listed())


def taken(found, signal):
    """The channel of a guess, or its channels."""
    return "+".join(found.guesses[signal].channel)


def test_a_log_with_units_is_proposed_whole():
    found = proposed(
        ("Ground Speed", "km/h", 70 + WAVE),
        ("Vel Lat", "km/h", WAVE),
        ("Yaw Rate", "deg/s", 20 * WAVE),
        ("RoadWheelAngle", "deg", 5 * WAVE),
        ("Lateral Acceleration", "g", WAVE),
    )
    assert all(map(found.is_sure, NEEDED))
    signals = found.signals()
    assert signals["v_y"].channel == ("Vel Lat",) and signals["v_y"].unit == "km/h"
    assert set(signals) == {"v_x", "v_y", "r", "delta_f", "a_y"}


def test_of_two_that_are_equal_none_is_taken():
    found = proposed(("GPS Speed", "km/h", WAVE), ("Ground Speed", "km/h", WAVE))
    assert not found.is_sure("v_x")
    assert {one.channel[0] for one in found.rivals["v_x"]} == {"GPS Speed", "Ground Speed"}
    better = proposed(("GPS Speed", "km/h", WAVE), ("Velocity Forward", "km/h", WAVE))
    assert better.is_sure("v_x") and taken(better, "v_x") == "Velocity Forward"


def test_of_two_that_are_equal_the_one_with_more_samples_per_second_is_named_first():
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
        assert taken(found, "v_x") == "Ground Speed"


def test_a_unit_of_something_else_takes_a_channel_out():
    found = proposed(("Yaw Rate", "bar", WAVE), ("Gyro Z", "deg/s", WAVE))
    assert taken(found, "r") == "Gyro Z" and found.is_sure("r")
    assert proposed(("Yaw Rate", "bar", WAVE)).guesses.get("r") is None


def test_without_a_unit_nothing_but_our_own_names_is_sure():
    assert not proposed(("Yaw Rate", "", WAVE)).is_sure("r")
    assert proposed(("Yaw Rate", "", WAVE)).guesses["r"].why == "no unit in the file"
    assert proposed(("r", "", WAVE)).is_sure("r")


def test_a_channel_that_never_changes_gives_way():
    found = proposed(("Yaw Rate", "deg/s", 0 * WAVE), ("ESP_YawRate", "deg/s", WAVE))
    assert taken(found, "r") == "ESP_YawRate"


def test_an_angle_that_goes_farther_than_road_wheels_is_that_of_the_hand_wheel():
    far = proposed(("RoadWheelAngle", "deg", 400 * WAVE)).guesses["delta_f"]
    assert far.hand and "hand wheel" in far.why
    near = proposed(("RoadWheelAngle", "deg", 20 * WAVE)).guesses["delta_f"]
    assert not near.hand
    named = proposed(("Steering Wheel Angle", "deg", 20 * WAVE))
    assert named.guesses["delta_f"].hand and not named.is_sure("delta_f")


@pytest.mark.parametrize("name", ["delta", "delta_f", "Front Steering Angle"])
def test_an_angle_that_turns_too_far_for_the_bend_is_that_of_the_hand_wheel(name):
    """v_x δ / r of road wheels is the wheelbase and the understeer of 20 m/s: 4 m."""
    car = (("Speed", "m/s", 20.0 + WAVE), ("Yaw Rate", "rad/s", 0.3 * WAVE))
    assert proposed(*car, (name, "deg", 3.5 * WAVE)).is_sure("delta_f")
    far = proposed(*car, (name, "deg", 50.0 * WAVE))
    assert far.guesses["delta_f"].hand and not far.is_sure("delta_f")


def test_two_wheels_of_an_axle_are_taken_together():
    found = proposed(
        ("Car.SteerAngleFL", "rad", 0.1 * WAVE), ("Car.SteerAngleFR", "rad", 0.1 * WAVE),
        ("FyFL", "N", WAVE), ("FyFR", "N", WAVE), ("FyRL", "N", WAVE), ("FyRR", "N", WAVE),
    )  # fmt: skip
    assert taken(found, "delta_f") == "Car.SteerAngleFL+Car.SteerAngleFR"
    assert taken(found, "Fyf") == "FyFL+FyFR"
    assert taken(found, "Fyr") == "FyRL+FyRR"
    assert {"Fyf", "Fyr"} <= set(found.signals())


def test_sideslip_stands_in_for_lateral_velocity_where_there_is_none():
    beta = ("Schwimmwinkel", "deg", WAVE)
    assert "beta" in proposed(beta).signals()
    both = proposed(beta, ("Vel Lat", "km/h", WAVE))
    assert "beta" not in both.signals()


def test_a_guess_that_cannot_be_read_is_none():
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


@pytest.mark.parametrize(
    ("name", "bare", "unit"),
    [
        ("carState.steeringAngleDeg", "carState.steeringAngle", "deg"),
        ("SpeedKph", "Speed", "km/h"),
        ("ACC_LAT_MPS2", "ACC_LAT", "m/s^2"),
        ("accLatMps2", "accLat", "m/s^2"),
        ("yawRateRadPs", "yawRate", "rad/s"),
        ("yawRateDegPerSec", "yawRate", "deg/s"),
        ("SteerAngleRad", "SteerAngle", "rad"),
        ("speed_kmh", "speed", "km/h"),
        ("GeschwRad", "GeschwRad", ""),  # of a wheel
        ("LenkRad", "LenkRad", ""),
        ("lenk_rad", "lenk_rad", ""),
        ("MPS", "MPS", "MPS"),
        ("Speed (km/h) *OBD", "Speed", "km/h"),
        ("Yaw [deg/s] 1)", "Yaw", "deg/s"),
        ("Yaw Rate [deg/s] @100Hz", "Yaw Rate", "deg/s"),
        ("Acc Lat [g] filtered", "Acc Lat filtered", "g"),
        ("Speed [km/h] (GPS)", "Speed (GPS)", "km/h"),
        ("Sensor (A) links", "Sensor (A) links", ""),
        ("dampsDeg2", "dampsDeg2", ""),
    ],
)
def test_units_stand_at_the_end_of_names_in_any_spelling(name, bare, unit):
    assert unit_in_name(name) == unit
    assert without_units(name, unit) == (bare, "")


def test_a_unit_of_the_name_is_that_of_the_signal_where_the_format_tells_none():
    found = proposed(("yawRateDegPs", "", 20 * WAVE), ("roadwheelAngleDeg", "", 4 * WAVE))
    assert found.signals()["r"].unit == "deg/s" and found.signals()["delta_f"].unit == "deg"


@pytest.mark.parametrize(
    ("signal", "name", "size", "unit"),
    [
        ("r", "YawRate", 37.0, "deg/s"), ("r", "YawRate", 2.0, ""),
        ("v_x", "Speed", 180.0, "km/h"), ("v_x", "Speed", 60.0, ""),
        ("beta", "Slip_Angle", 9.0, "deg"), ("beta", "Slip_Angle", 0.2, ""),
        ("delta_f", "RoadWheelAngle", 12.0, "deg"), ("delta_f", "RoadWheelAngle", 0.3, ""),
        ("delta_f", "SteeringWheelAngle", 102.0, "deg"),
        ("delta_f", "SteeringWheelAngle", 6.0, ""), ("a_y", "Lat_Acc", 1.05, "g"),
        ("a_y", "Lat_Acc", 8.0, ""),
    ],
)  # fmt: skip
def test_without_a_unit_that_is_proposed_which_the_range_allows_and_none_is_sure(
    signal, name, size, unit
):
    guess = proposed((name, "", size * WAVE)).guesses[signal]
    assert guess.unit == unit and guess.confidence < SURE
    assert "no unit in the file" in guess.why
    if unit and signal != "a_y":
        assert f"goes to {size:.3g}, " in guess.why


def test_one_spike_does_not_change_a_unit():
    wave = 2.0 * np.sin(np.arange(5000.0))
    wave[7] = 400.0
    assert proposed(("YawRate", "", wave)).guesses["r"].unit == ""


@pytest.mark.parametrize("rate", ["", "deg/s"])
@pytest.mark.parametrize("lateral", ["", "g"])
def test_r_and_a_y_without_units_have_those_in_which_a_y_is_v_x_r(rate, lateral):
    r = 0.06 * np.sin(0.03 * np.arange(2000.0))  # [rad/s], on a slippery road
    a_y = 20.0 * r
    r, a_y = (np.degrees(r) if rate else r), (a_y / 9.80665 if lateral else a_y)
    speed = ("Speed", "km/h", 72.0 + 0.1 * np.cos(np.arange(2000.0)))
    found = proposed(speed, ("YawRate", "", r), ("Lat_Acc", "", a_y)).guesses
    assert (found["r"].unit, found["a_y"].unit) == (rate, lateral)
    assert found["r"].confidence < SURE and found["a_y"].confidence < SURE


def test_a_steering_that_stays_near_in_rad_is_that_of_road_wheels_if_its_name_allows():
    near = proposed(("log.steer", "", 0.107 * WAVE)).guesses["delta_f"]
    assert not near.hand and near.confidence < SURE and "as road wheels do in rad" in near.why
    far = proposed(("log.steer", "", 80.0 * WAVE)).guesses["delta_f"]
    assert far.hand and far.unit == "deg"
    named = proposed(("SteeringWheelAngle", "", 0.107 * WAVE)).guesses["delta_f"]
    assert named.hand
    told = proposed(("Steering", "rad", 0.107 * WAVE)).guesses["delta_f"]
    assert told.hand


def test_a_rate_whose_unit_is_an_angles_is_proposed_per_second():
    guess = proposed(("Yaw Rate", "deg", 20 * WAVE)).guesses["r"]
    assert guess.unit == "deg/s" and guess.confidence < SURE


def test_a_filtered_duplicate_stands_back_for_what_was_filtered():
    found = proposed(("LatAcc_filtered", "g", WAVE), ("ESP_AccLat", "g", WAVE))
    assert found.is_sure("a_y") and taken(found, "a_y") == "ESP_AccLat"
    alone = proposed(("LatAcc_filtered", "g", WAVE))
    assert alone.is_sure("a_y")


def test_a_steering_command_stands_back_for_a_measured_angle():
    command = ("/drive/drive.steering_angle", "rad", WAVE)
    found = proposed(command, ("RoadWheelAngle", "rad", WAVE))
    assert found.is_sure("delta_f") and taken(found, "delta_f") == "RoadWheelAngle"
    assert proposed(command).is_sure("delta_f")
    for name in ("/drive/drive.steering_angle", "/cmd/steering_angle", "steer_setpoint"):
        assert is_commanded(name)
    assert not is_commanded("/vehicle/status/steering_status/steering_tire_angle")


def test_a_word_and_a_unit_of_what_no_rule_knows_are_named_and_never_taken():
    named = {"v_y": ("Seitwärts", "km/h"), "beta": ("Slip", "deg"), "r": ("Yaw", "deg/s"),
             "delta_f": ("SteerXyz", "deg")}  # fmt: skip
    found = proposed(*((*one, 90 * WAVE) for one in named.values()))
    for signal, (name, _) in named.items():
        assert taken(found, signal) == name and not found.is_sure(signal)
        assert found.guesses[signal].confidence < SURE
    assert found.guesses["delta_f"].hand
    none = [("Yaw", "deg", WAVE), ("Lateral", "", WAVE), ("Lateral", "bar", WAVE),
            ("Slip FL", "deg", WAVE), ("Lateral Target", "m/s", WAVE), ("Seitenwind", "m/s", WAVE),
            ("dérive pneu", "deg", WAVE), ("Transmission", "km/h", WAVE)]  # fmt: skip
    assert not any(set(named) & set(proposed(one).guesses) for one in none)


def test_a_side_and_the_number_of_an_axle_are_a_corner():
    """CarSim's R1 is the right wheel of the front axle, and none of the rear."""
    assert _words_of("Steer_R1") == ("steer", "fr") and _words_of("Fy_L2") == ("fy", "rl")
    assert _words_of("IMU_L12") == _words_of("IMU_l12") == ("imu", "l", "12")
    found = proposed(
        *((f"Steer_{place}", "deg", 5 * WAVE) for place in ("L1", "R1")),
        *((f"Fy_{place}", "N", 2e3 * WAVE) for place in ("L1", "R1", "L2", "R2")),
        ("Steer_SW", "deg", 80 * WAVE),
    )
    assert taken(found, "delta_f") == "Steer_L1+Steer_R1"
    assert found.is_sure("delta_f") and "delta_r" not in found.guesses
    assert taken(found, "Fyf") == "Fy_L1+Fy_R1"
    assert taken(found, "Fyr") == "Fy_L2+Fy_R2"


def test_a_channel_that_is_there_in_two_units_is_one():
    speed = 70 + WAVE
    found = proposed(("SPEED_KPH", "", speed), ("SPEED_MPH", "", np.round(speed / 1.609344, 2)))
    assert found.is_sure("v_x") and "v_x" not in found.rivals
    again = proposed(("speed", "m/s", speed), ("speed (2)", "m/s", speed))
    assert again.is_sure("v_x")
    others = proposed(("SPEED_KPH", "", speed), ("SPEED_MPH", "", speed / 1.5))
    assert not others.is_sure("v_x") and len(others.rivals["v_x"]) == 2


def test_omega_is_a_yaw_rate_where_it_is_no_faster_than_a_car_turns():
    assert proposed(("omega", "rad/s", 0.5 * WAVE)).is_sure("r")
    assert "r" not in proposed(("omega", "rad/s", 60 + WAVE)).guesses


def test_a_speed_without_a_unit_is_told_by_how_the_car_turns():
    """v_x r = a_y: at 20 m/s and 0.4 rad/s 0.82 g."""
    turn = (("Gyro Z", "", 0.4 * 57.3 * WAVE), ("GForceY", "", 0.82 * WAVE))
    found = proposed(("Speed", "", 72.0 + WAVE), ("Vy", "", 3.6 * WAVE), *turn)
    told = {name: found.guesses[name].unit for name in ("v_x", "v_y", "r", "a_y")}
    assert told == {"v_x": "km/h", "v_y": "km/h", "r": "deg/s", "a_y": "g"}
    assert not any(found.is_sure(name) for name in told)
    slow = proposed(("Speed", "", 20.0 + WAVE), ("Vy", "", WAVE), *turn)
    assert slow.guesses["v_x"].unit == slow.guesses["v_y"].unit == ""


def test_a_unit_in_a_name_may_be_spelled_in_another_way_beside_it():
    assert without_units("steering_deg", "°") == ("steering", "")
    assert without_units("speed_kmh", "kph") == ("speed", "")
    assert without_units("speed_kmh", "mph") == ("speed", "km/h")
    assert without_units("VL_Rad", "km/h") == ("VL_Rad", "")


@pytest.mark.parametrize(
    ("signal", "name", "unit", "said"),
    [
        ("v_x", "speed_kph [m/s]", "m/s", "km/h"), ("r", "yaw_rate_rad", "deg/s", "rad"),
        ("delta_f", "delta_f_deg", "rad", "deg"), ("a_y", "ay_g", "m/s^2", "g"),
        ("v_x", "Speed [mph]", "km/h", "mph"),
    ],
)  # fmt: skip
def test_a_name_that_contradicts_its_unit_is_asked(signal, name, unit, said):
    found = proposed((name, unit, 0.1 * WAVE))
    assert not found.is_sure(signal)
    assert f"its name says {said}, its unit is {unit}" in found.guesses[signal].why


def test_a_unit_may_be_the_name():
    speed, turn = ("MPH", unit_in_name("MPH"), 45.0 + WAVE), ("deg/s", "deg/s", 20.0 * WAVE)
    found = proposed(speed, turn, ("fps", "", 60.0 + WAVE))
    assert found.is_sure("v_x") and found.signals()["v_x"].unit == "MPH"
    assert taken(found, "r") == "deg/s" and not found.is_sure("r")


def test_a_g_in_a_name_is_its_unit_where_turning_says_so():
    car = (("Speed", "km/h", 72.0 + WAVE), ("Gyro Z", "rad/s", 0.4 * WAVE))
    assert proposed(*car, ("G lat", "", 0.8 * WAVE)).signals()["a_y"].unit == "g"
    assert not proposed(*car, ("G lat", "", 8.0 * WAVE)).is_sure("a_y")
    assert not proposed(car[0], ("G lat", "", 0.8 * WAVE)).is_sure("a_y")


def test_the_carriers_of_carmaker_are_road_wheels():
    places = ("CFL", "CFR", "CRL", "CRR")
    found = proposed(
        *((f"Car.{place}.rz", "rad", 0.1 * WAVE) for place in places),
        ("DM.Steer.Ang", "rad", 2.0 * WAVE),
    )
    assert taken(found, "delta_f") == "Car.CFL.rz+Car.CFR.rz"
    assert found.is_sure("delta_f") and "delta_r" not in found.guesses


PUBLIC = {  # names apart by commas
    "v_x": "vCar, V_GPS, v_CG, vel_u, wheel_based_speed",
    "r": "AngRateDown, imu_gz_rps, GPS Gyro, AVz, r_imu, Gyro_Yaw, yawspeed",
    "delta_f": "StrgWhlAng, StrWhAng, StrAngle, StrgAngl, SteWhlAngl, RWA",
    "a_y": "LtrlAcc, accy_can, lat_g, LatAc",
    "a_x": "InlineAcc, LgtlAcc, LINEALG",
}
UNIT = {"v_x": "m/s", "r": "deg/s", "delta_f": "deg", "a_y": "m/s^2", "a_x": "m/s^2"}


@each_of(PUBLIC)
def test_names_of_public_logs_are_proposed(signal, name):
    unit = unit_in_name(name) or UNIT[signal]
    found = proposed((name, unit, 20.0 * WAVE))
    assert taken(found, signal) == name
    assert found.is_sure(signal) or found.guesses[signal].hand
    assert not any(found.is_sure(one) for one in _RULES if one != signal)


@pytest.mark.parametrize("name", ["EffMt_D2_R", "M_Mtr_D2_R", "Damper_R", "Batt_V", "p_Brk_R"])
def test_a_letter_behind_a_name_is_a_side_and_no_signal(name):
    assert not any(_name_confidence(one, name) for one in _RULES)
    assert _name_confidence("r", "log.r") > 0.0


def test_a_wheel_of_carsim_turns():
    found = proposed(*((f"AVy_{place}", "rpm", 600.0 + WAVE) for place in ("L1", "R1", "L2", "R2")))
    assert all(found.is_sure(one) for one in ("wheel_fl", "wheel_fr", "wheel_rl", "wheel_rr"))
    assert not found.is_sure("r") and not found.is_sure("v_y")
