"""The laws by name: two kinds of statistics with two ways down, and least squares."""

from collections.abc import Mapping

from identifier.regression.concurrent import concurrent
from identifier.regression.descent import gradient, newton
from identifier.regression.forgetting import bounded_trace, directional, exponential
from identifier.regression.kreisselmeier import kreisselmeier
from identifier.regression.law import Law
from identifier.regression.least_squares import least_squares

LAWS: Mapping[str, Law] = {
    "kreisselmeier": kreisselmeier(gradient),
    "kreisselmeier_newton": kreisselmeier(newton),
    "rls": least_squares(directional),
    "rls_bounded_trace": least_squares(bounded_trace),
    "rls_exponential": least_squares(exponential),  # for comparison: its P is not bounded
    "concurrent": concurrent(gradient),
    "concurrent_newton": concurrent(newton),
}
