"""Points looked up by the cell that they are in: for many places at once, in arrays alone."""

import numpy as np

from erm.geometry.vertical import FloatArray
from erm.reconstruction.model.paths import IntArray

MOST_CELLS = 1e6  # along an axis; the number of a cell stays an integer
LISTED = 4  # cells a point, of which it is listed where each starts; of more it is searched for


class Grid:
    """Points on sheets, each divided into square cells.

    Parameters
    ----------
    points : array (point, 2)
        [m].
    sheet : array (point,) of int
        Points are looked for on one sheet at a time.
    cell : float
        Width of a cell [m]; about the radius that is looked for.
    """

    def __init__(self, points: FloatArray, sheet: IntArray, cell: float) -> None:
        self._origin = points.min(axis=0, initial=np.inf)
        extent = float(np.ptp(points, axis=0).max()) if len(points) else 0.0
        self._cell = max(cell, extent / MOST_CELLS, 1e-9)
        column, row = self._cells(points)
        self._columns, self._rows = (int(number.max(initial=0)) + 1 for number in (column, row))
        key = (sheet * self._columns + column) * self._rows + row
        self._order = np.argsort(key, kind="stable")
        self._key = key[self._order]
        self._east, self._north = np.ascontiguousarray(points[self._order].T)
        count = (int(sheet.max(initial=-1)) + 1) * self._columns * self._rows
        listed = count <= LISTED * len(points)
        self._start = np.concatenate([[0], np.cumsum(np.bincount(key, minlength=count))]) if listed else None

    def within(self, places: FloatArray, sheet: IntArray, radius: FloatArray) -> tuple[IntArray, IntArray, FloatArray]:
        """Pairs (place, point) no farther apart than the radius (place,) of the place, on its sheet, and its square."""
        first, low = self._cells(places - radius[:, None])
        last, high = self._cells(places + radius[:, None])
        first, low = np.maximum(first, 0), np.maximum(low, 0)
        last, high = np.minimum(last, self._columns - 1), np.minimum(high, self._rows - 1)
        place, step = _counted(np.where(high >= low, np.maximum(last - first + 1, 0), 0))
        start = (sheet[place] * self._columns + first[place] + step) * self._rows
        begin = self._starts(start + low[place])
        many = self._starts(start + high[place] + 1) - begin
        some = np.flatnonzero(many)
        of, step = _counted(many[some])
        place, point = place[some[of]], begin[some[of]] + step
        square = (self._east[point] - places[place, 0]) ** 2 + (self._north[point] - places[place, 1]) ** 2
        near = np.flatnonzero(square <= radius[place] ** 2)
        return place[near], self._order[point[near]], square[near]

    def _starts(self, cell: IntArray) -> IntArray:
        """How many points come before cells."""
        if self._start is None:
            return np.searchsorted(self._key, cell)
        return self._start[np.minimum(cell, len(self._start) - 1)]  # of sheets beyond the last there are no points

    def _cells(self, points: FloatArray) -> tuple[IntArray, IntArray]:
        column, row = np.floor((points - self._origin) / self._cell).astype(np.int64).T
        return column, row


def _counted(many: IntArray) -> tuple[IntArray, IntArray]:
    """Each number as often as it says, and how often it has come before: [2, 0, 1] gives [0, 0, 2] and [0, 1, 0]."""
    which = np.repeat(np.arange(len(many)), many)
    return which, np.arange(len(which)) - np.repeat(np.cumsum(many) - many, many)
