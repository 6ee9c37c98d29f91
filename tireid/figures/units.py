"""Units that suit the size of what is drawn: kN for cars, N for models, and the impulse of each."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from identifier.design import Design
from identifier.history import History
from identifier.reproducibility import AxleRmse

Array = NDArray[np.float64]
FARTHEST = 3.0  # an axis reaches at most this many times beyond the force it is compared with


class ForceUnit(NamedTuple):
    """A unit of force on an axis: its name and its size [N]."""

    name: str
    newtons: float

    def format(self, error: AxleRmse, axle: int) -> str:
        """Return an axle's error as text with its unit.

        Parameters
        ----------
        error : of both axles [N].
        axle : 0 is the front axle, 1 the rear.
        """
        value = (error.front, error.rear)[axle] / self.newtons
        digits = f"{value:.3g}" if value >= 1.0 else f"{value:.2f}"
        return f"{digits} {self.name}" if np.isfinite(value) else "not finite"


KILONEWTON, NEWTON = ForceUnit("kN", 1000.0), ForceUnit("N", 1.0)


def force_unit_of(force: Array) -> ForceUnit:
    """Return kN where a force reaches 1 kN, else N.

    Parameters
    ----------
    force : any shape [N]; what is not finite does not count.
    """
    return KILONEWTON if np.abs(_finite(force)).max(initial=0.0) >= 1000.0 else NEWTON


def impulse_unit(force_unit: float) -> str:
    """Return the name of the unit of ξ, the force unit times one second.

    Parameters
    ----------
    force_unit : U [N].
    """
    return f"{force_unit_name(force_unit)} s"


def paper_design(history: History) -> Design:
    """Return the design of a run of the paper's identifier, whose weights and error have units.

    Parameters
    ----------
    history : an online run.

    Raises
    ------
    TypeError
        Where another method ran.
    """
    if not isinstance(history.design, Design):
        raise TypeError(f"a run of the paper's identifier is needed, not of {history.design}")
    return history.design


def force_unit_name(force_unit: float) -> str:
    """Return the name of a unit of force.

    Parameters
    ----------
    force_unit : U [N].
    """
    names = {1.0: "N", 1000.0: "kN"}
    return names.get(force_unit, f"{force_unit:g} N")


def force_range(reference: Array, *others: Array) -> tuple[float, float]:
    """Return the ends of an axis that shows all curves, but no more than thrice the reference.

    A law that diverges or a model that is far off leaves the panel instead of flattening the rest.

    Parameters
    ----------
    reference : curves that are seen in full as long as they are finite.
    others : curves that may be cut.
    """
    largest = _finite(reference)
    bound = FARTHEST * float(np.abs(largest).max(initial=0.0)) or np.inf
    every = np.concatenate([largest, *(_finite(other) for other in others)])
    every = every[np.abs(every) <= 1e12]
    low = max(float(every.min(initial=0.0)), -bound)
    high = min(float(every.max(initial=0.0)), bound)
    margin = 0.06 * (high - low) or 1.0
    return low - margin, high + margin


def drawable(curve: Array, limits: tuple[float, float]) -> Array:
    """Return a curve whose values far outside the axis are brought close to it, NaN left out.

    Parameters
    ----------
    curve : any shape, in the unit of the axis.
    limits : ends of the axis.
    """
    low, high = limits
    reach = 10.0 * (high - low)
    return np.clip(curve, low - reach, high + reach)


def _finite(values: Array) -> Array:
    kept: Array = values[np.isfinite(values)]
    return kept
