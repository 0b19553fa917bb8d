"""Environment as CSV, one row per reflector. Ground, ceiling and materials are one comment line above."""

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np

from erm.common.errors import DataError
from erm.common.storage import atomic_path
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
    scene: dict[str, Any] = {}
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
        if lines and lines[0].startswith(COMMENT):
            scene = json.loads(lines[0].removeprefix(COMMENT))
    except (UnicodeDecodeError, json.JSONDecodeError) as error:
        raise DataError(f"{path}: not a CSV of reflectors ({error})") from error
    try:
        rows = [row for row in csv.reader(line for line in lines if not line.startswith("#")) if row]
    except csv.Error as error:
        raise DataError(f"{path}: not a CSV of reflectors ({error})") from error
    if not rows:
        raise DataError(f"{path}: empty; expected a header and one row per reflector")
    header, *body = rows
    for index, row in enumerate(body):
        if len(row) != len(header):
            raise DataError(f"{path}: row {index + 1} has {len(row)} cells, the header {len(header)}")
    cells = np.array(body, dtype=object).reshape(len(body), len(header))
    return {name.strip(): cells[:, index] for index, name in enumerate(header)}, scene
