"""Delay-angular power spectrum (DAPS), its noise floor, and the profiles made from it."""

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from sounder.instrument.antenna_pattern import Pattern
from sounder.instrument.description import Sounder
from sounder.options import Omnidirectional

QUANTILE = 0.25
"""Quantile of the power over delay that the noise floor is read from; up to three quarters may hold paths."""


def noise_power(power: NDArray[np.floating]) -> NDArray[np.floating]:
    """Mean noise power of every direction, from its quietest delays.

    The power of complex Gaussian noise is exponential with mean ``m``, and its quantile ``q`` is ``-m ln(1 - q)``.

    Parameters
    ----------
    power : array (..., delay)
        Linear; NaN where nothing was recorded.

    Returns
    -------
    array (...)
        Linear.
    """
    place = int(QUANTILE * power.shape[-1])
    quantile: NDArray[np.floating] = np.partition(power, place, axis=-1)[..., place]  # NaN sorts to the end
    return quantile / -np.log1p(-QUANTILE)


def daps(cir: xr.Dataset, sounder: Sounder, *, omnidirectional: Omnidirectional = "sum") -> xr.Dataset:
    """Build the DAPS of a position.

    Parameters
    ----------
    cir : xarray.Dataset
        ``cir`` (azimuth, elevation, delay), from :func:`sounder.cir.impulse_response.impulse_responses`.
    sounder : Sounder
        For the receive antenna's pattern.
    omnidirectional : {"sum", "maximum"}
        How the omnidirectional PDP is made. ``sum`` adds the power of all beams and divides by the gain that they
        together have toward a direction of the scan (Sun et al.); ``maximum`` takes the strongest beam in each delay
        bin and divides by the boresight gain (Hur et al.).

    Returns
    -------
    xarray.Dataset
        ``daps`` (azimuth, elevation, delay), path gain including the receive antenna [dB]; ``noise_floor`` (azimuth,
        elevation) [dB]; ``pdp`` (delay), omnidirectional, antenna removed [dB]; ``pas`` (azimuth, elevation), power
        over all delays above the noise floor [dB]; ``coherence`` (azimuth, elevation) where the CIRs have it. NaN
        where nothing was recorded.

    References
    ----------
    Sun et al., Synthesizing omnidirectional antenna patterns, received power and path loss from directional antennas
    for 5G millimeter-wave communications, IEEE GLOBECOM 2015. Hur et al., Synchronous channel sounder using
    horn antenna and indoor measurements on 28 GHz, IEEE BlackSeaCom 2014.
    """
    power = np.abs(cir["cir"].values).astype(float) ** 2
    floor = noise_power(power)
    recorded = np.isfinite(floor)
    pattern = Pattern.of(sounder.rx_antenna)
    boresight = 10 ** (pattern.gain / 10)
    excess = np.where(power > 4 * floor[..., None], power, 0)  # 6 dB: 2 % of the noise remains
    if omnidirectional == "sum":
        overlap = _overlap(cir["azimuth"].values, cir["elevation"].values, recorded, pattern)
        pdp = np.nansum(power, axis=(0, 1)) / (boresight * overlap)
    else:
        pdp = np.nanmax(power, axis=(0, 1)) / boresight
    grid = ("azimuth", "elevation")
    # The scan adds the noise of all its beams; a sum that holds nothing has no level.
    pas = np.where(recorded, excess.sum(axis=-1), np.nan)
    result = xr.Dataset(
        {
            "daps": ((*grid, "delay"), _db(power).astype(np.float32), _attrs("delay-angular power spectrum")),
            "noise_floor": (grid, _db(floor), _attrs("mean noise power")),
            "pdp": ("delay", _db(pdp), _attrs("omnidirectional power delay profile")),
            "pas": (grid, _db(pas), _attrs("power angular spectrum")),
        },
        coords=cir.coords,
        attrs={**cir.attrs, "omnidirectional": omnidirectional, "rx_antenna_gain": pattern.gain},
    )
    if "coherence" in cir:
        result["coherence"] = cir["coherence"]
    return result


def _overlap(
    azimuth: NDArray[np.float64], elevation: NDArray[np.float64], recorded: NDArray[np.bool_], pattern: Pattern
) -> float:
    """Relative gain of all recorded beams together toward a direction of the scan, averaged over the scan."""
    a, e = (grid[recorded] for grid in np.meshgrid(azimuth, elevation, indexing="ij"))
    gains = 10 ** (pattern.beam_gain(a[:, None], e[:, None], a[None, :], e[None, :]) / 10)
    return float(gains.sum(axis=1).mean())


def _db(power: NDArray[np.floating]) -> NDArray[np.floating]:
    with np.errstate(divide="ignore"):
        decibels: NDArray[np.floating] = 10 * np.log10(power)
    return decibels


def _attrs(long_name: str) -> dict[str, str]:
    return {"units": "dB", "long_name": long_name}
