"""Where the antennas stood: values of a layout, and rows of a text table by the names of positions."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot, sqrt
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from erm.common.errors import DataError
from erm.common.text_files import TextTable, read_table
from erm.common.topocentric import topocentric
from sounder.instrument.description import Sounder
from sounder.recordings.foreign_file import ForeignFile
from sounder.recordings.layout import Layout, PositionTable

SIGHT = {"": -1, "-1": -1, "1": 1, "0": 0, "los": 1, "nlos": 0, "true": 1, "false": 0, "yes": 1, "no": 0}
"""What a cell says of the line of sight."""


@dataclass(frozen=True)
class Place:
    """Where the antennas of one position stood, and how well that is known.

    Attributes
    ----------
    tx, rx : array (3,)
        East, north, up [m].
    los : int
        1, 0 or -1; see `sounder.recordings.recording.Recording`.
    position_std, heading_std : float or None
        Standard deviations of a coordinate of an antenna [m], and of the zero of azimuth [degree], where the table
        holds them.
    """

    tx: NDArray[np.float64]
    rx: NDArray[np.float64]
    los: int
    position_std: float | None = None
    heading_std: float | None = None

    def described(self, sounder: Sounder) -> Sounder:
        """Description with the errors of the survey of this position."""
        known = {"position_std": self.position_std, "heading_std": self.heading_std}
        given = {name: value for name, value in known.items() if value is not None}
        return sounder.model_copy(update={"survey": sounder.survey.model_copy(update=given)}) if given else sounder


def places(
    file: ForeignFile, layout: Layout, names: Sequence[str], table: Path | None, ends: tuple[int, int] = (1, 1)
) -> list[Place | DataError]:
    """Places of all positions of a file; the error in place of a position that the table does not hold.

    Parameters
    ----------
    file : ForeignFile
    layout : Layout
    names : sequence of str
        Names of the positions.
    table : Path or None
        Text table with a row for each position.
    ends : tuple of int
        Transmit and receive antennas at different places; each link of two is a position.
    """
    given, count = layout.positions, len(names)
    points_of: dict[str, NDArray[np.float64]] = {}
    for k, end in enumerate(("tx", "rx")):
        value = getattr(given, end)
        if value is not None:
            apart = ends[k] if max(ends) > 1 else count
            points = file.points(value, apart, f"positions.{end}")
            # link number t * receivers + r is of the transmitter t and the receiver r
            points_of[end] = points[np.unravel_index(np.arange(count), ends)[k]] if max(ends) > 1 else points
    los = file.lines_of_sight(given.los, count, "positions.los")
    rows = None
    if given.table is not None:
        if table is None:
            raise DataError(f"{file.path}: positions.table names no file; pass one with --positions")
        rows = _Rows(table, given.table, _read(table, _named(given.table)))
    found: list[Place | DataError] = []
    for p, name in enumerate(names):
        held = {end: points[p] for end, points in points_of.items()}
        try:
            found.append(Place(**held, los=los[p]) if rows is None else rows.place(name, held, los[p]))
        except DataError as error:
            found.append(error)
    return found


@dataclass(frozen=True)
class _Rows:
    """Rows of a table of positions."""

    path: Path
    columns: PositionTable
    table: TextTable

    def place(self, name: str, held: dict[str, NDArray[np.float64]], los: int) -> Place:
        """Place of the position of a name; what its row does not hold is ``held`` already."""
        path, columns = self.path, self.columns
        rows = [row for row, cell in enumerate(self.table.column(columns.name.lower())) if cell == name]
        if len(rows) != 1:
            raise DataError(f"{path}: column {columns.name} holds {name} {len(rows)} times; expected once")
        [row] = rows
        for end in ("tx", "rx"):
            if (names := getattr(columns, end)) is not None:
                point = np.array([self._number(row, column) for column in names])
                if columns.origin is not None:
                    who = f"{path}: line {self.table.lines[row]}: {end}"
                    point = topocentric(*columns.origin).place(*point, who=who)
                held[end] = point
        if columns.los is not None:
            text = self._cell(row, columns.los).lower()
            if text not in SIGHT:
                where = f"{path}: line {self.table.lines[row]}: {columns.los}"
                raise DataError(f"{where} is {text!r}; expected 1, 0 or nothing")
            los = SIGHT[text]
        stds = [self._deviation(row, std) for std in (columns.tx_std, columns.rx_std)]
        known = [std for std in stds if std is not None]
        # errors of both antennas add in the length of a path, and the description has one for both
        position_std = hypot(*known) / sqrt(2) if known else None
        return Place(**held, los=los, position_std=position_std, heading_std=self._deviation(row, columns.heading_std))

    def _cell(self, row: int, column: str) -> str:
        return self.table.column(column.lower())[row]

    def _number(self, row: int, column: str) -> float:
        text = self._cell(row, column)
        try:
            return float(text)
        except ValueError:
            where = f"{self.path}: line {self.table.lines[row]}"
            raise DataError(f"{where}: {column} is {text!r}; expected a number") from None

    def _deviation(self, row: int, value: float | str | None) -> float | None:
        return self._number(row, value) if isinstance(value, str) else value


def _named(columns: PositionTable) -> list[str]:
    """Columns that a layout names."""
    single = (columns.name, columns.los, columns.tx_std, columns.rx_std, columns.heading_std)
    return [*(columns.tx or ()), *(columns.rx or ()), *(name for name in single if isinstance(name, str))]


def _read(path: Path, names: Sequence[str]) -> TextTable:
    table = read_table(path, "a table of positions")
    if absent := [name for name in names if name.lower() not in table.header]:
        raise DataError(f"{path}: no column {', '.join(absent)}; the table has {', '.join(table.header)}")
    return table
