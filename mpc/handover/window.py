"""The last seconds of a drive: what models are judged on."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

COLUMNS = ("v_x", "v_y", "r", "delta")  # m/s, m/s, rad/s, rad


class Window:
    """The last samples in the order of `COLUMNS`, oldest first, always in one piece of memory.

    Parameters
    ----------
    seconds : longest time that can be looked back on [s].
    dt : sampling interval [s].

    Raises
    ------
    ValueError
        Where there is not room for two samples.
    """

    def __init__(self, seconds: float, dt: float) -> None:
        n = round(seconds / dt)
        if not n >= 2:
            raise ValueError(f"a window of {seconds:g} s holds no two samples every {dt:g} s")
        self.dt = dt
        self._n = n
        self._rows = np.zeros((3 * n, len(COLUMNS)))
        self._end = 0
        self._kept = 0

    def add(self, sample: Sequence[float]) -> None:
        """Take a sample.

        Parameters
        ----------
        sample : in the order of `COLUMNS`.
        """
        if self._end == len(self._rows):
            self._rows[: self._n] = self._rows[-self._n :]
            self._end = self._n
        self._rows[self._end] = sample
        self._end += 1
        self._kept = min(self._kept + 1, self._n)

    def __len__(self) -> int:
        """Return the number of samples at hand."""
        return self._kept

    @property
    def duration(self) -> float:
        """Time that can be looked back on [s]."""
        return self._kept * self.dt

    def last(self, seconds: float) -> Array:
        """Return the last samples (n, 4), a view; all of them where there are fewer.

        Parameters
        ----------
        seconds : time to look back [s].
        """
        n = min(round(seconds / self.dt), self._kept)
        return self._rows[self._end - n : self._end]

    def clear(self) -> None:
        """Forget everything."""
        self._kept = 0
