"""Bent facades: the paths on and near almost coplanar lines are assigned again to the faces that explain them.

Where a facade bends by a degree, the paths next to the bend agree with either face, and a line may also fit paths off
both. The face that more links saw takes them, and the other is left with too few to be a wall. The faces of a facade
do not overlap. All its paths are therefore ordered along it and split where that explains them best.
"""

from collections.abc import Sequence

import numpy as np

from erm.common.odds import TWENTY_TO_ONE
from erm.geometry.vertical import FloatArray
from erm.mpcs.standard_errors import SIGMAS
from erm.reconstruction.model.fit import CHI_SQUARED_GATE, EXACT_LINE, chi_squared, fit_line, fit_lines, residuals
from erm.reconstruction.model.line import Line, Lines, mirror_images
from erm.reconstruction.model.loss import is_diffuse
from erm.reconstruction.model.paths import BoolArray, IntArray, Paths
from erm.reconstruction.model.ragged import Ragged, list_sums
from erm.reconstruction.model.wall import cos_incidence
from erm.reconstruction.search.false_alarm import DISTURBED_SHARE
from erm.reconstruction.search.greedy import Group
from erm.reconstruction.search.images import Images
from erm.reconstruction.search.refine_groups import ROUGH_FIT_STEPS

MAX_BEND = 2.0
"""Largest angle between faces that share paths [degree]. Chosen; not derived."""
MAX_SETBACK = 0.5
"""Largest setback between faces that share paths [m]. Chosen; not derived."""
MAX_FACADE_PATHS = 64
"""Paths up to which a facade is split. A line with more is known so well that paths off another face make a group of
their own. Chosen; not derived."""
MAX_REFITS = 4
"""Repetitions of choosing and fitting the paths of a face. Chosen; not derived."""
FREE, TAKEN = -1, -2
"""Owners of paths that belong to no group, or to a group that is not to be split."""


def split_bent_facades(paths: Paths, groups: Sequence[Group], free: BoolArray, min_support: int) -> list[Group]:
    """Split the paths of each facade, and the free ones beside it, anew between its faces.

    Parameters
    ----------
    paths : Paths
    groups : sequence of Group
    free : array (path,) of bool
        Paths of no group.
    min_support : int
        Fewest paths of a face.

    Returns
    -------
    list of Group
    """
    if not groups:
        return []
    images = Images(paths)
    owner = np.where(free, FREE, TAKEN)
    for number, group in enumerate(groups):
        owner[group.inliers] = number
    cost = clutter_cost(paths, free)
    result: list[Group] = []
    done = np.zeros(len(groups), dtype=bool)
    for first in sorted(range(len(groups)), key=lambda number: -len(groups[number].inliers)):
        if done[first]:
            continue
        facade, beside = _facade(images, groups, first, owner)
        done[facade] = True
        own = [groups[number] for number in facade]
        rows = np.concatenate([*(group.inliers for group in own), beside])
        # a facade with as many free paths beside it as of its own is too uncertain to be split
        if 2 * min_support <= len(rows) <= MAX_FACADE_PATHS and 2 * len(beside) < len(rows):
            own = _split(paths.take(rows), cost[rows], rows, own, min_support)
            owner[rows] = FREE
        for group in own:
            owner[group.inliers] = TAKEN
        result += own
    return result


def clutter_cost(paths: Paths, free: BoolArray) -> FloatArray:
    """Cost (path,) of taking a path beside a facade for none off its faces: ``2 ln(1 / (2 pi s_L s_a r))``.

    This is twice the logarithm of a ratio of densities: that of a wall's paths about their prediction, over the density
    ``r`` of others: of clutter in all lengths and azimuths of a link, and of the facade's paths that others disturb, so
    that they lie anywhere beside it. At least the gate.
    """
    links = len(np.unique(paths.link))
    excess = paths.length - np.linalg.norm(paths.tx - paths.rx, axis=-1)
    density = (np.count_nonzero(free) + 1) / links / (max(float(excess.max()), 1.0) * 360)
    density += DISTURBED_SHARE / (4 * MAX_SETBACK * 4 * MAX_BEND)
    return np.maximum(-2 * np.log(2 * np.pi * paths.length_std * paths.azimuth_std * density), CHI_SQUARED_GATE)


def _facade(images: Images, groups: Sequence[Group], first: int, owner: IntArray) -> tuple[IntArray, IntArray]:
    """Find the groups on the facade of one group, and the free paths beside it.

    Its line would reflect the paths of both if it turned or was set back a little.

    Returns
    -------
    groups : array (group,) of int
        The first is ``first``.
    free : array (n,) of int
        Free paths, at most one of a link that the groups do not have.
    """
    paths, (line, inliers) = images.paths, groups[first]
    own, frame = paths.take(inliers), line.frame()
    rows = beside(images, groups[first])
    rows = rows[(owner[rows] != TAKEN) & ~np.isin(paths.link[rows], own.link)]
    facade, links = [first], own.link
    for other, count in zip(*np.unique(owner[rows][owner[rows] >= 0], return_counts=True), strict=True):
        theirs = paths.link[groups[other].inliers]
        if 2 * count > len(theirs) and not np.isin(theirs, links).any():
            facade.append(int(other))
            links = np.r_[links, theirs]
    rows = rows[(owner[rows] == FREE) & ~np.isin(paths.link[rows], links)]
    both = paths.take(np.r_[inliers, rows])
    rows = rows[~is_diffuse(both, cos_incidence(both, frame), np.array([0, len(both)]))[len(own) :]]
    rows = rows[np.lexsort((rows, paths.loss[rows], paths.link[rows]))]
    return np.array(facade), rows[np.unique(paths.link[rows], return_index=True)[1]]


def beside(images: Images, group: Group) -> IntArray:
    """Other paths (n,) than those of a group that its line would reflect if it turned or was set back a little."""
    paths, (line, inliers) = images.paths, group
    own = paths.take(inliers)
    transmitter, of = np.unique(images.transmitter[inliers], return_index=True)
    image = mirror_images(line, own.tx[of])
    horizontal = np.linalg.norm(image - own.rx[of, :2], axis=-1).max() + np.ptp(own.length)
    near = images.near_points(image, transmitter, float(2 * np.deg2rad(MAX_BEND) * horizontal + 2 * MAX_SETBACK))
    rows = np.setdiff1d(near.rows, inliers)
    columns, frame = paths.columns.take(rows), line.frame()
    residual = residuals(columns, frame)
    distance = np.minimum(
        frame.signed_distance_at(columns.tx_east, columns.tx_north),
        frame.signed_distance_at(columns.rx_east, columns.rx_north),
    )
    close = np.abs(residual.length) < 2 * MAX_SETBACK
    close &= np.abs(residual.azimuth) < 2 * MAX_BEND + SIGMAS * columns.azimuth_std
    return rows[close & (distance > 0)]


def _split(
    paths: Paths, clutter_cost: FloatArray, rows: IntArray, groups: list[Group], min_support: int
) -> list[Group]:
    """The groups of a facade, or those that its paths make if split in their order along it, whichever costs less.

    A path costs its chi-squared, a clutter path its ``clutter_cost``. A face costs
    ``2 ln(V / (2 pi sqrt(det C))) + 2 ln(paths) + 2 ln 20``: the evidence of two parameters of covariance ``C``
    in a range ``V``, of the
    position of its end, and of the prior that one facade in twenty bends.
    """
    line = groups[0].line
    frame = line.frame()
    along = frame.along(np.stack(frame.reflection_points(paths.columns), axis=-1))
    order = np.argsort(along, kind="stable")
    facade = _Facade(paths.take(order), clutter_cost[order], min_support)
    present = [np.isin(rows[order], group.inliers) for group in groups]
    now = sum(facade.cost(group.line, own) for group, own in zip(groups, present, strict=True))
    now += float(facade.clutter_cost[~np.any(present, axis=0)].sum())
    if len(groups) == 1 and not facade.is_poor_fit(line, now, len(groups[0].inliers)):
        return groups
    cost, faces = facade.best_split(line, 0, len(rows))
    if cost >= now - 1e-6 or sum(len(own) for _, own in faces) < sum(len(group.inliers) for group in groups):
        return groups  # false alarms are not tested here
    return [Group(face, np.sort(rows[order[own]])) for face, own in faces]


class _Facade:
    """Paths in their order along a facade, and the cost of explaining them by faces."""

    def __init__(self, paths: Paths, clutter_cost: FloatArray, min_support: int) -> None:
        self.paths, self.clutter_cost, self.min_support = paths, clutter_cost, min_support

    def cost(self, line: Line, own: BoolArray) -> float:
        """Cost of a face and of its own paths (path,)."""
        spread = 2 * np.pi * np.sqrt(np.linalg.det(line.covariance))
        face = 2 * (np.log(4 * MAX_BEND * MAX_SETBACK / spread) + np.log(len(self.paths)) + TWENTY_TO_ONE)
        return float(face + np.minimum(self._chi_squared(line), self.clutter_cost)[own].sum())

    def is_poor_fit(self, line: Line, cost: float, count: int) -> bool:
        """Whether the cost beyond a chi-squared of 2 per path is more than half that of another face."""
        face = self.cost(line, np.zeros(len(self.paths), dtype=bool))
        return cost - face - 2 * count > face / 2

    def best_split(self, start: Line, low: int, high: int) -> tuple[float, list[tuple[Line, IntArray]]]:
        """Cheapest faces of the paths from ``low`` to ``high``, and their total cost."""
        side = np.zeros(len(self.paths), dtype=bool)
        side[low:high] = True
        best, faces = float(self.clutter_cost[side].sum()), []
        line, own = self._fit_face(start, side)
        if own.sum() >= self.min_support:
            cost = self.cost(line, own) + float(self.clutter_cost[side & ~own].sum())
            if cost < best:
                best, faces = cost, [(line, np.flatnonzero(own))]
            if not self.is_poor_fit(line, cost, own.sum()):
                return best, faces
        places = np.arange(low + self.min_support, high - self.min_support + 1)
        if len(places):
            place, lines = self._best_place(start, low, high, places)
            parts = [self.best_split(lines[0], low, place), self.best_split(lines[1], place, high)]
            if (cost := parts[0][0] + parts[1][0]) < best:
                best, faces = cost, parts[0][1] + parts[1][1]
        return best, faces

    def _best_place(self, start: Line, low: int, high: int, places: IntArray) -> tuple[int, list[Line]]:
        """The place where two lines, one on each side, explain the paths best, and these lines."""
        halves = [part for place in places.tolist() for part in (np.arange(low, place), np.arange(place, high))]
        sides = Ragged.from_lists(halves)
        lines = fit_lines(self.paths.columns, sides, Lines.from_list([start] * len(sides)), ROUGH_FIT_STEPS)
        columns = self.paths.columns.take(sides.rows)
        chi2 = chi_squared(columns, residuals(columns, lines.frames(sides.owner)), EXACT_LINE)
        cost = list_sums(np.minimum(chi2, self.clutter_cost[sides.rows]), sides.start).reshape(-1, 2).sum(axis=1)
        best = int(np.argmin(np.round(cost, 6)))
        return int(places[best]), [lines.line(2 * best), lines.line(2 * best + 1)]

    def _fit_face(self, line: Line, side: BoolArray) -> tuple[Line, BoolArray]:
        """Fit a line to the paths of a side that agree with it; return it and its paths (path,)."""
        line = fit_line(self.paths.take(side), line)
        own = side
        for _ in range(MAX_REFITS):
            agree = side & (self._chi_squared(line) < CHI_SQUARED_GATE)
            if agree.sum() < 2 or np.array_equal(agree, own):
                return line, agree
            line, own = fit_line(self.paths.take(agree), line), agree
        return line, own

    def _chi_squared(self, line: Line) -> FloatArray:
        """Chi-squared (path,) of all paths against a line that is taken as exact."""
        return chi_squared(self.paths.columns, residuals(self.paths.columns, line.frame()), EXACT_LINE)
