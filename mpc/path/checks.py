"""Whether samples are one curve over its arc length."""

import math

import numpy as np

from mpc.path.line import Line, PathError

LARGEST_TURN = 0.3  # rad in one step; coarser samples would not carry the cubics between them
DISAGREEMENT = 0.02  # of a step, or rad; beside what cubics leave out at that turn


def check_line(line: Line, name: str, closed: bool) -> None:
    """Refuse samples that do not fit one another.

    Parameters
    ----------
    line : finite samples of equal shape.
    name : for messages.
    closed : whether the last sample must be the first one again.

    Raises
    ------
    PathError
        Where s is not uniform from 0, samples are too few, too coarse or disagree, or the ends of a
        closed path differ.
    """
    s, X, Y, psi, kappa = line
    if s.size < 5:
        raise PathError(f"{name}: a path needs at least 5 samples, it has {s.size}")
    h = float(s[-1]) / (s.size - 1)
    if not (h > 0.0 and np.abs(s - h * np.arange(s.size)).max() <= 1e-6 * h):
        raise PathError(f"{name}: s must rise from 0 in equal steps")
    turn = float(h * np.abs(kappa).max())
    if turn > LARGEST_TURN:
        raise PathError(
            f"{name}: a step may turn by at most {LARGEST_TURN} rad, one turns by {turn:.3g}; "
            f"sample it finer than {h:.3g} m"
        )
    middle = 0.5 * (psi[:-1] + psi[1:])
    dX, dY = np.diff(X) / h, np.diff(Y) / h
    along, across = dX * np.cos(middle) + dY * np.sin(middle), dY * np.cos(middle)
    across = across - dX * np.sin(middle)
    turned = np.diff(psi) - 0.5 * h * (kappa[:-1] + kappa[1:])
    wrong = np.maximum(np.abs(along - 1.0), np.maximum(np.abs(across), np.abs(turned)))
    worst = int(wrong.argmax())
    if wrong[worst] > DISAGREEMENT + 0.25 * turn**2:
        raise PathError(
            f"{name}: X, Y, psi and kappa must be one curve over s, at s = {s[worst]:.4g} m they "
            f"disagree by {wrong[worst]:.2g} of a step"
        )
    if closed:
        _check_ends(line, name, h)


def _check_ends(line: Line, name: str, h: float) -> None:
    """Refuse a closed path that does not close."""
    gap = math.hypot(line.X[-1] - line.X[0], line.Y[-1] - line.Y[0])
    bend = math.remainder(line.psi[-1] - line.psi[0], 2.0 * math.pi)
    kink = float(line.kappa[-1] - line.kappa[0])
    if gap > 1e-3 * h or abs(bend) > 1e-3 * h or abs(kink) * h > 1e-3:
        raise PathError(
            f"{name}: a closed path must end as it starts, its ends differ by {gap:.3g} m, "
            f"{bend:.3g} rad and {kink:.3g} 1/m"
        )
