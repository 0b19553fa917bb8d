"""Density of the paths of an antenna pair about each of its paths: how many agree with anything by chance."""

import numpy as np
import numpy.typing as npt

from erm.common.odds import THOUSAND_TO_ONE
from erm.geometry.vertical import FloatArray, angle_difference

CHI_SQUARED_GATE = 2 * THOUSAND_TO_ONE
"""Chi-squared up to which a path agrees with a line: with 2 degrees of freedom one true path in 1000 exceeds it, for
``exp(-x / 2) = 1e-3`` at ``x = 2 ln 1000 = 13.8``."""
JEFFREYS_COUNT = 0.5
"""Count added to a background, so that its rate is positive where none was counted (Jeffreys prior)."""
BATCH_PAIRS = 1_000_000
"""Pairs of paths compared at once. Chosen; not derived."""


def density_of_stronger(
    length: FloatArray,
    azimuth: FloatArray,
    std: tuple[FloatArray, FloatArray],
    loss: FloatArray,
    link: npt.NDArray[np.int64],
) -> FloatArray:
    """Density (path,) about each path of those of its link that lose less [1/(m degree)].

    Paths stand in clusters, the weak ones about the strong ones. Of rectangles as many times the errors wide on either
    side as the gate or more, the density is the largest ``count / area``; the largest holds all lengths and azimuths.

    Parameters
    ----------
    length, azimuth : array (path,)
        [m], [degree].
    std : pair of array (path,)
        Their standard errors.
    loss : array (path,)
        [dB]
    link : array (path,) of int
        Antenna pair of each path.

    Examples
    --------
    >>> std = np.full(3, 0.1), np.full(3, 1.0)
    >>> density = density_of_stronger(
    ...     np.array([10.0, 10.5, 30.0]), np.array([0.0, 5.0, 90.0]), std, np.array([5.0, 9.0, 7.0]), np.zeros(3, int)
    ... )
    >>> (1 / density).round().tolist()  # the second is beside the first: 1 m by 10 degrees
    [14400.0, 10.0, 7200.0]
    """
    span = max(float(np.ptp(length)) if len(length) else 0.0, 1.0)
    density = np.full(len(length), JEFFREYS_COUNT / (span * 360))
    order = np.argsort(link, kind="stable")
    start, size = np.unique(link[order], return_index=True, return_counts=True)[1:]
    for count in np.unique(size).tolist():  # links with as many paths together
        of_size = order[start[size == count, None] + np.arange(count)]
        for some in np.array_split(of_size, 1 + of_size.size * count // BATCH_PAIRS):
            for rows in np.array_split(some, 1 + some.size * count // BATCH_PAIRS, axis=1):
                density[rows] = np.maximum(density[rows], _of_links(some, rows, (length, azimuth, loss), std, span))
    return density


def _of_links(
    together: npt.NDArray[np.int64],
    rows: npt.NDArray[np.int64],
    values: tuple[FloatArray, FloatArray, FloatArray],
    std: tuple[FloatArray, FloatArray],
    span: float,
) -> FloatArray:
    """Largest density (link, row) about rows (link, row) of stronger ones among the paths (link, path) of each."""
    length, azimuth, loss = ((column[together][:, None], column[rows][:, :, None]) for column in values)
    of_length, of_azimuth = (one[rows][:, :, None] for one in std)
    along = np.abs(length[0] - length[1]) / of_length
    away = np.maximum(along, np.abs(angle_difference(*azimuth)) / of_azimuth)
    away = np.maximum(away, np.sqrt(CHI_SQUARED_GATE))
    away[loss[0] >= loss[1]] = np.inf
    away.sort(axis=-1)
    area = np.minimum(2 * away * of_length, span) * np.minimum(2 * away * of_azimuth, 360.0)
    count = np.where(np.isfinite(away), np.arange(1, together.shape[1] + 1), 0)
    return np.asarray((count / area).max(axis=-1, initial=0.0))
