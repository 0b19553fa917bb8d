"""Figures of channel parameters: distribution functions, and path loss over distance with its fits."""

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from erm.figures.style import LEGEND_ABOVE
from sounder.parameters.catalogue import PARAMETERS, READ_IN
from sounder.parameters.path_loss import free_space_path_loss
from sounder.parameters.statistics import FITS, LINES_OF_SIGHT, Statistic

SHOWN = (
    "rms_delay_spread", "azimuth_spread_arrival", "zenith_spread_arrival", "k_strongest", "mpcs", "coherence_bandwidth",
)  # fmt: skip
"""Parameters whose distributions a figure shows by default."""
MARGIN = 5.0
"""Of the axis of path loss beyond the positions [dB]. Chosen; not derived."""
STYLES = {"LoS": ("#0072b2", "-", "o"), "NLoS": ("#d55e00", "--", "^"), "unknown": ("#000000", "-.", "s")}
"""Colour (Okabe and Ito), line and marker of a group, which black and white print tells apart, too."""


def parameter_cdf(parameters: xr.Dataset, name: str, ax: Axes) -> Axes:
    """Draw the empirical distribution functions of a parameter with and without line of sight.

    Positions without a value are left out, infinite ones count as larger than all: the function does not reach 1.

    Parameters
    ----------
    parameters : xarray.Dataset
        From :func:`sounder.channel_parameters`.
    name : str
        One of `sounder.parameters.catalogue.PARAMETERS`.
    ax : matplotlib.axes.Axes

    Examples
    --------
    >>> table = xr.Dataset({"rms_delay_spread": ("position", [1e-8, 3e-8, 2e-8]), "los": ("position", [1, 1, 0])})
    >>> axes = parameter_cdf(table, "rms_delay_spread", Figure().add_subplot())
    >>> [line.get_label() for line in axes.lines], axes.get_xlabel()
    (['LoS (2)', 'NLoS (1)'], 'RMS delay spread (ns)')
    """
    about = PARAMETERS[name]
    scale, unit = READ_IN.get(about.unit, (1.0, about.unit))
    for value, group in LINES_OF_SIGHT.items():
        values = parameters[name].values[parameters["los"].values == value] * scale
        values = np.sort(values[~np.isnan(values)])
        if values.size:
            finite = values[np.isfinite(values)]
            infinite = f", {values.size - finite.size} infinite" if finite.size < values.size else ""
            label, (colour, line, _) = f"{group} ({values.size}{infinite})", STYLES[group]
            steps, shares = np.r_[finite[:1], finite], np.arange(finite.size + 1) / values.size
            ax.step(steps, shares, where="post", color=colour, linestyle=line, label=label)
    text, unit = about.text[0].upper() + about.text[1:], unit.replace("degree", "°")
    ax.set(xlabel=f"{text} ({unit})" if unit else text, ylabel="Share of positions", ylim=(0, 1.02))
    ax.grid(alpha=0.3)
    if ax.lines:
        ax.legend(loc="lower right", fontsize="small")
    return ax


def path_loss(parameters: xr.Dataset, statistics: Sequence[Statistic], ax: Axes) -> Axes:
    """Draw path loss over distance with standard deviations, its fits, and free space.

    Parameters
    ----------
    parameters : xarray.Dataset
        From :func:`sounder.channel_parameters`.
    statistics : sequence of Statistic
        From :func:`sounder.campaign_statistics`.
    ax : matplotlib.axes.Axes
    """
    known = {(one.group, one.parameter, one.statistic): one.value for one in statistics}
    distance, loss = parameters["distance"].values, parameters["path_loss"].values
    used = np.isfinite(loss) & (distance > 0)
    if not used.any():
        return ax
    reach = np.geomspace(distance[used].min() * 0.9, distance[used].max() * 1.1, 50)
    for value, group in LINES_OF_SIGHT.items():
        rows = used & (parameters["los"].values == value)
        if not rows.any():
            continue
        colour, _, marker = STYLES[group]
        error = np.nan_to_num(parameters["path_loss_std"].values[rows]) if "path_loss_std" in parameters else None
        ax.errorbar(distance[rows], loss[rows], error, fmt=marker, color=colour, markersize=4, elinewidth=0.8)
        for model, line in zip(FITS, ("-", "--"), strict=True):
            exponent, intercept, shadowing = (
                known.get((group, model, part), np.nan) for part in ("exponent", "intercept", "shadowing")
            )
            if np.isfinite([exponent, intercept]).all():
                label = "n" if model == "path_loss_close_in" else "β"
                name = model.removeprefix("path_loss_").replace("_", " ")
                ax.plot(
                    reach,
                    intercept + 10 * exponent * np.log10(reach),
                    color=colour,
                    linestyle=line,
                    linewidth=1,
                    label=f"{group}, {name}: {label} = {exponent:.2f}, σ = {shadowing:.1f} dB",
                )
    frequency = float(np.median(parameters["frequency"].values[used]))
    ax.plot(reach, free_space_path_loss(reach, frequency), color="#8c8c8c", linewidth=1, label="free space")
    ax.set(xscale="log", xlabel="Distance TX-RX (m)", ylabel="Path loss (dB)")
    ax.set_ylim(loss[used].min() - MARGIN, loss[used].max() + MARGIN)  # one bad error bar does not hide the rest
    ax.xaxis.set_major_formatter("{x:g}")
    ax.xaxis.set_minor_formatter("{x:g}")
    ax.grid(alpha=0.3, which="both")
    ax.tick_params(axis="x", which="both", length=3)  # numbers of both in one row
    ax.legend(**LEGEND_ABOVE)  # within the axes it would hide positions
    return ax


def cdf_page(parameters: xr.Dataset, names: Sequence[str] = SHOWN) -> Figure:
    """Draw the distribution functions of several parameters, one panel each; of those that any position has."""
    shown = [name for name in names if name in parameters and np.isfinite(parameters[name].values).any()]
    rows = max(-(-len(shown) // 3), 1)
    figure = Figure(figsize=(9.6, 2.9 * rows), layout="constrained")
    panels = np.ravel(figure.subplots(rows, 3))
    for name, ax in zip(shown, panels, strict=False):
        parameter_cdf(parameters, name, ax)
    for ax in panels[len(shown) :]:
        ax.remove()
    return figure
