"""Walls cut into the pieces that stand: where free paths pass, and where a reflection was expected in vain."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely

from erm.geometry.vertical import FloatArray
from erm.reconstruction.model.extent import (
    SOLID,
    TELLING,
    Footprint,
    Legs,
    Stretch,
    expected_places,
    footprint,
    legs_of,
    stretches,
    without_strays,
)
from erm.reconstruction.model.line import bounce_points
from erm.reconstruction.model.wall import Wall

WITNESSES = 32  # links asked about a gap
SOLID_GAP = 5.0  # m; between reflection points closer than this a wall is taken to stand


class Links(NamedTuple):
    """Antenna pairs of a campaign, in the order of their numbers."""

    tx: FloatArray  # (link, 3) m
    rx: FloatArray  # (link, 3) m


def pieces_of(walls: Sequence[Wall], sight: Legs, links: Links, max_gap: float) -> list[list[Stretch]]:
    """Cut the walls where free paths pass, and where antenna pairs in plain view saw no reflection.

    Parameters
    ----------
    walls : sequence of Wall
        All of the map: what stands between explains why a reflection was not seen.
    sight : Legs
        Direct paths known to be free.
    links : Links
        All antenna pairs.
    max_gap : float
        Reflection points further apart are ends of different pieces [m].
    """
    if not walls:
        return []
    thinned = [wall.thinned(TELLING) for wall in walls]
    walls, kept = zip(*(without_strays(wall) for wall in walls), strict=True)
    prints = [footprint(wall, stretches(wall, SOLID_GAP)) for wall in walls]
    spans = np.array([span(print_) for print_ in prints])
    legs = [legs_of(wall) for wall in thinned]
    start = np.vstack([sight.start, *(leg.start for leg in legs)])
    end = np.vstack([sight.end, *(leg.end for leg in legs)])
    owner = np.r_[
        np.full(len(sight.start), -1), np.repeat(np.arange(len(walls)), [2 * wall.support for wall in thinned])
    ]
    tree = shapely.STRtree(shapely.linestrings(spans))  # of walls, which are fewer than legs by far
    leg, hull = tree.query(as_lines(start, end), predicate="intersects")
    order = np.argsort(hull, kind="stable")
    leg, hull = leg[order], hull[order]
    edges = np.searchsorted(hull, np.arange(len(walls) + 1))
    pieces = []
    for number, wall in enumerate(walls):
        crossing = leg[edges[number] : edges[number + 1]]
        crossing = crossing[owner[crossing] != number]
        silent = _silent(wall, number, prints, tree, links)
        cut = stretches(wall, max_gap, Legs(start[crossing], end[crossing]), silent)
        # one point far from the others may be another wall's that lies in line but for a few centimetres
        whole = [piece for piece in cut if len(piece.members) > 1] or cut
        pieces.append([piece._replace(members=kept[number][piece.members]) for piece in whole])
    return pieces


def span(print_: Footprint, beyond: float = 0.0) -> FloatArray:
    """Outermost ends (2, 2) of a footprint, prolonged at either end [m]."""
    line = print_.line
    return line.foot() + np.array([[print_.low.min() - beyond], [print_.high.max() + beyond]]) * line.direction()


def _silent(wall: Wall, number: int, prints: Sequence[Footprint], tree: shapely.STRtree, links: Links) -> FloatArray:
    """Where along a wall antenna pairs that saw no reflection, with no wall known between, should have [m]."""
    along = np.sort(wall.line.along(wall.points))
    if (
        np.diff(along).max(initial=0.0) <= SOLID
    ):  # between near reflection points the wall stands, whoever did not see it
        return np.empty(0)
    front, place = expected_places(wall.line, links.tx, links.rx)
    after = np.searchsorted(along, place)
    asked = (after > 0) & (after < len(along))
    asked[asked] = np.diff(along)[after[asked] - 1] > SOLID
    saw = np.zeros(len(links.tx), dtype=bool)
    saw[wall.paths.link] = True
    asked &= ~saw[front]
    front, after = front[asked], after[asked]
    points = bounce_points(wall.line, links.tx[front], links.rx[front])
    length = np.linalg.norm(links.tx[front] - points, axis=-1) + np.linalg.norm(links.rx[front] - points, axis=-1)
    # what is weaker than all that was seen may be in the noise
    rows = np.flatnonzero(length <= wall.paths.length.max())
    rows = rows[np.lexsort((length[rows], after[rows]))]
    rank = np.arange(len(rows)) - np.searchsorted(after[rows], after[rows])
    rows = rows[rank < WITNESSES]
    front, points = front[rows], points[rows]
    if not len(front):
        return np.empty(0)
    legs = Legs(np.vstack([links.tx[front], links.rx[front]]), np.vstack([points, points]))
    leg, other = tree.query(as_lines(*legs), predicate="intersects")
    hidden = np.zeros(len(legs.start), dtype=bool)
    for one in np.unique(other[other != number]):
        rows = leg[other == one]
        hidden[rows] |= prints[one].blocks(Legs(legs.start[rows], legs.end[rows]))
    return wall.line.along(points[~hidden.reshape(2, -1).any(axis=0)])


def as_lines(start: FloatArray, end: FloatArray) -> np.ndarray:
    """Lines (leg,) between points (leg, 2 or more), seen from above."""
    return shapely.linestrings(np.stack([start[:, :2], end[:, :2]], axis=1))
