"""Figures of products, drawn into files.

Processes that draw import this file, and with it only what draws.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.projections.polar import PolarAxes

from erm.common.console import drawing, save_figure
from erm.common.errors import DataError
from erm.common.storage import open_groups, require_axes
from erm.mpcs.files import MAX_DELAY
from sounder.figures import products as figures

KINDS = ("daps_polar", "daps", "pdp")
"""Figures of a product, as their files are named."""


@drawing()
def product_axes() -> list[Axes]:
    """Axes of the figures of a product, in the order of :data:`KINDS`."""
    polar, cartesian, profile = (Figure(figsize=(5.6, height)) for height in (4.2, 3.4, 3.2))
    return [_polar(polar), cartesian.add_subplot(), profile.add_subplot()]


@drawing()
def draw_product(product: Path, out: Path, *, suffix: str = "png", axes: Sequence[Axes] | None = None) -> list[Path]:
    """Draw the DAPS (polar, and over delay and azimuth with the MPCs) and the PDP of a product.

    Parameters
    ----------
    product : Path
    out : Path
        Folder.
    suffix : str
        Format of the figures.
    axes : sequence of matplotlib.axes.Axes, optional
        From :func:`product_axes`. With those of an earlier product the next takes half the time.

    Returns
    -------
    list of Path
        Files, named after the product.

    Raises
    ------
    DataError
        The file is not a product, or the folder cannot be written to.
    """
    name, daps, mpc = _groups(product, "/mpc")
    require_axes(
        mpc, product, dict.fromkeys(("delay", "azimuth", "azimuth_std", "path_gain", "path_gain_std"), ("mpc",))
    )
    _require_delays(mpc, product)
    polar, cartesian, profile = axes = axes or product_axes()
    figures.daps_polar([(name, daps)], cast(PolarAxes, polar))
    figures.daps_cartesian(daps, cartesian, mpc=mpc).set_title(name)
    figures.pdp([(name, daps)], profile, mpc=mpc)
    return [_save(ax, path) for ax, path in zip(axes, figure_paths(product, out, suffix=suffix), strict=True)]


@drawing()
def draw_elevations(product: Path, out: Path, *, suffix: str = "png") -> list[Path]:
    """Draw the DAPS of a product over delay and azimuth, with a panel for each elevation, the highest on top.

    Returns
    -------
    list of Path
        The file.

    Raises
    ------
    DataError
        The file is not a product, or the folder cannot be written to.
    """
    name, daps = _groups(product)
    angles = np.sort(daps["elevation"].values)[::-1]
    figure = Figure(figsize=(5.6, 2.6 * len(angles)), layout="constrained")
    for angle, ax in zip(angles, np.ravel(figure.subplots(len(angles), 1, sharex=True)), strict=True):
        figures.daps_cartesian(daps, ax, elevation=float(angle)).label_outer()
    figure.suptitle(name)
    return [_save(figure, out / f"{product.stem}_elevations.{suffix}")]


def figure_paths(product: Path, out: Path, *, suffix: str = "png") -> list[Path]:
    """Files that :func:`draw_product` writes, in the order of :data:`KINDS`."""
    return [out / f"{product.stem}_{kind}.{suffix}" for kind in KINDS]


def is_up_to_date(paths: Sequence[Path], product: Path) -> bool:
    """Whether all figures exist and are newer than their product."""
    made = product.stat().st_mtime_ns
    return all(path.is_file() and path.stat().st_mtime_ns > made for path in paths)


@drawing()
def draw_overlay(first: Path, second: Path, out: Path, *, suffix: str = "png") -> list[Path]:
    """Draw the DAPS of two products into one polar diagram.

    Returns
    -------
    list of Path
        The file.

    Raises
    ------
    DataError
        A file is not a product, or the folder cannot be written to.
    """
    figure = Figure(figsize=(6.6, 4.2), layout="constrained")
    figures.daps_polar([_groups(first), _groups(second)], _polar(figure))
    return [_save(figure, out / f"{first.stem}_{second.stem}_daps_polar.{suffix}")]


def _groups(product: Path, *others: str) -> tuple[Any, ...]:
    """Name of the position, group ``/daps``, and other groups."""
    # the DAPS first: its error says what is wrong with other files
    daps, root, *rest = open_groups(product, "/daps", "/", *others, expected="a product of `sounder process`")
    scan = ("azimuth", "elevation")
    require_axes(daps, product, {"daps": (*scan, "delay"), "noise_floor": scan, "pdp": ("delay",)})
    require_axes(daps, product, {name: (name,) for name in (*scan, "delay")})
    _require_delays(daps, product)
    if not daps["daps"].size or "position" not in root or root["position"].size != 1:
        raise DataError(f"{product}: holds no direction or no position; expected a product of `sounder process`")
    return str(root["position"].values.ravel()[0]), daps, *rest


def _require_delays(dataset: xr.Dataset, product: Path) -> None:
    if not (np.abs(dataset["delay"].values) <= MAX_DELAY).all():
        raise DataError(f"{product}: a delay is no number or above 1 ms; process the recording again")


def _polar(figure: Figure) -> PolarAxes:
    axes = figure.add_subplot(projection="polar")
    return cast(PolarAxes, axes)


def _save(drawn: Figure | Axes, path: Path) -> Path:
    save_figure(drawn, path)
    return path
