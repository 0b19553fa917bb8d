"""How much errors of positions, headings and clocks widen those of lengths and azimuths."""

import numpy as np
import numpy.typing as npt

from erm.geometry.vertical import FloatArray, unit


def survey_widths(
    length: npt.ArrayLike, height_difference: npt.ArrayLike, azimuth: npt.ArrayLike, covariance: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Standard deviations (path,) that errors of positions cause in lengths [m] and azimuths [degree].

    A receiver displaced by ``e`` shortens the path by ``u.e`` at most, ``u`` the horizontal unit vector toward the
    arrival, and turns it by the part of ``e`` across it over the horizontal length.

    Parameters
    ----------
    length, height_difference : array (path,)
        Slant length and difference of the antennas' heights [m].
    azimuth : array (path,)
        Of arrival [degree].
    covariance : array (path or 1, 4, 4)
        Of east, north [m], heading [degree] and clock times the speed of light [m] of the position of each path.

    Examples
    --------
    >>> length, azimuth = survey_widths([30.0], [0.0], [90.0], np.diag([0.3, 0.4, 0.0, 0.3])[None] ** 2)
    >>> length.round(3).item(), azimuth.round(3).item()
    (0.5, 0.573)
    """
    length, height = np.asarray(length, dtype=float), np.asarray(height_difference, dtype=float)
    toward = unit(azimuth)
    smallest = np.sqrt(covariance[:, 0, 0] + covariance[:, 1, 1])  # right below a transmitter there is no azimuth
    horizontal = np.maximum(np.sqrt(np.maximum(length**2 - height**2, 0.0)), smallest)
    across = np.divide(1.0, horizontal, out=np.zeros_like(horizontal), where=horizontal > 0)
    slopes = np.zeros((2, len(length), 4))
    slopes[0, :, :2] = -toward
    slopes[0, :, 3] = 1.0
    slopes[1, :, :2] = np.rad2deg(np.stack([toward[:, 1], -toward[:, 0]], axis=-1) * across[:, None])
    slopes[1, :, 2] = 1.0
    variance = np.einsum("kpi,pij,kpj->kp", slopes, np.broadcast_to(covariance, (len(length), 4, 4)), slopes)
    of_length, of_azimuth = np.sqrt(np.maximum(variance, 0.0))
    return of_length, of_azimuth
