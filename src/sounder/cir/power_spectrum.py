"""Delay-angular power spectrum (DAPS), its noise floor, and the profiles made from it."""

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from sounder.cir.departures import beam_overlap, power_at_arrival
from sounder.cir.false_alarm import NOISE_QUANTILE, quantile_of_noise
from sounder.instrument.antenna_pattern import Pattern
from sounder.instrument.description import Sounder
from sounder.options import BeamProfile, require_choice

PROFILES: dict[BeamProfile, str] = {
    "sum": "sum of the beams over their overlap",
    "maximum": "strongest beam in each delay bin over the boresight gain",
}
"""What each omnidirectional PDP is, for labels."""
OF_DIRECTIONS = ("coherence", "carrier_offset", "phase_drift")
"""Variables of a CIR that are kept with its power."""


def noise_power(power: NDArray[np.floating], looks: int = 1) -> NDArray[np.floating]:
    """Mean noise power of every direction, estimated from its weakest delays.

    The power of complex Gaussian noise is exponential with mean ``m``, and its quantile ``q`` is ``-m ln(1 - q)``. The
    mean of several such powers has a gamma distribution.

    Parameters
    ----------
    power : array (..., delay)
        Linear; NaN where nothing was recorded.
    looks : int
        Powers of which each is the mean; see `looks_of`.

    Returns
    -------
    array (...)
        Linear; NaN where nothing was recorded.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> float(noise_power(rng.exponential(2.0, 100_000)).round(1))
    2.0
    """
    place = int(NOISE_QUANTILE * power.shape[-1])
    quantile: NDArray[np.floating] = np.partition(power, place, axis=-1)[..., place]  # NaN sorts to the end
    return quantile / quantile_of_noise(looks)


def looks_of(cir: xr.Dataset) -> int:
    """Independent noise powers of which each sample of a CIR is the mean: 1 unless powers were averaged.

    There are as many as snapshots, if the noise of each is its own. Where an instrument repeats what it recorded, or
    what is taken for noise stays the same, there are fewer; then the floor varies more over delay than the snapshots
    promise, and a threshold for them would take much of it for paths. How much the weakest delays vary tells their
    number, as far as it is below that of the snapshots: the ratio of two quantiles of a gamma distribution rises with
    it. The median ratio of the directions is taken.
    """
    if cir.attrs.get("averaging") != "power":
        return 1
    power = np.abs(cir["cir"].values) ** 2
    low, high = (int(quantile * power.shape[-1]) for quantile in (NOISE_QUANTILE / 2, NOISE_QUANTILE))
    weakest = np.partition(power, (low, high), axis=-1)
    noisy = weakest[..., high] > 0  # neither without noise nor missing
    measured = np.median(weakest[..., low][noisy] / weakest[..., high][noisy]) if noisy.any() else 1.0
    between: NDArray[np.float64] = np.arange(1.5, int(cir.attrs["snapshots"]))
    expected = quantile_of_noise(between, NOISE_QUANTILE / 2) / quantile_of_noise(between)
    return 1 + int(np.searchsorted(expected, measured))


def daps(cir: xr.Dataset, sounder: Sounder, *, omnidirectional: BeamProfile = "sum") -> xr.Dataset:
    """Compute the DAPS of a position, its noise floor and its profiles.

    Parameters
    ----------
    cir : xarray.Dataset
        ``cir`` (azimuth, elevation, delay), from :func:`sounder.cir.impulse_response.impulse_responses`, or
        (tx_azimuth, tx_elevation, azimuth, elevation, delay).
    sounder : Sounder
        For the patterns of the antennas.
    omnidirectional : {"sum", "maximum"}
        How the omnidirectional power delay profile (PDP) is made of the beams. Both are too low for paths above or
        below the scan, by what the antenna loses toward them; :mod:`sounder.mpc.omnidirectional_pdp` is not. ``sum``
        adds the power of all beams and divides by the gain that all beams together have toward a direction of the
        scan (Sun et al.). ``maximum`` takes the strongest beam in each delay bin and divides by the boresight gain
        (Hur et al.).

    Returns
    -------
    xarray.Dataset
        ``daps`` (azimuth, elevation, delay): path gain including the receive antenna [dB]. ``noise_floor`` (azimuth,
        elevation): mean noise power [dB]. ``valid`` (azimuth, elevation): 0 where nothing was recorded, or where the
        direction is left out. ``pdp`` (delay): omnidirectional, as chosen, boresight gain removed [dB].
        ``pas`` (azimuth, elevation): power angular spectrum, the sum over the delays that are 6 dB or more above the
        noise floor [dB]. ``coherence``, ``carrier_offset`` and ``phase_drift`` (azimuth, elevation), if ``cir`` has
        them. NaN where nothing was recorded. Where the transmit antenna has several beams, all these are of the sum of
        the power over its beams over their overlap, as if it were omnidirectional, and
        ``double_directional_daps`` (tx_azimuth, tx_elevation, azimuth, elevation, delay) is the DAPS over departure and
        arrival [dB].

    References
    ----------
    Sun et al., Synthesizing omnidirectional antenna patterns, received power and path loss from directional antennas
    for 5G millimeter-wave communications, IEEE GLOBECOM 2015. Hur et al., Synchronous channel sounder using
    horn antenna and indoor measurements on 28 GHz, IEEE BlackSeaCom 2014.

    Examples
    --------
    >>> import sounder
    >>> from sounder import shipped
    >>> recordings, b2b = [shipped.calibration("recording-132ghz.h5")], shipped.calibration("back-to-back-132ghz.h5")
    >>> [job], _ = sounder.gather(recordings, calibration=b2b)
    >>> cir, remarks = sounder.impulse_responses(job.recording, sounder.calibrate(job.b2b, job.recording))
    >>> spectrum = sounder.daps(cir, job.recording.sounder)
    >>> spectrum["daps"].dims
    ('azimuth', 'elevation', 'delay')
    >>> print(f"{float(spectrum['pdp'].max()):.1f} dB")  # the direct path has a gain of -104.5 dB
    -104.5 dB
    """
    require_choice("omnidirectional", omnidirectional, BeamProfile)
    arrival = power_at_arrival(cir, sounder)
    power = arrival.power
    floor = noise_power(power, looks_of(cir) * arrival.beams)
    recorded = np.isfinite(floor)
    pattern = Pattern.of(sounder.rx_antenna)
    boresight = 10 ** (pattern.gain / 10)
    excess = np.where(power > 4 * floor[..., None], power, 0)  # 6 dB: exp(-4) = 2 % of the noise samples remain
    if omnidirectional == "sum":
        overlap = beam_overlap(cir["azimuth"].values, cir["elevation"].values, recorded, pattern)
        pdp = np.nansum(power, axis=(0, 1)) / (boresight * overlap)
    else:
        pdp = np.nanmax(power, axis=(0, 1)) / boresight
    grid = ("azimuth", "elevation")
    pas = np.where(recorded, excess.sum(axis=-1), np.nan)
    result = xr.Dataset(
        {
            "daps": ((*grid, "delay"), _db(power).astype(np.float32), _attrs("delay-angular power spectrum")),
            "noise_floor": (grid, _db(floor), _attrs("mean noise power")),
            "valid": (grid, recorded.astype(np.int8), {"long_name": "1 where the direction is used, 0 where not"}),
            "pdp": ("delay", _db(pdp), _attrs(f"omnidirectional power delay profile: {PROFILES[omnidirectional]}")),
            "pas": (grid, _db(pas), _attrs("power angular spectrum, above the noise floor")),
        },
        coords=cir.coords,
        attrs={**cir.attrs, "omnidirectional": omnidirectional, "rx_antenna_gain": pattern.gain},
    )
    for name in OF_DIRECTIONS:
        if name in cir:
            result[name] = grid, arrival.of_strongest(cir[name]), cir[name].attrs
    if arrival.links is not None:
        long_name = "delay-angular power spectrum over departure and arrival"
        values = _db(arrival.links).astype(np.float32)
        result["double_directional_daps"] = cir["cir"].dims, values, _attrs(long_name)
        result.attrs["departure_noise"] = float(10 * np.log10(arrival.beams / arrival.overlap))
    return result


def _db(power: NDArray[np.floating]) -> NDArray[np.floating]:
    with np.errstate(divide="ignore"):
        decibels: NDArray[np.floating] = 10 * np.log10(power)
    return decibels


def _attrs(long_name: str) -> dict[str, str]:
    return {"units": "dB", "long_name": long_name}
