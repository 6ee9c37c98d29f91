"""A step that sums up its own errors, so that nothing else of a run need be recorded.

Added are, sampled: truth (2,) [N] and counts, 1 where the sample counts; constant: impossible [N],
a force that no tire makes; carried: squares (2,) [N²], the sum of squared errors over the samples
that count, and sane_samples, the samples before the first impossible force, and sane, 1 till then.
"""

from collections.abc import Mapping, Sequence
from functools import cache
from typing import NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from codegen import BatchScan, Scan
from identifier.reproducibility import AxleRmse
from models.recordings import Recording

Array = NDArray[np.float64]

CARRY = ("squares", "sane_samples", "sane")
OVER = ("truth", "counts")


class Scores(NamedTuple):
    """What is left of many runs.

    squares : mean squared error of either axle over the samples that count (runs, 2) [N²].
    sane_samples : samples before the first impossible force (runs,).
    record : by port, what a `BatchScan` records.
    """

    squares: Array
    sane_samples: NDArray[np.int64]
    record: Mapping[str, Array]


def scored(step: ca.Function) -> ca.Function:
    """Return the step with further ports, which hold the score of its output axle_force.

    Parameters
    ----------
    step : SX function with an output axle_force (2,) [N].
    """
    inputs = [ca.SX.sym(step.name_in(i), step.sparsity_in(i)) for i in range(step.n_in())]
    outputs = step.call(inputs)
    squares, samples, sane = ca.SX.sym("squares", 2), ca.SX.sym("samples"), ca.SX.sym("sane")
    truth, counts, impossible = ca.SX.sym("truth", 2), ca.SX.sym("counts"), ca.SX.sym("impossible")
    force = outputs[step.index_out("axle_force")]
    possible = ca.logic_and(ca.fabs(force[0]) < impossible, ca.fabs(force[1]) < impossible)
    sane_next = ca.logic_and(sane, possible)
    score = [
        squares + ca.if_else(counts, (force - truth) ** 2, 0),
        samples + sane_next,
        sane_next,
    ]
    return ca.Function(
        f"{step.name()}_scored",
        [*inputs, squares, samples, sane, truth, counts, impossible],
        [*outputs, *score],
        [*step.name_in(), *CARRY, *OVER, "impossible"],
        [*step.name_out(), *(f"{name}_next" for name in CARRY)],
    )


@cache
def _scored_scan(scan: Scan) -> BatchScan:
    differ = [port for port in scan.step.name_in() if port not in scan.over]
    return BatchScan(
        scored(scan.step),
        carry=(*scan.carry, *CARRY),
        over=(*scan.over, *OVER),
        lanes_over=(*differ, "impossible"),
    )


def run_scored(
    scan: Scan,
    values: Sequence[Mapping[str, Array]],
    recording: Recording,
    *,
    impossible: Sequence[float],
    counts: NDArray[np.bool_],
    keep: Sequence[int] = (),
    workers: int | None = None,
) -> Scores:
    """Run a step over a recording with many sets of numbers.

    Parameters
    ----------
    scan : its step reads x, u and v_x sample by sample and tells axle_force (2,) [N].
    values : for each run, what it starts from and its constants, by port.
    recording : its forces are the truth; without them every error is that of no force.
    impossible : for each run, a force that no tire makes [N].
    counts : samples that count in the error (n,).
    keep : samples whose values are recorded.
    workers : threads; None takes one for each processor.
    """
    n = len(recording)
    signals = {"x": recording.x, "u": recording.u, "v_x": recording.v_x}
    truth = np.zeros((n, 2)) if recording.axle_force is None else recording.axle_force
    record = _scored_scan(scan)(
        n,
        {
            **{port: np.stack([one[port] for one in values]) for port in values[0]},
            **{port: signals[port] for port in scan.over},
            "truth": truth,
            "counts": counts.astype(np.float64),
            "impossible": np.array(impossible),
            "squares": np.zeros(2),
            "sane_samples": np.zeros(()),
            "sane": np.ones(()),
        },
        keep=keep,
        workers=workers,
    )
    return Scores(
        squares=record["squares_final"] / counts.sum(),
        sane_samples=record["sane_samples_final"][:, 0].astype(np.int64),
        record=record,
    )


def rmse(squares: Array) -> AxleRmse:
    """Return the root of mean squares.

    Parameters
    ----------
    squares : of front and rear axle (2,) [N²].
    """
    front, rear = np.sqrt(squares)
    return AxleRmse(front=float(front), rear=float(rear))
