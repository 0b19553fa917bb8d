"""Parameters of delay: mean excess delay, RMS delay spread, maximum excess delay, coherence bandwidth.

Every function takes powers that need not be normalised. Paths of power 0 do not count. Without any power the result is
NaN. None changes if all powers are scaled, or all delays are shifted.

Sources: Recommendation ITU-R P.1407 (sections as in P.1407-6 and later).
"""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

GRID = 0.02
"""Steps of the search for the coherence bandwidth: the correlation changes by no more than this in a step [1]."""
SEARCHED = 100.0
"""The coherence bandwidth is searched up to this many times ``1 / (2 pi S)``, with the RMS delay spread ``S``."""

Real = NDArray[np.float64]


def _shares(power: Real) -> Real:
    """Powers (..., path) over their sum; NaN without power."""
    total = power.sum(axis=-1, keepdims=True)
    return np.where(total > 0, power / np.where(total > 0, total, 1), np.nan)


def mean_excess_delay(delay: Real, power: Real) -> Real:
    """Mean delay after the first path: ``T = sum_i p_i (t_i - t_first)`` with shares ``p_i`` of the power.

    Source: ITU-R P.1407, section 2.2.2 (average delay).

    Parameters
    ----------
    delay : array (..., path)
        [s]
    power : array (..., path)
        Linear.

    Returns
    -------
    array (...)
        [s]; 0 for one path, NaN for none.

    Examples
    --------
    >>> print(mean_excess_delay(np.array([1e-7, 2e-7]), np.array([3.0, 1.0])))
    2.5e-08
    """
    first = np.where(power > 0, delay, np.inf).min(axis=-1, keepdims=True, initial=np.inf)
    excess = np.where(power > 0, delay - np.where(np.isfinite(first), first, 0), 0)
    return np.asarray((_shares(power) * excess).sum(axis=-1) if power.shape[-1] else np.full(power.shape[:-1], np.nan))


def rms_delay_spread(delay: Real, power: Real) -> Real:
    """RMS delay spread: ``S = sqrt(sum_i p_i (t_i - T)^2)`` with ``T = sum_i p_i t_i``.

    Source: ITU-R P.1407, section 2.2.3; TR 38.901, Table 7.5-6 (DS).

    Parameters
    ----------
    delay : array (..., path)
        [s]
    power : array (..., path)
        Linear.

    Returns
    -------
    array (...)
        [s]; 0 for one path, NaN for none.

    Examples
    --------
    >>> print(rms_delay_spread(np.array([1e-7, 3e-7]), np.array([1.0, 1.0])))
    1e-07
    """
    if not power.shape[-1]:
        return np.full(power.shape[:-1], np.nan)
    share = _shares(power)
    centred = delay - np.nansum(share * delay, axis=-1, keepdims=True)
    return np.asarray(np.sqrt((share * centred**2).sum(axis=-1)))


def maximum_excess_delay(delay: Real, power: Real) -> Real:
    """Delay from the first path to the last, of those with power.

    With the paths down to a level under the strongest, this is the delay interval of ITU-R P.1407, section 2.2.5.

    Parameters
    ----------
    delay : array (..., path)
        [s]
    power : array (..., path)
        Linear.

    Returns
    -------
    array (...)
        [s]; 0 for one path, NaN for none.

    Examples
    --------
    >>> print(maximum_excess_delay(np.array([1e-7, 3e-7, 9e-7]), np.array([1.0, 0.1, 0.0])))
    2e-07
    """
    first = np.where(power > 0, delay, np.inf).min(axis=-1, initial=np.inf)
    last = np.where(power > 0, delay, -np.inf).max(axis=-1, initial=-np.inf)
    return np.asarray(np.where(last >= first, last - first, np.nan))


def frequency_correlation(delay: Real, power: Real, frequency: float | Real) -> Real:
    """Magnitude of the correlation of the channel at two frequencies: ``|sum_i p_i exp(-j 2 pi f t_i)|``.

    The phases of the paths are taken as independent and uniform (uncorrelated scattering).

    Source: ITU-R P.1407, section 5.2.1 (4.2.1 in P.1407-5).

    Parameters
    ----------
    delay, power : array (..., path)
        [s], linear.
    frequency : float or array
        Separation of the frequencies [Hz]; an array must broadcast with (...).

    Returns
    -------
    array (...)
        0 to 1; NaN without power.

    Examples
    --------
    >>> print(frequency_correlation(np.array([0, 1e-7]), np.array([1.0, 1.0]), 2.5e6).round(6))
    0.707107
    """
    if not power.shape[-1]:
        return np.full(power.shape[:-1], np.nan)
    share = _shares(power)
    centred = delay - np.nansum(share * delay, axis=-1, keepdims=True)  # keeps the phases small
    turns = np.asarray(frequency)[..., None] * centred
    return np.asarray(np.abs((share * np.exp(-2j * np.pi * turns)).sum(axis=-1)))


def coherence_bandwidth(delay: Real, power: Real, level: float = 0.5) -> float:
    """Smallest separation of two frequencies at which their correlation has fallen to a level.

    It is at least ``arccos(level) / (2 pi S)`` with the RMS delay spread ``S`` (Fleury 1996), where the search begins.
    Two equal paths ``T`` apart have ``|cos(pi f T)|``, and reach this bound.

    Sources: ITU-R P.1407, section 5.2.1. B. H. Fleury, An uncertainty relation for WSS processes and its application to
    WSSUS systems, IEEE Trans. Communications 44 (1996) 1632-1634.

    Parameters
    ----------
    delay, power : array (path,)
        [s], linear.
    level : float
        Between 0 and 1; 0.5, 0.7 and 0.9 are usual.

    Returns
    -------
    float
        [Hz]; infinite if the correlation does not fall to the level up to :data:`SEARCHED` times ``1 / (2 pi S)``, as
        with one path or a strong one, and NaN without power.

    Examples
    --------
    >>> print(f"{coherence_bandwidth(np.array([0, 1e-7]), np.array([1.0, 1.0])) / 1e6:.4f} MHz")
    3.3333 MHz
    """
    spread = float(rms_delay_spread(delay, power))
    if np.isnan(spread):
        return float("nan")
    if spread == 0 or 2 * power.max() / power.sum() - 1 > level:  # the others cannot cancel the strongest so far
        return float("inf")
    unit = 1 / (2 * np.pi * spread)
    first = np.arccos(level) * unit
    edges = np.arange(0, SEARCHED * unit, GRID * unit) + first * (1 - 1e-9)
    for some in np.array_split(edges, max(len(edges) // 256, 1)):
        below = np.flatnonzero(frequency_correlation(delay, power, some) <= level)
        if below.size:
            high = some[below[0]]
            low = max(high - GRID * unit, first * (1 - 1e-9))

            def over_level(frequency: float) -> float:
                return float(frequency_correlation(delay, power, frequency)) - level

            return float(brentq(over_level, low, high, xtol=1e-12 * high)) if over_level(low) > 0 else float(low)
    return float("inf")
