"""Where the search for lines starts: a path and the partner with which it makes a line that many others agree with."""

import numpy as np

from erm.geometry.vertical import FloatArray, angle_difference, bisector
from erm.reconstruction.model.fit import fit_lines
from erm.reconstruction.model.line import Lines, seed_lines
from erm.reconstruction.model.paths import BoolArray, IntArray, Paths
from erm.reconstruction.model.ragged import Ragged, first_of_each, sums
from erm.reconstruction.search.images import GATE, REACH, Images, outer

PARTNERS = 8  # pairs with a seed that are tried as starts
BATCH = 200_000  # paths held against pairs in one go


def best_starts(images: Images, seeds: IntArray, partners: Ragged, free: BoolArray) -> tuple[Lines, Ragged]:
    """Line of each seed and the partner that the most free paths around agree with.

    Parameters
    ----------
    images : Images
    seeds : array (seed,) of int
    partners : Ragged
        Free partners of each seed; one at least.
    free : array (path,) of bool

    Returns
    -------
    lines : Lines
    seen : Ragged
        Partners tried and paths that agreed with any pair: what became of the others makes no difference.
    """
    paths = images.paths
    partners = _farthest(paths, seeds, partners)
    of = partners.owner
    guess = _joint_images(images, seeds[of], partners.rows)
    radius = 2 * REACH * images.across[seeds] + REACH * images.along[seeds]
    near = images.around(images.points[seeds], images.transmitter[seeds], radius)
    near = near.kept(free[near.rows])
    score = np.empty(len(guess))
    owners, seen = [of], [partners.rows]
    around = near.take(of)
    for part in around.parts(BATCH):
        some = around.part(part)
        agreeing = _agreement(images, guess[part][some.owner], some.rows)
        score[part] = sums(agreeing, some.start)
        agree = np.flatnonzero(agreeing)
        owners.append(of[part][some.owner[agree]])
        seen.append(some.rows[agree])
    owner, row = np.concatenate(owners), np.concatenate(seen)
    order = np.argsort(owner, kind="stable")
    score = np.round(score, 9)
    best = np.flatnonzero(score == np.maximum.reduceat(score, partners.start[:-1])[of])
    best = best[first_of_each(of[best])]
    return _lines_of_images(paths, seeds, partners.rows[best], guess[best]), Ragged.of_pairs(
        owner[order], row[order], len(seeds)
    )


def _farthest(paths: Paths, seeds: IntArray, partners: Ragged) -> Ragged:
    """Partners of each seed, of many those with the farthest receivers: these locate an image best."""
    of = partners.owner
    away = np.linalg.norm(paths.rx[partners.rows] - paths.rx[seeds[of]], axis=-1)
    order = np.lexsort((np.where(partners.sizes[of] > PARTNERS, -away, 0.0), of))
    place = np.arange(len(of)) - partners.start[of]
    return Ragged(partners.rows[order], partners.start).kept(place < PARTNERS)


def _agreement(images: Images, guess: FloatArray, rows: IntArray) -> FloatArray:
    """How well (row,) paths agree with images (row, 2): 1 if exactly, 0 outside the gate."""
    paths = images.paths
    rays = paths.rays.take(rows)
    east, north = guess[:, 0] - rays.rx_east, guess[:, 1] - rays.rx_north
    slant = np.sqrt(east * east + north * north + rays.climb**2)
    late = (rays.length - slant) / images.along[rows]
    aside = angle_difference(np.rad2deg(np.arctan2(north, east)), rays.azimuth) / rays.azimuth_std
    return np.maximum(0, 1 - (late**2 + aside**2) / GATE)


def _joint_images(images: Images, seed: IntArray, partner: IntArray) -> FloatArray:
    """Image (pair, 2) that seeds and their partners agree on, by three Gauss-Newton steps."""
    paths = images.paths
    pair = np.stack([seed, partner], axis=1)
    weight = np.linalg.inv(images.covariance[pair])
    information = np.linalg.inv(weight.sum(axis=1))
    place = np.einsum("hpq,hkqr,hkr->hp", information, weight, images.points[pair])
    climb = paths.tx[pair, 2] - paths.rx[pair, 2]
    for _ in range(3):
        seen = place[:, None] - paths.rx[pair, :2]
        level = np.hypot(seen[..., 0], seen[..., 1])
        toward = seen / level[..., None]
        left = np.stack([-toward[..., 1], toward[..., 0]], axis=-1)
        slant = np.hypot(level, climb)
        late = (paths.length[pair] - slant) / paths.length_std[pair]
        bearing = np.rad2deg(np.arctan2(seen[..., 1], seen[..., 0]))
        aside = (paths.azimuth[pair] - bearing + 180) % 360 - 180
        aside /= paths.azimuth_std[pair]
        by_length = toward * (level / slant / paths.length_std[pair])[..., None]
        by_azimuth = left * (1 / level / np.deg2rad(paths.azimuth_std[pair]))[..., None]
        normal = outer(by_length).sum(axis=1) + outer(by_azimuth).sum(axis=1)
        gradient = (by_length * late[..., None] + by_azimuth * aside[..., None]).sum(axis=1)
        place = place + np.linalg.solve(normal, gradient[..., None])[..., 0]
    return place


def _lines_of_images(paths: Paths, seed: IntArray, partner: IntArray, image: FloatArray) -> Lines:
    """Bisectors of transmitters and their images, with the uncertainty of two paths."""
    tx = paths.tx[seed, :2]
    pivot = (tx + paths.rx[seed, :2]) / 2
    normal, offset = bisector(tx - pivot, image - pivot)
    starts = Lines(normal, offset, np.zeros((len(seed), 2, 2)), pivot)
    pairs = Ragged(np.stack([seed, partner], axis=1).ravel(), 2 * np.arange(len(seed) + 1))
    frames = starts.frames(pairs.owner)
    depth = np.minimum(frames.depth(paths.tx[pairs.rows]), frames.depth(paths.rx[pairs.rows]))
    front = np.flatnonzero(depth.reshape(-1, 2).min(axis=1) > 0)
    fitted = fit_lines(paths.rays, pairs.take(front), starts.take(front))
    return seed_lines(paths.take(seed)).put(front, fitted)
