"""Chains of reflections that look like a wall, and the two signs that reveal them.

The image of an image is a fixed point, just as the image in one wall is. Paths off two walls therefore agree on a
third one wherever the receiver is, and support alone cannot separate them from a wall. A candidate is rejected here if
its image is composed of known mirrors and its paths lose what these lose, or if two candidates are one double
reflection in its two orders.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from erm.geometry.chains import image_slopes
from erm.geometry.vertical import FloatArray, bisector, mirrored, unit
from erm.mpcs.standard_errors import SIGMAS
from erm.reconstruction.model.fit import CHI_SQUARED_GATE
from erm.reconstruction.model.line import Line, mirror_images
from erm.reconstruction.model.loss import loss_error, median_loss, reflection_loss, refractive_index_squared
from erm.reconstruction.model.paths import BoolArray, IntArray, Paths
from erm.reconstruction.model.wall import Wall

CHAIN_LOSS_TOLERANCE = 4.0
"""By how much less than its walls a chain may seem to lose [dB]: materials vary along a facade, and two paths in one
resolution cell interfere. Chosen; not derived."""
FIRST_MIRRORS = 3
"""First mirrors that are tried for each rest of a chain. Chosen; not derived."""
MIN_EXTRA_LOSS = 1.0
"""Least loss of a double reflection above that of either of its walls [dB]. Chosen; not derived."""
ORDER_LOSS_DIFFERENCE = 3.0
"""Largest difference between the losses of the two orders of a double reflection [dB]: they meet the same walls at
other angles. Chosen; not derived."""
MAX_MIRRORS, MAX_MIRRORS_OF_TRIPLE = 64, 32
"""Nearest walls that a chain of two, and of three, is composed of. Chosen; not derived."""
MAX_MIRROR_ERROR = 0.3
"""Uncertainty of images up to which lines are mirrors, and mirrors are chains [m]: the faces of a facade are as far
apart as its reveals and bays are deep, and a less certain chain agrees with paths off any. Chosen; not derived."""
FACADE_ROUGHNESS = 2e-3
"""Deviation of a facade from a plane [m]. Chosen; not derived."""


class Mirror(NamedTuple):
    """A wall as a mirror: its line, how far it extends along the line, and what it loses."""

    line: Line
    low: float  # m along the line
    high: float  # m
    index_squared: float
    loss_error: float  # dB
    middle: FloatArray  # (2,) m


def mirror_of(wall: Wall, margin: float) -> Mirror:
    """Return a wall as a mirror that extends a margin [m] beyond its reflection points."""
    along = wall.line.along(wall.reflection_points)
    low, high = float(along.min()), float(along.max())
    middle = wall.line.foot() + (low + high) / 2 * wall.line.direction()
    index_squared = refractive_index_squared(wall)
    return Mirror(wall.line, low - margin, high + margin, index_squared, loss_error(wall), middle)


def is_multi_bounce(wall: Wall, mirrors: Sequence[Mirror]) -> bool:
    """Whether two or three reflections off mirrors explain most paths of a wall.

    Mirroring an image in the last wall of a chain takes it one reflection back. A chain explains a path if what is left
    is the image in the first wall, if the path meets each wall where it may stand, and if it loses no less than the
    walls do.

    Parameters
    ----------
    wall : Wall
    mirrors : sequence of Mirror
        Accepted walls without the one in question.
    """
    transmitters, counts = np.unique(wall.paths.transmitter, return_counts=True)
    if not mirrors or np.count_nonzero(counts > 1) > 1:  # a line does not describe a chain for several transmitters
        return False
    middle = wall.reflection_points[:, :2].mean(axis=0)
    squared_distance = np.sum((np.array([mirror.middle for mirror in mirrors]) - middle) ** 2, axis=-1)
    mirrors = [mirrors[i] for i in np.argsort(squared_distance, kind="stable")[:MAX_MIRRORS]]
    paths = wall.paths.take(wall.paths.transmitter == transmitters[np.argmax(counts)])
    tx = paths.tx[0, :2]
    slope = _image_slope(wall.line, tx)
    covariance = slope @ wall.line.covariance @ slope.T
    explained = np.zeros(len(paths), dtype=bool)
    for chain in _chains(tx, mirror_images(wall.line, tx), covariance, mirrors):
        explained |= _explains([mirrors[i] for i in chain], paths)
        if np.mean(explained) > 0.5:
            return True
    return False


def _chains(
    tx: FloatArray, image: FloatArray, covariance: FloatArray, mirrors: Sequence[Mirror]
) -> list[tuple[int, ...]]:
    """Chains of mirrors, the one nearest to the transmitter first, that map the transmitter to the image within errors.

    Of a chain (a, b) or (a, c, b) the last mirrors are undone; what is left must be the image in the first mirror a.
    """
    count = len(mirrors)
    normals = np.array([mirror.line.normal for mirror in mirrors])
    pivots = np.array([mirror.line.pivot for mirror in mirrors])
    offsets = np.array([mirror.line.offset for mirror in mirrors])
    covariances = np.array([mirror.line.covariance for mirror in mirrors])
    absolute = offsets + np.sum(unit(normals) * pivots, axis=-1)
    first = mirrored(tx, normals, absolute)
    slopes = image_slopes(normals, offsets, tx - pivots)
    spread = np.sqrt(np.trace(slopes @ covariances @ slopes.swapaxes(1, 2), axis1=1, axis2=2))
    radius = 4 * (np.sqrt(np.trace(covariance)) + 2 * spread.max() + FACADE_ROUGHNESS)
    tree = cKDTree(first)
    without_b = mirrored(image, normals, absolute)
    few = min(count, MAX_MIRRORS_OF_TRIPLE)
    without_c_b = mirrored(without_b[:few, None], normals[:few], absolute[:few]).reshape(-1, 2)
    asked = np.vstack([without_b, without_c_b])
    near = tree.query(asked, k=min(FIRST_MIRRORS, count), distance_upper_bound=radius)[1].reshape(len(asked), -1)
    row, column = np.nonzero(near < count)
    a = near[row, column]
    double = row < count
    b = np.where(double, row, (row - count) // max(few, 1))
    c = np.where(double, -1, (row - count) % max(few, 1))
    possible = np.where(double, a != b, (a != c) & (b != c))
    found: list[tuple[int, ...]] = []
    for chosen, chain in (
        (possible & double, np.stack([a, b], axis=1)),
        (possible & ~double, np.stack([a, c, b], axis=1)),
    ):
        chain = chain[chosen]
        place, of_chain = np.broadcast_to(tx, (len(chain), 2)), np.zeros((len(chain), 2, 2))
        for mirror in chain.T:
            slope = image_slopes(normals[mirror], offsets[mirror], place - pivots[mirror])
            n = unit(normals[mirror])
            reflection = np.eye(2) - 2 * n[:, :, None] * n[:, None, :]
            of_chain = reflection @ of_chain @ reflection + slope @ covariances[mirror] @ slope.swapaxes(1, 2)
            place = mirrored(place, normals[mirror], absolute[mirror])
        apart = image - place
        total = covariance + of_chain + FACADE_ROUGHNESS**2 * np.eye(2)
        chi2 = np.einsum("np,npq,nq->n", apart, np.linalg.inv(total), apart)
        certain = np.trace(of_chain, axis1=1, axis2=2) < MAX_MIRROR_ERROR**2
        found += [tuple(one) for one in chain[certain & (chi2 < CHI_SQUARED_GATE)].tolist()]
    return found


def _image_slope(line: Line, point: FloatArray) -> FloatArray:
    """Slopes (2, 2) of a point's image by (normal [degree], offset [m])."""
    return image_slopes(np.array([line.normal]), np.array([line.offset]), (point - line.pivot)[None])[0]


def image_spread(line: Line, point: FloatArray) -> float:
    """Standard error of the place of a point's image in a line [m]."""
    slope = _image_slope(line, point)
    return float(np.sqrt(np.trace(slope @ line.covariance @ slope.T)))


def _explains(chain: Sequence[Mirror], paths: Paths) -> BoolArray:
    """Whether (path,) mirrors, met in turn where they stand, explain paths of one transmitter and their losses."""
    images = [paths.tx[0, :2]]
    for mirror in chain:
        images.append(mirror_images(mirror.line, images[-1]))
    here = paths.rx[:, :2]
    horizontal = np.linalg.norm(images[-1] - here, axis=-1)
    cos_elevation = horizontal / np.hypot(horizontal, paths.tx[:, 2] - paths.rx[:, 2])
    possible = np.ones(len(paths), dtype=bool)
    loss = np.zeros(len(paths))
    variance = paths.loss_std**2
    for mirror, image in zip(chain[::-1], images[:0:-1], strict=True):
        near, far = mirror.line.signed_distance(here), mirror.line.signed_distance(image)
        crosses = near * far < 0
        share = np.where(crosses, near, 0.0) / np.where(crosses, near - far, 1.0)
        toward = image - here
        cosine = np.abs(toward @ unit(mirror.line.normal)) / np.linalg.norm(toward, axis=-1) * cos_elevation
        here = here + share[:, None] * toward
        along = mirror.line.along(here)
        possible &= crosses & (along > mirror.low) & (along < mirror.high)
        loss += reflection_loss(mirror.index_squared, cosine)
        variance += mirror.loss_error**2
    return possible & (paths.loss > loss - CHAIN_LOSS_TOLERANCE - np.sqrt(variance))


def hidden_wall_pairs(walls: Sequence[Wall]) -> list[tuple[int, int, int]]:
    """Find pairs of candidates that are one double reflection, off a known and a hidden wall, in its two orders.

    If the image of the first is "hidden, then known", mirroring it in the known wall leaves the image in the hidden
    wall, and so the hidden wall. The image "known, then hidden" must then be that of the other. Real walls agree so by
    chance only. Both orders lose about the same, and more than the known wall, which more paths share.

    Returns
    -------
    list of (candidate, other candidate, known wall)
    """
    found = []
    main = np.array([np.bincount(wall.paths.transmitter).argmax() for wall in walls], dtype=np.int64)
    for transmitter in np.unique(main):
        numbers = np.flatnonzero(main == transmitter)
        own = [walls[i] for i in numbers.tolist()]
        tx = own[0].paths.tx[own[0].paths.transmitter == transmitter][0, :2]
        found += [
            (int(numbers[i]), int(numbers[j]), int(numbers[known])) for i, j, known in _hidden_wall_pairs_of(own, tx)
        ]
    return found


def _hidden_wall_pairs_of(walls: Sequence[Wall], tx: FloatArray) -> list[tuple[int, int, int]]:
    """`hidden_wall_pairs` of candidates of one transmitter (2,)."""
    lines = [wall.line for wall in walls]
    image = np.array([mirror_images(line, tx) for line in lines])
    spread = np.array([image_spread(line, tx) for line in lines])
    loss = np.array([median_loss(wall) for wall in walls])
    support = np.array([wall.support for wall in walls])
    tree = cKDTree(image)
    found = []
    for known, line in enumerate(lines):
        weaker: IntArray = np.flatnonzero((support < support[known]) & (loss > loss[known] + MIN_EXTRA_LOSS))
        of_hidden = mirrored(image[weaker] - line.pivot, line.normal, line.offset) + line.pivot
        normal, offset = bisector(tx - of_hidden, np.zeros(2))
        expected = mirrored(image[known] - of_hidden, normal, offset) + of_hidden
        radius = SIGMAS * (spread[weaker] + 2 * spread[known]) + FACADE_ROUGHNESS
        for i, near in zip(weaker.tolist(), tree.query_ball_point(expected, radius), strict=True):
            found += [
                (i, j, known) for j in near if j in weaker and j != i and abs(loss[i] - loss[j]) < ORDER_LOSS_DIFFERENCE
            ]
    return found
