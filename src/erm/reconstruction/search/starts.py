"""Starting lines of the search: each seed path with the partner whose common line the most other paths agree with."""

import numpy as np

from erm.geometry.vertical import FloatArray, angle_difference, bisector
from erm.reconstruction.model.fit import CHI_SQUARED_GATE, fit_lines
from erm.reconstruction.model.line import Lines, seed_lines
from erm.reconstruction.model.paths import BoolArray, IntArray, Paths
from erm.reconstruction.model.ragged import Ragged, first_of_each, list_sums
from erm.reconstruction.search.images import SEARCH_RADIUS, Images, outer

MAX_PARTNERS = 8
"""Partners of a seed that are tried. Chosen; not derived."""
BATCH_COMPARISONS = 200_000
"""Paths compared with common images at once. Chosen; not derived."""


def best_starts(images: Images, seeds: IntArray, partners: Ragged, free: BoolArray) -> tuple[Lines, Ragged]:
    """Line of each seed and of that partner with which the most free paths agree.

    Parameters
    ----------
    images : Images
    seeds : array (seed,) of int
    partners : Ragged
        Free partners of each seed; at least one.
    free : array (path,) of bool

    Returns
    -------
    lines : Lines
    depends_on : Ragged
        Partners that were tried and paths that agreed with any pair: whether others are free makes no difference.
    """
    paths = images.paths
    partners = _farthest(paths, seeds, partners)
    of = partners.owner
    common = _common_images(images, seeds[of], partners.rows)
    radius = 2 * SEARCH_RADIUS * images.across[seeds] + SEARCH_RADIUS * images.along[seeds]
    near = images.near_points(images.points[seeds], images.transmitter[seeds], radius)
    near = near.masked(free[near.rows])
    score = np.empty(len(common))
    owners, depends_on = [of], [partners.rows]
    around = near.take(of)
    for part in around.batches(BATCH_COMPARISONS):
        own = around.batch(part)
        agreement = _agreement(images, common[part][own.owner], own.rows)
        score[part] = list_sums(agreement, own.start)
        agree = np.flatnonzero(agreement)
        owners.append(of[part][own.owner[agree]])
        depends_on.append(own.rows[agree])
    score = np.round(score, 9)
    best = np.flatnonzero(score == np.maximum.reduceat(score, partners.start[:-1])[of])
    best = best[first_of_each(of[best])]
    lines = _lines_of_images(paths, seeds, partners.rows[best], common[best])
    return lines, Ragged.from_parts(owners, depends_on, len(seeds))


def _farthest(paths: Paths, seeds: IntArray, partners: Ragged) -> Ragged:
    """Partners of each seed; of too many those with the farthest receivers, which locate an image best."""
    of = partners.owner
    away = np.linalg.norm(paths.rx[partners.rows] - paths.rx[seeds[of]], axis=-1)
    order = np.lexsort((np.where(partners.sizes[of] > MAX_PARTNERS, -away, 0.0), of))
    place = np.arange(len(of)) - partners.start[of]
    return Ragged(partners.rows[order], partners.start).masked(place < MAX_PARTNERS)


def _agreement(images: Images, common: FloatArray, rows: IntArray) -> FloatArray:
    """Agreement (row,) of paths with images (row, 2): 1 if exact, 0 outside the gate."""
    paths = images.paths
    columns = paths.columns.take(rows)
    east, north = common[:, 0] - columns.rx_east, common[:, 1] - columns.rx_north
    slant = np.sqrt(east * east + north * north + columns.height_difference**2)
    length = (columns.length - slant) / images.along[rows]
    azimuth = angle_difference(np.rad2deg(np.arctan2(north, east)), columns.azimuth) / columns.azimuth_std
    return np.maximum(0, 1 - (length**2 + azimuth**2) / CHI_SQUARED_GATE)


def _common_images(images: Images, seed: IntArray, partner: IntArray) -> FloatArray:
    """Images (pair, 2) that seeds and their partners agree on, by three Gauss-Newton steps from their weighted mean."""
    paths = images.paths
    pair = np.stack([seed, partner], axis=1)
    weight = np.linalg.inv(images.covariance[pair])
    covariance = np.linalg.inv(weight.sum(axis=1))
    place = np.einsum("hpq,hkqr,hkr->hp", covariance, weight, images.points[pair])
    height_difference = paths.tx[pair, 2] - paths.rx[pair, 2]
    for _ in range(3):
        apart = place[:, None] - paths.rx[pair, :2]
        horizontal = np.hypot(apart[..., 0], apart[..., 1])
        toward = apart / horizontal[..., None]
        left = np.stack([-toward[..., 1], toward[..., 0]], axis=-1)
        slant = np.hypot(horizontal, height_difference)
        length = (paths.length[pair] - slant) / paths.length_std[pair]
        azimuth = np.rad2deg(np.arctan2(apart[..., 1], apart[..., 0]))
        azimuth = (paths.azimuth[pair] - azimuth + 180) % 360 - 180
        azimuth /= paths.azimuth_std[pair]
        by_length = toward * (horizontal / slant / paths.length_std[pair])[..., None]
        by_azimuth = left * (1 / horizontal / np.deg2rad(paths.azimuth_std[pair]))[..., None]
        normal = outer(by_length).sum(axis=1) + outer(by_azimuth).sum(axis=1)
        gradient = (by_length * length[..., None] + by_azimuth * azimuth[..., None]).sum(axis=1)
        place = place + _solved(normal, gradient)
    return place


def _solved(normal: FloatArray, gradient: FloatArray) -> FloatArray:
    """Steps (pair, 2) of least squares; the shortest ones where a place has gone so far that azimuths say nothing."""
    try:
        return np.asarray(np.linalg.solve(normal, gradient[..., None])[..., 0])
    except np.linalg.LinAlgError:
        return np.asarray((np.linalg.pinv(normal, hermitian=True) @ gradient[..., None])[..., 0])


def _lines_of_images(paths: Paths, seed: IntArray, partner: IntArray, image: FloatArray) -> Lines:
    """Bisectors of transmitters and images (pair, 2), fitted to seeds and partners.

    Where an antenna would be behind the line, the line of the seed alone is returned.
    """
    tx = paths.tx[seed, :2]
    pivot = (tx + paths.rx[seed, :2]) / 2
    normal, offset = bisector(tx - pivot, image - pivot)
    starts = Lines(normal, offset, np.zeros((len(seed), 2, 2)), pivot)
    pairs = Ragged(np.stack([seed, partner], axis=1).ravel(), 2 * np.arange(len(seed) + 1))
    frames = starts.frames(pairs.owner)
    distance = np.minimum(frames.signed_distance(paths.tx[pairs.rows]), frames.signed_distance(paths.rx[pairs.rows]))
    front = np.flatnonzero(distance.reshape(-1, 2).min(axis=1) > 0)
    fitted = fit_lines(paths.columns, pairs.take(front), starts.take(front))
    return seed_lines(paths.take(seed)).with_replaced(front, fitted)
