"""Conflicts between candidates: the legs of all of them are tested against the faces of all, in one search tree."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import shapely

from erm.geometry.vertical import FloatArray
from erm.reconstruction.decision.pieces import plan_lines, span
from erm.reconstruction.model.extent import (
    CLEARANCE,
    MAX_TESTED_PATHS,
    STRAY_SHARE,
    Footprint,
    Legs,
    legs_of,
    solid_footprint,
    without_strays,
)
from erm.reconstruction.model.line import Frame, Lines
from erm.reconstruction.model.paths import BoolArray, IntArray
from erm.reconstruction.model.wall import Wall

MAX_EXTENSION = 25.0
"""How far beyond its reflection points a wall may extend [m]. Chosen; not derived."""
EXTENSION_DECAY = 8.0
"""Distance beyond its reflection points over which the probability that a wall extends falls to 1/e [m]. Chosen; not
derived."""
MAX_EXTRA_HEIGHT = 3.0
"""How far above its reflection points a wall may extend [m]: one storey."""
DIRECT_PATH = -1
"""Owner of the direct paths' legs."""
BATCH_LEGS = 4096
"""Legs tested against faces at once. Chosen; not derived."""


class Conflicts:
    """Crossings of candidates' legs, and of direct paths, with candidates' faces.

    Parameters
    ----------
    walls : sequence of Wall
        All candidates.
    lines_of_sight : Legs
        Direct paths known to be unobstructed.
    plausible : array (candidate,) of bool
        Candidates that may be accepted. The others are only tested for what certainly contradicts them.
    """

    def __init__(self, walls: Sequence[Wall], lines_of_sight: Legs, plausible: BoolArray) -> None:
        footprints = [solid_footprint(wall) for wall, _ in map(without_strays, walls)]
        self._points = [_points_along(wall) for wall in walls]
        walls = [wall.thinned(MAX_TESTED_PATHS) for wall in walls]
        self.support = np.array([wall.support for wall in walls], dtype=np.int64)
        legs = [lines_of_sight, *(legs_of(wall) for wall in walls)]
        start, end = (np.vstack(ends) for ends in zip(*legs, strict=True))
        first = len(lines_of_sight.start)
        owner = np.r_[np.full(first, DIRECT_PATH), np.repeat(np.arange(len(walls)), 2 * self.support)]
        all_rows, of_plausible = np.arange(len(owner)), np.flatnonzero(np.r_[plausible, True][owner])
        whole = [(number, footprints[number]) for number in np.flatnonzero(plausible).tolist()]
        pieces = [
            (number, piece) for number in np.flatnonzero(~plausible).tolist() for piece in footprints[number].pieces()
        ]
        found = []
        for faces, extension, rows in ((whole, MAX_EXTENSION, all_rows), (pieces, 0.0, of_plausible)):
            number = np.array([number for number, _ in faces], dtype=np.int32)
            candidates = Faces([one for _, one in faces], extension)
            for low in range(0, len(rows) if faces else 0, BATCH_LEGS):
                batch = rows[low : low + BATCH_LEGS]
                leg, face, certain, probability, *place = candidates.crossings(Legs(start[batch], end[batch]))
                kept = (probability > 0) & (owner[batch[leg]] != number[face])
                columns = (certain, probability, *place)
                found.append((batch[leg[kept]], number[face[kept]], *(column[kept] for column in columns)))
        nothing = (np.empty(0, np.int64), np.empty(0, np.int32), np.empty(0, bool), *3 * (np.empty(0),))
        leg, self._face, self._certain, self._probability, self._along, self._height = (
            np.concatenate(column) for column in zip(nothing, *found, strict=True)
        )
        edge = np.r_[first + 2 * (np.cumsum(self.support) - self.support), 0]  # where each candidate's legs start
        half = np.r_[self.support, max(first, 1)][owner[leg]]
        self._owner, place = owner[leg].astype(np.int32), leg - edge[owner[leg]]
        self._from_rx, self._path = place >= half, (place % half).astype(np.int32)
        self._by_owner = _rows_of_each(self._owner, len(walls))
        self._by_face = _rows_of_each(self._face, len(walls))

    def openings(self, wall: int, accepted: BoolArray) -> int:
        """Number of openings without which a candidate cannot stand beside accepted ones.

        Openings of the candidate let direct paths and paths of the accepted ones through. Up to `STRAY_SHARE` of its
        support may be strays instead. If more than half of its own paths meet accepted ones, these need openings, too.
        """
        rows = self._by_face[wall]
        rows = rows[self._certain[rows]]
        owner = self._owner[rows]
        rows = rows[(owner == DIRECT_PATH) | accepted[owner]]
        needed = self._openings_of(wall, rows, STRAY_SHARE * self.support[wall])
        rows = self._by_owner[wall]
        rows = rows[self._certain[rows] & accepted[self._face[rows]]]
        if len(np.unique(self._path[rows])) > self.support[wall] / 2:
            face = self._face[rows]
            needed += sum(self._openings_of(one, rows[face == one], 0.0) for one in np.unique(face).tolist())
        return needed

    def _openings_of(self, face: int, rows: IntArray, strays: float) -> int:
        """Number of openings of a face that let crossings (row,) through, but for a number of strays.

        Two crossings next to each other along the face share an opening unless a point between them that is no higher
        than the higher one reflected a path. Where legs cross a wall they pass through few openings, however many legs
        there are. Where there is no wall crossings and reflection points are mixed.
        """
        if not len(rows):
            return 0
        order = np.argsort(self._along[rows], kind="stable")
        place, height = self._along[rows][order], self._height[rows][order]
        along, up = self._points[face]
        between = np.searchsorted(along, place)
        lowest = np.minimum.reduceat(np.r_[up, np.inf], between)[:-1]
        lowest[between[:-1] == between[1:]] = np.inf
        parted = lowest <= np.maximum(height[:-1], height[1:])
        sizes = np.sort(np.diff(np.flatnonzero(np.r_[True, parted, True])))
        return int(np.count_nonzero(np.cumsum(sizes) > strays))

    def rivals(self, wall: int, accepted: BoolArray) -> list[int]:
        """Accepted candidates whose paths or faces cross those of a candidate."""
        face, owner = self._face[self._by_owner[wall]], self._owner[self._by_face[wall]]
        others = np.unique(np.concatenate([face, owner[owner != DIRECT_PATH]]))
        return [int(other) for other in others if accepted[other]]

    def shadowing(self, wall: int, accepted: BoolArray) -> tuple[float, float]:
        """Probability that accepted candidates obstruct a candidate's legs from transmitters, and from receivers.

        The mean over its paths of ``exp(-d / EXTENSION_DECAY)``, where a leg would pass at the distance ``d`` beyond
        the nearest known end of an accepted wall.
        """
        rows = self._by_owner[wall]
        rows = rows[accepted[self._face[rows]]]
        probability = np.zeros((2, self.support[wall]))
        np.maximum.at(probability, (self._from_rx[rows].astype(int), self._path[rows]), self._probability[rows])
        of_tx, of_rx = probability.mean(axis=1)
        return float(of_tx), float(of_rx)


class Faces:
    """Where candidates are known to stand, and where they may extend to.

    Parameters
    ----------
    footprints : sequence of Footprint
    extension : float
        How far beyond their outermost pieces they may extend [m].
    """

    def __init__(self, footprints: Sequence[Footprint], extension: float) -> None:
        spans = np.array([span(one, extension) for one in footprints]).reshape(-1, 2, 2)
        self._tree = shapely.STRtree(shapely.linestrings(spans))
        self._frames = np.stack(Lines.from_list([one.line for one in footprints]).frames())
        self._pieces = np.array([len(one.low) for one in footprints], dtype=np.int64)
        most = int(self._pieces.max(initial=1))
        self._low, self._high, self._top = np.full((3, most, len(footprints)), np.nan)
        for number, (_, *columns) in enumerate(footprints):
            for table, column in zip((self._low, self._high, self._top), columns, strict=True):
                table[: len(column), number] = column
        self._lowest = np.nanmin(self._low, axis=0, initial=np.inf) - extension
        self._highest = np.nanmax(self._high, axis=0, initial=-np.inf) + extension

    def crossings(self, legs: Legs) -> tuple[IntArray, IntArray, BoolArray, FloatArray, FloatArray, FloatArray]:
        """Find the legs that cross faces.

        Returns
        -------
        leg, face : array (pair,) of int
        certain : array (pair,) of bool
            Whether the leg crosses where the face is known to stand.
        probability : array (pair,)
            Of the face to extend to where the leg crosses.
        along, height : array (pair,)
            Where the leg crosses, along the face and above 0 [m].
        """
        leg, face = self._tree.query(plan_lines(*legs))
        start, end = (np.ascontiguousarray(end.T) for end in legs)
        frame = Frame(*(column[face] for column in self._frames))
        before = frame.signed_distance_at(start[0][leg], start[1][leg])
        after = frame.signed_distance_at(end[0][leg], end[1][leg])
        through = np.flatnonzero((np.minimum(before, after) < -CLEARANCE) & (np.maximum(before, after) > CLEARANCE))
        leg, face, before, after = leg[through], face[through], before[through], after[through]
        share = before / (before - after)
        east, north, height = (a[leg] + share * (b[leg] - a[leg]) for a, b in zip(start, end, strict=True))
        nx, ny, _, px, py = (column[face] for column in self._frames)
        place = (north - py) * nx - (east - px) * ny
        near = np.flatnonzero((place >= self._lowest[face]) & (place <= self._highest[face]))
        leg, face, place, height = leg[near], face[near], place[near], height[near]
        certain, distance = np.zeros(len(leg), dtype=bool), np.full(len(leg), np.inf)
        of = np.arange(len(leg))
        for number, (low, high, top) in enumerate(zip(self._low, self._high, self._top, strict=True)):
            of = of[self._pieces[face[of]] > number]
            own, along, up = face[of], place[of], height[of]
            outside = np.maximum(np.maximum(low[own] - along, along - high[own]), 0)
            above = up - top[own]
            certain[of] |= (outside == 0) & (above < 0)
            outside[above >= MAX_EXTRA_HEIGHT] = np.inf
            distance[of] = np.minimum(distance[of], outside)
        return leg, face, certain, np.exp(-distance / EXTENSION_DECAY), place, height


def _points_along(wall: Wall) -> tuple[FloatArray, FloatArray]:
    """Reflection points (inlier,) of a wall in their order along it, and their heights [m]."""
    along = wall.line.along(wall.reflection_points)
    order = np.argsort(along, kind="stable")
    return along[order], wall.reflection_points[order, 2]


def _rows_of_each(key: IntArray, count: int) -> list[IntArray]:
    """Row numbers of each value 0 .. count - 1 of a key."""
    order = np.argsort(key, kind="stable")
    edges = np.searchsorted(key[order], np.arange(count + 1))
    return [order[a:b] for a, b in pairwise(edges)]
