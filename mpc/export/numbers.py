"""The parameters of a tracker as C and as JSON, in the order of the structure."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mpc.realtime import Tracker

Params = NDArray[np.void]
MACROS = {"tolerance": "TOLERANCE"}  # members that are other in float


def params_of(tracker: Tracker) -> Params:
    """Return the numbers that a tracker reads, of `mpc.realtime.layout.params_type`.

    Parameters
    ----------
    tracker : in double.
    """
    return tracker.params


def initializers(params: Params) -> str:
    """Return the members of the C structure, one a line with its name.

    Parameters
    ----------
    params : of `mpc.realtime.layout.params_type`, in double.
    """
    return "".join(
        f"    /* {name} */ {MACROS.get(name) or _initializer(params[name])},\n"
        for name in params.dtype.names or ()
    )


def plain_params(params: Params) -> dict[str, Any]:
    """Return the numbers by name, ready for JSON.

    Parameters
    ----------
    params : of `mpc.realtime.layout.params_type`, in double.
    """
    return {name: params[name].tolist() for name in params.dtype.names or ()}


def _initializer(value: NDArray[Any]) -> str:
    if value.ndim:
        return "{ " + ", ".join(map(_initializer, value)) + " }"
    if np.issubdtype(value.dtype, np.integer):
        return f"{int(value)}U"
    return f"R({float(value)!r})"
