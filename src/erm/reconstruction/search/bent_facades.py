"""Facades that bend: the paths on and about nearly coplanar lines, divided anew between the faces that they ask for.

Where a facade turns by a degree, the paths next to the bend agree with either face, and a line may be laid through
paths off both. The face that more links saw takes them, and the other is left with too few to be a wall. Faces do not
interleave: so all paths of a facade are put in their order along it and cut where that explains them best.
"""

from collections.abc import Sequence

import numpy as np

from erm.geometry.vertical import FloatArray
from erm.reconstruction.model.fit import chi_squared, fit_line, fit_lines, residuals
from erm.reconstruction.model.line import Line, Lines, anchors
from erm.reconstruction.model.loss import scattered
from erm.reconstruction.model.paths import BoolArray, IntArray, Paths
from erm.reconstruction.model.ragged import Ragged, sums
from erm.reconstruction.search.greedy import Group
from erm.reconstruction.search.images import GATE, Images
from erm.reconstruction.search.refine_groups import ROUGHLY

TURN = 2.0  # degree; faces that turn by more share no paths
SHIFT = 0.5  # m; nor do faces that are set back by more
PRIOR = 3.0  # log odds against one more face: one facade in twenty bends
MOST = 64  # paths; a line that has more is known so well that what does not belong to it makes a group of its own
TAKEN = -2  # by a group that is not to be divided
ROUNDS = 4  # of choosing members and fitting


def unbent(paths: Paths, groups: Sequence[Group], free: BoolArray, min_support: int) -> list[Group]:
    """Groups after the paths of each facade, and those left over beside it, were divided between its faces anew.

    Parameters
    ----------
    paths : Paths
    groups : sequence of Group
    free : array (path,) of bool
        Paths of no group.
    min_support : int
        Fewest paths of a face.
    """
    if not groups:
        return []
    images = Images(paths)
    owner = np.where(free, -1, TAKEN)
    for number, group in enumerate(groups):
        owner[group.members] = number
    unlikely = _elsewhere(paths, free)
    result: list[Group] = []
    done = np.zeros(len(groups), dtype=bool)
    for first in sorted(range(len(groups)), key=lambda number: -len(groups[number].members)):
        if done[first]:
            continue
        facade, left = _facade(images, groups, first, owner)
        done[facade] = True
        own = [groups[number] for number in facade]
        rows = np.concatenate([*(group.members for group in own), left])
        # beside strays as many as its own paths a facade tells nothing of its faces
        if 2 * min_support <= len(rows) <= MOST and 2 * len(left) < len(rows):
            own = _divided(paths.take(rows), unlikely[rows], rows, own, min_support)
            owner[rows] = -1
        for group in own:
            owner[group.members] = TAKEN
        result += own
    return result


def _elsewhere(paths: Paths, free: BoolArray) -> FloatArray:
    """What it costs (path,) to say that a path is no wall's: ``2 ln(1 / (2 pi s_L s_a r))``.

    Twice the logarithm of how much denser the paths of a wall lie about what it predicts than ``r``, those from
    nowhere, do over all lengths and azimuths of a link. No less than what the gate lets in.
    """
    links = len(np.unique(paths.link))
    late = paths.length - np.linalg.norm(paths.tx - paths.rx, axis=-1)
    density = (np.count_nonzero(free) + 1) / links / (max(float(late.max()), 1.0) * 360)
    return np.maximum(-2 * np.log(2 * np.pi * paths.length_std * paths.azimuth_std * density), GATE)


def _facade(images: Images, groups: Sequence[Group], first: int, owner: IntArray) -> tuple[IntArray, IntArray]:
    """Groups on the facade of one, itself first, and paths of other links that no group has (``owner`` -1).

    Their paths are such as its line would reflect if it turned or were set back.
    """
    paths, (line, members) = images.paths, groups[first]
    own = paths.take(members)
    number, of = np.unique(images.transmitter[members], return_index=True)
    image = anchors(line, own.tx[of])
    level = np.linalg.norm(image - own.rx[of, :2], axis=-1).max() + np.ptp(own.length)
    near = images.around(image, number, float(2 * np.deg2rad(TURN) * level + 2 * SHIFT))
    rows = np.unique(near.rows)
    rows = rows[(owner[rows] != TAKEN) & (owner[rows] != first) & ~np.isin(paths.link[rows], own.link)]
    rays = paths.rays.take(rows)
    found, frame = residuals(rays, line.frame()), line.frame()
    before = np.minimum(frame.before(rays.tx_east, rays.tx_north), frame.before(rays.rx_east, rays.rx_north))
    close = (np.abs(found.length) < 2 * SHIFT) & (np.abs(found.azimuth) < 2 * TURN + 3 * rays.azimuth_std)
    rows = rows[close & (before > 0)]
    facade, links = [first], own.link
    for other, count in zip(*np.unique(owner[rows][owner[rows] >= 0], return_counts=True), strict=True):
        theirs = paths.link[groups[other].members]
        if 2 * count > len(theirs) and not np.isin(theirs, links).any():
            facade.append(int(other))
            links = np.r_[links, theirs]
    rows = rows[(owner[rows] == -1) & ~np.isin(paths.link[rows], links)]
    both = paths.take(np.r_[members, rows])
    cosine = np.clip((line.depth(both.tx) + line.depth(both.rx)) / both.length, 0, 1)
    rows = rows[~scattered(both, cosine, np.array([0, len(both)]))[len(own) :]]
    rows = rows[np.lexsort((rows, paths.loss[rows], paths.link[rows]))]
    return np.array(facade), rows[np.unique(paths.link[rows], return_index=True)[1]]


def _divided(paths: Paths, unlikely: FloatArray, rows: IntArray, groups: list[Group], min_support: int) -> list[Group]:
    """The groups of a facade, or those that its paths make if cut in their order along it, whichever is likelier.

    A path costs its chi-squared, one of no wall what is ``unlikely`` about it; a face costs
    ``2 ln(V / (2 pi sqrt(det C))) + 2 ln(places) + 2 PRIOR``: the evidence of two parameters of the covariance ``C``
    out of a range ``V``, and of the place of its end.
    """
    line = groups[0].line
    frame = line.frame()
    along = frame.along(np.stack(frame.bounce(paths.rays), axis=-1))
    order = np.argsort(along, kind="stable")
    facade = _Facade(paths.take(order), unlikely[order], min_support)
    as_found = [np.isin(rows[order], group.members) for group in groups]
    now = sum(facade.cost(group.line, own) for group, own in zip(groups, as_found, strict=True))
    now += float(facade.unlikely[~np.any(as_found, axis=0)].sum())
    if len(groups) == 1 and not facade.strained(line, now, len(groups[0].members)):
        return groups
    cost, faces = facade.cut(line, 0, len(rows))
    if cost >= now - 1e-6 or sum(len(own) for _, own in faces) < sum(len(group.members) for group in groups):
        return groups  # whether a group is there by chance is not asked here
    return [Group(face, np.sort(rows[order[own]])) for face, own in faces]


class _Facade:
    """Paths in their order along a facade, and what it costs to explain them by lines."""

    def __init__(self, paths: Paths, unlikely: FloatArray, min_support: int) -> None:
        self.paths, self.unlikely, self.min_support = paths, unlikely, min_support
        self.places = np.log(len(paths))

    def cost(self, line: Line, own: BoolArray) -> float:
        """Cost of a face and of its own paths (path,)."""
        spread = 2 * np.pi * np.sqrt(np.linalg.det(line.covariance))
        face = 2 * (np.log(4 * TURN * SHIFT / spread) + self.places + PRIOR)
        return float(face + np.minimum(self._misfit(line), self.unlikely)[own].sum())

    def strained(self, line: Line, cost: float, count: int) -> bool:
        """Whether a face leaves so much unexplained, beyond a chi-squared of 2 a path, that half of it pays another."""
        face = self.cost(line, np.zeros(len(self.paths), dtype=bool))
        return cost - face - 2 * count > face / 2

    def cut(self, start: Line, low: int, high: int) -> tuple[float, list[tuple[Line, IntArray]]]:
        """Cheapest faces of the paths from ``low`` to ``high``, and their cost together."""
        side = np.zeros(len(self.paths), dtype=bool)
        side[low:high] = True
        best, faces = float(self.unlikely[side].sum()), []
        line, own = self._settled(start, side)
        if own.sum() >= self.min_support:
            cost = self.cost(line, own) + float(self.unlikely[side & ~own].sum())
            if cost < best:
                best, faces = cost, [(line, np.flatnonzero(own))]
            if not self.strained(line, cost, own.sum()):
                return best, faces
        places = np.arange(low + self.min_support, high - self.min_support + 1)
        if len(places):
            place, lines = self._best_place(start, low, high, places)
            parts = [self.cut(lines[0], low, place), self.cut(lines[1], place, high)]
            if (cost := parts[0][0] + parts[1][0]) < best:
                best, faces = cost, parts[0][1] + parts[1][1]
        return best, faces

    def _best_place(self, start: Line, low: int, high: int, places: IntArray) -> tuple[int, list[Line]]:
        """Where two lines explain the paths best, and these."""
        halves = [part for place in places.tolist() for part in (np.arange(low, place), np.arange(place, high))]
        sides = Ragged.of_lists(halves)
        lines = fit_lines(self.paths.rays, sides, Lines.of([start] * len(sides)), ROUGHLY)
        rays = self.paths.rays.take(sides.rows)
        chi2 = chi_squared(rays, residuals(rays, lines.frames(sides.owner)), (0.0, 0.0, 0.0))
        cost = sums(np.minimum(chi2, self.unlikely[sides.rows]), sides.start).reshape(-1, 2).sum(axis=1)
        best = int(np.argmin(np.round(cost, 6)))
        return int(places[best]), [lines.one(2 * best), lines.one(2 * best + 1)]

    def _settled(self, line: Line, side: BoolArray) -> tuple[Line, BoolArray]:
        """A line fitted to those paths of a side that agree with it, and which (path,) they are."""
        line = fit_line(self.paths.take(side), line)
        own = side
        for _ in range(ROUNDS):
            agree = side & (self._misfit(line) < GATE)
            if agree.sum() < 2 or np.array_equal(agree, own):
                return line, agree
            line, own = fit_line(self.paths.take(agree), line), agree
        return line, own

    def _misfit(self, line: Line) -> FloatArray:
        """Chi-squared (path,) of all paths against a line taken as exact."""
        return chi_squared(self.paths.rays, residuals(self.paths.rays, line.frame()), (0.0, 0.0, 0.0))
