"""What keeps the weights over hours: the paper's leakage forgets, the other two do not."""

from dataclasses import replace

import numpy as np
import pytest

from identifier.driving import natural_driving
from identifier.methods import certify, make_method
from identifier.paper.design import VARIANTS, PaperIdentifier, design_for, with_keeping
from identifier.run import identify
from identifier.stability.gain_design import DEFAULT_KEEPING, KEEPINGS
from models.maneuvers import RandomSteer, Slalom
from models.plant import Plant
from models.vehicle import sedan
from tireid.commands.demo_story import SENSORS

CAR = sedan()


def kept(keeping, design=None):
    design = design or design_for(CAR, natural_driving(CAR))
    return with_keeping(design, design.operation(CAR), keeping)


@pytest.fixture(name="drives", scope="module")
def the_drives():
    """A slalom that is worth learning, exact; it and five minutes straight ahead as sensors see."""
    rng, plant = np.random.default_rng(3), Plant(CAR)
    brisk = Slalom(amplitude=0.07, frequency=0.5, onset=1.0, rate_limit=0.5, duration=60.0)
    calm = RandomSteer(
        amplitude=0.0005, frequency=0.2, seed=5, onset=1.0, rate_limit=0.5, duration=300.0
    )
    runs = [plant.simulate(maneuver, speed=20.0).recording() for maneuver in (brisk, calm)]
    return runs[0], [SENSORS.apply(run, rng) for run in runs]


@pytest.mark.parametrize("keeping", KEEPINGS)
def test_only_the_leakage_forgets_a_slalom_on_five_minutes_of_a_straight_road(keeping, drives):
    exact, (brisk, calm) = drives

    def missed(model):
        return np.sqrt(np.mean((model.predict(exact) - exact.axle_force) ** 2))

    design = kept(keeping)
    learnt = identify(brisk, CAR, design).freeze(60.0)
    left = identify(calm, CAR, design, learnt).freeze(300.0)
    nothing = replace(learnt, weights=learnt.weights._replace(W=0.0 * learnt.weights.W))
    gained = [missed(nothing) - missed(model) for model in (learnt, left)]
    assert gained[0] > 0.3 * missed(nothing)
    if keeping == "leakage":
        assert gained[1] < 0.1 * gained[0]
    else:
        assert gained[1] > 0.95 * gained[0]


@pytest.mark.sweep("rk4-integral", "euler-pi_lead", "euler-instantaneous")
@pytest.mark.parametrize("law", ["integral", "instantaneous", "pi_lead"])
@pytest.mark.parametrize("integrator", ["euler", "rk4"])
def test_every_keeping_of_a_found_design_passes_its_certificate(law, integrator):
    design = design_for(CAR, natural_driving(CAR), law=law, integrator=integrator)
    bounds = {}
    for keeping in KEEPINGS:
        certificate = certify(kept(keeping, design), CAR)
        assert certificate.verdict == "pass", keeping
        loop = design.network.hidden * design.gains.eta_W  # V costs no margin
        assert certificate["gain_sampled"].value == pytest.approx(loop, rel=1e-6)
        name = "projection_bound" if keeping == "projection" else "error_bound"
        bounds[keeping] = certificate[name].value
    assert bounds["projection"] < bounds["leakage"] < bounds["dead_zone"] < np.inf


def test_the_paper_keeps_its_leakage():
    for law in VARIANTS:
        gains = make_method(law, CAR).gains
        assert gains.W_free == gains.V_free == 0.0 < gains.rho_W
        assert gains.W_max == gains.V_max == np.inf
    design = PaperIdentifier.for_vehicle(CAR)
    assert kept("leakage", design) is design
    assert KEEPINGS[DEFAULT_KEEPING] is not KEEPINGS["leakage"]


def test_the_balls_are_those_of_half_open_units_and_of_the_first_weights():
    """W: its force at s = 1/2 is the expected residual. V: twice a normal draw of its size."""
    design = design_for(CAR, natural_driving(CAR))
    known = design.operation(CAR)
    dead, projected = kept("dead_zone").gains, kept("projection").gains
    assert dead.W_free == projected.W_max
    assert dead.V_free == projected.V_max
    assert np.sqrt(10) * 0.5 * dead.W_free == pytest.approx(known.needed_force)
    first = [design.network.initial_weights(np.random.default_rng(k)).V for k in range(500)]
    assert dead.V_free == pytest.approx(2.0 * np.sqrt(np.mean(np.square(first)) * 40), rel=0.02)
    assert (dead.rho_W, projected.rho_W, projected.rho_V) == (design.gains.rho_W, 0.0, 0.0)


def test_what_cannot_be_kept_otherwise_is_refused():
    design = design_for(CAR, natural_driving(CAR))
    with pytest.raises(ValueError, match="keeping must be one of"):
        kept("memory", design)
    for keeping in ("dead_zone", "projection"):
        with pytest.raises(ValueError, match="bounded by a dead zone or a projection"):
            kept(keeping, kept("dead_zone"))


def test_a_dead_zone_without_a_leakage_is_refused():
    gains = PaperIdentifier.for_vehicle(CAR).gains
    for free, rho in (("W_free", "rho_W"), ("V_free", "rho_V")):
        with pytest.raises(ValueError, match=f"{free} is the dead zone of a leakage"):
            replace(gains, **{free: 1.0, rho: 0.0})
