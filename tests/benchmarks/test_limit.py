"""The limit of grip against what the tires can give."""

import numpy as np
import pytest

from benchmarks.mpc_cases import cornering_limit
from models.tires import FialaTire, MagicFormula
from models.vehicle import GRAVITY, sedan
from mpc.tires.ladder import cornering_force

SLIPS = np.linspace(0.005, 0.4, 200)


@pytest.mark.parametrize("mu", [1.0, 0.5])
def test_the_limit_is_a_little_less_than_the_weaker_axle_gives_to_the_side(mu):
    car = sedan()
    tire = MagicFormula.from_tir(car.require_chassis().tire)
    axles = [
        cornering_force(car, tire, axle, SLIPS, mu).max() / car.axle_loads[axle] for axle in (0, 1)
    ]
    assert cornering_limit(car, tire, mu) / (GRAVITY * min(axles)) == pytest.approx(0.98, abs=0.02)


def test_without_load_sensitivity_the_limit_is_nearly_friction_times_gravity():
    tire = FialaTire(C_alpha=60e3, C_kappa=60e3, friction=0.8)
    for mu in (1.0, 0.5):
        share = cornering_limit(sedan(), tire, mu) / (0.8 * mu * GRAVITY)
        assert 0.96 < share < 1.0
