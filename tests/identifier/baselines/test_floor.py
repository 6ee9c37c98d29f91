"""The offline fit: it finds planted parameters, and nothing learnt online gets below it."""

from dataclasses import replace

import numpy as np
import pytest

from identifier.axle import AxleIdentifier
from identifier.baselines import (
    CurveModel,
    ForceEkf,
    StiffnessRls,
    dugoff_ekf,
    fit_floor,
    magic_formula_ekf,
    share_of_force,
    structure_of,
)
from identifier.method import CannotFreezeError
from identifier.paper.design import PaperIdentifier
from identifier.paper.network import natural_network
from identifier.run import identify
from models.recordings import read_recording
from models.vehicle import Vehicle

MAGIC = np.array([[12.0, 1.5, 6000.0], [14.0, 1.3, 5200.0]])  # B, C, D


def magic(axle, alpha):
    B, C, D = MAGIC[axle]
    return D * np.sin(C * np.arctan(B * alpha))


def cost(model, recordings):
    return sum(float(np.sum(share_of_force(model, rec) ** 2)) for rec in recordings)


def small_network(car):
    return PaperIdentifier.for_vehicle(car, network=natural_network(car, hidden=4))


def test_planted_parameters_are_found_exactly(car, curve_drive, rng):
    recording = curve_drive(car, magic, n=600)
    structure = structure_of(magic_formula_ekf(car, textbook=True), car)
    model = fit_floor(structure, [recording], rng=rng, starts=1)
    np.testing.assert_allclose(model.parameters, MAGIC, rtol=1e-2)
    assert share_of_force(model, recording).max() < 1e-3


def test_planted_lag_and_offsets_are_found_too(car, drive, rng):
    true = CurveModel(
        vehicle=car,
        curve="magic_formula",
        parameters=MAGIC,
        min_speed=1.0,
        relaxation_length=np.array([0.7, 1.1]),
        offset=np.array([0.003, -0.05]),
    )
    recording = drive(n=600)
    recording = replace(recording, axle_force=true.axle_force(recording))
    model = fit_floor(structure_of(magic_formula_ekf(car), car), [recording], rng=rng, starts=1)
    np.testing.assert_allclose(model.relaxation_length, true.relaxation_length, rtol=1e-2)
    np.testing.assert_allclose(model.offset, true.offset, rtol=2e-2)
    assert share_of_force(model, recording).max() < 1e-3


@pytest.mark.parametrize(
    "make",
    [
        StiffnessRls.for_vehicle,
        magic_formula_ekf,
        dugoff_ekf,
        AxleIdentifier.for_vehicle,
        small_network,
    ],
)
def test_no_method_gets_below_the_floor_of_its_structure(make, car, drive, rng):
    recording, method = drive(n=400), make(car)
    learnt = identify(recording, car, method).freeze(99.0)
    floor = fit_floor(structure_of(method, car), [recording], rng=rng, starts=2, steps=25)
    assert type(floor) is type(learnt)
    assert cost(floor, [recording]) < cost(learnt, [recording])


def test_a_fit_to_several_recordings_serves_all(car, drive, rng):
    recordings = [drive(n=400, amplitude=a) for a in (0.02, 0.1)]
    structure = structure_of(StiffnessRls.for_vehicle(car), car)
    alone = [fit_floor(structure, [one], rng=rng, starts=1) for one in recordings]
    joint = fit_floor(structure, recordings, rng=rng, starts=1)
    assert cost(joint, recordings) < min(cost(model, recordings) for model in alone)
    for model, one in zip(alone, recordings, strict=True):
        assert cost(model, [one]) < cost(joint, [one])


def test_linear_floor_is_the_ratio_of_sums(car, drive, rng):
    recording = drive(n=400)
    structure = structure_of(StiffnessRls.for_vehicle(car, textbook=True), car)
    model = fit_floor(structure, [recording], rng=rng, starts=1)
    v_y, r, v_x = recording.v_y, recording.r, recording.v_x
    alpha = recording.u - np.column_stack([v_y + car.l_f * r, v_y - car.l_r * r]) / v_x[:, None]
    stiffness = np.sum(alpha * recording.axle_force, axis=0) / np.sum(alpha**2, axis=0)
    np.testing.assert_allclose(model.parameters[:, 0], stiffness, rtol=1e-3)


@pytest.mark.parametrize("textbook", [True, False])
@pytest.mark.parametrize("make", [magic_formula_ekf, dugoff_ekf, StiffnessRls.for_vehicle])
def test_on_recorded_driving_the_online_method_comes_near_its_floor(
    make, textbook, shared_data, rng
):
    """The more a structure can say, the less of it is told by the motion alone."""
    slalom = read_recording(shared_data / "carmaker.csv.gz", run="slalom1_14_5ms", dt=0.01)
    car = Vehicle(
        mass=2027.0,
        yaw_inertia=2877.0,
        l_f=0.924,
        l_r=1.626,
        cornering_stiffness_front=1.1e5,
        cornering_stiffness_rear=1.3e5,
    )
    method = make(car, textbook=textbook)
    learnt = identify(slalom, car, method).freeze(99.0)
    floor = fit_floor(structure_of(method, car), [slalom], rng=rng, starts=1)
    near = 1.1 if textbook else 1.3
    assert cost(floor, [slalom]) <= cost(learnt, [slalom]) < near * cost(floor, [slalom])


def test_the_same_seed_gives_the_same_floor(car, drive):
    structure, recording = structure_of(small_network(car), car), drive(n=200)
    fits = [
        fit_floor(structure, [recording], rng=np.random.default_rng(seed), starts=1, steps=5)
        for seed in (1, 1, 2)
    ]
    forces = [model.axle_force(recording) for model in fits]
    np.testing.assert_array_equal(forces[0], forces[1])
    assert np.abs(forces[0] - forces[2]).max() > 0.0


def test_what_cannot_be_fitted_is_refused(car, drive, rng):
    with pytest.raises(CannotFreezeError, match="ForceEkf has no structure"):
        structure_of(ForceEkf.for_vehicle(car), car)
    structure = structure_of(StiffnessRls.for_vehicle(car), car)
    blind = replace(drive(n=50), axle_force=None)
    with pytest.raises(ValueError, match="needs the true forces"):
        fit_floor(structure, [blind], rng=rng)
    with pytest.raises(ValueError, match="at least one recording"):
        fit_floor(structure, [], rng=rng)
    with pytest.raises(ValueError, match="starts must be at least 1"):
        fit_floor(structure, [drive(n=50)], rng=rng, starts=0)
