"""Samples for the self-test of a package, and the forces that CasADi gives for them."""

from typing import NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from identifier.export.fold import FoldedStep
from identifier.refused import NOWHERE, STALE_TIME, stale_samples

Array = NDArray[np.float64]

SAMPLES = 240
REST = 10  # samples at rest, and some as long in between


class Vectors(NamedTuple):
    """Samples (n, 5) in the order of the inputs, SI, and axle forces (n, 2) [N]."""

    samples: Array
    force: Array


def synthetic_samples(folded: FoldedStep, n: int = SAMPLES) -> Array:
    """Return a start from rest and turns to both sides, (n, 5); arithmetic only, no noise.

    Parameters
    ----------
    folded : its lowest speed sets the scale.
    n : number of samples.
    """
    k = np.arange(n, dtype=np.float64)
    wave, slow = _triangle(k / 60.0), _triangle(k / 97.0 + 0.2)
    v_x = folded.min_speed * np.minimum(0.0973 * np.maximum(k - REST, 0.0), 15.0)
    v_x = np.where((k >= n // 2) & (k < n // 2 + REST), 0.5 * folded.min_speed, v_x)
    v_y = 0.03 * v_x * slow
    r = 0.4 * folded.min_speed * wave * np.minimum(k / n, 0.5)
    delta_f, delta_r = 0.05 * wave, 0.005 * slow
    return np.column_stack([v_x, v_y, r, delta_f, delta_r])


def _triangle(phase: Array) -> Array:
    wave: Array = 4.0 * np.abs(phase - np.floor(phase + 0.5)) - 1.0
    return wave


def run_in_virtual_machine(folded: FoldedStep, samples: Array) -> tuple[Array, dict[str, Array]]:
    """Return the outputs (n, k) of a folded step, one beside the other, and what it carries then.

    Samples that are refused count as time, as `identifier.refused` says.

    Parameters
    ----------
    folded : the step.
    samples : (n, 5) in the order of the inputs.
    """
    carry = [ca.DM(value) for value in folded.carry.values()]
    n, size = len(carry), sum(port.size for port in folded.outputs)
    told, now, missed, started = [], np.zeros(size), 0, False

    def step(sample: Array) -> tuple[list[ca.DM], Array]:
        v_x, v_y, r, delta_f, delta_r = sample
        results = list(folded.function(*carry, ca.DM([v_y, r]), ca.DM([delta_f, delta_r]), v_x))
        flat = [np.array(value).ravel(order="F") for value in results[n:]]
        return results[:n], np.concatenate(flat)

    for sample in samples:
        if folded.limits.accept(*sample):
            anew = folded.believed is None and missed > 0
            if anew if started else folded.rests_first:
                carry, _ = step(np.array([0.0, *sample[1:]]))
            carry, now = step(sample)
            missed, started = 0, True
        else:
            missed += 1
            if folded.believed is not None and started:
                carry, now = step(np.array([NOWHERE, 0.0, 0.0, 0.0, 0.0]))
            if missed >= stale_samples(STALE_TIME, folded.dt):
                now = np.zeros(size)
        told.append(now)
    return np.array(told), dict(zip(folded.carry, map(np.array, carry), strict=True))


def vectors(folded: FoldedStep) -> Vectors:
    """Return the self-test of a package.

    Parameters
    ----------
    folded : the step.
    """
    samples = synthetic_samples(folded)
    outputs, _ = run_in_virtual_machine(folded, samples)
    return Vectors(samples, outputs[:, :2])


def vectors_header(found: Vectors) -> str:
    """Return the vectors as a C header.

    Parameters
    ----------
    found : the vectors.
    """
    return (
        "/* Generated. Samples v_x, v_y, r, delta_f, delta_r [SI] and forces front, rear [N]. */\n"
        f"#define VECTORS {len(found.samples)}\n\n"
        f"static const double vector_input[VECTORS][5] = {{\n{_rows(found.samples)}}};\n\n"
        f"static const double vector_force[VECTORS][2] = {{\n{_rows(found.force)}}};\n"
    )


def _rows(table: Array) -> str:
    return "".join(f"    {{ {', '.join(repr(float(v)) for v in row)} }},\n" for row in table)
