"""`tireid check --monte-carlo`: the proven bounds beside what happened on random drives."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from identifier.stability import Certificate
from identifier.stability.monte_carlo import Observed
from tireid.certificate_table import number, unit_text

TOLERANCE = 1e-9  # of rounding, in parts of a bound
BOUNDS = (  # name in the certificate, what it bounds, and how a table calls it
    ("error_bound", "xi_tilde", "|xi - xi_hat|, by the leakage"),
    ("projection_bound", "xi_tilde", "|xi - xi_hat|, by the projection"),
    ("weight_bound", "W", "|W|, by the leakage"),
    ("V_bound", "V", "|V|"),
)


class Row(NamedTuple):
    """A bound beside what was seen.

    name, title, unit : of the bound.   bound : its value.   largest : seen on any drive.
    passed : drives on which it was exceeded.   tightness : bound over seen: least, median, 90 %.
    """

    name: str
    title: str
    unit: str
    bound: float
    largest: float
    passed: int
    tightness: tuple[float, float, float]


def bound_rows(certificate: Certificate, observed: Observed) -> list[Row]:
    """Return every proven bound that the certificate holds, beside what was seen.

    Parameters
    ----------
    certificate : of the design.
    observed : the drives.
    """
    known = {entry.name: entry for entry in certificate.properties}
    rows = []
    for name, what, title in BOUNDS:
        if name in known and np.isfinite(known[name].value):
            seen: NDArray[np.float64] = getattr(observed, what)
            bound = known[name].value
            passed = int(np.count_nonzero(~(seen <= bound * (1.0 + TOLERANCE))))
            ratio = bound / seen[np.isfinite(seen) & (seen > 0.0)]
            low, middle, high = np.quantile(ratio, [0.0, 0.5, 0.9]) if ratio.size else [np.nan] * 3
            largest = float(seen.max())
            tightness = float(low), float(middle), float(high)
            rows.append(Row(name, title, known[name].unit, bound, largest, passed, tightness))
    return rows


def monte_carlo_text(rows: list[Row], observed: Observed, seed: int, force_unit: float) -> str:
    """Return the comparison as lines of text.

    Parameters
    ----------
    rows : from `bound_rows`.
    observed : the drives.
    seed : that they were drawn with.
    force_unit : the unit U of the design [N].
    """
    unit = unit_text("U s", force_unit)
    lines = [
        f"\n{observed.xi_tilde.size} random drives within what is judged, seed {seed} "
        f"({observed.outside} harder ones left out): largest error "
        f"{number(float(observed.xi_tilde.max()))} {unit}, diverged on {observed.diverged}"
    ]
    if not rows:
        return "\n".join([*lines, "nothing is proven of these gains that a drive could contradict"])
    lines.append(
        f"{'proven bound':42} {'value':>9} {'largest':>9} {'passed':>7}   over seen: "
        f"{'least':>7} {'median':>7} {'90 %':>7}"
    )
    for row in rows:
        title = f"{row.title} [{unit_text(row.unit, force_unit)}]"
        ratios = " ".join(f"{number(value):>7}" for value in row.tightness)
        lines.append(
            f"{title:42} {number(row.bound):>9} {number(row.largest):>9} {row.passed:>7}   "
            f"{'':10} {ratios}"
        )
    return "\n".join(lines)


def monte_carlo_numbers(rows: list[Row], observed: Observed, seed: int) -> dict[str, Any]:
    """Return the comparison for JSON.

    Parameters
    ----------
    rows : from `bound_rows`.
    observed : the drives.
    seed : that they were drawn with.
    """
    return {
        "drives": observed.xi_tilde.size,
        "left_out": observed.outside,
        "seed": seed,
        "diverged": observed.diverged,
        "largest_error": _finite(float(observed.xi_tilde.max())),
        "bounds": {
            row.name: {
                "value": row.bound,
                "unit": row.unit,
                "largest": _finite(row.largest),
                "passed": row.passed,
                "over_seen": dict(
                    zip(("least", "median", "q90"), map(_finite, row.tightness), strict=True)
                ),
            }
            for row in rows
        },
    }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
