"""Arcs seen from above: curved faces as lines of points, and lines of points as arcs."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from erm.common.errors import DataError
from erm.geometry.vertical import FloatArray, azimuth_of, unit

SAGITTA = 0.01
"""Largest distance between an arc and the chords that draw it [m]; the format of maps promises it."""


def arc_points(ends: npt.ArrayLike, centre: npt.ArrayLike, radius: float) -> FloatArray:
    """Points (point, 2) along an arc, counter-clockwise about its centre from the first to the second end [m].

    A chord over the angle ``d`` is ``r (1 - cos(d / 2))`` off its arc.

    Parameters
    ----------
    ends : array (2, 2)
        Both ends on the circle [m].
    centre : array (2,)
        [m].
    radius : float
        Of either sign [m].

    Examples
    --------
    >>> arc_points([[1.0, 0.0], [0.0, 1.0]], [0.0, 0.0], 1.0).round(2).tolist()[:2]
    [[1.0, 0.0], [0.97, 0.26]]
    """
    ends, centre = np.asarray(ends, dtype=float), np.asarray(centre, dtype=float)
    size = abs(radius)
    first, second = azimuth_of(ends - centre).tolist()
    sweep = (second - first) % 360 or 360.0
    step = np.rad2deg(2 * np.arccos(max(1 - SAGITTA / size, 0.5)))
    inner = first + np.linspace(0, sweep, int(np.ceil(sweep / step)) + 1)[1:-1]
    return np.vstack([ends[:1], centre + size * unit(inner), ends[1:]])


def circle_through(points: Sequence[Sequence[float]] | FloatArray) -> tuple[FloatArray, float, bool]:
    """Circle through the first, middle and last point of a line.

    Returns
    -------
    centre : array (2,)
        [m].
    radius : float
        [m].
    counter_clockwise : bool
        Whether the line turns so about the centre.

    Raises
    ------
    DataError
        The three points are on a straight line.
    """
    first, middle, last = (np.asarray(points[i], dtype=float) for i in (0, len(points) // 2, -1))
    a, b = middle - first, last - first
    cross = float(a[0] * b[1] - a[1] * b[0])
    if abs(cross) < 1e-12 * float(a @ a + b @ b) or len(points) < 3:
        raise DataError("an arc without centre and with straight points; expected its centre and radius")
    square = np.array([a @ a, b @ b])
    apart = np.array([b[1] * square[0] - a[1] * square[1], a[0] * square[1] - b[0] * square[0]]) / (2 * cross)
    return first + apart, float(np.hypot(*apart)), cross > 0
