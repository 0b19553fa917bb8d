"""Figures of products as files."""

from pathlib import Path
from typing import cast

import xarray as xr
from matplotlib.figure import Figure
from matplotlib.projections.polar import PolarAxes

from erm.console import save_figure
from erm.storage import open_group
from sounder import figures


def draw_product(product: Path, out: Path, *, suffix: str = "png") -> list[Path]:
    """Draw the DAPS (polar, and cartesian with the MPCs) and the PDP of one product.

    Returns
    -------
    list of Path
        Files written, named after the product.

    Raises
    ------
    DataError
        The file is not a product, or the folder cannot be written to.
    """
    name, daps = _daps(product)
    mpc = open_group(product, "/mpc")
    drawn: dict[str, Figure] = {}

    drawn["daps_polar"] = Figure(figsize=(5.6, 4.2), layout="constrained")
    figures.daps_polar([(name, daps)], _polar(drawn["daps_polar"]))
    drawn["daps"] = Figure(figsize=(5.6, 3.4), layout="constrained")
    figures.daps_cartesian(daps, drawn["daps"].add_subplot(title=name), mpc=mpc)
    drawn["pdp"] = Figure(figsize=(5.6, 3.2), layout="constrained")
    figures.pdp([(name, daps)], drawn["pdp"].add_subplot())
    return [_save(figure, out / f"{product.stem}_{kind}.{suffix}") for kind, figure in drawn.items()]


def draw_overlay(first: Path, second: Path, out: Path, *, suffix: str = "png") -> list[Path]:
    """Draw the DAPS of two products into one polar diagram.

    Returns
    -------
    list of Path
        The file written.

    Raises
    ------
    DataError
        A file is not a product, or the folder cannot be written to.
    """
    figure = Figure(figsize=(6.6, 4.2), layout="constrained")
    figures.daps_polar([_daps(first), _daps(second)], _polar(figure))
    return [_save(figure, out / f"{first.stem}_{second.stem}_daps_polar.{suffix}")]


def _daps(product: Path) -> tuple[str, xr.Dataset]:
    daps = open_group(product, "/daps")  # first, for it tells a product from other files
    return str(open_group(product)["position"].values[0]), daps


def _polar(figure: Figure) -> PolarAxes:
    axes = figure.add_subplot(projection="polar")
    return cast(PolarAxes, axes)


def _save(figure: Figure, path: Path) -> Path:
    save_figure(figure, path)
    return path
