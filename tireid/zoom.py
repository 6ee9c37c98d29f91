"""A figure of a report to look at closer: its panels as data, which a browser draws anew.

A drag zooms in, and the legend reads the cursor. Library, script and data of all plots of a report
are packed and together no larger than `LARGEST`: of long lines each column has the lowest and the
highest sample. Without JavaScript the picture stands alone.
"""

import json
import math
import re
import zlib
from base64 import b64encode
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from codegen.arrays import Array

LARGEST = 60_000  # bytes that a report has for its plots
# Figures, by name: the curves, and forces and v_y over time.
ZOOMED = ("slip", "forces", "inputs", "side_slip", "tires", "lateral")
REPLAY = "replay_"  # how names begin of those that have a zoom while there is room
_COLUMNS, _COLUMNS_AT_FIRST = 1200, 400  # of a panel: at most, and those that are tried first
_COARSE = 140  # columns: a picture has about 560 points an axle, and each column four of them
# Room over size that is good, share of the columns that would fill it, and how often to try.
_FULL, _TRIM, _TRIES = 1.15, 0.97, 6
_POINTS = 300  # of a cloud
_MOST, _FINE = 5e3, 5e5  # steps of its last digit that a largest value has; of curves and across
_CURVE = 250  # points, up to which a line is a curve
_OPEN = """(async () => {
  if (!window.DecompressionStream) return;
  const opened = async id => {
    const packed = atob(document.getElementById(id).textContent);
    const bytes = Uint8Array.from(packed, one => one.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    return new Response(stream).text();
  };
  new Function("data", await opened("zoom-script"))(JSON.parse(await opened("zoom-data")));
})();"""


class Series(NamedTuple):
    """A line of a panel.

    kind : "line", "dashed", "points"; "low" and behind it "high" of a band.
    x : rising but for points (k,).   y : NaN where a segment begins (k,).
    """

    name: str
    color: str
    kind: str
    x: Array
    y: Array

    @property
    def most(self) -> float:
        return _MOST if self.kind == "points" or len(self.x) > _CURVE else _FINE

    def thinned(self, columns: int) -> "Series":
        """Return the lowest and the highest sample of each column; of points some of them."""
        x, y, k = self.x, self.y, len(self.x)
        if self.kind == "points":
            some = np.linspace(0, k - 1, min(k, _POINTS)).astype(int)
            outer = [one(v) for v in (x, y) for one in (np.argmin, np.argmax)]
            some = np.union1d(some, outer)
            some = some[np.argsort(x[some], kind="stable")]
            return self._replace(x=x[some], y=y[some])
        if k <= 2 * columns:
            return self
        edges = np.linspace(0, k, columns + 1).astype(int)
        first, last = edges[:-1], edges[1:] - 1
        low, high = np.fmin.reduceat(y, first), np.fmax.reduceat(y, first)
        falls = y[first] - low > high - y[first]
        begin = high if self.kind == "high" else np.where(falls & (self.kind != "low"), high, low)
        end = begin if self.kind in ("low", "high") else np.where(falls, low, high)
        end = np.where(np.logical_or.reduceat(np.isnan(y), first), np.nan, end)
        pairs = ([x[first], x[last]], [begin, end])
        x, y = (np.column_stack(pair).ravel() for pair in pairs)
        return self._replace(x=x, y=y)


class Panel(NamedTuple):
    """A panel of a figure.

    across, up : names of the axes with their units.   limits : how far the upright axis reaches.
    spans : from, to and color of what is shaded; a line where both are the same.
    """

    title: str
    across: str
    up: str
    limits: tuple[float, float]
    spans: Sequence[tuple[float, float, str]]
    series: Sequence[Series]


Zoom = Sequence[Panel]


class Drawn(bytes):
    """A figure as PNG; its panels, where it may be looked at closer, or while there is room."""

    zoom: Zoom = ()
    spare = False


def zoom_of(figure: Any) -> Zoom:
    """Return the panels of a drawn figure; names of axes that several share are those of each."""
    panels = [
        Panel(
            _words("\n".join(map(axes.get_title, ("left", "center", "right"))), ", "),
            _words(axes.get_xlabel()),
            _words(axes.get_ylabel()),
            axes.get_ylim(),
            [*_spans(axes)],
            [one.thinned(_COLUMNS) for one in _series(axes)],
        )
        for axes in figure.axes
    ]
    for k, panel in enumerate(panels):
        across = next((one.across for one in panels[k:] if one.across), "")
        up = next((one.up for one in panels[k::-1] if one.up), "")
        clock = re.match(r"time since (-?\d+) s", across)  # as `label_time` names its zero
        zero = float(clock[1]) if clock else 0.0
        spans = [(begin - zero, end - zero, color) for begin, end, color in panel.spans]
        series = [one._replace(x=one.x - zero) for one in panel.series]
        panels[k] = Panel(panel.title, across, up, panel.limits, spans, series)
    return panels


def _words(text: str, between: str = " ") -> str:
    """Return a label of a figure without its marks of mathematics, its lines joined."""
    return between.join(filter(None, re.sub(r"\\(\$)|[$\\]", r"\1", text).split("\n")))


def _series(axes: Any) -> Iterator[Series]:
    from matplotlib.colors import to_hex

    def made(artist: Any, color: Any, kind: str, x: Array, y: Array) -> Iterator[Series]:
        known = np.isfinite(x) & np.isfinite(y)
        if not known.any():
            return
        if len(x) == 2:  # a straight line, to be read between its ends
            x, y = (np.linspace(one[0], one[1], _CURVE) for one in (x, y))
        elif kind == "points":
            x, y = x[known], y[known]
        else:
            every = np.arange(len(x))
            x, y = np.interp(every, every[known], x[known]), np.where(known, y, np.nan)
        label = str(artist.get_label())
        yield Series("" if label.startswith("_") else _words(label), to_hex(color), kind, x, y)

    for band in axes.collections:
        outlines = [one.vertices[np.argsort(one.vertices[:, 0])].T for one in band.get_paths()]
        starts = [np.unique(x, return_index=True)[1] for x, _ in outlines]
        x = np.concatenate([x[at] for (x, _), at in zip(outlines, starts, strict=True)])
        for kind, extreme in (("low", np.fmin), ("high", np.fmax)):
            ends = [extreme.reduceat(y, at) for (_, y), at in zip(outlines, starts, strict=True)]
            for one in ends[1:]:
                one[0] = np.nan  # where a segment begins
            yield from made(band, band.get_facecolor()[0], kind, x, np.concatenate(ends))
    for line in axes.lines:
        if line.get_transform() is axes.transData:
            kind = "points" if line.get_linestyle() == "None" else "line"
            kind = "dashed" if line.is_dashed() else kind
            x, y = (np.asarray(one, dtype=float) for one in line.get_data())
            yield from made(line, line.get_color(), kind, x, y)


def _spans(axes: Any) -> Iterator[tuple[float, float, str]]:
    from matplotlib.colors import to_hex

    for patch in axes.patches:
        x = patch.get_path().transformed(patch.get_patch_transform()).vertices[:, 0]
        yield float(x.min()), float(x.max()), to_hex(patch.get_facecolor())
    for line in axes.lines:
        x = line.get_xdata()
        if line.get_transform() is not axes.transData and x[0] == x[-1]:
            yield float(x[0]), float(x[0]), to_hex(line.get_color())


def plots_html(zooms: Mapping[str, Zoom], spare: Mapping[str, Zoom]) -> str:
    """Return what a page needs to draw panels in place of pictures; nothing where there are none.

    zooms : by the id of the figure.   spare : the first of them, while there is room.
    """
    page, _ = _fitting(zooms)
    for name in spare:
        zooms = {**zooms, name: spare[name]}
        larger, columns = _fitting(zooms)
        if columns < _COARSE:
            break
        page = larger
    return page


def _fitting(zooms: Mapping[str, Zoom]) -> tuple[str, int]:
    """Return the largest page that there is room for, and its columns."""
    columns, page, fitted, before = _COLUMNS_AT_FIRST, "", 0, (0, 0)
    if not zooms:
        return page, fitted
    script = _script()
    room = LARGEST - len(script)
    for _ in range(_TRIES):
        data = _packed("zoom-data", _data(zooms, columns))
        size = len(data)
        if fitted < columns and size <= room:
            page, fitted = data + script, columns
        full = size <= room < _FULL * size
        if full or columns == before[0] or (size <= room and columns == _COLUMNS):
            break
        more = (size - before[1]) / (columns - before[0])  # of each column; points have none
        before = columns, size
        columns = max(
            1, min(int(columns + (_TRIM * room - size) / (more or size / columns)), _COLUMNS)
        )
    return page, fitted


@cache
def _script() -> str:
    """Return the library with what draws, and what opens it."""
    parts = ("uplot/uPlot.min.css", "uplot/uPlot.iife.min.js", "zoom.js")
    style, *code = ((Path(__file__).parent / one).read_text(encoding="utf-8") for one in parts)
    text = "\n".join([f"const LIBRARY = {json.dumps(style)};", *code])
    return f"{_packed('zoom-script', text)}<script>\n{_OPEN}\n</script>\n"


def _packed(name: str, text: str) -> str:
    data = b64encode(zlib.compress(text.encode(), 9)).decode("ascii")
    return f'<script type="text/plain" id="{name}">{data}</script>\n'


def _data(zooms: Mapping[str, Zoom], columns: int) -> str:
    """Return panels as JSON; an array of several lines stands once, as steps of its last digit."""
    places: dict[str, int] = {}

    def place(values: Array, most: float) -> int:
        largest = float(np.nanmax(np.abs(values), initial=0.0))
        decimals = math.floor(math.log10(most / (largest or most)))
        known = ~np.isnan(values)
        steps = np.full(len(values), None, dtype=object)
        steps[known] = np.diff(np.rint(values[known] * 10.0**decimals).astype(int), prepend=0)
        return places.setdefault(_json([decimals, *steps]), len(places))

    figures = {}
    for name, panels in zooms.items():
        figures[name] = [panel._asdict() for panel in panels]
        for panel in figures[name]:
            panel["series"] = [
                one._replace(x=place(one.x, _FINE), y=place(one.y, one.most))._asdict()
                for one in (line.thinned(columns) for line in panel["series"])
            ]
    return f'{{"columns":{columns},"figures":{_json(figures)},"arrays":[{",".join(places)}]}}'


def _json(value: Any) -> str:
    return json.dumps(value, separators=(",", ":"))
