"""Maps: what was reconstructed, sensed and known, in plan."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from erm.figures.style import PALETTE, draw_points, draw_segments, fit_frame, legend_above, new_axes
from erm.geometry.vertical import FloatArray
from erm.maps.environment import Environment

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
        MPC table; its antennas are drawn and, after `erm.reconstruction.reconstruct`, its accepted reflection points.
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
    if environment is not None:
        _name(axes, environment.reflectors["end_points"].values, names, np.vstack(seen))
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


def _name(axes: "Axes", walls: FloatArray, names: Sequence[str], taken: FloatArray) -> None:
    """Write names beside reflectors (reflector, 2, 2), each furthest from all that is drawn (n, 2)."""
    from matplotlib.patheffects import withStroke

    axes.apply_aspect()
    per_metre = 72 / axes.figure.dpi * np.diff(axes.transData.transform([[0, 0], [1, 0]])[:, 0])[0]  # points
    along = np.linspace(0, 1, 21)[:, None, None]
    drawn = np.vstack([taken, (walls[:, 0] + along * (walls[:, 1] - walls[:, 0])).reshape(-1, 2)]) * per_metre
    for ends, name in zip(walls, names, strict=False):
        place, aside = _beside(ends * per_metre, drawn, len(name))
        drawn = np.vstack([drawn, place + aside])
        axes.annotate(
            name,
            tuple(place / per_metre),
            tuple(aside),
            textcoords="offset points",
            ha="center",
            va="center",
            fontsize="small",
            color=PALETTE["wall"],
            path_effects=[withStroke(linewidth=2.5, foreground="white")],
            zorder=7,
        )


def _beside(ends: FloatArray, drawn: FloatArray, letters: int) -> tuple[FloatArray, FloatArray]:
    """Where along a reflector (2 ends, 2), and how far aside, a name has most room beside what is drawn (n, 2)."""
    box = np.array([3.2 * letters, 4.5])  # half of the name's width and height, points
    angle = np.radians(np.arange(0, 360, 30))
    aside = (box + 5.0) * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    place = ends[0] + np.array([0.5, 0.35, 0.65, 0.1, 0.9])[:, None] * (ends[1] - ends[0])
    away = np.abs(place[:, None, None] + aside[None, :, None] - drawn) - box
    room = np.linalg.norm(np.maximum(away, 0), axis=-1).min(axis=-1)
    best = np.unravel_index(np.argmax(np.round(np.minimum(room, 9.0), 6)), room.shape)
    return place[best[0]], aside[best[1]]
