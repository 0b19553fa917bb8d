"""K-factor by named methods [dB]: power of one path over that of the others."""

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]


def k_strongest(power: Real) -> Real:
    """Power of the strongest path over that of all others.

    It needs no line of sight: USC's power ratio of the strongest MPC, kappa.

    Parameters
    ----------
    power : array (..., path)
        Linear.

    Returns
    -------
    array (...)
        [dB]; infinite for one path, NaN for none.

    Examples
    --------
    >>> print(k_strongest(np.array([10.0, 0.5, 0.5])))
    10.0
    """
    return _ratio(power, power.max(axis=-1, initial=0.0))


def k_los(power: Real, direct: NDArray[np.bool_]) -> Real:
    """Power of the direct path over that of all others.

    Source: TR 38.901, Table 7.5-6 (K), as the ratio of the LoS ray to the other rays, Eq. (7.5-30).

    Parameters
    ----------
    power : array (..., path)
        Linear.
    direct : array (path,)
        Whether a path is direct.

    Returns
    -------
    array (...)
        [dB]; infinite if there is no other path, NaN if there is no direct one.

    Examples
    --------
    >>> print(k_los(np.array([1.0, 10.0]), np.array([True, False])))
    -10.0
    """
    return _ratio(power, np.where(direct, power, 0).sum(axis=-1))


def k_moments(power: Real) -> Real:
    """K-factor from the first two moments of a power that fades: of snapshots, positions or frequencies.

    ``K = sqrt(M^2 - V) / (M - sqrt(M^2 - V))`` with the mean ``M`` and the variance ``V`` of the samples.

    Source: L. J. Greenstein, D. G. Michelson, V. Erceg, Moment-method estimation of the Ricean K-factor, IEEE
    Communications Lett. 3 (1999) 175-176, Eqs. 6-8.

    Parameters
    ----------
    power : array (..., sample)
        Linear, of samples that fade alike; with noise far below the signal, since noise counts as fading.

    Returns
    -------
    array (...)
        [dB]; infinite if nothing fades, -inf if the power varies by its mean or more (Rayleigh fading, or beyond Rice),
        NaN for fewer than two samples.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> fading = rng.normal(size=(200_000, 2)) @ [1, 1j] / np.sqrt(2)
    >>> print(k_moments(np.abs(2 + fading) ** 2).round(1))  # 4 = 6.0 dB
    6.0
    """
    if power.shape[-1] < 2:
        return np.full(power.shape[:-1], np.nan)
    mean, variance = power.mean(axis=-1), power.var(axis=-1, ddof=1)
    steady = np.sqrt(np.maximum(mean**2 - variance, 0))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(10 * np.log10(steady / (mean - steady)))


def _ratio(power: Real, one: Real) -> Real:
    """One path over the others [dB]; NaN if it has no power."""
    rest = np.maximum(power.sum(axis=-1) - one, 0)
    # of one path alone the difference is rounding
    rest = np.where(rest > power.shape[-1] * np.finfo(float).eps * one, rest, 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(one > 0, 10 * np.log10(one) - 10 * np.log10(rest), np.nan))
