"""Maps in plan view: reconstructed walls, reflection points, antennas, known outline."""

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
    """Draw a map: walls, poles, antennas, reflection points and a known outline.

    Parameters
    ----------
    environment : Environment, optional
        Walls and poles.
    table : xarray.Dataset, optional
        MPC table. Its antennas are drawn; if it is a result of `erm.reconstruct`, its accepted reflection points too.
    outline : array (segment, 2 ends, 2), optional
        Known faces [m]. They do not change the limits of the axes, unless nothing else is drawn.
    names : sequence of str
        Names written beside the reflectors.
    ax : matplotlib Axes, optional
        Where to draw; default: a new figure.

    Returns
    -------
    matplotlib Axes

    Examples
    --------
    >>> import erm
    >>> from matplotlib.figure import Figure
    >>> street = erm.Environment.walls([[[-60, 10], [60, 10]], [[-60, -8], [60, -8]]])
    >>> axes = erm.plot_map(street, names=["north", "south"], ax=Figure().add_subplot())
    >>> [text.get_text() for text in axes.texts]
    ['north', 'south']
    """
    axes = ax or new_axes((7.0, 6.0))
    drawn: list[FloatArray] = []
    if environment is not None:
        reflectors = environment.reflectors
        is_wall = reflectors["kind"].values == "wall"
        walls = reflectors["end_points"].values
        draw_segments(axes, walls[is_wall], "wall", "merged wall")
        if not is_wall.all():
            x, y = walls[~is_wall, 0].T
            axes.scatter(x, y, s=30, marker="s", color=PALETTE["wall"], label="pole", zorder=4)
        drawn.append(walls.reshape(-1, 2))
    if table is not None:
        if "accepted" in table:
            points = table["reflection_point"].values[table["accepted"].values, :2]
            draw_points(axes, points, "RP", "reflection point")
            drawn.append(points)
        for name in ("RX", "TX"):
            antennas = np.unique(table[f"{name.lower()}_position"].values[:, :2], axis=0)
            draw_points(axes, antennas, name, name)
            drawn.append(antennas)
    if outline is not None:
        draw_segments(axes, outline, "truth", "known outline")
        if not any(map(len, drawn)):
            drawn.append(outline.reshape(-1, 2))
    fit_frame(axes, np.vstack(drawn) if drawn else np.zeros((0, 2)))
    if environment is not None:
        _write_names(axes, environment.reflectors["end_points"].values, names, np.vstack(drawn))
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
    """Draw measured reflection points over the true ones.

    Parameters
    ----------
    outline : array (segment, 2 ends, 2)
        Known faces [m].
    true_points, sensed : array (point, 2)
        True and measured reflection points, east/north [m].
    tx, rx : array (antenna, 2)
        Positions of the antennas [m].
    ax : matplotlib Axes, optional
        Where to draw; default: a new figure.
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
    """Mark a distance on a map by a double arrow between two points (2,) [m], with a label beside it."""
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


def _write_names(axes: "Axes", walls: FloatArray, names: Sequence[str], occupied: FloatArray) -> None:
    """Write names beside reflectors (reflector, 2, 2), where points (n, 2) leave most room."""
    from matplotlib.patheffects import withStroke

    axes.apply_aspect()
    per_metre = 72 / axes.figure.dpi * np.diff(axes.transData.transform([[0, 0], [1, 0]])[:, 0])[0]  # points
    along = np.linspace(0, 1, 21)[:, None, None]
    drawn = np.vstack([occupied, (walls[:, 0] + along * (walls[:, 1] - walls[:, 0])).reshape(-1, 2)]) * per_metre
    for ends, name in zip(walls, names, strict=False):
        place, shift = _free_place(ends * per_metre, drawn, len(name))
        drawn = np.vstack([drawn, place + shift])
        axes.annotate(
            name,
            tuple(place / per_metre),
            tuple(shift),
            textcoords="offset points",
            ha="center",
            va="center",
            fontsize="small",
            color=PALETTE["wall"],
            path_effects=[withStroke(linewidth=2.5, foreground="white")],
            zorder=7,
        )


def _free_place(ends: FloatArray, drawn: FloatArray, letters: int) -> tuple[FloatArray, FloatArray]:
    """Point on a reflector (2 ends, 2) and shift of a name from it where points (n, 2) leave most room."""
    box = np.array([3.2 * letters, 4.5])  # half of the name's width and height, points
    angle = np.radians(np.arange(0, 360, 30))
    shift = (box + 5.0) * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    place = ends[0] + np.array([0.5, 0.35, 0.65, 0.1, 0.9])[:, None] * (ends[1] - ends[0])
    distance = np.abs(place[:, None, None] + shift[None, :, None] - drawn) - box
    room = np.linalg.norm(np.maximum(distance, 0), axis=-1).min(axis=-1)
    best = np.unravel_index(np.argmax(np.round(np.minimum(room, 9.0), 6)), room.shape)
    return place[best[0]], shift[best[1]]
