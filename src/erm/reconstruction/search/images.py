"""The images all paths point to, in a tree."""

from copy import copy
from itertools import chain
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from erm.geometry.vertical import FloatArray, unit
from erm.reconstruction.model.grid import Grid
from erm.reconstruction.model.line import Lines
from erm.reconstruction.model.paths import BoolArray, IntArray, Paths
from erm.reconstruction.model.ragged import Ragged

GATE = 13.8  # chi-squared of 2 degrees of freedom that one true path in a thousand exceeds
REACH = 4.0  # standard errors of azimuth within which an image is looked for
NEIGHBOURS = 24  # nearest images looked at for partners of a seed
LAYERS = (0.75, 0.97)  # shares of paths that are looked for in grids of their own, the surest first
FEW = 1000  # paths that one grid is enough for
BATCH = 65536  # paths whose neighbours are looked at in one go
STRIP = 16.0  # m; wider than most errors of images, narrower than a city
MARGIN = 1.25  # of what a path's own range departs from the line's


class Layer(NamedTuple):
    """Paths that know their images about equally well."""

    rows: IntArray
    spread: float  # m2; largest variance of an image, along and across
    grid: Grid


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
        self.covariance = outer(toward * self.along[:, None]) + outer(left * self.across[:, None])
        _, first, self.transmitter = np.unique(paths.transmitter, return_index=True, return_inverse=True)
        self.transmitters = paths.tx[first]
        # transmitters lie apart in a third dimension, so that one tree serves them all
        spread = np.ptp(self.points, axis=0).max() if len(paths) else 0.0
        self.apart = 4.0 * (spread + REACH * self.across.max(initial=0.0) + 1.0)
        places = np.column_stack([self.points, self.transmitter * self.apart])
        self.tree = cKDTree(places)
        self.radius = REACH * float(self.across.max(initial=0.0) + self.along.max(initial=0.0))
        self._spread = self.across**2 + self.along**2
        edges = np.quantile(self._spread, LAYERS) if len(paths) > FEW else []
        self._layer = np.searchsorted(edges, self._spread)
        self.layers = self._layers(np.arange(len(paths)))

    def without(self, free: BoolArray) -> "Images":
        """Return the same images, of which `about` tells the free ones (path,) only; itself while most are."""
        if 2 * np.count_nonzero(free) > sum(len(layer.rows) for layer in self.layers):
            return self
        return self.only(np.flatnonzero(free))

    def only(self, rows: IntArray) -> "Images":
        """Return the same images, of which `about` tells some paths (row,) only."""
        fewer = copy(self)
        fewer.layers = self._layers(rows)
        return fewer

    def _layers(self, rows: IntArray) -> list[Layer]:
        layers = []
        for number in np.unique(self._layer[rows]):
            own = rows[self._layer[rows] == number]
            most = float(self._spread[own].max())
            grid = Grid(self.points[own], self.transmitter[own], MARGIN * float(np.sqrt(GATE * most)))
            layers.append(Layer(own, most, grid))
        return layers

    def around(self, points: FloatArray, transmitter: IntArray, radius: FloatArray | float) -> Ragged:
        """Paths whose images lie within radii of points (n, 2), each of one transmitter (n,)."""
        return within(self.tree, np.column_stack([points, transmitter * self.apart]), radius)

    def about(self, lines: Lines, gates: float = 1.0) -> tuple[IntArray, IntArray]:
        """Pairs (line, path) in which a path may agree with a line: its image lies near the line's of its transmitter.

        Of a path inside the gate, azimuth and length each depart from what the line predicts by no more than
        ``sqrt(GATE)`` standard errors, its own and the line's together, whose image has the covariance ``S C S'``.
        ``gates`` widens the gate so many times.
        """
        tx, n = self.transmitters[:, :2], unit(lines.normal)
        depth = n @ tx.T - (lines.offset + np.sum(n * lines.pivot, axis=-1))[:, None]
        line, front = np.nonzero(depth > 0)
        images = tx[front] - 2 * depth[line, front, None] * n[line]
        aside = np.sum((tx[front] - lines.pivot[line]) * n[line][:, ::-1] * [-1.0, 1.0], axis=-1)
        turn, both, shift = lines.covariance[line][:, [0, 0, 1], [0, 1, 1]].T
        # the image moves by 2 depth along the wall and 2 aside towards it a radian, and by 2 towards it a metre
        wide = (
            np.deg2rad(np.deg2rad(turn)) * (depth[line, front] ** 2 + aside**2) - 2 * np.deg2rad(both) * aside + shift
        )
        pairs = []
        for layer in self.layers:
            radius = gates * np.minimum(MARGIN * np.sqrt(GATE * (layer.spread + 8 * wide)), self.radius)
            near, path, square = layer.grid.within(images, front, radius)
            path = layer.rows[path]
            own = np.flatnonzero(square <= (gates * MARGIN) ** 2 * GATE * (self._spread[path] + 8 * wide[near]))
            pairs.append((line[near[own]], path[own]))
        nothing = np.empty(0, dtype=np.int64)
        of, rows = zip((nothing, nothing), *pairs, strict=True)
        return np.concatenate(of), np.concatenate(rows)

    def partners(self, seeds: BoolArray | None = None) -> Ragged:
        """Paths of the same transmitter and another link whose images agree with that of each within their errors.

        Of others than ``seeds`` (path,) none are told.
        """
        total = len(self.paths)
        count = min(NEIGHBOURS + 1, total)
        if count < 2:
            return Ragged(np.empty(0, dtype=np.int64), np.zeros(total + 1, dtype=np.int64))
        bound = max(REACH * np.sqrt(2) * float(self.across.max()), 1e-6)
        # neighbours one after another find the same part of the tree in the processor's cache
        order = self.tree.indices if seeds is None else self.tree.indices[seeds[self.tree.indices]]
        asked = np.sort(order)
        near = np.empty((len(asked), count), dtype=np.int32)
        near[np.searchsorted(asked, order)] = self.tree.query(
            self.tree.data[order], k=count, distance_upper_bound=bound, workers=-1
        )[1]
        sizes, rows = np.zeros(total, dtype=np.int64), [np.empty(0, dtype=np.int64)]
        for first in range(0, len(asked), BATCH):
            some = near[first : first + BATCH]
            row, place = np.nonzero(some < total)
            path, partner = asked[first + row], some[row, place].astype(np.int64)
            kept = self.paths.link[path] != self.paths.link[partner]
            path, partner = path[kept], partner[kept]
            apart = self.points[path] - self.points[partner]
            agree = mahalanobis(apart, self.covariance[path] + self.covariance[partner]) < GATE
            sizes += np.bincount(path[agree], minlength=total)
            rows.append(partner[agree])
        return Ragged(np.concatenate(rows), np.concatenate([[0], np.cumsum(sizes)]))


def side_by_side(paths: Paths) -> IntArray:
    """Order of paths in which those are near each other whose images are.

    All that is looked up about an image is then read from one place: in a table of a million paths the processor
    waits for its memory most of the time otherwise.
    """
    points = paths.anchors()
    return np.lexsort((points[:, 1], np.floor(points[:, 0] / STRIP), paths.transmitter))


def within(tree: cKDTree, places: FloatArray, radius: FloatArray | float) -> Ragged:
    """Rows of a tree that lie within radii of places (n, coordinate)."""
    if len(places) == 0 or tree.n == 0:
        return Ragged(np.empty(0, dtype=np.int64), np.zeros(len(places) + 1, dtype=np.int64))
    near = np.asarray(tree.query_ball_point(places, radius, return_sorted=False))
    start = np.concatenate([[0], np.cumsum([len(one) for one in near])])
    return Ragged(np.fromiter(chain.from_iterable(near), dtype=np.int64, count=start[-1]), start)


def outer(vector: FloatArray) -> FloatArray:
    """``v v'`` of vectors (..., 2)."""
    return vector[..., :, None] * vector[..., None, :]


def mahalanobis(apart: FloatArray, covariance: FloatArray) -> FloatArray:
    """``d' C**-1 d`` of vectors (..., 2)."""
    a, b, d = covariance[..., 0, 0], covariance[..., 0, 1], covariance[..., 1, 1]
    x, y = apart[..., 0], apart[..., 1]
    return (x * x * d - 2 * x * y * b + y * y * a) / (a * d - b * b)
