"""Maps and error curves. Functions take products and return the axes; saving is the caller's business."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from erm.environment import Environment
from erm.geometry import FloatArray

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

# Okabe and Ito's colours, told apart by all; one thing keeps its colour in every figure
PALETTE = {"TX": "#d55e00", "RX": "#0072b2", "RP": "#e69f00", "wall": "#009e73", "truth": "#8c8c8c"}
LINES: dict[str, dict[str, Any]] = {"wall": {"linewidth": 2.6, "zorder": 3}, "truth": {"linewidth": 1.0, "zorder": 1}}
MARKERS: dict[str, dict[str, Any]] = {
    "TX": {"marker": "*", "s": 170, "zorder": 6, "edgecolors": "black", "linewidths": 0.6},
    "RX": {"marker": "h", "s": 34, "zorder": 5, "edgecolors": "white", "linewidths": 0.5},
    "RP": {"marker": "x", "s": 26, "zorder": 4, "linewidths": 1.2},
}
CURVES = ("#000000", "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00")
WIDE = 30.0  # times; medians further apart than this need a logarithmic axis
MARGIN = 0.08  # share of the map's larger side left free around it


def plot_map(
    environment: Environment | None = None,
    *,
    table: "xr.Dataset | None" = None,
    outline: FloatArray | None = None,
    names: Sequence[str] = (),
    ax: "Axes | None" = None,
) -> "Axes":
    """Draw a map: antennas, reflection points, merged walls, known outline.

    Parameters
    ----------
    environment : Environment, optional
        Merged walls and poles.
    table : xarray.Dataset, optional
        MPC table; its antennas are drawn and, after `erm.reconstruct`, its accepted reflection points.
    outline : array (segment, 2 ends, 2), optional
        Known faces [m]; drawn where the rest of the map is.
    names : sequence of str
        Written beside the reflectors, one each.
    ax : matplotlib Axes, optional
        Where to draw; a new figure by default.
    """
    axes = ax or new_axes((7.0, 6.0))
    seen: list[FloatArray] = []
    if environment is not None:
        reflectors = environment.reflectors
        is_wall = reflectors["kind"].values == "wall"
        walls = reflectors["end_points"].values
        draw_segments(axes, walls[is_wall], "wall", "merged wall")
        if not is_wall.all():
            x, y = walls[~is_wall, 0].T
            axes.scatter(x, y, s=30, marker="s", color=PALETTE["wall"], label="pole", zorder=4)
        _name(axes, walls, names)
        seen.append(walls.reshape(-1, 2))
    if table is not None:
        if "accepted" in table:
            points = table["reflection_point"].values[table["accepted"].values, :2]
            draw_points(axes, points, "RP", "reflection point")
            seen.append(points)
        for name in ("RX", "TX"):
            antennas = np.unique(table[f"{name.lower()}_position"].values[:, :2], axis=0)
            draw_points(axes, antennas, name, name)
            seen.append(antennas)
    if outline is not None:
        draw_segments(axes, outline, "truth", "known outline")
        if not any(map(len, seen)):
            seen.append(outline.reshape(-1, 2))
    fit_frame(axes, np.vstack(seen) if seen else np.zeros((0, 2)))
    axes.set_xlabel("East (m)")
    axes.set_ylabel("North (m)")
    _legend_beside(axes)
    return axes


def plot_error_cdf(errors: Mapping[str, npt.ArrayLike], *, ax: "Axes | None" = None) -> "Axes":
    """Draw the empirical distribution of errors, one curve an entry.

    Parameters
    ----------
    errors : mapping of str to array (point,)
        Errors [m] by label.
    """
    axes = ax or new_axes((5.2, 3.8))
    for (label, values), colour in zip(errors.items(), CURVES, strict=False):
        ordered = np.sort(np.asarray(values, dtype=float))
        steps = np.r_[ordered[:1], ordered]
        rmse = np.sqrt(np.mean(ordered**2)) if len(ordered) else np.nan
        axes.step(
            steps,
            np.arange(len(steps)) / max(len(ordered), 1),
            where="post",
            color=colour,
            label=f"{label} (n = {len(ordered)}, RMSE {rmse:.2g} m)",
        )
    axes.set_xlabel("Error (m)")
    axes.set_ylabel("Share of reflection points")
    axes.set_ylim(0, 1.02)
    typical = [float(np.median(np.asarray(values))) for values in errors.values() if np.size(values)]
    if typical and max(typical) > WIDE * min(typical) > 0:  # side by side only a logarithm shows both
        axes.set_xscale("log")
    else:
        axes.set_xlim(left=0)
    axes.grid(alpha=0.3)
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), frameon=False, fontsize="small")
    return axes


def new_axes(size: tuple[float, float]) -> "Axes":
    """Axes in a figure of their own, of a size [inch]."""
    import matplotlib.pyplot as plt

    return plt.subplots(figsize=size, layout="constrained")[1]


def draw_segments(axes: "Axes", segments: FloatArray, thing: str, label: str) -> None:
    """Draw segments (segment, 2, 2) as one collection."""
    from matplotlib.collections import LineCollection

    if len(segments):
        lines = LineCollection(list(segments), colors=PALETTE[thing], label=label, **LINES[thing])
        axes.add_collection(lines)


def _name(axes: "Axes", walls: FloatArray, names: Sequence[str]) -> None:
    """Write names beside the middles of reflectors (reflector, 2, 2), each on the right of its wall."""
    from matplotlib.patheffects import withStroke

    for ends, name in zip(walls, names, strict=False):
        along = ends[1] - ends[0]
        size = max(float(np.hypot(*along)), 1e-9)
        aside = 8 * np.array([along[1], -along[0]]) / size if size > 1e-6 else np.array([-8.0, 6.0])
        axes.annotate(
            name,
            tuple(ends.mean(axis=0)),
            tuple(aside),
            textcoords="offset points",
            ha="center",
            va="center",
            fontsize="small",
            color=PALETTE["wall"],
            path_effects=[withStroke(linewidth=2.5, foreground="white")],
            zorder=7,
        )


def draw_points(axes: "Axes", points: FloatArray, thing: str, label: str) -> None:
    """Draw points (point, 2) in the colour and shape of the thing."""
    if len(points):
        axes.scatter(*points.T, color=PALETTE[thing], label=label, **MARKERS[thing])


def fit_frame(axes: "Axes", points: FloatArray) -> None:
    """Fit the view to points (point, 2), metres of equal length both ways."""
    axes.set_aspect("equal")
    if len(points):
        low, high = points.min(axis=0), points.max(axis=0)
        margin = MARGIN * max(np.max(high - low), 1.0)
        axes.set_xlim(low[0] - margin, high[0] + margin)
        axes.set_ylim(low[1] - margin, high[1] + margin)


def _legend_beside(axes: "Axes") -> None:
    """Put the legend above the map, where it hides nothing."""
    handles, labels = axes.get_legend_handles_labels()
    if handles:
        axes.legend(
            handles,
            labels,
            loc="lower center",
            bbox_to_anchor=(0.5, 1.0),
            ncols=len(labels),
            frameon=False,
            fontsize="small",
        )
