"""Where a function of one number crosses zero, by SciPy, which is imported when it is asked."""

from collections.abc import Callable

FINEST = 2.0**-50  # share of x, SciPy's own


def root(
    f: Callable[[float], float],
    low: float,
    high: float,
    *,
    xtol: float = 2e-12,
    rtol: float = FINEST,
) -> float:
    """Return x between two ends at which f is zero, by Brent's method.

    Parameters
    ----------
    f : continuous, of other sign at either end.
    low, high : ends.
    xtol, rtol : how near it must be, absolute and over its size.

    Raises
    ------
    ValueError
        Where both ends have one sign.
    """
    from scipy.optimize import brentq  # takes longer to import than a log of a minute to learn from

    return float(brentq(f, low, high, xtol=xtol, rtol=rtol))
