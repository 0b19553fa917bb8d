"""History of verifications: a CSV file with a row for each figure of each day, for a control chart."""

import csv
from pathlib import Path
from typing import NamedTuple

from erm.common.atomic import atomic_path
from erm.common.errors import DataError
from erm.common.text_files import read_table
from sounder.verification.verify import Verified

COLUMNS = ("date", "sounder", "artefact", "quantity", "unit", "error", "std")
"""Header of the file. ``error`` is the figure itself where nothing is expected."""


class Entry(NamedTuple):
    """One figure of one day."""

    date: str
    sounder: str
    artefact: str
    quantity: str
    unit: str
    error: float
    std: float


def entries(verified: Verified) -> list[Entry]:
    """Rows of a verification."""
    day = verified.verification.date.isoformat()
    return [
        Entry(day, verified.sounder, one.artefact, one.quantity, one.unit, one.error, one.std)
        for one in verified.figures
    ]


def read_history(path: Path) -> list[Entry]:
    """Read a history; empty if there is no file yet.

    Raises
    ------
    DataError
        The file is no history.
    """
    if not path.exists():
        return []
    expected = f"a history of verifications (CSV with the columns {', '.join(COLUMNS)})"
    table = read_table(path, expected)
    found = []
    for line, row in zip(table.lines, table.rows, strict=True):
        try:
            named = dict(zip(table.header, row, strict=True))
            date, who, artefact, quantity, unit = (named[name] for name in COLUMNS[:5])
            found.append(Entry(date, who, artefact, quantity, unit, float(named["error"]), float(named["std"])))
        except (KeyError, ValueError) as error:
            raise DataError(f"{path}: line {line}: not readable ({error}); expected {expected}") from None
    return found


def with_today(history: list[Entry], today: list[Entry]) -> list[Entry]:
    """History with the figures of a day, which replace earlier ones of the same day, in the order of dates."""
    keys = {entry[:4] for entry in today}
    return sorted([*(entry for entry in history if entry[:4] not in keys), *today])


def write_history(history: list[Entry], path: Path) -> None:
    """Write a history."""
    with atomic_path(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        writer.writerows(history)
