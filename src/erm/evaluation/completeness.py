"""How much of what the receivers see is on a map."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt
import shapely

from erm.evaluation.outline import STEP, covered_samples
from erm.geometry.vertical import FloatArray
from erm.maps.environment import Environment
from erm.maps.outline import outline_of

if TYPE_CHECKING:
    import xarray as xr

SUPPORTS = (1, 3, 10)
NEAR = 0.01  # m; a line of sight ends so far before the face it looks at, lest that face be in its way


class Completeness(NamedTuple):
    """What so many receivers see, and how much of it has a wall."""

    receivers: int
    length: float  # m of outline that at least so many receivers see
    share: float  # of it that has a wall of the map beside it (`covered_samples`); NaN where nothing is seen


def completeness(
    environment: Environment, outline: FloatArray, rx_positions: npt.ArrayLike, supports: tuple[int, ...] = SUPPORTS
) -> list[Completeness]:
    """Share of the visible outline that is on a map, by how many receivers see it.

    A stretch is visible to a receiver if no other part of the outline crosses the line between them, seen from
    above: heights of outlines are seldom known. That a receiver sees a stretch does not say that a path bounces there.

    Parameters
    ----------
    environment : Environment
        The map.
    outline : array (segment, 2 ends, 2)
        Known faces [m].
    rx_positions : array (receiver, 2 or more)
        Their different places [m].
    supports : tuple of int
        Least numbers of receivers.
    """
    walls = outline_of(environment)
    seen = [receivers_that_see(segment, outline, rx_positions) for segment in outline]
    have = [covered_samples(segment, walls, STEP) for segment in outline]
    length = [
        np.full(len(count), np.linalg.norm(b - a) / len(count)) for (a, b), count in zip(outline, seen, strict=True)
    ]
    receivers, mapped, metres = np.concatenate(seen), np.concatenate(have), np.concatenate(length)
    result = []
    for least in supports:
        visible = float(np.sum(metres[receivers >= least]))
        share = float(np.sum(metres[mapped & (receivers >= least)])) / visible if visible else float("nan")
        result.append(Completeness(least, visible, share))
    return result


def receivers_that_see(segment: FloatArray, outline: FloatArray, rx_positions: npt.ArrayLike) -> npt.NDArray[np.int64]:
    """Number (stretch,) of receivers that see each stretch of ``STEP`` of a segment past the outline.

    Parameters
    ----------
    segment : array (2 ends, 2)
        [m].
    outline : array (segment, 2 ends, 2)
        What may stand in the way [m]; the segment itself may be among it.
    rx_positions : array (receiver, 2 or more)
        [m].
    """
    receivers = np.asarray(rx_positions, dtype=float)[:, :2]
    count = max(1, round(float(np.linalg.norm(segment[1] - segment[0])) / STEP))
    middles = segment[0] + ((np.arange(count) + 0.5) / count)[:, None] * (segment[1] - segment[0])
    toward = middles[:, None] - receivers
    distance = np.linalg.norm(toward, axis=-1, keepdims=True)
    ends = receivers + toward * np.maximum(0.0, 1 - NEAR / np.maximum(distance, NEAR))
    sights = shapely.linestrings(np.stack([np.broadcast_to(receivers, ends.shape), ends], axis=-2).reshape(-1, 2, 2))
    blocked = np.zeros(len(sights), dtype=bool)
    blocked[shapely.STRtree(sights).query(shapely.linestrings(outline), predicate="intersects")[1]] = True
    return np.sum(~blocked.reshape(count, len(receivers)), axis=1)


def receivers_of(table: "xr.Dataset") -> FloatArray:
    """Different places (receiver, 2) of the receivers of an MPC table [m]."""
    return np.unique(table["rx_position"].values[:, :2], axis=0)
