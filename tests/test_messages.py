"""What is refused, one example of each rule: the class of the error, and what its line names."""

import math
import pathlib
from dataclasses import replace

import numpy as np
import pytest

import tireid as ti
from identifier.export.compiled import CompiledPackage, PackageFileError
from identifier.export.fmu import export_fmu
from identifier.export.specialize import specialize
from identifier.methods import make_method
from identifier.run import OnlineIdentifier
from models.faults import FaultError, SensorFault
from models.friction import Friction, FrictionChange, FrictionError
from models.maneuvers import ManeuverError, SampledSteer, Slalom, StepSteer
from models.plant import Driver, Plant, PlantError, StepwisePlant
from models.recordings import LogMap, RecordingError, Repair, read_recording
from models.recordings.wheels import Wheels
from models.rules import require_kind
from models.schema import require_few
from models.sensors import Sensor, SensorError
from models.tires import DugoffTire, FialaTire, LinearTire, MagicFormula
from models.vehicle import VehicleError, sedan
from mpc.handover.judge import Judge
from mpc.loop.lateral import LateralVelocity
from mpc.loop.sensing import CarSensors
from mpc.path import (
    Path,
    PathError,
    SpeedProfile,
    constant_radius,
    iso_3888_1,
    iso_3888_2,
    slalom,
)
from mpc.path.courses import Straight
from mpc.path.gates import Gate, line_through_gates
from mpc.path.line import line_from_heading
from mpc.problem import Problem
from mpc.realtime import Guards, Tracker
from mpc.tires import prediction_tire

CAR = sedan()
CHASSIS = CAR.require_chassis()
STEER = {"amplitude": 0.1, "onset": 1.0, "rate_limit": 0.7, "duration": 12.0}
STEP = StepSteer(**STEER)
LOG = Plant(CAR).simulate(STEP, speed=20.0).recording()
SAMPLED = {"times": (1.0, 1.5, 2.5), "angles": (0.0, 0.1, 0.0), "rate_limit": 0.4, "duration": 4.0}
FAULT = {"channel": "r", "kind": "zero", "start": 0.0, "duration": 1.0}
GATE = {"start": 0.0, "end": 1.0, "right": 0.0, "left": 1.0}
WALL = (
    Gate(start=10.0, end=30.0, right=5.0, left=8.0),
    Gate(start=20.0, end=40.0, right=-8.0, left=-5.0),
)
LINE = Path.from_waypoints([0.0, 50.0], [0.0, 0.0])


def half(**where):
    return FrictionChange(scale=0.5, **where)


def plant(steer=STEP, **change):
    return Plant(CAR).simulate(steer, **{"speed": 20.0} | change)


def points(X, Y, **options):
    return Path.from_waypoints(X, Y, **options)


def tracker(**change):
    return Tracker(prediction_tire(CAR), Problem(dt=0.05), **change)


def drive(speeds=15.0, **how):
    return ti.drive(ti.paths.iso_3888_2(), CAR, speeds=speeds, **how)


def columns(**change):
    t = 0.01 * np.arange(100)
    zero = np.zeros(100)
    return {"t": t, "vx": zero + 9.0, "vy": zero, "r": zero, "delta_f": zero} | change


REFUSED = {
    VehicleError: [
        (lambda: replace(CAR, chassis=replace(CHASSIS, roll_stiffness=1.0)), "roll_stiffness"),
        (lambda: Plant(replace(CAR, chassis=None)), "chassis"),
        (lambda: Plant(replace(CAR, chassis=replace(CHASSIS, tire=None))), "tire"),
    ],
    ManeuverError: [
        (lambda: Slalom(**STEER, frequency=2.0), "rate_limit"),
        (lambda: SampledSteer(**SAMPLED | {"rate_limit": 0.19}), "more than rate_limit"),
        (lambda: SampledSteer(**SAMPLED | {"times": (1.0, 1.0, 2.0)}), "times must rise"),
        (lambda: SampledSteer(**SAMPLED | {"times": (-1.0, 1.0, 2.0)}), "times must rise"),
        (lambda: SampledSteer(**SAMPLED | {"angles": (0.1, 0.1, 0.0)}), "first angle must be 0"),
        (lambda: SampledSteer(**SAMPLED | {"angles": (0.0, 0.0)}), "finite pairs"),
        (lambda: SampledSteer(**SAMPLED | {"angles": (0.0, math.nan, 0.0)}), "finite pairs"),
        (lambda: SampledSteer(**SAMPLED | {"duration": 0.0}), "duration must be positive"),
    ],
    FrictionError: [
        (lambda: Friction(scale=math.nan), "scale"),
        (half, "exactly one"),
        (lambda: Friction(changes=(half(at_time=1.0), half(at_place=9.0))), "all over time"),
        (lambda: Friction(changes=(half(at_time=1.0, width=2.0), half(at_time=2.0))), "is over"),
        (lambda: Friction(changes=tuple(half(at_place=k) for k in range(5))), "at most 4"),
    ],
    PlantError: [
        (lambda: plant(replace(STEP, duration=60.0), dt=0.1, sample_time=0.1), "not finite")
    ],
    FaultError: [
        (lambda: SensorFault(**FAULT | {"start": math.inf}), "start must be"),
        (lambda: SensorFault(**FAULT | {"duration": 0.0}), "duration positive"),
        (lambda: SensorFault(**FAULT | {"size": math.nan}), "size must be finite"),
    ],
    SensorError: [(lambda: CarSensors(r=Sensor(delay=0.01)), "belongs to the loop")],
    RecordingError: [
        (lambda: Repair(factor={"v_z": 1.0}), "factor must be of v_x"),
        (lambda: Repair(factor={"v_y": 0.0}), "must not be 0"),
        (lambda: Repair(offset={"v_y": np.nan}), "offset.v_y must be finite"),
        (lambda: Repair(delay={"v_y": np.inf}), "delay.v_y must be finite"),
        (lambda: Repair(lag={"v_y": -0.1}), "lag.v_y must be positive"),
        (lambda: Repair(vehicle={"wheelbase": 2.7}), "vehicle must be of mass"),
        (lambda: Repair(velocity_sensor_x=np.nan), "velocity_sensor_x must be finite"),
        (lambda: Repair(offset={"v_y": 0.1}).then(Repair(sideslip=True)), "sideslip angle"),
        (lambda: read_recording(columns(vy=np.zeros(99))), "columns must have one length"),
        (lambda: read_recording(columns(vy=np.zeros((100, 1)))), "one axis"),
        (lambda: read_recording(columns(vx=np.full(100, np.nan))), "must be finite"),
        (lambda: read_recording(columns(vx=["1"] * 100)), "must be numeric"),
        (lambda: read_recording(columns(vx=np.ones(100, bool))), "vx must be numeric.* bool"),
        (lambda: read_recording(columns(t=columns()["t"][::-1])), "must increase"),
        (lambda: read_recording(columns(t=1e4 * np.arange(100))), r'"t": "t \[us\]"\}'),
        (lambda: read_recording(columns(vx=[9.0] * 99 + [[1.0, 2.0]])), "rows are of several"),
        (
            lambda: read_recording(columns(vx=np.ma.masked_equal(columns()["t"], 0.05))),
            "position 5",
        ),
        (lambda: read_recording([1.0, 2.0]), "a data frame or a mapping"),
        (lambda: Wheels(radius=(0.3, math.nan)), "wheels: radius must lie between 0.01 and 2"),
        (lambda: Wheels(radius=(0.3, 0.3, 0.3)), "one per axle or one per wheel, not 3 numbers"),
        (lambda: Wheels(track=(-1.5,)), "wheels: track must lie between"),
        (lambda: Wheels(track=(1.5, 1.5, 1.5)), "wheels: track must be one number or one per axle"),
        (lambda: LogMap(holes="fill"), "holes must be refuse or cut, not 'fill'"),
        (lambda: LogMap(order="sort"), "order must be refuse or mend, not 'sort'"),
        (lambda: Wheels(wheelbase=0.0), "wheels: wheelbase must lie between"),
        (lambda: Wheels(acceleration=math.inf), "wheels: acceleration must lie between"),
        (lambda: read_recording(columns(), dt="0.01"), "dt must be positive, it is '0.01'"),
        (lambda: read_recording(columns(), columns=["r"]), "columns must be a mapping"),
    ],
    PathError: [
        (lambda: constant_radius(radius=np.inf), "radius must be positive"),
        (lambda: constant_radius(radius=30.0, turns=0.0), "radius must be positive"),
        (lambda: Gate(**GATE | {"end": -1.0}), "start before its end"),
        (lambda: Gate(**GATE | {"end": np.inf}), "start before its end"),
        (lambda: Gate(**GATE | {"left": np.nan}), "right of a gate"),
        (lambda: iso_3888_1(car_width=18.0), "car_width must be"),
        (lambda: iso_3888_2(car_width=np.nan), "car_width must be"),
        (lambda: slalom(gap=1.0), "5 m between"),
        (
            lambda: line_through_gates(
                WALL, start=(0.0, 0.0), end=(50.0, 0.0), clearance=1.0, easing=5.0
            ),
            "nothing is free at x = 20 m",
        ),
        (lambda: Straight(length=np.nan), "length of a straight"),
        (lambda: line_from_heading(np.zeros(7), np.zeros(7), 1.0), r"4 n \+ 1 samples"),
        (lambda: LINE.project(0.0, np.inf, 1.0), "cannot project"),
        (lambda: replace(LINE, closed=True), "must end as it starts"),
        (lambda: Path.from_csv("absent.csv"), "absent.csv: there is no such"),
        (lambda: points([0.0, 1.0], [0.0]), r"\(2,\) and \(1,\)"),
        (lambda: points([0.0, 10.0, np.nan], [0.0] * 3), "number 3 is"),
        (lambda: points([0.0, 9.0, 9.0, 20.0], [0.0, 1.0, 1.0, 2.0]), "numbers 2 and 3 are both"),
        (lambda: points([0.0], [0.0]), "at least 2 different way-points, it has 1"),
        (lambda: points([0.0, 9.0, 9.0, 0.0], [0.0, 0.0, 9.0, 0.0], closed=True), "at least 4"),
        (lambda: points([0.0, 10.0, 0.0], [0.0, 0.0, 0.1]), "tighter than 3 m, at s = "),
        (lambda: points([0.0, 20.0, 40.0], [0.0, 5.0, 0.0], minimum_radius=500.0), "than 500"),
        (lambda: points([0.0, 20.0], [0.0, 5.0], minimum_radius=np.nan), "minimum_radius"),
        (lambda: points([0.0, 20.0], [0.0, 5.0], spacing=0.0), "way-points: spacing must be"),
        (lambda: points([0.0, 20.0], [0.0, 5.0], spacing=15.0), "quarter of the length"),
    ],
    PackageFileError: [(lambda: CompiledPackage.from_folder(pathlib.Path()), "no package")],
    TypeError: [
        (lambda: require_kind(str, "as of input", name=3), r"^name must be a str, as of input"),
        (lambda: ti.identify("log.csv", CAR), "recording must be a Recording, as of read_rec"),
        (lambda: ti.identify(LOG, "car"), "vehicle must be a Vehicle, as of Vehicle.from_"),
        (lambda: ti.identify(LOG, CAR, 3), r"method must be a Method, as of make_method\("),
        (lambda: ti.replay(LOG, CAR), "tire must be a TireModel, as of Run.tire"),
    ],
    ValueError: [
        (lambda: plant(sample_time=0.0105), "multiple"),
        (lambda: plant(dt=-0.01, sample_time=-0.01), "multiple"),
        (lambda: plant(dt=-0.002, sample_time=-0.01), "multiple"),
        (lambda: plant(speed=0.0), "positive at the start"),
        (lambda: plant(speed=math.nan), "finite"),
        (lambda: plant(bank=math.nan), "bank must be finite"),
        (lambda: Driver(gain=math.nan), "gain"),
        (lambda: StepwisePlant(Plant(CAR), period=0.0105), "multiple of dt"),
        (lambda: StepwisePlant(Plant(CAR)).start(0.0), "v_x must be positive"),
        (lambda: require_few(ValueError, "--laps", math.nan, "runs", "laps"), "here are nan"),
        (lambda: MagicFormula.from_tir(CHASSIS.tire).mounted("middle"), "'middle'"),
        (lambda: LinearTire(C_alpha=0.0, C_kappa=1.0), "C_alpha must be positive"),
        (lambda: DugoffTire(C_alpha=1.0, C_kappa=math.nan, friction=1.0), "C_kappa must be"),
        (lambda: FialaTire(C_alpha=1.0, C_kappa=1.0, friction=-1.0), "friction must be positive"),
        (
            lambda: export_fmu(specialize(make_method("integral", CAR), CAR), "one.fmu", 1),
            "version must be 2 or 3, it is 1",
        ),
        (lambda: Judge(0.1), "three samples"),
        (
            lambda: LateralVelocity(OnlineIdentifier(make_method("axle", CAR), CAR, 0.01)),
            "AxleIdentifier estimates no v_y",
        ),
        (lambda: SpeedProfile(LINE, np.inf), "positive and finite"),
        (lambda: SpeedProfile(LINE, np.ones(3)), "broadcast"),
        (lambda: tracker(period=0.06), "period must be"),
        (lambda: tracker(delay=-0.01), "delay must be"),
        (lambda: tracker(delay=0.5), "delay must be"),
        (lambda: tracker(tolerance=0.0), "tolerance must be"),
        (lambda: tracker(max_iterations=0), "max_iterations must be"),
        (lambda: tracker(linearizations=0), "linearizations must be"),
        (lambda: Guards(e_y=0.0), "e_y must be"),
        (lambda: Guards(min_speed=np.nan), "min_speed must be"),
        (lambda: Guards(hold_time=-0.1), "hold_time must not be"),
        (lambda: Guards(fall_back_e_y=0.0), "fall_back_e_y must be"),
        (lambda: drive(delay=0.015), "delay must be 0 to 100 ms"),
        (lambda: drive(speeds=0.0), "speeds in m/s, or a profile of speed_profile, must lie"),
        (lambda: drive(friction=9.0), "friction must lie between"),
        (lambda: drive(laps=2.0), "laps are of a closed path"),
        (lambda: drive(learning=True), "none is given"),
        (lambda: drive(speeds=None), "give speeds, such as 15.0 m/s"),
        (lambda: drive(confirm=True), "confirm goes with --speed tires, or with a share"),
        (lambda: drive(speeds=SpeedProfile(LINE, 9.0)), "speeds are of the path .*, not of ISO"),
    ],
}


@pytest.mark.parametrize(
    ("error", "call", "names"),
    [(error, *row) for error, rows in REFUSED.items() for row in rows],
    ids=lambda value: value if isinstance(value, str) else None,
)
def test_an_error_has_its_class_and_names_what_broke_which_rule(
    error, call, names, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(error, match=names):
        call()
