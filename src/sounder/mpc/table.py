"""The table of MPCs: the paths found in physical units, with their errors and remarks."""

from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from erm.common.constants import SAME_DELAY, c
from sounder.mpc.cramer_rao import UNITS
from sounder.mpc.directions import DB_PER_NEPER
from sounder.mpc.scan import Scan
from sounder.mpc.stated import stated_variance

LARGEST_STD = np.array([np.inf, 180.0, 90.0, np.inf]) / np.sqrt(3)
"""Standard deviations of azimuths and elevations of which nothing is known: they are uniform [degree]."""
WRAPPED_FLAGS = {"flag_values": np.array([0, 1], np.int8), "flag_meanings": "within_one_period may_be_a_period_longer"}
"""Attributes of the CF conventions for ``may_be_wrapped``."""

Real = NDArray[np.float64]
Paths = NDArray[np.record]


def tabulate(found: Paths, scan: Scan, distance: float, *, inflation: Real, clock: Real, pattern: Real) -> xr.Dataset:
    """Table of the paths found.

    The covariance is that of the least-squares fits, with the noise power as variance, or the fit's own residual where
    that exceeds the noise. The variance of the delay is ``N V / sum_b a_b^2`` with the path's amplitude ``a_b`` in a
    beam, the noise power ``N``, and ``V`` the ``delay_variance`` of `sounder.cir.matched_filter.MatchedFilter`. With a
    phase of its own in every beam it is independent of the others. Both are inflated for other paths, and that of the
    delay includes the clock's. Those of elevation and gain include other directions outside the fan that the beams do
    not exclude. What the description states about calibration, survey and antennas is added; see
    :func:`sounder.mpc.stated.stated_variance`.

    Parameters
    ----------
    found : array of `sounder.kernels.extraction.records.PATH` (mpc,)
    scan : Scan
    distance : float
        Direct distance from TX to RX [m].
    inflation : array (mpc, 2)
        From :func:`sounder.mpc.uncertainty.variance_inflation`.
    clock : array (mpc,)
        From :func:`sounder.mpc.clock.clock_variance` [s2].
    pattern : array (mpc, 3, 3)
        From :func:`sounder.mpc.stated.pattern_covariance`.

    Returns
    -------
    xarray.Dataset
        Along ``mpc``: ``delay`` [s], in the one period that begins with the direct path; ``azimuth``, ``elevation``
        [degree], the latter NaN if the scan has one elevation; ``path_gain`` [dB] without antennas; ``delay_std``,
        ``azimuth_std``, ``elevation_std``, ``path_gain_std``; ``clock_std`` [s], the part of ``delay_std`` that the
        MPCs of the position share, nearly; ``covariance`` (mpc, parameter, other), in the units of the four; ``snr``
        [dB] of the peak in the beam that sees the path best; ``misfit``, the residual power of the fits in magnitudes
        of neighbouring beams and in samples about the peak, over that of the noise: about 1 for one path in noise, and
        what errors of the pattern make in a fit of several paths;
        and ``may_be_wrapped``, 1 where the path is so weak that its delay may be longer by a period.
    """
    several_elevations = scan.elevation.size > 1
    rate, antenna = scan.filter_.sample_rate, scan.antenna
    noise, amplitude = scan.noise[found["beam"]], found["amplitude"]
    period = scan.period / rate
    earliest = distance / c - SAME_DELAY
    delay = earliest + (found["delay"] / rate - earliest) % period
    gain = 20 * np.log10(amplitude) - antenna.gain
    covariance = _covariance(found, noise, scan, inflation)
    covariance[:, 0, 0] += clock
    covariance[:, range(4), range(4)] += stated_variance(scan.sounder, delay)
    covariance[:, 1:, 1:] += pattern
    least_known = np.minimum(1.0, LARGEST_STD / np.sqrt(np.maximum(np.diagonal(covariance, axis1=1, axis2=2), 1e-300)))
    covariance *= least_known[:, :, None] * least_known[:, None, :]
    if not several_elevations:
        covariance[:, 2, :] = covariance[:, :, 2] = np.nan
    values = {
        "delay": (delay, "s", "propagation delay"),
        "azimuth": (found["azimuth"] % 360, "degree", "azimuth of arrival, counter-clockwise from east"),
        "elevation": (
            found["elevation"] if several_elevations else np.full(len(found), np.nan),
            "degree",
            "elevation of arrival above the horizon",
        ),
        "path_gain": (gain, "dB", "path gain, antennas removed"),
    }
    std = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    for i, name in enumerate(UNITS):
        values[f"{name}_std"] = std[:, i], values[name][1], f"standard deviation of {name.replace('_', ' ')}"
    values["clock_std"] = np.sqrt(clock), "s", "standard deviation of the clock, part of delay_std"
    snr = 20 * np.log10(amplitude * found["beam_gain"]) - 10 * np.log10(noise)
    values["snr"] = snr, "dB", "peak power over noise power in the best beam"
    values["misfit"] = _misfit(found, noise), "1", "residual power of the fit over noise power"
    free_space = 20 * np.log10(c / (4 * np.pi * scan.sounder.carrier.frequency * c * (delay + period)))
    weak = (gain - 2 * std[:, 3] < free_space).astype(np.int8)
    values["may_be_wrapped"] = weak, "1", "1 where free space allows a delay longer by one period"
    columns: dict[str, tuple[str, Real, dict[str, Any]]] = {
        name: ("mpc", value, {"units": units, "long_name": long_name})
        for name, (value, units, long_name) in values.items()
    }
    for name in UNITS:
        columns[name][2]["ancillary_variables"] = f"{name}_std"
    columns["may_be_wrapped"][2].update(WRAPPED_FLAGS)
    matrix = (
        ("mpc", "parameter", "other"),
        covariance,
        {"units": "1", "long_name": "covariance of the parameters, in products of their units"},
    )
    return xr.Dataset({**columns, "covariance": matrix}, coords={"parameter": list(UNITS), "other": list(UNITS)})


def _misfit(found: Paths, noise: Real) -> Real:
    """Mean of the misfits in angle and in delay, of those that are known."""
    angle, delay = found["misfit"], found["residual_power"] / noise
    both: Real = np.where(delay > 0, np.where(np.isnan(angle), delay, (angle + delay) / 2), angle)
    return both


def _covariance(found: Paths, noise: Real, scan: Scan, inflation: Real) -> Real:
    """Covariance (mpc, 4, 4) of delay [s], azimuth, elevation [degree] and gain [dB]."""
    energy = found["amplitude"] ** 2 * found["pattern_energy"]
    db_per_amplitude = DB_PER_NEPER / found["amplitude"]
    covariance = np.zeros((len(found), 4, 4))
    unit_variance = scan.filter_.matched_filter.delay_variance
    covariance[:, 0, 0] = inflation[:, 0] * noise * unit_variance / energy / scan.filter_.sample_rate**2
    elevation, amplitude = found["elevation_spread"], found["amplitude_spread"]
    for i, j, name, scale, spread in (
        (1, 1, "azimuth_variance", 1.0, 0.0),
        (2, 2, "elevation_variance", 1.0, elevation**2),
        (3, 3, "amplitude_variance", db_per_amplitude**2, amplitude**2),
        (1, 2, "azimuth_elevation", 1.0, 0.0),
        (1, 3, "azimuth_amplitude", db_per_amplitude, 0.0),
        (2, 3, "elevation_amplitude", db_per_amplitude, elevation * amplitude),
    ):
        covariance[:, i, j] = covariance[:, j, i] = (inflation[:, 1] * (found[name] - spread) + spread) * scale
    return covariance
