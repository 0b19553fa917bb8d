"""Poles from paths: lamp posts and columns throw a weak path from one and the same point to every receiver.

Where all paths off one wall share an image, all paths off one pole share their reflection point; and what they lose
tells its radius, for the wave spreads behind a convex face the more the thinner that is.
"""

from collections.abc import Sequence

import numpy as np
import shapely
from scipy.spatial import cKDTree
from scipy.special import gammainc

from erm.geometry import point_covariance, reflection_point
from erm.walls.chance import UNSEEN
from erm.walls.conflicts import BEYOND
from erm.walls.consensus import find_groups
from erm.walls.extent import Legs, footprint, stretches
from erm.walls.grid import Grid
from erm.walls.images import GATE, mahalanobis
from erm.walls.line import Lines
from erm.walls.paths import BoolArray, Paths
from erm.walls.pieces import SOLID_GAP, as_lines, span
from erm.walls.ragged import Ragged
from erm.walls.scatterers import Points, Pole, errors, middle_of_antennas, misfit, poles_of, radii_of, settle
from erm.walls.turns import Trial, Turns
from erm.walls.wall import Wall

REACH = 2.0  # m; members' points lie this near to a pole
LEAST_LOSS = 6.0  # dB; a cylinder seen from farther than its radius loses more
PLENTY = 4  # links; fewer must agree beyond all chance, as many where no such accident is expected
RING = 10.0  # outer radius of the ring about a pole that is counted, in radii of the gate
ACCIDENTS = 0.001  # poles that chance may be expected to make of as few links
OFF_WALL = 0.5  # m; what is nearer to a wall is its roughness, or a pilaster
ALONE = 3.0  # m; points closer than this to each other are the roughness of a wall that nobody saw


def find_poles(paths: Paths, walls: Sequence[Wall], min_support: int) -> list[Pole]:
    """Poles that at least ``min_support`` links agree on, none of whose paths a wall explains.

    A point must explain delays and azimuths of its paths, their losses must tell one radius, and the legs must not
    pass through walls.

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
    min_support = max(min_support, fewest_links(len(paths)))
    measured = paths.tx, paths.rx, paths.length, paths.azimuth
    points, _ = reflection_point(*measured)
    starts = Points(points, point_covariance(*measured, *errors(paths.rays)))
    sheet, reach = np.zeros(len(paths), dtype=np.int64), np.full(len(paths), REACH)
    near = Ragged.of_pairs(*Grid(points, sheet, REACH).within(points, sheet, reach)[:2], len(paths))
    links = near.distinct(paths.link)
    of = near.owner
    # of two members d' (C1 + C2)**-1 d is no more than the sum of what each departs from the pole
    apart = mahalanobis(points[of] - points[near.rows], starts.covariance[of] + starts.covariance[near.rows])
    enough = near.kept(apart < 2 * GATE).distinct(paths.link) >= min_support
    order = np.lexsort((paths.length, -links))
    turns = Turns[Pole](np.arange(len(paths)), min_support)
    turns.take(
        order[enough[order]],
        lambda seeds, free: _tried(paths, starts.take(seeds), near.take(seeds), free, min_support),
        near,
    )
    tree = cKDTree(points)
    found = [pole for pole in turns.found if not _accidental(paths, tree, pole)]
    if not found:
        return []
    members = np.zeros(len(paths), dtype=bool)
    members[np.concatenate([pole.members for pole in found])] = True
    chain = np.full(len(paths), -1)
    for number, group in enumerate(find_groups(paths, 3, seeds=members)):
        chain[group.members] = number
    standing = Standing(walls)
    poles: list[Pole] = []
    for pole in found:
        of_chain = np.bincount(chain[pole.members] + 1)[1:].max(initial=0) >= len(pole.members) / 2
        if not of_chain and not standing.touch(pole) and not standing.hide(pole, paths.take(pole.members)):
            poles.append(pole)
    centres = np.array([pole.centre for pole in poles]).reshape(-1, 2)
    crowd = np.linalg.norm(centres[:, None] - centres, axis=-1) < ALONE
    return [p._replace(members=rows[p.members]) for p, near_by in zip(poles, crowd, strict=True) if near_by.sum() == 1]


def _tried(paths: Paths, starts: Points, around: Ragged, free: BoolArray, min_support: int) -> list[Trial[Pole]]:
    """Poles that paths around starts agree on, where they do."""
    points, members, seen = settle(paths, starts, around.kept(free[around.rows]), min_support)
    some = np.flatnonzero(members.sizes)
    found: list[Pole | None] = [None] * len(members)
    if len(some):
        for number, pole in zip(some.tolist(), poles_of(paths, points.take(some), members.take(some)), strict=True):
            found[number] = pole
    return [Trial(pole, before) for pole, before in zip(found, seen, strict=True)]


def fewest_links(count: int) -> int:
    """Fewest links that make a pole among ``count`` paths: an accident of fewer is never excluded."""
    links = 3
    while count * chance_of(links, 0) > _allowed(links):
        links += 1
    return links


def chance_of(links: int, others: int) -> float:
    """Probability that a point laid by one path has by chance the company of as many more as make ``links``.

    With ``n`` paths in the ring from one to `RING` radii of the gate, the gate holds ``m = (n + 1/2) / (RING**2 - 1)``
    by chance, and ``P(Poisson(m) >= k)`` is the regularised incomplete gamma function ``P(k, m)``.
    """
    return float(gammainc(max(links - 1, 1), (others + UNSEEN) / (RING**2 - 1)))


def _allowed(links: int) -> float:
    """Accidents that may be expected beside a pole of so many links."""
    return ACCIDENTS if links < PLENTY else 1.0


def _accidental(paths: Paths, tree: cKDTree, pole: Pole) -> bool:
    """Whether poles of as many links would be found if all paths came from anywhere, as many as about this one.

    Each of the ``N`` paths lays a point, so ``N`` times `chance_of` are expected. Where those alone whose points, in a
    tree, are near are enough for that, the others are not asked.
    """
    limit = _allowed(len(pole.members))
    inward = pole.centre - middle_of_antennas(paths.take(pole.members), np.array([0, len(pole.members)]))[0]
    surface = pole.centre - pole.radius * inward / np.linalg.norm(inward)
    for rows in (np.array(tree.query_ball_point(surface, RING * REACH), dtype=np.int64), np.arange(len(paths))):
        chi2 = misfit(paths.rays.take(rows[~np.isin(rows, pole.members)]), surface, pole.covariance)
        about = int(np.count_nonzero((chi2 > GATE) & (chi2 < RING**2 * GATE)))
        if len(paths) * chance_of(len(pole.members), about) > limit:
            return True
    return False


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

    def touch(self, pole: Pole) -> bool:
        """Whether a pole stands on a wall, or where it may go on."""
        along, depth = self.frames.along(pole.centre), self.frames.depth(pole.centre)
        return bool(np.any((self.low < along) & (along < self.high) & (np.abs(depth) < OFF_WALL)))

    def hide(self, pole: Pole, paths: Paths) -> bool:
        """Whether most of the paths of a pole would have to pass through walls."""
        height = radii_of(paths, pole.centre)[1]
        point = np.column_stack([np.broadcast_to(pole.centre, (len(paths), 2)), height])
        legs = Legs(np.vstack([paths.tx, paths.rx]), np.vstack([point, point]))
        behind = np.zeros(len(legs.start), dtype=bool)
        for number in np.unique(self.tree.query(as_lines(*legs), predicate="intersects")[1]).tolist():
            behind |= self.prints[number].blocks(legs)
        return bool(np.mean(behind.reshape(2, -1).any(axis=0)) > 0.5)
