"""Identifier and tracker together: they build, hand tires over, and drive a car neither knows."""

import ctypes
import re
import subprocess
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from identifier.axle.slip import Sensors
from identifier.export.package import build_package
from identifier.methods import make_method
from models.vehicle import sedan
from mpc.export.pair import DELAY, NoHandoverError, build_pair, frozen_start
from mpc.realtime import Tracker
from mpc.tires import prediction_tire
from tests.identifier.conftest import slalom_of
from tests.identifier.export.conftest import require_silence
from tests.kept import Kept
from tests.mpc.export.conftest import LAWS, STRICT, c_files, put_pair
from tests.rivals import rival
from tests.shipped import Shipped

CAR = sedan()
INCLUDES = ["-Iinclude", "-Iidentifier/include", "-Impc/include"]


@pytest.mark.sweep("gcc-precision0-axle", "clang-precision1-integral")
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("precision", [(0, 0), (1, 0), (0, 1)])
def test_example_and_handover_have_no_warning_in_any_mix_of_precisions(
    law, precision, compiler, pairs, write_pair, run
):
    folder = write_pair(pairs[law])
    defines = [f"-DTIREID_SINGLE={precision[0]}", f"-DTIREID_MPC_SINGLE={precision[1]}"]
    sources = [*c_files(folder), *c_files(folder, "examples")]
    require_silence(folder, run, compiler, sources, *defines, *INCLUDES)


@pytest.fixture(scope="module")
def sensing():
    """By law, an identifier that reads a_y with a tracker: the default, and one that tells v_y."""
    return cache(lambda law: build_pair(build_package(make_method(law, CAR), CAR, with_a_y=True)))


def program(folder, run, single):
    """Build the example with its packages; return what the compiler says."""
    parts = ("", "identifier/", "mpc/")
    sources = [path for part in parts for path in c_files(folder, f"{part}src")]
    defines = [f"-DTIREID_SINGLE={single}", f"-DTIREID_MPC_SINGLE={single}"]
    words = [*STRICT, "-O1", "-ffp-contract=off", *defines, *INCLUDES, *sources]
    return run("gcc", *words, *c_files(folder, "examples"), "-lm", "-o", "loop", cwd=folder)


def require_lane_kept(said, log):
    rms = [float(text) for text in re.findall(r"rms ([\d.]+) m", said)]
    exported, learnt = np.array(rms).reshape(2, -1)
    assert learnt[-1] < 0.6 * exported[-1]  # what was learnt is worth something
    rows = np.loadtxt(log, delimiter=",", skiprows=1)
    assert np.abs(rows[:, 3]).max() < 0.3
    return rows


@pytest.mark.heavy
@pytest.mark.parametrize(("law", "single"), [("axle", 0), ("inertial", 0), ("inertial", 1)])
def test_a_car_with_an_accelerometer_keeps_its_lane(law, single, sensing, write_pair, run):
    """The inertial one without a sensor of v_y: the tracker steers by the v_y that is told."""
    folder = write_pair(sensing(law))
    answer = program(folder, run, single)
    assert (answer.returncode, answer.stderr) == (0, "")
    log = folder / "log.csv"
    answer = run(str(folder / "loop"), str(log))
    assert answer.returncode == 0, answer.stdout
    require_lane_kept(answer.stdout, log)


@pytest.mark.heavy
def test_what_is_learnt_without_v_y_is_handed_over_whole(sensing, write_pair):
    """Compliance, the share of sway, and the zero of the steering: as Python makes the tire."""
    pair = sensing("inertial")
    drive = replace(slalom_of(9.99), v_y=None)
    drive = replace(drive, delta_f=drive.delta_f - 0.004)
    library = joined(write_pair(pair))
    learnt = Shipped.of(pair.identifier, single=False)
    learnt.run(drive)
    weights, specialized = learnt.weights, pair.identifier.specialized
    assert np.abs(weights["sensors"]).max() > 5e-4
    state = {**specialized.carry, **weights}
    wanted = prediction_tire(specialized.method.frozen(CAR, state))
    assert wanted.weights[0] != 0.0  # the zero of the steering
    assert not np.allclose(wanted.weights, pair.tracker.tire.weights, rtol=0.01)
    taken, params = handed_over(library, pair, weights, 1.0)
    assert taken
    np.testing.assert_allclose(params["weights"], wanted.weights, rtol=1e-14)


@pytest.mark.heavy
@pytest.mark.parametrize(("law", "single"), [("integral", "OFF"), ("axle", "ON")])
def test_cmake_builds_both_and_the_learning_car_keeps_its_lane(law, single, pairs, write_pair, run):
    folder = write_pair(pairs[law])
    defines = [f"-DTIREID_SINGLE={single}", f"-DTIREID_MPC_SINGLE={single}"]
    answer = run("cmake", "-B", "build", *defines, cwd=folder)
    assert answer.returncode == 0, answer.stderr
    answer = run("cmake", "--build", "build", cwd=folder)
    assert answer.returncode == 0, answer.stderr
    assert "warning" not in answer.stderr
    answer = run("ctest", "--test-dir", "build", cwd=folder)
    assert answer.returncode == 0, answer.stdout
    assert "3 tests" in answer.stdout or "out of 3" in answer.stdout
    log = folder / "drives.csv"
    answer = run(str(folder / "build" / "tireid_closed_loop"), str(log))
    assert answer.returncode == 0, answer.stdout
    written = log.read_text()
    again = run(str(folder / "build" / "tireid_closed_loop"), str(log))
    assert (again.returncode, "exists" in again.stderr) == (2, True)
    assert log.read_text() == written
    rows = require_lane_kept(answer.stdout, log)
    assert (rows[:, -1] <= 1).all()


@pytest.fixture(scope="module")
def taught(pairs):
    """By law, the identifier after 10 s of a slalom, as C has learnt it."""

    def make(law):
        learner = Shipped.of(pairs[law].identifier, single=False)
        learner.run(slalom_of(9.99))
        return learner

    return Kept(make)


@pytest.fixture(scope="module")
def libraries(pairs, tmp_path_factory):
    """By law, the handover and the tracker in double."""

    def make(law):
        return joined(put_pair(tmp_path_factory.mktemp(law), pairs[law]))

    return Kept(make)


def joined(folder):
    """The handover and the tracker that lie in a folder."""
    sources = ["src/tireid_handover.c", "mpc/src/tireid_mpc_params.c"]
    flags = ["-std=c99", "-O1", "-ffp-contract=off", "-fPIC", "-shared", *INCLUDES]
    words = ["gcc", *flags, *sources, "-lm", "-o", "joined.so"]
    subprocess.run(words, cwd=folder, check=True)
    library = ctypes.CDLL(str(folder / "joined.so"))
    library.tireid_handover.restype = ctypes.c_bool
    return library


def handed_over(library, pair, weights, share):
    """Hand weights over in C; return whether they were taken, and the parameters then."""
    params = np.zeros((), pair.tracker.params.dtype)
    place = ctypes.c_void_p(params.ctypes.data)
    library.tireid_mpc_default_params(place)
    flat = np.concatenate([np.ravel(value) for value in weights.values()])
    taken = library.tireid_handover(
        ctypes.c_void_p(flat.ctypes.data), place, ctypes.c_double(share)
    )
    return taken, params


@pytest.mark.parametrize("law", LAWS)
def test_c_hands_over_what_python_makes_of_the_same_weights(law, taught, pairs, libraries):
    pair, weights = pairs[law], taught[law].weights
    specialized = pair.identifier.specialized
    state = {**specialized.carry, **weights}
    wanted = prediction_tire(specialized.method.frozen(specialized.vehicle, state))
    assert not np.allclose(wanted.weights, pair.tracker.tire.weights, rtol=0.01)
    taken, params = handed_over(libraries[law], pair, weights, 1.0)
    assert taken
    np.testing.assert_allclose(params["weights"], wanted.weights, rtol=1e-14)
    tracker = Tracker(pair.tracker.tire, period=0.01, delay=0.03)
    tracker.set_tire(wanted)  # which may do more than copy weights
    kept = {"caution", "grips", "prior", "surprise", "doubt", "doubt_step", "force_error"}
    kept.add("stiffness")  # what caution fears is of the tires that were exported
    for name in set(params.dtype.names) - kept:
        np.testing.assert_allclose(params[name], tracker.params[name], rtol=1e-14, err_msg=name)
    for name in kept:
        np.testing.assert_array_equal(params[name], pair.tracker.params[name], err_msg=name)


def test_how_sensors_are_mounted_stays_at_a_handover(write_pair):
    design = make_method("axle", CAR)
    fresh = design.frozen(CAR, design.setup(CAR).carry)
    start = replace(fresh, sensors=Sensors(0.01, 0.2, 0.05))
    pair = build_pair(build_package(design, CAR, start))
    weights = Shipped.of(pair.identifier, single=False).weights
    taken, params = handed_over(joined(write_pair(pair)), pair, weights, 1.0)
    assert taken
    np.testing.assert_allclose(params["weights"], prediction_tire(start).weights, rtol=1e-14)
    np.testing.assert_array_equal(params["weights"][[3, 1]], [0.01, 0.05])


@pytest.mark.parametrize("law", LAWS)
def test_a_share_moves_weights_that_far(law, taught, pairs, libraries):
    pair, weights = pairs[law], taught[law].weights
    _, whole = handed_over(libraries[law], pair, weights, 1.0)
    _, part = handed_over(libraries[law], pair, weights, 0.25)
    start = pair.tracker.tire.weights
    np.testing.assert_allclose(part["weights"], 0.75 * start + 0.25 * whole["weights"], rtol=1e-12)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e6])
def test_numbers_that_are_no_tire_change_nothing(law, value, taught, pairs, libraries):
    pair = pairs[law]
    weights = {name: array.copy() for name, array in taught[law].weights.items()}
    weights["W"][1, 2] = value
    taken, params = handed_over(libraries[law], pair, weights, 1.0)
    assert not taken
    np.testing.assert_array_equal(params["weights"], pair.tracker.tire.weights)


def test_a_curve_that_falls_is_no_tire(taught, pairs, libraries):
    weights = {**taught["axle"].weights, "W": -taught["axle"].weights["W"]}
    taken, _ = handed_over(libraries["axle"], pairs["axle"], weights, 1.0)
    assert not taken


@pytest.mark.parametrize(
    ("law", "complaint"), [rival("linear_kf", "no tire"), ("lagged_ekf", "CurveModel")]
)
def test_what_cannot_be_handed_over_is_said(law, complaint):
    with pytest.raises(NoHandoverError, match=complaint):
        build_pair(build_package(make_method(law, CAR), CAR))


def test_a_pair_holds_each_package_under_its_own_name(pairs):
    for pair in (pairs[law] for law in LAWS):
        assert pair.identifier.specialized.name + "_mpc" == pair.tracker.name
        assert pair.tracker.params["delay"] == DELAY


def test_a_car_with_downforce_has_no_handover_in_c():
    racer = replace(sedan(), downforce_area_front=1.0)
    package = build_package(make_method("axle", racer), racer)
    with pytest.raises(NoHandoverError, match="has downforce, which the handover in C does not"):
        frozen_start(package)
