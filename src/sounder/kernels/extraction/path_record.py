"""What is kept of a path that was found: one record of named fields, in the kernels as in Python."""

import numpy as np
import numpy.typing as npt

Paths = npt.NDArray[np.void]
Path = np.void

PATH = np.dtype(
    [
        ("delay", np.float64),
        ("azimuth", np.float64),
        ("elevation", np.float64),
        ("amplitude", np.float64),
        ("azimuth_variance", np.float64),
        ("elevation_variance", np.float64),
        ("amplitude_variance", np.float64),
        ("azimuth_elevation", np.float64),
        ("azimuth_amplitude", np.float64),
        ("elevation_amplitude", np.float64),
        ("misfit", np.float64),
        ("residual_power", np.float64),
        ("beam", np.int64),
        ("beam_gain", np.float64),
        ("pattern_energy", np.float64),
        ("lowest_elevation", np.float64),
        ("highest_elevation", np.float64),
        ("elevation_spread", np.float64),
        ("amplitude_spread", np.float64),
        ("search_angles", np.bool_),
    ],
    align=True,
)
"""A path.

==========================================  ===========================================================================
``delay``                                   [sample]
``azimuth``, ``elevation``                  [degree]
``amplitude``                               toward boresight [1]
``azimuth_variance`` and so on              variances of angles [degree2] and amplitude; NaN for an angle that was not
                                            fitted, infinite for one that the beams do not determine
``azimuth_elevation`` and so on             covariances of these
``misfit``                                  residual power of the magnitudes over that of the noise
``residual_power``                          mean power left around the peak in its beam
``beam``                                    beam in which the path was found
``beam_gain``                               amplitude of that beam's pattern toward the path, relative to boresight
``pattern_energy``                          sum over the beams of the fit of the squared pattern toward the path
``lowest_elevation``,                       elevations between which the path was fitted [degree]
``highest_elevation``
``elevation_spread``,                       largest difference to other directions that the beams do not exclude, in
``amplitude_spread``                        elevation [degree] and amplitude
``search_angles``                           whether the next fit searches the angles anew
==========================================  ===========================================================================
"""
FIT_BEAMS = 9
"""Beams of a fit: the one a path was found in and those around it."""
OVERLAP = 6.0
"""Paths closer than this in delay share samples [sample]: three chips of two samples."""
