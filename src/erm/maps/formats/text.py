"""Environment as CSV, one row per reflector. Ground, ceiling and materials are one comment line above."""

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np

from erm.common.atomic import atomic_path
from erm.common.errors import DataError
from erm.common.gate.nesting import parse_json
from erm.common.text_files import read_text, split_table
from erm.maps.formats.columns import Columns

COMMENT = "# environment "
"""First words of the comment line."""


def write(columns: Columns, scene: dict[str, Any], path: Path) -> None:
    """Write numbers exactly; infinite ones as ``inf``, unknown ones blank."""
    with atomic_path(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        file.write(f"{COMMENT}{json.dumps(scene, allow_nan=False)}\n")
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(columns)
        for row in zip(*columns.values(), strict=True):
            rows.writerow("" if cell != cell else cell for cell in (value.item() for value in row))


def read(path: Path) -> tuple[Columns, dict[str, Any]]:
    """Read a file of `write`; the comment line may be absent."""
    text = read_text(path, "a CSV of reflectors")
    first = text.partition("\n")[0]
    try:
        scene = parse_json(first.removeprefix(COMMENT)) if first.startswith(COMMENT) else {}
    except ValueError as error:
        raise DataError(f"{path}: not a CSV of reflectors ({error})") from error
    table = split_table(text, path, "a header and one row per reflector")
    for line, row in zip(table.lines, table.rows, strict=True):
        if len(row) != len(table.header):
            raise DataError(f"{path}: line {line} has {len(row)} cells, the header {len(table.header)}")
    return {name: np.array(table.column(name), dtype=object) for name in table.header}, scene
