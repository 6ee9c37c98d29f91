"""One look for every figure, set for the time of drawing only: matplotlib's globals stay untouched.

Truth is black, what was identified online blue, frozen weights orange and dashed, the linear tire
grey and dotted; the colors are those of Okabe and Ito, which color-blind readers tell apart.
"""

from collections.abc import Callable, Mapping
from functools import wraps
from io import BytesIO
from pathlib import Path
from typing import Any, ParamSpec

from matplotlib import style
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

P = ParamSpec("P")

PAGE = 7.16  # width of both columns of a paper [in]
RESOLUTION = 200  # [dots per inch]

BLACK, GREY, BLUE, ORANGE = "#000000", "#767676", "#0072B2", "#D55E00"
GREEN, PURPLE, SKY, AMBER = "#009E73", "#AA4499", "#56B4E9", "#E69F00"
SERIES = (BLUE, ORANGE, GREEN, PURPLE, AMBER, SKY, GREY)

TRUTH: Mapping[str, Any] = {"color": BLACK, "linewidth": 1.5, "label": "truth"}
ONLINE: Mapping[str, Any] = {"color": BLUE, "linewidth": 0.9, "label": "online"}
FROZEN: Mapping[str, Any] = {
    "color": ORANGE,
    "linewidth": 1.1,
    "linestyle": (0, (3.5, 1.2)),
    "label": "frozen weights",
}
LINEAR: Mapping[str, Any] = {
    "color": GREY,
    "linewidth": 1.2,
    "linestyle": (0, (1, 1.2)),
    "label": "linear tire",
}

LOOK: dict[str, Any] = {
    "font.size": 8.0,
    "axes.titlesize": 8.0,
    "axes.labelsize": 8.0,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "legend.fontsize": 8.0,
    "legend.frameon": False,
    "legend.handlelength": 2.2,
    "legend.columnspacing": 1.6,
    "axes.linewidth": 0.6,
    "axes.edgecolor": "#444444",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "axes.grid": True,
    "axes.titlelocation": "left",
    "axes.titlepad": 4.0,
    "axes.formatter.use_mathtext": True,
    "grid.color": "#DDDDDD",
    "grid.linewidth": 0.5,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.major.size": 3.0,
    "ytick.major.size": 3.0,
    "figure.constrained_layout.wspace": 0.04,
    "agg.path.chunksize": 20000,
    "savefig.bbox": None,
}


def styled(draw: Callable[P, Figure]) -> Callable[P, Figure]:
    """Return a drawing function that works in the look of the project, whatever the user's own.

    Parameters
    ----------
    draw : function that makes a figure.
    """

    @wraps(draw)
    def wrapper(*args: P.args, **kwargs: P.kwargs) -> Figure:
        with style.context(["default", LOOK]):
            return draw(*args, **kwargs)

    return wrapper


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure that fits its labels into its size when drawn.

    Parameters
    ----------
    width : of the figure [in].
    height : of the figure [in].
    """
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def figure_png(figure: Figure, *, resolution: int = RESOLUTION) -> bytes:
    """Return a figure as PNG, the same bytes for the same figure.

    Parameters
    ----------
    figure : as a function of this package returns it.
    resolution : dots per inch.
    """
    buffer = BytesIO()
    with style.context(["default", LOOK]):
        figure.savefig(buffer, format="png", dpi=resolution, metadata={"Software": None})
    return buffer.getvalue()


def save_figure(figure: Figure, path: Path) -> None:
    """Write a figure as PNG.

    Parameters
    ----------
    figure : as a function of this package returns it.
    path : the file.
    """
    path.write_bytes(figure_png(figure))
