"""Figures worth putting in a paper: functions of results that return a matplotlib Figure."""

from tireid.figures.compare_matrix import matrix_figure
from tireid.figures.compare_methods import methods_figure
from tireid.figures.compare_pareto import pareto_figure
from tireid.figures.comparison import comparison_figure
from tireid.figures.drive_errors import drive_errors_figure
from tireid.figures.drive_path import drive_path_figure
from tireid.figures.drive_solve import drive_solve_figure
from tireid.figures.drive_steering import drive_steering_figure
from tireid.figures.drive_tires import drive_tires_figure
from tireid.figures.errors import error_figure
from tireid.figures.forces import force_figure
from tireid.figures.inputs import inputs_figure
from tireid.figures.learnt_axles import learnt_axles_figure
from tireid.figures.prediction import prediction_figure
from tireid.figures.scheme import scheme_figure
from tireid.figures.side_by_side import side_by_side_figure
from tireid.figures.slip import slip_figure
from tireid.figures.stability import locus_figure
from tireid.figures.style import figure_png, save_figure
from tireid.figures.tire_curve import TireCurve, axle_slip
from tireid.figures.weights import weights_figure

__all__ = [
    "TireCurve",
    "axle_slip",
    "comparison_figure",
    "drive_errors_figure",
    "drive_path_figure",
    "drive_solve_figure",
    "drive_steering_figure",
    "drive_tires_figure",
    "error_figure",
    "figure_png",
    "force_figure",
    "inputs_figure",
    "learnt_axles_figure",
    "locus_figure",
    "matrix_figure",
    "methods_figure",
    "pareto_figure",
    "prediction_figure",
    "save_figure",
    "scheme_figure",
    "side_by_side_figure",
    "slip_figure",
    "weights_figure",
]
