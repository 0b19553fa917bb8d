"""Figures of studies: sensed points against true ones, sectors in a DAPS. Saving is the caller's business."""

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from erm.explain import Sector
from erm.figures import CURVES, PALETTE, draw_points, draw_segments, fit_frame, new_axes
from erm.geometry import FloatArray
from erm.letter import published

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.projections.polar import PolarAxes

    from erm.letter.prediction import Prediction
    from erm.letter.sweeps import Sweep

DIRECT = "#d55e00"
SECTORS = ("#009e73", "#cc79a7", "#f0e442", "#56b4e9", "#e69f00", "#0072b2", "#999999", "#000000")
MEASURES = {
    "completeness": "Completeness",
    "point_error": "RP error (m)",
    "wall_error": "Wall error (m)",
}
RIM = 0.05  # share of the radius that the sectors' coloured rim takes


def plot_sensed_points(
    outline: FloatArray,
    true_points: FloatArray,
    sensed: FloatArray,
    *,
    tx: FloatArray,
    rx: FloatArray,
    ax: "Axes | None" = None,
) -> "Axes":
    """Draw sensed reflection points over the true ones.

    Parameters
    ----------
    outline : array (segment, 2 ends, 2)
        Known faces [m].
    true_points, sensed : array (point, 2)
        East/north [m].
    tx, rx : array (antenna, 2)
        [m].
    """
    axes = ax or new_axes((6.4, 4.0))
    draw_segments(axes, outline, "truth", "known outline")
    open_square: dict[str, Any] = {"marker": "s", "s": 36, "facecolors": "none", "edgecolors": PALETTE["RP"]}
    axes.scatter(*sensed.T, label="sensed", zorder=4, **open_square)
    cross: dict[str, Any] = {"marker": "+", "s": 30, "color": "black", "linewidths": 0.9}
    axes.scatter(*true_points.T, label="simulated", zorder=5, **cross)
    draw_points(axes, rx, "RX", "RX")
    draw_points(axes, tx, "TX", "TX")
    fit_frame(axes, outline.reshape(-1, 2))
    axes.set(xlabel="East (m)", ylabel="North (m)")
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=5, frameon=False, fontsize="small")
    return axes


def plot_sectors(sectors: Sequence[Sector], axes: "PolarAxes") -> "PolarAxes":
    """Lay sectors over a DAPS in polar form; their legend stands beside it.

    Parameters
    ----------
    sectors : sequence of Sector
        From `erm.explain.sectors`.
    axes : matplotlib.projections.polar.PolarAxes
        Of which the radius is set already; its figure should have a constrained layout.
    """
    outer = axes.get_rmax()
    rings = [radius for radius in axes.get_yticks() if radius < 0.95 * outer]
    axes.set_rmax((1 + RIM) * outer)
    axes.set_yticks(rings)
    reflectors = [name for name in dict.fromkeys(sector.name for sector in sectors) if name != "direct"]
    components = Counter[str]()  # a reflector seen under two azimuths has two sectors and one entry
    for sector in sectors:
        components[sector.name] += sector.components
    colours = {"direct": DIRECT} | {name: SECTORS[i % len(SECTORS)] for i, name in enumerate(reflectors)}
    for sector in sectors:
        start, stop = np.radians([sector.start, sector.stop])
        where: dict[str, Any] = {"x": (start + stop) / 2, "width": stop - start, "color": colours[sector.name]}
        axes.bar(height=outer, alpha=0.15, zorder=0.5, **where)
        axes.bar(height=RIM * outer, bottom=outer, label=f"{sector.name} ({components[sector.name]})", **where)
    handles, labels = axes.get_legend_handles_labels()
    first = [labels.index(label) for label in dict.fromkeys(labels)]
    figure = axes.get_figure(root=True)
    if figure is not None and first:  # beside the axes the legend would squeeze them
        shown = [handles[i] for i in first], [labels[i] for i in first]
        figure.legend(*shown, loc="outside lower center", ncols=6, frameon=False, fontsize="small")
    return axes


def plot_sweeps(sweeps: "Sequence[Sweep]") -> "Figure":
    """Draw what settings bring: a column a knob, a row a measure; dotted where the letter has it.

    Parameters
    ----------
    sweeps : sequence of Sweep
        From `erm.letter.sweeps.sweep`.
    """
    import matplotlib.pyplot as plt

    shape = len(MEASURES), len(sweeps)
    figure, grid = plt.subplots(*shape, figsize=(2.3 * shape[1] + 0.6, 5.6), sharex="col", sharey="row", squeeze=False)
    figure.set_layout_engine("constrained")
    for column, one in zip(grid.T, sweeps, strict=True):
        for axes, (measure, label) in zip(column, MEASURES.items(), strict=True):
            axes.plot(one.knob.values, [getattr(o, measure) for o in one.outcomes], "o-", color=CURVES[1], markersize=4)
            axes.axvline(one.knob.usual, color=PALETTE["truth"], linestyle=":", linewidth=1.2, zorder=0)
            axes.grid(alpha=0.3)
            if axes is column[0]:
                axes.set_ylim(0, 1.02)
            else:
                axes.set_yscale("log")
            if axes in grid[:, 0]:
                axes.set_ylabel(label)
        if min(one.knob.values) > 0:
            column[-1].set_xscale("log")
        column[-1].set_xticks(one.knob.values, [f"{value:g}" for value in one.knob.values])
        column[-1].minorticks_off()
        if one.knob.values[0] > one.knob.values[-1]:
            column[-1].invert_xaxis()  # effort grows to the right in every column
        column[-1].set_xlabel(f"{one.knob.name} ({one.knob.unit})")
    return figure


def plot_predictions(predictions: "Sequence[Prediction]") -> "Figure":
    """Draw how well maps of more and more positions predict a new route.

    Parameters
    ----------
    predictions : sequence of Prediction
        From `erm.letter.prediction.predict`.
    """
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(8.0, 3.4), layout="constrained")
    count = [one.positions for one in predictions]
    left.plot(count, [one.power for one in predictions], "o-", color=CURVES[1], label="true power that is predicted")
    left.plot(count, [one.false for one in predictions], "s--", color=CURVES[2], label="predicted power that is not")
    left.set_ylabel("Share of the reflected power")
    left.set_ylim(0, 1.02)
    left.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), frameon=False, fontsize="small")
    right.plot(count, [one.level for one in predictions], "o-", color=CURVES[1])
    right.set_ylabel("RMS error of the power (dB)")
    right.set_ylim(bottom=0)
    for axes in (left, right):
        axes.set_xlabel("Positions behind the map")
        axes.grid(alpha=0.3)
    return figure


def plot_letter_points() -> "Figure":
    """Draw the letter's published reflection points and faces: route 1 as a map, route 2 by its ordinates."""
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(9.0, 5.0), layout="constrained")
    face = published.east_north(published.EAST_BUILDING)
    along = face[1] - face[0]
    line = face[0] + np.array([[-0.25], [1.1]]) * along  # the printed points reach beyond the measured ones
    points = published.east_north(published.ROUTE_1_POINTS)
    left.plot(*line.T, color=PALETTE["truth"], linestyle="--", linewidth=1.0)
    left.plot(*face.T, color=PALETTE["truth"], linewidth=2.0, label="east building's face")
    draw_points(left, points, "RP", "published RP")
    draw_points(left, np.zeros((1, 2)), "TX", "TX")
    left.set_title("Route 1", loc="left", fontsize="medium")
    left.set_xlabel("East (m)")
    left.set_ylabel("North (m)")
    left.set_aspect("equal")
    left.set_xlim(-8, 62)
    left.legend(loc="lower left", frameon=False, fontsize="small")

    count = len(published.ROUTE_2_ORDINATES)
    for name, south in published.CORRIDOR_WALLS.items():
        right.axhline(-south, color=PALETTE["truth"], linewidth=2.0, zorder=1)
        right.annotate(name, (0.6, -south), (0, 3), textcoords="offset points", fontsize="small")
    numbered = np.column_stack([np.arange(1, count + 1), -published.ROUTE_2_ORDINATES])
    draw_points(right, numbered, "RP", "published RP")
    right.set_title("Route 2 (eastings are not printed)", loc="left", fontsize="medium")
    right.set_xlabel("number of the reflection point")
    right.set_ylabel("North (m)")
    right.set_xlim(0.5, count + 0.5)
    right.set_ylim(-69, -48)
    right.legend(loc="center right", frameon=False, fontsize="small")
    return figure
