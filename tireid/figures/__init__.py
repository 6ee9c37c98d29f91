"""Figures worth putting in a paper: functions of results that return a matplotlib Figure."""

from tireid.figures.comparison import comparison_figure
from tireid.figures.errors import error_figure
from tireid.figures.forces import force_figure
from tireid.figures.inputs import inputs_figure
from tireid.figures.prediction import prediction_figure
from tireid.figures.slip import slip_figure
from tireid.figures.stability import locus_figure
from tireid.figures.style import figure_png, save_figure
from tireid.figures.weights import weights_figure

__all__ = [
    "comparison_figure",
    "error_figure",
    "figure_png",
    "force_figure",
    "inputs_figure",
    "locus_figure",
    "prediction_figure",
    "save_figure",
    "slip_figure",
    "weights_figure",
]
