"""Recordings of signals that tests make."""

from models.recordings import Recording


def made(t, /, **signals):
    """A recording at 20 m/s, of zeros where no signal is given; None is a signal that is absent."""
    zeros = dict.fromkeys(("v_y", "r", "delta_f", "delta_r"), 0.0 * t)
    return Recording(**{"name": "made", "t": t, "v_x": 0.0 * t + 20.0, **zeros, **signals})
