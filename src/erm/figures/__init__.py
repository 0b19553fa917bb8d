"""Figures of maps, errors and studies: products in, axes or a figure out; saving is the caller's business."""

from erm.figures.curves import plot_error_cdf, plot_predictions, plot_sweeps
from erm.figures.errors import plot_face_errors, plot_ordinates
from erm.figures.maps import mark_width, plot_map, plot_sensed_points
from erm.figures.sectors import plot_sectors
from erm.figures.style import PALETTE

__all__ = [
    "PALETTE",
    "mark_width",
    "plot_error_cdf",
    "plot_face_errors",
    "plot_map",
    "plot_ordinates",
    "plot_predictions",
    "plot_sectors",
    "plot_sensed_points",
    "plot_sweeps",
]
