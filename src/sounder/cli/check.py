"""The command ``sounder check``."""

from pathlib import Path
from typing import Annotated

import typer

from erm.common import console


def check(
    files: Annotated[
        list[Path], typer.Argument(readable=False, help="Recordings, back-to-back recordings, products or maps (HDF5).")
    ],
) -> None:
    """Verify the checksums of files; tell which parts are damaged."""
    from sounder.processing.integrity import check_file

    rows: list[list[str]] = []
    failures: list[str] = []
    for file in files:
        lines, broken = check_file(file)
        rows += [[file.name, *line] for line in lines]
        failures += broken
    console.show(["file", "member", "state"], rows)
    console.report_failures(failures)
