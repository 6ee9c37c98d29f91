"""The loop along a run: its gain by another road, and no regressor worse than the worst."""

import numpy as np

from identifier.paper.design import PaperIdentifier
from identifier.paper.laws import LAWS
from identifier.run import identify
from identifier.stability.along import loop_along, network_inputs
from identifier.stability.loop import direction_matrix
from identifier.stability.operation import proven_bounds, worst_loop


def test_gain_along_a_run_is_the_formula_at_one_sample(car, drive):
    design = PaperIdentifier.for_vehicle(car)
    history = identify(drive(n=600), car, design)
    along, k = loop_along(history, design), 345
    x_bar = np.concatenate([history.recording.x[k], history.recording.u[k]])
    x_bar = x_bar / np.array(design.network.scale)
    np.testing.assert_allclose(network_inputs(history, design)[k], x_bar)
    W, V = history.state["W"][k], history.state["V"][k]
    s = np.tanh(V @ x_bar)
    through_V = (W * (1 - s**2)) @ (W * (1 - s**2)).T * (x_bar @ x_bar)
    G = design.gains.eta_W * (s @ s) * np.eye(2) + design.gains.eta_V * through_V
    assert np.isclose(along.gain[k], np.linalg.eigvalsh(G)[-1])
    assert along.strongest == int(np.argmax(along.gain))


def test_no_recorded_regressor_is_worse_than_the_worst(car, drive):
    design = PaperIdentifier.for_vehicle(car)
    history = identify(drive(n=600), car, design)
    integral, task = LAWS[design.law], design.operation(car)
    law, D = integral.error(), direction_matrix(integral, design.gains.matrix)
    kept = proven_bounds(design.gains, law, task, D).W
    worst = worst_loop(design.gains, law, task, D, kept)
    along = loop_along(history, design)
    assert along.gain.max() < np.linalg.eigvalsh(worst.G)[-1]
    assert along.radius.max() < 1.0 + 1e-9
    assert along.margin > 1.0
