"""Style of all figures: colours and markers of things, equal scales of maps, legends outside of the axes."""

from typing import TYPE_CHECKING, Any

import numpy as np

from erm.geometry.vertical import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PALETTE = {"TX": "#d55e00", "RX": "#0072b2", "RP": "#e69f00", "wall": "#009e73", "truth": "#8c8c8c"}
"""Colours of things in all figures: those of Okabe and Ito, which colour-blind readers can distinguish."""
LINES: dict[str, dict[str, Any]] = {"wall": {"linewidth": 2.6, "zorder": 3}, "truth": {"linewidth": 1.0, "zorder": 1}}
MARKERS: dict[str, dict[str, Any]] = {
    "TX": {"marker": "*", "s": 170, "zorder": 6, "edgecolors": "black", "linewidths": 0.6},
    "RX": {"marker": "h", "s": 34, "zorder": 5, "edgecolors": "white", "linewidths": 0.5},
    "RP": {"marker": "x", "s": 14, "zorder": 2, "linewidths": 0.8},  # under the walls that they are on
}
CURVES = ("#000000", "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00")
LOG_RATIO = 30.0
"""Ratio of medians above which an axis of errors is logarithmic; chosen."""
MAP_MARGIN = 0.08
"""Margin around a map, relative to its larger side; chosen."""
LEGEND_ABOVE: dict[str, Any] = {
    "loc": "lower left",
    "bbox_to_anchor": (0.0, 1.0),
    "frameon": False,
    "fontsize": "small",
}
"""Place of a legend over the axes, where it hides nothing."""


def new_axes(size: tuple[float, float]) -> "Axes":
    """Axes in a new figure of a given size [inch]."""
    import matplotlib.pyplot as plt

    return plt.subplots(figsize=size, layout="constrained")[1]


def draw_segments(axes: "Axes", segments: FloatArray, thing: str, label: str) -> None:
    """Draw segments (segment, 2, 2) as one collection."""
    from matplotlib.collections import LineCollection

    if len(segments):
        lines = LineCollection(list(segments), colors=PALETTE[thing], label=label, **LINES[thing])
        axes.add_collection(lines)


def draw_points(axes: "Axes", points: FloatArray, thing: str, label: str) -> None:
    """Draw points (point, 2) with the colour and marker of a thing."""
    if len(points):
        axes.scatter(*points.T, color=PALETTE[thing], label=label, **MARKERS[thing])


def fit_frame(axes: "Axes", points: FloatArray) -> None:
    """Set equal scales, and limits that show points (point, 2)."""
    axes.set_aspect("equal")
    axes.set(xlabel="East (m)", ylabel="North (m)")
    if len(points):
        low, high = points.min(axis=0), points.max(axis=0)
        margin = MAP_MARGIN * max(np.max(high - low), 1.0)
        axes.set_xlim(low[0] - margin, high[0] + margin)
        axes.set_ylim(low[1] - margin, high[1] + margin)


def legend_above(axes: "Axes") -> None:
    """Put the legend above a map."""
    handles, labels = axes.get_legend_handles_labels()
    if handles:
        above: dict[str, Any] = {"loc": "lower center", "bbox_to_anchor": (0.5, 1.0), "ncols": len(labels)}
        axes.legend(handles, labels, frameon=False, fontsize="small", **above)
