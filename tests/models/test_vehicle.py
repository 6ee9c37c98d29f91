"""The car as data: what is refused, what comes back from a file, and the documented sedan."""

import math
from dataclasses import replace

import numpy as np
import pytest

from identifier.frozen import vehicle_from, vehicle_numbers
from models.tires import MagicFormula
from models.vehicle import _OF_CHASSIS, GRAVITY, Vehicle, VehicleError, estimate, sedan
from tests.refused import line_about

SIX = """mass = 1500
yaw_inertia = 2500.0
l_f = 1.1
l_r = 1.6
cornering_stiffness_front = 1.2e5
cornering_stiffness_rear = 110000.0
"""
CHASSIS = sedan().require_chassis()
NUMBERS = ("mass", "yaw_inertia", "l_f", "l_r", "cornering_stiffness_front")


def written(tmp_path, text):
    path = tmp_path / "car.toml"
    path.write_text(text, encoding="utf-8")
    return path


def car_of(tmp_path, text):
    return Vehicle.from_toml(written(tmp_path, text))


@pytest.mark.parametrize(
    ("key", "value"),
    [
        *((key, value) for key in NUMBERS for value in (0.0, -1.0, math.nan, math.inf)),
        ("cg_height", 2.0), ("cg_height", -0.1), ("drive_front_share", 1.1),
        ("brake_front_share", math.nan), ("drag_area", 70.0), ("center_of_gravity_sd", 4.0),
        ("estimated", ("mass",)), ("roll_stiffness_front_share", 1.01),
        ("drive_front_share", -0.01), ("drive_front_share", math.nan), ("brake_front_share", 1.01),
        ("roll_center_height_front", 0.6), ("roll_camber_rear", math.nan),
        ("relaxation_length_rear", 0.0), ("roll_damping", math.nan),
    ],
)  # fmt: skip
def test_a_number_that_no_car_has_is_refused_by_name(key, value):
    both = (sedan(), CHASSIS) if key != "cg_height" else (sedan(),)
    having = [record for record in both if hasattr(record, key)]
    assert having
    for record in having:
        with pytest.raises(VehicleError, match=key):
            replace(record, **{key: value})


def test_axle_loads_balance_weight_and_pitch_moment():
    car = sedan()
    front, rear = car.axle_loads
    assert front + rear == pytest.approx(car.mass * GRAVITY, rel=1e-15)
    assert front * car.l_f == pytest.approx(rear * car.l_r, rel=1e-15)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (SIX + "masss = 1.0\n", "masss is unknown"),
        (SIX.replace("mass = 1500\n", ""), "mass is missing"),
        ("[vehicle]\n" + SIX, "vehicle is unknown, known are name, mass"),
        (SIX.replace("1500", '"1500"'), "mass must be a number"),
        (SIX.replace("1500", "nan"), "mass must be positive"),
        (SIX + "chassis = 3\n", "chassis must be a table"),
        (SIX + "[chassis]\ntrack = 1.5\n", "chassis.track is unknown"),
        (SIX + "[chassis]\ncg_height = -0.5\n", "cg_height must be positive"),
        (SIX + "[chassis]\nroll_stiffness = 100.0\n", "roll_stiffness must exceed"),
        (SIX + "[chassis]\nestimated = []\n", "chassis.estimated is unknown"),
        ("mass = -1\nl_f = 1\nl_r = 1\n", "mass must be positive"),
        ("mass = 1e308\nl_f = 1\nl_r = 1\n", "mass must lie between"),
        ("mass = 1500\nl_f = nan\nl_r = 1\n", "l_f must be positive"),
        ("mass = 1500\nl_f = 1\n", "l_r is missing"),
        ("mass = 1500\nl_f = 1\nl_r = 1\nestimated = []\n", "estimated is unknown"),
    ],
)
def test_a_wrong_file_is_one_line_with_file_key_and_rule(tmp_path, text, said):
    message = line_about(written(tmp_path, text), VehicleError, Vehicle.from_toml)
    assert message.startswith(": ") and said in message


def test_a_vehicle_comes_back_from_its_file_bit_for_bit(tmp_path, rng):
    for number in range(20):
        scale = 1.0 + 0.3 * rng.random(3)
        chassis = replace(CHASSIS, roll_damping=6000.0 * scale[1] ** 17)
        name = 'a "quoted" \\ name with\ttab, ü and \x7f'
        car = replace(
            sedan(), name=name, mass=1000.0 * scale[0] / 3.0, l_f=scale[2], chassis=chassis,
            downforce_area_front=0.9, downforce_area_rear=-0.2 * scale[0], drag_area=0.66,
        )  # fmt: skip
        path = tmp_path / f"car{number}.toml"
        car.to_toml(path)
        assert Vehicle.from_toml(path) == car


def test_the_tire_is_found_from_the_folder_of_the_vehicle_file(tmp_path):
    (tmp_path / "sub").mkdir()
    moved = replace(sedan(), chassis=replace(CHASSIS, tire=tmp_path / "tires" / "t.tir"))
    moved.to_toml(tmp_path / "sub" / "car.toml")
    assert '"../tires/t.tir"' in (tmp_path / "sub" / "car.toml").read_text()


def test_a_car_on_the_built_in_tire_moves_to_another_folder_and_a_tire_that_lies_there_is_taken(
    tmp_path,
):
    sedan().to_toml(tmp_path / "car.toml")
    (tmp_path / "elsewhere").mkdir()
    moved = (tmp_path / "car.toml").rename(tmp_path / "elsewhere" / "car.toml")
    assert Vehicle.from_toml(moved) == sedan()
    own = moved.with_name("sedan.tir")
    own.write_bytes(CHASSIS.tire.read_bytes())
    assert Vehicle.from_toml(moved).chassis.tire == own.resolve()
    sedan().to_toml(moved, overwrite=True)  # names the built-in one, not that beside it
    assert Vehicle.from_toml(moved) == sedan()


def test_the_sedan_has_the_stiffness_of_its_tires_and_understeers():
    car = sedan()
    tire = MagicFormula.from_tir(CHASSIS.tire)
    _, _, l_f, l_r, C_f, C_r = car.bicycle
    for stiffness, load in zip((C_f, C_r), car.axle_loads, strict=True):
        assert stiffness == pytest.approx(2.0 * tire.cornering_stiffness(load / 2.0), rel=0.005)
    assert l_r * C_r > l_f * C_f


@pytest.mark.parametrize(
    ("key", "factor"),
    [
        ("yaw_inertia", 1e-3), ("mass", 1e-3), ("cornering_stiffness_front", 1e-3),
        ("cornering_stiffness_rear", 1 / 57.3), ("cornering_stiffness_rear", 100.0),
    ],
)  # fmt: skip
def test_a_value_in_another_unit_is_refused(key, factor):
    car = sedan()
    with pytest.raises(VehicleError, match="check the units"):
        replace(car, **{key: factor * getattr(car, key)})


def test_what_a_file_leaves_out_is_estimated_and_said(tmp_path):
    text = "\n".join(line for line in SIX.splitlines() if "rear" not in line and "yaw" not in line)
    car = car_of(tmp_path, text)
    assert car.estimated == ("yaw_inertia", "cornering_stiffness_rear")
    assert car.cornering_stiffness_front == 1.2e5
    assert car.yaw_inertia == 1500.0 * (1.1 * 1.6)
    assert car.cornering_stiffness_rear == pytest.approx(14.0 * 1500.0 * GRAVITY * 1.1 / 2.7)
    assert "yaw_inertia = 2640 kg m²" in car.estimates
    assert "rear = 8.393e+04 N/rad (14 static axle loads per rad)" in car.estimates
    assert "stiffness_front" not in car.estimates
    assert car_of(tmp_path, SIX).estimates == ""
    made = Vehicle(name=car.name, mass=1500.0, l_f=1.1, l_r=1.6, cornering_stiffness_front=1.2e5)
    assert made == car and made.estimates == car.estimates


@pytest.mark.parametrize(("l_f", "l_r", "share"), [(0.0805, 0.093, 0.5), (1.2, 1.5, 1.0)])
def test_a_model_car_has_less_inertia_for_its_size(l_f, l_r, share):
    assert estimate(3.0, l_f, l_r)["yaw_inertia"] == pytest.approx(share * 3.0 * l_f * l_r)


def test_estimates_stay_estimates_in_files_and_models(tmp_path):
    plain = "mass = 1500\nl_f = 1.1\nl_r = 1.6\n"
    car = car_of(tmp_path, plain)
    car.to_toml(tmp_path / "again.toml")
    again = Vehicle.from_toml(tmp_path / "again.toml")
    assert again == car
    assert again.estimated == car.estimated == vehicle_from(vehicle_numbers(car)).estimated
    told = replace(car, estimated=())
    assert told == car
    assert "estimated" not in vehicle_numbers(told)


def test_downforce_adds_to_the_static_load_and_comes_back_from_files(tmp_path):
    text = SIX + "downforce_area_front = 0.9\ndownforce_area_rear = -0.2\n"
    car = car_of(tmp_path, text)
    loads = np.array(car.axle_loads)
    expected = 1.0 + 0.5 * 1.2 * np.array([0.9, -0.2]) * 50.0**2 / loads
    np.testing.assert_allclose(car.load_ratio(50.0), expected, rtol=1e-12)
    assert car.load_ratio(np.full((3, 4), 7.0)).shape == (3, 4, 2)
    assert vehicle_from(vehicle_numbers(car)) == replace(car, chassis=None)
    assert car.has_downforce


def test_a_car_without_downforce_has_the_files_that_it_had(tmp_path):
    car = car_of(tmp_path, SIX)
    assert not car.has_downforce
    np.testing.assert_array_equal(car.load_ratio(80.0), 1.0)
    assert list(vehicle_numbers(car)) == ["name", *(line.split()[0] for line in SIX.splitlines())]
    car.to_toml(tmp_path / "again.toml")
    assert "downforce" not in (tmp_path / "again.toml").read_text()
    again = car_of(tmp_path, SIX + "downforce_area_front = 0\n")
    assert vehicle_numbers(again) == vehicle_numbers(car)


TOLD = "cg_height = 0.5\ndrive_front_share = 0\nbrake_front_share = 0.7\ndrag_area = 0.66\n"


def test_what_braking_wants_to_know_comes_back_from_files(tmp_path):
    car = car_of(tmp_path, SIX + TOLD)
    assert (car.cg_height, car.drive_front_share, car.brake_front_share) == (0.5, 0.0, 0.7)
    assert car.drag == pytest.approx(0.5 * 1.2 * 0.66 / 1500.0)
    car.to_toml(tmp_path / "again.toml")
    assert Vehicle.from_toml(tmp_path / "again.toml") == car == vehicle_from(vehicle_numbers(car))
    plain = car_of(tmp_path, SIX)
    assert [plain.lengthwise(name) for name in _OF_CHASSIS] == [None] * 3
    assert plain.drag == pytest.approx(0.5 * 1.2 * 0.7 / 1500.0)


def test_what_a_chassis_leaves_out_is_typical_of_the_size_of_the_car(tmp_path):
    """The rules agree with the built-in sedan to a fifth; what is stated stays."""
    car = replace(sedan(), chassis=None, cg_height=0.55).with_chassis()
    c = car.require_chassis()
    for one in c.estimated:
        assert getattr(c, one) == pytest.approx(getattr(CHASSIS, one), rel=0.2), one
        assert f"{one} = " in car.assumed
    written(tmp_path, SIX + "[chassis]\ntrack_front = 1.9\n").replace(tmp_path / "part.toml")
    part = Vehicle.from_toml(tmp_path / "part.toml")
    inner = part.require_chassis()
    assert inner.track_front == 1.9 and "track_front" not in inner.estimated
    assert part.lengthwise("cg_height") is None, "nobody declared it"
    part.to_toml(tmp_path / "again.toml")
    again = Vehicle.from_toml(tmp_path / "again.toml")
    assert again == part and again.require_chassis().estimated == inner.estimated
