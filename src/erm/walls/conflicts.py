"""Who stands in whose way: the legs of all candidates held against the faces of all, looked up in one tree."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import shapely

from erm.geometry import FloatArray
from erm.walls.extent import CLEARANCE, Footprint, Legs, footprint, legs_of, stretches
from erm.walls.paths import BoolArray, IntArray
from erm.walls.pieces import SOLID_GAP, span
from erm.walls.wall import Wall

BEYOND = 25.0  # m; how far beyond its reflection points a wall may go on
FADE = 8.0  # m; over which the belief that it does falls to 1/e
TALLER = 3.0  # m; a storey: how much above its reflection points a wall may go on
NOBODY = -1


class Conflicts:
    """Crossings of candidates' legs, and of direct paths, with candidates' faces.

    Parameters
    ----------
    walls : sequence of Wall
        All candidates.
    sight : Legs
        Direct paths known to be free.
    """

    def __init__(self, walls: Sequence[Wall], sight: Legs) -> None:
        self.support = np.array([wall.support for wall in walls], dtype=np.int64)
        self.prints = [footprint(wall, stretches(wall, SOLID_GAP)) for wall in walls]
        legs = [legs_of(wall) for wall in walls]
        start = np.vstack([sight.start, *(leg.start for leg in legs)])
        end = np.vstack([sight.end, *(leg.end for leg in legs)])
        owner = np.r_[np.full(len(sight.start), NOBODY), np.repeat(np.arange(len(walls)), 2 * self.support)]
        member = np.concatenate([np.arange(len(sight.start)), *(np.tile(np.arange(n), 2) for n in self.support)])
        from_rx = np.concatenate(
            [np.zeros(len(sight.start), dtype=bool), *(np.repeat([False, True], n) for n in self.support)]
        )
        leg, face = _meetings(start, end, self.prints)
        hard, shade = self._crossings(start[leg], end[leg], face)
        kept = (shade > 0) & (owner[leg] != face)
        leg, self.face, self.hard, self.shade = leg[kept], face[kept], hard[kept], shade[kept]
        self.owner, self.member, self.from_rx = owner[leg], member[leg], from_rx[leg]
        self._by_owner = _slices(self.owner, len(walls))
        self._by_face = _slices(self.face, len(walls))

    def blocked(self, wall: int, believed: BoolArray) -> float:
        """Share of a candidate's paths that would have to pass through believed ones."""
        rows = self._by_owner[wall]
        rows = rows[self.hard[rows] & believed[self.face[rows]]]
        return len(np.unique(self.member[rows])) / self.support[wall]

    def cuts(self, wall: int, believed: BoolArray) -> int:
        """Number of direct paths and paths of believed candidates that would have to pass through a candidate."""
        rows = self._by_face[wall]
        rows = rows[self.hard[rows] & ((self.owner[rows] == NOBODY) | believed[self.owner[rows]])]
        return len(np.unique(np.stack([self.owner[rows], self.member[rows]]), axis=1).T)

    def shadow(self, wall: int, believed: BoolArray) -> tuple[float, float]:
        """How far (transmitters', receivers' legs) a candidate is in the shadow that believed ones may cast.

        The mean over its paths of ``exp(-d / FADE)``, ``d`` how far beyond the nearest known end of a believed
        wall a leg would pass through.
        """
        rows = self._by_owner[wall]
        rows = rows[believed[self.face[rows]]]
        shade = np.zeros((2, self.support[wall]))
        np.maximum.at(shade, (self.from_rx[rows].astype(int), self.member[rows]), self.shade[rows])
        first, second = shade.mean(axis=1)
        return float(first), float(second)

    def _crossings(self, start: FloatArray, end: FloatArray, face: IntArray) -> tuple[BoolArray, FloatArray]:
        """Whether legs (n, 3) pass through faces (n,) for certain, and how likely it is that they would."""
        hard = np.zeros(len(face), dtype=bool)
        shade = np.zeros(len(face))
        for number, rows in enumerate(_slices(face, len(self.prints))):
            if len(rows):
                hard[rows], shade[rows] = _through(self.prints[number], start[rows], end[rows])
        return hard, shade


def _through(print_: Footprint, start: FloatArray, end: FloatArray) -> tuple[BoolArray, FloatArray]:
    """Whether legs (n, 3) pass through a wall where it stands, and where it may stand."""
    before, after = print_.line.depth(start), print_.line.depth(end)
    through = (np.minimum(before, after) < -CLEARANCE) & (np.maximum(before, after) > CLEARANCE)
    share = np.where(through, before, 0.0) / np.where(through, before - after, 1.0)
    met = start + share[:, None] * (end - start)
    place = print_.line.along(met)[:, None]
    outside = np.maximum(np.maximum(print_.low - place, place - print_.high), 0)
    hard = ((outside == 0) & (met[:, 2:] < print_.top)).any(axis=1)
    shade = np.where(met[:, 2:] < print_.top + TALLER, np.exp(-outside / FADE), 0.0).max(axis=1)
    return through & hard, np.where(through, shade, 0.0)


def _meetings(start: FloatArray, end: FloatArray, prints: Sequence[Footprint]) -> tuple[IntArray, IntArray]:
    """Pairs (leg, candidate) that meet seen from above, the candidates' faces prolonged by `BEYOND`."""
    if not prints or not len(start):
        return np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)
    faces = np.array([span(print_, BEYOND) for print_ in prints])
    tree = shapely.STRtree(shapely.linestrings(faces))
    lines = shapely.linestrings(np.stack([start[:, :2], end[:, :2]], axis=1))
    leg, face = tree.query(lines, predicate="intersects")
    return leg, face


def _slices(key: IntArray, count: int) -> list[IntArray]:
    """Row numbers of each key value 0 .. count - 1."""
    order = np.argsort(key, kind="stable")
    edges = np.searchsorted(key[order], np.arange(count + 1))
    return [order[a:b] for a, b in pairwise(edges)]
