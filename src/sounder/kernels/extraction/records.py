"""Records of named fields, for the kernels and for Python: ``path.delay`` or ``paths["delay"]``."""

from typing import Any, cast

import numpy as np
import numpy.typing as npt

Path = np.record
Paths = npt.NDArray[np.record]


def _record(*fields: tuple[str, Any]) -> np.dtype[np.record]:
    return cast("np.dtype[np.record]", np.dtype((np.record, np.dtype(list(fields), align=True))))


PATH = _record(
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
)
"""A path that was found.

``delay`` [sample]; ``azimuth`` and ``elevation`` [degree]; ``amplitude`` toward boresight.

``azimuth_variance`` and so on: variances of the angles [degree2] and of the amplitude; NaN for an angle that was not
fitted, infinite for one that the beams do not determine. ``azimuth_elevation`` and so on: covariances of these.

``misfit``: residual power of the magnitudes, or what their fit counts as noise, over that of the noise.
``residual_power``: mean power left around the peak. ``beam``: number of the link in which the path was found.
``beam_gain``: amplitude of the patterns of that link's beams toward the path, relative to boresight.
``pattern_energy``: sum of the squared pattern toward the path over the links of the fit.

``lowest_elevation`` and ``highest_elevation``: bounds of the fit [degree]. ``elevation_spread`` [degree] and
``amplitude_spread``: largest differences to other directions that the beams do not exclude. ``search_angles``: whether
the next fit searches the angles anew.

A path has two such records, of its arrival and of its departure. What is of the path as a whole, such as the delay, is
in that of the arrival; that of the departure has its angles, and the gain of the departure's beam alone.
"""
ARRIVAL, DEPARTURE = 0, 1
"""Ends of a path: places of its records, and of the antennas."""
LINK = _record(("noise", np.float64), ("threshold", np.float64))
"""A pair of a beam at departure and a beam at arrival: mean noise power, NaN if it was not recorded; least power of a
path."""
BEAM = _record(
    ("azimuth", np.float64),
    ("elevation", np.float64),
    ("cos_azimuth", np.float64),
    ("sin_azimuth", np.float64),
    ("cos_elevation", np.float64),
    ("sin_elevation", np.float64),
)
"""A beam of an antenna: where it looks [degree]."""
ARTEFACT = _record(("delay", np.float64), ("amplitude", np.float64))
"""A copy that the instrument makes of every path: how much later [sample], and its amplitude at most, relative."""
TRIAL = _record(
    ("azimuth", np.float64),
    ("elevation", np.float64),
    ("amplitude", np.float64),
    ("squares", np.float64),
    ("sidelobe_misfit", np.float64),
)
"""A direction tried: the fit from there, its squared residuals, and its `sidelobe_check.sidelobe_misfit`."""

FIT_BEAMS = 9
"""Beams of a fit at either end: the one a path was found in and those around it."""
OVERLAP = 6.0
"""Paths closer than this in delay share samples [sample]: three chips of two samples."""
