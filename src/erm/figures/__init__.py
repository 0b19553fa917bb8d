"""Figures of maps and errors. Functions take products and return axes; they save no files."""

from erm.figures.error_cdf import plot_error_cdf
from erm.figures.maps import mark_width, plot_map, plot_sensed_points
from erm.figures.sectors import plot_sectors
from erm.figures.style import PALETTE

__all__ = ["PALETTE", "mark_width", "plot_error_cdf", "plot_map", "plot_sectors", "plot_sensed_points"]
