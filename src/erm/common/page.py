"""One Markdown page with its figures; the page is there whole or not at all."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from erm.common.console import save_figure
from erm.common.errors import DataError
from erm.common.storage import atomic_path

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FORMATS = ("pdf", "png")
LEAST = 0.0001  # numbers nearer to zero are not told apart


class Page:
    """Text, tables and numbered figures, written in the end.

    A page of an earlier run is removed with the first figure, so that no page ever stands beside figures it does not
    belong to.

    Parameters
    ----------
    out : Path
        Folder; figures go to ``figures`` in it.
    name : str
        Of the page's file.
    """

    def __init__(self, out: Path, name: str) -> None:
        self._out, self._target = out, out / name
        self._blocks: list[str] = []
        self._figures = 0

    def add(self, *paragraphs: str) -> None:
        """Add paragraphs, headings or lists of Markdown."""
        self._blocks += paragraphs

    def table(self, header: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
        """Add a table; floats are written to three digits, NaN as a dash."""
        lines = ["| " + " | ".join(cells) + " |" for cells in ([str(one) for one in header], ["---"] * len(header))]
        lines += ["| " + " | ".join(cell(one) for one in row) + " |" for row in rows]
        self._blocks.append("\n".join(lines))

    def figure(self, name: str, drawn: "Figure | Axes", caption: str) -> None:
        """Save a figure as vector PDF and PNG, and show it with a numbered caption."""
        import matplotlib.pyplot as plt

        self.outdate()
        for suffix in FORMATS:
            save_figure(drawn, self._out / "figures" / f"{name}.{suffix}")
        plt.close(drawn.get_figure(root=True))
        self._figures += 1
        link = f"![Figure {self._figures}](figures/{name}.png)"
        self._blocks.append(f"{link}\n\n*Figure {self._figures} ([PDF](figures/{name}.pdf)).* {caption}")

    def file(self, name: str, text: str) -> None:
        """Write a text beside the page."""
        self.outdate()
        with atomic_path(self._out / name) as temporary:
            temporary.write_text(text, encoding="utf-8")

    def outdate(self) -> None:
        """Remove the page of an earlier run before the first figure or table that is not its own."""
        try:
            self._target.unlink(missing_ok=True)
        except OSError as error:
            raise DataError(f"{self._target}: cannot be written ({error.strerror}); choose a writable folder") from None

    def write(self) -> Path:
        """Write the page."""
        with atomic_path(self._target) as temporary:
            temporary.write_text("\n\n".join(self._blocks) + "\n", encoding="utf-8")
        return self._target


def cell(value: object) -> str:
    """Write a number to three significant digits, a count or a word as it is, a dash for what is not there."""
    if value is None or (isinstance(value, float) and not np.isfinite(value)):
        return "–"
    if isinstance(value, bool):
        return "on" if value else "off"
    if not isinstance(value, float):
        return str(value).replace("|", r"\|")  # which would begin another cell
    if 0 < abs(value) < LEAST:
        return f"< {LEAST}"
    return f"{value:.0f}" if abs(value) >= 1000 else f"{value:.3g}"
