"""Errors of reflection points to a face: in plan, and by one coordinate where the other is not known."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from erm.figures.style import PALETTE, draw_points, fit_frame, legend_above, new_axes
from erm.geometry.vertical import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ERROR = "#000000"


def plot_face_errors(
    points: FloatArray, face: FloatArray, *, tx: FloatArray | None = None, ax: "Axes | None" = None
) -> "Axes":
    """Draw reflection points and their perpendicular errors from the line of a face.

    Parameters
    ----------
    points : array (point, 2)
        East/north [m].
    face : array (2 ends, 2)
        Known ends of the face [m]. Beyond them its line is dashed.
    tx : array (antenna, 2), optional
        [m].
    """
    from matplotlib.collections import LineCollection

    axes = ax or new_axes((4.6, 5.0))
    along = face[1] - face[0]
    reach = (points - face[0]) @ along / (along @ along)
    feet = face[0] + reach[:, None] * along
    ends = np.array([min(0.0, reach.min(initial=0.0)), max(1.0, reach.max(initial=1.0))])
    line = face[0] + ends[:, None] * along
    axes.plot(*line.T, color=PALETTE["truth"], linestyle="--", linewidth=1.0)
    axes.plot(*face.T, color=PALETTE["truth"], linewidth=2.0, label="face")
    axes.add_collection(LineCollection(list(np.stack([points, feet], axis=1)), colors=ERROR, linewidths=0.8))
    draw_points(axes, points, "RP", f"RP ({len(points)})")
    seen = [points, line]
    if tx is not None:
        draw_points(axes, tx, "TX", "TX")
        seen.append(tx)
    fit_frame(axes, np.vstack(seen))
    legend_above(axes)
    return axes


def plot_ordinates(
    values: npt.ArrayLike, faces: npt.ArrayLike, known: Mapping[str, float], *, ax: "Axes | None" = None
) -> "Axes":
    """Draw reflection points of which only the northing is known, and their errors from their faces.

    Parameters
    ----------
    values, faces : array (point,)
        Northing of each point and of its face [m].
    known : mapping of str to float
        Northings of all faces by name [m].
    """
    axes = ax or new_axes((4.6, 4.0))
    values, faces = np.asarray(values, dtype=float), np.asarray(faces, dtype=float)
    number = np.arange(1, len(values) + 1)
    for name, north in known.items():
        axes.axhline(north, color=PALETTE["truth"], linewidth=2.0, zorder=1)
        axes.annotate(name, (0.6, north), (0, 3), textcoords="offset points", fontsize="small")
    axes.vlines(number, values, faces, color=ERROR, linewidth=0.8, zorder=3)
    draw_points(axes, np.column_stack([number, values]), "RP", f"RP ({len(values)})")
    axes.set(xlabel="Number of the reflection point", ylabel="North (m)", xlim=(0.5, len(values) + 0.5))
    axes.margins(y=0.12)
    legend_above(axes)
    return axes
