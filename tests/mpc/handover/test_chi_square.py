"""The error of a tire's forces, told from impulses, is the error of its forces."""

import numpy as np
import pytest

from mpc.handover.judge import Judge, Window, axle_forces
from mpc.tires import prediction_tire
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


def bicycle_drive(car):
    """Samples of a bicycle whose axle forces (n, 2) [N] are known exactly."""
    v_x, v_y, r = 20.0, 0.0, 0.0
    load, h, fine = np.array(car.axle_loads), 0.001, 10
    rows, forces = [], []
    for k in range(3000):
        delta = 0.05 * np.sin(3.0 * k * h)
        alpha = np.array([delta - (v_y + car.l_f * r) / v_x, -(v_y - car.l_r * r) / v_x])
        F = 0.8 * load * np.tanh(20.0 * alpha)
        if k % fine == 0:
            rows.append((v_x, v_y, r, delta))
            forces.append(F)
        v_y += h * (F.sum() / car.mass - v_x * r)
        r += h * (car.l_f * F[0] - car.l_r * F[1]) / car.yaw_inertia
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
