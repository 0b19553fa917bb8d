"""Marks of a map: names without overlap, which RX belongs to which TX, scale bar and north arrow."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from erm.figures.style import PALETTE
from erm.geometry.vertical import FloatArray

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

MAX_NAMED = 60
"""Most positions whose names are written; more cannot be read on a page. Chosen; not derived."""
GAPS = (5.0, 14.0, 24.0, 36.0, 50.0, 70.0, 95.0, 125.0)
"""Gaps between a name and its place that are tried in turn [point]. Chosen; not derived."""
BAR_SHARE = 0.25
"""Longest scale bar, relative to the width of the map. Chosen; not derived."""


def antenna_pairs(table: "xr.Dataset") -> tuple[list[str], FloatArray, FloatArray]:
    """Names of the positions of an MPC table, and places (pair, 2) of their TX and RX; each pair once."""
    ends = np.hstack([table[f"{end}_position"].values[:, :2] for end in ("tx", "rx")])
    rows = list(zip(table["position"].values.astype(str).tolist(), map(tuple, ends.tolist()), strict=True))
    pairs = list(dict.fromkeys(rows))
    places = np.array([ends for _, ends in pairs], float).reshape(-1, 4)
    return [name for name, _ in pairs], places[:, :2], places[:, 2:]


def draw_pairs(axes: "Axes", tx: FloatArray, rx: FloatArray) -> None:
    """Draw a thin line from each RX (pair, 2) to its TX (pair, 2), under everything else."""
    from matplotlib.collections import LineCollection

    if len(tx):
        lines = np.stack([tx, rx], axis=1)
        style: dict[str, Any] = {"colors": PALETTE["RX"], "linewidths": 0.5, "alpha": 0.35, "zorder": 0}
        axes.add_collection(LineCollection(list(lines), label="RX to its TX", **style))


def draw_scale(axes: "Axes", heading: float = 0.0) -> None:
    """Draw a scale bar of 1, 2 or 5 times a power of ten, and an arrow to the north.

    Parameters
    ----------
    axes : matplotlib Axes
        In metres; its limits are set.
    heading : float
        Bearing of the upward axis [degree, clockwise from north], as of `erm.Georeference`.
    """
    from matplotlib.offsetbox import AnchoredOffsetbox, DrawingArea
    from matplotlib.patches import FancyArrowPatch
    from matplotlib.text import Text
    from mpl_toolkits.axes_grid1.anchored_artists import AnchoredSizeBar

    width = float(np.ptp(axes.get_xlim()))
    length = round_length(BAR_SHARE * width)
    frame: dict[str, Any] = {"frameon": True, "borderpad": 0.3}
    bar = AnchoredSizeBar(axes.transData, length, f"{length:g} m", "lower right", pad=0.3, sep=3, **frame)
    bar.patch.set(alpha=0.8, edgecolor="none")
    axes.add_artist(bar).set_zorder(9)
    size, radius = 30.0, 9.0
    area = DrawingArea(size, size)
    toward = np.radians(90 + heading)  # bearings turn clockwise: north lies counter-clockwise of the axis
    north = np.array([np.cos(toward), np.sin(toward)])
    middle = np.full(2, size / 2)
    tail, tip = middle - radius * north, middle + radius * north
    area.add_artist(FancyArrowPatch(tuple(tail), tuple(tip), arrowstyle="-|>", mutation_scale=9, color="black"))
    letter = middle + 1.4 * radius * north
    area.add_artist(Text(float(letter[0]), float(letter[1]), "N", ha="center", va="center", fontsize="small"))
    box = AnchoredOffsetbox("upper right", child=area, pad=0.0, frameon=True, borderpad=0.3)
    box.patch.set(alpha=0.8, edgecolor="none")
    axes.add_artist(box).set_zorder(9)


def round_length(longest: float) -> float:
    """Largest of 1, 2, 5 times a power of ten that is not more than a length [m].

    Examples
    --------
    >>> [round_length(longest) for longest in (0.9, 3.0, 47.0, 100.0)]
    [0.5, 2.0, 20.0, 100.0]
    """
    power = 10.0 ** np.floor(np.log10(longest))
    return float(max(step for step in (1, 2, 5) if step * power <= longest) * power)


def write_names(
    axes: "Axes", places: FloatArray, names: Sequence[str], occupied: FloatArray, colour: str
) -> FloatArray:
    """Write names beside segments, where points leave most room.

    Parameters
    ----------
    axes : matplotlib Axes
        In metres; its limits are set.
    places : array (segment, 2 ends, 2)
        What is named; points have equal ends [m].
    names : sequence of str
    occupied : array (point, 2)
        Points to be left free [m].
    colour : str

    Returns
    -------
    array (point, 2)
        Points that are occupied now [m].
    """
    from matplotlib.patheffects import withStroke

    axes.apply_aspect()
    per_metre = 72 / axes.figure.dpi * np.diff(axes.transData.transform([[0, 0], [1, 0]])[:, 0])[0]  # points
    drawn = occupied * per_metre
    for ends, name in zip(places, names, strict=False):
        place, shift = _free_place(ends * per_metre, drawn, len(name))
        corners = np.stack(np.meshgrid([-1, -0.5, 0, 0.5, 1], [-1, 0, 1]), axis=-1).reshape(-1, 2)
        drawn = np.vstack([drawn, place + shift + corners * _half_size(len(name))])
        # a line leads from a name that is far from its place
        far = np.linalg.norm(np.maximum(np.abs(shift) - _half_size(len(name)), 0)) > 2 * GAPS[0]
        leader = {"arrowstyle": "-", "color": colour, "linewidth": 0.5, "shrinkA": 0, "shrinkB": 1} if far else None
        axes.annotate(
            name,
            tuple(place / per_metre),
            tuple(shift),
            textcoords="offset points",
            ha="center",
            va="center",
            fontsize="small",
            color=colour,
            arrowprops=leader,
            path_effects=[withStroke(linewidth=2.5, foreground="white")],
            zorder=7,
        )
    return drawn / per_metre


def along_segments(segments: FloatArray) -> FloatArray:
    """Points (point, 2) along segments (segment, 2, 2)."""
    along = np.linspace(0, 1, 21)[:, None, None]
    return np.asarray((segments[:, 0] + along * (segments[:, 1] - segments[:, 0])).reshape(-1, 2))


def _half_size(letters: int) -> FloatArray:
    """Half of the width and height of a name [point]."""
    return np.array([3.2 * letters, 4.5])


def _free_place(ends: FloatArray, drawn: FloatArray, letters: int) -> tuple[FloatArray, FloatArray]:
    """Point on a segment (2 ends, 2) and shift of a name from it where points (n, 2) leave most room.

    The shift is the smallest of :data:`GAPS` at which the name touches nothing; if there is none, that at which it
    hides the fewest points.
    """
    box = _half_size(letters)
    angle = np.radians(np.arange(0, 360, 15))
    place = ends[0] + np.array([0.5, 0.35, 0.65, 0.1, 0.9])[:, None] * (ends[1] - ends[0])
    most, found = -np.inf, (place[0], box)
    for gap in GAPS:
        shift = (box + gap) * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        distance = np.abs(place[:, None, None] + shift[None, :, None] - drawn) - box
        away = np.linalg.norm(np.maximum(distance, 0), axis=-1)
        room = np.round(np.minimum(away.min(axis=-1), 9.0), 6) - (away == 0).sum(axis=-1)
        best = np.unravel_index(np.argmax(room), room.shape)
        if room[best] > most:
            most, found = float(room[best]), (place[best[0]], shift[best[1]])
        if most > 0:
            break
    return found
