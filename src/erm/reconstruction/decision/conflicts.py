"""Who stands in whose way: the legs of all candidates held against the faces of all, looked up in one tree."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import shapely

from erm.geometry.vertical import FloatArray
from erm.reconstruction.decision.pieces import SOLID_GAP, as_lines, span
from erm.reconstruction.model.extent import (
    CLEARANCE,
    TELLING,
    Footprint,
    Legs,
    footprint,
    legs_of,
    stretches,
    without_strays,
)
from erm.reconstruction.model.line import Frame, Lines
from erm.reconstruction.model.paths import BoolArray, IntArray
from erm.reconstruction.model.wall import Wall

BEYOND = 25.0  # m; how far beyond its reflection points a wall may go on
FADE = 8.0  # m; over which the belief that it does falls to 1/e
TALLER = 3.0  # m; a storey: how much above its reflection points a wall may go on
NOBODY = -1
BATCH = 4096  # legs held against faces in one go


class Conflicts:
    """Crossings of candidates' legs, and of direct paths, with candidates' faces.

    Parameters
    ----------
    walls : sequence of Wall
        All candidates.
    sight : Legs
        Direct paths known to be free.
    hopeful : array (candidate,) of bool
        Those that may ever be believed. Of the others it is only asked what contradicts them for certain.
    """

    def __init__(self, walls: Sequence[Wall], sight: Legs, hopeful: BoolArray) -> None:
        prints = [footprint(wall, stretches(wall, SOLID_GAP)) for wall, _ in map(without_strays, walls)]
        seen = np.array([wall.support for wall in walls], dtype=np.int64)
        walls = [wall.thinned(TELLING) for wall in walls]
        self.support = np.array([wall.support for wall in walls], dtype=np.int64)
        self._asked = self.support / seen
        legs = [sight, *(legs_of(wall) for wall in walls)]
        start, end = (np.vstack(ends) for ends in zip(*legs, strict=True))
        first = len(sight.start)
        owner = np.r_[np.full(first, NOBODY), np.repeat(np.arange(len(walls)), 2 * self.support)]
        all_rows, telling = np.arange(len(owner)), np.flatnonzero(np.r_[hopeful, True][owner])
        whole = [(number, prints[number]) for number in np.flatnonzero(hopeful).tolist()]
        pieces = [(number, piece) for number in np.flatnonzero(~hopeful).tolist() for piece in prints[number].pieces()]
        met = []
        for faces, beyond, rows in ((whole, BEYOND, all_rows), (pieces, 0.0, telling)):
            number = np.array([number for number, _ in faces], dtype=np.int32)
            standing = Faces([print_ for _, print_ in faces], beyond)
            for low in range(0, len(rows) if faces else 0, BATCH):
                some = rows[low : low + BATCH]
                leg, face, hard, shade = standing.crossings(Legs(start[some], end[some]))
                kept = (shade > 0) & (owner[some[leg]] != number[face])
                met.append((some[leg[kept]], number[face[kept]], hard[kept], shade[kept]))
        nothing = (np.empty(0, np.int64), np.empty(0, np.int32), np.empty(0, bool), np.empty(0))
        leg, self.face, self.hard, self.shade = (np.concatenate(column) for column in zip(nothing, *met, strict=True))
        edge = np.r_[first + 2 * (np.cumsum(self.support) - self.support), 0]  # where each one's legs start
        half = np.r_[self.support, max(first, 1)][owner[leg]]
        self.owner, place = owner[leg].astype(np.int32), leg - edge[owner[leg]]
        self.from_rx, self.member = place >= half, (place % half).astype(np.int32)
        self._by_owner = _slices(self.owner, len(walls))
        self._by_face = _slices(self.face, len(walls))

    def blocked(self, wall: int, believed: BoolArray) -> float:
        """Share of a candidate's paths that would have to pass through believed ones."""
        rows = self._by_owner[wall]
        rows = rows[self.hard[rows] & believed[self.face[rows]]]
        return len(np.unique(self.member[rows])) / self.support[wall]

    def cuts(self, wall: int, believed: BoolArray) -> float:
        """Number of direct paths and paths of believed candidates that would have to pass through a candidate.

        Direct paths, which are all there, count for the share of its own paths that a candidate was asked with.
        """
        rows = self._by_face[wall]
        rows = rows[self.hard[rows]]
        owner, member = self.owner[rows], self.member[rows]
        direct = owner == NOBODY
        others = np.flatnonzero(~direct & believed[owner])
        most = int(self.support.max(initial=1))
        paths = np.unique(owner[others].astype(np.int64) * most + member[others])
        return len(paths) + float(np.count_nonzero(direct) * self._asked[wall])

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


class Faces:
    """Where candidates are known to stand, and where they may go on.

    Parameters
    ----------
    prints : sequence of Footprint
    beyond : float
        How far beyond their outermost pieces they may go on [m].
    """

    def __init__(self, prints: Sequence[Footprint], beyond: float) -> None:
        spans = np.array([span(one, beyond) for one in prints]).reshape(-1, 2, 2)
        self._tree = shapely.STRtree(shapely.linestrings(spans))
        self._frames = np.stack(Lines.of([one.line for one in prints]).frames())
        self._pieces = np.array([len(one.low) for one in prints], dtype=np.int64)
        most = int(self._pieces.max(initial=1))
        self._low, self._high, self._top = np.full((3, most, len(prints)), np.nan)
        for number, (_, *columns) in enumerate(prints):
            for kept, column in zip((self._low, self._high, self._top), columns, strict=True):
                kept[: len(column), number] = column
        self._least = np.nanmin(self._low, axis=0, initial=np.inf) - beyond
        self._most = np.nanmax(self._high, axis=0, initial=-np.inf) + beyond

    def crossings(self, legs: Legs) -> tuple[IntArray, IntArray, BoolArray, FloatArray]:
        """Pairs (leg, face) that meet, whether they do for certain, and how likely it is that they would."""
        leg, face = self._tree.query(as_lines(*legs))
        start, end = (np.ascontiguousarray(end.T) for end in legs)
        frame = Frame(*(column[face] for column in self._frames))
        before, after = frame.before(start[0][leg], start[1][leg]), frame.before(end[0][leg], end[1][leg])
        through = np.flatnonzero((np.minimum(before, after) < -CLEARANCE) & (np.maximum(before, after) > CLEARANCE))
        leg, face, before, after = leg[through], face[through], before[through], after[through]
        share = before / (before - after)
        east, north, height = (a[leg] + share * (b[leg] - a[leg]) for a, b in zip(start, end, strict=True))
        nx, ny, _, px, py = (column[face] for column in self._frames)
        place = (north - py) * nx - (east - px) * ny
        near = np.flatnonzero((place >= self._least[face]) & (place <= self._most[face]))
        leg, face, place, height = leg[near], face[near], place[near], height[near]
        hard, apart = np.zeros(len(leg), dtype=bool), np.full(len(leg), np.inf)
        of = np.arange(len(leg))
        for number, (low, high, top) in enumerate(zip(self._low, self._high, self._top, strict=True)):
            of = of[self._pieces[face[of]] > number]
            here, there, up = face[of], place[of], height[of]
            outside = np.maximum(np.maximum(low[here] - there, there - high[here]), 0)
            above = up - top[here]
            hard[of] |= (outside == 0) & (above < 0)
            outside[above >= TALLER] = np.inf
            apart[of] = np.minimum(apart[of], outside)
        shade = np.exp(-apart / FADE)
        return leg, face, hard, shade


def _slices(key: IntArray, count: int) -> list[IntArray]:
    """Row numbers of each key value 0 .. count - 1."""
    order = np.argsort(key, kind="stable")
    edges = np.searchsorted(key[order], np.arange(count + 1))
    return [order[a:b] for a, b in pairwise(edges)]
