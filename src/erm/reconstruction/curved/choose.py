"""Plane, cylinder or neither: the explanations of the same paths are compared by their evidence."""

from collections.abc import Sequence

import numpy as np

from erm.common.odds import THOUSAND_TO_ONE
from erm.reconstruction.curved.agreement import path_log_odds
from erm.reconstruction.curved.search import CurvedFace, CylinderSearch
from erm.reconstruction.model.fit import EXACT_LINE, chi_squared, fit_line, residuals
from erm.reconstruction.model.line import PLANE_SPAN
from erm.reconstruction.model.loss import log_odds_of_loss
from erm.reconstruction.model.paths import IntArray, Paths
from erm.reconstruction.search.greedy import Group

MAX_TANGENT_PATHS = 9
"""Paths up to which a plane may be a tangent of a curved face. Chosen; not derived."""


def curved_faces(
    paths: Paths, groups: Sequence[Group], pool: Paths, min_support: int
) -> tuple[list[CurvedFace], CylinderSearch, list[Group]]:
    """Cylinders that explain paths better than the planes that they were grouped on.

    The evidence of a face is the sum of the log odds of its paths against clutter, plus the logarithm of the volume of
    its parameters that agree with them, over that before the measurement (Laplace's method): a cylinder pays for its
    third parameter. A cylinder is accepted if it exceeds by 1000 : 1, times the number of searches, what the planes
    lose that its paths are taken from.

    Parameters
    ----------
    paths : Paths
        Paths of the groups.
    groups : sequence of Group
        Paths that share an image, of a plane.
    pool : Paths
        Paths that may be off cylinders, with any loss; their rows are those of the same table.
    min_support : int
        Fewest paths of a plane.

    Returns
    -------
    faces : list of CurvedFace
        Their inliers are indices of the pool.
    search : CylinderSearch
        Of the pool.
    groups : list of Group
        Those that are left, fitted to the paths that are left to them.
    """
    certain = [group.inliers for group in groups if len(group.inliers) > MAX_TANGENT_PATHS]
    grouped = paths.row[np.concatenate([np.empty(0, dtype=np.int64), *certain])]
    search = CylinderSearch(pool, ~np.isin(pool.row, grouped))
    candidates = search.run()
    owner = np.full(int(max(pool.row.max(initial=0), paths.row.max(initial=0))) + 1, -1)
    left = [group.inliers for group in groups]
    odds = [_plane_log_odds(paths, group, search) for group in groups]
    volume = [_plane_log_volume(group) for group in groups]
    for number, inliers in enumerate(left):
        owner[paths.row[inliers]] = number
    accepted: list[CurvedFace] = []
    taken = np.zeros(len(pool), dtype=bool)
    changed: set[int] = set()
    threshold = THOUSAND_TO_ONE + np.log(
        max(len(pool), 1)
    )  # one search from each path: as many chances of a false alarm
    while candidates:
        # planes lose nothing at best: a face gains no more than its evidence
        best, gain = -1, threshold
        for number in sorted(range(len(candidates)), key=lambda number: -candidates[number].evidence):
            face = candidates[number]
            if face.evidence < gain:
                break
            lost = _loss(face, search, owner, paths, left, odds, volume, min_support)
            if face.evidence - face.log_view - lost <= gain:  # which no view raises
                continue
            face = candidates[number] = search.seen(face)
            # the planes together have as many links that received nothing
            without = max(lost + face.log_view, 0.0)
            if face.evidence - without > gain:
                best, gain = number, face.evidence - without
        if best < 0:
            break
        face = candidates.pop(best)
        if taken[face.inliers].any():  # without the paths that others have it is less likely
            again = search.refine(
                np.array([*face.fit.centre, face.fit.radius]), face.fit.covariance, np.flatnonzero(~taken)
            )
            candidates += [] if again is None else [again]
            continue
        accepted.append(face)
        taken[face.inliers] = True
        rows = pool.row[face.inliers]
        for number in set(owner[rows].tolist()) - {-1}:
            kept = ~np.isin(paths.row[left[number]], rows)
            left[number], odds[number] = left[number][kept], odds[number][kept]
            changed.add(number)
        owner[rows] = -1
    result = []
    for number, group in enumerate(groups):
        if number not in changed:
            result.append(group)
        elif len(left[number]) >= min_support:
            result.append(Group(fit_line(paths.take(left[number]), group.line), left[number]))
    return accepted, search, result


def _loss(
    face: CurvedFace,
    search: CylinderSearch,
    owner: IntArray,
    paths: Paths,
    left: list[IntArray],
    odds: list[np.ndarray],
    volume: list[float],
    min_support: int,
) -> float:
    """Evidence that planes lose with the paths of a cylinder."""
    rows = search.paths.row[face.inliers]
    global_clutter = search.elements.log_clutter[face.inliers]
    denser = np.zeros(len(owner))
    denser[rows] = face.log_clutter - global_clutter
    lost = 0.0
    for number in set(owner[rows].tolist()) - {-1}:
        kept = ~np.isin(paths.row[left[number]], rows)
        # the same clutter as for the cylinder
        before = float((odds[number] - denser[paths.row[left[number]]]).sum()) + volume[number]
        after = float(odds[number][kept].sum()) + volume[number] if np.count_nonzero(kept) >= min_support else 0.0
        lost += max(before, 0.0) - max(after, 0.0)
    return lost


def _plane_log_odds(paths: Paths, group: Group, search: CylinderSearch) -> np.ndarray:
    own = paths.take(group.inliers)
    chi2 = chi_squared(own.columns, residuals(own.columns, group.line.frame()), EXACT_LINE)
    at = np.searchsorted(search.paths.row, own.row)
    elements = search.elements.take(np.minimum(at, len(search.paths) - 1))
    return path_log_odds(chi2, elements) + log_odds_of_loss(own.loss, own.loss_std)


def _plane_log_volume(group: Group) -> float:
    return float(np.log(2 * np.pi / (360 * PLANE_SPAN)) + np.linalg.slogdet(group.line.covariance)[1] / 2)
