"""The page of a verification: figures of merit, linearity, and a control chart over dates."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from sounder.verification.history import Entry
from sounder.verification.verify import COVERAGE, Figure, Verified

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Drawing

PAPER = (8.27, 11.69)
"""A4 [inch]."""
MOST_ROWS = 22
"""Figures in the table of a page; more are counted."""
SHOWN = {"s": (1e12, "ps"), "dB": (1.0, "dB"), "dB/dB": (1.0, "dB/dB")}
"""Factor and unit of figures, for people."""
LINE = 0.19
"""Height of a line of the table, where the charts have 2 [1]; chosen by eye."""
HEADER = ("artefact", "quantity", "known", "measured", "error", "std (k = 1)", "agrees (95 %)")


def rows(figures: Sequence[Figure]) -> list[tuple[str, ...]]:
    """Cells of the table of figures, with units."""
    return [_row(figure) for figure in figures]


def _row(figure: Figure) -> tuple[str, ...]:
    factor, unit = SHOWN[figure.unit]
    wide, long_unit = (1e9, "ns") if figure.unit == "s" else (factor, unit)
    digits = 4 if figure.unit == "dB/dB" else 3 if figure.unit == "s" else 2
    judged = {None: "", True: "yes", False: "NO"}[figure.agrees]
    known, measured = (
        f"{round(value * wide, digits) + 0.0:.{digits}f} {long_unit}" for value in (figure.expected, figure.measured)
    )
    std = "" if np.isnan(figure.std) else f"{figure.std * factor:.2g} {unit}"
    if figure.agrees is None:
        return figure.artefact, figure.quantity, "", measured, "", std, judged
    return (
        figure.artefact,
        figure.quantity,
        known,
        measured,
        f"{figure.error * factor:+.3g} {unit}",
        std,
        judged,
    )


def draw_page(verified: Verified, history: Sequence[Entry]) -> "Drawing":
    """Draw the page.

    Parameters
    ----------
    verified : Verified
        Of today.
    history : sequence of Entry
        Of all days, in their order, with today.

    Returns
    -------
    matplotlib.figure.Figure
        One page, A4.
    """
    from matplotlib.figure import Figure as Drawing

    page = Drawing(figsize=PAPER, layout="constrained")
    lines = min(len(verified.figures), MOST_ROWS) + 2
    table, linearity, delay, gain = page.subplots(4, 1, height_ratios=[LINE * lines, 2, 2, 2])
    verification = verified.verification
    page.suptitle(
        f"{verification.name}\n{verified.sounder}, {verification.date.isoformat()}, calibration "
        f"{verification.calibration.name}",
        fontsize=11,
    )
    _draw_table(verified, table)
    draw_linearity(verified, linearity)
    for axes, unit in ((delay, "s"), (gain, "dB")):
        draw_control_chart([entry for entry in history if entry.unit == unit], axes, unit)
    page.supxlabel(
        "Standard deviations hold the scatter of snapshots or recordings, the calibration, and what is stated of the "
        "artefact\nand the connection (GUM). Bars and limits are two standard deviations. In the spirit of IEEE P2982.",
        fontsize=7,
    )
    return page


def _draw_table(verified: Verified, axes: "Axes") -> None:
    axes.axis("off")
    cells = rows(verified.figures)
    if len(cells) > MOST_ROWS:
        more = (f"and {len(cells) - MOST_ROWS + 1} more", *[""] * (len(HEADER) - 1))
        cells = [*cells[: MOST_ROWS - 1], more]
    drawn = axes.table(cells, colLabels=HEADER, loc="upper center", cellLoc="left", edges="horizontal")
    drawn.auto_set_font_size(False)
    drawn.set_fontsize(7)
    drawn.auto_set_column_width(list(range(len(HEADER))))


def draw_linearity(verified: Verified, axes: "Axes") -> "Axes":
    """Draw the gain errors of connected devices over their known gain [dB]."""
    expected, measured, std = verified.levels.T
    axes.errorbar(expected, measured - expected, COVERAGE * std, fmt="o", capsize=3, ms=4, color="C0")
    axes.axhline(0.0, color="0.6", lw=0.8)
    axes.set(xlabel="known gain [dB]", ylabel="error of gain [dB]", title="Linearity, against the calibration")
    axes.title.set_fontsize(8)
    return axes


def draw_control_chart(entries: Sequence[Entry], axes: "Axes", unit: str) -> "Axes":
    """Draw errors over dates, with limits of two standard deviations about zero.

    An error that leaves its limits is out of control; several on one side tell a drift (Shewhart, 1931).
    """
    factor, shown = SHOWN[unit]
    kept = [entry for entry in entries if entry.quantity in ("delay", "gain")]
    days = sorted({entry.date for entry in kept})
    for number, artefact in enumerate(dict.fromkeys(entry.artefact for entry in kept)):
        own = [entry for entry in kept if entry.artefact == artefact]
        at = np.array([days.index(entry.date) for entry in own])
        error, std = (np.array([getattr(entry, name) for entry in own]) * factor for name in ("error", "std"))
        colour = f"C{number}"
        axes.errorbar(at, error, COVERAGE * std, fmt="o-", ms=4, capsize=3, lw=0.8, color=colour, label=artefact)
    axes.axhline(0.0, color="0.6", lw=0.8)
    axes.set_xticks(range(len(days)), days, fontsize=7)
    quantity = "delay" if unit == "s" else "gain"
    axes.set(ylabel=f"error of {quantity} [{shown}]", title=f"Control chart: {quantity}")
    axes.title.set_fontsize(8)
    if kept:
        axes.legend(fontsize=6, loc="best")
    return axes
