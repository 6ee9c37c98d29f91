"""What a notebook displays of an object: HTML that needs nothing else, on light and dark pages.

Colors stand out from both; all else is the page's. Words are escaped here, parts are markup.
"""

from collections.abc import Iterable, Sequence
from itertools import chain, repeat
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from codegen.arrays import Array
from codegen.escape import html

GREEN, RED, AMBER = "#2e8b57", "#d93a32", "#b86e00"
AXLE_COLORS = ("#3b8ec2", "#d55e00")  # front, rear
REFUSED = ";opacity:.6"  # look of an answer that is not valid
STRUCK = f"{REFUSED};text-decoration:line-through"  # of the axle that refuses it
_WIDTH, _HEIGHT, _ROOM = 420, 200, 16  # of a chart, and for its words [px]
_CELL = "text-align:left;padding:1px 12px 1px 0;background:none"


def card(*parts: str) -> str:
    return f'<div style="max-width:46rem;margin:.4em 0;line-height:1.45">{"".join(parts)}</div>'


def line(text: str, strong: str = "", color: str = "inherit") -> str:
    """Return a line of text behind its strong words, which may have a color."""
    return f'<div><b style="color:{color}">{html(strong)}</b> {html(text)}</div>'


def folded(heading: str, lines: Iterable[str]) -> str:
    """Return lines under a heading that opens them; nothing where there are none."""
    inside = "".join(line(one) for one in lines)
    return inside and f"<details><summary>{html(heading)}</summary>{inside}</details>"


def table(rows: Iterable[Sequence[str]], looks: Sequence[str] = ()) -> str:
    """Return a table; its first row is the header.   looks : CSS of the other cells of a column."""
    marks = [
        "".join(
            f'<{cell} style="{_CELL}{look if cell == "td" else ""}">{html(one)}</{cell}>'
            for one, look in zip(row, looks or repeat(""), strict=False)
        )
        for cell, row in zip(chain(["th"], repeat("td")), rows, strict=False)
    ]
    return (
        f'<table style="color:inherit;font-size:inherit"><tr>{"</tr><tr>".join(marks)}</tr></table>'
    )


class Curve(NamedTuple):
    """A curve of a chart (k,), between the ends of a band where it has one.

    solid : at which points it is no extrapolation, (k,).
    """

    name: str
    color: str
    y: Array
    solid: NDArray[np.bool_]
    band: Sequence[Array] = ()


def chart(x: Array, curves: Sequence[Curve], across: str, up: str) -> str:
    """Return curves over `x` (k,) as SVG, the axes through zero; nothing of what is not finite.

    across, up : names of the axes with their units.
    """
    every = np.concatenate([one for curve in curves for one in (curve.y, *curve.band)])
    reach = float(np.abs(x).max()), float(np.abs(every).max())
    if not 0.0 < reach[1] < np.inf:
        return ""
    ends = _WIDTH - 2, _HEIGHT - 2 * _ROOM

    def place(value: Array, axis: int) -> Array:
        share = value / reach[axis] * (-1.0 if axis else 1.0)
        return np.round(ends[axis] * (1.0 + share) / 2.0 + (_ROOM if axis else 1), 1)

    def points(x: Array, y: Array) -> str:
        pairs = zip(place(x, 0).tolist(), place(y, 1).tolist(), strict=True)
        return " ".join(f"{a},{b}" for a, b in pairs)

    def word(at: tuple[float, float], text: str, color: str = "currentColor") -> str:
        return f'<text x="{at[0]}" y="{at[1]}" fill="{color}">{html(text)}</text>'

    ticks = [_round_below(one) for one in reach]
    (x0, x1), (y0, y1) = (place(np.array([0.0, one]), k).tolist() for k, one in enumerate(ticks))
    marks = [
        f'<path d="M0 {y0}H{_WIDTH}M{x0} {_ROOM}V{_HEIGHT - _ROOM}M{x1} {y0}v5M{x0} {y1}h-5" '
        'stroke="currentColor" opacity=".5"/>',
        word((x1 - 4, y0 + 17), f"{ticks[0]:g}"),
        word((x0 + 5, y1 + 4), f"{ticks[1]:g}"),
        word((0, 11), up),
        word((0, _HEIGHT - 3), across),
    ]
    for k, (name, color, y, solid, band) in enumerate(curves):
        if band:
            around = points(np.hstack([x, x[::-1]]), np.hstack([band[0], band[1][::-1]]))
            marks.append(f'<polygon points="{around}" fill="{color}" opacity=".25"/>')
        for some, dash in ((solid, ""), (slice(None), ' stroke-dasharray="2 4"')):
            line = f'points="{points(x[some], y[some])}" stroke="{color}"{dash}'
            marks.append(f'<polyline {line} stroke-width="1.5"/>')
        marks.append(word((_WIDTH - 70 * (len(curves) - k), 11), name, color))
    return (
        f'<svg width="{_WIDTH}" height="{_HEIGHT}" viewBox="0 0 {_WIDTH} {_HEIGHT}" fill="none" '
        f'font-size="12" style="max-width:100%">{"".join(marks)}</svg>'
    )


def _round_below(reach: float) -> float:
    """Return the largest 1, 2 or 5 of a power of ten that is not above a reach."""
    power = 10.0 ** np.floor(np.log10(reach))
    return max((one * power for one in (1.0, 2.0, 5.0) if one * power <= reach), default=power)
