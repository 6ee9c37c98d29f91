"""The verdict rings on what is planted, names it, and stays silent on a drive that is right."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import identifier.verdict
from benchmarks.random_cars import good_sensors
from identifier.estimate.method import FitMethod
from identifier.evidence import brisk_windows, clean_rms, measured_force
from identifier.measured import NOT_IDENTIFIABLE
from identifier.methods import make_method
from identifier.motion.parameters import INDEX
from identifier.prediction import predict
from identifier.run import identify
from identifier.tire_model import GRIP, STIFFNESS
from identifier.verdict import calibrated, judge, judge_prediction
from identifier.verdict.verdict import BEYOND_KNOWN
from models.friction import Friction, FrictionChange
from models.maneuvers import Slalom, StepSteer
from models.plant import Plant
from models.vehicle import sedan
from tests.identifier.conftest import missed, steered

SENSORS = good_sensors(sedan())
ONSET = 4.0  # s


@pytest.fixture(scope="module")
def whole():
    """A drive that begins straight and is steered at random then, without noise."""
    return steered(3, 24.0, amplitude=0.06, frequency=0.6, onset=ONSET).recording()


@pytest.fixture(scope="module")
def drive(whole):
    return SENSORS.apply(whole, np.random.default_rng(1))


def answer(recording, car=None):
    car = sedan() if car is None else car
    return identify(recording, car, FitMethod.for_vehicle(car, dt=recording.dt))


@pytest.fixture(scope="module")
def clean(drive):
    return answer(drive)


@pytest.fixture(scope="module")
def good(clean):
    return judge(clean)


def codes(verdict, *, refusing=True):
    return {one.code for one in verdict.findings if one.refuses or not refusing}


def test_a_right_answer_is_valid_and_it_is_right(clean, good, drive):
    assert good.valid
    assert codes(good) == set()
    assert (missed(clean.freeze(), drive) < 0.08).all()
    assert good.measures["explained_lateral"] > 0.98
    assert repr(good) == "<Verdict: valid>"


def test_what_is_measured_is_the_true_force(whole):
    """Newton over windows gives the force that the plant integrated, roll and lag and all."""
    car = sedan()
    windows = brisk_windows(whole, 3.0)
    measured = measured_force(whole, car, windows)
    true = windows.mean(whole.axle_force / np.array(car.axle_loads))
    share = clean_rms(measured - true, np.zeros(2)) / clean_rms(true, np.zeros(2))
    assert share.max() < 0.03


def late(drive, name, seconds):
    signal = getattr(drive, name)
    return replace(drive, **{name: np.interp(drive.t - seconds, drive.t, signal)})


def turned(drive, degrees):
    """Look the sensor so far to the left: the car then seems to drift to the right."""
    a = np.radians(degrees)
    v_x, v_y = drive.v_x, drive.v_y
    return replace(
        drive, v_x=v_x * np.cos(a) + v_y * np.sin(a), v_y=v_y * np.cos(a) - v_x * np.sin(a)
    )


@pytest.mark.parametrize(("bias", "degrees"), [(2.0, 0.0), (0.0, 5.0)])
def test_an_offset_is_estimated_with_its_size_and_the_forces_are_right(drive, bias, degrees):
    """At one speed a bias and an angle are one: their sum at that speed is what is known."""
    faulty = turned(replace(drive, v_y=drive.v_y + bias), degrees)
    run = answer(faulty)
    model, speed = run.freeze(), float(np.mean(faulty.v_x))
    found = model["v_y_bias"] + model["v_y_angle"] * speed
    assert found == pytest.approx(bias - np.radians(degrees) * speed, rel=0.05)
    assert judge(run).valid
    assert missed(model, faulty).max() < 0.08


@pytest.mark.parametrize(
    "plant",
    [
        lambda d: late(d, "delta_f", 0.15),
        lambda d: late(d, "r", 0.12),
        lambda d: replace(d, v_y=-d.v_y),
    ],
    ids=["late steering", "late yaw rate", "mirrored v_y"],
)
def test_a_fault_that_the_estimate_cannot_take_out_is_refused(drive, plant):
    verdict = judge(answer(plant(drive)))
    assert not verdict.valid
    assert "force_missed" in codes(verdict)


def test_a_straight_drive_teaches_nothing_and_nothing_is_called_learnt(drive):
    verdict = judge(answer(drive.between(0.0, ONSET)))
    assert not verdict.valid
    assert codes(verdict) == {"no_force"}
    tires = [number for number in verdict.numbers if number.title in (STIFFNESS, GRIP)]
    assert "not identifiable from this drive" in {number.state for number in tires}
    assert not [number for number in verdict.numbers if number.valid]


@pytest.mark.sweep("0.0", "0.3")
@pytest.mark.parametrize("value", [0.0, 0.3, -1.7])
def test_v_y_that_is_not_measured_is_noticed(drive, value):
    verdict = judge(answer(replace(drive, v_y=np.full(len(drive), value))))
    assert "v_y_stuck" in codes(verdict)


def test_a_drive_of_a_moment_is_too_short(drive):
    for end in (6.9, 9.0):
        run = answer(drive.between(6.0, end))
        assert codes(judge(run)) == {"too_short"}
        assert calibrated(run).model_error is None


def test_each_learnt_number_holds_the_truth_within_its_doubt(good):
    """The stiffness of the plant's tires at their static load, within three sigma."""
    told = dict(zip(("front", "rear"), sedan().bicycle[4:], strict=True))
    learnt = {number.axle: number for number in good.numbers if number.title == STIFFNESS}
    assert set(learnt) == set(told)
    for axle, number in learnt.items():
        assert number.state == "valid"
        assert abs(number.value - told[axle]) < 3.0 * number.sd
        assert 0.01 * number.value < number.sd < 0.2 * number.value
    assert {number.title for number in good.numbers if number.axle == "rear"} == {
        "cornering stiffness",
        "grip",
        "relaxation length",
    }


def moved(model, **by):
    """A model with numbers of both axles, or of one, moved."""
    p = model.p.copy()
    for name, value in by.items():
        for k in [INDEX[name]] if name in INDEX else [INDEX[f"{name}_{axle}"] for axle in "fr"]:
            p[k] += value
    return replace(model, p=p)


def judged(clean, model):
    """The verdict where the run had come to another model."""
    return judge(replace(clean, models={len(clean.recording): model}))


def test_a_stiffness_that_no_tire_has_is_refused_and_told_to_be_at_its_bound(clean):
    model = clean.freeze()
    lowest = np.log(2.0) - model["ln_stiffness_r"]
    flat = {f"residual{j}_r": -model[f"residual{j}_r"] for j in range(4)}
    verdict = judged(clean, moved(model, ln_stiffness_r=lowest, **flat))
    refused = {(one.code, one.axle) for one in verdict.findings if one.refuses}
    assert refused == {("force_missed", "rear"), ("no_tire", "rear"), ("at_bound", "rear")}


def test_another_drive_is_given_back_and_its_range_is_told(clean, whole):
    other = steered(8, 16.0, amplitude=0.05, speed=22.0).recording()
    noisy = SENSORS.apply(other, np.random.default_rng(2))
    verdict = judge_prediction(clean.freeze(), noisy)
    assert verdict.valid
    assert missed(clean.freeze(), other).max() < 0.12
    assert re.match(r"verdict: valid for [\d.]+ to [\d.]+ m/s, slip up to", verdict.lines[0])


def test_a_prediction_has_a_verdict_of_its_own(clean, drive):
    model = clean.freeze()
    assert judge_prediction(model, drive).valid
    half = moved(model, ln_grip=np.log(0.5), ln_stiffness=np.log(0.5))
    verdict = judge_prediction(half, drive)
    assert codes(verdict) == {"force_missed"}
    assert all(0.2 < share < 0.6 for share in verdict.measures["force_missed"])


def test_a_drive_without_force_at_one_axle_judges_the_other(clean):
    quick = Slalom(
        amplitude=np.radians(1.05), frequency=0.8, onset=1.0, rate_limit=2.0, duration=8.0
    )
    drive = Plant(sedan()).simulate(quick, speed=12.0).recording()
    model = clean.freeze()
    verdict = judge_prediction(model, drive)
    front, rear = verdict.measures["peak_force_static_loads"]
    assert front > 0.1 > rear
    assert verdict.valid and ("no_force", "rear") in {(x.code, x.axle) for x in verdict.findings}
    assert "force_missed" in codes(judge_prediction(moved(model, ln_stiffness=-0.5), drive))


def test_a_drive_that_shows_nothing_cannot_judge_a_model(clean, drive):
    """Neither valid nor refused; a fault of the model itself is refused all the same."""
    model = clean.freeze()
    for part in (drive.between(0.0, ONSET), drive.between(6.0, 6.9)):
        verdict = judge_prediction(model, part)
        assert (verdict.valid, verdict.judged, verdict.model_error) == (False, False, None)
        assert verdict.headline.startswith("verdict: cannot judge, ")
        assert {number.state for number in verdict.numbers} <= {"not judged", NOT_IDENTIFIABLE}
        assert not verdict.to_dict()["judged"]
    soft = {f"residual{j}": -10.0 for j in range(4)}
    refused = judge_prediction(moved(model, **soft), drive.between(0.0, ONSET))
    assert refused.judged and "no_tire" in codes(refused)


def test_one_steady_corner_is_valid_for_no_slip(whole):
    """It decides one point of the curve, and elsewhere the prior stands."""
    corner = StepSteer(amplitude=0.03, onset=1.0, rate_limit=0.3, duration=34.0)
    log = Plant(sedan()).simulate(corner, speed=20.0).recording()
    run = answer(SENSORS.apply(log, np.random.default_rng(4)).between(4.0, 34.0))
    assert codes(judge(run)) == {"prior"}
    assert (run.freeze().known_slip == 0.0).all()
    assert missed(run.freeze(), whole).max() > 0.12
    begun = answer(SENSORS.apply(log, np.random.default_rng(4)).between(0.0, 12.0))
    assert judge(begun).valid and (begun.freeze().known_slip > np.radians(1.0)).all()


def test_another_friction_is_looked_for_where_a_part_is_missed(clean, drive):
    """The search costs thirty times the rest of the verdict; who asks for it gets it."""
    model = clean.freeze()
    assert judge_prediction(model, drive).friction is None
    assert predict(model, drive).friction().unchanged
    ice = FrictionChange(scale=0.5, at_time=12.0), FrictionChange(scale=1.0, at_time=16.0)
    wet = steered(3, 24.0, amplitude=0.06, frequency=0.6, friction=Friction(changes=ice))
    verdict = judge_prediction(model, wet.recording(SENSORS, np.random.default_rng(1)))
    (road,) = verdict.friction.roads
    assert 12.0 < road.first < 15.0


@pytest.mark.sweep("axle*", "linear*")
@pytest.mark.parametrize(
    ("name", "valid"),
    [("axle", True), ("lagged_ekf", True), ("integral", False), ("linear", False)],
)
def test_every_method_that_freezes_has_a_verdict(drive, name, valid):
    """Where it is valid, the axles miss less than a seventh of the true force."""
    car = sedan()
    run = identify(drive, car, make_method(name, car))
    verdict = judge(run)
    share = missed(run.freeze(), drive)
    assert verdict.valid == valid
    assert share.max() < 1.0 / 7.0 or not valid
    assert np.allclose(verdict.measures["force_missed"], share, atol=0.05)
    learnt = {number.identified for number in verdict.numbers}
    assert (True in learnt) == (name != "linear")


def test_every_finding_is_in_the_documents():
    folder = Path(identifier.verdict.__file__).parent
    text = (folder / "judging.py").read_text(encoding="utf-8")
    named = {BEYOND_KNOWN, "v_y_reads"}  # the second of a day
    written = {*named, *re.findall(r'Objection\(\s*"(\w+)"', text)}
    page = (folder.parents[1] / "docs" / "results.md").read_text(encoding="utf-8")
    assert len(written) > 10
    assert written == set(re.findall(r"^\| `(\w+)` \| (?:no|yes)", page, flags=re.MULTILINE))


@pytest.mark.parametrize("noise", [1.0, 8.0])
def test_noise_of_the_sensors_is_no_disagreement_of_an_estimated_v_y(whole, clean, noise, rng):
    shown = replace(
        whole,
        v_y=whole.v_y + noise * 0.03 * rng.standard_normal(len(whole)),
        a_y=whole.a_y + noise * 0.1 * rng.standard_normal(len(whole)),
        axle_force=None,
        estimated=("v_y",),
    )
    model = clean.freeze()
    assert "a_y_disagrees" not in codes(judge_prediction(model, shown), refusing=False)
    scaled = replace(shown, a_y=1.4 * shown.a_y)
    assert "a_y_disagrees" in codes(judge_prediction(model, scaled))
