"""Multipath components (MPCs): delay, angle of arrival and path gain of the paths in a CIR, with their errors."""

from typing import Literal

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.constants import c

from sounder.antenna import Pattern
from sounder.calibration import Deembedding
from sounder.config import Sounder
from sounder.daps import noise_power
from sounder.kernels import component
from sounder.kernels.cancel import Limits, cancel, search_of
from sounder.kernels.view import View, beams_of, table_of
from sounder.matched import OVER, Matched

Threshold = Literal["usc", "nyu"]

CAPACITY = 1024
"""Most MPCs a position can have."""
MARGIN = 2.0
"""Amplitude over the pattern's prediction that still counts as the same path (6 dB, for horns not as measured)."""
LEFTOVER = 0.1
"""Amplitude, relative to a path in its beam, under which what a fit leaves around it is its own remainder (-20 dB)."""
DYNAMIC_RANGE = 75.0
"""How far under the strongest sample a path can be told from what cancellation leaves of others [dB]."""
PASSES = 2
"""Rounds of fitting each path again with all the others taken out."""
LOCATED = 3.0
"""How far over the pattern's sidelobes a path must stand in its beam for its angle to be believed [dB]."""
DIRECT_GUARD = 1e-9
"""How much earlier than the direct path an MPC may come before its delay counts as wrapped [s]."""


def extract(
    cir: xr.Dataset,
    filter_: Deembedding,
    sounder: Sounder,
    *,
    distance: float = 0.0,
    threshold: Threshold = "usc",
) -> xr.Dataset:
    """Extract the MPCs of a position.

    The strongest sample of all beams is refined to a path: its delay, and its magnitudes in the beam and the eight
    around it, by the matched filter of the calibrated pulse; its angles and amplitude by fitting the antenna's
    pattern to these magnitudes. Then the path is taken out of every beam, sidelobes in delay and angle with it, and
    the search starts again, until nothing exceeds the threshold. Paths that share samples are fitted again in turn.

    Standard deviations are those of the least-squares fits, with the larger of the noise power and the fit's own
    residual as variance; for the delay ``std = sqrt(P V / sum_b a_b^2)`` with the path's amplitude ``a_b`` in a beam,
    ``P`` the noise power or what the fit left around the path, and ``V`` of :class:`sounder.matched.Matched`. Those of
    elevation and gain reach, besides, to directions outside the fan that the beams do not exclude. Errors of one path
    alone are up to 1.14 times the Cramer-Rao bound.

    Parameters
    ----------
    cir : xarray.Dataset
        ``cir`` (azimuth, elevation, delay), from :func:`sounder.correlate.impulse_responses`.
    filter_ : Deembedding
        That made it; its pulse is the shape of a single path.
    sounder : Sounder
        For the receive antenna's pattern and the period.
    distance : float
        Direct distance from TX to RX [m]. Delays are known modulo the sequence's period; no path is shorter than the
        direct one, so earlier ones are late by a period.
    threshold : {"usc", "nyu"}
        ``usc``: noise floor + 12 dB, which noise alone exceeds once in 7 million samples (Gomez-Ponce et al.).
        ``nyu``: the higher of strongest - 25 dB and noise floor + 5 dB (Sun et al.); noise alone exceeds the second
        in 4 % of the samples, so that weak positions fill with noise.

    Returns
    -------
    xarray.Dataset
        Along ``mpc``, strongest first, possibly none: ``delay`` [s], ``azimuth``, ``elevation`` [degree],
        ``path_gain`` [dB] without antennas, and ``delay_std``, ``azimuth_std``, ``elevation_std``,
        ``path_gain_std``. The elevation is NaN where the scan has one elevation only. The attribute
        ``paths_outside_fan`` counts the paths left out because only sidelobes saw them, so that their angle is not
        known; ``complete`` is 0 if more paths exceed the threshold than a table holds.
    """
    azimuth, elevation = cir["azimuth"].values, cir["elevation"].values
    beams = np.array(cir["cir"].values.reshape(azimuth.size * elevation.size, -1), np.complex64, order="C")
    noise = noise_power(np.abs(beams) ** 2).astype(float)
    matched = filter_.matched
    pattern = Pattern.of(sounder.rx_antenna)
    width_azimuth = sounder.rx_antenna.hpbw_azimuth or 360.0
    width_elevation = sounder.rx_antenna.hpbw_elevation or 180.0
    view = _view(azimuth, elevation, noise, pattern, matched, width_azimuth, width_elevation)
    bandwidth = np.ptp(np.fft.fftfreq(filter_.weight.size, 1 / filter_.sample_rate)[filter_.weight > 0])
    limits = Limits(
        threshold=_thresholds(beams, noise, threshold),
        resolution=np.array([filter_.sample_rate / bandwidth, width_azimuth / 2, width_elevation]),
        leftover=np.array([LEFTOVER, MARGIN, 10 ** (pattern.sidelobe_level / 20) if pattern.directive else 0.0]),
        margin=MARGIN,
    )
    work = component.work_of(view)
    found = np.zeros((CAPACITY, component.COLUMNS))
    taken = np.zeros((CAPACITY, len(beams)), np.complex64)
    count, complete = cancel(beams, view, limits, PASSES, work, search_of(beams, work), found, taken)
    found = found[:count][np.argsort(-found[:count, component.AMPLITUDE])]
    located = _located(found, pattern) & ~(found[:, component.AZIMUTH_STD] > width_azimuth / 2)
    table = _table(found[located], noise, matched, filter_.sample_rate, sounder, distance, fans=elevation.size > 1)
    return table.assign_attrs(threshold=threshold, paths_outside_fan=int((~located).sum()), complete=int(complete))


def _view(
    azimuth: NDArray[np.float64],
    elevation: NDArray[np.float64],
    noise: NDArray[np.float64],
    pattern: Pattern,
    matched: Matched,
    width_azimuth: float,
    width_elevation: float,
) -> View:
    looks = np.stack([grid.ravel() for grid in np.meshgrid(azimuth, elevation, indexing="ij")], axis=-1).astype(float)
    step_azimuth = float(np.diff(azimuth).max()) if azimuth.size > 1 else 0.0
    around = azimuth.size > 1 and azimuth[0] + 360 - azimuth[-1] <= 1.5 * step_azimuth
    return View(
        beam=beams_of(noise, looks),
        azimuth_cut=table_of(pattern.azimuth_cut),
        elevation_cut=table_of(pattern.elevation_cut),
        pulse=matched.pulse,
        matched=matched.matched,
        limits=np.array(
            [
                max(step_azimuth, width_azimuth / 2),
                elevation.min() - 2 * width_elevation,
                elevation.max() + 2 * width_elevation,
                width_elevation,
                pattern.floor * np.log(10) / 20,
                matched.amplitude_variance,
            ]
        ),
        grid=np.array([azimuth.size, elevation.size, int(around), OVER]),
    )


def _located(found: NDArray[np.float64], pattern: Pattern) -> NDArray[np.bool_]:
    """Tell the paths whose direction the main lobe has seen.

    A path far above or below the fan is seen through the sidelobes, alike by all beams; its delay is right, its angle
    is not known.
    """
    if not pattern.directive:
        return np.ones(len(found), bool)
    least = 10 ** ((pattern.sidelobe_level + LOCATED) / 20)
    located: NDArray[np.bool_] = found[:, component.OFF_BORESIGHT] > least
    return located


def _thresholds(beams: NDArray[np.complex64], noise: NDArray[np.float64], threshold: Threshold) -> NDArray[np.float64]:
    """Least power of a path in every beam; infinite where nothing was recorded."""
    strongest = float(np.max(np.abs(beams), where=np.isfinite(beams), initial=0.0)) ** 2
    if threshold == "usc":
        level = np.maximum(strongest * 10 ** (-DYNAMIC_RANGE / 10), noise * 10**1.2)
    else:
        level = np.maximum(strongest * 10**-2.5, noise * 10**0.5)
    return np.where(np.isfinite(noise), level, np.inf)


def _table(
    found: NDArray[np.float64],
    noise: NDArray[np.float64],
    matched: Matched,
    sample_rate: float,
    sounder: Sounder,
    distance: float,
    *,
    fans: bool,
) -> xr.Dataset:
    delay = found[:, component.DELAY] / sample_rate
    period = sounder.waveform.period
    earliest = distance / c - DIRECT_GUARD
    delay = earliest + (delay - earliest) % period
    amplitude = found[:, component.AMPLITUDE]
    energy = amplitude**2 * found[:, component.ENERGY]
    around = np.maximum(noise[found[:, component.BEAM].astype(int)], found[:, component.LEFT_OVER])
    columns = {
        "delay": (delay, "s", "propagation delay"),
        "azimuth": (found[:, component.AZIMUTH] % 360, "degree", "azimuth of arrival, counter-clockwise from east"),
        "elevation": (
            found[:, component.ELEVATION] if fans else np.full(len(found), np.nan),
            "degree",
            "elevation of arrival above the horizon",
        ),
        "path_gain": (
            20 * np.log10(amplitude) - sounder.rx_antenna.gain,
            "dB",
            "path gain, antennas removed",
        ),
        "delay_std": (
            np.sqrt(around * matched.delay_variance / energy) / sample_rate,
            "s",
            "standard deviation of delay",
        ),
        "azimuth_std": (found[:, component.AZIMUTH_STD], "degree", "standard deviation of azimuth"),
        "elevation_std": (found[:, component.ELEVATION_STD], "degree", "standard deviation of elevation"),
        "path_gain_std": (
            20 / np.log(10) * found[:, component.AMPLITUDE_STD] / amplitude,
            "dB",
            "standard deviation of path gain",
        ),
    }
    return xr.Dataset(
        {
            name: ("mpc", values, {"units": units, "long_name": long_name})
            for name, (values, units, long_name) in columns.items()
        }
    )
