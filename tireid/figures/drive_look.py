"""How the pictures of a drive tell paths, cones and the tires that a tracker was told of."""

from collections.abc import Mapping
from typing import Any

from tireid.figures.style import AMBER, BLACK, BLUE, GREY, ORANGE

PATH: Mapping[str, Any] = {
    "color": "#9ADBC6",
    "linewidth": 3.5,
    "solid_capstyle": "butt",
    "label": "path",
}
CONES: Mapping[str, Any] = {
    "linestyle": "",
    "marker": "o",
    "markersize": 2.6,
    "markeredgewidth": 0.4,
    "markeredgecolor": "#7A4B00",
    "markerfacecolor": AMBER,
    "label": "cones",
}
AT_THE_END = " at the end"  # what a label ends with that is of a tire as it was then
LATER = (0, (2.5, 0.9))
TIRES: Mapping[str, Mapping[str, Any]] = {
    "linear": {"color": GREY, "linestyle": (0, (1, 1.2)), "linewidth": 1.3},
    "frozen": {"color": ORANGE, "linestyle": "-", "linewidth": 1.2},
    "oracle": {"color": BLACK, "linestyle": (0, (5, 1.5)), "linewidth": 1.1},
    "learning": {"color": BLUE, "linestyle": "-", "linewidth": 1.2},
}


def tire_look(label: str) -> dict[str, Any]:
    """Return color, line style and width of a tire in every figure.

    Parameters
    ----------
    label : that begins with the name of the tire.
    """
    look = dict(TIRES.get(label.split()[0], TIRES["frozen"]))
    return look | {"linestyle": LATER, "linewidth": 1.4} if label.endswith(AT_THE_END) else look
