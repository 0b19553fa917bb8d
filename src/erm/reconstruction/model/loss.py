"""Reflection loss of a wall: the refractive index that the gains of its paths imply.

Each gain is weighted by its error. The gain of a path beyond the elevations of the scan may be wrong by tens of
decibels while its delay and azimuth are good.
"""

import numpy as np

from erm.geometry.vertical import FloatArray
from erm.reconstruction.model.paths import BoolArray, IntArray, Paths
from erm.reconstruction.model.wall import Wall

LOSS_SCATTER = 3.0
"""Standard deviation of the losses of one wall's paths [dB]: materials vary along a facade, and two paths in one
resolution cell interfere. Chosen; not derived."""
DIFFUSE_EXCESS_LOSS = 10.0
"""Loss above that of a wall's specular paths from which a path counts as diffuse [dB]: three times `LOSS_SCATTER`,
rounded."""
TYPICAL_LOSS, LOSS_RANGE = 7.0, 5.0
"""Mean and standard deviation of reflection losses of building materials [dB]: metal 0, concrete 8, wood 17."""
CLUTTER_LOSS_RANGE = 30.0
"""Range of the losses of clutter [dB]: the dynamic range of a table."""
MIN_REFRACTIVE_INDEX = 1.05
"""Smallest refractive index of a wall; air has 1. Chosen; not derived."""
MAX_REFLECTION_AMPLITUDE = 0.98
"""Largest amplitude reflected: a loss below 0.2 dB is metal and an error of the gain."""


def refractive_index_squared(wall: Wall) -> float:
    """Squared refractive index of a smooth lossless face that loses what a wall does.

    This is the weighted median of the squared indices that the losses of its paths imply.

    The field of vertical antennas is perpendicular to the plane of incidence of a vertical face. With ``c`` the cosine
    of incidence and ``w**2 = n**2 - 1 + c**2`` the amplitude is ``|r| = (w - c) / (w + c)`` (Fresnel), hence
    ``w = c (1 + |r|) / (1 - |r|)``.
    """
    return float(_index_squared(wall.paths, wall.cos_incidence, np.array([0, wall.support]))[0])


def reflection_loss(index_squared: FloatArray | float, cosine: FloatArray) -> FloatArray:
    """Loss (...) [dB] of the face of `refractive_index_squared` at cosines of incidence (...)."""
    root = np.sqrt(index_squared - 1 + cosine**2)
    return -20 * np.log10(np.maximum((root - cosine) / (root + cosine), 1e-3))


def is_diffuse(paths: Paths, cosine: FloatArray, start: IntArray) -> BoolArray:
    """Paths (path,) that certainly lose far more than the others of their wall: diffuse, not specular, reflections.

    A rough or broken facade scatters weak paths from anywhere along it. They do not share the wall's virtual anchor.

    Parameters
    ----------
    paths : Paths
        Those of the first wall, from ``start[0]`` to ``start[1]``, then those of the second, and so on.
    cosine : array (path,)
        Of incidence.
    start : array (wall + 1,) of int
    """
    specular = reflection_loss(np.repeat(_index_squared(paths, cosine, start), np.diff(start)), cosine)
    return np.asarray(paths.loss - 2 * paths.loss_std > specular + DIFFUSE_EXCESS_LOSS)


def loss_at_normal_incidence(wall: Wall) -> float:
    """Loss of a wall at normal incidence [dB], comparable between walls seen at different angles."""
    return float(reflection_loss(refractive_index_squared(wall), np.ones(1))[0])


def excess_loss(wall: Wall, typical: float) -> float:
    """Weighted median of what a wall's paths lose above a face of ``typical`` loss at normal incidence [dB].

    Each path is compared at its own angle. At grazing incidence all materials reflect nearly everything, so the loss at
    normal incidence that a grazing path implies is uncertain by tens of decibels, and this difference is not. With the
    amplitude ``r`` at normal incidence, the face has the refractive index ``(1 + r) / (1 - r)`` (Fresnel).
    """
    amplitude = 10 ** (-typical / 20)
    index_squared = ((1 + amplitude) / (1 - amplitude)) ** 2
    excess = wall.paths.loss - reflection_loss(index_squared, wall.cos_incidence)
    return weighted_quantile(excess, _weights(wall.paths), 0.5)


def median_loss(wall: Wall) -> float:
    """Weighted median of the losses of a wall's paths [dB]."""
    return weighted_quantile(wall.paths.loss, _weights(wall.paths), 0.5)


def loss_error(wall: Wall) -> float:
    """Standard error of a wall's loss that comes from the errors of its gains [dB].

    Elevations beyond those of the scan are all taken for too low, so the errors of a wall's gains are correlated and
    are not averaged.
    """
    weight = _weights(wall.paths)
    return float(np.sum(weight * wall.paths.loss_std) / np.sum(weight))


def weighted_quantile(values: FloatArray, weight: FloatArray, share: float) -> float:
    """Value below which a share of the weight lies, interpolated linearly between the midpoints of the weights."""
    return float(weighted_quantiles(values, weight, np.array([0, len(values)]), share)[0])


def weighted_quantiles(values: FloatArray, weight: FloatArray, start: IntArray, share: float) -> FloatArray:
    """`weighted_quantile` (list,) of each list of values, the first from ``start[0]`` to ``start[1]``."""
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


def _index_squared(paths: Paths, cosine: FloatArray, start: IntArray) -> FloatArray:
    amplitude = np.clip(10 ** (-paths.loss / 20), 0.0, MAX_REFLECTION_AMPLITUDE)
    root = cosine * (1 + amplitude) / (1 - amplitude)
    median = weighted_quantiles(root**2 + 1 - cosine**2, _weights(paths), start, 0.5)
    return np.maximum(median, MIN_REFRACTIVE_INDEX**2)


def _weights(paths: Paths) -> FloatArray:
    return 1 / (paths.loss_std**2 + LOSS_SCATTER**2)


def log_odds_of_loss(
    loss: FloatArray, loss_std: FloatArray, typical: float = TYPICAL_LOSS, spread: float = LOSS_RANGE
) -> FloatArray:
    """Log odds (path,) of reflection losses [dB] to be those of faces of a typical loss and not those of clutter."""
    variance = spread**2 + loss_std**2
    return np.asarray(
        -((loss - typical) ** 2) / (2 * variance) - np.log(2 * np.pi * variance) / 2 + np.log(CLUTTER_LOSS_RANGE)
    )
