"""Low passes of sampled signals: a window without phase, one of first order, and its inverse."""

import math

import numpy as np

from codegen.arrays import Array

_NEGLIGIBLE = 1e-20  # share of an earlier sample


def window(half: int) -> Array:
    """Return a Hann window of sum one, (2 half + 1,)."""
    bell = np.hanning(2 * half + 3)[1:-1]
    return np.asarray(bell / bell.sum(), dtype=np.float64)


def smoothed(signal: Array, half: int) -> Array:
    """Return a signal under a window without phase, mirrored about its ends (n,).
    signal : samples (n,).
    """
    padded = np.pad(signal, half, mode="reflect", reflect_type="odd")
    return np.asarray(np.convolve(padded, window(half), "valid"), dtype=np.float64)


def low_passed(signal: Array, lag: float, dt: float) -> Array:
    """Return what comes out of a low pass of first order that began at rest on the first value.

    It is exact for straight lines between samples.
    signal : u, what goes in (n,).   lag : time constant T of the low pass [s].
    dt : sampling interval [s].
    """
    keep = math.exp(-dt / lag)
    ramp = (1.0 - keep) * lag / dt  # lag of a straight line, T u_dot
    # y_k = keep y_(k-1) + (1 - keep) u_(k-1) + (1 - ramp) (u_k - u_(k-1)), from y_0 = u_0
    y = np.array(signal, dtype=np.float64)
    y[1:] = (ramp - keep) * signal[:-1] + (1.0 - ramp) * signal[1:]
    # 1/(1 - q) = (1 + q)(1 + q²)(1 + q⁴)...: of a sum over all samples before, by whole arrays
    behind = 1
    while behind < y.size and keep > _NEGLIGIBLE:
        y[behind:] += keep * y[:-behind]  # NumPy reads all of the right side first
        keep, behind = keep * keep, 2 * behind
    return y


def without_low_pass(signal: Array, lag: float, dt: float, half: int) -> Array:
    """Return what went into a low pass, u = y + T ẏ, of y smoothed by a window without phase.
    signal : y, what came out (n,).   lag : time constant T of the low pass [s].
    dt : sampling interval [s].
    half : samples on each side of the window that takes noise off first; 0 for none.
    """
    if half > 0:
        signal = smoothed(signal, half)
    source: Array = signal + lag * np.gradient(signal, dt)
    return source
