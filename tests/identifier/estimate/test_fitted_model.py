"""A fitted model as a file, in other units and sample by sample."""

import json
from dataclasses import replace

import numpy as np
import pytest

from codegen.arrays import blocks
from identifier.axle.gate import Plausibility
from identifier.estimate import report
from identifier.estimate.model import FittedModel
from identifier.motion.parameters import INDEX
from identifier.tire_model import GRIP, STIFFNESS, load_model
from models.maneuvers import Slalom, StepSteer
from models.plant import Plant
from models.vehicle import sedan
from tests.identifier.estimate.conftest import driven
from tireid.learning import identify


def test_a_saved_model_is_the_same(learnt, tmp_path):
    model = learnt.model.band.calibrated_by(None, np.array([0.02, 0.03]))
    model.save(tmp_path / "tires.json")
    loaded = load_model(tmp_path / "tires.json")
    assert isinstance(loaded, FittedModel)
    assert loaded.to_dict() == model.to_dict()
    drive = driven(5)
    np.testing.assert_array_equal(loaded.predict(drive), model.predict(drive))
    np.testing.assert_array_equal(loaded.band.over(drive), model.band.over(drive))


def test_a_file_of_before_has_no_play(learnt):
    data = json.loads(json.dumps(learnt.model.to_dict()))
    k = list(data["parameters"]).index("steering_play")
    del data["parameters"]["steering_play"], data["covariance"][k]
    for row in data["covariance"]:
        del row[k]
    read = FittedModel.from_dict(data, "tires.json")
    np.testing.assert_array_equal(read.p, learnt.model.p)
    np.testing.assert_array_equal(read.covariance, learnt.model.covariance)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda d: d["parameters"].pop("ln_grip_f"), "ln_grip_f"),
        (lambda d: d["parameters"]["ln_stiffness_r"].update(value=9.0), "must be within"),
        (lambda d: d["covariance"][0].__setitem__(1, 9.0), "covariance must be symmetric"),
        (lambda d: d["covariance"][0].__setitem__(0, -1.0), "no negative variance"),
        (lambda d: d.update(speeds_m_s=[1.0, float("inf")]), "speeds_m_s"),
        (lambda d: d.update(driven_slip_rad=[0.1]), "driven"),
        (lambda d: d["vehicle"].update(mass=-1.0), "mass"),
    ],
)
def test_a_bad_file_is_refused(learnt, refused_in_one_line, change, said):
    data = json.loads(json.dumps(learnt.model.to_dict()))
    change(data)
    refused_in_one_line(data, said)


def test_sample_by_sample_it_says_what_it_says_of_the_drive(learnt):
    """Without the smoothing of a drive: within noise, and as near to the truth."""
    drive, model = driven(5), learnt.model
    run = model.setup(drive.dt).run(drive, tuple(blocks(len(drive))), ports=("axle_force",))
    step = np.concatenate([block.outputs["axle_force"] for block in run])
    size = np.sqrt(np.mean(drive.axle_force**2, axis=0))
    away = np.sqrt(np.mean((step - model.predict(drive)) ** 2, axis=0))
    assert (away < 0.03 * size).all()
    assert model.setup(0.02).ends_run == Plausibility.for_vehicle(model.vehicle).rest(0.02) > 2


def test_on_another_road_its_band_opens_by_what_friction_may_do(learnt):
    model = learnt.model
    slip = np.array([0.0005, 0.05])
    own, other = model.band.half(slip), model.band.on_another_road().band.half(slip)
    np.testing.assert_allclose(other[0], own[0], rtol=0.05)  # the stiffness stays
    assert (other[1] > 2.0 * own[1]).all()
    np.testing.assert_array_equal(model.band.on_another_road().force(slip), model.force(slip))
    with pytest.raises(ValueError, match="sd_friction"):
        model.band.on_another_road(-0.1)


def test_the_doubt_of_a_load_is_that_of_mass_and_center_of_gravity(learnt):
    car, sd = replace(sedan(), l_f=0.9, l_r=1.8), 0.04
    moved = replace(car, l_f=car.l_f + sd * car.wheelbase, l_r=car.l_r - sd * car.wheelbase)
    change = np.array(moved.axle_loads) / np.array(car.axle_loads) - 1.0
    doubted = learnt.model.mounted_on(replace(car, center_of_gravity_sd=sd))
    np.testing.assert_allclose(doubted.band.load_doubt, np.hypot(0.03, change))
    untold = learnt.model.mounted_on(car)
    np.testing.assert_allclose(untold.band.load_doubt, np.hypot(0.03, change / 4.0))
    for one, other in zip(doubted.estimates(), untold.estimates(), strict=True):
        if one.title in (STIFFNESS, GRIP):
            assert one.sd > other.sd


def test_a_zero_of_the_steering_widens_the_band_of_the_front_axle_alone(learnt):
    model, k = learnt.model, INDEX["steering_zero"]
    unsure = model.covariance.copy()
    unsure[k, k] += np.radians(1.0) ** 2
    slip = np.array([0.0, 0.02])
    half, wide = model.band.half(slip), replace(model, covariance=unsure).band.half(slip)
    assert (wide[:, 0] > 1.5 * half[:, 0]).all()
    np.testing.assert_allclose(wide[:, 1], half[:, 1])


def test_a_gentle_drive_does_not_know_the_stiffness_where_the_ratio_may_be_wrong(learnt):
    """A ratio that the drive does not decide is in the ±, and the number is not identified."""
    model, k = learnt.model, INDEX["steering_gain"]
    front, rear = [one for one in model.estimates() if one.title == STIFFNESS]
    assert front.identified and rear.identified and not report.of_ratio(model)
    p, blind, J = model.p.copy(), model.covariance.copy(), np.zeros(len(model.p))
    p[k], blind[k], blind[:, k] = 0.0, 0.0, 0.0
    J[k], J[INDEX["ln_stiffness_f"]] = 1.0, -1.0  # a drive that decides their product alone
    gentle = replace(model, p=p, covariance=blind + 0.04**2 * np.outer(J, J))
    opened, held = gentle.band.ratio_open
    assert opened.model.covariance[k, k] == pytest.approx(0.25**2)
    assert not held.any()
    front, rear = [one for one in gentle.estimates() if one.title == STIFFNESS]
    assert front.sd > 0.2 * front.value and not front.identified
    assert rear.identified
    ((code, text),) = report.of_ratio(gentle)
    assert code == "steering_ratio" and "front cornering stiffness is not known" in text


def test_grip_is_the_top_of_the_curve_and_known_slip_ends_where_a_drive_decides_the_force():
    """A small slalom, a large one and a step agree on the grip, each within its own doubt."""
    car, limit = sedan(), np.radians(30.0)
    plant = Plant(car)
    steering = [
        Slalom(
            amplitude=np.radians(size), frequency=0.5, onset=1.0, rate_limit=limit, duration=20.0
        )
        for size in (4.0, 6.0)
    ]
    step = StepSteer(amplitude=np.radians(3.0), onset=1.0, rate_limit=limit, duration=10.0)
    found = []
    for maneuver in (*steering, step):
        run = identify(plant.simulate(maneuver, speed=20.0).recording(), car)
        grip = [one for one in run.tire.estimates() if one.title == GRIP]
        found.append(([one.value for one in grip], [one.sd for one in grip]))
        assert (run.tire.known_slip > 0.9 * run.tire.reach.slip).all()
    values, sd = np.array([value for value, _ in found]), np.array([sd for _, sd in found])
    assert (np.abs(values - values[1]) < 2.0 * sd).all()
    assert (sd[:2] < 0.12).all() and (sd[2] > sd[:2]).all()


def test_samples_of_a_fit_spread_by_its_covariance_and_its_own_error(learnt):
    """Grip by ln: the variance of the fit, and of the share of the force that the fit misses."""
    model, n = learnt.model, 400
    drawn = np.array([one.p for one in model.band._samples(n, np.random.default_rng(1))])
    own = model.band._error_at(0.5)
    for i, axle in enumerate("fr"):
        k = INDEX[f"ln_grip_{axle}"]
        expected = np.hypot(np.sqrt(model.covariance[k, k]), own[i])
        assert np.std(drawn[:, k]) == pytest.approx(expected, rel=0.15)
        assert np.mean(drawn[:, k]) == pytest.approx(model.p[k], abs=4.0 * expected / np.sqrt(n))
