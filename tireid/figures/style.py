"""One look for every figure, set for the time of drawing only: matplotlib's globals stay untouched.

Truth is black, what was identified online blue, the frozen model orange and dashed, the linear tire
grey and dotted; the colors are those of Okabe and Ito, which color-blind readers tell apart.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import wraps
from io import BytesIO
from pathlib import Path
from typing import Any, Literal, NamedTuple, ParamSpec

import numpy as np
from matplotlib import rc_params_from_file, style
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine, LayoutEngine
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator
from numpy.typing import NDArray
from PIL import Image

from codegen.arrays import Array
from codegen.writing import write_file
from identifier.measured import printed_unit
from identifier.paper.design import PaperIdentifier
from identifier.reproducibility import AxleRmse
from identifier.run import History
from tireid.zoom import REPLAY, ZOOMED, Drawn, zoom_of

PAGE = 7.16  # width of both columns of a paper [in]
RESOLUTION = 200  # [dots per inch]
_LINE, _ENTRY = 0.15, 0.19  # of text, and of a legend [in]
_NUMBERS = 0.46  # of the left axis, and their distances [in], at least
_DIGIT, _TICK = 0.088, 0.2  # of a number there, and beside it: its label and its axis [in]
_MOST_DIGITS = 7  # of a number: powers of ten are written shorter than they are spelled
_NEAR = 0.07  # [in]
_WHITE = {254: 255}  # as it comes out of a palette
# s: of a clock that begins later, as a Unix time does, only the last digits are shown
FAR = 1e5
CLOCK_STEP = 100.0  # s
# an axis reaches at most this many times beyond the force it is compared with
FARTHEST = 3.0

_P = ParamSpec("_P")


BLACK, GREY, BLUE, ORANGE = "#000000", "#767676", "#0072B2", "#D55E00"
GREEN, PURPLE, SKY, AMBER = "#009E73", "#AA4499", "#56B4E9", "#E69F00"
SERIES = (BLUE, ORANGE, GREEN, PURPLE, AMBER, SKY, GREY)

Look = Mapping[str, Any]  # of a curve, as words of matplotlib
TRUTH: Look = {"color": BLACK, "linewidth": 1.5, "label": "truth"}
_POINTS: Look = {"linestyle": "", "marker": ".", "markersize": 3.0}
MOTION: Look = {**_POINTS, "color": BLACK, "label": "force from the motion"}
ONLINE: Look = {"color": BLUE, "linewidth": 0.9, "label": "online"}
FROZEN: Look = {
    "color": ORANGE, "linestyle": (0, (3.5, 1.2)), "linewidth": 1.1, "label": "model",
}  # fmt: skip
MODEL: Look = {**_POINTS, "color": ORANGE, "label": "model"}
LINEAR: Look = {
    "color": GREY, "linestyle": (0, (1, 1.2)), "linewidth": 1.2, "label": "linear tire",
}  # fmt: skip

_look = rc_params_from_file(Path(__file__).with_name("look.mplstyle"), use_default_template=False)
LOOK: dict[str, Any] = dict(_look.items())


def styled(draw: Callable[_P, Figure]) -> Callable[_P, Figure]:
    """Return a drawing function that works in the look of the project, whatever the user's own.

    A figure that has no legend gets one above its panels.
    """

    @wraps(draw)
    def wrapper(*args: _P.args, **kwargs: _P.kwargs) -> Figure:
        with style.context(["default", LOOK]):
            figure = draw(*args, **kwargs)
            if not any(one.get_legend() for one in figure.axes) and not figure.legends:
                legend_above(figure)
            return figure

    return wrapper


class _NotebookFigure(Figure):
    """A figure that Jupyter displays without pyplot."""

    def _repr_png_(self) -> bytes:
        return figure_png(self, resolution=100)


class _Margins(LayoutEngine):
    """Room for titles, numbers and labels as large as ours are, which is not measured anew."""

    _adjust_compatible, _colorbar_gridspec = True, False
    entries = 0  # rows of the legend

    def execute(self, fig: Figure) -> None:
        grid = fig.axes[0].get_gridspec()
        assert grid is not None
        width, height = fig.get_size_inches()
        titles = [one.get_title(side) for one in fig.axes for side in ("left", "right")]
        lines = _LINE * max(1 + text.count("\n") if text else 0 for text in titles)
        numbered = any(one.get_xlabel() for one in fig.axes[: -grid.ncols])
        names = _LINE * max(1 + one.get_ylabel().count("\n") for one in fig.axes)
        numbers = [
            len(text)
            for one in fig.axes[:: grid.ncols]
            for text in one.yaxis.get_major_formatter().format_ticks(list(one.get_yticks()))
        ]
        widest = _TICK + _DIGIT * min(max(numbers, default=0), _MOST_DIGITS)
        left, below = max(_NUMBERS, widest) + names, 2.0 * _LINE + _NEAR
        gap = lines + 1.5 * _NEAR + (below if numbered else 0.0)
        top = lines + _NEAR + self.entries * _ENTRY
        each = (height - top - below - _NEAR - (grid.nrows - 1) * gap) / grid.nrows
        fig.subplots_adjust(
            left=left / width,
            right=1.0 - 1.5 * _NEAR / width,
            top=1.0 - top / height,
            bottom=(below + _NEAR) / height,
            hspace=gap / each,
            wspace=0.06,
        )
        for axes in fig.axes:
            box = axes.get_position()
            axes.xaxis.set_label_coords(0.5, (_LINE + _NEAR) / (-height * box.height))
            axes.yaxis.set_label_coords((names + _NEAR - left) / (width * box.width), 0.5)


def new_figure(height: float, *, plain: bool = False) -> Figure:
    """Return an empty figure that fits its labels into its size when drawn.

    height : of the figure [in].
    plain : rows of panels with nothing beside them, of which the room for labels is known.
    """
    figure = _NotebookFigure(
        figsize=(PAGE, height), layout=_Margins() if plain else ConstrainedLayoutEngine()
    )
    FigureCanvasAgg(figure)
    return figure


def axle_panels(
    heights: Sequence[float], *, room: float = 0.0, sharex: bool | Literal["col"] = True
) -> tuple[Figure, NDArray[Any]]:
    """Return an empty figure and its panels: a row for each height [in], a column for each axle.

    room : above and below them [in].
    """
    figure = new_figure(room + sum(heights), plain=True)
    panels = figure.subplots(
        len(heights), 2, sharex=sharex, sharey="row", height_ratios=heights, squeeze=False
    )
    for axes, name in zip(panels[0], AXLES, strict=True):
        axes.set_title(name)
    return figure, panels


def label_forces(panels: NDArray[Any], unit: "ForceUnit", *, residual: bool) -> None:
    """Name the axes of rows of forces, the last row of residuals where there is one."""
    for row, axes in enumerate(panels[:, 0]):
        of_residuals = residual and row == len(panels) - 1
        axes.set_ylabel(f"{'residual' if of_residuals else 'lateral force'} [{unit.name}]")


@contextmanager
def laid_out(figure: Figure) -> Iterator[None]:
    """Lay a figure out, and let it be drawn in the look of the project meanwhile.

    It is laid out once: it is drawn more than once, and this takes as long as that.
    """
    with style.context(["default", LOOK]):
        engine = figure.get_layout_engine()
        if engine is not None:
            # At fewer dots letters are less exact.
            resolution, figure.dpi = figure.dpi, RESOLUTION
            engine.execute(figure)
            figure.dpi = resolution
            figure.set_layout_engine(None)  # that of rcParams, where `LOOK` has none
        yield


def figure_png(figure: Figure, *, resolution: int = RESOLUTION) -> bytes:
    """Return a figure as PNG of few colors: a third of the bytes, written in half the time."""
    buffer, dpi = BytesIO(), figure.dpi
    with laid_out(figure):
        figure.dpi = resolution
        canvas: Any = FigureCanvasAgg(figure)
        canvas.draw()
        figure.dpi = dpi
    drawn = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
    drawn = drawn.quantize(method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
    drawn.putpalette([_WHITE.get(one, one) for one in drawn.getpalette() or ()])
    drawn.save(buffer, "png", dpi=(resolution, resolution))
    return buffer.getvalue()


def save_figures(folder: Path, figures: Mapping[str, Figure]) -> dict[str, bytes]:
    """Write figures as PNG under their names; return these, which a report shows, too."""
    images = dict[str, bytes]()
    for name, one in figures.items():
        images[name] = drawn = Drawn(figure_png(one))
        drawn.spare = name.startswith(REPLAY)
        drawn.zoom = zoom_of(one) if drawn.spare or name in ZOOMED else ()
        write_file(folder / f"{name}.png", drawn)
    return images


TIME = "time [s]"
AXLES = ("Front axle", "Rear axle")
_FREEZE, _PREDICTION = "freeze", "after the freeze (prediction)"


def clock_zero(t: Array) -> float:
    """Return what figures take off the times of a recording [s]; 0 where they are as short as is.

    t : times of the samples (n,) [s].
    """
    first = float(t[0])
    return 0.0 if abs(first) < FAR else CLOCK_STEP * float(np.floor(first / CLOCK_STEP))


def label_time(axes: Axes, t: Array) -> None:
    """Name the time axis of a panel, and number it from the zero that it names.

    t : times of the samples (n,) [s].
    """
    zero = clock_zero(t)
    axes.set_xlabel(TIME if zero == 0.0 else f"time since {zero:.0f} s [s]")
    if zero != 0.0:
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value - zero:g}"))


def mark_freeze(axes: Axes, t_freeze: float, *, prediction: bool = False) -> None:
    """Draw the freeze as a line and, where the replay goes on, shade what it predicts.

    The limits of the time axis must be set before.

    t_freeze : time of the freeze [s].
    """
    first, last = axes.get_xlim()
    if prediction and t_freeze < last:
        axes.axvspan(
            max(t_freeze, first),
            last,
            label=_PREDICTION,
            facecolor="#F1EDE4",
            edgecolor="none",
            zorder=0,
        )
    if first <= t_freeze <= last:
        axes.axvline(t_freeze, color=GREY, linewidth=0.8, linestyle=(0, (4, 2)), label=_FREEZE)


def few_ticks(axis: Axis) -> None:
    """Number a logarithmic axis in plain numbers: at 1, 2 and 5 of decades, finer within one."""
    low, high = axis.get_view_interval()
    subs = (1.0, 2.0, 5.0) if high > 10.0 * low else (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0)
    axis.set_major_locator(LogLocator(subs=subs))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_locator(NullLocator())


def note(axes: Axes, text: str) -> None:
    """Write a short text above the right end of a panel, opposite to its title."""
    axes.set_title(text, loc="right", color="#444444")


def legend_above(figure: Figure, *, columns: int | None = None, last: Sequence[str] = ()) -> None:
    """Put one legend of all labeled curves above all panels, where it covers no data.

    columns : entries in a row; None puts up to five in one.   last : labels that end it.
    """
    entries: dict[str, Any] = {}
    for axes in figure.axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    for label in (*last, _FREEZE, _PREDICTION):
        if label in entries:
            entries[label] = entries.pop(label)
    if entries:
        columns = columns or (len(entries) if len(entries) < 6 else 3)
        engine = figure.get_layout_engine()
        if isinstance(engine, _Margins):
            engine.entries = -(-len(entries) // columns)
        place = {"loc": "outside upper center", "borderaxespad": 0.2}
        _bold_legend(figure, entries, ncols=columns, **place)


def legend_beside(axes: Axes) -> None:
    """Put the legend of one panel to its right, where it covers no data."""
    entries = dict(zip(*reversed(axes.get_legend_handles_labels()), strict=True))
    place = {"loc": "upper left", "bbox_to_anchor": (1.01, 1.0), "borderaxespad": 0.0}
    _bold_legend(axes, entries, **place)


def _bold_legend(owner: Any, entries: Mapping[str, Any], **place: Any) -> None:
    """Put a legend, its thin lines and faint dots large enough to tell their colors."""
    for line in owner.legend([*entries.values()], [*entries], **place).get_lines():
        line.set_linewidth(max(line.get_linewidth(), 1.2))
        if line.get_marker() == ".":
            line.set_markersize(7.0)
            line.set_alpha(1.0)


class ForceUnit(NamedTuple):
    """A unit of force on an axis: its name and its size [N]."""

    name: str
    newtons: float

    def format(self, error: AxleRmse, axle: int) -> str:
        """Return an axle's error as text with its unit.

        error : of both axles [N].   axle : 0 is the front axle, 1 the rear.
        """
        value = (error.front, error.rear)[axle] / self.newtons
        digits = f"{value:.3g}" if value >= 1.0 else f"{value:.2f}"
        return f"{digits} {self.name}" if np.isfinite(value) else "not finite"


def force_unit_of(force: Array) -> ForceUnit:
    """Return kN where a force reaches 1 kN, else N.

    force : any shape [N]; what is not finite does not count.
    """
    return ForceUnit(*printed_unit("N", force))


def paper_design(history: History) -> PaperIdentifier:
    """Return the design of a run of the paper's identifier, whose weights and error have units."""
    if not isinstance(history.method, PaperIdentifier):
        raise TypeError(f"a run of the paper's identifier is needed, not of {history.method}")
    return history.method


def force_range(reference: Array, *others: Array) -> tuple[float, float]:
    """Return the ends of an axis that shows all curves, but no more than thrice the reference.

    A law that diverges or a model that is far off leaves the panel instead of flattening the rest.
    """
    known = reference[np.isfinite(reference)]
    bound = FARTHEST * float(np.abs(known).max(initial=0.0)) or np.inf
    every = np.concatenate([one.ravel() for one in (reference, *others)])
    every = every[np.abs(every) <= 1e12]
    low = max(float(every.min(initial=0.0)), -bound)
    high = min(float(every.max(initial=0.0)), bound)
    margin = 0.06 * (high - low) or 1.0
    return low - margin, high + margin


def drawable(curve: Array, limits: tuple[float, float]) -> Array:
    """Return a curve whose values far outside the axis are brought close to it, NaN left out."""
    low, high = limits
    reach = 10.0 * (high - low)
    return np.clip(curve, low - reach, high + reach)
