"""Level over the noise floor that noise exceeds at a stated rate (constant false-alarm rate, CFAR)."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import betaln, gammaincc, gammaincinv

from sounder.options import Threshold

NOISE_QUANTILE = 0.25
"""Quantile of the power over delay from which the noise floor is taken; up to three quarters of the delays may hold
paths. Chosen, not derived."""


def quantile_of_noise(looks: int | NDArray[np.float64] = 1, quantile: float = NOISE_QUANTILE) -> NDArray[np.float64]:
    """Power at a quantile of the mean of ``looks`` noise powers, over its mean: ``-ln(1 - q)`` for one look."""
    return np.asarray(gammaincinv(looks, quantile) / looks, float)


@lru_cache(maxsize=256)
def false_alarm_level(rate: float, cells: int, independent: float, looks: int = 1) -> float:
    """Power over the noise floor that noise alone exceeds ``rate`` times in ``cells`` samples, on average.

    Noise power, averaged over ``looks`` snapshots, has a gamma distribution: a sample exceeds ``x`` times the true mean
    with ``P(x) = Gamma(looks, looks x) / Gamma(looks)``, ``exp(-x)`` for one look. The floor is not the true mean, but
    an order statistic of the samples of a beam over its expectation. The quantile ``u`` of an order statistic of ``n``
    independent samples has the density ``Beta(q n, (1 - q) n + 1)``, and the level is where the mean of ``P`` over that
    is ``rate / cells`` (order-statistic CFAR). The fewer samples a beam has, the higher it is. Neighbouring samples
    exceed it together, so that the rate of false paths is lower than stated.

    Parameters
    ----------
    rate : float
        False alarms allowed.
    cells : int
        Samples of all beams.
    independent : float
        Independent noise samples of a beam.
    looks : int
        Powers that were averaged.

    Returns
    -------
    float
        Linear.

    References
    ----------
    Rohling, Radar CFAR thresholding in clutter and multiple target situations, IEEE Trans. Aerosp. Electron. Syst.
    19(4), 1983.

    Examples
    --------
    For 108 beams of 1022 samples, half of them independent, and for 65534 samples a beam [dB]:

    >>> [f"{10 * np.log10(false_alarm_level(0.05, 108 * n, n / 2)):.1f}" for n in (1022, 65534)]
    ['11.9', '12.7']
    """
    a, b = NOISE_QUANTILE * independent, (1 - NOISE_QUANTILE) * independent + 1
    logit = np.log(NOISE_QUANTILE / (1 - NOISE_QUANTILE)) + np.linspace(-12, 12, 2001) / np.sqrt(min(a, b))
    u = 1 / (1 + np.exp(-logit))
    density = np.exp(a * np.log(u) + b * np.log1p(-u) - betaln(a, b))
    weight = density / density.sum()
    floor = gammaincinv(looks, u) / gammaincinv(looks, NOISE_QUANTILE) * looks
    low, high = 0.0, 1e6
    for _ in range(60):  # halves the interval of the logarithm to rounding
        middle = np.expm1((np.log1p(low) + np.log1p(high)) / 2)
        if weight @ gammaincc(looks, middle * floor) > rate / cells:
            low = middle
        else:
            high = middle
    return float(high)


def noise_margin(threshold: Threshold, cells: int, independent: float, looks: int = 1) -> float:
    """Level of a threshold over the noise floor [dB]: its own, or that of its false alarms.

    Parameters
    ----------
    threshold : Threshold
    cells, independent, looks
        As for `false_alarm_level`.
    """
    if threshold.noise_margin is not None:
        return threshold.noise_margin
    return float(10 * np.log10(false_alarm_level(threshold.false_alarms, max(cells, 1), independent, looks)))
