"""Walls fitted to everything they reflected: chains of bounces off known walls say where these stand, too.

Each bounce of a chain moves its image by twice the error of a wall, and later bounces of a street meet its walls more
steeply than the first: a few chains may tell more of a wall than all single bounces off it. So, once it is known which
images are walls, the lines of all are fitted together to their own paths and to those that bounced off two or three.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from erm.geometry.vertical import FloatArray, angle_difference, mirrored, unit
from erm.reconstruction.decision.multi_bounce import LOSS_TOLERANCE, image_slopes, mirror_of
from erm.reconstruction.model.fit import HUBER, STEPS
from erm.reconstruction.model.line import Lines
from erm.reconstruction.model.loss import SCATTERED, reflection_loss
from erm.reconstruction.model.paths import BoolArray, IntArray, Paths
from erm.reconstruction.model.ragged import first_of_each
from erm.reconstruction.model.wall import Wall
from erm.reconstruction.search.images import GATE, REACH, Images

MOST_CHAINS = 20_000  # looked for, from all transmitters; a large city has more, and paths of chance for each
MOST = 1e8  # chains times paths among which they are looked for
BY_CHANCE = 0.05  # share of chains that may have been found by chance
RING = 3.0  # outer radius of the ring in which chance is counted, in radii of the gate
ROUNDS = 3  # of looking for chains and fitting; the lines of one find the chains of the next
SETTLED = 1e-9  # degree, m


class Prediction(NamedTuple):
    """What chains predict of paths, and its slopes by the (normal, offset) of each of their walls."""

    length: FloatArray  # (path,) m
    azimuth: FloatArray  # (path,) degree
    length_slope: FloatArray  # (path, bounce, 2)
    azimuth_slope: FloatArray  # (path, bounce, 2)


class Chains(NamedTuple):
    """Paths and the walls that each met, from the transmitter on: all the same number of walls."""

    paths: Paths
    walls: IntArray  # (path, bounce)


def adjusted(walls: Sequence[Wall], paths: Paths, max_gap: float) -> tuple[list[Wall], IntArray]:
    """Walls fitted together to their members and to the chains among other paths; and the rows of these chains.

    Parameters
    ----------
    walls : sequence of Wall
        All of the map.
    paths : Paths
        Members of none, that vertical faces may have reflected.
    max_gap : float
        How far beyond its outermost reflection points a wall may reflect [m].
    """
    none = np.empty(0, dtype=np.int64)
    if len(walls) < 2 or not len(paths):
        return list(walls), none
    lines = Lines.of([wall.line for wall in walls])
    count = len(walls)
    covariance = np.zeros((count, 2, count, 2))
    covariance[np.arange(count), :, np.arange(count)] = lines.covariance
    own = [Chains(wall.paths, np.full((wall.support, 1), number)) for number, wall in enumerate(walls)]
    search = Search(walls, paths, max_gap)
    found: list[Chains] = []
    for _ in range(ROUNDS):
        before, found = found, search.chains(lines, covariance)
        if not found:
            return list(walls), none
        lines, covariance = fitted([*own, *found], lines)
        if [chains.paths.row.tolist() for chains in before] == [chains.paths.row.tolist() for chains in found]:
            break
    lines = lines._replace(covariance=lines.covariance * shared([*own, *found], lines, covariance))
    return (
        [replace(wall, line=lines.one(number)) for number, wall in enumerate(walls)],
        np.concatenate([chains.paths.row for chains in found]),
    )


def predicted(tx: FloatArray, rx: FloatArray, walls: IntArray, lines: Lines) -> Prediction:
    """Predict paths that met walls (path, bounce), transmitter first, by their images.

    A wall's slopes of an image are turned by all reflections after it.
    """
    place, slopes = images_of(tx[:, :2], walls, lines)
    seen = place[-1] - rx[:, :2]
    level = np.hypot(seen[:, 0], seen[:, 1])
    slant = np.hypot(level, tx[:, 2] - rx[:, 2])
    toward = seen / level[:, None]
    left = np.stack([-toward[:, 1], toward[:, 0]], axis=-1)
    return Prediction(
        slant,
        np.rad2deg(np.arctan2(seen[:, 1], seen[:, 0])) % 360,
        np.einsum("p,pi,pbik->pbk", level / slant, toward, slopes),
        np.rad2deg(np.einsum("p,pi,pbik->pbk", 1 / level, left, slopes)),
    )


def images_of(point: FloatArray, walls: IntArray, lines: Lines) -> tuple[list[FloatArray], FloatArray]:
    """Images (path, 2) of points before and after each wall of chains (path, bounce), and slopes of the last of them.

    The slopes (path, bounce, 2, 2) are by the (normal, offset) of each wall.
    """
    places, slopes = [point], np.zeros((len(point), walls.shape[1], 2, 2))
    for bounce, wall in enumerate(walls.T):
        normal, offset, pivot = lines.normal[wall], lines.offset[wall], lines.pivot[wall]
        n = unit(normal)
        turn = np.eye(2) - 2 * n[:, :, None] * n[:, None, :]
        slopes[:, :bounce] = turn[:, None] @ slopes[:, :bounce]
        slopes[:, bounce] = image_slopes(normal, offset, places[-1] - pivot)
        places.append(mirrored(places[-1] - pivot, normal, offset) + pivot)
    return places, slopes


def fitted(sets: Sequence[Chains], lines: Lines) -> tuple[Lines, FloatArray]:
    """Most likely lines of all walls together, and their covariance (wall, 2, wall, 2).

    As in `erm.reconstruction.model.fit.fit_lines` residuals beyond `HUBER` standard errors pull with constant force.
    """
    count = len(lines.normal)
    covariance = np.zeros((2 * count, 2 * count))
    for _ in range(STEPS):
        normal, gradient = np.zeros((2 * count, 2 * count)), np.zeros(2 * count)
        for row, pull, _ in _pulls(sets, lines):
            normal += row.T @ row
            gradient += row.T @ pull
        scale = 1 / np.sqrt(np.diag(normal))
        covariance = np.linalg.inv(normal * scale[:, None] * scale) * scale[:, None] * scale
        step = (covariance @ gradient).reshape(count, 2)
        lines = lines._replace(normal=(lines.normal + step[:, 0]) % 360, offset=lines.offset + step[:, 1])
        if np.abs(step).max() < SETTLED:
            break
    whole = covariance.reshape(count, 2, count, 2)
    return lines._replace(covariance=whole[np.arange(count), :, np.arange(count)]), whole


def shared(sets: Sequence[Chains], lines: Lines, covariance: FloatArray) -> float:
    """By how much variances grow for errors that all paths of a link share, as those of its antennas' places.

    Were all errors independent, the pulls ``g`` of the links on the parameters would add up to ``sum g'C g`` equal to
    the number of these. What it exceeds that by, if by more than two standard errors, is shared; 1 if it does not.
    """
    size = 2 * len(lines.normal)
    pulls, links = [], []
    for row, pull, link in _pulls(sets, lines):
        pulls.append(row * pull[:, None])
        links.append(link)
    _, of = np.unique(np.concatenate(links), return_inverse=True)
    each = np.zeros((of.max() + 1, size))
    np.add.at(each, of, np.concatenate(pulls))
    strain = np.einsum("lp,pq,lq->l", each, covariance.reshape(size, size), each) / size
    sure = float(strain.sum() - 2 * np.sqrt(np.sum((strain - strain.mean()) ** 2)))
    return float(strain.sum()) if sure > 1 else 1.0


def _pulls(sets: Sequence[Chains], lines: Lines) -> Iterator[tuple[FloatArray, FloatArray, IntArray]]:
    """Slopes (path, 2 wall) and residuals (path,) of lengths and azimuths, by their standard errors, and links."""
    for paths, walls in sets:
        found = predicted(paths.tx, paths.rx, walls, lines)
        column = 2 * walls[:, :, None] + np.arange(2)
        for residual, slope, std in (
            (paths.length - found.length, found.length_slope, paths.length_std),
            (angle_difference(paths.azimuth, found.azimuth), found.azimuth_slope, paths.azimuth_std),
        ):
            # a wall that was met twice has two entries in a row, which add up
            row = np.zeros((len(paths), 2 * len(lines.normal)))
            np.add.at(row, (np.arange(len(paths))[:, None, None], column), slope)
            weight = np.sqrt(np.minimum(1.0, HUBER / np.maximum(np.abs(residual / std), HUBER))) / std
            yield row * weight[:, None], residual * weight, paths.link


class Search:
    """Paths looked up by the images of chains.

    Parameters
    ----------
    walls, paths, max_gap
        See `adjusted`.
    """

    def __init__(self, walls: Sequence[Wall], paths: Paths, max_gap: float) -> None:
        self.paths, self.images = paths, Images(paths)
        self.mirrors = [mirror_of(wall, max_gap) for wall in walls]
        self.low, self.high, self.index2, self.loss_error = np.array(
            [(mirror.low, mirror.high, mirror.index2, mirror.loss_error) for mirror in self.mirrors]
        ).T

    def chains(self, lines: Lines, covariance: FloatArray) -> list[Chains]:
        """Paths that two or three of the walls explain, each by one chain, and no others nearly as well."""
        count = len(lines.normal)
        first, second = np.nonzero(~np.eye(count, dtype=bool))
        found = []
        tried = np.stack([first, second], axis=1)
        for _ in range(2):
            chains = len(tried) * len(self.images.transmitters)
            if not 0 < chains <= MOST_CHAINS or len(tried) * len(self.paths) > MOST:
                break
            some = self._met(tried, lines, covariance)
            if some is not None:
                found.append(some)
            # of three walls, such as two of which were met in this order, or that came back to the first
            pairs = tried if some is None else np.unique(some.walls, axis=0)
            back = np.column_stack([tried, tried[:, 0]])
            longer = [np.column_stack([pairs, np.full(len(pairs), last)]) for last in range(count)] if some else []
            tried = np.unique(np.vstack([back, *longer]), axis=0)
            tried = tried[tried[:, 1] != tried[:, 2]]
        taken: set[int] = set()
        result = []
        for some in found:
            fresh = ~np.isin(some.paths.row, list(taken))
            taken |= set(some.paths.row.tolist())
            result.append(Chains(some.paths.take(fresh), some.walls[fresh]))
        return [some for some in result if len(some.paths)]

    def _met(self, tried: IntArray, lines: Lines, covariance: FloatArray) -> Chains | None:
        """Paths that chains (chain, bounce) explain."""
        transmitters = len(self.images.transmitters)
        chain = np.tile(tried, (transmitters, 1))
        of = np.repeat(np.arange(transmitters), len(tried))
        places, slopes = images_of(self.images.transmitters[of, :2], chain, lines)
        spread = np.sqrt(np.einsum("cbik,cbkl,cbil->c", slopes, lines.covariance[chain], slopes))
        near = self.images.around(places[-1], of, RING * (self.images.radius + REACH * spread))
        chain, rows = chain[near.owner], near.rows
        paths = self.paths.take(rows)
        found = predicted(paths.tx, paths.rx, chain, lines)
        chi2 = _chi_squared(paths, found, chain, covariance)
        near_by = (chi2 < RING**2 * GATE) & self._possible(paths, chain, lines)
        chain, rows, chi2 = chain[near_by], rows[near_by], chi2[near_by]
        inside = chi2 < GATE
        by_chance = np.count_nonzero(~inside) / (RING**2 - 1)
        if by_chance > BY_CHANCE * np.count_nonzero(inside):
            return None
        chain, rows, chi2 = chain[inside], rows[inside], chi2[inside]
        # one chain for each path, one path a link for each chain: a path given twice counts once
        number = np.unique(chain, axis=0, return_inverse=True)[1].ravel()
        for of_path in (True, False):
            key = rows if of_path else number * (self.paths.link.max() + 1) + self.paths.link[rows]
            order = np.lexsort((chi2, key))
            best = np.sort(order[first_of_each(key[order])])
            chain, rows, chi2, number = chain[best], rows[best], chi2[best], number[best]
        return Chains(self.paths.take(rows), chain) if len(rows) else None

    def _possible(self, paths: Paths, chain: IntArray, lines: Lines) -> BoolArray:
        """Whether (path,) walls may stand where the paths would meet them, and would take as much of them."""
        places, _ = images_of(paths.tx[:, :2], chain, lines)
        here = paths.rx[:, :2]
        level = np.linalg.norm(places[-1] - here, axis=-1)
        steep = level / np.hypot(level, paths.tx[:, 2] - paths.rx[:, 2])
        possible = np.ones(len(paths), dtype=bool)
        loss, error = np.zeros(len(paths)), paths.loss_std**2
        for wall, image in zip(chain.T[::-1], places[:0:-1], strict=True):
            frame = lines.frames(wall)
            before, behind = frame.depth(here), frame.depth(image)
            possible &= (before > 0) & (behind < 0)
            share = before / np.where(before - behind > 0, before - behind, np.inf)
            toward = image - here
            cosine = np.abs(np.sum(toward * unit(lines.normal[wall]), axis=-1))
            cosine = cosine / np.maximum(np.linalg.norm(toward, axis=-1), 1e-9) * steep
            here = here + share[:, None] * toward
            along = frame.along(here)
            possible &= (along > self.low[wall]) & (along < self.high[wall])
            loss += reflection_loss(self.index2[wall], cosine)
            error = error + self.loss_error[wall] ** 2
        error = np.sqrt(error)
        return possible & (paths.loss > loss - LOSS_TOLERANCE - error) & (paths.loss < loss + SCATTERED + 2 * error)


def _chi_squared(paths: Paths, found: Prediction, chain: IntArray, covariance: FloatArray) -> FloatArray:
    """Chi-squared (path,) of paths against chains, the uncertainty of the walls included."""
    slope = np.stack([found.length_slope, found.azimuth_slope], axis=1)  # (path, 2, bounce, 2)
    spread = np.zeros((len(paths), 2, 2))
    for one in range(chain.shape[1]):
        for other in range(chain.shape[1]):
            both = covariance[chain[:, one], :, chain[:, other]]
            spread += slope[:, :, one] @ both @ slope[:, :, other].swapaxes(1, 2)
    spread[:, 0, 0] += paths.length_std**2
    spread[:, 1, 1] += paths.azimuth_std**2
    apart = np.stack([paths.length - found.length, angle_difference(paths.azimuth, found.azimuth)], axis=-1)
    return np.einsum("pi,pij,pj->p", apart, np.linalg.inv(spread), apart)
