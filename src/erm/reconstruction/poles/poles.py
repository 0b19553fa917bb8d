"""Poles from paths: lamp posts and columns reflect a weak path from the same point to every receiver.

All paths off one wall share an image; all paths off one pole share their reflection point. Their loss gives its radius:
the thinner a convex surface, the more the wave spreads behind it.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely
from scipy.spatial import cKDTree

from erm.common.odds import TWENTY_TO_ONE
from erm.geometry.vertical import FloatArray, reflection_point
from erm.geometry.vertical_covariance import point_covariance
from erm.reconstruction.decision.conflicts import MAX_EXTENSION
from erm.reconstruction.decision.pieces import hidden_legs, span
from erm.reconstruction.model.extent import Legs, solid_footprint
from erm.reconstruction.model.fit import CHI_SQUARED_GATE
from erm.reconstruction.model.grid import Grid
from erm.reconstruction.model.line import Lines
from erm.reconstruction.model.paths import BoolArray, IntArray, Paths
from erm.reconstruction.model.ragged import Ragged
from erm.reconstruction.model.wall import Wall
from erm.reconstruction.poles.cylinder import Cylinder, refine_cylinder
from erm.reconstruction.poles.evidence import ClutterDensity, pole_log_odds
from erm.reconstruction.poles.point_scatterers import (
    InitialPole,
    Points,
    initial_poles,
    path_errors,
    radii_from_loss,
    refine_points,
)
from erm.reconstruction.search.false_alarm import log_probability_of_view
from erm.reconstruction.search.greedy import GreedySelection, Trial
from erm.reconstruction.search.images import mahalanobis

POLE_SEARCH_RADIUS = 2.0
"""Distance from a pole within which the reflection points of its paths are searched [m]. Chosen; not derived."""
MIN_POLE_LOSS = 6.0
"""Smallest loss of a path off a pole [dB]: a cylinder seen from further than its radius loses more."""
MIN_WALL_DISTANCE = 0.5
"""Distance to a wall below which a pole is taken for its roughness or a pilaster [m]. Chosen; not derived."""


class Pole(NamedTuple):
    """A vertical cylinder and the paths off it."""

    centre: FloatArray  # (2,) m
    covariance: FloatArray  # (2, 2) m2
    radius: float  # m, of a perfectly reflecting one
    top: float  # m, of the highest reflection point
    inliers: IntArray
    reduced_chi_squared: float


def find_poles(paths: Paths, walls: Sequence[Wall], min_support: int) -> list[Pole]:
    """Find poles that at least ``min_support`` links agree on.

    Delays and azimuths of a pole's paths, and the single radius that their losses imply, must be twenty times more
    likely than if the paths were clutter or off an image (`erm.reconstruction.poles.evidence`); of 2800 such candidates
    on random streets three were no poles. Less than one such point must be expected by chance, and the legs must not
    pass through walls.

    Parameters
    ----------
    paths : Paths
        Paths that belong to no wall, with any loss.
    walls : sequence of Wall
        Walls of the map.
    min_support : int
    """
    rows = np.flatnonzero(paths.loss > MIN_POLE_LOSS)
    paths = paths.take(rows)
    if len(paths) < min_support:
        return []
    measured = paths.tx, paths.rx, paths.length, paths.azimuth
    points, _ = reflection_point(*measured)
    starts = Points(points, point_covariance(*measured, *path_errors(paths.columns))[:, :2, :2])
    clutter = ClutterDensity(paths, points)
    found = _search(paths, starts, min_support)
    fitted = _fit_cylinders(paths, clutter.tree, found, min_support)
    if not fitted:
        return []
    density = clutter.at(np.array([one.centre for one, _ in fitted]), [inliers for _, inliers in fitted])
    obstacles = WallObstacles(walls)
    _, first = np.unique(paths.link, return_index=True)
    links = paths.take(first)
    poles: list[Pole] = []
    for (cylinder, inliers), own_density in zip(fitted, density.tolist(), strict=True):
        own = paths.take(inliers)
        if clutter.expected_false_alarms(own) > 1:
            continue
        of_pole, of_images = pole_log_odds(own, cylinder, own_density, min_support)
        if of_pole - of_images < TWENTY_TO_ONE or obstacles.touch(cylinder):
            continue
        if np.mean(obstacles.hide(cylinder, own)) > 0.5:
            continue
        # a link with a weaker path than all that received the pole is not expected to receive it
        near = links.take(_spreading(cylinder, links) <= _spreading(cylinder, own).max())
        in_view = int(np.count_nonzero(~obstacles.hide(cylinder, near)))
        if of_pole + log_probability_of_view(len(inliers), in_view) > TWENTY_TO_ONE:
            poles.append(
                Pole(
                    cylinder.centre,
                    cylinder.covariance[:2, :2],
                    cylinder.radius_by_loss,
                    cylinder.top,
                    rows[inliers],
                    cylinder.reduced_chi_squared,
                )
            )
    return poles


def _search(paths: Paths, starts: Points, min_support: int) -> list[InitialPole]:
    """Points that at least ``min_support`` links agree on."""
    points = starts.position
    sheet, radius = np.zeros(len(paths), dtype=np.int64), np.full(len(paths), POLE_SEARCH_RADIUS)
    pairs = Grid(points, sheet, POLE_SEARCH_RADIUS).within(points, sheet, radius)[:2]
    near = Ragged.from_pairs(*pairs, len(paths))
    of = near.owner
    # for two inliers d' (C1 + C2)**-1 d is at most the sum of their own deviations from the pole
    apart = mahalanobis(points[of] - points[near.rows], starts.covariance[of] + starts.covariance[near.rows])
    enough = near.masked(apart < 2 * CHI_SQUARED_GATE).count_distinct(paths.link) >= min_support
    order = np.lexsort((paths.length, -near.count_distinct(paths.link)))
    selection = GreedySelection[InitialPole](np.arange(len(paths)), min_support)
    selection.run(
        order[enough[order]],
        lambda seeds, free: _try_seeds(paths, starts.take(seeds), near.take(seeds), free, min_support),
        near,
    )
    return selection.found


def _try_seeds(
    paths: Paths, starts: Points, around: Ragged, free: BoolArray, min_support: int
) -> list[Trial[InitialPole]]:
    """Poles that the free paths around starting points agree on, if any."""
    points, inliers, depends_on = refine_points(paths, starts, around.masked(free[around.rows]), min_support)
    some = np.flatnonzero(inliers.sizes)
    found: list[InitialPole | None] = [None] * len(inliers)
    if len(some):
        for number, pole in zip(
            some.tolist(), initial_poles(paths, points.take(some), inliers.take(some)), strict=True
        ):
            found[number] = pole
    return [Trial(pole, needed) for pole, needed in zip(found, depends_on, strict=True)]


def _fit_cylinders(
    paths: Paths, tree: cKDTree, found: Sequence[InitialPole], min_support: int
) -> list[tuple[Cylinder, IntArray]]:
    """Cylinders fitted to poles, and their paths; those that most paths agree with come first."""
    free = np.ones(len(paths), dtype=bool)
    fitted = []
    for pole in sorted(found, key=lambda pole: -len(pole.inliers)):
        start = pole.inliers[free[pole.inliers]]
        if len(start) < min_support:
            continue
        around = np.array(tree.query_ball_point(pole.centre, POLE_SEARCH_RADIUS + 2 * pole.radius), dtype=np.int64)
        around = np.union1d(around[free[around]], start)
        refined = refine_cylinder(paths, around, start, pole.centre, pole.radius, min_support)
        if refined is not None:
            free[refined[1]] = False
            fitted.append(refined)
    return fitted


def _spreading(pole: Cylinder, links: Paths) -> FloatArray:
    """Quantity ``d1 d2 (d1 + d2)`` (path,) [m3] that the power off a thin pole is inversely proportional to."""
    first, second = (np.linalg.norm(end[:, :2] - pole.centre, axis=-1) for end in (links.tx, links.rx))
    return first * second * (first + second)


class WallObstacles:
    """The walls of the map as obstacles.

    Parameters
    ----------
    walls : sequence of Wall
    """

    def __init__(self, walls: Sequence[Wall]) -> None:
        self._footprints = [solid_footprint(wall) for wall in walls]
        self._frames = Lines.from_list([wall.line for wall in walls]).frames()
        self._low = np.array([one.low.min() for one in self._footprints]) - MAX_EXTENSION
        self._high = np.array([one.high.max() for one in self._footprints]) + MAX_EXTENSION
        spans = np.array([span(one) for one in self._footprints]).reshape(-1, 2, 2)
        self._tree = shapely.STRtree(shapely.linestrings(spans))

    def touch(self, pole: Cylinder) -> bool:
        """Whether a pole stands at a wall, or where a wall may extend to."""
        along, distance = self._frames.along(pole.centre), self._frames.signed_distance(pole.centre)
        return bool(np.any((self._low < along) & (along < self._high) & (np.abs(distance) < MIN_WALL_DISTANCE)))

    def hide(self, pole: Cylinder, paths: Paths) -> BoolArray:
        """Whether (path,) paths off a pole would have to pass through walls."""
        height = radii_from_loss(paths, pole.centre)[1]
        point = np.column_stack([np.broadcast_to(pole.centre, (len(paths), 2)), height])
        legs = Legs(np.vstack([paths.tx, paths.rx]), np.vstack([point, point]))
        return np.asarray(hidden_legs(legs, self._tree, self._footprints).reshape(2, -1).any(axis=0))
