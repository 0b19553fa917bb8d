"""What a fit found, as the table of MPCs: units, errors, and what to think of each."""

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from erm.common.constants import c
from sounder.cir.deembedding import Deembedding
from sounder.instrument.description import Sounder
from sounder.kernels.extraction import columns as component

DIRECT_GUARD = 1e-9
"""How much earlier than the direct path an MPC may come before its delay counts as wrapped [s]."""
PARAMETERS = ("delay", "azimuth", "elevation", "path_gain")
NEPER = 20 / np.log(10)
"""Decibels a unit of the amplitude's logarithm."""

Real = NDArray[np.float64]


def tabulate(
    found: Real,
    noise: Real,
    filter_: Deembedding,
    sounder: Sounder,
    distance: float,
    *,
    wider: Real,
    clock: Real,
    fans: bool,
) -> xr.Dataset:
    """Table of the paths found.

    The covariance is that of the least-squares fits, with the noise power as variance, or the fit's own residual where
    that is more than noise leaves. The delay's is ``N V / sum_b a_b^2`` with the path's amplitude ``a_b`` in a beam,
    the noise power ``N``, and ``V`` of :class:`sounder.cir.matched_filter.MatchedFilter`; with a phase of its own in
    every beam it is independent of the others. Both are widened for other paths, and the delay's holds the clock's.
    Those of elevation and gain reach, besides, to directions outside the fan that the beams do not exclude.

    Parameters
    ----------
    found : array (mpc, component.COLUMNS)
        From :func:`sounder.kernels.extraction.sage.cancel`.
    noise : array (beam,)
        Noise power.
    filter_ : Deembedding
    sounder : Sounder
        For the gain of the receive antenna and the carrier.
    distance : float
        Direct distance [m].
    wider : array (mpc, 2)
        From :func:`sounder.mpc.uncertainty.widened`.
    clock : array (mpc,)
        From :func:`sounder.mpc.clock.clock_variance` [s2].
    fans : bool
        Whether the scan has several elevations.

    Returns
    -------
    xarray.Dataset
        Along ``mpc``: ``delay`` [s], in the one period that begins with the direct path; ``azimuth``, ``elevation``
        [degree], NaN without ``fans``; ``path_gain`` [dB] without antennas; ``delay_std``, ``azimuth_std``,
        ``elevation_std``, ``path_gain_std``; ``clock_std`` [s], the part of ``delay_std`` that all MPCs of the
        position share, nearly; ``covariance`` (mpc, parameter, other), in the units of the four;
        ``snr`` [dB] of the peak in the beam that saw it best; ``misfit``, the power that the fit left in
        magnitudes of neighbouring beams and in samples about the peak, over that of the noise: about 1 for one path
        in noise; and ``may_be_wrapped``, 1 where the path is so weak that it may be one of a
        period more.
    """
    beam = found[:, component.BEAM].astype(int)
    amplitude = found[:, component.AMPLITUDE]
    delay = found[:, component.DELAY] / filter_.sample_rate
    period = filter_.weight.size / filter_.sample_rate
    earliest = distance / c - DIRECT_GUARD
    delay = earliest + (delay - earliest) % period
    gain = 20 * np.log10(amplitude) - sounder.rx_antenna.gain
    covariance = _covariance(found, noise[beam], filter_, wider)
    covariance[:, 0, 0] += clock
    if not fans:
        covariance[:, 2, :] = covariance[:, :, 2] = np.nan
    values = {
        "delay": (delay, "s", "propagation delay"),
        "azimuth": (found[:, component.AZIMUTH] % 360, "degree", "azimuth of arrival, counter-clockwise from east"),
        "elevation": (
            found[:, component.ELEVATION] if fans else np.full(len(found), np.nan),
            "degree",
            "elevation of arrival above the horizon",
        ),
        "path_gain": (gain, "dB", "path gain, antennas removed"),
    }
    std = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    for i, name in enumerate(PARAMETERS):
        values[f"{name}_std"] = std[:, i], values[name][1], f"standard deviation of {name.replace('_', ' ')}"
    values["clock_std"] = np.sqrt(clock), "s", "standard deviation of the clock, part of delay_std"
    seen = amplitude * found[:, component.OFF_BORESIGHT]
    values["snr"] = 20 * np.log10(seen) - 10 * np.log10(noise[beam]), "dB", "peak over noise power in the best beam"
    values["misfit"] = _misfit(found, noise[beam]), "1", "residual power of the fit over that of the noise"
    later = 20 * np.log10(c / (4 * np.pi * sounder.carrier.frequency * c * (delay + period)))
    weak = (gain - 2 * std[:, 3] < later).astype(np.int8)
    values["may_be_wrapped"] = weak, "1", "1 where free space allows a delay longer by a period"
    columns = {
        name: ("mpc", value, {"units": units, "long_name": long_name})
        for name, (value, units, long_name) in values.items()
    }
    matrix = (
        ("mpc", "parameter", "other"),
        covariance,
        {"units": "1", "long_name": "covariance of the parameters, in products of their units"},
    )
    return xr.Dataset(
        {**columns, "covariance": matrix}, coords={"parameter": list(PARAMETERS), "other": list(PARAMETERS)}
    )


def _misfit(found: Real, noise: Real) -> Real:
    """Mean of the residuals in angle and in delay, where there are any."""
    angle, delay = found[:, component.MISFIT], found[:, component.LEFT_OVER] / noise
    both: Real = np.where(delay > 0, np.where(np.isnan(angle), delay, (angle + delay) / 2), angle)
    return both


def _covariance(found: Real, noise: Real, filter_: Deembedding, wider: Real) -> Real:
    """Covariance (mpc, 4, 4) of delay [s], azimuth, elevation [degree] and gain [dB]."""
    energy = found[:, component.AMPLITUDE] ** 2 * found[:, component.ENERGY]
    per_amplitude = NEPER / found[:, component.AMPLITUDE]
    covariance = np.zeros((len(found), 4, 4))
    covariance[:, 0, 0] = wider[:, 0] * noise * filter_.matched_filter.delay_variance / energy / filter_.sample_rate**2
    up, stronger = found[:, component.ELEVATION_SPREAD], found[:, component.AMPLITUDE_SPREAD]
    for i, j, column, scale, spread in (
        (1, 1, component.VAR_AZIMUTH, 1.0, 0.0),
        (2, 2, component.VAR_ELEVATION, 1.0, up**2),
        (3, 3, component.VAR_AMPLITUDE, per_amplitude**2, stronger**2),
        (1, 2, component.AZIMUTH_ELEVATION, 1.0, 0.0),
        (1, 3, component.AZIMUTH_AMPLITUDE, per_amplitude, 0.0),
        (2, 3, component.ELEVATION_AMPLITUDE, per_amplitude, up * stronger),
    ):
        covariance[:, i, j] = covariance[:, j, i] = (wider[:, 1] * (found[:, column] - spread) + spread) * scale
    return covariance
