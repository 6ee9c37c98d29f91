"""Refused samples in the shipped C: the same rule as beside a car in Python, and its status."""

from dataclasses import replace

import numpy as np
import pytest

from codegen import find_compiler
from identifier.export.compiled import samples_of
from identifier.export.specialize import SIDE_SLIP
from identifier.methods import make_method
from identifier.run import OnlineIdentifier, identify
from models.vehicle import sedan
from tests.identifier.export.conftest import BANKED
from tests.kept import Kept
from tests.rivals import INSTALLED
from tests.shipped import Shipped, Status

CAR = sedan()
TOLD = ("linear_kf",) * INSTALLED
OTHERS = ("lagged_ekf", *TOLD)
LAWS = ("axle", "integral", *OTHERS, BANKED, "inertial")
TELL_V_Y = (*TOLD, "inertial")
pytestmark = pytest.mark.skipif(find_compiler() is None, reason="needs a C compiler")


@pytest.fixture(scope="module")
def shipped(packages):
    """By law, what a package is computed with; each test begins anew."""
    return Kept(lambda law: Shipped.of(packages[law]))


def method_of(law):
    return make_method("axle" if law == BANKED else law, CAR)


def driven(slalom, package):
    return samples_of(slalom, package.inputs)[:1500]


def with_gaps(rows):
    rows[300:303, 1] = np.nan
    rows[400:420, 2] = np.inf
    rows[500:550, 0] = np.nan
    rows[700:900, 3] = 1e308
    rows[1000:1060] = np.nan
    rows[1100:1110, 4] = -np.inf
    return rows


def in_python(law, rows):
    online = OnlineIdentifier(method_of(law), CAR, 0.01)
    told = []
    for row in rows:
        force = online.update(row[1:3], row[3:5], row[0], *row[5:])
        others = [value for port, value in online.outputs.items() if port in SIDE_SLIP]
        told.append(np.concatenate([[online.stale], force, *others]))
    return np.array(told), online


@pytest.mark.parametrize("law", LAWS)
def test_gaps_are_met_as_beside_a_car_in_python(law, shipped, slalom):
    package, rows = shipped[law], with_gaps(driven(slalom, shipped[law]))
    package.init()
    run = package.run_samples(rows)
    told, online = in_python(law, rows)
    assert np.abs(run.axle_force - told[:, 1:3]).max() < 1e-6
    for port, value in zip(SIDE_SLIP, told[:, 3:].T, strict=False):
        assert np.abs(run.outputs[port].ravel() - value).max() < 1e-9
    np.testing.assert_array_equal(run.status == Status.STALE, told[:, 0] > 0)
    read = [0, 2, 3, 4] if law in TELL_V_Y else slice(5)  # whose v_y may be missing
    refused = ~(np.abs(rows[:, read]) < 1e3).all(axis=1)
    np.testing.assert_array_equal(np.isin(run.status, [Status.BAD_INPUT, Status.STALE]), refused)
    assert shipped[law].faults >= refused.sum() == online.counts.refused
    for name, value in shipped[law].weights.items():
        kept = online.state()[name]
        if name == "UD" or kept.shape != value.shape:
            kept = kept.reshape(value.shape)
        np.testing.assert_allclose(value, kept, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("channel", range(5))
@pytest.mark.parametrize("gap", [20, 50, 200])
def test_every_channel_heals(law, channel, gap, shipped, slalom):
    rows = driven(slalom, shipped[law])
    shipped[law].init()
    clean = shipped[law].run_samples(rows).axle_force
    rows[800 : 800 + gap, channel] = np.nan
    shipped[law].init()
    force = shipped[law].run_samples(rows).axle_force
    after = slice(800 + gap + 30, 1500)
    size = np.sqrt((clean[after] ** 2).mean(0))
    assert (np.sqrt(((force - clean)[after] ** 2).mean(0)) < 0.03 * size).all()


@pytest.mark.parametrize("law", LAWS)
def test_a_drive_in_segments_gives_the_forces_of_the_same_run_in_python(law, shipped, slalom):
    drive = slalom if "a_y" in shipped[law].inputs else replace(slalom, a_y=None)
    drive = drive.taken(np.r_[:900, 1100:2000])
    shipped[law].init()
    run = shipped[law].run(drive)
    told = identify(drive, CAR, method_of(law))
    assert np.abs(run.axle_force - told.axle_force).max() < 1e-6
    assert run.status.shape == (len(drive),) and (run.status == Status.OK).all()
