"""The command ``erm letter``."""

from pathlib import Path
from typing import Annotated

import typer

from erm.common.console import drawing
from erm.common.outputs import require_folder


def letter(out: Annotated[Path, typer.Option(help="Folder for the page, its tables and figures.")]) -> None:
    """Repeat the studies of the published letter (Chang et al.).

    The page compares the numbers of the letter with those of its method and of this software. Captures are simulated,
    which takes minutes. The result is one page, letter.md, with figures as PDF and PNG.
    """
    require_folder(out)
    from erm.letter.captures import installed
    from erm.letter.study import run

    with drawing():
        print(run(out, installed()))
