"""The command ``erm letter``."""

from pathlib import Path
from typing import Annotated

import typer

from erm.common.outputs import require_folder


def letter(out: Annotated[Path, typer.Option(help="Folder for the page, its tables and figures.")]) -> None:
    """Redo the studies of the letter, with its method and this one.

    Captures are simulated, which takes minutes. The result is one page, letter.md, with figures as PDF and PNG.
    """
    require_folder(out)
    from erm.letter.captures import installed
    from erm.letter.study import run

    print(run(out, installed()))
