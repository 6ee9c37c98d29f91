"""The shipped C from Python."""

import re
from dataclasses import replace

import numpy as np
import pytest

from codegen import find_compiler
from identifier.export.compiled import samples_of
from identifier.export.package import build_package
from identifier.methods import make_method
from identifier.run import identify
from models.vehicle import sedan
from tests.kept import Kept
from tests.shipped import Shipped, Status

CAR = sedan()
pytestmark = pytest.mark.skipif(find_compiler() is None, reason="needs a C compiler")


@pytest.mark.parametrize("law", ["integral", "inertial"])
def test_sample_by_sample_is_the_whole_recording(packages, slalom, law):
    one, all_at_once = (Shipped.of(packages[law]) for _ in range(2))
    rows = samples_of(slalom, one.inputs)[:300]
    forces = np.array([one.step(*row)[1] for row in rows])
    np.testing.assert_array_equal(forces, all_at_once.run_samples(rows).axle_force)
    assert one.state == all_at_once.state


@pytest.mark.sweep("axle")
@pytest.mark.parametrize("law", ["integral", "axle"])
def test_frozen_c_is_the_frozen_model(law, packages, slalom):
    method = make_method(law, CAR)
    run = Shipped.of(packages[law])
    run.run(slalom)
    learnt = run.weights
    model = identify(slalom, CAR, method).freeze(float(slalom.t[-1]))
    run.set_adaptation(False)
    run.reset()
    frozen = run.run(slalom).axle_force
    assert np.abs(frozen - model.predict(slalom)).max() < 1e-6
    for name, value in run.weights.items():
        np.testing.assert_array_equal(value, learnt[name])


def test_weights_go_to_another_instance_reset_keeps_them_and_init_forgets(packages, slalom):
    one, two = (Shipped.of(packages["integral"]) for _ in range(2))
    first = one.run(slalom).axle_force
    assert np.abs(two.weights["W"]).max() == 0.0
    learnt = one.weights
    assert two.takes(learnt)
    one.reset()
    np.testing.assert_array_equal(one.weights["W"], learnt["W"])
    np.testing.assert_array_equal(one.run(slalom).axle_force, two.run(slalom).axle_force)
    one.init()
    np.testing.assert_array_equal(one.run(slalom).axle_force, first)


def test_every_status_is_told(packages):
    run = Shipped.of(packages["integral"])
    assert run.step(20.0, 0.1, 0.1, 0.01)[0] == Status.OK
    force = run.step(20.0, 0.1, 0.1, 0.01)[1]
    assert run.step(0.0, 0.0, 0.0, 0.0)[0] == Status.REST
    assert run.step(20.0, 100.0, 0.1, 0.01)[0] == Status.IMPLAUSIBLE
    run.step(20.0, 0.1, 0.1, 0.01)
    status, held = run.step(20.0, float("nan"), 0.1, 0.01)
    assert status == Status.BAD_INPUT
    np.testing.assert_allclose(held, force, rtol=0.05)
    assert run.faults == 2


def test_the_default_goes_on_with_the_last_sample_that_it_believes(packages):
    run = Shipped.of(packages["axle"])
    for _ in range(100):
        assert run.step(20.0, 0.1, 0.1, 0.01)[0] == Status.OK
    before = run.step(20.0, 0.1, 0.1, 0.01)[1]
    status, force = run.step(20.0, 8.0, 0.1, 0.01)
    assert status == Status.IMPLAUSIBLE
    np.testing.assert_allclose(force, before, rtol=0.05)
    assert run.faults == 1
    assert run.step(20.0, 0.1, 0.1, 0.01)[0] == Status.OK
    for _ in range(26):
        status, force = run.step(20.0, 100.0, 0.1, 0.01)
    assert (status, *force) == (Status.IMPLAUSIBLE, 0.0, 0.0)
    assert run.faults == 27


def test_a_y_comes_last_and_may_be_missing(packages, slalom):
    seeing, blind = (Shipped.of(packages["inertial"]) for _ in range(2))
    rows = samples_of(slalom, seeing.inputs)[:300]
    forces, without = (
        np.array([one.step(*row[:n])[1] for row in rows]) for one, n in ((seeing, 6), (blind, 5))
    )
    assert np.abs(without - forces).max() > 10.0


@pytest.fixture(scope="module")
def learnt(packages, slalom):
    """By law and precision, a package that has learnt for 45 s."""

    def make(key):
        law, single = key
        run = Shipped.of(packages[law], single=single)
        run.run(slalom)
        return run

    return Kept(make)


@pytest.mark.parametrize("single", [False, True])
def test_factors_are_taken_where_no_variance_is_negative(learnt, single, rng):
    """P = U D U' is a covariance just where D is not negative, whatever U is."""
    run = learnt["axle", single]
    weights = run.weights
    size = weights["UD"].shape[1]
    q = round((np.sqrt(8 * size + 1) - 1) / 2)
    diagonal = np.flatnonzero(np.equal(*np.triu_indices(q)))
    assert diagonal.size == q
    for place in [*diagonal, *rng.choice(size, 20)]:
        for axle in (0, 1):
            factors = rng.normal(size=(2, size))
            factors[:, diagonal] = np.abs(factors[:, diagonal])
            factors[axle, place] = -1e-9
            before = run.state
            assert run.takes({**weights, "UD": factors}) == (place not in diagonal)
            assert (run.state == before) == (place in diagonal)
    assert run.takes(weights)


@pytest.mark.parametrize("law", ["axle", "inertial"])
@pytest.mark.parametrize("single", [False, True])
def test_weights_are_taken_within_their_limits_and_not_beyond(law, single, learnt, packages):
    run = learnt[law, single]
    weights = run.weights
    assert run.takes(weights)
    for kept in packages[law].specialized.ranges:
        old = weights[kept.port].ravel()[kept.first : kept.first + len(kept.shares)]
        for end, sign in ((kept.low, -1), (kept.high, 1)):
            for away in (1e-4, -1e-4):  # of the range: outside, inside
                value = weights[kept.port].copy()
                missing = end + sign * away * (kept.high - kept.low) - old @ kept.shares
                value.flat[kept.first] += missing / kept.shares[0]
                before = run.state
                taken = run.takes({**weights, kept.port: value})
                if away > 0.0:
                    assert (taken, run.state) == (False, before), kept
                elif kept.port != "W":  # whose numbers keep several ranges
                    assert taken, kept
    assert run.takes(weights)


@pytest.mark.parametrize("law", ["axle", "inertial"])
@pytest.mark.parametrize("single", [False, True])
def test_weights_that_a_run_begins_with_are_taken_wherever_they_lie(law, single):
    axle = make_method("axle", CAR)
    model = axle.frozen(CAR, axle.setup(CAR).carry)
    start = replace(model, W=9.0 * model.W)  # seven loads
    run = Shipped.of(build_package(make_method(law, CAR), CAR, start), single=single)
    assert run.takes(run.weights)


def test_a_folder_is_loaded_with_its_own_precision(write, slalom):
    package = build_package(make_method("integral", CAR), CAR, single=True, name="mine")
    folder = write(package)
    from_folder = Shipped.from_folder(folder)
    assert from_folder.single
    assert from_folder.version.startswith(f"mine {package.about['hash']}")
    np.testing.assert_array_equal(
        from_folder.run(slalom).axle_force, Shipped.of(package).run(slalom).axle_force
    )


def test_an_input_on_its_limit_is_taken_and_one_beyond_is_not(packages):
    package = packages["integral"]
    text = "\n".join(package.files.values())
    limit = {
        name: float(re.search(rf"#define TIREID_{name.upper()} \((\S+)\)", text).group(1))
        for name in ("max_speed", "max_yaw_rate", "max_steering")
    }
    names = ("max_speed", "max_speed", "max_yaw_rate", "max_steering", "max_steering")
    run = Shipped.of(package)
    for place, name in enumerate(names):
        for side in (1.0, -1.0):
            for size, refused in (
                (limit[name], False),
                (np.nextafter(limit[name], np.inf), True),
                (np.inf, True),
                (np.nan, True),
            ):
                run.init()
                sample = [20.0, 0.1, 0.1, 0.01, 0.0]
                sample[place] = side * size
                assert (run.step(*sample)[0] == Status.BAD_INPUT) == refused, (name, side, size)
