"""Figures of a score: detection and errors over the SNR and over the distance to the next path.

Every function draws into the axes that it is given, and returns them.
"""

from itertools import pairwise
from typing import Literal

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import NDArray
from scipy.special import erf

from sounder.figures.products import MPC_COLOUR
from sounder.mpc.score import Score

Against = Literal["snr", "separation"]

BINS = {"snr": np.arange(0.0, 81.0, 5.0), "separation": np.geomspace(0.1, 1000, 13)}
"""Edges of the bins: steps of 5 dB, and three bins for each decade."""
LABELS = {"snr": "SNR in the best beam (dB)", "separation": "Distance to the next path ({delay:g} ns, {azimuth:g}°)"}
ERRORS = {
    "delay": ("Delay error (ns)", 1e9),
    "azimuth": ("Azimuth error (°)", 1.0),
    "elevation": ("Elevation error (°)", 1.0),
    "path_gain": ("Path gain error (dB)", 1.0),
}
"""Label of the axis, and its unit relative to that of the table."""
SUMMARY_COLOUR = "#0072b2"
MIN_PATHS = 3
"""Paths that a bin must hold for an RMS error. Chosen; not derived."""


def detection(score: Score, ax: Axes, *, against: Against = "snr") -> Axes:
    """Draw the share of required paths that were found, with its 68 % interval (Wilson) and the number of paths.

    Parameters
    ----------
    score : sounder.mpc.score.Score
    ax : matplotlib.axes.Axes
    against : {"snr", "separation"}
    """
    required = score.paths.isel(path=np.flatnonzero(score.paths["required"].values))
    place, found = _place(required, against), required["match"].values >= 0
    edges = BINS[against]
    for low, high in pairwise(edges):
        inside = (place >= low) & (place < high)
        count = int(inside.sum())
        if not count:
            continue
        share = float(found[inside].mean())
        centre, half = _wilson(share, count)
        middle = _middle(low, high, against)
        ax.errorbar(
            middle,
            share,
            xerr=[[middle - low], [high - middle]],
            yerr=[[max(share - centre + half, 0.0)], [max(centre + half - share, 0.0)]],
            fmt="o",
            color=SUMMARY_COLOUR,
            markersize=4,
        )
        ax.annotate(str(count), (middle, 0.02), ha="center", fontsize="x-small")
    _abscissa(score, ax, against)
    ax.set(ylabel="Share of paths found", ylim=(0, 1.05))
    ax.grid(alpha=0.3)
    return ax


def errors(score: Score, ax: Axes, *, parameter: str = "delay", against: Against = "snr") -> Axes:
    """Draw the absolute errors of required paths that were found, and the RMS in each bin.

    Parameters
    ----------
    score : sounder.mpc.score.Score
    ax : matplotlib.axes.Axes
    parameter : {"delay", "azimuth", "elevation", "path_gain"}
    against : {"snr", "separation"}
    """
    label, scale = ERRORS[parameter]
    required = score.paths.isel(path=np.flatnonzero(score.paths["required"].values))
    place, error = _place(required, against), np.abs(required[f"{parameter}_error"].values) * scale
    known = np.isfinite(place) & np.isfinite(error)
    place, error = place[known], error[known]
    ax.plot(place, error, ".", color=MPC_COLOUR, alpha=0.5, markersize=4, label="path")
    edges = BINS[against]
    index = np.digitize(place, edges) - 1
    bins = [i for i in range(edges.size - 1) if np.count_nonzero(index == i) >= MIN_PATHS]
    rms = [float(np.sqrt(np.mean(error[index == i] ** 2))) for i in bins]
    middle = [_middle(edges[i], edges[i + 1], against) for i in bins]
    ax.plot(middle, rms, "o-", color=SUMMARY_COLOUR, markersize=4, label="RMS")
    if error.any():
        # a few errors are tiny by chance; they must not set the scale
        ax.set_yscale("log")
        ax.set_ylim(bottom=np.quantile(error[error > 0], 0.05) / 2)
    _abscissa(score, ax, against)
    ax.set(ylabel=label)
    ax.grid(alpha=0.3)
    ax.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, frameon=False, borderaxespad=0.1)
    return ax


def normalised(score: Score, ax: Axes) -> Axes:
    """Draw the distribution of errors in standard deviations, and that of normal errors.

    Parameters
    ----------
    score : sounder.mpc.score.Score
    ax : matplotlib.axes.Axes
    """
    required = score.paths.isel(path=np.flatnonzero(score.paths["required"].values))
    for (parameter, (label, _)), style in zip(ERRORS.items(), ("-", "--", "-.", ":"), strict=True):
        values = np.abs(required[f"{parameter}_normalised"].values)
        values = np.sort(values[np.isfinite(values)])
        if values.size:
            name = label.partition(" error")[0]
            ax.step(
                values, np.arange(1, values.size + 1) / values.size, style, where="post", color=MPC_COLOUR, label=name
            )
    deviations = np.linspace(0, 4, 81)
    ax.plot(deviations, erf(deviations / np.sqrt(2)), color=SUMMARY_COLOUR, label="normal")
    ax.set(xlabel="Error (standard deviations)", ylabel="Share within", xlim=(0, 4), ylim=(0, 1.05))
    ax.grid(alpha=0.3)
    ax.legend(loc="lower right", fontsize="small")
    return ax


def _place(paths: xr.Dataset, against: Against) -> NDArray[np.float64]:
    """Abscissa of paths; distances below the first edge are drawn there."""
    values: NDArray[np.float64] = paths[against].values
    return values if against == "snr" else np.maximum(values, BINS[against][0])


def _middle(low: float, high: float, against: Against) -> float:
    return (low + high) / 2 if against == "snr" else float(np.sqrt(low * high))


def _abscissa(score: Score, ax: Axes, against: Against) -> None:
    label = LABELS[against].format(delay=score.gates.delay * 1e9, azimuth=score.gates.azimuth)
    ax.set(xlabel=label, xscale="linear" if against == "snr" else "log")


def _wilson(share: float, count: int) -> tuple[float, float]:
    """Centre and half width of the 68 % interval of a share (Wilson, J. Am. Stat. Assoc. 22 (1927) 209)."""
    middle = (share + 0.5 / count) / (1 + 1 / count)
    return middle, float(np.sqrt(share * (1 - share) / count + 0.25 / count**2) / (1 + 1 / count))
