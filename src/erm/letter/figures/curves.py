"""Curves of the letter's future work: effects of settings and positions."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from erm.figures.style import CURVES, LEGEND_ABOVE, PALETTE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from erm.letter.prediction import Predicted
    from erm.letter.sweeps import Sweep

MEASURES: dict[str, tuple[str, dict[str, str]]] = {
    "Completeness": (
        "linear",
        {
            "completeness": "MPCs as measured",
            "of_corrected": "corrected standard deviations",
            "of_exact": "without errors",
        },
    ),
    "RP error (m)": ("log", {"point_error": "MPCs on the map", "shared_error": "paths found with every value"}),
    "Wall error (m)": ("log", {"wall_error": "MPCs as measured", "wall_corrected": "corrected standard deviations"}),
}
"""Columns of a figure of sweeps: label, scale, and the curves by field of `erm.letter.sweeps.Outcome`."""
STYLES: tuple[dict[str, Any], ...] = (
    {"color": CURVES[1], "fmt": "o-"},
    {"color": CURVES[2], "fmt": "s--"},
    {"color": CURVES[3], "fmt": "^:"},
)


def plot_sweeps(sweeps: "Sequence[Sweep]") -> "Figure":
    """Draw the effect of settings: a row for each setting, a column for each measure; dotted: the letter's value.

    Bars are one standard error of the mean over the replicates.

    Parameters
    ----------
    sweeps : sequence of Sweep
        From `erm.letter.sweeps.sweep`.
    """
    import matplotlib.pyplot as plt

    shape = len(sweeps), len(MEASURES)
    height = 1.75 * shape[0] + 0.7  # inch
    # no automatic layout: legends wider than their column would move the columns apart
    room = {"left": 0.08, "right": 0.98, "bottom": 0.5 / height, "top": 1 - 0.7 / height, "wspace": 0.35, "hspace": 0.5}
    figure, grid = plt.subplots(*shape, figsize=(8.6, height), sharey="col", squeeze=False, gridspec_kw=room)
    for row, one in zip(grid, sweeps, strict=True):
        for axes, (label, (scale, curves)) in zip(row, MEASURES.items(), strict=True):
            for (field, label_of_curve), style in zip(curves.items(), STYLES, strict=False):
                mean, error = one.mean(field), one.error(field)
                axes.errorbar(
                    one.parameter.values, mean, yerr=error, label=label_of_curve, markersize=4, capsize=2, **style
                )
            axes.axvline(one.parameter.usual, color=PALETTE["truth"], linestyle=":", linewidth=1.2, zorder=0)
            axes.grid(alpha=0.3)
            axes.set_yscale(scale)
            if scale == "linear":
                axes.set_ylim(0, 1.04)
            if min(one.parameter.values) > 0:
                axes.set_xscale("log")
            axes.set_xticks(one.parameter.values, [f"{value:g}" for value in one.parameter.values])
            axes.minorticks_off()
            if one.parameter.values[0] > one.parameter.values[-1]:
                axes.invert_xaxis()  # effort grows to the right in every row
            axes.set_xlabel(f"{one.parameter.name[:1].upper()}{one.parameter.name[1:]} ({one.parameter.unit})")
            axes.set_ylabel(label)
    for axes in grid[0]:
        axes.legend(**LEGEND_ABOVE)
    return figure


def plot_predictions(predictions: "Sequence[Predicted]") -> "Figure":
    """Draw how well maps of more and more positions predict a new route.

    Bars are one standard error of the mean over maps of different positions.

    Parameters
    ----------
    predictions : sequence of Predicted
        From `erm.letter.prediction.predict`.
    """
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(8.0, 3.6), layout="constrained")
    shares = {"power": "true power that is predicted", "false": "false power", "false_cut": "false, walls cut back"}
    for (field, label), style in zip(shares.items(), STYLES, strict=True):
        _with_bars(left, predictions, field, label, style)
    left.set_ylabel("Share of the reflected power")
    left.set_ylim(0, 1.04)
    _with_bars(right, predictions, "level", "all reflected power", STYLES[0])
    right.set_ylabel("RMS error of the power (dB)")
    right.set_ylim(bottom=0)
    for axes in (left, right):
        axes.set_xlabel("Positions of the map")
        axes.grid(alpha=0.3)
        axes.legend(**LEGEND_ABOVE)
    return figure


def _with_bars(axes: "Axes", predictions: "Sequence[Predicted]", field: str, label: str, style: dict[str, Any]) -> None:
    values = [one.of(field) for one in predictions]
    mean = [float(np.mean(one)) for one in values]
    error = [float(np.std(one, ddof=1) / np.sqrt(len(one))) if len(one) > 1 else np.nan for one in values]
    count = [one.positions for one in predictions]
    axes.errorbar(count, mean, yerr=error, label=label, markersize=4, capsize=2, **style)
