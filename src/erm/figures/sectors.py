"""Sectors over a DAPS: from which reflector the components of each range of azimuths came."""

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
# none of the hues blue and orange, which a DAPS of two positions has: Tol's bright and muted ones without them
SECTORS = ("#228833", "#aa3377", "#ccbb44", "#44aa99", "#ee99aa", "#777777", "#6a3d9a", "#999933")

RIM = 0.09  # share of the radius that the sectors' coloured rim takes
MARKS: dict[str, dict[str, Any]] = {
    "one bounce, or none": {"marker": "o", "s": 26, "facecolors": "white", "edgecolors": "black", "linewidths": 1.1},
    "several bounces": {"marker": "D", "s": 20, "facecolors": "white", "edgecolors": "black", "linewidths": 1.1},
    "not explained": {"marker": "x", "s": 26, "color": "black", "linewidths": 1.4},
}


def plot_sectors(
    sectors: Sequence[Sector],
    axes: "PolarAxes",
    *,
    table: "xr.Dataset | None" = None,
    labels: "Sequence[str] | npt.NDArray[np.str_]" = (),
) -> "PolarAxes":
    """Lay sectors over a DAPS in polar form, and mark its components; the legend stands below.

    Parameters
    ----------
    sectors : sequence of Sector
        From `erm.evaluation.explain.sectors`.
    axes : matplotlib.projections.polar.PolarAxes
        With delay in nanoseconds as radius, of which the limit is set already; its figure should have a constrained
        layout.
    table : xarray.Dataset, optional
        MPC table of what the DAPS shows; every component is marked by how many bounces explain it.
    labels : sequence of str
        From `erm.evaluation.explain.explain`, one a component.
    """
    outer = axes.get_rmax()
    rings = [radius for radius in axes.get_yticks() if radius < 0.95 * outer]
    axes.set_rmax((1 + RIM) * outer)
    axes.set_yticks(rings)
    reflectors = [name for name in dict.fromkeys(sector.name for sector in sectors) if name != DIRECT]
    components = Counter[str]()  # a reflector seen under two azimuths has two sectors and one entry
    for sector in sectors:
        components[sector.name] += sector.components
    colours = {DIRECT: LINE_OF_SIGHT} | {name: SECTORS[i % len(SECTORS)] for i, name in enumerate(reflectors)}
    for sector in sectors:
        start, stop = np.radians([sector.start, sector.stop])
        where: dict[str, Any] = {"x": (start + stop) / 2, "width": stop - start, "color": colours[sector.name]}
        axes.bar(height=outer, alpha=0.15, zorder=0.5, **where)
        axes.bar(height=RIM * outer, bottom=outer, label=f"{sector.name} ({components[sector.name]})", **where)
        if sector.name != DIRECT:
            _on_rim(axes, sector.name, np.radians(_own_middle(sector, sectors)), (1 + RIM / 2) * outer)
    if table is not None:
        _mark(axes, table, np.asarray(labels))
    handles, texts = axes.get_legend_handles_labels()
    first = [texts.index(text) for text in dict.fromkeys(texts)]
    figure = axes.get_figure(root=True)
    if figure is not None and first:  # beside the axes the legend would squeeze them
        shown = [handles[i] for i in first], [texts[i] for i in first]
        figure.legend(*shown, loc="outside lower center", ncols=6, frameon=False, fontsize="small")
    return axes


def _own_middle(sector: Sector, sectors: Sequence[Sector]) -> float:
    """Middle of the widest part of a sector that it shares with no other; of all of it where there is none [degree]."""
    azimuth = np.arange(sector.start, sector.stop + 0.5)
    others = [one for one in sectors if one is not sector]
    shared = np.zeros(len(azimuth), dtype=bool)
    for one in others:
        shared |= (azimuth - one.start) % 360 <= one.stop - one.start
    runs = np.split(np.flatnonzero(~shared), np.flatnonzero(np.diff(np.flatnonzero(~shared)) > 1) + 1)
    widest = max(runs, key=len)
    return float(azimuth[widest].mean()) if len(widest) else (sector.start + sector.stop) / 2


def _on_rim(axes: "PolarAxes", name: str, angle: float, radius: float) -> None:
    """Write a name on the rim, along it and never upside down."""
    turned = np.degrees(angle) % 180 - 90
    axes.text(
        angle,
        radius,
        name,
        rotation=turned,
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
