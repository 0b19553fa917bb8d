"""Fitted paths as the table of what was found has them."""

import numpy as np
from numpy.typing import NDArray

from sounder.kernels.extraction import columns
from sounder.mpc.two_paths_fit import AZIMUTH, DELAY, ELEVATION, LEVEL

Real = NDArray[np.float64]


def write_path(row: Real, path: Real, covariance: Real, misfit: float, seen: tuple[int, float, float]) -> None:
    """Write angles, amplitude, their covariance, and which beam sees the path best; the delay is the caller's.

    Parameters
    ----------
    row : array (component.COLUMNS,)
        Written to.
    path : array (4 or more,)
        Parameters of the fit, in the order of `sounder.mpc.two_paths_fit`.
    covariance : array (4 or more, 4 or more)
        Theirs.
    misfit : float
        Residual power over that of the noise.
    seen : tuple
        The beam that sees the path best, its pattern's amplitude toward the path relative to boresight, and the
        power of its noise times the variance of a delay for amplitude and noise of 1 [sample2].
    """
    amplitude = np.exp(path[LEVEL])
    row[columns.AZIMUTH], row[columns.ELEVATION] = path[AZIMUTH], path[ELEVATION]
    row[columns.AMPLITUDE] = amplitude
    row[columns.VAR_AZIMUTH] = covariance[AZIMUTH, AZIMUTH]
    row[columns.VAR_ELEVATION] = covariance[ELEVATION, ELEVATION]
    row[columns.VAR_AMPLITUDE] = covariance[LEVEL, LEVEL] * amplitude**2
    row[columns.AZIMUTH_ELEVATION] = covariance[AZIMUTH, ELEVATION]
    row[columns.AZIMUTH_AMPLITUDE] = covariance[AZIMUTH, LEVEL] * amplitude
    row[columns.ELEVATION_AMPLITUDE] = covariance[ELEVATION, LEVEL] * amplitude
    row[columns.MISFIT] = misfit
    row[columns.BEAM], row[columns.OFF_BORESIGHT], spread = seen
    row[columns.ENERGY] = spread / (amplitude**2 * covariance[DELAY, DELAY])


def turn(angle: Real) -> Real:
    """An angle the short way round, -180 to 180 [degree]."""
    return (angle + 180) % 360 - 180
