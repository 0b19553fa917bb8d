"""Empirical distribution functions of errors."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from erm.figures.style import CURVES, LEGEND_ABOVE, LOG_RATIO, new_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def plot_error_cdf(
    errors: Mapping[str, npt.ArrayLike], *, colours: Mapping[str, str] | None = None, ax: "Axes | None" = None
) -> "Axes":
    """Draw the empirical distribution function of errors, one curve per label.

    Parameters
    ----------
    errors : mapping of str to array (point,)
        Errors [m] by label.
    colours : mapping of str to str, optional
        Colours by label, to give a thing the same colour in several figures.
    ax : matplotlib Axes, optional
        Where to draw; default: a new figure.
    """
    axes = ax or new_axes((5.2, 3.8))
    for (label, values), colour in zip(errors.items(), CURVES, strict=False):
        ordered = np.sort(np.asarray(values, dtype=float))
        steps = np.r_[ordered[:1], ordered]
        rmse = np.sqrt(np.mean(ordered**2)) if len(ordered) else np.nan
        axes.step(
            steps,
            np.arange(len(steps)) / max(len(ordered), 1),
            where="post",
            color=(colours or {}).get(label, colour),
            label=f"{label} (n = {len(ordered)}, RMSE {rmse:.2g} m)",
        )
    axes.set_xlabel("Error (m)")
    axes.set_ylabel("Share of reflection points")
    axes.set_ylim(0, 1.02)
    typical = [float(np.median(np.asarray(values))) for values in errors.values() if np.size(values)]
    if typical and max(typical) > LOG_RATIO * min(typical) > 0:  # only a logarithmic axis shows both
        axes.set_xscale("log")
    else:
        axes.set_xlim(left=0)
    axes.grid(alpha=0.3)
    axes.legend(**LEGEND_ABOVE)
    return axes
