"""Figures of a score: what was found and how far off it was, against SNR and against the distance to the next path.

Every function draws into the axes it is given and returns them; saving is the caller's business.
"""

from itertools import pairwise
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from scipy.special import erf

from sounder.score import Score

Against = Literal["snr", "separation"]

BINS = {
    "snr": np.arange(0.0, 81.0, 5.0),
    "separation": np.array([0, 0.25, 0.5, 1, 1.5, 2, 3, 4, 6, 8, 12, 16, 32]),
}
LABELS = {"snr": "SNR in the best beam (dB)", "separation": "Distance to the next path ({delay:g} ns, {azimuth:g}°)"}
ERRORS = {
    "delay": ("Delay error (ns)", 1e9),
    "azimuth": ("Azimuth error (°)", 1.0),
    "elevation": ("Elevation error (°)", 1.0),
    "path_gain": ("Path gain error (dB)", 1.0),
}
"""Label of the axis, and its units in the table's."""
MPC_COLOUR = "#d55e00"
SUMMARY_COLOUR = "#0072b2"
FEWEST = 3
"""Paths a bin must hold to have an RMS error."""


def detection(score: Score, ax: Axes, *, against: Against = "snr") -> Axes:
    """Draw the share of the required paths that were found, with its 68 % interval (Wilson) and the number of paths.

    Parameters
    ----------
    score : sounder.score.Score
    ax : matplotlib.axes.Axes
    against : {"snr", "separation"}
    """
    required = score.paths.isel(path=np.flatnonzero(score.paths["required"].values))
    place, found = required[against].values, required["match"].values >= 0
    edges = BINS[against]
    for low, high in pairwise(edges):
        inside = (place >= low) & (place < high)
        count = int(inside.sum())
        if not count:
            continue
        share = float(found[inside].mean())
        middle, half = _wilson(share, count)
        ax.errorbar(
            (low + high) / 2,
            share,
            yerr=[[max(share - middle + half, 0.0)], [max(middle + half - share, 0.0)]],
            xerr=(high - low) / 2,
            fmt="o",
            color=SUMMARY_COLOUR,
            markersize=4,
        )
        ax.annotate(str(count), ((low + high) / 2, 0.02), ha="center", fontsize="x-small")
    ax.set(xlabel=_label(score, against), ylabel="Share of paths found", ylim=(0, 1.05))
    ax.grid(alpha=0.3)
    return ax


def errors(score: Score, ax: Axes, *, parameter: str = "delay", against: Against = "snr") -> Axes:
    """Draw the absolute errors of the required paths that were found, and their RMS in bins.

    Parameters
    ----------
    score : sounder.score.Score
    ax : matplotlib.axes.Axes
    parameter : {"delay", "azimuth", "elevation", "path_gain"}
    against : {"snr", "separation"}
    """
    label, scale = ERRORS[parameter]
    judged = score.paths.isel(path=np.flatnonzero(score.paths["required"].values))
    place, error = judged[against].values, np.abs(judged[f"{parameter}_error"].values) * scale
    known = np.isfinite(place) & np.isfinite(error)
    place, error = place[known], error[known]
    smallest = error[error > 0].min(initial=np.inf)
    ax.plot(place, np.maximum(error, smallest), ".", color=MPC_COLOUR, alpha=0.5, markersize=4, label="path")
    edges = BINS[against]
    index = np.digitize(place, edges) - 1
    bins = [i for i in range(edges.size - 1) if np.count_nonzero(index == i) >= FEWEST]
    rms = [float(np.sqrt(np.mean(error[index == i] ** 2))) for i in bins]
    ax.plot([(edges[i] + edges[i + 1]) / 2 for i in bins], rms, "o-", color=SUMMARY_COLOUR, markersize=4, label="RMS")
    if error.any():
        ax.set_yscale("log")
    ax.set(xlabel=_label(score, against), ylabel=label)
    ax.grid(alpha=0.3)
    ax.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, frameon=False, borderaxespad=0.1)
    return ax


def normalised(score: Score, ax: Axes) -> Axes:
    """Draw how many errors are within so many standard deviations, beside what normal errors would give.

    Parameters
    ----------
    score : sounder.score.Score
    ax : matplotlib.axes.Axes
    """
    judged = score.paths.isel(path=np.flatnonzero(score.paths["required"].values))
    for (parameter, (label, _)), style in zip(ERRORS.items(), ("-", "--", "-.", ":"), strict=True):
        told = np.abs(judged[f"{parameter}_normalised"].values)
        told = np.sort(told[np.isfinite(told)])
        if told.size:
            name = label.partition(" error")[0]
            ax.step(told, np.arange(1, told.size + 1) / told.size, style, where="post", color=MPC_COLOUR, label=name)
    wide = np.linspace(0, 4, 81)
    ax.plot(wide, erf(wide / np.sqrt(2)), color=SUMMARY_COLOUR, label="normal")
    ax.set(xlabel="Error (standard deviations)", ylabel="Share within", xlim=(0, 4), ylim=(0, 1.05))
    ax.grid(alpha=0.3)
    ax.legend(loc="lower right", fontsize="small")
    return ax


def _label(score: Score, against: Against) -> str:
    return LABELS[against].format(delay=score.gates.delay * 1e9, azimuth=score.gates.azimuth)


def _wilson(share: float, count: int) -> tuple[float, float]:
    """Middle and half width of the 68 % interval of a share (Wilson, J. Am. Stat. Assoc. 22 (1927) 209)."""
    middle = (share + 0.5 / count) / (1 + 1 / count)
    return middle, float(np.sqrt(share * (1 - share) / count + 0.25 / count**2) / (1 + 1 / count))
