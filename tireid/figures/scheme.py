"""The identifier as a block diagram, as in the paper's Fig. 1: who tells whom, by which equation.

Orange is what the two laws of the paper differ in, the error filter, and where a freeze cuts. The
network reads the measured state, which is the default here; the paper prints the estimated one.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyBboxPatch

from tireid.figures.style import BLACK, BLUE, GREY, ORANGE, PAGE, new_figure, styled

WIDTH, HEIGHT = 100.0, 46.0  # of the drawing, in its own unit
JOINT, SUM = 0.45, 1.6  # radii of a joint of two lines and of the sum

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


BLOCKS: Mapping[str, Block] = {
    "vehicle": Block((17.0, 38.0), (15.0, 9.0), "vehicle (6)\nwith its tires"),
    "transform": Block((40.0, 38.0), (12.0, 9.0), r"(7)" + "\n" + r"$\xi = K^{-1}x$"),
    "observer": Block(
        (50.0, 22.0),
        (36.0, 10.0),
        "observer (8)\n"
        r"$\dot{\hat\xi} = A_d\,\hat\xi + (A_\xi\,\xi + B_\xi\,u - A_d\,\xi) + \hat f$",
        BLUE,
    ),
    "network": Block(
        (45.0, 6.0),
        (26.0, 10.0),
        "network\n" + r"$\hat f = \hat W\,\tanh(\hat V\,\bar x),\ \ \bar x = [x, u]$",
        BLUE,
    ),
    "filter": Block(
        (85.0, 38.0),
        (26.0, 9.0),
        "error filter (10)\n" + r"$\dot z = -\lambda z + \tilde\xi$",
        ORANGE,
    ),
    "laws": Block(
        (84.5, 11.5),
        (29.0, 21.0),
        "adaptive laws (11)-(13)\n"
        r"$\dot{\hat W} = -\eta_1 A_d^{-T} z\,\sigma^T - \rho_1 |\tilde\xi|\,\hat W$" + "\n"
        r"$\dot{\hat V} = -\eta_2 (I - \Lambda)\,\hat W^T A_d^{-T} z\,\bar x^T$" + "\n"
        r"$-\ \rho_2 |\tilde\xi|\,\hat V$",
        BLUE,
    ),
}
DIFFERENCE: Point = (62.0, 38.0)  # ξ̃ = ξ - ξ̂
SIGNALS: Mapping[str, Signal] = {
    "steering": Signal([(0.5, 38.0), (9.5, 38.0)], r"$u$", (2.5, 39.6)),
    "steering to observer": Signal([(5.0, 38.0), (5.0, 22.0), (32.0, 22.0)], "", (0, 0), True),
    "steering to network": Signal(
        [(5.0, 22.0), (5.0, 3.5), (32.0, 3.5)], r"$u$", (18.0, 5.1), True
    ),
    "state": Signal([(24.5, 38.0), (34.0, 38.0)], r"$x$", (27.0, 39.6)),
    "state to network": Signal(
        [(28.5, 38.0), (28.5, 8.5), (32.0, 8.5)], r"$x$", (27.0, 12.0), True
    ),
    "impulse": Signal([(46.0, 38.0), (62.0 - SUM, 38.0)], r"$\xi$", (53.5, 39.8)),
    "impulse to observer": Signal([(50.0, 38.0), (50.0, 27.0)], r"$\xi$", (51.5, 31.5), True),
    "estimate": Signal([(62.0, 27.0), (62.0, 38.0 - SUM)], r"$\hat\xi$", (63.6, 31.5)),
    "error": Signal([(62.0 + SUM, 38.0), (72.0, 38.0)], r"$\tilde\xi$", (66.5, 40.0)),
    "error to laws": Signal(
        [(69.5, 38.0), (69.5, 27.5), (76.0, 27.5), (76.0, 22.0)], r"$\tilde\xi$", (74.2, 24.8), True
    ),
    "filtered error": Signal([(91.0, 33.5), (91.0, 22.0)], r"$z$", (92.8, 27.0), False, ORANGE),
    "weights": Signal([(70.0, 6.0), (58.0, 6.0)], r"$\hat W, \hat V$", (61.5, 9.0)),
    "force": Signal([(45.0, 11.0), (45.0, 17.0)], r"$\hat f$", (46.6, 13.6)),
}
NOTES: Mapping[str, tuple[Point, str]] = {
    "law": ((83.0, 27.9), "instantaneous law:\n" + r"$\tilde\xi$ in place of $z$"),
    "freeze": ((64.0, 1.6), r"cut at $T_{\rm freeze}$"),
}
CUT: Point = (66.0, 6.0)


@styled
def scheme_figure() -> Figure:
    """Draw the identifier as blocks and signals."""
    figure = new_figure(PAGE, PAGE * HEIGHT / WIDTH)
    axes = figure.subplots()
    axes.set(xlim=(0.0, WIDTH), ylim=(-0.5, HEIGHT - 0.5), aspect="equal")
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
        axes.add_patch(Circle(signal.points[0], JOINT, facecolor=GREY, edgecolor="none", zorder=3))
    if signal.label:
        axes.text(*signal.place, signal.label, ha="center", va="center", color=signal.color)
