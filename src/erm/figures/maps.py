"""Maps in plan view: reconstructed walls, reflection points, antennas, known outline."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from erm.figures.map_marks import MAX_NAMED, along_segments, antenna_pairs, draw_pairs, draw_scale, write_names
from erm.figures.style import PALETTE, draw_points, draw_segments, fit_frame, legend_above, new_axes
from erm.geometry.vertical import FloatArray
from erm.maps.environment import Environment
from erm.maps.outline import outline_of

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes


def plot_map(
    environment: Environment | None = None,
    *,
    table: "xr.Dataset | None" = None,
    outline: FloatArray | None = None,
    names: Sequence[str] = (),
    annotated: bool = False,
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
    annotated : bool
        Also draw a scale bar, an arrow to the north, and of a table the names of its positions, up to
        :data:`erm.figures.map_marks.MAX_NAMED`, and a line from each RX to its TX.
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
        is_pole = reflectors["kind"].values == "pole"
        walls = reflectors["end_points"].values
        draw_segments(axes, outline_of(environment), "wall", "merged wall")
        if is_pole.any():
            x, y = walls[is_pole, 0].T
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
    if drawn:
        occupied = np.vstack(drawn)
        if environment is not None:
            faces = environment.reflectors["end_points"].values
            occupied = np.vstack([occupied, along_segments(faces)])
            occupied = write_names(axes, faces, names, occupied, PALETTE["wall"])
        if annotated:
            _annotate(axes, environment, table, occupied)
    legend_above(axes)
    return axes


def _annotate(axes: "Axes", environment: Environment | None, table: "xr.Dataset | None", occupied: FloatArray) -> None:
    """Names of positions, which RX belongs to which TX, scale and north."""
    if table is not None and table.sizes["mpc"]:
        names, tx, rx = antenna_pairs(table)
        draw_pairs(axes, tx, rx)
        if len(names) <= MAX_NAMED:
            write_names(axes, np.stack([rx, rx], axis=1), names, occupied, PALETTE["RX"])
    place = None if environment is None else environment.georeference
    draw_scale(axes, 0.0 if place is None else place.heading)


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
