"""Path loss of positions, and its fits over distance: close-in and floating-intercept."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaincinv, stdtrit

from erm.common.constants import c

CONFIDENCE = 0.95
"""Probability that an interval holds the true value, if shadowing is normal and independent [1]."""

Real = NDArray[np.float64]
Interval = tuple[float, float]
UNKNOWN = (float("nan"), float("nan"))


def path_loss(power: Real) -> Real:
    """Omnidirectional path loss: ``-10 lg sum_i G_i`` with the path gains ``G_i`` without antennas.

    Parameters
    ----------
    power : array (..., path)
        Linear.

    Returns
    -------
    array (...)
        [dB]; NaN without power.

    Examples
    --------
    >>> print(path_loss(np.array([5e-11, 5e-11])))
    100.0
    """
    total = power.sum(axis=-1)
    return np.asarray(np.where(total > 0, -10 * np.log10(np.where(total > 0, total, 1)), np.nan))


def free_space_path_loss(distance: Real | float, frequency: Real | float) -> Real:
    """Loss in free space between isotropic antennas: ``20 lg(4 pi d f / c)`` [dB], of metres and hertz (Friis)."""
    return np.asarray(20 * np.log10(4 * np.pi * np.asarray(distance) * frequency / c))


@dataclass(frozen=True)
class Fit:
    """Fit of path loss over distance.

    Attributes
    ----------
    positions : int
        Positions that were fitted.
    intercept : float
        Path loss at 1 m [dB]; of the close-in model that of free space, the mean if frequencies differ.
    exponent : float
        Path loss exponent: a tenth of the path loss of a decade of distance [1].
    shadowing : float
        Standard deviation about the fit, ``sqrt(sum x^2 / N)`` [dB].
    intercept_interval, exponent_interval, shadowing_interval : (float, float)
        Confidence intervals. Those of the shadowing are of the deviation with ``N`` minus the number of fitted
        parameters in the denominator.
    """

    positions: int
    intercept: float
    exponent: float
    shadowing: float
    intercept_interval: Interval = UNKNOWN
    exponent_interval: Interval = UNKNOWN
    shadowing_interval: Interval = UNKNOWN


def close_in(distance: Real, loss: Real, frequency: Real | float) -> Fit:
    """Fit the close-in model: ``L = FSPL(f, 1 m) + 10 n lg(d / 1 m) + X``.

    With ``D = 10 lg d`` and ``A = L - FSPL(f, 1 m)``: ``n = sum(A D) / sum(D^2)``, which minimises the shadowing ``X``.

    Source: S. Sun et al., Investigation of prediction accuracy, sensitivity, and parameter stability of large-scale
    propagation path loss models for 5G wireless communications, IEEE Trans. Veh. Technol. 65 (2016) 2843-2860.

    Parameters
    ----------
    distance, loss : array (position,)
        [m], [dB]; positions without a path loss (NaN) are left out.
    frequency : float or array (position,)
        [Hz]

    Returns
    -------
    Fit
        NaN without positions, and for intervals of one position.

    Examples
    --------
    >>> distance = np.array([10.0, 100.0, 200.0])
    >>> loss = free_space_path_loss(1.0, 132e9) + 10 * 2.1 * np.log10(distance)
    >>> print(f"{close_in(distance, loss, 132e9).exponent:.2f}")
    2.10
    """
    free = np.broadcast_to(free_space_path_loss(1.0, frequency), np.shape(loss))
    distance, loss, free = _known(distance, loss, free)
    decades = 10 * np.log10(distance)
    energy = np.sum(decades**2)
    if not energy > 0:
        return Fit(loss.size, float("nan"), float("nan"), float("nan"))
    exponent = float(np.sum((loss - free) * decades) / energy)
    residual = loss - free - exponent * decades
    spread, deviation = _shadowing(residual, 1)
    return Fit(
        loss.size,
        float(free.mean()),
        exponent,
        float(np.sqrt(np.mean(residual**2))),
        exponent_interval=_interval(exponent, spread / np.sqrt(energy), loss.size - 1),
        shadowing_interval=deviation,
    )


def floating_intercept(distance: Real, loss: Real) -> Fit:
    """Fit the floating-intercept model: ``L = alpha + 10 beta lg(d / 1 m) + X`` (least squares).

    Sources: Sun et al. (2016); 3GPP calls it the alpha-beta model. It is a description of the distances that were
    measured, not of others.

    Parameters
    ----------
    distance, loss : array (position,)
        [m], [dB]; positions without a path loss (NaN) are left out.

    Returns
    -------
    Fit
        NaN if there are fewer than two distances, and for intervals of two positions.

    Examples
    --------
    >>> fit = floating_intercept(np.array([10.0, 100.0, 1000.0]), np.array([90.0, 120.0, 150.0]))
    >>> print(f"{fit.intercept:.1f} dB, {fit.exponent:.2f}")
    60.0 dB, 3.00
    """
    distance, loss = _known(distance, loss)
    decades = 10 * np.log10(distance)
    centred = decades - decades.mean() if decades.size else decades
    energy = np.sum(centred**2)
    # distances that agree to rounding are one distance
    if not energy > np.finfo(float).eps * np.sum(decades**2):
        return Fit(loss.size, float("nan"), float("nan"), float("nan"))
    exponent = float(np.sum(loss * centred) / energy)
    intercept = float(loss.mean() - exponent * decades.mean())
    residual = loss - intercept - exponent * decades
    spread, deviation = _shadowing(residual, 2)
    at_one_metre = np.sqrt(1 / loss.size + decades.mean() ** 2 / energy)
    return Fit(
        loss.size,
        intercept,
        exponent,
        float(np.sqrt(np.mean(residual**2))),
        intercept_interval=_interval(intercept, spread * at_one_metre, loss.size - 2),
        exponent_interval=_interval(exponent, spread / np.sqrt(energy), loss.size - 2),
        shadowing_interval=deviation,
    )


def _known(*columns: Real) -> tuple[Real, ...]:
    """Positions with a path loss and a distance."""
    known = np.all([np.isfinite(column) for column in columns], axis=0) & (np.asarray(columns[0]) > 0)
    return tuple(np.asarray(column, float)[known] for column in columns)


def _shadowing(residual: Real, fitted: int) -> tuple[float, Interval]:
    """Unbiased deviation of the residuals, and its interval from the chi-squared distribution."""
    freedom = residual.size - fitted
    if freedom < 1:
        return float("nan"), UNKNOWN
    energy = float(np.sum(residual**2))
    low, high = (2 * float(gammaincinv(freedom / 2, (1 + sign * CONFIDENCE) / 2)) for sign in (-1, 1))
    return float(np.sqrt(energy / freedom)), (float(np.sqrt(energy / high)), float(np.sqrt(energy / low)))


def _interval(value: float, std: float, freedom: int) -> Interval:
    """Interval from Student's distribution."""
    if freedom < 1:
        return UNKNOWN
    half = float(stdtrit(freedom, (1 + CONFIDENCE) / 2)) * std
    return value - half, value + half
