"""Standard errors of delays and angles for tables that have none.

Delay and direction of a direct path are known from the positions of the antennas, so its errors can be measured. If no
direct paths were received, residuals of paths off common walls give the errors, once there are walls.
"""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from erm.common.constants import c
from erm.geometry.vertical import FloatArray, angle_difference, azimuth_of

if TYPE_CHECKING:
    import xarray as xr

SIGMAS = 3.0
"""Standard errors beyond which a value contradicts another."""
SMALLEST_ERRORS = (1e-12, 1e-2, 1e-2)
"""Smallest standard errors of delay [s], azimuth and elevation [degree]: 0.3 mm, and 2 mm at 10 m; chosen. Smaller
errors than these are dominated by those of positions and arithmetic."""
COMMON_SHARES = (0.0, 0.1, 0.3, 1.0, 3.0, 10.0)
"""Common errors that `widen_errors` tries, relative to the median error; chosen."""
MAD_TO_STD = 1.4826
"""Standard deviation of a Gaussian over its median absolute deviation."""
MIN_LOG_ODDS = 2.0
"""Least log-likelihood ratio for wider errors: Akaike's criterion for two parameters."""
MIN_SCALE = 1e-3
"""Smallest scale of residuals, relative to the standard errors, for residuals that are 0; chosen."""
MIN_SAMPLE = 5
"""Fewest direct paths for an estimate; chosen."""


UNKNOWN_GAIN_STD = 100.0
"""Standard deviation of a path gain that is unknown or doubtful [dB]: more than the paths of a position differ."""


class StandardErrors(NamedTuple):
    """Standard errors of a table that has none, and their source."""

    delay: float
    """[s]"""
    azimuth: float
    """[degree]"""
    elevation: float
    """[degree]"""
    sample: int
    """Number of measured errors behind them."""
    source: str
    """Source, for people."""


ASSUMED = StandardErrors(0.3e-9, 3.0, 3.0, 0, "an assumption")
"""Errors of unrefined estimates: samples of 0.83 ns give 0.24 ns rms, a grid of 10 degrees gives 2.9 degrees rms."""


def errors_of_direct_paths(table: "xr.Dataset") -> StandardErrors:
    """Standard errors of direct paths, from their known delays and directions.

    Each link contributes its strongest MPC within three assumed standard errors of the direct path. The median absolute
    deviation gives the scale, so that a few links where another path arrives there do not matter. Elevations have the
    root mean square: those of paths beyond the fan of a scan are ten times as uncertain as those of strong paths in it,
    and an elevation does nothing but reject. The result is `ASSUMED` if fewer than `MIN_SAMPLE` links have such an MPC.
    """
    difference = table["tx_position"].values - table["rx_position"].values
    delay_error = table["delay"].values - np.linalg.norm(difference, axis=-1) / c
    azimuth_error = angle_difference(table["azimuth"].values, azimuth_of(difference))
    true_elevation = np.rad2deg(np.arctan2(difference[:, 2], np.hypot(difference[:, 0], difference[:, 1])))
    elevation_error = table["elevation"].values - true_elevation
    near = np.flatnonzero(
        (np.abs(delay_error) < SIGMAS * ASSUMED.delay) & (np.abs(azimuth_error) < SIGMAS * ASSUMED.azimuth)
    )
    near = near[np.argsort(-table["path_gain"].values[near], kind="stable")]
    ends = np.hstack([table["tx_position"].values[near], table["rx_position"].values[near]])
    _, strongest = np.unique(ends, axis=0, return_index=True)
    rows = near[strongest]
    if len(rows) < MIN_SAMPLE:
        return ASSUMED
    known = np.isfinite(elevation_error[rows])
    elevation_std = (
        float(np.sqrt(np.mean(elevation_error[rows][known] ** 2)))
        if np.count_nonzero(known) >= MIN_SAMPLE
        else ASSUMED.elevation
    )
    found = (robust_std(delay_error[rows]), robust_std(azimuth_error[rows]), elevation_std)
    delay, azimuth, elevation = (max(value, smallest) for value, smallest in zip(found, SMALLEST_ERRORS, strict=True))
    return StandardErrors(delay, azimuth, elevation, len(rows), "direct paths")


def widen_errors(residual: FloatArray, expected: FloatArray, std: FloatArray) -> FloatArray:
    """Widen standard errors if residuals show that they are too small.

    True errors may be proportional to the stated ones, as for overlapping paths, or have a common part, as from a
    survey. The candidates are ``f * hypot(std, share * median(std))`` for `COMMON_SHARES`, with ``f`` the scale of the
    residuals. The candidate of the highest likelihood (Student's t with 3 degrees of freedom) is used, if its
    log-likelihood exceeds that of the stated errors by `MIN_LOG_ODDS`: a few residuals are large by chance.

    Parameters
    ----------
    residual, expected : array (residual,)
        Residuals and their stated standard errors.
    std : array (path,)
        Standard errors to widen.

    Returns
    -------
    array (path,)
        Standard errors, not smaller than ``std``.
    """
    typical = float(np.median(expected))
    best, highest = std, _log_likelihood(residual, expected) + MIN_LOG_ODDS
    for share in COMMON_SHARES:
        own = np.hypot(expected, share * typical)
        factor = max(robust_std(residual / own), MIN_SCALE)
        likelihood = _log_likelihood(residual, factor * own)
        if likelihood > highest:
            best, highest = np.maximum(std, factor * np.hypot(std, share * typical)), likelihood
    return best


def _log_likelihood(residual: FloatArray, std: FloatArray) -> float:
    """Log-likelihood of Student's t with 3 degrees of freedom, up to a constant."""
    return -float(np.sum(np.log(std) + 2 * np.log1p((residual / std) ** 2 / 3)))


def robust_std(errors: FloatArray) -> float:
    """Standard deviation of errors around zero; up to half of them may be outliers."""
    return MAD_TO_STD * float(np.median(np.abs(errors)))
