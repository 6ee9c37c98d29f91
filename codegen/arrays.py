"""The kind of array that everything here is made of."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
