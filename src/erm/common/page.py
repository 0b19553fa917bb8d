"""A Markdown page with its figures."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from erm.common.atomic import atomic_path
from erm.common.console import save_figure
from erm.common.errors import DataError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FORMATS = ("pdf", "png")
SMALLEST = 0.0001
"""Smaller numbers are written as ``< 0.0001``; chosen."""


class Page:
    """Text, tables and numbered figures. The page itself is written last.

    The first figure removes the page of an earlier run, so that a page never stands beside figures of another run.

    Parameters
    ----------
    out : Path
        Folder of the page. Figures go to its folder ``figures``.
    name : str
        File name of the page.
    """

    def __init__(self, out: Path, name: str) -> None:
        self._out, self._target = out, out / name
        self._blocks: list[str] = []
        self._figures = 0

    def add(self, *paragraphs: str) -> None:
        """Add paragraphs, headings or lists of Markdown."""
        self._blocks += paragraphs

    def table(self, header: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
        """Add a table. Floats have three significant digits, NaN is a dash."""
        lines = ["| " + " | ".join(cells) + " |" for cells in ([str(one) for one in header], ["---"] * len(header))]
        lines += ["| " + " | ".join(cell(one) for one in row) + " |" for row in rows]
        self._blocks.append("\n".join(lines))

    def figure(self, name: str, drawn: "Figure | Axes", caption: str) -> None:
        """Save a figure as PDF and PNG, and add it with a numbered caption."""
        import matplotlib.pyplot as plt

        self.remove_outdated()
        for suffix in FORMATS:
            save_figure(drawn, self._out / "figures" / f"{name}.{suffix}")
        plt.close(drawn.get_figure(root=True))
        self._figures += 1
        link = f"![Figure {self._figures}](figures/{name}.png)"
        self._blocks.append(f"{link}\n\n*Figure {self._figures} ([PDF](figures/{name}.pdf)).* {caption}")

    def file(self, name: str, text: str) -> None:
        """Write a text file beside the page."""
        self.remove_outdated()
        with atomic_path(self._out / name) as temporary:
            temporary.write_text(text, encoding="utf-8")

    def remove_outdated(self) -> None:
        """Remove the page of an earlier run."""
        remove_outdated(self._target)

    def write(self) -> Path:
        """Write the page."""
        with atomic_path(self._target) as temporary:
            temporary.write_text("\n\n".join(self._blocks) + "\n", encoding="utf-8")
        return self._target


def remove_outdated(page: Path) -> None:
    """Remove the page of an earlier run, so that it does not stand beside other results."""
    try:
        page.unlink(missing_ok=True)
    except OSError as error:
        raise DataError(f"{page}: cannot be written ({error.strerror}); choose a writable folder") from None


def cell(value: object) -> str:
    """Write a float to three significant digits, NaN and None as a dash, anything else as it is."""
    if value is None or (isinstance(value, float) and not np.isfinite(value)):
        return "–"
    if isinstance(value, bool):
        return "on" if value else "off"
    if not isinstance(value, float):
        return str(value).replace("|", r"\|")  # a bare | would begin another cell
    if 0 < abs(value) < SMALLEST:
        return f"< {SMALLEST}"
    return f"{value:.0f}" if abs(value) >= 1000 else f"{value:.3g}"
