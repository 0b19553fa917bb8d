"""Figures of products: DAPS in polar form, DAPS over delay and azimuth with the MPCs, and PDP.

Every function draws into the axes that it is given, in place of what it drew there before, and returns them.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import Colormap, ListedColormap
from matplotlib.patheffects import withStroke
from matplotlib.projections.polar import PolarAxes
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from sounder.figures.again import clear, colour_bar
from sounder.parameters.selection import extraction_margin

MPC_COLOUR = "#d55e00"
POWER_MAP = "viridis"
"""Colour map of power: perceptually uniform, and readable with colour-blindness."""
OVERLAY_MAPS = ("Blues", "Oranges")
"""Colour maps of two positions in one figure: the hue is the position, the lightness is the power."""
RINGS = 100
"""Rings of delay in a polar diagram, each with the power of its strongest sample. With a ring for each sample, paths
would be too thin to see. Chosen; not derived."""
LEGEND_ABOVE: dict[str, Any] = {
    "loc": "lower right",
    "bbox_to_anchor": (1.0, 1.0),
    "frameon": False,
    "borderaxespad": 0.1,
}
"""Legend above the axes, where it hides nothing."""
DYNAMIC_RANGE = 40.0
"""Range of power that is shown, below the strongest [dB]. Chosen; not derived."""
VISIBLE_SNR = 12.0
"""Power over the noise floor from which something is shown [dB]: the threshold of MPCs by USC."""

PDP_MARGIN = 5.0
"""How far under the noise floor the axis of a PDP begins [dB]. Chosen; not derived."""


def strongest_elevation(daps: xr.Dataset) -> xr.DataArray:
    """DAPS with the strongest elevation at each azimuth and delay [dB]; NaN where all are missing."""
    return daps["daps"].max("elevation", keep_attrs=True)


def elevations_shown(daps: xr.Dataset) -> str:
    """How elevations are combined, in words: ``strongest of elevations -9, 0, 9°``."""
    angles = [f"{angle:g}" for angle in np.atleast_1d(daps["elevation"].values)]
    return f"elevation {angles[0]}°" if len(angles) == 1 else f"strongest of elevations {', '.join(angles)}°"


def last_visible_delay(daps: xr.Dataset) -> float:
    """Largest delay at which the power exceeds the noise floor by :data:`VISIBLE_SNR`, and a tenth more [s]."""
    above = (daps["daps"] > daps["noise_floor"] + VISIBLE_SNR).any(("azimuth", "elevation"))
    delay = daps["delay"].values
    last = delay[above.values][-1] if above.any() else delay[-1]
    return float(min(1.1 * last, delay[-1]))


def daps_cartesian(
    daps: xr.Dataset, ax: Axes, *, mpc: xr.Dataset | None = None, elevation: float | None = None
) -> Axes:
    """Draw a DAPS over delay and azimuth. The scale says which elevations it shows.

    Parameters
    ----------
    daps : xarray.Dataset
        Group ``/daps`` of a product.
    ax : matplotlib.axes.Axes
    mpc : xarray.Dataset, optional
        Group ``/mpc``, drawn as circles with their standard deviations of azimuth.
    elevation : float, optional
        One elevation of the scan [degree], on the scale of all. Default: the strongest elevation of each azimuth and
        delay.
    """
    bars = clear(ax)
    end = last_visible_delay(daps)
    shown_delays = daps["daps"].isel(delay=slice(int(np.searchsorted(daps["delay"].values, end)) + 1))
    power = shown_delays.max("elevation") if elevation is None else shown_delays.sel(elevation=elevation)
    top = float(daps["daps"].max())
    azimuth = power["azimuth"].values
    image = ax.pcolorfast(
        _edges(power["delay"].values * 1e9),
        _edges(azimuth),
        power.values,
        cmap=POWER_MAP,
        vmin=max(top - DYNAMIC_RANGE, float(daps["noise_floor"].median())),
        vmax=top,
    )
    shown = elevations_shown(daps) if elevation is None else f"elevation {elevation:g}°"
    colour_bar(image, ax, bars, label=f"Path gain incl. RX antenna (dB)\n{shown}", pad=0.02)
    if mpc is not None and mpc.sizes["mpc"]:
        half = _half_step(azimuth)
        # 358 degrees belongs to the row of 0, which extends from -5 to 5
        wrapped = (mpc["azimuth"].values - azimuth[0] + half) % 360 + azimuth[0] - half
        ax.errorbar(
            mpc["delay"].values * 1e9,
            wrapped,
            yerr=np.minimum(np.nan_to_num(mpc["azimuth_std"].values), half),
            fmt="o",
            markersize=5,
            markerfacecolor="none",
            markeredgecolor=MPC_COLOUR,
            markeredgewidth=1.2,
            ecolor=MPC_COLOUR,
            elinewidth=1,
            label=f"MPCs ({mpc.sizes['mpc']})",
        )
        ax.legend(**LEGEND_ABOVE)
    ax.set(xlabel="Delay (ns)", ylabel="Azimuth of arrival (°)", xlim=(0, end * 1e9))
    ax.set_yticks(np.arange(0, 361, 60))
    ax.set_ylim(azimuth[0] - _half_step(azimuth), azimuth[-1] + _half_step(azimuth))
    return ax


def daps_polar(products: Sequence[tuple[str, xr.Dataset]], ax: PolarAxes) -> PolarAxes:
    """Draw one DAPS, or two in one polar diagram: the radius is delay, the angle is azimuth, the colour is power.

    Parameters
    ----------
    products : sequence of (name, dataset)
        Name and group ``/daps`` of one or two positions. Power of less than :data:`VISIBLE_SNR` above the noise floor,
        or more than :data:`DYNAMIC_RANGE` below the strongest, is left blank.
    ax : matplotlib.projections.polar.PolarAxes

    Raises
    ------
    ValueError
        There are more than two positions, or none.
    """
    if not 1 <= len(products) <= 2:
        raise ValueError(f"{len(products)} positions; expected one or two in a polar diagram")
    bars = clear(ax)
    maps = [colormaps[POWER_MAP]] if len(products) == 1 else [_without_pale_third(name) for name in OVERLAY_MAPS]
    outer = max(last_visible_delay(daps) for _, daps in products)
    sectors_drawn = np.zeros(360)
    for index, ((name, daps), colours) in enumerate(zip(products, maps, strict=True)):
        above = daps["daps"].where(daps["daps"] > daps["noise_floor"] + VISIBLE_SNR).max("elevation")
        rings = max(int(outer / RINGS / float(daps["delay"][1] - daps["delay"][0])), 1)
        power = above.where(above > above.max() - DYNAMIC_RANGE).coarsen(delay=rings, boundary="trim").max()
        corners, values = _sectors(power)
        drawn = PolyCollection(list(corners * (1, 1e9)), array=values, cmap=colours, alpha=(1.0, 0.8)[index])
        ax.add_collection(drawn)
        np.add.at(sectors_drawn, np.degrees(corners[..., 0]).astype(int) % 360, 1)
        if not values.size:
            drawn.set_clim(0, 1)  # of a bar that is not shown
        bar = colour_bar(
            drawn,
            ax,
            bars,
            label=f"{name}: path gain incl. RX antenna (dB)\n{elevations_shown(daps)}",
            location=("right", "left")[index],
            pad=0.12,
            shrink=0.8,
        )
        bar.ax.set_visible(values.size > 0)
    ax.set_rlim(0, outer * 1e9)
    ax.set_thetagrids(np.arange(0, 360, 30))
    ax.set_rlabel_position(_emptiest_gap(sectors_drawn))
    ax.yaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
    ax.tick_params(axis="x", pad=5)
    for label in ax.yaxis.get_ticklabels():
        label.set(fontsize="small", path_effects=[withStroke(linewidth=2.5, foreground="white")])
    ax.set_xlabel("Angle: azimuth of arrival; radius: delay (ns)")
    ax.grid(alpha=0.4)
    return ax


def pdp(products: Sequence[tuple[str, xr.Dataset]], ax: Axes, *, mpc: xr.Dataset | None = None) -> Axes:
    """Draw omnidirectional power delay profiles.

    The axis says how they were made. It begins :data:`PDP_MARGIN` under the lowest noise floor of the beams, without
    the boresight gain: a synthesis from MPCs has no noise of its own.

    Parameters
    ----------
    products : sequence of (name, dataset)
        Name and group ``/daps``.
    ax : matplotlib.axes.Axes
    mpc : xarray.Dataset, optional
        Group ``/mpc`` of the first product: drawn as circles with their standard deviations, with the least power by
        which MPCs were found in a beam of median noise.
    """
    clear(ax)
    for name, daps in products:
        ax.plot(daps["delay"].values * 1e9, daps["pdp"].values, linewidth=0.9, label=name)
    made = {str(daps["pdp"].attrs.get("long_name", "")).rpartition(": ")[2] for _, daps in products}
    ax.set(xlabel="Delay (ns)", ylabel="\n".join(["Path gain (dB)", *sorted(made - {""})]))
    ax.set_xlim(0, max(last_visible_delay(daps) for _, daps in products) * 1e9)
    floor = min(float(daps["noise_floor"].min()) - daps.attrs.get("rx_antenna_gain", 0.0) for _, daps in products)
    if np.isfinite(floor):
        ax.set_ylim(bottom=floor - PDP_MARGIN)
    if mpc is not None:
        _mark_mpcs(products[0][1], mpc, ax)
    ax.grid(alpha=0.3)
    ax.legend(**LEGEND_ABOVE, ncols=4)
    return ax


def _mark_mpcs(daps: xr.Dataset, mpc: xr.Dataset, ax: Axes) -> None:
    """Draw MPCs over their PDP, the median noise floor of the beams and the threshold over it."""
    floor = float(daps["noise_floor"].median()) - daps.attrs.get("rx_antenna_gain", 0.0)
    for level, label, style in ((floor + extraction_margin(mpc), "threshold", "--"), (floor, "noise floor", ":")):
        if np.isfinite(level):
            ax.axhline(level, color="0.35", linestyle=style, linewidth=0.9, label=label)
    if mpc.sizes["mpc"]:
        ax.errorbar(
            mpc["delay"].values * 1e9,
            mpc["path_gain"].values,
            yerr=np.nan_to_num(mpc["path_gain_std"].values),
            fmt="o",
            markersize=5,
            markerfacecolor="none",
            color=MPC_COLOUR,
            elinewidth=0.8,
            label="MPC",
        )


def _half_step(values: NDArray[np.float64]) -> float:
    return float(np.diff(values).min() / 2) if values.size > 1 else 180.0


def _edges(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Where the cells of values end: halfway to their neighbours, and as far on the other side of the outermost."""
    half = np.diff(values) / 2 if values.size > 1 else np.array([_half_step(values)])
    return np.concatenate([values[:1] - half[0], values[: half.size] + half, values[half.size :] + half[-1]])


def _without_pale_third(name: str) -> Colormap:
    """Colour map without its palest third, which cannot be seen on white."""
    return ListedColormap(colormaps[name](np.linspace(0.35, 1, 256)))


def _emptiest_gap(sectors_drawn: NDArray[np.float64]) -> float:
    """Azimuth between two grid lines where least is drawn [degree], from the number of sectors in each degree."""
    between = np.arange(15, 360, 30)
    around = between[:, None] + np.arange(-8, 9)
    return float(between[np.argmin(sectors_drawn[around].sum(axis=1))])


def _sectors(power: xr.DataArray) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Corners (sector, corner, 2) [rad, s] and power (sector,) [dB] of all sectors of azimuth and delay with a power.

    Arcs are polygons with an edge for each degree.
    """
    azimuth, delay = power["azimuth"].values, power["delay"].values
    looks, bins = np.nonzero(np.isfinite(power.values))
    half = min(_half_step(azimuth), 180.0)
    arc = np.radians(azimuth[looks, None] + np.linspace(-half, half, max(int(2 * half), 1) + 1))
    step = (delay[1] - delay[0]) * np.array([-0.5, 0.5])
    inner, outer = (delay[bins, None] + step).clip(0).T
    angle = np.hstack([arc, arc[:, ::-1]])
    radius = np.repeat(np.stack([outer, inner], axis=1), arc.shape[1], axis=1)
    return np.stack([angle, radius], axis=-1), power.values[looks, bins]
