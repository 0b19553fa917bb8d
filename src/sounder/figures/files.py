"""Products as figures in files, and judged by the truth in a file."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import cast

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.projections.polar import PolarAxes

from erm.common.console import save_figure
from erm.common.errors import DataError
from erm.common.storage import atomic_path, open_group
from erm.mpcs.files import read_csv, read_product
from sounder.figures import products as figures
from sounder.figures import score as score_figures
from sounder.instrument.description import Sounder
from sounder.mpc.score import Gates, Score, score, with_snr

KINDS = ("daps_polar", "daps", "pdp")
"""Figures of a product."""
TRUTH = "truth/paths.h5 of `sounder simulate`, an MPC table (.csv) or a product"


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
    polar, cartesian, profile = (Figure(figsize=(5.6, height), layout="constrained") for height in (4.2, 3.4, 3.2))
    figures.daps_polar([(name, daps)], _polar(polar))
    figures.daps_cartesian(daps, cartesian.add_subplot(title=name), mpc=mpc)
    figures.pdp([(name, daps)], profile.add_subplot())
    paths = figure_paths(product, out, suffix=suffix)
    return [_save(figure, path) for figure, path in zip((polar, cartesian, profile), paths, strict=True)]


def figure_paths(product: Path, out: Path, *, suffix: str = "png") -> list[Path]:
    """Files that :func:`draw_product` writes, in the order of :data:`KINDS`."""
    return [out / f"{product.stem}_{kind}.{suffix}" for kind in KINDS]


def is_up_to_date(paths: Sequence[Path], product: Path) -> bool:
    """Whether all figures exist and are newer than their product."""
    made = product.stat().st_mtime_ns
    return all(path.is_file() and path.stat().st_mtime_ns > made for path in paths)


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


def score_products(
    products: Sequence[Path],
    truth: Path,
    *,
    gates: Gates | None = None,
    dynamic_range: float = 25.0,
    least_snr: float = 10.0,
) -> tuple[Score, list[str]]:
    """Judge the MPCs of products, or of MPC tables, by the paths that were there.

    Parameters
    ----------
    products : sequence of Path
        Products of ``sounder process``; or MPC tables (.csv), for which no SNR is known.
    truth : Path
        ``truth/paths.h5`` of ``sounder simulate``, an MPC table (.csv), or another product. Positions that no product
        is of are left out.
    gates, dynamic_range, least_snr
        As for :func:`sounder.mpc.score.score`.

    Returns
    -------
    score : Score
    complaints : list of str
        One line for each file that could not be used.

    Raises
    ------
    DataError
        The truth cannot be read, or no product can.
    """
    there, complaints = read_truth(truth)
    names = there["position"].values.astype(str)
    estimates, paths, periods = [], [], set()
    for product in products:
        try:
            found, problems, root = _mpcs(product)
            # A product of nothing found is about a position all the same.
            positions = np.unique((found if root is None else root)["position"].values.astype(str)).tolist()
            if unknown := sorted(set(positions) - set(names)):
                known = ", ".join(sorted(set(names))[:3])
                raise DataError(f"{product}: {unknown[0]} is not in {truth}, which holds {known} and so on")
        except DataError as error:
            complaints.append(str(error))
            continue
        complaints += problems
        local = there.isel(path=np.flatnonzero(np.isin(names, positions)))
        if root is not None:
            sounder = Sounder.from_tables(json.loads(root.attrs["sounder"]), str(product))
            local = with_snr(local, open_group(product, "/daps"), sounder)
            periods.add(sounder.waveform.period)
        estimates.append(found)
        paths.append(local)
    if not paths:
        raise DataError("\n".join(complaints))
    if len(periods) > 1:
        raise DataError(f"{products[0]} and others are of sounders with different periods; score them apart")
    joined = xr.concat(estimates, dim="mpc", join="outer"), xr.concat(paths, dim="path", join="outer")
    judged = score(
        *joined,
        gates=gates,
        dynamic_range=dynamic_range,
        least_snr=least_snr,
        period=periods.pop() if periods else None,
    )
    return judged, complaints


def read_truth(path: Path) -> tuple[xr.Dataset, list[str]]:
    """Read true paths, along ``path`` with their ``position``; and complaints about rows that broke a rule.

    Raises
    ------
    DataError
        The file is neither the truth of ``sounder simulate`` nor a table of MPCs.
    """
    complaints: list[str] = []
    if path.suffix.lower() == ".csv":
        table, complaints = read_csv(path)
    elif "path" in (traced := open_group(path, expected=TRUTH)).dims:
        table = traced
    else:
        table, complaints = read_product(path)
    names = ["position", "delay", "azimuth", "elevation", "path_gain"]
    if missing := [name for name in names if name not in table]:
        raise DataError(f"{path}: has no {missing[0]}; expected {TRUTH}")
    table = table[names]
    return (table if "path" in table.dims else table.rename(mpc="path")), complaints


def write_score(judged: Score, out: Path, *, suffix: str = "png") -> list[Path]:
    """Write a score: ``paths.csv``, a row a true path, and figures against SNR and against separation.

    Returns
    -------
    list of Path
        Files written. Without any SNR there is no figure against it.

    Raises
    ------
    DataError
        The folder cannot be written to.
    """
    with atomic_path(out / "paths.csv") as temporary:
        judged.paths.to_dataframe().to_csv(temporary, index=False)
    written = [out / "paths.csv"]
    kinds: list[score_figures.Against] = ["snr", "separation"]
    for against in kinds:
        if not np.isfinite(judged.paths[against].values).any():
            continue
        figure = Figure(figsize=(9.6, 5.6), layout="constrained")
        first, *others = figure.subplots(2, 3).flat
        score_figures.detection(judged, first, against=against)
        for parameter, ax in zip(score_figures.ERRORS, others, strict=False):
            score_figures.errors(judged, ax, parameter=parameter, against=against)
        score_figures.normalised(judged, others[-1])
        written.append(_save(figure, out / f"against_{against}.{suffix}"))
    return written


def _mpcs(path: Path) -> tuple[xr.Dataset, list[str], xr.Dataset | None]:
    """Table and complaints of a file, and if it is a product, its root."""
    if path.suffix.lower() == ".csv":
        return *read_csv(path), None
    return *read_product(path), open_group(path)


def _daps(product: Path) -> tuple[str, xr.Dataset]:
    daps = open_group(product, "/daps")  # first, for it tells a product from other files
    return str(open_group(product)["position"].values[0]), daps


def _polar(figure: Figure) -> PolarAxes:
    axes = figure.add_subplot(projection="polar")
    return cast(PolarAxes, axes)


def _save(figure: Figure, path: Path) -> Path:
    save_figure(figure, path)
    return path
