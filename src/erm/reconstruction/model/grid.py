"""Points in square cells, for finding the neighbours of many places at once with arrays alone."""

import numpy as np

from erm.geometry.vertical import FloatArray
from erm.reconstruction.model.paths import IntArray

MAX_CELLS = 1e6  # cells along an axis, so that the number of a cell fits an integer; chosen, not derived
MAX_INDEX_SIZE = 4  # cells per point up to which the start of every cell is stored; chosen, not derived


class Grid:
    """Points on sheets, each sheet divided into square cells.

    Parameters
    ----------
    points : array (point, 2)
        [m].
    sheet : array (point,) of int
        Only points on the same sheet are neighbours.
    cell : float
        Width of a cell [m]; fastest if about the search radius.
    """

    def __init__(self, points: FloatArray, sheet: IntArray, cell: float) -> None:
        self._origin = points.min(axis=0, initial=np.inf)
        extent = float(np.ptp(points, axis=0).max()) if len(points) else 0.0
        self._cell = max(cell, extent / MAX_CELLS, 1e-9)
        column, row = self._cells(points)
        self._columns, self._rows = (int(number.max(initial=0)) + 1 for number in (column, row))
        key = (sheet * self._columns + column) * self._rows + row
        self._order = np.argsort(key, kind="stable")
        self._key = key[self._order]
        self._east, self._north = np.ascontiguousarray(points[self._order].T)
        count = (int(sheet.max(initial=-1)) + 1) * self._columns * self._rows
        indexed = count <= MAX_INDEX_SIZE * len(points)
        self._start = np.concatenate([[0], np.cumsum(np.bincount(key, minlength=count))]) if indexed else None

    def within(self, places: FloatArray, sheet: IntArray, radius: FloatArray) -> tuple[IntArray, IntArray, FloatArray]:
        """Find the points within a radius of each place, on its sheet.

        Parameters
        ----------
        places : array (place, 2)
            [m].
        sheet : array (place,) of int
        radius : array (place,)
            [m].

        Returns
        -------
        place, point : array (pair,) of int
        squared_distance : array (pair,)
            [m2].
        """
        first, low = self._cells(places - radius[:, None])
        last, high = self._cells(places + radius[:, None])
        first, low = np.maximum(first, 0), np.maximum(low, 0)
        last, high = np.minimum(last, self._columns - 1), np.minimum(high, self._rows - 1)
        place, step = _repeated(np.where(high >= low, np.maximum(last - first + 1, 0), 0))
        start = (sheet[place] * self._columns + first[place] + step) * self._rows
        begin = self._starts(start + low[place])
        count = self._starts(start + high[place] + 1) - begin
        filled = np.flatnonzero(count)
        of, step = _repeated(count[filled])
        place, point = place[filled[of]], begin[filled[of]] + step
        square = (self._east[point] - places[place, 0]) ** 2 + (self._north[point] - places[place, 1]) ** 2
        near = np.flatnonzero(square <= radius[place] ** 2)
        return place[near], self._order[point[near]], square[near]

    def _starts(self, cell: IntArray) -> IntArray:
        """Number of points before each cell."""
        if self._start is None:
            return np.searchsorted(self._key, cell)
        return self._start[np.minimum(cell, len(self._start) - 1)]  # sheets beyond the last have no points

    def _cells(self, points: FloatArray) -> tuple[IntArray, IntArray]:
        column, row = np.floor((points - self._origin) / self._cell).astype(np.int64).T
        return column, row


def _repeated(count: IntArray) -> tuple[IntArray, IntArray]:
    """Each index ``count`` times, and its repetitions numbered: [2, 0, 1] gives [0, 0, 2] and [0, 1, 0]."""
    which = np.repeat(np.arange(len(count)), count)
    return which, np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)
