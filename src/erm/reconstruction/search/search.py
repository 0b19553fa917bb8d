"""The consensus search where the errors of the paths are not well known: the residuals show how large they are."""

import numpy as np

from erm.common.constants import c
from erm.geometry.vertical import FloatArray
from erm.mpcs.standard_errors import SMALLEST_ERRORS, robust_std, widen_errors
from erm.reconstruction.model.fit import fit_lines, residuals
from erm.reconstruction.model.line import Lines, seed_lines
from erm.reconstruction.model.paths import BoolArray, IntArray, Paths
from erm.reconstruction.model.ragged import Ragged, concatenate_rows
from erm.reconstruction.search.consensus import find_groups
from erm.reconstruction.search.greedy import Group

MIN_RESIDUALS = 6
"""Residuals with enough freedom that are needed to estimate an error. Chosen; not derived."""
MIN_FREEDOM = 0.2
"""Smallest ``1 - leverage`` of a residual that errors are estimated from. Chosen; not derived."""
ERROR_CHANGE = 0.1
"""Relative change of an error for which the search is repeated. Chosen; not derived."""
SURVEY_LENGTH = 0.01
"""Error of length that the first search allows for [m]: antennas are surveyed to a centimetre, and 30 ps of a clock are
as much."""
SURVEY_AZIMUTH = 0.2
"""Error of azimuth that the first search allows for [degree]: the heading of a mast. Chosen; not derived."""
NEW_MPC = -2
"""``image`` of a path that an earlier search did not have."""


def search_groups(
    paths: Paths, known: BoolArray, min_support: int, count: int = 0, image: IntArray | None = None
) -> tuple[Paths, list[Group]]:
    """Find the groups of paths with common images, and the errors of the paths that these groups show.

    Where a table gives no errors (``known`` is false) the first estimates are those of `erm.mpcs.selection.select` from
    ``count`` direct paths; the residuals are then pooled with them. Where a table gives errors, what the residuals show
    beyond them is added: survey and clock errors shift all paths of a link equally, and the table does not contain
    them. The first search allows for such errors, so that it does not leave out the links that show them. It is
    repeated at most twice with better errors.

    Parameters
    ----------
    paths : Paths
    known : array (path,) of bool
        Whether the table gave the errors.
    min_support : int
    count : int
        Direct paths that the errors were estimated from.
    image : array (path,) of int, optional
        Group of each path in an earlier search, -1 for none, `NEW_MPC` for paths that it did not have. These groups
        show the errors and collect their paths first, and only new paths start new groups.

    Returns
    -------
    paths : Paths
        With other errors.
    groups : list of Group
    """
    first = paths
    length_std = np.where(known, np.hypot(first.length_std, SURVEY_LENGTH), first.length_std)
    azimuth_std = np.where(known, np.hypot(first.azimuth_std, SURVEY_AZIMUTH), first.azimuth_std)
    paths = first.with_errors(length_std, azimuth_std)
    before: list[Group] = []
    seeds = None
    if image is not None:
        paths = _with_estimated_errors(first, paths, known, count, _groups_of(paths, image)) or paths
        before, seeds = _groups_of(paths, image), image == NEW_MPC
    groups = find_groups(paths, min_support, before, seeds)
    for _ in range(2):
        estimated = _with_estimated_errors(first, paths, known, count, groups)
        if estimated is None:
            break
        paths = estimated
        groups = find_groups(paths, min_support, before, seeds)
    return paths, groups


def _groups_of(paths: Paths, image: IntArray) -> list[Group]:
    """Groups of the paths with the same image (path,), each with its line."""
    order = np.lexsort((paths.azimuth_std, image))
    order = order[image[order] >= 0]
    _, owner = np.unique(image[order], return_inverse=True)
    inliers = Ragged.from_pairs(owner, order, int(owner.max(initial=-1)) + 1)
    inliers = inliers.take(np.flatnonzero(inliers.sizes > 1))
    if not len(inliers):
        return []
    best = inliers.rows[inliers.start[:-1]]  # the path with the smallest error of azimuth
    lines = fit_lines(paths.columns, inliers, seed_lines(paths.take(best)))
    return [Group(lines.line(number), np.sort(own)) for number, own in enumerate(inliers)]


def add_uncertain_paths(
    certain: Paths, groups: list[Group], paths: Paths, at: IntArray, min_support: int
) -> tuple[Paths, list[Group]]:
    """Let uncertain paths join the groups of the certain ones, and make groups of their own.

    Uncertain are paths that may have lost too much, or whose delays are hypotheses. Their errors are widened as those
    of the certain paths were; errors are not estimated from them.

    Parameters
    ----------
    certain : Paths
    groups : list of Group
        Of the certain paths.
    paths : Paths
        All paths.
    at : array (path of certain,) of int
        Where the certain paths are among all.
    min_support : int

    Returns
    -------
    paths : Paths
        All paths, with errors.
    groups : list of Group
    """
    if len(certain) == len(paths):
        return certain, groups
    errors = []
    for name in ("length_std", "azimuth_std"):
        own = getattr(paths, name)
        wider = own * (float(np.median(getattr(certain, name) / own[at])) if len(certain) else 1.0)
        wider[at] = getattr(certain, name)
        errors.append(wider)
    paths = paths.with_errors(*errors)
    known = [Group(group.line, at[group.inliers]) for group in groups]
    grown = find_groups(paths, min_support, known)
    is_certain = np.zeros(len(paths), dtype=bool)
    is_certain[at] = True
    return paths, _without_extensions(paths, grown, is_certain, min_support)


def _without_extensions(paths: Paths, groups: list[Group], certain: BoolArray, min_support: int) -> list[Group]:
    """Groups without uncertain paths beyond the certain ones: they do not lengthen a wall that certain paths found."""
    lines = Lines.from_list([group.line for group in groups])
    inliers = Ragged.from_lists([group.inliers for group in groups])
    of, is_certain = inliers.owner, certain[inliers.rows]
    frames = lines.frames(of)
    along = frames.along(np.stack(frames.reflection_points(paths.columns.take(inliers.rows)), axis=-1))
    low, high = np.full(len(groups), np.inf), np.full(len(groups), -np.inf)
    np.minimum.at(low, of[is_certain], along[is_certain])
    np.maximum.at(high, of[is_certain], along[is_certain])
    found = np.bincount(of[is_certain], minlength=len(groups)) >= min_support
    kept = inliers.masked(is_certain | ((along >= low[of]) & (along <= high[of])) | ~found[of])
    some = np.flatnonzero(found)
    lines = lines.with_replaced(some, fit_lines(paths.columns, kept.take(some), lines.take(some)))
    return [Group(lines.line(number), own) for number, own in enumerate(kept)]


def _with_estimated_errors(
    first: Paths, paths: Paths, known: BoolArray, count: int, groups: list[Group]
) -> Paths | None:
    """The paths with errors that agree with the residuals of groups; None where they agree already."""
    residual, usable = _normalised_residuals(paths, groups)
    inliers = concatenate_rows(group.inliers for group in groups)
    errors = []
    for column, (std, start, smallest) in enumerate(
        (
            (paths.length_std, first.length_std, SMALLEST_ERRORS[0] * c),
            (paths.azimuth_std, first.azimuth_std, SMALLEST_ERRORS[1]),
        )
    ):
        values = residual[usable[:, column], column]
        if len(values) < MIN_RESIDUALS:
            errors.append(np.where(known, start, std))
            continue
        factor = robust_std(values)
        rows = inliers[usable[:, column]]
        wider = widen_errors(values * std[rows], start[rows], start)
        pooled = np.sqrt((count * start**2 + len(values) * (std * factor) ** 2) / (count + len(values)))
        errors.append(np.where(known, wider, np.maximum(pooled, smallest)))
    changed = max(
        float(np.abs(np.log(a / b)).max(initial=0.0))
        for a, b in zip(errors, (paths.length_std, paths.azimuth_std), strict=True)
    )
    return paths.with_errors(*errors) if changed > ERROR_CHANGE else None


def _normalised_residuals(paths: Paths, groups: list[Group]) -> tuple[FloatArray, BoolArray]:
    """Residuals (n, 2) of length and azimuth in standard errors, and whether (n, 2) a fit left them enough freedom.

    A residual with leverage ``h`` has the variance ``(1 - h) s**2``. The two parameters of a line fit most of the
    lengths of three paths and little of their azimuths.
    """
    lines = Lines.from_list([group.line for group in groups])
    inliers = Ragged.from_lists([group.inliers for group in groups])
    columns = paths.columns.take(inliers.rows)
    found = residuals(columns, lines.frames(inliers.owner))
    a, b, d = lines.covariance[inliers.owner][:, [0, 0, 1], [0, 1, 1]].T
    normalised, freedom = [], []
    for residual, by_normal, by_offset, std in (
        (found.length, found.length_by_normal, found.length_by_offset, columns.length_std),
        (found.azimuth, found.azimuth_by_normal, found.azimuth_by_offset, columns.azimuth_std),
    ):
        leverage = (by_normal**2 * a + 2 * by_normal * by_offset * b + by_offset**2 * d) / std**2
        freedom.append(np.clip(1 - leverage, 0.0, 1.0))
        normalised.append(residual / (std * np.sqrt(np.maximum(freedom[-1], 0.1))))
    return np.stack(normalised, axis=-1), np.stack(freedom, axis=-1) > MIN_FREEDOM
