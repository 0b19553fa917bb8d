"""Numbers of arrays as JSON takes them, rounded to what the page shows."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

ELLIPSE_SHARE = 0.95
"""Probability that an ellipse holds the true point."""


def rounded(values: ArrayLike, digits: int) -> Any:
    """Nested lists of numbers; what is not finite is None.

    Examples
    --------
    >>> rounded([1.2345, np.nan], 2)
    [1.23, None]
    """
    array = np.asarray(values, float)
    known: NDArray[np.object_] = np.atleast_1d(np.round(array, digits)).astype(object)
    known[~np.isfinite(np.atleast_1d(array))] = None
    return known.reshape(array.shape).tolist()


def with_error(value: float | None, std: float | None) -> str:
    """Write a value and its standard deviation to the second digit of the latter; a dash if the value is not known.

    Examples
    --------
    >>> with_error(12.3456, 0.012), with_error(12.3456, None)
    ('12.346 ± 0.012', '12.35')
    """
    if value is None:
        return "–"
    if not std:
        return f"{value:.2f}"
    digits = max(1 - int(np.floor(np.log10(std))), 0)
    return f"{value:.{digits}f} ± {std:.{digits}f}"


def ellipse(covariance: NDArray[np.float64]) -> list[float] | None:
    """Semi-axes [m] and angle of the first [degree] of the ellipse of :data:`ELLIPSE_SHARE`; None if it is not known.

    A normal point in the plane is within ``q`` standard deviations with the probability ``1 - exp(-q^2 / 2)``.

    Parameters
    ----------
    covariance : array (2, 2)
        [m^2]

    Examples
    --------
    >>> ellipse(np.diag([4.0, 1.0]))
    [4.895, 2.448, 0.0]
    """
    if not np.isfinite(covariance).all() or not np.any(covariance):
        return None
    variances, axes = np.linalg.eigh(covariance)
    q = np.sqrt(-2 * np.log(1 - ELLIPSE_SHARE))
    angle = np.degrees(np.arctan2(axes[1, 1], axes[0, 1]))
    small, large = np.sqrt(np.maximum(variances, 0)) * q
    return [round(float(large), 3), round(float(small), 3), round(float((angle + 90) % 180 - 90), 1)]
