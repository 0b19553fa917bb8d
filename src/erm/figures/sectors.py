"""Azimuth sectors over a DAPS: the reflectors that the MPCs of each sector came from."""

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from matplotlib.patheffects import withStroke

from erm.evaluation.explain import DIRECT, UNEXPLAINED, Sector, count_reflectors

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.projections.polar import PolarAxes

LINE_OF_SIGHT = "#000000"
"""Colour of the direct path."""
SECTORS = ("#228833", "#aa3377", "#ccbb44", "#44aa99", "#ee99aa", "#777777", "#6a3d9a", "#999933")
"""Colours of reflectors: Tol's bright and muted ones without blue and orange, which a DAPS of two positions has."""
RIM_WIDTH = 0.09
"""Width of the coloured rim, relative to the radius; chosen."""
MARKS: dict[str, dict[str, Any]] = {
    "at most one reflection": {"marker": "o", "s": 26, "facecolors": "white", "edgecolors": "black", "linewidths": 1.1},
    "several reflections": {"marker": "D", "s": 20, "facecolors": "white", "edgecolors": "black", "linewidths": 1.1},
    "not explained": {"marker": "x", "s": 26, "color": "black", "linewidths": 1.4},
}


def plot_sectors(
    sectors: Sequence[Sector],
    axes: "PolarAxes",
    *,
    table: "xr.Dataset | None" = None,
    labels: "Sequence[str] | npt.NDArray[np.str_]" = (),
) -> "PolarAxes":
    """Draw sectors over a polar DAPS, and mark its MPCs. The legend is below.

    Parameters
    ----------
    sectors : sequence of Sector
        Results of `erm.evaluation.explain.azimuth_sectors`.
    axes : matplotlib.projections.polar.PolarAxes
        Axes with the delay in nanoseconds as radius, whose limit is set. The figure should have a constrained layout.
    table : xarray.Dataset, optional
        MPCs of the DAPS; each is marked by its number of reflections.
    labels : sequence of str
        Labels of `erm.explain`, one for each MPC.
    """
    outer = axes.get_rmax()
    rings = [radius for radius in axes.get_yticks() if radius < 0.95 * outer]
    axes.set_rmax((1 + RIM_WIDTH) * outer)
    axes.set_yticks(rings)
    reflectors = [name for name in dict.fromkeys(sector.name for sector in sectors) if name != DIRECT]
    components = Counter[str]()  # a reflector with two sectors has one entry in the legend
    for sector in sectors:
        components[sector.name] += sector.components
    colours = {DIRECT: LINE_OF_SIGHT} | {name: SECTORS[i % len(SECTORS)] for i, name in enumerate(reflectors)}
    for sector in sectors:
        start, stop = np.radians([sector.start, sector.stop])
        where: dict[str, Any] = {"x": (start + stop) / 2, "width": stop - start, "color": colours[sector.name]}
        axes.bar(height=outer, alpha=0.15, zorder=0.5, **where)
        axes.bar(height=RIM_WIDTH * outer, bottom=outer, label=f"{sector.name} ({components[sector.name]})", **where)
        if sector.name != DIRECT:
            _on_rim(axes, sector.name, np.radians(_own_middle(sector, sectors)), (1 + RIM_WIDTH / 2) * outer)
    if table is not None:
        _mark(axes, table, np.asarray(labels))
    handles, texts = axes.get_legend_handles_labels()
    first = [texts.index(text) for text in dict.fromkeys(texts)]
    figure = axes.get_figure(root=True)
    if figure is not None and first:  # a legend beside the axes would make them small
        shown = [handles[i] for i in first], [texts[i] for i in first]
        figure.legend(*shown, loc="outside lower center", ncols=6, frameon=False, fontsize="small")
    return axes


def _own_middle(sector: Sector, sectors: Sequence[Sector]) -> float:
    """Middle of the widest part of a sector without other sectors, or of the whole sector [degree]."""
    azimuth = np.arange(sector.start, sector.stop + 0.5)
    shared = np.zeros(len(azimuth), dtype=bool)
    for other in sectors:
        if other is not sector:
            shared |= (azimuth - other.start) % 360 <= other.stop - other.start
    runs = np.split(np.flatnonzero(~shared), np.flatnonzero(np.diff(np.flatnonzero(~shared)) > 1) + 1)
    widest = max(runs, key=len)
    return float(azimuth[widest].mean()) if len(widest) else (sector.start + sector.stop) / 2


def _on_rim(axes: "PolarAxes", name: str, angle: float, radius: float) -> None:
    """Write a name along the rim, never upside down."""
    rotation = np.degrees(angle) % 180 - 90
    axes.text(
        angle,
        radius,
        name,
        rotation=rotation,
        ha="center",
        va="center",
        fontsize="x-small",
        color="white",
        path_effects=[withStroke(linewidth=1.5, foreground="black")],
    )


def _mark(axes: "PolarAxes", table: "xr.Dataset", labels: npt.NDArray[np.str_]) -> None:
    bounces = np.array([count_reflectors(label) for label in labels], dtype=int)
    kinds = np.where(labels == UNEXPLAINED, 2, np.where(bounces > 1, 1, 0))
    for kind, (label, style) in enumerate(MARKS.items()):
        chosen = kinds == kind
        if chosen.any():
            angle, radius = np.radians(table["azimuth"].values[chosen]), table["delay"].values[chosen] * 1e9
            axes.scatter(angle, radius, label=f"{label} ({np.count_nonzero(chosen)})", zorder=6, **style)
