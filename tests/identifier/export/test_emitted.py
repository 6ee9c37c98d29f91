"""Property file, g-g-v, understeer gradient and car of slipx of a model, by other roads."""

import math
import re
from dataclasses import replace
from datetime import date
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import fsolve

from identifier.axle.model import begun
from identifier.band import normal_quantile
from identifier.estimate.model import FittedModel
from identifier.estimate.posterior import Reach
from identifier.estimate.priors import Priors
from identifier.estimate.solve import car_numbers
from identifier.export.ggv import diamond, ggv_text
from identifier.export.slipx import slipx_files
from identifier.export.steady import steady_text, understeer_gradient
from identifier.export.tir import tire_properties
from identifier.methods import make_method
from identifier.motion.model import pushed_function
from identifier.motion.parameters import INDEX
from identifier.speed_limits import speed_limits
from models.plant.dynamics import relaxation_lengths
from models.tires import MagicFormula
from models.vehicle import GRAVITY, Vehicle, sedan

CAR = replace(sedan().without_chassis(), drive_front_share=None)  # nobody tells what it drives
PRESSED = replace(CAR, downforce_area_front=1.0, downforce_area_rear=2.0)
SMALL = Vehicle(
    name="1:10", mass=3.5, yaw_inertia=0.05, l_f=0.16, l_r=0.17,
    cornering_stiffness_front=200.0, cornering_stiffness_rear=200.0,
)  # fmt: skip
TODAY = date(2026, 11, 26)
Z = normal_quantile(0.9)


def fitted(car=CAR, sd=0.1, **numbers):
    """A model at the priors' mean but for some numbers; sd : over that of the priors."""
    priors = Priors.of(car)
    p = priors.mean.copy()
    for name, value in numbers.items():
        p[INDEX[name]] = value
    return FittedModel(
        vehicle=car,
        p=p,
        covariance=sd**2 * priors.covariance,
        reach=Reach(
            np.array([0.2, 0.15]),
            np.array([5.0, 30.0]),
            np.array([-5.0, 3.0]),
            np.zeros(2),
            1.0,
        ),
    )


TIRES = {
    "curvature_f": -0.8, "curvature_r": 0.4, "shape_f": 1.3, "shape_r": 1.5, "ln_road": -0.2,
    "residual0_f": 0.02, "residual2_f": -0.03, "residual1_r": -0.02, "residual3_r": 0.04,
}  # fmt: skip


def read(model, axle, folder):
    path = folder / "tire.tir"
    path.write_text(tire_properties(model, axle), encoding="utf-8")
    return MagicFormula.from_tir(path)


def network():
    method = make_method("integral", CAR)
    return method.frozen(CAR, method.setup(CAR).carry)


# Property files.


@pytest.mark.parametrize("i", [0, 1])
def test_a_property_file_reads_back_the_axle_over_slip_and_load(tmp_path, i):
    model = fitted(PRESSED, **TIRES)
    axle = ("front", "rear")[i]
    tire = read(model, axle, tmp_path)
    assert pytest.approx(0.5 * PRESSED.axle_loads[i]) == tire.coefficients.FNOMIN
    alpha = np.linspace(-1.0, 1.0, 41) * model.known_slip[i]
    assert PRESSED.load_ratio(40.0)[i] > 1.1
    for v_x in (0.0, 20.0, 40.0):  # its load grows with speed
        load = 0.5 * PRESSED.axle_loads[i] * PRESSED.load_ratio(v_x)[i]
        pair = [2.0 * float(tire.forces(a, 0.0, 0.0, load).F_y) for a in alpha]
        force = model.force(alpha, axle, v_x=v_x)
        assert np.abs(pair - force).max() <= 0.02 * np.abs(force).max()
    load = 0.5 * PRESSED.axle_loads[i]
    lag = float(tire.relaxation_length(load))
    assert lag == pytest.approx(model.relaxation_length[i], rel=1e-8)
    assert float(tire.relaxation_length(1.5 * load)) == pytest.approx(lag, rel=0.1)
    assert relaxation_lengths(sedan(), (tire, tire))[i] == pytest.approx(lag, rel=0.1)
    assert tire.valid_range.alpha[1] == pytest.approx(model.known_slip[i])


def test_a_property_file_claims_the_slip_that_the_verdict_says():
    model = fitted()
    model = replace(model, reach=model.reach._replace(slip=np.radians([1.1, 0.8])))
    for axle, known in zip(("front", "rear"), np.degrees(model.known_slip), strict=True):
        assert f"Identified up to a slip of {known:.3g} deg" in tire_properties(model, axle)
    assert known == pytest.approx(0.8)


def test_a_curve_that_is_no_magic_formula_has_no_property_file():
    bumpy = fitted(residual0_f=2.0, residual1_f=-2.2, residual2_f=0.9)
    with pytest.raises(ValueError, match=r"front axle is no Magic Formula: .* % of its peak"):
        tire_properties(bumpy, "front")


# Limits of acceleration.


def level(**numbers):
    """A car whose axles have one lowest friction 1.1, sure of all but its mass."""
    model = fitted(sd=1e-6, **numbers)
    low = 1.0 - Z * model.band.load_doubt
    grip = dict(zip(("ln_grip_f", "ln_grip_r"), np.log(1.1 / low), strict=True))
    model = fitted(sd=1e-6, **grip, **numbers)
    return replace(model, reach=model.reach._replace(slip=np.array([0.5, 0.5])))


def limits(model):
    """What planners are told."""
    found = speed_limits(model)
    driving, braking = diamond(found.push), diamond(found.brake)
    return SimpleNamespace(v_x=found.v, a_y=found.a_y, braking=braking, driving=driving)


NO_ELLIPSE = dict.fromkeys(("braking_f", "braking_r", "driving_f", "driving_r"), 0.0)


def test_limits_of_a_car_are_those_that_load_transfer_leaves_by_hand():
    """While it brakes the rear axle has φ (1 - h L/l_f f) left: the diamond ends at l_f/(h L)."""
    model = level(load_transfer=0.45, **NO_ELLIPSE)
    found, L = limits(model), CAR.wheelbase
    np.testing.assert_allclose(found.a_y, 1.1 * GRAVITY, rtol=1e-3)
    np.testing.assert_allclose(found.braking, CAR.l_f / (0.45 * L) * GRAVITY, rtol=1e-3)
    transfer = CAR.l_r / (0.45 * L)
    assert transfer > 1.1  # driving: the front axle unloads less than the tires could push
    np.testing.assert_allclose(found.driving, 1.1 * GRAVITY, rtol=1e-3)


def test_limits_of_a_car_are_those_that_the_ellipse_leaves_by_hand():
    use = dict(zip(NO_ELLIPSE, (1.25, 0.5, 2.0, 0.0), strict=True))
    found = limits(level(load_transfer=0.0, **use))
    np.testing.assert_allclose(found.braking, GRAVITY / 1.25, rtol=1e-3)
    np.testing.assert_allclose(found.driving, GRAVITY / 2.0, rtol=1e-3)


def test_the_end_of_what_is_not_known_of_the_ellipse_is_taken():
    model = level(load_transfer=0.0, **{**NO_ELLIPSE, "braking_r": 1.25})
    covariance, k = model.covariance.copy(), INDEX["braking_r"]
    covariance[k, k] = 0.2**2
    found = limits(replace(model, covariance=covariance))
    np.testing.assert_allclose(found.braking, GRAVITY / (1.25 + Z * 0.2), rtol=1e-3)


@pytest.mark.parametrize(
    ("h", "braking_r", "driving_f"), [(0.4, 0.9, 0.8), (0.45, 0.2, 0.2), (0.1, 1.1, 1.3)]
)
def test_the_diamond_of_planners_lies_within_the_forces_of_the_model(h, braking_r, driving_f):
    """What it allows both axles can give, by load and ellipse; of a larger one they cannot.

    So it is on the side that limits a_x_max; the other is as wide or wider.
    """
    use = {"braking_f": 0.1, "braking_r": braking_r, "driving_f": driving_f, "driving_r": 0.1}
    grip = {"ln_grip_f": math.log(1.3), "ln_grip_r": math.log(1.25)}
    model = fitted(PRESSED, sd=1e-6, load_transfer=h, **use, **grip)
    found = limits(model)
    low = 1.0 - Z * model.band.load_doubt
    forces = [model.force(np.linspace(0.0, 2.0 * known, 300))[:, i].max()
              for i, known in enumerate(model.known_slip)]  # fmt: skip
    peak = low * forces / PRESSED.axle_loads
    coasting = -PRESSED.drag * found.v_x**2

    def pushed(a_x):
        car = car_numbers(PRESSED)
        return np.array(pushed_function()(model.p, car, a_x[None], found.v_x[None])).T

    for side, most in ((-1.0, found.braking), (1.0, found.driving)):
        spare = []
        for share in np.linspace(0.0, 0.999, 200):
            ratio = pushed(coasting + side * share * most)
            able = GRAVITY * (peak * ratio).min(axis=1)
            assert (found.a_y * (1.0 - share) <= 1.002 * able).all(), (side, share)
            larger = pushed(coasting + side * share * 1.03 * most)
            spare.append(GRAVITY * (peak * larger).min(axis=1) - found.a_y * (1.0 - share))
        ends = 1.03 * most * (braking_r if side < 0.0 else driving_f) > GRAVITY
        assert ((np.min(spare, axis=0) < 0.0) | ends | (most > 0.999 * found.a_y)).all(), side


def test_limits_fall_with_what_is_not_known_and_models_without_a_band_have_none():
    sure, doubtful = limits(fitted(sd=0.05)), limits(fitted(sd=0.22))
    assert (doubtful.a_y < 0.97 * sure.a_y).all()
    assert (doubtful.braking < 0.97 * sure.braking).all()
    assert (sure.a_y < 0.95 * GRAVITY * 0.85).all()  # the mean of the curves' peaks
    assert limits(begun(fitted(sd=0.05))).a_y[0] == pytest.approx(sure.a_y[0], rel=0.05)
    with pytest.raises(ValueError, match="NetworkModel cannot tell how sure it is"):
        limits(network())
    with pytest.raises(ValueError, match="front axle is not known at any slip"):
        model = fitted()
        limits(replace(model, reach=model.reach._replace(slip=np.array([0.0, 0.1]))))


def test_raceline_planners_read_the_table(tmp_path):
    model = fitted(PRESSED)
    found, path = limits(model), tmp_path / "ggv.csv"
    path.write_text(ggv_text(model), encoding="utf-8")
    with path.open("rb") as file:
        table = np.loadtxt(file, comments="#", delimiter=",")
    least = np.minimum(found.braking, found.driving)
    expected = np.column_stack([found.v_x, least, found.a_y])
    np.testing.assert_allclose(table, expected, atol=5.1e-4)
    assert table[0, 0] == 0.0 and table[-1, 0] == 30.0 and (np.diff(table[:, 0]) > 0.0).all()
    assert (table[:, 1:] > 0.0).all() and (table[:, 1:] < 50.0).all() and table[-1, 2] > table[0, 2]
    comments = [line for line in path.read_text().splitlines() if line.startswith("#")]
    assert comments[-1] == "# v_mps, ax_max_mps2, ay_max_mps2" and "Lower end" in comments[1]


# Understeer.


def steering_slope(model, i, a_y, ratio):
    """∂α/∂a_y of an axle [rad/(m/s²)], of a Magic Formula with E = 0 turned round by hand."""
    stiff, grip, c = (model[f"{name}_{'fr'[i]}"] for name in ("ln_stiffness", "ln_grip", "shape"))
    K, mu = math.exp(stiff), math.exp(grip)
    phi = a_y / (GRAVITY * ratio)
    at = math.asin(phi / mu) / c
    return c * mu / K / math.cos(at) ** 2 / (c * mu * math.cos(c * at)) / (GRAVITY * ratio)


@pytest.mark.parametrize("car", [CAR, PRESSED], ids=["plain", "pressed"])
def test_the_gradient_is_that_of_the_single_track_at_every_acceleration(car):
    model = fitted(car, sd=1e-3)
    found = understeer_gradient(model, np.random.default_rng(0))
    assert list(found.v_x) == ([5.0, 17.5, 30.0] if car is PRESSED else [30.0])
    rows = [[float(one) for one in row.split(",")] for row in found.csv.splitlines()[1:]]
    for v_x in found.v_x:  # each once
        assert (np.diff([row[1] for row in rows if row[0] == v_x]) > 0.0).all()
    for n, v_x in enumerate(found.v_x):
        ratio = car.load_ratio(v_x)
        for k, a_y in enumerate(found.a_y):
            if np.isfinite(found.gradient[n, k]):
                expected = steering_slope(model, 0, a_y, ratio[0])
                expected -= steering_slope(model, 1, a_y, ratio[1])
                assert found.gradient[n, k] == pytest.approx(expected, rel=0.02, abs=2e-5), a_y
    C = model.stiffness
    linear = car.mass / car.wheelbase * (car.l_r / C[0] - car.l_f / C[1])
    assert np.isfinite(found.gradient[0]).sum() >= 7
    if car is CAR:
        assert found.gradient[0, 0] == pytest.approx(linear, abs=2e-6)


def test_the_standard_deviation_is_that_of_linear_propagation():
    model = fitted(sd=0.2)
    found = understeer_gradient(model, np.random.default_rng(1))
    index = [INDEX[f"ln_stiffness_{axle}"] for axle in "fr"]
    P = model.covariance[np.ix_(index, index)] + np.diag(model.band.error_share**2)
    J = np.array([-1.0, 1.0]) / np.exp(model.p[index]) / GRAVITY
    resid = [INDEX[f"residual{j}_{axle}"] for axle in "fr" for j in range(4)]
    slips = np.tile([0.01, 0.02, 0.05, 0.12], 2)
    Jr = np.repeat(J, 4) / np.repeat(np.exp(model.p[index]), 4) / slips
    variance = J @ P @ J + Jr @ model.covariance[np.ix_(resid, resid)] @ Jr
    assert found.sd[0, 0] == pytest.approx(math.sqrt(variance), rel=0.2)
    assert found.sd[0, 6] > 2.0 * found.sd[0, 0]  # near the limit less is sure
    first, second = (understeer_gradient(model, np.random.default_rng(1)) for _ in range(2))
    assert first.csv == second.csv
    rows = first.csv.splitlines()
    assert rows[0] == "v_x_m_s,a_y_m_s2,gradient_deg_per_g,sd_deg_per_g"
    K = math.degrees(found.gradient[0, 0]) * GRAVITY
    assert [float(one) for one in rows[1].split(",")[:3]] == pytest.approx([30.0, 0.0, K], rel=1e-3)


def test_a_model_that_knows_no_doubt_has_no_gradient():
    with pytest.raises(ValueError, match="NetworkModel cannot tell how sure it is"):
        understeer_gradient(network(), np.random.default_rng(0))


# Steady turning.


@pytest.mark.parametrize("car", [CAR, PRESSED], ids=["plain", "pressed"])
def test_the_table_of_steady_turning_solves_the_equations_of_the_single_track(car):
    model = fitted(car, **TIRES)
    table = np.loadtxt(steady_text(model).splitlines(), delimiter=",")  # as ForzaETH's reader does
    v, delta, a_y = table[0, 1:], table[1:, 0], table[1:, 1:]
    assert table[0, 0] == delta[0] == 0.0 and (a_y[0] == 0.0).all() and v[-1] == 30.0
    assert np.isfinite(a_y[:, 0]).all() and np.isnan(a_y[-1, -1])
    assert (np.diff(a_y, axis=0)[np.isfinite(a_y[1:])] > 0.0).all()
    for n in (3, 20, 63):
        k = int(0.8 * np.isfinite(a_y[:, n]).sum())

        def missed(x, v_x=v[n], steer=delta[k]):
            v_y, r = x
            slip = (
                steer - math.atan((v_y + car.l_f * r) / v_x),
                -math.atan((v_y - car.l_r * r) / v_x),
            )
            F = [float(model.force(np.array([one]))[0, i]) * car.load_ratio(v_x)[i]
                 for i, one in enumerate(slip)]  # fmt: skip
            return sum(F) / car.mass - v_x * r, (car.l_f * F[0] - car.l_r * F[1]) / car.yaw_inertia

        r = a_y[k, n] / v[n]
        assert fsolve(missed, (car.l_r * r, r))[1] == pytest.approx(r, rel=2e-3)


# A car of slipx.


def slipx_car(folder, model):
    for name, text in slipx_files(model, np.random.default_rng(0), TODAY).items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")


def test_the_loader_of_slipx_takes_the_folder(tmp_path):
    slipx = pytest.importorskip("slipx", reason="needs slipx 0.2.0, which loads the folder")
    model = fitted(SMALL, **TIRES)
    slipx_car(tmp_path, model)
    car = slipx.load_car(tmp_path)
    stiffness = [car.params.c_alpha_f, car.params.c_alpha_r]
    np.testing.assert_allclose(stiffness, model.stiffness, rtol=0.1)
    assert car.params.mass == SMALL.mass and car.params.lr == SMALL.l_r
    for i, tire in enumerate((car.spec.tyre_front, car.spec.tyre_rear)):
        found, load = tire.provenance.residuals, 0.5 * SMALL.axle_loads[i]
        assert tire.nominal_load == pytest.approx(load)
        assert found["linear.c_alpha"]["value"] == tire.c_alpha
        assert 0.0 < found["linear.c_alpha"]["stddev"] < tire.c_alpha
        slip = np.linspace(0.0, 1.0, 30) * model.known_slip[i]
        force = load * _mf_lite(slip, tire.c_alpha / load, tire.mu_y0, **tire.mf_lite)
        expected = 0.5 * model.force(slip)[:, i]
        assert np.abs(force - expected).max() <= 0.02 * expected.max()
    assert "c_kappa" in _refusal(car, slipx.Tier.L2_DoubleTrack)


def _mf_lite(alpha, K, mu, C, E):
    Bx = K / (C * mu) * alpha
    return mu * np.sin(C * np.arctan(Bx - E * (Bx - np.arctan(Bx))))


def _refusal(car, tier):
    with pytest.raises(ValueError) as refused:
        car.params_for_tier(tier)
    return str(refused.value)


def test_the_folder_of_slipx_holds_value_and_deviation_of_each_number_of_a_tire():
    model = fitted(SMALL, sd=0.3)
    files = slipx_files(model, np.random.default_rng(0), TODAY)
    text = files["tyres/rubber_as-driven-front.yaml"]
    assert set(files) >= {"car.yaml", "dynamics.yaml", "limits.yaml", "provenance.yaml"}
    assert all(one.startswith('schema_version: "0.2.0"') for one in files.values())
    for name in ("linear.c_alpha", "friction.mu_y0", "mf_lite.C", "mf_lite.E", "relaxation.sigma"):
        value, stddev = re.search(rf"    {name}: {{value: (\S+), stddev: (\S+),", text).groups()
        assert f"{name.split('.')[1]}: {value}" in text.split("provenance:")[0]
        assert float(stddev) > 0.0
    stiff = float(re.search(r"c_alpha: {value: \S+, stddev: (\S+),", text)[1])
    expected = next(one for one in model.estimates() if one.title == "cornering stiffness")
    assert stiff == pytest.approx(0.5 * expected.sd, rel=0.4)
    assert re.search(r"curve of tireid by at most \S+ % of its largest", text)
    assert "2026-11-26" in text and "typical of the class" in text


def test_a_car_that_slipx_does_not_describe_is_refused_in_one_line():
    with pytest.raises(ValueError, match=r"slipx describes cars of 1:10, mass within .* has 1500"):
        slipx_files(fitted(), np.random.default_rng(0), TODAY)
