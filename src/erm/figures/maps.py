"""Maps: what was reconstructed, sensed and known, in plan."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from erm.environment import Environment
from erm.figures.style import PALETTE, draw_points, draw_segments, fit_frame, legend_above, new_axes
from erm.geometry import FloatArray

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes


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
    legend_above(axes)
    return axes


def plot_sensed_points(
    outline: FloatArray,
    true_points: FloatArray,
    sensed: FloatArray,
    *,
    tx: FloatArray,
    rx: FloatArray,
    ax: "Axes | None" = None,
) -> "Axes":
    """Draw sensed reflection points over the true ones.

    Parameters
    ----------
    outline : array (segment, 2 ends, 2)
        Known faces [m].
    true_points, sensed : array (point, 2)
        East/north [m].
    tx, rx : array (antenna, 2)
        [m].
    """
    axes = ax or new_axes((6.4, 4.0))
    draw_segments(axes, outline, "truth", "known outline")
    open_square: dict[str, Any] = {"marker": "s", "s": 36, "facecolors": "none", "edgecolors": PALETTE["RP"]}
    axes.scatter(*sensed.T, label="sensed", zorder=4, **open_square)
    cross: dict[str, Any] = {"marker": "+", "s": 30, "color": "black", "linewidths": 0.9}
    axes.scatter(*true_points.T, label="simulated", zorder=5, **cross)
    draw_points(axes, rx, "RX", "RX")
    draw_points(axes, tx, "TX", "TX")
    fit_frame(axes, outline.reshape(-1, 2))
    legend_above(axes)
    return axes


def mark_width(axes: "Axes", start: FloatArray, stop: FloatArray, label: str) -> "Axes":
    """Mark a distance on a map: an arrow with two heads between two points (2,) [m], and its label beside it."""
    from matplotlib.patheffects import withStroke

    span: dict[str, Any] = {"arrowstyle": "<->", "color": "black", "shrinkA": 0, "shrinkB": 0, "linewidth": 1.1}
    axes.annotate("", tuple(start), tuple(stop), arrowprops=span, zorder=8)
    axes.annotate(
        label,
        tuple((np.asarray(start) + stop) / 2),
        (6, 0),
        textcoords="offset points",
        va="center",
        fontsize="small",
        path_effects=[withStroke(linewidth=2.5, foreground="white")],
        zorder=8,
    )
    return axes


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
