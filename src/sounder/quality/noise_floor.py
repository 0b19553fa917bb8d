"""Noise floors of the directions: what is at the input of the receiver does not depend on where the horn points."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from erm.common.significance import FALSE_ALARM
from sounder.cir.false_alarm import NOISE_QUANTILE

Real = NDArray[np.float64]

LEAST_TREND = 1.0
"""Smallest change of the noise floor over a scan that counts as a change of the gain [dB]. Chosen; the noise of strong
signals changes the floors of some directions by less."""
DISTINCT_GAIN = 3.0
"""Difference from the usual gain from which a direction shows the sign of the gains [dB]: ten times the error of a
floor."""
MIN_DISTINCT = 3
"""Fewest such directions; chosen."""
SIGNAL_TO_PEAK = 13.0
"""Peak over the floor that noise alone reaches never in practice [dB]: exp(-20) a sample, 2e-6 in a capture of 1022."""


def floor_std(noise_density: Real) -> float:
    """Standard deviation of a noise floor that is a quantile over delay [dB].

    The quantile ``q`` of ``n`` exponential powers has the relative standard deviation
    ``sqrt(q / ((1 - q) n)) / -ln(1 - q)``. Noise of the density ``S`` has ``n = N mean(S)^2 / mean(S^2)`` independent
    ones among ``N`` samples.

    Parameters
    ----------
    noise_density : array (sample,)
        Behind the de-embedding filter.

    Examples
    --------
    >>> round(floor_std(np.ones(1000)), 2)
    0.28
    """
    independent = noise_density.size * noise_density.mean() ** 2 / np.mean(noise_density**2)
    relative = np.sqrt(NOISE_QUANTILE / (1 - NOISE_QUANTILE) / independent) / -np.log1p(-NOISE_QUANTILE)
    return float(10 / np.log(10) * relative)


@dataclass(frozen=True)
class NoiseFloors:
    """Noise floors of a scan against what the gain settings say.

    Attributes
    ----------
    level : float
        Floor that the directions have in common [dB].
    excess : array (direction,)
        Floor of each direction over it [dB]; NaN where nothing was recorded.
    bound : float
        Largest excess, of either sign, of a clean direction [dB].
    fall : float
        Change of the gain from the first to the last direction [dB], removed from ``excess``; 0 if not significant.
    sign : int
        -1 if the floors agree with gains of the opposite sign only; otherwise 1.
    """

    level: float
    excess: Real
    bound: float
    fall: float
    sign: int

    @classmethod
    def of(cls, floor: Real, agc_gain: Real, order: NDArray[np.int64], std: float) -> "NoiseFloors":
        """Compare floors.

        Parameters
        ----------
        floor : array (direction,)
            Mean noise power at the antenna [dB]: the gains are removed.
        agc_gain : array (direction,)
            [dB]
        order : array (direction,)
            Number of each direction in the order of the scan.
        std : float
            Standard deviation of a clean floor [dB].
        """
        known = np.isfinite(floor)
        if not known.any():  # captures without any noise
            return cls(np.nan, np.zeros(floor.shape), np.inf, 0.0, 1)
        # a median of n Gaussian values has the variance pi / (2 n); the trend shares the false alarms
        count = int(known.sum())
        quantile = -float(ndtri(FALSE_ALARM / (count + 1) / 2))
        bound = std * np.sqrt(1 + np.pi / 2 / count) * quantile
        sign = 1
        if _follows_gain(floor[known], agc_gain[known], bound):
            sign, floor = -1, floor + 2 * agc_gain
        level, slope = _line(order[known], floor[known])
        fall = slope * (floor.size - 1)
        # A trend is a change of the gain only if it explains the floors: a few bad directions are none.
        residual = floor - level - slope * order
        # between medians of thirds, over two thirds of the scan
        significant = max(LEAST_TREND, quantile * 1.5 * std * np.sqrt(np.pi / 2 * 2 / (count / 3)))
        if abs(fall) < significant or _scatter(residual[known]) > 2 * std:
            level, fall = float(np.median(floor[known])), 0.0
            residual = floor - level
        return cls(level, residual, bound, fall, sign)


def _scatter(values: Real) -> float:
    """Robust standard deviation."""
    return float(1.4826 * np.median(np.abs(values - np.median(values))))


def _follows_gain(floor: Real, agc_gain: Real, bound: float) -> bool:
    """Whether floors agree with gains of the opposite sign only: it was removed with the wrong sign."""
    usual = np.median(agc_gain) if agc_gain.size else 0.0
    other = np.abs(agc_gain - usual) > DISTINCT_GAIN
    if other.sum() < MIN_DISTINCT:
        return False
    reference = other if other.all() else ~other
    stated, opposite = (
        np.abs(changed[other] - np.median(changed[reference])) < bound for changed in (floor, floor + 2 * agc_gain)
    )
    return bool(opposite.sum() > 3 * stated.sum() and 2 * opposite.sum() > other.sum())


def _line(x: NDArray[np.int64], y: Real) -> tuple[float, float]:
    """Line through the medians of the first and the last third: value at 0, and slope."""
    if x.size < 9:
        return float(np.median(y)), 0.0
    ranks = np.argsort(x)
    first, last = ranks[: x.size // 3], ranks[-(x.size // 3) :]
    slope = (np.median(y[last]) - np.median(y[first])) / (np.median(x[last]) - np.median(x[first]))
    return float(np.median(y - slope * x)), float(slope)
