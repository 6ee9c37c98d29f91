"""The loop along a run: its gain by another road, and no regressor worse than the worst."""

import numpy as np
import pytest

from identifier.paper.design import PaperIdentifier
from identifier.paper.laws import LAWS
from identifier.run import identify
from identifier.stability.along import strongest_along
from identifier.stability.loop import direction_matrix
from identifier.stability.operation import proven_bounds, worst_loop


def test_the_largest_gain_along_a_run_is_the_formula_at_its_sample_and_below_the_worst(car, drive):
    design = PaperIdentifier.for_vehicle(car)
    history = identify(drive(n=600), car, design)
    found = strongest_along(history, design)
    largest = []
    for k in range(600):
        x_bar = np.concatenate([history.recording.x[k], history.recording.u[k]])
        x_bar = x_bar / np.array(design.network.scale)
        W, V = history.state["W"][k], history.state["V"][k]
        s = np.tanh(V @ x_bar)
        through_V = (W * (1 - s**2)) @ (W * (1 - s**2)).T * (x_bar @ x_bar)
        G = design.gains.eta_W * (s @ s) * np.eye(2) + design.gains.eta_V * through_V
        largest.append(np.linalg.eigvalsh(G)[-1])
    assert found.gain == pytest.approx(max(largest), rel=1e-9)
    assert found.t == pytest.approx(history.recording.t[np.argmax(largest)])
    integral, task = LAWS[design.law], design.operation(car)
    law, D = integral.error(), direction_matrix(integral, design.gains.matrix)
    kept = proven_bounds(design.gains, law, task, D).W
    worst = worst_loop(design.gains, law, task, D, kept)
    assert found.gain < np.linalg.eigvalsh(worst.G)[-1] and found.margin > 1.0
