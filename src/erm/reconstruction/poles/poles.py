"""Poles from paths: lamp posts and columns throw a weak path from one and the same point to every receiver.

Where all paths off one wall share an image, all paths off one pole share their reflection point; and what they lose
tells its radius, for the wave spreads behind a convex face the more the thinner that is.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely
from scipy.spatial import cKDTree

from erm.geometry.vertical import FloatArray, point_covariance, reflection_point
from erm.reconstruction.decision.conflicts import BEYOND
from erm.reconstruction.decision.pieces import SOLID_GAP, as_lines, span
from erm.reconstruction.model.extent import Legs, footprint, stretches
from erm.reconstruction.model.grid import Grid
from erm.reconstruction.model.line import Lines
from erm.reconstruction.model.paths import BoolArray, IntArray, Paths
from erm.reconstruction.model.ragged import Ragged
from erm.reconstruction.model.wall import Wall
from erm.reconstruction.poles.cylinder import Cylinder, settled
from erm.reconstruction.poles.evidence import Strays, log_odds, of_choice
from erm.reconstruction.poles.point_scatterers import Points, Start, errors, poles_of, radii_of, settle
from erm.reconstruction.search.greedy import Trial, Turns
from erm.reconstruction.search.images import GATE, mahalanobis

REACH = 2.0  # m; members' points lie this near to a pole
LEAST_LOSS = 6.0  # dB; a cylinder seen from farther than its radius loses more
ACCIDENTS = 1.0  # points that chance may be expected to let as many links agree on
LEAST_ODDS = 3.0  # log; of 2800 likelier than this on random streets three were no poles
OFF_WALL = 0.5  # m; what is nearer to a wall is its roughness, or a pilaster


class Pole(NamedTuple):
    """A vertical cylinder and the paths off it."""

    centre: FloatArray  # (2,) m
    covariance: FloatArray  # (2, 2) m2
    radius: float  # m, of a perfectly reflecting one
    top: float  # m, of the highest bounce
    members: IntArray
    strain: float  # chi-squared a degree of freedom


def find_poles(paths: Paths, walls: Sequence[Wall], min_support: int) -> list[Pole]:
    """Poles that at least ``min_support`` links agree on, none of whose paths a wall explains.

    Delays and azimuths of a pole's paths, and the one radius that their losses tell, must be twenty times likelier than
    if the paths came from anywhere or off an image (`erm.reconstruction.poles.evidence`), no such point may be
    expected by chance, and the legs must not pass through walls.

    Parameters
    ----------
    paths : Paths
        Those that no wall has, of whatever loss.
    walls : sequence of Wall
        Walls of the map.
    """
    rows = np.flatnonzero(paths.loss > LEAST_LOSS)
    paths = paths.take(rows)
    if len(paths) < min_support:
        return []
    measured = paths.tx, paths.rx, paths.length, paths.azimuth
    points, _ = reflection_point(*measured)
    starts = Points(points, point_covariance(*measured, *errors(paths.rays))[:, :2, :2])
    strays = Strays(paths, points)
    sheet, reach = np.zeros(len(paths), dtype=np.int64), np.full(len(paths), REACH)
    near = Ragged.of_pairs(*Grid(points, sheet, REACH).within(points, sheet, reach)[:2], len(paths))
    of = near.owner
    # of two members d' (C1 + C2)**-1 d is no more than the sum of what each departs from the pole
    apart = mahalanobis(points[of] - points[near.rows], starts.covariance[of] + starts.covariance[near.rows])
    enough = near.kept(apart < 2 * GATE).distinct(paths.link) >= min_support
    order = np.lexsort((paths.length, -near.distinct(paths.link)))
    turns = Turns[Start](np.arange(len(paths)), min_support)
    turns.take(
        order[enough[order]],
        lambda seeds, free: _tried(paths, starts.take(seeds), near.take(seeds), free, min_support),
        near,
    )
    fitted = _fitted(paths, strays.tree, turns.found, min_support)
    if not fitted:
        return []
    density = strays.density(np.array([one.centre for one, _ in fitted]), [members for _, members in fitted])
    standing = Standing(walls)
    _, every = np.unique(paths.link, return_index=True)
    links = paths.take(every)
    poles: list[Pole] = []
    for (one, members), crowd in zip(fitted, density.tolist(), strict=True):
        own = paths.take(members)
        if strays.accidents(own) > ACCIDENTS:
            continue
        of_pole, of_images = log_odds(own, one, crowd, min_support)
        if of_pole - of_images < LEAST_ODDS or standing.touch(one) or np.mean(standing.hide(one, own)) > 0.5:
            continue
        # where a pole is weaker than to all that see it, nobody expects it
        near_by = links.take(_spread(one, links) <= _spread(one, own).max())
        in_view = int(np.count_nonzero(~standing.hide(one, near_by)))
        if of_pole + of_choice(len(members), in_view) > LEAST_ODDS:
            poles.append(Pole(one.centre, one.covariance[:2, :2], one.by_loss, one.top, rows[members], one.strain))
    return poles


def _fitted(paths: Paths, tree: cKDTree, found: Sequence[Start], min_support: int) -> list[tuple[Cylinder, IntArray]]:
    """Cylinders in place of points on surfaces, and their paths; those that most paths agree with choose first."""
    free = np.ones(len(paths), dtype=bool)
    fitted = []
    for pole in sorted(found, key=lambda pole: -len(pole.members)):
        start = pole.members[free[pole.members]]
        if len(start) < min_support:
            continue
        around = np.array(tree.query_ball_point(pole.centre, REACH + 2 * pole.radius), dtype=np.int64)
        around = np.union1d(around[free[around]], start)
        one = settled(paths, around, start, pole.centre, pole.radius, min_support)
        if one is not None:
            free[one[1]] = False
            fitted.append(one)
    return fitted


def _spread(pole: Cylinder, links: Paths) -> FloatArray:
    """What the power off a thin pole falls with (path,), ``d1 d2 (d1 + d2)`` [m3]."""
    first, second = (np.linalg.norm(end[:, :2] - pole.centre, axis=-1) for end in (links.tx, links.rx))
    return first * second * (first + second)


def _tried(paths: Paths, starts: Points, around: Ragged, free: BoolArray, min_support: int) -> list[Trial[Start]]:
    """Poles that paths around starts agree on, where they do."""
    points, members, seen = settle(paths, starts, around.kept(free[around.rows]), min_support)
    some = np.flatnonzero(members.sizes)
    found: list[Start | None] = [None] * len(members)
    if len(some):
        for number, pole in zip(some.tolist(), poles_of(paths, points.take(some), members.take(some)), strict=True):
            found[number] = pole
    return [Trial(pole, before) for pole, before in zip(found, seen, strict=True)]


class Standing:
    """What stands there: the walls of the map.

    Parameters
    ----------
    walls : sequence of Wall
    """

    def __init__(self, walls: Sequence[Wall]) -> None:
        self.prints = [footprint(wall, stretches(wall, SOLID_GAP)) for wall in walls]
        self.frames = Lines.of([wall.line for wall in walls]).frames()
        self.low = np.array([print_.low.min() for print_ in self.prints]) - BEYOND
        self.high = np.array([print_.high.max() for print_ in self.prints]) + BEYOND
        spans = np.array([span(print_) for print_ in self.prints]).reshape(-1, 2, 2)
        self.tree = shapely.STRtree(shapely.linestrings(spans))

    def touch(self, pole: Cylinder) -> bool:
        """Whether a pole stands on a wall, or where it may go on."""
        along, depth = self.frames.along(pole.centre), self.frames.depth(pole.centre)
        return bool(np.any((self.low < along) & (along < self.high) & (np.abs(depth) < OFF_WALL)))

    def hide(self, pole: Cylinder, paths: Paths) -> BoolArray:
        """Paths (path,) that would have to pass through walls to come off a pole."""
        height = radii_of(paths, pole.centre)[1]
        point = np.column_stack([np.broadcast_to(pole.centre, (len(paths), 2)), height])
        legs = Legs(np.vstack([paths.tx, paths.rx]), np.vstack([point, point]))
        behind = np.zeros(len(legs.start), dtype=bool)
        leg, wall = self.tree.query(as_lines(*legs), predicate="intersects")
        for number in np.unique(wall).tolist():
            some = leg[wall == number]
            behind[some] |= self.prints[number].blocks(Legs(legs.start[some], legs.end[some]))
        return np.asarray(behind.reshape(2, -1).any(axis=0))
