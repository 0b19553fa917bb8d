"""Text as ordinary programs write it: with or without a byte order mark, and tables with any usual separator."""

import csv
from dataclasses import dataclass
from itertools import dropwhile
from pathlib import Path

from erm.common.errors import DataError
from erm.common.gate.files import read_bytes, require_file

MARKS = {b"\xef\xbb\xbf": "utf-8-sig", b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16"}
"""Byte order marks, and the encodings that they name."""
SEPARATORS = (",", ";", "\t")
CELLS = 8
"""Memory of the cells of a table, relative to its text: Python takes 50 bytes more for each cell."""


@dataclass(frozen=True)
class TextTable:
    """Cells of a table in a text file.

    Attributes
    ----------
    header : list of str
        Names of the columns, in lower case.
    rows : list of list of str
        Cells without blanks around them. Every number is written with a decimal point.
    lines : list of int
        Line of the file that each row stands in.
    """

    header: list[str]
    rows: list[list[str]]
    lines: list[int]

    def column(self, name: str) -> list[str]:
        """Cells of a column; empty where the table has no such column or a row is too short."""
        if name not in self.header:
            return [""] * len(self.rows)
        place = self.header.index(name)
        return [row[place] if place < len(row) else "" for row in self.rows]


def read_text(path: Path | str, expected: str, *, limit: int | None = None, expansion: int = 1) -> str:
    """Read a text file in the encoding that its byte order mark names, in UTF-8, or else in Windows-1252.

    Text in Windows-1252 that holds more than ASCII is almost never valid UTF-8, so the one is not taken for the other.

    Parameters
    ----------
    path : path
    expected : str
        What the file should be, for errors.
    limit, expansion : int
        Those of `erm.common.gate.files.read_bytes`.

    Raises
    ------
    DataError
        The file is missing, is too large or is not text.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder) / "place.txt"
    ...     _ = path.write_bytes("Straße".encode("cp1252"))
    ...     read_text(path, "text")
    'Straße'
    """
    content = read_bytes(Path(path), expected, limit=limit, expansion=expansion)
    marked = next((encoding for mark, encoding in MARKS.items() if content.startswith(mark)), "utf-8")
    try:
        return content.decode(marked)
    except UnicodeDecodeError as error:
        if marked != "utf-8" or b"\0" in content:
            raise DataError(f"{path}: not text ({error}); expected {expected}") from None
    try:
        return content.decode("cp1252")
    except UnicodeDecodeError as error:
        raise DataError(f"{path}: not text in UTF-8 or Windows-1252 ({error}); expected {expected}") from None


def read_table(path: Path | str, expected: str) -> TextTable:
    r"""Read a table with a header line. Blank lines, and lines above the header that start with ``#``, are not read.

    The separator is the one that a line ``sep=`` above the header names, as Excel writes it, or else the comma,
    semicolon or tab that cuts the header into most cells. Numbers may have a decimal comma if the separator is
    another character.

    Parameters
    ----------
    path : path
    expected : str
        What the file should be, for errors.

    Raises
    ------
    DataError
        The file is missing, is not text, or is no table.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder) / "table.csv"
    ...     _ = path.write_text("Delay; Azimuth\n1,5e-8;90\n")
    ...     read_table(path, "a table")
    TextTable(header=['delay', 'azimuth'], rows=[['1.5e-8', '90']], lines=[2])
    """
    require_file(Path(path))
    return split_table(read_text(path, expected, expansion=CELLS), path, expected)


def split_table(text: str, path: Path | str, expected: str) -> TextTable:
    """Split the text of a table into cells; see `read_table`."""
    lines = [(number, line) for number, line in enumerate(text.splitlines(), start=1) if line.strip()]
    lines = list(dropwhile(lambda item: item[1].startswith("#"), lines))
    separator = None
    if lines and lines[0][1].lower().startswith("sep="):
        separator = lines.pop(0)[1][4:5] or ","
    if not lines:
        raise DataError(f"{path}: empty; expected {expected}")
    if separator is None:
        separator = max(SEPARATORS, key=lines[0][1].count)
    reader = csv.reader((line for _, line in lines), delimiter=separator, skipinitialspace=True)
    try:
        header, *rows = [[cell.strip() for cell in row] for row in reader]
    except (csv.Error, ValueError) as error:
        raise DataError(f"{path}: not a text table ({error}); expected {expected}") from None
    if separator != ",":
        rows = [[_with_point(cell) for cell in row] for row in rows]
    return TextTable([name.lower() for name in header], rows, [number for number, _ in lines[1:]][: len(rows)])


def _with_point(cell: str) -> str:
    """Cell with a decimal point, if it is a number with a decimal comma."""
    pointed = cell.replace(",", ".", 1)
    try:
        float(pointed)
    except ValueError:
        return cell
    return pointed
