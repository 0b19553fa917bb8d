"""Walls cut into the pieces that stand: unobstructed paths and missing reflections show the openings."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely

from erm.geometry.vertical import FloatArray
from erm.reconstruction.model.extent import (
    MAX_TESTED_PATHS,
    Footprint,
    Legs,
    Piece,
    cut_wall,
    expected_reflections,
    legs_of,
    solid_footprint,
    without_strays,
)
from erm.reconstruction.model.line import reflection_points
from erm.reconstruction.model.wall import Wall

MAX_LINKS_PER_GAP = 32
"""Links tested for a reflection in a gap, the shortest first. Chosen; not derived."""


class Links(NamedTuple):
    """Antenna pairs of a campaign, in the order of their numbers."""

    tx: FloatArray  # (link, 3) m
    rx: FloatArray  # (link, 3) m


def cut_walls(
    walls: Sequence[Wall], lines_of_sight: Legs, links: Links, max_gap: float, curved: np.ndarray
) -> list[list[Piece]]:
    """Cut walls where unobstructed paths pass, and where links with a clear view received no reflection.

    Parameters
    ----------
    walls : sequence of Wall
        All walls of the map: one in between explains why a reflection was not received.
    lines_of_sight : Legs
        Direct paths known to be unobstructed.
    links : Links
        All antenna pairs.
    max_gap : float
        Reflection points further apart are on different pieces [m].
    curved : array (face,) of shapely.Geometry
        Where curved faces stand: they hide walls, too.

    Returns
    -------
    list of list of Piece
        The pieces of each wall.
    """
    if not walls:
        return []
    thinned = [wall.thinned(MAX_TESTED_PATHS) for wall in walls]
    walls, kept = zip(*(without_strays(wall) for wall in walls), strict=True)
    footprints = [solid_footprint(wall) for wall in walls]
    spans = np.array([span(one) for one in footprints])
    legs = [legs_of(wall) for wall in thinned]
    start = np.vstack([lines_of_sight.start, *(leg.start for leg in legs)])
    end = np.vstack([lines_of_sight.end, *(leg.end for leg in legs)])
    owner = np.r_[
        np.full(len(lines_of_sight.start), -1), np.repeat(np.arange(len(walls)), [2 * wall.support for wall in thinned])
    ]
    tree = shapely.STRtree(shapely.linestrings(spans))  # of walls, which are far fewer than legs
    leg, crossed = tree.query(plan_lines(start, end), predicate="intersects")
    order = np.argsort(crossed, kind="stable")
    leg, crossed = leg[order], crossed[order]
    edges = np.searchsorted(crossed, np.arange(len(walls) + 1))
    pieces, shadows = [], shapely.STRtree(curved)
    for number, wall in enumerate(walls):
        crossing = leg[edges[number] : edges[number + 1]]
        crossing = crossing[owner[crossing] != number]
        missed = _missed_reflections(wall, number, footprints, (tree, shadows), links)
        cut = cut_wall(wall, max_gap, Legs(start[crossing], end[crossing]), missed)
        # a single point far from the others may be off another wall in line with this one to a few centimetres
        supported = [piece for piece in cut if len(piece.inliers) > 1] or cut
        pieces.append([piece._replace(inliers=kept[number][piece.inliers]) for piece in supported])
    return pieces


def span(footprint: Footprint, beyond: float = 0.0) -> FloatArray:
    """Outermost ends (2, 2) of a footprint, extended at either end [m]."""
    line = footprint.line
    return line.foot() + np.array([[footprint.low.min() - beyond], [footprint.high.max() + beyond]]) * line.direction()


def _missed_reflections(
    wall: Wall,
    number: int,
    footprints: Sequence[Footprint],
    trees: tuple[shapely.STRtree, shapely.STRtree],
    links: Links,
) -> FloatArray:
    """Places (n,) along a wall where links should have received a reflection and did not, with nothing between [m]."""
    along = np.sort(wall.line.along(wall.reflection_points))
    front, place = expected_reflections(wall.line, links.tx, links.rx)
    after = np.searchsorted(along, place)
    received = np.zeros(len(links.tx), dtype=bool)
    received[wall.paths.link] = True
    asked = ~received[front]
    front, after = front[asked], after[asked]
    points = reflection_points(wall.line, links.tx[front], links.rx[front])
    length = np.linalg.norm(links.tx[front] - points, axis=-1) + np.linalg.norm(links.rx[front] - points, axis=-1)
    # a longer path than all that were received may be below the noise
    rows = np.flatnonzero(length <= wall.paths.length.max())
    rows = rows[np.lexsort((length[rows], after[rows]))]
    rank = np.arange(len(rows)) - np.searchsorted(after[rows], after[rows])
    rows = rows[rank < MAX_LINKS_PER_GAP]
    front, points = front[rows], points[rows]
    if not len(front):
        return np.empty(0)
    legs = Legs(np.vstack([links.tx[front], links.rx[front]]), np.vstack([points, points]))
    hidden = hidden_legs(legs, trees[0], footprints, without=number) | meet(legs, trees[1])
    return wall.line.along(points[~hidden.reshape(2, -1).any(axis=0)])


def hidden_legs(
    legs: Legs, tree: shapely.STRtree, footprints: Sequence[Footprint], without: int | None = None
) -> np.ndarray:
    """Whether (leg,) legs would pass through walls.

    Parameters
    ----------
    legs : Legs
    tree : shapely.STRtree
        Spans of the walls.
    footprints : sequence of Footprint
        Of the same walls.
    without : int, optional
        A wall that is not counted.
    """
    hidden = np.zeros(len(legs.start), dtype=bool)
    leg, wall = tree.query(plan_lines(*legs), predicate="intersects")
    for number in set(wall.tolist()) - {without}:
        rows = leg[wall == number]
        hidden[rows] |= footprints[number].blocks(Legs(legs.start[rows], legs.end[rows]))
    return hidden


def meet(legs: Legs, curved: shapely.STRtree) -> np.ndarray:
    """Whether (leg,) legs, seen from above, meet any of the curved faces of a tree."""
    met = np.zeros(len(legs.start), dtype=bool)
    met[curved.query(plan_lines(*legs), predicate="intersects")[0]] = True
    return met


def plan_lines(start: FloatArray, end: FloatArray) -> np.ndarray:
    """Line strings (leg,) between points (leg, 2 or more), seen from above."""
    return shapely.linestrings(np.stack([start[:, :2], end[:, :2]], axis=1))
