"""Walls that are not there: chains of bounces taken for single ones, and what gives them away.

The image of an image is as fixed a point as the image in one wall, so paths off two walls agree on a third from
everywhere, and support alone cannot tell. Three things can: the point is composed of mirrors already known; such a wall
would stand, or have its paths pass, where other paths show free air or walls; and it loses what both walls lose.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from erm.geometry.vertical import FloatArray, bisector, mirrored, unit
from erm.reconstruction.model.line import Line, anchors
from erm.reconstruction.model.loss import loss_error, reflection_loss, refractive_index_squared, typical_loss
from erm.reconstruction.model.paths import BoolArray, Paths
from erm.reconstruction.model.wall import Wall
from erm.reconstruction.search.images import GATE

LOSS_TOLERANCE = 4.0  # dB; materials vary along a facade, and two paths in one cell interfere
ALTERNATIVES = 3  # first mirrors tried for each rest of a chain
EXTRA_LOSS = 1.0  # dB; a double bounce loses at least this much more than either of its walls alone
LOSS_OF_ORDER = 3.0  # dB; the two orders of one double bounce meet the same walls at other angles
NEAREST, NEAREST_OF_THREE = 64, 32  # walls about a phantom of which it may be composed
SMOOTH = 2e-3  # m; facades are not mirrors to better than this


class Mirror(NamedTuple):
    """An accepted wall: its line, how far along it stands, and its refractive index squared."""

    line: Line
    low: float  # m along the line
    high: float  # m
    index2: float
    loss_error: float  # dB
    middle: FloatArray  # of where it stands [m]


def mirror_of(wall: Wall, margin: float) -> Mirror:
    """Return the wall as a mirror that may reach a margin [m] beyond its reflection points."""
    along = wall.line.along(wall.points)
    low, high = float(along.min()), float(along.max())
    middle = wall.line.foot() + (low + high) / 2 * wall.line.direction()
    index2 = refractive_index_squared(wall)
    return Mirror(wall.line, low - margin, high + margin, index2, loss_error(wall), middle)


def composed_of(wall: Wall, mirrors: Sequence[Mirror]) -> bool:
    """Whether two or three bounces off mirrors explain most paths of a wall.

    Undoing a mirror takes the image one bounce back; when what is left is the image in another mirror, the paths
    from there to the receivers meet both in turn where these may stand, and lose no less than both, the wall is
    not needed.

    Parameters
    ----------
    mirrors : sequence of Mirror
        Accepted walls, the one in question not among them.
    """
    transmitters, counts = np.unique(wall.paths.transmitter, return_counts=True)
    if not mirrors or np.count_nonzero(counts > 1) > 1:  # a chain has no line that holds for other transmitters
        return False
    middle = wall.points[:, :2].mean(axis=0)
    away = np.sum((np.array([mirror.middle for mirror in mirrors]) - middle) ** 2, axis=-1)
    mirrors = [mirrors[i] for i in np.argsort(away, kind="stable")[:NEAREST]]
    one = transmitters[np.argmax(counts)]
    members = np.flatnonzero(wall.paths.transmitter == one)
    paths = wall.paths.take(members)
    tx = paths.tx[0, :2]
    spread = _image_slopes(wall.line, tx)
    covariance = spread @ wall.line.covariance @ spread.T
    explained = np.zeros(len(members), dtype=bool)
    for chain in _chains(tx, anchors(wall.line, tx), covariance, mirrors):
        explained |= _carries(paths, [mirrors[i] for i in chain])
    return bool(np.mean(explained) > 0.5)


def _chains(
    tx: FloatArray, image: FloatArray, covariance: FloatArray, mirrors: Sequence[Mirror]
) -> list[tuple[int, ...]]:
    """Sequences of mirrors, transmitter first, that take the transmitter to the image within the errors."""
    count = len(mirrors)
    normals = np.array([m.line.normal for m in mirrors])
    pivots = np.array([m.line.pivot for m in mirrors])
    offsets = np.array([m.line.offset for m in mirrors])
    own = np.array([m.line.covariance for m in mirrors])
    absolute = offsets + np.sum(unit(normals) * pivots, axis=-1)
    first = mirrored(tx, normals, absolute)
    slopes = image_slopes(normals, offsets, tx - pivots)
    spread = np.sqrt(np.trace(slopes @ own @ slopes.swapaxes(1, 2), axis1=1, axis2=2))
    radius = 4 * (np.sqrt(np.trace(covariance)) + 2 * spread.max() + SMOOTH)
    tree = cKDTree(first)
    once = mirrored(image, normals, absolute)  # by the last mirror, b
    few = slice(0, min(count, NEAREST_OF_THREE))
    twice = mirrored(once[few, None], normals[few], absolute[few]).reshape(-1, 2)  # and by the one before it, c
    near = tree.query(np.vstack([once, twice]), k=min(ALTERNATIVES, count), distance_upper_bound=radius)[1]
    near = near.reshape(count + len(twice), -1)
    row, column = np.nonzero(near < count)
    a = near[row, column]
    double = row < count
    b = np.where(double, row, (row - count) // max(few.stop, 1))
    middle = np.where(double, -1, (row - count) % max(few.stop, 1))
    possible = np.where(double, a != b, (a != middle) & (b != middle))
    found: list[tuple[int, ...]] = []
    for chosen, chain in (
        (possible & double, np.stack([a, b], axis=1)),
        (possible & ~double, np.stack([a, middle, b], axis=1)),
    ):
        chain = chain[chosen]
        place, total = np.broadcast_to(tx, (len(chain), 2)), np.zeros((len(chain), 2, 2))
        for mirror in chain.T:
            slope = image_slopes(normals[mirror], offsets[mirror], place - pivots[mirror])
            n = unit(normals[mirror])
            turn = np.eye(2) - 2 * n[:, :, None] * n[:, None, :]
            total = turn @ total @ turn + slope @ own[mirror] @ slope.swapaxes(1, 2)
            place = mirrored(place, normals[mirror], absolute[mirror])
        apart = image - place
        spreads = covariance + total + SMOOTH**2 * np.eye(2)
        chi2 = np.einsum("np,npq,nq->n", apart, np.linalg.inv(spreads), apart)
        found += [tuple(one) for one in chain[chi2 < GATE].tolist()]
    return found


def image_slopes(normal: FloatArray, offset: FloatArray, relative: FloatArray) -> FloatArray:
    """Derivatives (n, 2, 2) of images by (normal [degree], offset [m]), points (n, 2) counted from the pivots."""
    n, m = unit(normal), unit(normal + 90)
    depth, along = offset - np.sum(n * relative, axis=-1), np.sum(m * relative, axis=-1)
    return np.stack([np.deg2rad(2 * depth[..., None] * m - 2 * along[..., None] * n), 2 * n], axis=-1)


def _image_slopes(line: Line, point: FloatArray) -> FloatArray:
    """Derivative (2, 2) of a point's image by (normal [degree], offset [m])."""
    return image_slopes(np.array([line.normal]), np.array([line.offset]), (point - line.pivot)[None])[0]


def _carries(paths: Paths, chain: Sequence[Mirror]) -> BoolArray:
    """Whether (path,) paths can bounce off mirrors in turn, where these stand, and lose as little as they did."""
    images = [paths.tx[0, :2]]
    for mirror in chain:
        images.append(anchors(mirror.line, images[-1]))
    here = paths.rx[:, :2]
    level = np.linalg.norm(images[-1] - here, axis=-1)
    steep = level / np.hypot(level, paths.tx[:, 2] - paths.rx[:, 2])  # horizontal share of the ray
    possible = np.ones(len(paths), dtype=bool)
    loss = np.zeros(len(paths))
    error = paths.loss_std**2
    for mirror, image in zip(chain[::-1], images[:0:-1], strict=True):
        before, behind = mirror.line.depth(here), mirror.line.depth(image)
        crosses = before * behind < 0
        share = np.where(crosses, before, 0.0) / np.where(crosses, before - behind, 1.0)
        toward = image - here
        cosine = np.abs(toward @ unit(mirror.line.normal)) / np.linalg.norm(toward, axis=-1) * steep
        here = here + share[:, None] * toward
        along = mirror.line.along(here)
        possible &= crosses & (along > mirror.low) & (along < mirror.high)
        loss += reflection_loss(mirror.index2, cosine)
        error += mirror.loss_error**2
    return possible & (paths.loss > loss - LOSS_TOLERANCE - np.sqrt(error))


def orders_of_hidden_walls(walls: Sequence[Wall]) -> list[tuple[int, int, int]]:
    """Triples (one, other, known) where one and other are a double bounce off a known and a hidden wall in its orders.

    If the image of one is "hidden, then known", undoing the known mirror leaves the image in the hidden wall, hence the
    wall; "known, then hidden" must then be the image of other. Real walls meet this by accident only. Both orders lose
    about the same, and more than the known wall, which more paths share.
    """
    found = []
    main = np.array([np.bincount(wall.paths.transmitter).argmax() for wall in walls], dtype=np.int64)
    for one in np.unique(main):
        rows = np.flatnonzero(main == one).tolist()
        lines = [walls[i].line for i in rows]
        tx = walls[rows[0]].paths.tx[walls[rows[0]].paths.transmitter == one][0, :2]
        image = np.array([anchors(line, tx) for line in lines])
        slopes = [_image_slopes(line, tx) for line in lines]
        spread = np.array([np.sqrt(np.trace(s @ line.covariance @ s.T)) for s, line in zip(slopes, lines, strict=True)])
        loss = np.array([typical_loss(walls[i]) for i in rows])
        support = np.array([walls[i].support for i in rows])
        tree = cKDTree(image)
        for known, line in enumerate(lines):
            weaker = np.flatnonzero((support < support[known]) & (loss > loss[known] + EXTRA_LOSS))
            through_hidden = mirrored(image[weaker] - line.pivot, line.normal, line.offset) + line.pivot
            normal, offset = bisector(tx - through_hidden, np.zeros(2))
            expected = mirrored(image[known] - through_hidden, normal, offset) + through_hidden
            reach = 3 * (spread[weaker] + 2 * spread[known]) + SMOOTH
            for i, near in zip(weaker, tree.query_ball_point(expected, reach), strict=True):
                found += [
                    (rows[i], rows[j], rows[known])
                    for j in near
                    if j in weaker and j != i and abs(loss[i] - loss[j]) < LOSS_OF_ORDER
                ]
    return found
