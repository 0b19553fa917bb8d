"""Directions of the beams of a scan, the gains of its antenna toward paths, and differences on a circle."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sounder.instrument.antenna_pattern import Pattern

DB_PER_NEPER = 20 / np.log(10)
"""Decibels of an amplitude whose natural logarithm is 1."""

Real = NDArray[np.float64]


def wrap(difference: Real, period: float = 360.0) -> Real:
    """Difference of two numbers on a circle, the short way round.

    Parameters
    ----------
    difference : array (...)
        Of angles [degree], or of delays in the unit of ``period``.
    period : float
        Length of the circle.

    Returns
    -------
    array (...)
        From ``-period / 2`` to ``period / 2``, the latter excluded.

    Examples
    --------
    >>> wrap(np.array([350.0 - 10.0, 20.0 - 10.0]))
    array([-20.,  10.])
    """
    return (difference + period / 2) % period - period / 2


def beam_directions(azimuth: ArrayLike, elevation: ArrayLike) -> Real:
    """Azimuth and elevation of every beam of a scan.

    Parameters
    ----------
    azimuth, elevation : array (azimuth,), (elevation,)
        Axes of the scan [degree].

    Returns
    -------
    array (beam, 2)
        Azimuth and elevation [degree]; the elevation changes fastest.
    """
    grids = np.meshgrid(np.asarray(azimuth, float), np.asarray(elevation, float), indexing="ij")
    return np.stack([grid.ravel() for grid in grids], axis=-1)


def beam_gains(path_azimuth: ArrayLike, path_elevation: ArrayLike, directions: Real, pattern: Pattern) -> Real:
    """Gain of the antenna in every beam toward every path.

    Parameters
    ----------
    path_azimuth, path_elevation : array (path,)
        Directions of the paths [degree].
    directions : array (beam, 2)
        From `beam_directions` [degree].
    pattern : Pattern

    Returns
    -------
    array (path, beam)
        Relative to boresight [dB].
    """
    toward = np.asarray(path_azimuth, float)[:, None], np.asarray(path_elevation, float)[:, None]
    return np.asarray(pattern.beam_gain(*toward, *directions.T))
