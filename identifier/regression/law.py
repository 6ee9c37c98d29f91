"""What a law is: where its statistics start, and how one pair moves them and the weights.

W (2, n_h) [U]: weights.   s (n_h,), y (2,) [U]: the pair of `filtered`.   U: force unit.
"""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from identifier.regression.filtered import Pair

Array = NDArray[np.float64]
State = Mapping[str, Any]


class Numbers(NamedTuple):
    """The numbers of a law, CasADi symbols inside the step.

    filter_rate: κ [1/s].   forgetting: λ [1/s].   learning_rate: η [1/s].   ridge: δ [s], the
    information in seconds of |s| = 1 that the first weights count for.   quiet: learning rests
    where the root mean square of s is below [-].   W_max: radius of the projection [U].
    """

    filter_rate: Any
    forgetting: Any
    learning_rate: Any
    ridge: Any
    quiet: Any
    W_max: Any


class Weights(NamedTuple):
    """Weights now, and those that the law falls back to where it knows nothing; both (2, n_h)."""

    now: Any
    first: Any


class Law(NamedTuple):
    """A law: `start(n_h, memory, ridge)` and `update(state, weights, pair, numbers, ahead)`.

    `start` returns the statistics by name, before any pair. `update` returns the statistics and W
    after this pair; `ahead` is T_s [s], or 0 where learning rests and nothing may change.
    """

    start: Callable[[int, int, float], dict[str, Array]]
    update: Callable[[State, Weights, Pair, Numbers, Any], tuple[dict[str, Any], Any]]
