"""The Monte Carlo of the bounds asks the certificate itself, and its alarm rings."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks import bounds_monte_carlo
from benchmarks.bounds_monte_carlo import driven, proven_design, random_driving, record, run
from benchmarks.random_drives import random_vehicle
from benchmarks.targets import Targets
from identifier.certificate import Certificate
from identifier.methods import certify
from identifier.paper.network import Network


@pytest.fixture(name="case", scope="module")
def a_case():
    rng = np.random.default_rng(2)
    vehicle = random_vehicle(rng)
    driving = random_driving(rng, vehicle)
    return vehicle, *proven_design(rng, vehicle, driving, Network(hidden=5))


def test_the_bounds_of_a_design_are_those_of_the_command(case):
    vehicle, design, certificate = case
    assert certificate == certify(design, vehicle)
    assert certificate["error_bound"].value < np.inf


def test_weights_are_resumed_and_sensors_err_on_the_drives(case, monkeypatch):
    vehicle, design, certificate = case
    asked = {}

    def told(design, vehicle, driving, count, *, beginning, rng):
        asked.update(driving=driving, W=beginning.W, count=count)

    monkeypatch.setattr(bounds_monte_carlo, "monte_carlo", told)
    driven(design, vehicle, certificate, 16, np.random.default_rng(0))
    bound = certificate["weight_bound"].value
    assert asked == {"driving": design.driving, "W": bound, "count": 16}
    kinds = [random_driving(np.random.default_rng(k), vehicle) for k in range(8)]
    assert {kind.noise_r > 0.0 for kind in kinds} == {True, False}


@pytest.mark.heavy
@pytest.mark.parametrize("share", [1.0, 1e-3])
def test_a_bound_that_is_passed_misses_the_target(monkeypatch, share):
    """A certificate that states a thousandth of what it proves is found out."""

    def planted(design, vehicle):
        found = certify(design, vehicle)
        entries = (
            replace(e, value=share * e.value) if e.name.endswith("_bound") else e
            for e in found.properties
        )
        return Certificate(properties=tuple(entries))

    monkeypatch.setattr(bounds_monte_carlo, "certify", planted)
    targets = Targets("bounds_monte_carlo")
    record([run(1, 4)], targets)
    passed = {key: targets.values[f"{key}/passed"] for key in bounds_monte_carlo.PROVEN}
    if share == 1.0:
        assert targets.finish(keep=False) == 0
        assert set(passed.values()) == {0}
    else:
        assert targets.finish(keep=False) == 1
        assert passed["leakage"] == 4
