"""Common images: paths off one vertical wall share the transmitter's mirror image, whatever the receiver.

Taken for single bounces, the paths of a transmitter point to images; where those of several receivers agree, there is a
wall, or a chain of walls that looks like one. Everything is looked up in a tree of these images, so the work grows
in proportion to the number of paths.
"""

from collections.abc import Sequence
from itertools import chain
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from erm.geometry import FloatArray, bisector, mirrored
from erm.walls.loss import scattered
from erm.walls.wall import STEPS, BoolArray, IntArray, Line, Paths, fit_line, misfit, seed_line

GATE = 13.8  # chi-squared of 2 degrees of freedom that one true path in a thousand exceeds
REACH = 4.0  # standard errors of azimuth within which an image is looked for
NEIGHBOURS = 24  # nearest images looked at for partners of a seed
PARTNERS = 8  # pairs with a seed that are tried as starts
ROUGHLY = 5  # steps of a fit whose members may yet change
DECIBEL = 0.5  # chi-squared a dB: of two paths of a link inside the gate the much stronger one is the wall's


class Group(NamedTuple):
    """A line and the paths that agree with it, at most one a link."""

    line: Line
    members: IntArray


class Images:
    """The images all paths point to, in a tree.

    Parameters
    ----------
    paths : Paths
        Paths longer than the direct one.
    """

    def __init__(self, paths: Paths) -> None:
        self.paths = paths
        self.points = paths.anchors()
        level = np.hypot(*(self.points - paths.rx[:, :2]).T)
        self.across = level * np.deg2rad(paths.azimuth_std)  # m
        # what the arc of the azimuth's error departs from its tangent counts as an error of the length
        self.along = np.hypot(paths.length * paths.length_std / level, self.across**2 / (2 * level))
        toward = (self.points - paths.rx[:, :2]) / level[:, None]
        left = np.stack([-toward[:, 1], toward[:, 0]], axis=-1)
        self.covariance = _outer(toward * self.along[:, None]) + _outer(left * self.across[:, None])
        self.transmitters = _places(paths)
        # transmitters lie apart in a third dimension, so that one tree serves them all
        spread = np.ptp(self.points, axis=0).max() if len(paths) else 0.0
        self.apart = 4.0 * (spread + REACH * self.across.max(initial=0.0) + 1.0)
        self.tree = cKDTree(np.column_stack([self.points, paths.transmitter * self.apart]))

    def around(self, points: FloatArray, transmitter: IntArray, radius: float) -> IntArray:
        """Paths whose images lie within a radius of points (n, 2) of different transmitters (n,), ascending."""
        if len(points) == 0 or len(self.paths) == 0:
            return np.empty(0, dtype=np.int64)
        near = self.tree.query_ball_point(
            np.column_stack([points, transmitter * self.apart]), radius, return_sorted=False
        )
        return np.sort(np.fromiter(chain.from_iterable(near), dtype=np.int64))

    def partners(self) -> tuple[IntArray, IntArray]:
        """Pairs (pair,) of paths of one transmitter and two links whose images agree within their errors."""
        count = min(NEIGHBOURS + 1, len(self.paths))
        if count < 2:
            return np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)
        radius = REACH * np.sqrt(2) * float(self.across.max())
        _, near = self.tree.query(self.tree.data, k=count, distance_upper_bound=max(radius, 1e-6), workers=-1)
        first = np.repeat(np.arange(len(self.paths)), count)
        second = near.ravel()
        kept = second < len(self.paths)
        first, second = first[kept], second[kept]
        kept = self.paths.link[first] != self.paths.link[second]
        first, second = first[kept], second[kept]
        apart = self.points[first] - self.points[second]
        agree = _mahalanobis(apart, self.covariance[first] + self.covariance[second]) < GATE
        return first[agree], second[agree]


def find_groups(
    paths: Paths, min_support: int, known: Sequence[Group] = (), seeds: BoolArray | None = None
) -> list[Group]:
    """Explain the paths by lines that at least ``min_support`` links agree on.

    Seeds are taken in the order of how many partners agree with them, then of their loss. Each seed and its partners
    make two-path lines; the one most paths agree with gathers these and is fitted to them until they no longer
    change, and they are taken out. In the end every path goes to the line it fits best.

    Parameters
    ----------
    known : sequence of Group
        Lines of an earlier search in a part of the paths; they gather first.
    seeds : array (path,) of bool, optional
        Paths that new lines may start from; by default all.
    """
    if len(paths) == 0:
        return []
    images = Images(paths)
    free = np.ones(len(paths), dtype=bool)
    taken = np.zeros(paths.row.max() + 1, dtype=bool)
    groups: list[Group] = []

    def keep(group: Group) -> None:
        groups.append(group)
        taken[paths.row[group.members]] = True
        np.logical_not(taken[paths.row], out=free)

    for group in known:
        grown = _settle(images, group.line, free)
        if grown is not None and len(grown.members) >= min_support:
            keep(grown)
    first, second = images.partners()
    start = np.searchsorted(first, np.arange(len(paths) + 1))
    agreeing = _distinct_links(first, paths.link[second], len(paths))
    several = len(images.transmitters) > 1  # a wall may have one path from each of several transmitters
    enough = agreeing >= (1 if several else min_support - 1)
    if seeds is not None:
        enough &= seeds
    order = np.lexsort((paths.length, np.round(paths.loss, 6), -agreeing))
    for seed in order[enough[order]]:
        if not free[seed]:
            continue
        with_seed = second[start[seed] : start[seed + 1]]
        with_seed = with_seed[free[with_seed]]
        if len(with_seed) == 0:
            continue
        line = _best_start(images, int(seed), with_seed, free)
        grown = _settle(images, line, free)
        if grown is not None and len(grown.members) >= min_support:
            keep(grown)
    return _reassigned(images, groups, min_support)


def _best_start(images: Images, seed: int, partners: IntArray, free: BoolArray) -> Line:
    """Line of the seed and the partner that the most paths around agree with."""
    paths = images.paths
    if len(partners) > PARTNERS:
        # receivers far apart locate an image best
        away = np.linalg.norm(paths.rx[partners] - paths.rx[seed], axis=-1)
        partners = partners[np.argsort(-away, kind="stable")[:PARTNERS]]
    guess = _joint_images(images, seed, partners)
    place, transmitter = images.points[seed : seed + 1], paths.transmitter[seed : seed + 1]
    near = images.around(place, transmitter, 2 * REACH * float(images.across[seed]) + REACH * float(images.along[seed]))
    near = near[free[near]]
    seen = guess[:, None] - paths.rx[near, :2]
    level = np.hypot(seen[..., 0], seen[..., 1])
    climb = paths.tx[near, 2] - paths.rx[near, 2]
    late = (paths.length[near] - np.hypot(level, climb)) / images.along[near]
    aside = np.rad2deg(np.arctan2(seen[..., 1], seen[..., 0])) - paths.azimuth[near]
    aside = ((aside + 180) % 360 - 180) / paths.azimuth_std[near]
    score = np.maximum(0, 1 - (late**2 + aside**2) / GATE).sum(axis=1)
    best = int(np.argmax(np.round(score, 9)))
    return _line_of_image(paths, seed, int(partners[best]), guess[best])


def _joint_images(images: Images, seed: int, partners: IntArray) -> FloatArray:
    """Image (partner, 2) that the seed and each partner agree on, by three Gauss-Newton steps."""
    paths = images.paths
    pair = np.stack([np.full(len(partners), seed), partners], axis=1)  # (h, 2)
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
        normal = _outer(by_length).sum(axis=1) + _outer(by_azimuth).sum(axis=1)
        gradient = (by_length * late[..., None] + by_azimuth * aside[..., None]).sum(axis=1)
        place = place + np.linalg.solve(normal, gradient[..., None])[..., 0]
    return place


def _line_of_image(paths: Paths, seed: int, partner: int, image: FloatArray) -> Line:
    """Bisector of a transmitter and its image, with the uncertainty of two paths."""
    tx = paths.tx[seed, :2]
    pivot = (tx + paths.rx[seed, :2]) / 2
    normal, offset = bisector(tx - pivot, image - pivot)
    two = paths.take(np.array([seed, partner]))
    start = Line(float(normal), float(offset), np.zeros((2, 2)), pivot)
    if min(start.depth(two.tx).min(), start.depth(two.rx).min()) <= 0:
        return seed_line(two)
    return fit_line(two, start)


def _settle(images: Images, line: Line, free: BoolArray) -> Group | None:
    """Let a line gather the free paths that agree with it, and fit it to them, until they no longer change."""
    members = np.empty(0, dtype=np.int64)
    for _ in range(12):
        gathered = gather(images, line, free)
        if len(gathered) < 2:
            return None
        settled = np.array_equal(gathered, members)
        line = fit_line(images.paths.take(gathered), line, STEPS if settled else ROUGHLY)
        if settled:
            return Group(line, members)
        members = gathered
    return Group(line, gather(images, line, free))


def gather(images: Images, line: Line, free: BoolArray) -> IntArray:
    """Free paths that agree with a line, the best of each link; ascending."""
    paths = images.paths
    places = images.transmitters
    front = np.flatnonzero(line.depth(places) > 0)
    images_of = mirrored(places[front, :2] - line.pivot, line.normal, line.offset) + line.pivot
    radius = REACH * float(images.across.max(initial=0.0) + images.along.max(initial=0.0))
    near = images.around(images_of, front, radius)
    near = near[free[near]]
    if len(near) == 0:
        return near
    chi2 = misfit(paths.take(near), line)
    inside = np.flatnonzero(chi2 < GATE)
    cost = chi2[inside] + DECIBEL * paths.loss[near[inside]]
    link = paths.link[near[inside]]
    rank = np.lexsort((cost, link))
    first = np.r_[True, link[rank][1:] != link[rank][:-1]][: len(rank)]
    return np.sort(near[inside[rank[first]]])


def _reassigned(images: Images, groups: list[Group], min_support: int) -> list[Group]:
    """Groups after each path went to the line it fits best; those that lost too many are gone."""
    paths = images.paths
    everything = np.ones(len(paths), dtype=bool)
    claims = [gather(images, group.line, everything) for group in groups]
    if not claims:
        return []
    path = np.concatenate(claims)
    owner = np.repeat(np.arange(len(groups)), [len(claim) for claim in claims])
    cost = np.concatenate([misfit(paths.take(claim), group.line) for claim, group in zip(claims, groups, strict=True)])
    # a path between two lines stays with the better supported one unless the other is clearly better
    cost -= np.log(np.array([len(claim) for claim in claims]))[owner]
    rank = np.lexsort((owner, cost, paths.row[path]))
    best = rank[np.r_[True, paths.row[path][rank][1:] != paths.row[path][rank][:-1]][: len(rank)]]
    result = []
    for number, group in enumerate(groups):
        members = np.sort(path[best[owner[best] == number]])
        if len(members) < min_support:
            continue
        line = fit_line(paths.take(members), group.line)
        mirrored_ones = ~scattered(paths.take(members), line)
        if mirrored_ones.sum() >= min_support:
            members = members[mirrored_ones]
            result.append(Group(line if mirrored_ones.all() else fit_line(paths.take(members), line), members))
    return result


def _places(paths: Paths) -> FloatArray:
    """Where (transmitter, 3) each transmitter stood."""
    places = np.zeros((paths.transmitter.max(initial=-1) + 1, 3))
    places[paths.transmitter] = paths.tx
    return places


def _distinct_links(first: IntArray, link: IntArray, count: int) -> IntArray:
    """Number (path,) of different links among the partners of each path."""
    pairs = np.unique(np.stack([first, link], axis=1), axis=0) if len(first) else np.empty((0, 2), dtype=np.int64)
    return np.bincount(pairs[:, 0], minlength=count)


def _outer(vector: FloatArray) -> FloatArray:
    return vector[..., :, None] * vector[..., None, :]


def _mahalanobis(apart: FloatArray, covariance: FloatArray) -> FloatArray:
    """``d' C**-1 d`` of vectors (..., 2)."""
    a, b, d = covariance[..., 0, 0], covariance[..., 0, 1], covariance[..., 1, 1]
    x, y = apart[..., 0], apart[..., 1]
    return (x * x * d - 2 * x * y * b + y * y * a) / (a * d - b * b)
