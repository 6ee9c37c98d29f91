"""Draws the identifier as a block diagram, as in the paper's Fig. 1, for tireid/figures.

`python -m benchmarks.scheme_picture` writes fig1_scheme.png and fig1_scheme.svg there.

Orange is what the two laws of the paper differ in, the error filter, and where a freeze cuts. The
network reads the measured state, which is the default here; the paper prints the estimated one.
"""

import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyBboxPatch

from tireid.figures import style
from tireid.figures.chosen import CHOSEN as FIGURES_CHOSEN
from tireid.figures.paper import SCHEME
from tireid.figures.style import BLACK, GREY, ORANGE, new_figure

WIDTH, _HEIGHT = 100.0, 46.0  # of the drawing, in its own unit
_JOINT, SUM = 0.45, 1.6  # radii of a joint of two lines and of the sum

Point = tuple[float, float]


class Block(NamedTuple):
    """A box: its center, width and height, what stands in it, and the color of its frame."""

    center: Point
    size: Point
    text: str
    color: str = BLACK


class Signal(NamedTuple):
    """An arrow along points; its label stands at a place of its own. A joint begins at a dot."""

    points: Sequence[Point]
    label: str
    place: Point
    joint: bool = False
    color: str = BLACK


with Path(__file__).with_suffix(".toml").open("rb") as file:
    _drawn = tomllib.load(file)
BLOCKS: Mapping[str, Block] = {name: Block(**block) for name, block in _drawn["blocks"].items()}
SIGNALS: Mapping[str, Signal] = {name: Signal(**one) for name, one in _drawn["signals"].items()}
DIFFERENCE: Point = (62.0, 38.0)  # ξ̃ = ξ - ξ̂
NOTES: Mapping[str, tuple[Point, str]] = {
    "law": ((83.0, 27.9), "instantaneous law:\n" + r"$\tilde\xi$ in place of $z$"),
    "freeze": ((64.0, 1.6), r"cut at $T_{\rm freeze}$"),
}
CUT: Point = (66.0, 6.0)


@style.styled
def scheme_figure() -> Figure:
    """Draw the identifier as blocks and signals."""
    figure = new_figure(FIGURES_CHOSEN.page, FIGURES_CHOSEN.page * _HEIGHT / WIDTH)
    axes = figure.subplots()
    axes.set(xlim=(0.0, WIDTH), ylim=(-0.5, _HEIGHT - 0.5), aspect="equal")
    axes.set_axis_off()
    for block in BLOCKS.values():
        _draw_block(axes, block)
    for signal in SIGNALS.values():
        _draw_signal(axes, signal)
    axes.add_patch(Circle(DIFFERENCE, SUM, facecolor="white", edgecolor=BLACK, linewidth=1.0))
    (x, y) = DIFFERENCE
    axes.text(x - 2.6, y + 1.0, "+", ha="center", va="center")
    axes.text(x - 1.6, y - 2.8, "\N{MINUS SIGN}", ha="center", va="center")
    (x, y) = CUT
    axes.plot([x - 0.8, x + 0.8], [y - 2.2, y + 2.2], color=ORANGE, linewidth=1.6)
    for (x, y), text in NOTES.values():
        axes.text(x, y, text, ha="center", va="center", color=ORANGE, fontsize=7.0)
    return figure


def _draw_block(axes: Axes, block: Block) -> None:
    (x, y), (width, height) = block.center, block.size
    frame = FancyBboxPatch(
        (x - width / 2, y - height / 2),
        width,
        height,
        boxstyle="round,pad=0,rounding_size=0.8",
        facecolor="white",
        edgecolor=block.color,
        linewidth=1.1,
    )
    axes.add_patch(frame)
    axes.text(x, y, block.text, ha="center", va="center", linespacing=1.75)


def _draw_signal(axes: Axes, signal: Signal) -> None:
    *way, last = signal.points
    if len(way) > 1:
        axes.plot(*zip(*way, strict=True), color=signal.color, linewidth=0.9, solid_capstyle="butt")
    arrow = {"arrowstyle": "-|>", "color": signal.color, "linewidth": 0.9, "shrinkA": 0.0}
    axes.annotate("", xy=last, xytext=way[-1], arrowprops={**arrow, "shrinkB": 0.0})
    if signal.joint:
        axes.add_patch(Circle(signal.points[0], _JOINT, facecolor=GREY, edgecolor="none", zorder=3))
    if signal.label:
        axes.text(*signal.place, signal.label, ha="center", va="center", color=signal.color)


def main() -> None:
    """Draw both files."""
    figure = scheme_figure()
    SCHEME.with_suffix(".svg").write_bytes(style.figure_svg(figure))
    SCHEME.write_bytes(style.figure_png(figure))
    print(f"wrote {SCHEME} and .svg")


if __name__ == "__main__":
    main()
