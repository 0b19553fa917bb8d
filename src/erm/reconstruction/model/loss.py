"""What a wall loses: the refractive index that the gains of its paths ask for, each gain trusted as far as its error.

A gain depends on the antenna in the direction of arrival, so that of a path beyond the edge of the fan may be wrong by
tens of decibels while its delay and azimuth are good.
"""

import numpy as np

from erm.geometry.vertical import FloatArray
from erm.reconstruction.model.paths import BoolArray, IntArray, Paths
from erm.reconstruction.model.wall import Wall

SCATTER = 3.0  # dB; materials vary along a facade, and two paths in one cell interfere
SCATTERED = 10.0  # dB; three deviations of a mirrored path
LEAST_INDEX = 1.05  # refractive index; air has 1
MOST_AMPLITUDE = 0.98  # reflected; a loss under 0.2 dB is metal and error of gain


def refractive_index_squared(wall: Wall) -> float:
    """Of a smooth lossless face that loses what the wall does: the weighted median over its paths.

    Vertical antennas meet a vertical face with the field across the plane of incidence, where ``|r| = (w - c) /
    (w + c)``, ``c`` the cosine of incidence and ``w**2 = n**2 - 1 + c**2``; solved, ``w = c (1 + |r|) / (1 - |r|)``.
    """
    return float(_index2(wall.paths, wall.incidence, _whole(wall.paths))[0])


def reflection_loss(index2: FloatArray | float, cosine: FloatArray) -> FloatArray:
    """Loss [dB] of the face of `refractive_index_squared` at cosines of incidence (...)."""
    root = np.sqrt(index2 - 1 + cosine**2)
    return -20 * np.log10(np.maximum((root - cosine) / (root + cosine), 1e-3))


def scattered(paths: Paths, cosine: FloatArray, start: IntArray) -> BoolArray:
    """Paths (path,) off walls that lose far more than the others of the same for certain: scattered, not mirrored.

    A rough or broken facade throws weak paths from anywhere along it, and these do not share the image.

    Parameters
    ----------
    paths : Paths
        Those of the first wall, from ``start[0]`` to ``start[1]``, then those of the second, and so on.
    cosine : array (path,)
        Of incidence.
    start : array (wall + 1,) of int
    """
    usual = reflection_loss(np.repeat(_index2(paths, cosine, start), np.diff(start)), cosine)
    return np.asarray(paths.loss - 2 * paths.loss_std > usual + SCATTERED)


def loss_at_normal_incidence(wall: Wall) -> float:
    """What the wall would lose face on [dB]: comparable between walls seen at different angles."""
    return float(reflection_loss(refractive_index_squared(wall), np.ones(1))[0])


def typical_loss(wall: Wall) -> float:
    """Weighted median of the losses of a wall's paths [dB]."""
    return weighted_quantile(wall.paths.loss, _weights(wall.paths), 0.5)


def loss_error(wall: Wall) -> float:
    """Standard error of a wall's loss that the errors of its gains leave [dB].

    Elevations beyond the fan are all taken for too low, so the errors of a wall's gains are alike and are not averaged.
    """
    weight = _weights(wall.paths)
    return float(np.sum(weight * wall.paths.loss_std) / np.sum(weight))


def weighted_quantile(values: FloatArray, weight: FloatArray, share: float) -> float:
    """Value below which a share of the weight lies: the midpoints of the weights, joined by straight lines."""
    return float(weighted_quantiles(values, weight, np.array([0, len(values)]), share)[0])


def weighted_quantiles(values: FloatArray, weight: FloatArray, start: IntArray, share: float) -> FloatArray:
    """`weighted_quantile` of each of the stretches of values, the first from ``start[0]`` to ``start[1]``."""
    first, last = start[:-1], start[1:] - 1
    of = np.repeat(np.arange(len(first)), np.diff(start))
    order = np.lexsort((values, of))
    values, weight = values[order], weight[order]
    reached = np.cumsum(weight)
    reached -= (reached[first] - weight[first])[of]
    place = (reached - weight / 2) / reached[last][of]
    below = np.add.reduceat(place < share, first, dtype=np.int64)
    after = np.minimum(first + below, last)
    before = np.maximum(after - 1, first)
    apart = place[after] - place[before]
    part = np.clip((share - place[before]) / np.where(apart > 0, apart, 1.0), 0.0, 1.0)
    return values[before] + part * (values[after] - values[before])


def _index2(paths: Paths, cosine: FloatArray, start: IntArray) -> FloatArray:
    amplitude = np.clip(10 ** (-paths.loss / 20), 0.0, MOST_AMPLITUDE)
    root = cosine * (1 + amplitude) / (1 - amplitude)
    middle = weighted_quantiles(root**2 + 1 - cosine**2, _weights(paths), start, 0.5)
    return np.maximum(middle, LEAST_INDEX**2)


def _weights(paths: Paths) -> FloatArray:
    return 1 / (paths.loss_std**2 + SCATTER**2)


def _whole(paths: Paths) -> IntArray:
    return np.array([0, len(paths)])
