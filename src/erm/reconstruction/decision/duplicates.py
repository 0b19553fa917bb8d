"""Candidates that are one line are merged."""

from collections.abc import Sequence

import numpy as np

from erm.geometry.vertical import angle_difference
from erm.reconstruction.model.fit import CHI_SQUARED_GATE, fit_line, misfit
from erm.reconstruction.model.loss import median_loss
from erm.reconstruction.model.paths import IntArray
from erm.reconstruction.model.wall import Wall

DUPLICATE_OFFSET = 0.02
"""Difference of offsets below which overlapping lines are one [m]. Chosen; not derived."""
DUPLICATE_ANGLE = 0.2
"""Angle below which overlapping lines are one [degree]. Chosen; not derived."""
MAX_TESTED_ANGLE, MAX_TESTED_OFFSET = 10.0, 2.0
"""Angle [degree] and distance [m] up to which two lines are compared at all. Chosen; not derived."""


def merge_duplicates(candidates: Sequence[Wall], max_gap: float) -> list[Wall]:
    """Merge candidates that are one line within their errors.

    Parameters
    ----------
    candidates : sequence of Wall
    max_gap : float
        Lines further apart along their direction are not compared [m].

    Returns
    -------
    list of Wall
        Best supported first.
    """
    ranked = sorted(candidates, key=lambda wall: (-wall.support, round(median_loss(wall), 6)))
    kept: list[Wall] = []
    normals = np.array([wall.line.normal for wall in ranked])
    middles = np.array([np.median(wall.reflection_points[:, :2], axis=0) for wall in ranked]).reshape(-1, 2)
    place: list[int] = []
    for number, wall in enumerate(ranked):
        angle = np.abs(angle_difference(normals[place], wall.line.normal))
        offset = np.abs(wall.line.signed_distance(middles[place])) if place else np.empty(0)
        near = np.flatnonzero((angle < MAX_TESTED_ANGLE) & (offset < MAX_TESTED_OFFSET))
        duplicate = next((int(i) for i in near if _are_duplicates(kept[i], wall, max_gap)), None)
        if duplicate is None:
            kept.append(wall)
            place.append(number)
        else:
            kept[duplicate] = _merge(kept[duplicate], wall)
    return kept


def _are_duplicates(wall: Wall, other: Wall, max_gap: float) -> bool:
    """Whether two nearby lines are one within their errors, or nearly so."""
    along, of_other = wall.line.along(wall.reflection_points), wall.line.along(other.reflection_points)
    if of_other.min() > along.max() + max_gap or of_other.max() < along.min() - max_gap:
        return False
    line = wall.line.with_pivot(other.line.pivot)
    angle = abs(float(angle_difference(other.line.normal, line.normal)))
    # lines that follow one another may be the faces of a bent facade
    overlap = of_other.min() < along.max() and of_other.max() > along.min()
    if overlap and angle < DUPLICATE_ANGLE and abs(other.line.offset - line.offset) < DUPLICATE_OFFSET:
        return True
    return float(np.mean(misfit(other.paths, wall.line) < CHI_SQUARED_GATE)) > 0.5


def _merge(wall: Wall, other: Wall) -> Wall:
    """Return a wall with the other's paths that agree with it, of links that it does not have, fitted again.

    The other may have paths off a third wall beside them, which would turn the line.
    """
    agrees = misfit(other.paths, wall.line) < CHI_SQUARED_GATE
    fresh = other.inliers[agrees & ~np.isin(other.paths.link, wall.paths.link)]
    inliers: IntArray = np.sort(np.r_[wall.inliers, fresh])
    return Wall(wall.all_paths, fit_line(wall.all_paths.take(inliers), wall.line), inliers)
