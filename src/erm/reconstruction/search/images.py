"""The virtual anchors that all paths point to, indexed for search.

The virtual anchor of a path is the mirror image of the transmitter that the path points to if it was reflected once.
It is called image here.
"""

from copy import copy
from itertools import chain
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from erm.geometry.vertical import FloatArray, unit
from erm.reconstruction.model.fit import BATCH_PATHS, CHI_SQUARED_GATE
from erm.reconstruction.model.grid import Grid
from erm.reconstruction.model.line import Lines
from erm.reconstruction.model.paths import BoolArray, IntArray, Paths
from erm.reconstruction.model.ragged import Ragged
from erm.reconstruction.search.false_alarm import log_odds_at_best

SEARCH_RADIUS = 4.0
"""Standard errors of azimuth within which images are searched. It exceeds ``sqrt(CHI_SQUARED_GATE) = 3.7``."""
MAX_NEIGHBOURS = 24
"""Nearest images that are considered as partners of an image. Chosen; not derived."""
LAYER_SHARES = (0.75, 0.97)
"""Shares of the paths, the most accurate first, that have search grids of their own. Chosen; not derived."""
SINGLE_GRID_PATHS = 1000
"""Paths up to which one grid is enough. Chosen; not derived."""
STRIP_WIDTH = 16.0
"""Width of the strips of `spatial_order` [m]: wider than most errors of images, narrower than a city."""
RANGE_MARGIN = 1.25
"""Factor on search radii: the slopes of a path's own prediction differ from those of the line. Chosen; not derived."""
BATCH_LINES = 64
"""Lines whose neighbouring images are searched at once. Chosen; not derived."""


class Layer(NamedTuple):
    """Paths whose images are about equally accurate."""

    rows: IntArray
    variance: float  # m2; largest variance of an image, along plus across
    grid: Grid


class Images:
    """The images that all paths point to.

    Parameters
    ----------
    paths : Paths
        Paths longer than the direct one.

    Attributes
    ----------
    points, covariance : array (path, 2), (path, 2, 2)
        Images [m] and their covariances [m2].
    along, across : array (path,)
        Standard errors of the images along and across the direction from the receiver [m].
    transmitter : array (path,) of int
        Number of the transmitter of each path, among those of these paths.
    transmitters : array (transmitter, 3)
        Positions of these [m].
    worth : array (path,)
        Log odds of each path to be off an image and not there by chance, 0 where these are less.
    """

    def __init__(self, paths: Paths) -> None:
        self.paths = paths
        self.worth = np.maximum(log_odds_at_best(paths), 0.0)
        self.points = paths.virtual_anchors()
        horizontal = np.hypot(*(self.points - paths.rx[:, :2]).T)
        self.across = horizontal * np.deg2rad(paths.azimuth_std)
        # the sagitta of the arc that the error of azimuth spans counts as an error of the length
        self.along = np.hypot(paths.length * paths.length_std / horizontal, self.across**2 / (2 * horizontal))
        toward = (self.points - paths.rx[:, :2]) / horizontal[:, None]
        left = np.stack([-toward[:, 1], toward[:, 0]], axis=-1)
        self.covariance = outer(toward * self.along[:, None]) + outer(left * self.across[:, None])
        _, first, self.transmitter = np.unique(paths.transmitter, return_index=True, return_inverse=True)
        self.transmitters = paths.tx[first]
        # transmitters are separated in a third dimension, so that one tree holds all of them
        extent = np.ptp(self.points, axis=0).max() if len(paths) else 0.0
        self._separation = 4.0 * (extent + SEARCH_RADIUS * self.across.max(initial=0.0) + 1.0)
        self._tree = cKDTree(np.column_stack([self.points, self.transmitter * self._separation]))
        self.radius = SEARCH_RADIUS * float(self.across.max(initial=0.0) + self.along.max(initial=0.0))
        self._variance = self.across**2 + self.along**2
        edges = np.quantile(self._variance, LAYER_SHARES) if len(paths) > SINGLE_GRID_PATHS else []
        self._layer = np.searchsorted(edges, self._variance)
        self._layers = self._make_layers(np.arange(len(paths)))

    def restricted_to_free(self, free: BoolArray) -> "Images":
        """Return the same images, `near_lines` restricted to the free ones (path,); itself while most are free."""
        if 2 * np.count_nonzero(free) > sum(len(layer.rows) for layer in self._layers):
            return self
        return self.restricted_to(np.flatnonzero(free))

    def restricted_to(self, rows: IntArray) -> "Images":
        """Return the same images, `near_lines` restricted to some paths (row,)."""
        fewer = copy(self)
        fewer._layers = self._make_layers(rows)
        return fewer

    def _make_layers(self, rows: IntArray) -> list[Layer]:
        layers = []
        for number in np.unique(self._layer[rows]):
            own = rows[self._layer[rows] == number]
            largest = float(self._variance[own].max())
            cell = RANGE_MARGIN * float(np.sqrt(CHI_SQUARED_GATE * largest))
            layers.append(Layer(own, largest, Grid(self.points[own], self.transmitter[own], cell)))
        return layers

    def near_points(self, points: FloatArray, transmitter: IntArray, radius: FloatArray | float) -> Ragged:
        """Paths of one transmitter (n,) each whose images lie within a radius of points (n, 2)."""
        return neighbours(self._tree, np.column_stack([points, transmitter * self._separation]), radius)

    def near_lines(self, lines: Lines, gates: float = 1.0) -> tuple[IntArray, IntArray]:
        """Find the paths that may agree with lines: their images lie near those of the lines.

        For a path inside the gate, azimuth and length each deviate from the line's prediction by at most
        ``sqrt(CHI_SQUARED_GATE)`` standard errors, those of path and line together. The line's own image has the
        covariance ``S C S'`` with its slopes ``S`` by (normal, offset).

        Parameters
        ----------
        lines : Lines
        gates : float
            Factor by which the gate is widened.

        Returns
        -------
        line, path : array (pair,) of int
        """
        tx, n = self.transmitters[:, :2], unit(lines.normal)
        distance = n @ tx.T - (lines.offset + np.sum(n * lines.pivot, axis=-1))[:, None]
        line, transmitter = np.nonzero(distance > 0)
        distance = distance[line, transmitter]
        images = tx[transmitter] - 2 * distance[:, None] * n[line]
        along = np.sum((tx[transmitter] - lines.pivot[line]) * n[line][:, ::-1] * [-1.0, 1.0], axis=-1)
        of_normal, both, of_offset = lines.covariance[line][:, [0, 0, 1], [0, 1, 1]].T
        # per radian the image moves by 2 distance along the wall and 2 along towards it, per metre by 2 towards it
        variance = np.deg2rad(np.deg2rad(of_normal)) * (distance**2 + along**2) - 2 * np.deg2rad(both) * along
        variance = variance + of_offset
        pairs = []
        for layer in self._layers:
            widest = RANGE_MARGIN * np.sqrt(CHI_SQUARED_GATE * (layer.variance + 8 * variance))
            near, path, square = layer.grid.within(images, transmitter, gates * np.minimum(widest, self.radius))
            path = layer.rows[path]
            limit = (gates * RANGE_MARGIN) ** 2 * CHI_SQUARED_GATE * (self._variance[path] + 8 * variance[near])
            own = np.flatnonzero(square <= limit)
            pairs.append((line[near[own]], path[own]))
        nothing = np.empty(0, dtype=np.int64)
        of, rows = zip((nothing, nothing), *pairs, strict=True)
        return np.concatenate(of), np.concatenate(rows)

    def partners(self, seeds: BoolArray | None = None) -> Ragged:
        """Paths of the same transmitter and another link whose images agree with that of each path within their errors.

        Parameters
        ----------
        seeds : array (path,) of bool, optional
            Paths whose partners are found; the others get none.
        """
        total = len(self.paths)
        count = min(MAX_NEIGHBOURS + 1, total)
        if count < 2:
            return Ragged.empty(total)
        bound = max(SEARCH_RADIUS * np.sqrt(2) * float(self.across.max()), 1e-6)
        # consecutive neighbours find the same part of the tree in the processor's cache
        order = self._tree.indices if seeds is None else self._tree.indices[seeds[self._tree.indices]]
        asked = np.sort(order)
        near = np.empty((len(asked), count), dtype=np.int32)
        near[np.searchsorted(asked, order)] = self._tree.query(
            self._tree.data[order], k=count, distance_upper_bound=bound, workers=-1
        )[1]
        sizes, rows = np.zeros(total, dtype=np.int64), [np.empty(0, dtype=np.int64)]
        for first in range(0, len(asked), BATCH_PATHS):
            batch = near[first : first + BATCH_PATHS]
            row, place = np.nonzero(batch < total)
            path, partner = asked[first + row], batch[row, place].astype(np.int64)
            other_link = self.paths.link[path] != self.paths.link[partner]
            path, partner = path[other_link], partner[other_link]
            apart = self.points[path] - self.points[partner]
            agree = mahalanobis(apart, self.covariance[path] + self.covariance[partner]) < CHI_SQUARED_GATE
            sizes += np.bincount(path[agree], minlength=total)
            rows.append(partner[agree])
        return Ragged(np.concatenate(rows), np.concatenate([[0], np.cumsum(sizes)]))


def spatial_order(paths: Paths) -> IntArray:
    """Order of paths that puts those with near images next to each other.

    What is looked up about an image is then read from one place in memory: with a million paths the processor would
    mostly wait for its memory otherwise.
    """
    points = paths.virtual_anchors()
    return np.lexsort((points[:, 1], np.floor(points[:, 0] / STRIP_WIDTH), paths.transmitter))


def neighbours(tree: cKDTree, places: FloatArray, radius: FloatArray | float) -> Ragged:
    """Rows of a tree that lie within a radius of places (n, coordinate)."""
    if len(places) == 0 or tree.n == 0:
        return Ragged.empty(len(places))
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
