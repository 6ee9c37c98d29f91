"""What a drive is worth, in a few numbers."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from mpc.loop.record import Drive
from mpc.realtime.messages import Status


class Scores(NamedTuple):
    """Deviation from the path and cost of steering; `to_dict` is ready for JSON."""

    rms_e_y_m: float
    """Root mean square of the true deviation over the whole drive [m]."""
    peak_e_y_m: float
    """Its largest magnitude [m]."""
    completed: bool
    """Whether the car reached the end on the path."""
    failures: Mapping[str, int]
    """Periods in which the tracker reported other than success, by status."""
    solve_ms: Mapping[str, float]
    """Time of the tracker's step: median, p99 and max [ms]."""

    def to_dict(self) -> dict[str, Any]:
        """Return plain numbers and words."""
        return {**self._asdict(), "failures": dict(self.failures), "solve_ms": dict(self.solve_ms)}


def scores(drive: Drive) -> Scores:
    """Return the scores of a drive.

    Parameters
    ----------
    drive : the drive.
    """
    values, counts = np.unique(drive.status, return_counts=True)
    failures = {
        Status(int(value)).name: int(count)
        for value, count in zip(values, counts, strict=True)
        if value != Status.OK
    }
    solve_ms = 1e3 * drive.solve_time
    return Scores(
        rms_e_y_m=float(np.sqrt(np.mean(drive.e_y**2))),
        peak_e_y_m=float(np.abs(drive.e_y).max()),
        completed=drive.completed,
        failures=failures,
        solve_ms={
            "median": float(np.median(solve_ms)),
            "p99": float(np.percentile(solve_ms, 99.0)),
            "max": float(solve_ms.max()),
        },
    )
