"""What a drive tells of the tires adds up, and is what plain least squares makes of its samples."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from identifier.axle import AxleIdentifier
from identifier.axle.curve import doublings
from identifier.axle.information import (
    Evidence,
    Information,
    change_from,
    merged,
    posterior,
    reference_of,
    total,
)
from identifier.axle.prior import fiala_weights
from identifier.axle.step import EVIDENCE_CARRY, build_evidence
from identifier.run import learn
from models.recordings import RecordingError, joined
from tests.identifier.conftest import CAR, drive, saturating


@pytest.fixture(scope="module")
def design():
    return AxleIdentifier.for_vehicle(CAR)


@pytest.fixture(scope="module")
def evidence(design):
    return Evidence(design=design, reference=reference_of(design, CAR))


@pytest.fixture(scope="module")
def parts():
    return [drive(n=n, amplitude=a) for n, a in ((1201, 0.06), (803, 0.03), (1000, 0.05))]


def error_of(model):
    """Share of the true force that steady curves miss up to where the drives went."""
    alpha = np.linspace(0.005, 0.06, 40)
    true = np.column_stack([saturating(alpha, C, peak) for C, peak in
                            ((CAR.cornering_stiffness_front, 5000.0),
                             (CAR.cornering_stiffness_rear, 4500.0))])  # fmt: skip
    away = model.force_at(alpha) - true
    return np.sqrt((away**2).mean() / (true**2).mean())


def test_it_is_the_sum_over_samples_that_a_plain_loop_makes(design, evidence, parts):
    recording = parts[1].between(0.0, 3.0)
    step = build_evidence(doublings(design.ladder))
    setup = evidence._setup
    carry = {name: ca.DM(setup.carry[name]) for name in EVIDENCE_CARRY}
    constants = {name: ca.DM(value) for name, value in setup.constants.items()}
    rows, weights = [], []
    for k in range(len(recording)):
        sample = {"x": recording.x[k], "u": recording.u[k], "v_x": recording.v_x[k], "a_y": np.nan}
        out = step(**carry, **constants, **sample)
        carry = {name: out[f"{name}_next"] for name in EVIDENCE_CARRY}
        if k % 5 == 0 and float(out["learns"]) > 0.5:
            rows.append(np.hstack([np.array(out["h"])[0], float(out["y"][0])]))
            weights.append(5.0 / float(out["R"][0]))
    rows = np.array(rows) * np.sqrt(weights)[:, None]
    told = evidence.of(recording)
    assert told.samples == pytest.approx(5 * len(rows))
    assert np.allclose(told.matrix[0], rows[:, :-1].T @ rows[:, :-1], rtol=1e-9)
    assert np.allclose(told.vector[0], rows[:, :-1].T @ rows[:, -1], rtol=1e-9)


def test_parts_learnt_apart_and_added_are_the_drive_learnt_at_once(design, evidence, parts):
    apart = total([evidence.of(one) for one in parts], 7)
    at_once = evidence.of(joined(parts))
    models = [
        merged(design, evidence.reference, told, np.zeros((2, 9))) for told in (apart, at_once)
    ]
    assert apart.samples == at_once.samples > 0
    assert np.abs(models[0].W / models[1].W - 1.0).max() < 1e-9
    assert np.abs(models[0].own - models[1].own).max() < 1e-9 * np.abs(models[1].own).max()


def test_order_does_not_change_a_bit_of_the_sum(evidence, parts):
    told = [evidence.of(one) for one in parts]
    first, second = total(told, 7), total(told[::-1], 7)
    assert (first.matrix == second.matrix).all() and (first.vector == second.vector).all()
    both = told[0] + told[1]
    assert np.allclose(both.matrix, total(told[:2], 7).matrix, rtol=1e-14)


def test_pieces_of_a_long_drive_add_up_to_all_of_it_but_for_where_they_begin(evidence, parts):
    pieces = evidence.parts(parts[0], 4.0)
    assert [begin for begin, _ in pieces] == pytest.approx([0.0, 4.0, 8.0, 12.0])
    whole = evidence.of(parts[0])
    again = total([one for _, one in pieces], 7)  # states go on from piece to piece
    assert np.allclose(again.matrix, whole.matrix, rtol=1e-12)


def test_a_merged_model_knows_the_tires_as_well_as_the_drives_learnt_in_a_row(design, parts):
    models = [learn(one, CAR, design) for one in parts]
    told = [
        Evidence(design=design, reference=model).of(one)
        for one, model in zip(parts, models, strict=True)
    ]
    together = merged(design, models[0], total(told, 7), np.zeros((2, 9)))
    in_a_row = learn(joined(parts), CAR, design)
    assert error_of(together) < 1.02 * error_of(in_a_row) + 1e-3
    assert error_of(together) < 0.6 * error_of(reference_of(design, CAR))


def test_nothing_told_leaves_the_prior(design, evidence):
    P = evidence.reference.covariance
    mean = np.hstack([evidence.reference.W, evidence.reference.own])
    theta, after = posterior(Information.nothing(7), mean, P)
    assert np.allclose(theta, mean) and np.allclose(after, P, rtol=1e-6)


def test_posterior_is_what_least_squares_with_the_prior_as_rows_makes(evidence, parts):
    told = evidence.of(parts[0])
    mean = np.hstack([evidence.reference.W, evidence.reference.own])
    P = evidence.reference.covariance
    theta, _ = posterior(told, mean, P)
    for i in (0, 1):
        w, V = np.linalg.eigh(told.matrix[i])
        keep = w > w.max() * 1e-13
        root = np.sqrt(w[keep])[:, None] * V[:, keep].T  # root'root = Λ
        seen = (V[:, keep].T @ told.vector[i]) / np.sqrt(w[keep])
        before = np.linalg.inv(np.linalg.cholesky(P[i]))
        rows, sides = np.vstack([root, before]), np.concatenate([seen, before @ mean[i]])
        found = np.linalg.lstsq(rows, sides, rcond=None)[0]
        assert np.allclose(theta[i], found, rtol=1e-5, atol=1e-8)


def test_a_tire_that_lost_a_tenth_of_its_stiffness_is_seen_as_one(design, evidence, parts):
    ladder = design.ladder
    told = evidence.of(parts[0])
    theta = np.hstack([evidence.reference.W, evidence.reference.own])
    per_load = CAR.cornering_stiffness_front / CAR.axle_loads[0]
    softer = theta.copy()
    softer[0, :-3] = fiala_weights(0.9 * per_load, design.prior.friction, ladder)
    theta[0, :-3] = fiala_weights(per_load, design.prior.friction, ladder)
    drives = replace(
        told,
        vector=np.einsum("aij,aj->ai", told.matrix, softer),
        square=np.einsum("ai,aij,aj->a", softer, told.matrix, softer),
    )
    found = change_from(drives, theta, design, CAR)
    assert found.value[0, 0] == pytest.approx(np.log(0.9), abs=0.02)
    assert abs(found.value[0, 1]) < 0.1 and np.abs(found.value[1]).max() < 1e-6


def test_a_sensor_that_is_off_is_no_change_of_the_tires(design, evidence, parts):
    told = evidence.of(parts[0])
    theta = np.hstack([evidence.reference.W, evidence.reference.own])
    off = theta.copy()
    off[:, -1] += (0.004, 0.02)  # rad, m/s
    drives = replace(
        told,
        vector=np.einsum("aij,aj->ai", told.matrix, off),
        square=np.einsum("ai,aij,aj->a", off, told.matrix, off),
    )
    assert np.abs(change_from(drives, theta, design, CAR).value).max() < 2e-3


def test_what_cannot_be_added_is_refused(design, evidence, parts):
    with pytest.raises(ValueError, match=r"matrix must have shape \(2, 7, 7\)"):
        Information(
            matrix=np.zeros((2, 3, 3)), vector=np.zeros((2, 7)), square=np.zeros(2),
            samples=1.0, seconds=1.0,
        )  # fmt: skip
    with pytest.raises(ValueError, match="samples must not be negative, it is -1"):
        replace(Information.nothing(7), samples=-1.0)
    other = replace(design, ladder=tuple(2.0 * scale for scale in design.ladder))
    with pytest.raises(ValueError, match="the reference's units"):
        Evidence(design=other, reference=evidence.reference)
    with pytest.raises(RecordingError, match="there is no vy"):
        evidence.of(replace(parts[0], v_y=None))
