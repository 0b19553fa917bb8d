"""Completeness of a map: the share of the visible outline that has a wall."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt
import shapely

from erm.evaluation.outline import MATCH_SPACING, covered_samples
from erm.geometry.vertical import FloatArray
from erm.maps.environment import Environment
from erm.maps.outline import outline_of

if TYPE_CHECKING:
    import xarray as xr

FACE_CLEARANCE = 0.01
"""A line of sight ends this far in front of its face, so that the face does not block it [m]; chosen."""


class Completeness(NamedTuple):
    """Outline that a number of receivers see, and the share of it that has a wall."""

    receivers: int
    """Least number of receivers."""
    length: float
    """Length of outline that at least this many receivers see [m]."""
    share: float
    """Share of this length that has a wall of the map (`covered_samples`); NaN if the length is 0."""


def completeness(
    environment: Environment,
    outline: FloatArray,
    rx_positions: npt.ArrayLike,
    min_receivers: tuple[int, ...] = (1, 3, 10),
) -> list[Completeness]:
    """Share of the visible outline that is on a map, by the number of receivers that see it.

    A receiver sees a piece of outline if no other part of the outline crosses the line between them in the plan view;
    heights of outlines are rarely known. A visible piece does not always reflect a path.

    Parameters
    ----------
    environment : Environment
        The map.
    outline : array (segment, 2 ends, 2)
        Known faces [m].
    rx_positions : array (receiver, 2 or more)
        Positions of the receivers [m].
    min_receivers : tuple of int
        Least numbers of receivers, one result each.

    Returns
    -------
    list of Completeness
        ``receivers``, ``length`` [m] and ``share`` of each.

    Examples
    --------
    >>> import erm
    >>> import numpy as np
    >>> outline = np.array([[[0.0, 10.0], [100.0, 10.0]]])
    >>> half = erm.Environment.walls([[[0, 10], [50, 10]]])
    >>> for row in erm.completeness(half, outline, [[20, 0], [80, 0]], min_receivers=(1, 2, 3)):
    ...     print(row.receivers, round(row.length), round(row.share, 1))
    1 100 0.5
    2 100 0.5
    3 0 nan
    """
    walls = outline_of(environment)
    seen = [count_receivers(segment, outline, rx_positions) for segment in outline]
    have = [covered_samples(segment, walls, MATCH_SPACING) for segment in outline]
    length = [
        np.full(len(count), np.linalg.norm(b - a) / len(count)) for (a, b), count in zip(outline, seen, strict=True)
    ]
    receivers, mapped, metres = np.concatenate(seen), np.concatenate(have), np.concatenate(length)
    result = []
    for least in min_receivers:
        visible = float(np.sum(metres[receivers >= least]))
        share = float(np.sum(metres[mapped & (receivers >= least)])) / visible if visible else float("nan")
        result.append(Completeness(least, visible, share))
    return result


def count_receivers(segment: FloatArray, outline: FloatArray, rx_positions: npt.ArrayLike) -> npt.NDArray[np.int64]:
    """Number (piece,) of receivers that see each piece of length ``MATCH_SPACING`` of a segment.

    Parameters
    ----------
    segment : array (2 ends, 2)
        End points [m].
    outline : array (segment, 2 ends, 2)
        Faces that may block the view [m]; the segment itself may be one of them.
    rx_positions : array (receiver, 2 or more)
        Positions of the receivers [m].
    """
    receivers = np.asarray(rx_positions, dtype=float)[:, :2]
    count = max(1, round(float(np.linalg.norm(segment[1] - segment[0])) / MATCH_SPACING))
    middles = segment[0] + ((np.arange(count) + 0.5) / count)[:, None] * (segment[1] - segment[0])
    toward = middles[:, None] - receivers
    distance = np.linalg.norm(toward, axis=-1, keepdims=True)
    ends = receivers + toward * np.maximum(0.0, 1 - FACE_CLEARANCE / np.maximum(distance, FACE_CLEARANCE))
    sights = shapely.linestrings(np.stack([np.broadcast_to(receivers, ends.shape), ends], axis=-2).reshape(-1, 2, 2))
    blocked = np.zeros(len(sights), dtype=bool)
    blocked[shapely.STRtree(sights).query(shapely.linestrings(outline), predicate="intersects")[1]] = True
    return np.sum(~blocked.reshape(count, len(receivers)), axis=1)


def receivers_of(table: "xr.Dataset") -> FloatArray:
    """Distinct positions (receiver, 2) of the receivers of an MPC table [m]."""
    return np.unique(table["rx_position"].values[:, :2], axis=0)
