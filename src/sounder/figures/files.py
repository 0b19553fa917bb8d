"""Figures of products and scores, drawn into files."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.projections.polar import PolarAxes

from erm.common.atomic import atomic_path
from erm.common.console import drawing, save_figure
from erm.common.errors import DataError
from erm.common.storage import number_in, open_groups, require_axes
from sounder.figures import parameters as parameter_figures
from sounder.figures import products as figures
from sounder.figures import score as score_figures
from sounder.mpc.score import Score
from sounder.parameters.statistics import Statistic

KINDS = ("daps_polar", "daps", "pdp")
"""Figures of a product, as their files are named."""
PARAMETER_FIGURES = ("parameter-cdfs", "path-loss")
"""Figures of the channel parameters of a campaign, as their files are named."""


@drawing()
def draw_product(product: Path, out: Path, *, suffix: str = "png") -> list[Path]:
    """Draw the DAPS (polar, and over delay and azimuth with the MPCs) and the PDP of a product.

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
    polar, cartesian, profile = (Figure(figsize=(5.6, height)) for height in (4.2, 3.4, 3.2))
    figures.daps_polar([(name, daps)], _polar(polar))
    figures.daps_cartesian(daps, cartesian.add_subplot(title=name), mpc=mpc)
    figures.pdp([(name, daps)], profile.add_subplot(), mpc=mpc)
    paths = figure_paths(product, out, suffix=suffix)
    return [_save(figure, path) for figure, path in zip((polar, cartesian, profile), paths, strict=True)]


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
    parameter_figures.path_loss(parameters, statistics, loss.add_subplot())
    drawn = (parameter_figures.cdf_page(parameters), loss)
    return [_save(figure, out / f"{name}.{suffix}") for name, figure in zip(PARAMETER_FIGURES, drawn, strict=True)]


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


@drawing()
def write_score(score: Score, out: Path, *, suffix: str = "png") -> list[Path]:
    """Write a score: ``paths.csv`` with a row for each true path, and figures over SNR and over separation.

    Returns
    -------
    list of Path
        Files. There is no figure over the SNR if no SNR is known.

    Raises
    ------
    DataError
        The folder cannot be written to.
    """
    with atomic_path(out / "paths.csv") as temporary:
        score.paths.to_dataframe().to_csv(temporary, index=False)
    written = [out / "paths.csv"]
    kinds: list[score_figures.Against] = ["snr", "separation"]
    for against in kinds:
        if not np.isfinite(score.paths[against].values).any():
            continue
        figure = Figure(figsize=(9.6, 5.6), layout="constrained")
        first, *others = figure.subplots(2, 3).flat
        score_figures.detection(score, first, against=against)
        for parameter, ax in zip(score_figures.ERRORS, others, strict=False):
            score_figures.errors(score, ax, parameter=parameter, against=against)
        score_figures.normalised(score, others[-1])
        written.append(_save(figure, out / f"against_{against}.{suffix}"))
    return written


def _groups(product: Path, *others: str) -> tuple[Any, ...]:
    """Name of the position, group ``/daps``, and other groups."""
    # the DAPS first: its error says what is wrong with other files
    daps, root, *rest = open_groups(product, "/daps", "/", *others, expected="a product of `sounder process`")
    scan = ("azimuth", "elevation")
    require_axes(daps, product, {"daps": (*scan, "delay"), "noise_floor": scan, "pdp": ("delay",)})
    require_axes(daps, product, {name: (name,) for name in (*scan, "delay")})
    number_in(daps, "rx_antenna_gain", product, 0.0)
    if not daps["daps"].size or "position" not in root or root["position"].size != 1:
        raise DataError(f"{product}: holds no direction or no position; expected a product of `sounder process`")
    return str(root["position"].values.ravel()[0]), daps, *rest


def _polar(figure: Figure) -> PolarAxes:
    axes = figure.add_subplot(projection="polar")
    return cast(PolarAxes, axes)


def _save(figure: Figure, path: Path) -> Path:
    save_figure(figure, path)
    return path
