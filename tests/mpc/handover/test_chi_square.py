"""The error of a tire's forces, told from impulses, is the error of its forces."""

from dataclasses import replace

import numpy as np
import pytest

from mpc.handover.judge import Judge, Window, axle_forces
from mpc.tires import PredictionTire, prediction_tire
from mpc.tires.axles import LadderAxles, curve_weights
from tests.mpc.handover.conftest import samples_of


def forces_by_hand(tire, samples):
    """Ladders with lag, in plain numpy."""
    car, n = tire.vehicle, tire.structure.units
    delta_0, _, bias, _ = tire.weights[:4]
    axles = tire.weights[4:].reshape(2, -1)
    lagged, told = None, []
    for v_x, v_y, r, delta in samples:
        alpha = np.array(
            [
                delta + delta_0 - np.arctan((v_y - bias + car.l_f * r) / v_x),
                -np.arctan((v_y - bias - car.l_r * r) / v_x),
            ]
        )
        if lagged is None:
            lagged = alpha
        else:
            sigma = []
            for axle, x in zip(axles, lagged, strict=True):
                per_scale, W = axle[4 : 4 + n], axle[-n:]
                slope = np.sum(W * per_scale / np.cosh(per_scale * x) ** 2)
                sigma.append(axle[2] * max(slope, 0.02 * np.sum(W * per_scale)) + axle[3])
            lagged = alpha + np.exp(-v_x * 0.01 / np.array(sigma)) * (lagged - alpha)
        force = [
            axle[0] * np.sum(axle[-n:] * np.tanh(axle[4 : 4 + n] * x))
            for axle, x in zip(axles, lagged, strict=True)
        ]
        told.append([force[0] * np.cos(delta), force[1]])
    return np.array(told)


def test_forces_along_a_drive_are_those_by_hand(tire, dry):
    samples = samples_of(dry[1])[:200]
    weights = np.stack([tire.weights, 0.9 * tire.weights])
    told = axle_forces(tire, weights, samples, 0.01)
    np.testing.assert_allclose(told[0], forces_by_hand(tire, samples), atol=1.0)
    other = tire._replace(weights=weights[1])
    np.testing.assert_allclose(told[1], forces_by_hand(other, samples), atol=1.0)


def bicycle_drive(car, acceleration=0.0, shares=(0.0, 0.0)):
    """Samples of a bicycle whose axle forces (n, 2) [N] are known exactly; shares push it."""
    v_x, v_y, r = 20.0, 0.0, 0.0
    load, h, fine = np.array(car.axle_loads), 0.001, 10
    rows, forces = [], []
    for k in range(3000):
        delta = 0.05 * np.sin(3.0 * k * h)
        alpha = np.array([delta - (v_y + car.l_f * r) / v_x, -(v_y - car.l_r * r) / v_x])
        push = car.mass * (acceleration - v_y * r) * np.array(shares)
        F = 0.8 * load * np.tanh(20.0 * alpha) * np.sqrt(1.0 - (0.8 * push / (0.8 * load)) ** 2)
        if k % fine == 0:
            rows.append((v_x, v_y, r, delta))
            forces.append(F)
        v_y += h * (F.sum() / car.mass - v_x * r)
        r += h * (car.l_f * F[0] - car.l_r * F[1]) / car.yaw_inertia
        v_x += h * acceleration
    return np.array(rows), np.array(forces)


def test_errors_are_those_of_the_forces(car, tire):
    """The slope over 13 samples is the mean over 12 steps, weighted by a parabola."""
    samples, forces = bicycle_drive(car)
    weights = tire.weights.copy()
    weights[4:].reshape(2, -1)[1, 0] *= 0.8  # a fifth of the rear force is missing
    found = Judge(0.01).chi_square(tire._replace(weights=weights), samples)
    told = axle_forces(tire, weights[None], samples, 0.01)[0]
    missing = (forces - told) / np.array(car.axle_loads)
    j = np.arange(1, 13)
    parabola = j * (13 - j) / np.sum(j * (13 - j))
    steps = 0.5 * (missing[1:] + missing[:-1])
    mean = np.array([parabola @ steps[i : i + 12] for i in range(10, len(steps) - 11)])
    np.testing.assert_allclose(found.rms, np.sqrt(np.mean(mean**2, axis=0)), atol=5e-4)
    assert np.abs(mean[:, 1]).max() > 0.05


@pytest.mark.parametrize(("acceleration", "shares"), [(5.0, (1.0, 0.0)), (-6.0, (0.62, 0.38))])
def test_an_axle_that_pushes_is_expected_to_have_less_to_the_side(car, acceleration, shares):
    """The ellipse by hand, of a car that is driven in front and brakes on both axles."""
    samples, _ = bicycle_drive(car, acceleration, shares)
    weights = curve_weights(np.tile([20.0, 0.8], (2, 1)), loads=car.axle_loads)
    tire = PredictionTire(LadderAxles(units=1, lagged=False), weights, car)
    plain = car.without_chassis()
    front = replace(plain, drive_front_share=0.0, brake_front_share=0.0)  # told wrongly
    found = Judge(0.01).chi_square(tire, samples)
    wrong = Judge(0.01).chi_square(tire._replace(vehicle=front), samples)
    assert found.rms.max() < 0.01
    assert wrong.rms[0] > 0.02
    assert found.mean < 0.1 * wrong.mean


def test_a_learnt_tire_fits_and_another_does_not(car, tire, dry):
    judge, samples = Judge(0.01), samples_of(dry[1])
    good = judge.chi_square(tire, samples)
    assert good.mean < 1.0
    assert judge.chi_square(prediction_tire(car), samples).mean > 2.0 * good.mean  # the linear tire
    both = judge.chi_squares(tire, np.stack([tire.weights, tire.weights]), samples)
    assert both[0].total == both[1].total == pytest.approx(good.total)
    assert good.independent == pytest.approx(2 * (1 + (len(samples) - 22 - 1) / 12), rel=1e-12)


@pytest.mark.parametrize("count", [3, 10, 11, 37, 60])
def test_a_window_holds_the_last_samples_in_order(count):
    window = Window(0.1, 0.01)
    for k in range(count):
        window.add(k + 0.1 * np.arange(4))
    n = min(count, 10)
    expected = np.arange(count - n, count)[:, None] + 0.1 * np.arange(4)
    np.testing.assert_array_equal(window.last(1.0), expected)
    np.testing.assert_array_equal(window.last(0.03), expected[-3:])
    assert (len(window), window.duration) == (n, n * 0.01)
    window.clear()
    assert len(window.last(1.0)) == 0
