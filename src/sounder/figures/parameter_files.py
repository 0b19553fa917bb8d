"""Figures of the channel parameters of a campaign, drawn into files."""

from collections.abc import Sequence
from pathlib import Path

import xarray as xr
from matplotlib.figure import Figure

from erm.common.console import drawing, save_figure
from sounder.figures.parameters import cdf_page, path_loss
from sounder.parameters.statistics import Statistic

PARAMETER_FIGURES = ("parameter-cdfs", "path-loss")
"""The figures, as their files are named."""


@drawing()
def draw_parameters(
    parameters: xr.Dataset, statistics: Sequence[Statistic], out: Path, *, suffix: str = "png"
) -> list[Path]:
    """Draw the distributions of channel parameters, and path loss over distance.

    Returns
    -------
    list of Path
        Files, named as :data:`PARAMETER_FIGURES` says.
    """
    loss = Figure(figsize=(5.6, 4.0), layout="constrained")
    path_loss(parameters, statistics, loss.add_subplot())
    paths = [out / f"{name}.{suffix}" for name in PARAMETER_FIGURES]
    for figure, path in zip((cdf_page(parameters), loss), paths, strict=True):
        save_figure(figure, path)
    return paths
