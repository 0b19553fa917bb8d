"""The command ``sounder check``."""

from pathlib import Path
from typing import Annotated

import typer

from erm.common import console
from erm.common.messages import write_json


def check(
    files: Annotated[
        list[Path], typer.Argument(readable=False, help="Recordings, back-to-back recordings, products or maps (HDF5).")
    ],
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Verify the checksums of files and name the damaged parts."""
    from sounder.processing.integrity import check_file

    rows: list[list[str]] = []
    failures: list[str] = []
    for file in files:
        lines, broken = check_file(file)
        rows += [[file.name, *line] for line in lines]
        failures += broken
    header = ["file", "member", "state"]
    if as_json:
        write_json([dict(zip(header, row, strict=True)) for row in rows])
    else:
        console.show(header, rows)
    console.report_failures(failures)
