"""Chains of reflections off known walls: what they predict, and which paths they explain."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from erm.geometry.chains import chain_images
from erm.geometry.vertical import FloatArray, angle_difference, unit
from erm.reconstruction.decision.multi_bounce import CHAIN_LOSS_TOLERANCE, MAX_MIRROR_ERROR, mirror_of
from erm.reconstruction.model.fit import CHI_SQUARED_GATE
from erm.reconstruction.model.line import Lines
from erm.reconstruction.model.loss import DIFFUSE_EXCESS_LOSS, reflection_loss
from erm.reconstruction.model.paths import BoolArray, IntArray, Paths
from erm.reconstruction.model.ragged import first_of_each
from erm.reconstruction.model.wall import Wall
from erm.reconstruction.search.images import SEARCH_RADIUS, Images

MAX_CHAINS = 20_000
"""Chains that are searched at most, from all transmitters: a large city has more, and clutter for each. Chosen; not
derived."""
MAX_COMPARISONS = 1e8
"""Chains times paths that are searched at most. Chosen; not derived."""
RING_RADIUS = 3.0
"""Outer radius of the ring in which the background of chains is counted, in radii of the gate. Chosen; not derived."""
MAX_FALSE_SHARE = 0.05
"""Largest share of chains that may be found by chance. Chosen; not derived."""


class Prediction(NamedTuple):
    """What chains predict of paths, with slopes by the (normal, offset) of each of their walls."""

    length: FloatArray  # (path,) m
    azimuth: FloatArray  # (path,) degree
    length_slope: FloatArray  # (path, bounce, 2)
    azimuth_slope: FloatArray  # (path, bounce, 2)


class Chains(NamedTuple):
    """Paths and the walls that each met, the one nearest to the transmitter first; all met the same number of walls."""

    paths: Paths
    walls: IntArray  # (path, bounce)


def first_of_each_path(chains: Sequence[Chains]) -> list[Chains]:
    """The first chain of each path."""
    taken = np.empty(0, dtype=np.int64)
    result = []
    for one in chains:
        fresh = ~np.isin(one.paths.row, taken)
        taken = np.r_[taken, one.paths.row]
        result.append(Chains(one.paths.take(fresh), one.walls[fresh]))
    return [one for one in result if len(one.paths)]


def predict_chains(tx: FloatArray, rx: FloatArray, walls: IntArray, lines: Lines) -> Prediction:
    """Predict the paths (path,) of antennas (path, 3) that met walls (path, bounce), transmitter first, by images."""
    places, slopes = _images(tx[:, :2], walls, lines)
    apart = places[-1] - rx[:, :2]
    horizontal = np.hypot(apart[:, 0], apart[:, 1])
    slant = np.hypot(horizontal, tx[:, 2] - rx[:, 2])
    toward = apart / horizontal[:, None]
    left = np.stack([-toward[:, 1], toward[:, 0]], axis=-1)
    return Prediction(
        slant,
        np.rad2deg(np.arctan2(apart[:, 1], apart[:, 0])) % 360,
        np.einsum("p,pi,pbik->pbk", horizontal / slant, toward, slopes),
        np.rad2deg(np.einsum("p,pi,pbik->pbk", 1 / horizontal, left, slopes)),
    )


def _images(points: FloatArray, walls: IntArray, lines: Lines) -> tuple[list[FloatArray], FloatArray]:
    return chain_images(points, walls, lines.normal, lines.offset, lines.pivot)


class ChainSearch:
    """Search of paths by the images of chains.

    Parameters
    ----------
    walls, paths, max_gap
        See `erm.reconstruction.decision.adjust.adjust_walls`.
    """

    def __init__(self, walls: Sequence[Wall], paths: Paths, max_gap: float) -> None:
        self.paths, self.images = paths, Images(paths)
        mirrors = [mirror_of(wall, max_gap) for wall in walls]
        self.low, self.high, self.index_squared, self.loss_error = np.array(
            [(mirror.low, mirror.high, mirror.index_squared, mirror.loss_error) for mirror in mirrors]
        ).T

    def find(self, lines: Lines, covariance: FloatArray) -> list[Chains]:
        """Find the paths that chains of two, and of three, walls explain; each path has one chain."""
        count = len(lines.normal)
        first, second = np.nonzero(~np.eye(count, dtype=bool))
        found = []
        tried = np.stack([first, second], axis=1)
        for _ in range(2):
            chains = len(tried) * len(self.images.transmitters)
            if not 0 < chains <= MAX_CHAINS or len(tried) * len(self.paths) > MAX_COMPARISONS:
                break
            explained = self._explained(tried, lines, covariance)
            if explained is not None:
                found.append(explained)
            # chains of three: those that return to the first wall, and found pairs extended by any wall
            pairs = tried if explained is None else np.unique(explained.walls, axis=0)
            back = np.column_stack([tried, tried[:, 0]])
            longer = [np.column_stack([pairs, np.full(len(pairs), last)]) for last in range(count)] if explained else []
            tried = np.unique(np.vstack([back, *longer]), axis=0)
            tried = tried[tried[:, 1] != tried[:, 2]]
        return first_of_each_path(found)

    def _explained(self, tried: IntArray, lines: Lines, covariance: FloatArray) -> Chains | None:
        """Paths that chains (chain, bounce) explain; None if too many of them would be by chance."""
        transmitters = len(self.images.transmitters)
        chain = np.tile(tried, (transmitters, 1))
        of = np.repeat(np.arange(transmitters), len(tried))
        places, slopes = _images(self.images.transmitters[of, :2], chain, lines)
        spread = np.sqrt(np.einsum("cbik,cbkl,cbil->c", slopes, lines.covariance[chain], slopes))
        sharp = spread < MAX_MIRROR_ERROR  # a less certain chain agrees with paths off another face of the same facade
        chain, of, image, spread = chain[sharp], of[sharp], places[-1][sharp], spread[sharp]
        if not len(chain):
            return None
        near = self.images.near_points(image, of, RING_RADIUS * (self.images.radius + SEARCH_RADIUS * spread))
        chain, rows = chain[near.owner], near.rows
        paths = self.paths.take(rows)
        found = predict_chains(paths.tx, paths.rx, chain, lines)
        chi2 = _chi_squared(paths, found, chain, covariance)
        in_ring = (chi2 < RING_RADIUS**2 * CHI_SQUARED_GATE) & self.possible(paths, chain, lines)
        chain, rows, chi2 = chain[in_ring], rows[in_ring], chi2[in_ring]
        inside = chi2 < CHI_SQUARED_GATE
        by_chance = np.count_nonzero(~inside) / (RING_RADIUS**2 - 1)
        if by_chance > MAX_FALSE_SHARE * np.count_nonzero(inside):
            return None
        chain, rows, chi2 = chain[inside], rows[inside], chi2[inside]
        # one chain for each path, and one path of a link for each chain
        number = np.unique(chain, axis=0, return_inverse=True)[1].ravel()
        for of_path in (True, False):
            key = rows if of_path else number * (self.paths.link.max() + 1) + self.paths.link[rows]
            order = np.lexsort((chi2, key))
            best = np.sort(order[first_of_each(key[order])])
            chain, rows, chi2, number = chain[best], rows[best], chi2[best], number[best]
        return Chains(self.paths.take(rows), chain) if len(rows) else None

    def possible(self, paths: Paths, chain: IntArray, lines: Lines) -> BoolArray:
        """Whether (path,) the walls may stand where the paths would meet them, and lose what the paths lost."""
        places, _ = _images(paths.tx[:, :2], chain, lines)
        here = paths.rx[:, :2]
        horizontal = np.linalg.norm(places[-1] - here, axis=-1)
        cos_elevation = horizontal / np.hypot(horizontal, paths.tx[:, 2] - paths.rx[:, 2])
        possible = np.ones(len(paths), dtype=bool)
        loss, variance = np.zeros(len(paths)), paths.loss_std**2
        for wall, image in zip(chain.T[::-1], places[:0:-1], strict=True):
            frame = lines.frames(wall)
            near, far = frame.signed_distance(here), frame.signed_distance(image)
            possible &= (near > 0) & (far < 0)
            share = near / np.where(near - far > 0, near - far, np.inf)
            toward = image - here
            cosine = np.abs(np.sum(toward * unit(lines.normal[wall]), axis=-1))
            cosine = cosine / np.maximum(np.linalg.norm(toward, axis=-1), 1e-9) * cos_elevation
            here = here + share[:, None] * toward
            along = frame.along(here)
            possible &= (along > self.low[wall]) & (along < self.high[wall])
            loss += reflection_loss(self.index_squared[wall], cosine)
            variance = variance + self.loss_error[wall] ** 2
        error = np.sqrt(variance)
        least, most = loss - CHAIN_LOSS_TOLERANCE - error, loss + DIFFUSE_EXCESS_LOSS + 2 * error
        return possible & (paths.loss > least) & (paths.loss < most)


def _chi_squared(paths: Paths, found: Prediction, chain: IntArray, covariance: FloatArray) -> FloatArray:
    """Chi-squared (path,) of paths against chains, the uncertainty of the walls included."""
    spread = spread_of_chains(found, chain, covariance)
    spread[:, 0, 0] += paths.length_std**2
    spread[:, 1, 1] += paths.azimuth_std**2
    apart = np.stack([paths.length - found.length, angle_difference(paths.azimuth, found.azimuth)], axis=-1)
    return np.einsum("pi,pij,pj->p", apart, np.linalg.inv(spread), apart)


def spread_of_chains(found: Prediction, chain: IntArray, covariance: FloatArray) -> FloatArray:
    """Covariance (path, 2, 2) of predicted lengths and azimuths from that (wall, 2, wall, 2) of the walls."""
    slope = np.stack([found.length_slope, found.azimuth_slope], axis=1)  # (path, 2, bounce, 2)
    spread = np.zeros((len(chain), 2, 2))
    for one in range(chain.shape[1]):
        for other in range(chain.shape[1]):
            both = covariance[chain[:, one], :, chain[:, other]]
            spread += slope[:, :, one] @ both @ slope[:, :, other].swapaxes(1, 2)
    return spread
