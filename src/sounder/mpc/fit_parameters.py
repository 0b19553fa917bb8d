"""Parameters of the fits of several paths, and how their results become path records."""

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]


class Parameter(IntEnum):
    """Order of the parameters of a path in all fits of several paths."""

    AZIMUTH = 0
    """[degree]"""
    ELEVATION = 1
    """[degree]"""
    LEVEL = 2
    """Natural logarithm of the amplitude."""
    DELAY = 3
    """After a reference sample that the fit states [sample]."""
    PHASE = 4
    """Only in the joint fit [radian]."""


AZIMUTH, ELEVATION, LEVEL, DELAY, PHASE = Parameter

AZIMUTH_GRID = 0.25
"""Step of the directions that fits start from [beamwidth]; chosen, not derived."""
REGULARISATION = 1e-6
"""Information added so that a matrix can be inverted."""


def set_path(
    path: np.record,
    parameters: Real,
    covariance: Real,
    *,
    misfit: float,
    beam: int,
    beam_gain: float,
    unit_delay_variance: float,
) -> None:
    """Write the result of a fit of several paths to the record of one of them; the delay is left to the caller.

    Parameters
    ----------
    path : record of `sounder.kernels.extraction.records.PATH`
        Written to.
    parameters : array (4 or more,)
        In the order of `Parameter`.
    covariance : array (4 or more, 4 or more)
        Of the parameters.
    misfit : float
        Power that the fit counts as noise, over that of the receiver's.
    beam : int
        The beam that sees the path best.
    beam_gain : float
        Amplitude of its pattern toward the path, relative to boresight.
    unit_delay_variance : float
        Variance of the delay of a path of amplitude 1 in that beam alone [sample2].
    """
    amplitude = np.exp(parameters[LEVEL])
    path["azimuth"], path["elevation"], path["amplitude"] = parameters[AZIMUTH], parameters[ELEVATION], amplitude
    path["azimuth_variance"] = covariance[AZIMUTH, AZIMUTH]
    path["elevation_variance"] = covariance[ELEVATION, ELEVATION]
    path["amplitude_variance"] = covariance[LEVEL, LEVEL] * amplitude**2
    path["azimuth_elevation"] = covariance[AZIMUTH, ELEVATION]
    path["azimuth_amplitude"] = covariance[AZIMUTH, LEVEL] * amplitude
    path["elevation_amplitude"] = covariance[ELEVATION, LEVEL] * amplitude
    path["misfit"], path["beam"], path["beam_gain"] = misfit, beam, beam_gain
    path["pattern_energy"] = unit_delay_variance / (amplitude**2 * covariance[DELAY, DELAY])
