"""The search for common images where nobody knows the errors of the paths well: what they leave tells more of these."""

import numpy as np
import numpy.typing as npt

from erm.common.constants import c
from erm.geometry.vertical import FloatArray
from erm.mpcs.standard_errors import SMALLEST_ERRORS, robust_std, widen_errors
from erm.reconstruction.model.fit import fit_lines, residuals
from erm.reconstruction.model.line import Lines, seed_lines
from erm.reconstruction.model.paths import IntArray, Paths
from erm.reconstruction.model.ragged import Ragged, concatenated
from erm.reconstruction.search.consensus import find_groups
from erm.reconstruction.search.greedy import Group

FEWEST = 6  # residuals beyond the parameters that are fitted to them, to estimate errors from
SURVEY_LENGTH = 0.01  # m; antennas are surveyed to a centimetre, and 30 ps of a clock are as much
SURVEY_AZIMUTH = 0.2  # degree; the heading of a mast
FRESH = -2  # instead of the image of a path that an earlier search had not


def search(
    paths: Paths, known: npt.NDArray[np.bool_], min_support: int, count: int = 0, image: IntArray | None = None
) -> tuple[Paths, list[Group]]:
    """Groups of paths with common images, and the paths with the errors that these groups show.

    Where a table gives no errors (``known`` false) those of the paths are first what `select` made of ``count`` direct
    paths, then what these and the residuals show. Where it does, what the residuals show beyond them is added: survey
    and clock shift all paths of a link alike, which the table cannot know. So as not to leave out the links that show
    it, the first search allows for such errors.

    Of an earlier search in a part of the paths ``image`` (path,) tells the group of each, -1 where it has none, and
    `FRESH` where it had not the path. Its groups tell the errors and gather first, and only fresh paths make new ones.
    """
    first = paths
    length_std = np.where(known, np.hypot(first.length_std, SURVEY_LENGTH), first.length_std)
    azimuth_std = np.where(known, np.hypot(first.azimuth_std, SURVEY_AZIMUTH), first.azimuth_std)
    paths = first.with_errors(length_std, azimuth_std)
    before: list[Group] = []
    seeds = None
    if image is not None:
        paths = _adapted(first, paths, known, count, _groups_of(paths, image)) or paths
        before, seeds = _groups_of(paths, image), image == FRESH
    groups = find_groups(paths, min_support, before, seeds)
    for _ in range(2):
        adapted = _adapted(first, paths, known, count, groups)
        if adapted is None:
            break
        paths = adapted
        groups = find_groups(paths, min_support, before, seeds)
    return paths, groups


def _groups_of(paths: Paths, image: IntArray) -> list[Group]:
    """Groups of the paths with the same image (path,), each with its line."""
    order = np.lexsort((paths.azimuth_std, image))
    order = order[image[order] >= 0]
    _, owner = np.unique(image[order], return_inverse=True)
    members = Ragged.of_pairs(owner, order, int(owner.max(initial=-1)) + 1)
    members = members.take(np.flatnonzero(members.sizes > 1))
    if not len(members):
        return []
    best = members.rows[members.start[:-1]]  # the path that knows its face best
    lines = fit_lines(paths.rays, members, seed_lines(paths.take(best)))
    return [Group(lines.one(number), np.sort(own)) for number, own in enumerate(members)]


def joined(
    first: Paths, groups: list[Group], paths: Paths, at: IntArray, min_support: int
) -> tuple[Paths, list[Group]]:
    """Let unsure paths join the groups of ``first``, the others, and make groups of their own.

    ``at`` (path of first,) tells where the others are among all the paths: those that may have lost too much, or are
    later than measured, are unsure. Their errors are widened as those of the others were; to the estimate of errors
    they add nothing.
    """
    if len(first) == len(paths):
        return first, groups
    wider = []
    for name in ("length_std", "azimuth_std"):
        own = getattr(paths, name)
        grown = own * (float(np.median(getattr(first, name) / own[at])) if len(first) else 1.0)
        grown[at] = getattr(first, name)
        wider.append(grown)
    paths = paths.with_errors(*wider)
    known = [Group(group.line, at[group.members]) for group in groups]
    grown = find_groups(paths, min_support, known)
    sure = np.zeros(len(paths), dtype=bool)
    sure[at] = True
    return paths, _not_longer(paths, grown, sure, min_support)


def _not_longer(paths: Paths, groups: list[Group], sure: npt.NDArray[np.bool_], min_support: int) -> list[Group]:
    """Groups without the unsure paths beyond their sure ones: those make no wall longer that these have found."""
    lines, members = Lines.of([group.line for group in groups]), Ragged.of_lists([group.members for group in groups])
    of, certain = members.owner, sure[members.rows]
    frames = lines.frames(of)
    along = frames.along(np.stack(frames.bounce(paths.rays.take(members.rows)), axis=-1))
    low, high = np.full(len(groups), np.inf), np.full(len(groups), -np.inf)
    np.minimum.at(low, of[certain], along[certain])
    np.maximum.at(high, of[certain], along[certain])
    enough = np.bincount(of[certain], minlength=len(groups)) >= min_support
    kept = members.kept(certain | ((along >= low[of]) & (along <= high[of])) | ~enough[of])
    some = np.flatnonzero(enough)
    lines = lines.put(some, fit_lines(paths.rays, kept.take(some), lines.take(some)))
    return [Group(lines.one(number), own) for number, own in enumerate(kept)]


def _adapted(first: Paths, paths: Paths, known: npt.NDArray[np.bool_], count: int, groups: list[Group]) -> Paths | None:
    """The paths with errors that agree with the residuals of groups; None where they do already."""
    white, kept = _white_residuals(paths, groups)
    members = concatenated(group.members for group in groups)
    new = []
    for column, (std, start, least) in enumerate(
        (
            (paths.length_std, first.length_std, SMALLEST_ERRORS[0] * c),
            (paths.azimuth_std, first.azimuth_std, SMALLEST_ERRORS[1]),
        )
    ):
        values = white[kept[:, column], column]
        if len(values) < FEWEST:
            new.append(np.where(known, start, std))
            continue
        factor = robust_std(values)
        rows = members[kept[:, column]]
        residual = values * std[rows]
        wider = widen_errors(residual, start[rows], start)
        pooled = np.sqrt((count * start**2 + len(values) * (std * factor) ** 2) / (count + len(values)))
        new.append(np.where(known, wider, np.maximum(pooled, least)))
    changed = max(
        float(np.abs(np.log(a / b)).max(initial=0.0))
        for a, b in zip(new, (paths.length_std, paths.azimuth_std), strict=True)
    )
    return paths.with_errors(*new) if changed > 0.1 else None


def _white_residuals(paths: Paths, groups: list[Group]) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
    """Residuals (n, 2) of length and azimuth in standard errors, and which of them a fit left room to.

    A residual ``r`` with leverage ``h`` has the variance ``(1 - h) s**2``; two parameters swallow most of the
    lengths of three paths and little of their azimuths.
    """
    lines, members = Lines.of([group.line for group in groups]), Ragged.of_lists([group.members for group in groups])
    rays = paths.rays.take(members.rows)
    found = residuals(rays, lines.frames(members.owner))
    a, b, d = lines.covariance[members.owner][:, [0, 0, 1], [0, 1, 1]].T
    white, room = [], []
    for residual, by_normal, by_offset, std in (
        (found.length, found.length_by_normal, found.length_by_offset, rays.length_std),
        (found.azimuth, found.azimuth_by_normal, found.azimuth_by_offset, rays.azimuth_std),
    ):
        leverage = (by_normal**2 * a + 2 * by_normal * by_offset * b + by_offset**2 * d) / std**2
        room.append(np.clip(1 - leverage, 0.0, 1.0))
        white.append(residual / (std * np.sqrt(np.maximum(room[-1], 0.1))))
    return np.stack(white, axis=-1), np.stack(room, axis=-1) > 0.2
