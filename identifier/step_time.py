"""How long one step of a method takes, in compiled code."""

import math
import time
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from identifier.method import Method
from models.recordings import Recording
from models.vehicle import Vehicle

Array = NDArray[np.float64]
LONG = 10_000  # samples, beside which the call of the loop does not count


def step_times(
    methods: Mapping[str, Method], vehicle: Vehicle, recording: Recording, *, repeats: int = 30
) -> dict[str, float]:
    """Return by method the shortest time per sample of a compiled run over a recording [s].

    Setting up is left out. Times are those of this thread on its processor, so that waiting for a
    busy machine does not count, and the methods take turns. A short recording is run forward and
    backward in time until it is long enough.

    Parameters
    ----------
    methods : by name.
    vehicle : the car.
    recording : what is run over.
    repeats : turns; the shortest counts.
    """
    signals = {"x": recording.x, "u": recording.u, "v_x": recording.v_x}
    signals = {port: _long(signal) for port, signal in signals.items()}
    n = len(signals["v_x"])
    runs = {}
    for name, method in methods.items():
        setup = method.setup(vehicle, recording)
        sampled = {port: signals[port] for port in setup.scan.over}
        runs[name] = setup.scan, {**setup.carry, **sampled, **setup.constants}
        setup.scan(n, runs[name][1])  # compiled and warm
    shortest = dict.fromkeys(methods, math.inf)
    for _ in range(repeats):
        for name, (scan, values) in runs.items():
            start = time.thread_time()
            scan(n, values, every=n)
            shortest[name] = min(shortest[name], time.thread_time() - start)
    return {name: duration / n for name, duration in shortest.items()}


def _long(signal: Array) -> Array:
    """Return a signal (n, ...) forward and backward in turn, without a jump."""
    there_and_back = np.concatenate([signal, signal[::-1]])
    return np.concatenate([there_and_back] * math.ceil(LONG / len(there_and_back)))
