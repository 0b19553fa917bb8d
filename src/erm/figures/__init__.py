"""Figures of maps and errors: products in, axes or a figure out; saving is the caller's business."""

from erm.figures.error_cdf import plot_error_cdf
from erm.figures.maps import mark_width, plot_map, plot_sensed_points
from erm.figures.sectors import plot_sectors
from erm.figures.style import PALETTE

__all__ = ["PALETTE", "mark_width", "plot_error_cdf", "plot_map", "plot_sectors", "plot_sensed_points"]
