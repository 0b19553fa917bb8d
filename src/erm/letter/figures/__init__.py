"""Figures of the letter's studies."""

from erm.letter.figures.curves import plot_predictions, plot_sweeps
from erm.letter.figures.errors import plot_face_errors, plot_ordinates

__all__ = ["plot_face_errors", "plot_ordinates", "plot_predictions", "plot_sweeps"]
