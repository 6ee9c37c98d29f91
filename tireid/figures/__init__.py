"""Figures worth putting in a paper: functions of results that return a matplotlib Figure.

Each is fetched where it is asked for: those of a drive need the tracker, others do not.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tireid.figures.compare import matrix_figure, methods_figure
    from tireid.figures.drive import (
        drive_errors_figure,
        drive_path_figure,
        drive_solve_figure,
        drive_steering_figure,
    )
    from tireid.figures.forces import (
        force_figure,
        inputs_figure,
        prediction_figure,
        side_by_side_figure,
    )
    from tireid.figures.paper import comparison_figure, error_figure, locus_figure, weights_figure
    from tireid.figures.plan import plan_area_figure, plan_band_figure, plan_steering_figure
    from tireid.figures.predict import friction_figure, motion_figure
    from tireid.figures.scheme import scheme_figure
    from tireid.figures.side_slip import drive_lateral_figure, side_slip_figure
    from tireid.figures.style import figure_png, figure_svg, save_figure
    from tireid.figures.tires import (
        TireCurve,
        axle_slip,
        drive_tires_figure,
        learnt_axles_figure,
        slip_figure,
    )

_HOMES = {
    "compare": ("matrix_figure", "methods_figure"),
    "drive": (
        "drive_errors_figure",
        "drive_path_figure",
        "drive_solve_figure",
        "drive_steering_figure",
    ),
    "forces": ("force_figure", "inputs_figure", "prediction_figure", "side_by_side_figure"),
    "paper": ("comparison_figure", "error_figure", "locus_figure", "weights_figure"),
    "plan": ("plan_area_figure", "plan_band_figure", "plan_steering_figure"),
    "predict": ("friction_figure", "motion_figure"),
    "scheme": ("scheme_figure",),
    "side_slip": ("drive_lateral_figure", "side_slip_figure"),
    "style": ("figure_png", "figure_svg", "save_figure"),
    "tires": ("TireCurve", "axle_slip", "drive_tires_figure", "learnt_axles_figure", "slip_figure"),
}
__all__ = [
    "TireCurve",
    "axle_slip",
    "comparison_figure",
    "drive_errors_figure",
    "drive_lateral_figure",
    "drive_path_figure",
    "drive_solve_figure",
    "drive_steering_figure",
    "drive_tires_figure",
    "error_figure",
    "figure_png",
    "figure_svg",
    "force_figure",
    "friction_figure",
    "inputs_figure",
    "learnt_axles_figure",
    "locus_figure",
    "matrix_figure",
    "methods_figure",
    "motion_figure",
    "plan_area_figure",
    "plan_band_figure",
    "plan_steering_figure",
    "prediction_figure",
    "save_figure",
    "scheme_figure",
    "side_by_side_figure",
    "side_slip_figure",
    "slip_figure",
    "weights_figure",
]


def __getattr__(name: str) -> Any:
    """Return a figure's function, fetched at its first use."""
    for home, names in _HOMES.items():
        if name in names:
            value = getattr(importlib.import_module(f"{__name__}.{home}"), name)
            globals()[name] = value
            return value
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
