"""The guaranteed band: two linear programs, no drive outside, and a wrong bound is told."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import linprog

from identifier.axle import AxleIdentifier
from identifier.axle.guarantee import (
    Doubt,
    ForceBound,
    HalfSpaces,
    PossibleWeights,
    Strips,
    force_rate,
    grip_lost,
    least_bound,
    possible_weights,
    prior_box,
    slip_beyond,
    strip_sides,
    vertices,
)
from identifier.frozen import FrozenModelError
from identifier.methods import make_method
from identifier.run import identify
from identifier.tire_model import load_model
from identifier.verdict import BoundViolatedError, calibrated, contradictions, guaranteed
from identifier.verdict.guaranteed import strips_of
from models.friction import Friction, FrictionChange
from models.vehicle import sedan
from tests.identifier.conftest import steered

DESIGN = AxleIdentifier.for_vehicle(sedan())
LADDER = np.array(DESIGN.ladder)
BOX = prior_box(DESIGN.bounds, DESIGN.ladder)
TIRE = np.array([0.15, 0.4, 0.3, 0.1])  # weights that some tire could have
SLIP = np.linspace(-0.3, 0.3, 31)


def drawn_strips(rng, error, m=120):
    """Means of a drive of that tire, both axles alike, off by up to an error."""
    h = np.tanh(rng.uniform(-0.12, 0.12, m)[:, None] / LADDER)
    return steady_strips(h @ TIRE + error * rng.uniform(-1.0, 1.0, m), h)


def steady_strips(y, h):
    """Means of a drive within the slip that taught, at 20 m/s, whose forces do not change."""
    m, nothing = len(y), np.zeros((len(y), 2))
    still = {"beyond": nothing, "rate": nothing, "lost": nothing, "v_x": np.full(m, 20.0)}
    both = {"y": np.column_stack([y, y]), "h": np.repeat(h[:, None], 2, axis=1)}
    return Strips(**both, **still, t=0.1 * np.arange(m))


def swung(seed, speed, **road):
    return steered(seed, 16.0, speed=speed, **road).recording()


@pytest.fixture(scope="module", name="run")
def a_run():
    return identify(replace(swung(3, 20.0), axle_force=None), sedan(), DESIGN)


@pytest.fixture(scope="module", name="model")
def a_model(run):
    return guaranteed(run)


def test_vertices_give_what_two_linear_programs_of_a_slip_give():
    strips = drawn_strips(np.random.default_rng(1), 0.05)
    bound = ForceBound(error=(0.06, 0.06))
    corners = possible_weights(strips, 0, bound, BOX)
    sides = BOX.both(strip_sides(strips.y[:, 0], strips.h[:, 0], np.full(120, 0.06)))
    for slip in (0.005, 0.03, 0.1, 0.4):
        t = np.tanh(slip / LADDER)
        ends = [
            sign * linprog(sign * t, sides.A, sides.b, bounds=(None, None), method="highs").fun
            for sign in (1.0, -1.0)
        ]
        np.testing.assert_allclose([(corners @ t).min(), (corners @ t).max()], ends, atol=1e-7)


def test_many_more_constraints_than_are_tried_first_lead_to_the_same_polytope():
    strips = drawn_strips(np.random.default_rng(2), 0.05, m=2000)
    sides = BOX.both(strip_sides(strips.y[:, 1], strips.h[:, 1], np.full(2000, 0.055)))
    corners = vertices(sides)
    assert corners is not None and (sides.b[:, None] + 1e-8 >= sides.A @ corners.T).all()
    touched = np.sum(np.isclose(sides.A @ corners.T, sides.b[:, None], atol=1e-7), axis=0)
    assert (touched >= LADDER.size).all()  # each is where four sides meet


@pytest.mark.parametrize("seed", range(5))
def test_the_tire_that_drove_is_among_the_possible_ones(seed):
    strips = drawn_strips(np.random.default_rng(seed), 0.04)
    corners = possible_weights(strips, 0, ForceBound(error=(0.04, 0.04)), BOX)
    true, possible = np.tanh(SLIP[:, None] / LADDER) @ TIRE, np.tanh(SLIP[:, None] / LADDER)
    span = possible @ corners.T
    assert (span.min(axis=1) <= true + 1e-9).all() and (true <= span.max(axis=1) + 1e-9).all()
    e, tau = least_bound(strips, 0, BOX)
    assert e <= 0.04 and tau == 0.0
    assert possible_weights(strips, 0, ForceBound(error=(0.99 * e, 1.0)), BOX) is None
    assert possible_weights(strips, 0, ForceBound(error=(1.01 * e, 1.0)), BOX) is not None


def test_where_nothing_is_excited_the_prior_box_stays():
    rng = np.random.default_rng(3)
    quiet = drawn_strips(rng, 0.0)
    quiet = quiet._replace(h=1e-6 * quiet.h, y=1e-6 * quiet.y)  # straight ahead
    corners, box = possible_weights(quiet, 0, ForceBound(error=(0.05, 0.05)), BOX), vertices(BOX)
    T = np.tanh(SLIP[:, None] / LADDER)
    for side in (np.min, np.max):
        np.testing.assert_allclose(side(T @ corners.T, axis=1), side(T @ box.T, axis=1), atol=1e-7)
    small = drawn_strips(rng, 0.0)
    known = possible_weights(small, 0, ForceBound(error=(0.05, 0.05)), BOX)
    wide = [np.ptp(np.tanh(at / LADDER) @ known.T) for at in (0.1, 0.5)]
    assert wide[1] > 2.0 * wide[0]  # slip beyond 0.12 rad was not driven


def test_a_box_holds_brush_tires_and_no_tire_that_stiffens():
    for stiffness, friction in ((4.0, 0.3), (12.0, 0.9), (35.0, 1.6)):
        sliding = np.minimum(np.tan(np.abs(SLIP)) * stiffness / (3.0 * friction), 1.0)
        force = np.sign(SLIP) * friction * (1.0 - (1.0 - sliding) ** 3)
        strips = steady_strips(force, np.tanh(SLIP[:, None] / LADDER))
        assert least_bound(strips, 0, BOX)[0] < 0.05 * friction
    stiffens = np.array([-0.4, 0.0, 0.0, 2.5])
    assert (BOX.b >= BOX.A @ TIRE).all() and not (BOX.A @ stiffens <= BOX.b).all()


def test_forces_of_drives_that_were_not_seen_are_inside(model):
    for seed, speed in ((4, 17.0), (5, 23.0)):
        drive = swung(seed, speed)
        low, high = model.guarantee.over(replace(drive, axle_force=None))
        late = drive.t > 1.0
        assert ((low <= drive.axle_force) & (drive.axle_force <= high))[late].all()
        t, broken = contradictions(model, drive)
        assert len(t) > 100 and not broken.any()
        away = np.abs(model.predict(drive) - drive.axle_force)[late].max(axis=0)
        assert (0.5 * (high - low)[late].mean(axis=0) < 5.0 * away).all()


def test_another_road_contradicts_the_guarantee(model):
    wet = swung(4, 17.0, friction=Friction(changes=(FrictionChange(scale=0.5, at_time=6.0),)))
    t, broken = contradictions(model, wet)
    assert broken.any(axis=0).all() and t[broken.any(axis=1)][0] > 5.7
    low, high = model.guarantee.over(wet)
    assert not ((low <= wet.axle_force) & (wet.axle_force <= high)).all()


def test_a_told_bound_is_taken_or_its_violation_is_told(run, model):
    told = guaranteed(run, 0.3)
    assert told.guarantee.possible.given and not model.guarantee.possible.given
    assert told.guarantee.possible.bound == ForceBound(error=(0.3, 0.3))
    with pytest.raises(BoundViolatedError, match=r"violated at the front axle: .* from .* s on"):
        guaranteed(run, 0.002)
    for wrong in (0.0, -0.1, np.nan, 11.0):
        with pytest.raises(ValueError, match="bound of an error"):
            guaranteed(run, wrong)
    with pytest.raises(ValueError, match="lateness"):
        ForceBound(error=(0.1, 0.1), lateness=(0.0, 2.0))


def test_only_what_came_before_a_freeze_teaches(run):
    early = guaranteed(run, 0.2, t=8.0)
    shown = strips_of(run.freeze(8.0), run.recording)
    before = shown.until(int(np.sum(shown.t + 0.3 <= 8.0 + 1e-9)))
    corners = possible_weights(before, 0, ForceBound(error=(0.2, 0.2)), BOX)
    np.testing.assert_allclose(
        np.sort(early.guarantee.possible.corners[0], axis=0), np.sort(corners, axis=0), atol=1e-9
    )


def test_a_band_is_asked_as_a_force_is(model):
    low, high = model.guarantee.at(0.05, "rear")
    assert low < model.force(0.05, "rear") < high
    both = model.guarantee.at([[0.05, 0.1]])
    assert both[0].shape == (1, 2, 2) and both[0][0, 0, 1] == pytest.approx(low)
    fast = model.guarantee.possible.fastest[0]
    slow, quick = (model.guarantee.at(0.05, "front", rate) for rate in (0.0, fast))
    late = model.guarantee.possible.bound.lateness[0] * fast * model.vehicle.axle_loads[0]
    assert slow[0] - quick[0] == pytest.approx(late) == quick[1] - slow[1]
    with pytest.raises(ValueError, match="axle must be front or rear"):
        model.guarantee.at(0.05, "left")


def test_a_stored_guarantee_comes_back(model, tmp_path):
    path = tmp_path / "weights.json"
    model.save(path)
    again = load_model(path)
    np.testing.assert_array_equal(again.guarantee.at(SLIP), model.guarantee.at(SLIP))
    data = model.to_dict()
    for key, wrong in (
        ("corners", [[[1.0, 2.0]], [[1.0, 2.0]]]),
        ("error_static_axle_loads", [0.1]),
        ("lateness_s", [0.0, -1.0]),
        ("given", "yes"),
        ("speed_m_s", -3.0),
    ):
        with pytest.raises(FrozenModelError):
            type(model).from_dict(data | {"guarantee": data["guarantee"] | {key: wrong}}, "file")
    with pytest.raises(FrozenModelError, match="missing"):
        type(model).from_dict(data | {"guarantee": {"given": True}}, "file")


def test_a_calibrated_model_can_carry_it(run, model):
    both = guaranteed(run, model=calibrated(run))
    assert both.calibration is not None
    np.testing.assert_array_equal(both.guarantee.at(SLIP), model.guarantee.at(SLIP))


def test_without_a_set_of_weights_of_this_car_and_road_there_is_no_guarantee(run, model):
    car, log = sedan(), run.recording
    paper = guaranteed(identify(log, car, make_method("integral", car)))
    assert paper.guarantee is None and contradictions(paper, log) is None
    assert run.freeze().guarantee is None
    short = guaranteed(identify(log.between(0.0, 0.5), car, DESIGN))
    blind = guaranteed(identify(replace(log, v_y=None), car, make_method("inertial", car)))
    assert short.guarantee is None and blind.guarantee is None
    heavier = replace(car, mass=1.2 * car.mass)
    for other in (model.mounted_on(heavier), model.band.on_another_road()):
        assert other.guarantee is None


def test_the_rate_of_a_ramp_is_its_slope_and_fades_behind_it():
    dt, t = 0.01, np.arange(300)
    ramp = np.minimum(0.02 * t, 2.0)  # 2 per second, for a second
    units = np.repeat(ramp[:, None, None], 2, axis=1)
    curves = np.ones((1, 1)), np.full((1, 1), 0.5)
    rate = force_rate(units, curves, dt, [slice(0, 300)])
    np.testing.assert_allclose(rate[:99], np.tile([2.0, 1.0], (99, 1)))
    np.testing.assert_allclose(rate[200, 0], 2.0 * np.exp(-1.0 / 0.3), rtol=0.05)
    gap = force_rate(units, curves, dt, [slice(0, 150), slice(150, 300)])
    assert (gap[150:] == 0.0).all()  # nothing is remembered over a gap
    several = force_rate(units, (np.array([[0.2], [-3.0], [1.0]]), curves[1]), dt, [slice(0, 300)])
    np.testing.assert_allclose(several, rate * [3.0, 1.0])  # that which changes most counts


def test_slip_beyond_what_taught_is_remembered_for_a_while():
    dt, slip = 0.01, np.zeros((200, 2))
    slip[50:53, 0] = [-0.15, 0.3, 0.12]
    beyond = slip_beyond(slip, np.array([0.1, 0.2]), dt, [slice(0, 120), slice(120, 200)])
    np.testing.assert_allclose(beyond[49:52, 0], [0.0, 0.5, 2.0])
    np.testing.assert_allclose(beyond[51:120, 0], 2.0 * np.exp(-dt * np.arange(69) / 0.3))
    assert (beyond[120:] == 0.0).all() and (beyond[:, 1] == 0.0).all()
    again = np.tile(slip, (200, 1))  # it decays by sums of exponents: none may overflow
    assert np.isfinite(slip_beyond(again, np.array([0.1, 0.2]), 1.0, [slice(0, 40_000)])).all()


def test_a_return_from_slip_that_did_not_teach_stays_inside(model):
    """A slower car with twice the slip comes back late: what no curve of the drive shows."""
    for seed, speed in ((6, 13.0), (9, 16.0)):
        drive = swung(seed, speed, amplitude=0.25)
        units, doubt = model.signals_of(drive)
        assert np.abs(model.lagged_slip(drive)).max() > 1.5 * model.excitation[:, 0].max()
        y, late = drive.axle_force / model.vehicle.axle_loads, drive.t > 1.0
        low, high = model.guarantee.possible.limits(units, doubt)
        assert ((low <= y) & (y <= high))[late].all()
        _, own = replace(model, possible=None).signals_of(drive)
        assert (doubt.rate >= own.rate - 1e-9).all()  # the model's is possible too
        low, high = model.guarantee.possible.limits(
            units, Doubt(0.0 * own.beyond, own.rate, 0.0 * own.lost)
        )
        assert not ((low <= y) & (y <= high))[late].all()  # the same without either


def test_what_the_car_drives_or_brakes_with_may_be_missing_sideways(model):
    lost = grip_lost(np.array([[0.3, 0.0], [-0.4, 2.0]]), np.array([0.5, 0.5]))
    np.testing.assert_allclose(lost, [[0.2, 0.0], [0.4, 1.0]])  # 3, 4 and 5 make an ellipse
    drive = swung(4, 17.0)
    pulls = replace(drive, v_x=drive.v_x + 2.0 * np.maximum(drive.t - 8.0, 0.0))  # 2 m/s² from 8 s
    units, doubt = model.signals_of(pulls)
    before, late = (drive.t > 2.0) & (drive.t < 8.0), drive.t > 10.0
    loads, carried = model.vehicle.axle_loads, model.force(model.driven_slip).diagonal()
    expected = 1.0 - np.sqrt(1.0 - (2.0 * model.vehicle.mass / carried) ** 2)
    np.testing.assert_allclose(doubt.lost[late].mean(axis=0), expected, rtol=0.25)
    assert (doubt.lost[before] < 0.1 * expected).all()
    low, high = model.guarantee.possible.limits(units, doubt)
    least, most = model.guarantee.possible.limits(units, doubt._replace(lost=0.0 * doubt.lost))
    assert (low <= least).all() and (high >= most).all()
    reach, at = model.guarantee.possible.reach(units), np.argmax(np.where(late, least[:, 1], -1.0))
    np.testing.assert_allclose((least - low)[at, 1], (doubt.lost * reach[0])[at, 1])
    assert high[at, 1] == most[at, 1]  # nothing along the car makes more of a side force
    assert (carried / loads < 2.0).all()


def test_the_bound_grows_with_a_rate_that_did_not_teach(model):
    """Twice as fast as anything that taught: the error may be twice as large, beside τ ρ."""
    given, axles = model.guarantee.possible, ("front", "rear")
    for i, axle in enumerate(axles):
        unchanged = model.guarantee.at(0.02, axle, rate=given.fastest[i])
        twice = model.guarantee.at(0.02, axle, rate=2.0 * given.fastest[i])
        more = given.bound.error[i] + given.bound.lateness[i] * given.fastest[i]
        more *= model.vehicle.axle_loads[i]
        np.testing.assert_allclose(np.subtract(twice, unchanged), [-more, more], rtol=1e-9)


def test_the_bound_grows_with_slip_that_did_not_teach(model):
    driven, wide = model.excitation[0, 0], ForceBound(error=(0.1, 0.1))
    np.testing.assert_allclose(
        wide.allowed(np.array([[0.0, 0.5]]), np.zeros((1, 2))), [[0.1, 0.15]]
    )
    at = np.array([driven, 2.0 * driven])
    low, high = (side[:, 0] / model.vehicle.axle_loads[0] for side in model.guarantee.at(at))
    units = np.repeat(np.tanh(at[:, None] / LADDER)[:, None], 2, axis=1)
    least, most = (side[:, 0] for side in model.guarantee.possible.reach(units))
    error = model.guarantee.possible.bound.error[0]
    np.testing.assert_allclose(high - most, [error, 2.0 * error])
    np.testing.assert_allclose(least - low, [error, 2.0 * error])


def test_an_empty_guarantee_is_refused():
    told = {"bound": ForceBound(error=(1, 1)), "given": True, "speed": 9.0}
    with pytest.raises(ValueError, match="corners"):
        PossibleWeights(**told, corners=(np.ones((0, 4)),) * 2, fastest=(1.0, 1.0))
    with pytest.raises(ValueError, match="fastest force"):
        PossibleWeights(**told, corners=(np.ones((1, 4)),) * 2, fastest=(1.0, 0.0))
    nowhere = HalfSpaces(np.array([[1.0], [-1.0]]), np.array([0.0, -1.0]))
    assert vertices(nowhere) is None
