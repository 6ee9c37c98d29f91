"""The offline fit: it finds planted parameters, and nothing learnt online gets below it."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.floor import axle_structure, curve_structure, fit_floor, share_of_force
from identifier.axle import AxleIdentifier
from identifier.baselines import CurveModel, magic_formula_ekf
from identifier.run import identify
from tests.identifier.baselines.conftest import MAGIC, magic


def cost(model, recordings):
    return sum(float(np.sum(share_of_force(model, rec) ** 2)) for rec in recordings)


def test_planted_parameters_are_found_exactly(car, curve_drive, rng):
    recording = curve_drive(car, magic, n=600)
    structure = curve_structure(magic_formula_ekf(car, textbook=True), car)
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
    recording = replace(recording, axle_force=true.predict(recording))
    model = fit_floor(curve_structure(magic_formula_ekf(car), car), [recording], rng=rng, starts=1)
    np.testing.assert_allclose(model.relaxation_length, true.relaxation_length, rtol=1e-2)
    np.testing.assert_allclose(model.offset, true.offset, rtol=2e-2)
    assert share_of_force(model, recording).max() < 1e-3


@pytest.mark.sweep("for_vehicle-axle_structure")
@pytest.mark.parametrize(
    ("make", "structure_of"),
    [(magic_formula_ekf, curve_structure), (AxleIdentifier.for_vehicle, axle_structure)],
)
def test_no_method_gets_below_the_floor_of_its_structure(make, structure_of, car, drive, rng):
    recording, method = drive(n=400), make(car)
    learnt = identify(recording, car, method).freeze(99.0)
    floor = fit_floor(structure_of(method, car), [recording], rng=rng, starts=2, steps=25)
    assert type(floor) is type(learnt)
    assert cost(floor, [recording]) < cost(learnt, [recording])


def test_a_fit_to_several_recordings_serves_all(car, drive, rng):
    recordings = [drive(n=400, amplitude=a) for a in (0.02, 0.1)]
    structure = curve_structure(magic_formula_ekf(car), car)
    alone = [fit_floor(structure, [one], rng=rng, starts=1) for one in recordings]
    joint = fit_floor(structure, recordings, rng=rng, starts=1)
    assert cost(joint, recordings) < min(cost(model, recordings) for model in alone)
    for model, one in zip(alone, recordings, strict=True):
        assert cost(model, [one]) < cost(joint, [one])


def test_what_cannot_be_fitted_is_refused(car, drive, rng):
    structure = curve_structure(magic_formula_ekf(car), car)
    blind = replace(drive(n=50), axle_force=None)
    with pytest.raises(ValueError, match="needs the true forces"):
        fit_floor(structure, [blind], rng=rng)
    with pytest.raises(ValueError, match="at least one recording"):
        fit_floor(structure, [], rng=rng)
    with pytest.raises(ValueError, match="starts must be at least 1"):
        fit_floor(structure, [drive(n=50)], rng=rng, starts=0)
