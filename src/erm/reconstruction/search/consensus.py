"""Consensus search: paths off one vertical wall share the virtual anchor of the transmitter, whatever the receiver.

Taken for single reflections, the paths of a transmitter point to virtual anchors (images). Where those of several
receivers agree there is a wall, or a chain of walls that looks like one. All images are searched through a tree, so
that the work grows in proportion to the number of paths.
"""

from collections.abc import Sequence
from itertools import compress

import numpy as np

from erm.common.odds import TWENTY_TO_ONE
from erm.geometry.vertical import FloatArray
from erm.reconstruction.model.fit import fit_lines
from erm.reconstruction.model.line import PLANE_SPAN, Lines, seed_lines
from erm.reconstruction.model.loss import is_diffuse
from erm.reconstruction.model.paths import BoolArray, IntArray, Paths
from erm.reconstruction.model.ragged import Ragged, first_of_each
from erm.reconstruction.model.wall import Wall, cos_incidence
from erm.reconstruction.search.density import MAX_REQUIRED_PARTNERS, required_partners
from erm.reconstruction.search.false_alarm import evidence, log_odds_at_best
from erm.reconstruction.search.greedy import GreedySelection, Group, Trial
from erm.reconstruction.search.images import Images, spatial_order
from erm.reconstruction.search.refine_groups import best_of_each_link, collect_inliers, refine_groups
from erm.reconstruction.search.starts import best_starts


def find_groups(
    paths: Paths,
    min_support: int,
    known: Sequence[Group] = (),
    seeds: BoolArray | None = None,
    least_evidence: float = TWENTY_TO_ONE,
) -> list[Group]:
    """Explain the paths by lines that at least ``min_support`` links agree on.

    Seeds are taken in the order of how many partners agree with them, then of their loss. A seed makes
    a line with each of its partners. The line that most paths agree with collects these and is
    fitted to them until they no longer change; they are then taken, unless they are a false alarm. In the end every
    path goes to the line that it fits best.

    Parameters
    ----------
    paths : Paths
    min_support : int
    known : sequence of Group
        Lines of an earlier search in some of the paths. They collect their paths first.
    seeds : array (path,) of bool, optional
        Paths that new lines may start from; by default all.
    least_evidence : float
        Log odds of a group to be no false alarm (`erm.reconstruction.search.false_alarm.evidence`).
    """
    if len(paths) == 0:
        return []
    order = spatial_order(paths)
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    known = [Group(group.line, np.sort(place[group.inliers])) for group in known]
    seeds = None if seeds is None else seeds[order]
    groups = _find_groups(paths.take(order), min_support, known, seeds, least_evidence)
    return [Group(group.line, np.sort(order[group.inliers])) for group in groups]


def _find_groups(
    paths: Paths, min_support: int, known: Sequence[Group], seeds: BoolArray | None, least_evidence: float
) -> list[Group]:
    """`find_groups` of at least one path, in the order of `spatial_order`."""
    images = Images(paths)
    selection = GreedySelection[Group](paths.row, max(min_support, 2))
    if known:
        lines = Lines.from_list([group.line for group in known])
        inliers = Ragged.from_lists([group.inliers for group in known])
        selection.run(
            np.arange(len(known)),
            lambda some, free: _grow(images, lines.take(some), free, before=inliers.take(some)),
        )
    partners = images.partners(seeds)
    agreeing = partners.count_distinct(paths.link)
    several = len(images.transmitters) > 1  # a wall may have one path from each of several transmitters
    enough = agreeing >= (1 if several else min_support - 1)
    together = _worth_of_partners(images, partners)
    order = np.lexsort((paths.row, paths.length, np.round(paths.loss, 6), -agreeing))
    if seeds is not None:
        enough &= seeds
        # partners were not searched for known groups, whose paths are not clutter
        agreeing[~(selection.free | seeds)] = MAX_REQUIRED_PARTNERS
    required = required_partners(images, agreeing)
    enough &= (agreeing >= required) & (_most_evidence(paths, together) > least_evidence)
    rest = images

    def try_seeds(seeds: IntArray, free: BoolArray) -> list[Trial[Group] | None]:
        nonlocal rest
        rest = rest.restricted_to_free(free)
        return _without_false_alarms(
            paths, _grow_from_seeds(rest, seeds, partners, required, free), min_support, least_evidence
        )

    selection.run(order[enough[order]], try_seeds, partners)
    return _reassign(images, selection.found, min_support)


def _worth_of_partners(images: Images, partners: Ragged) -> FloatArray:
    """What the partners of each path (path,) are worth together, the best one of each link."""
    worth, link = images.worth[partners.rows], images.paths.link[partners.rows]
    best = best_of_each_link(partners.owner, link, partners.rows, -worth)
    return np.bincount(partners.owner[best], worth[best], len(images.paths)).astype(np.float64)


def _most_evidence(paths: Paths, together: FloatArray) -> FloatArray:
    """Most evidence (path,) that a path and its partners, worth so much together, can have.

    At best the line is as uncertain as that of the path alone: see `erm.reconstruction.search.false_alarm.evidence`.
    """
    odds = log_odds_at_best(paths)
    volume = np.linalg.slogdet(seed_lines(paths).covariance)[1] / 2 + np.log(2 * np.pi / (360 * PLANE_SPAN))
    return np.asarray(odds + volume + together)


def _without_false_alarms(
    paths: Paths, trials: Sequence[Trial[Group] | None], min_support: int, least_evidence: float
) -> list[Trial[Group] | None]:
    """Trials that found nothing where they found a false alarm."""
    if least_evidence == -np.inf:
        return list(trials)
    groups = [trial.found if trial else None for trial in trials]
    large = [n for n, group in enumerate(groups) if group is not None and len(group.inliers) >= min_support]
    walls = [Wall(paths, group.line, group.inliers) for group in (groups[n] for n in large) if group is not None]
    false_alarms = set(compress(large, evidence(walls) < least_evidence))
    return [trial and trial._replace(found=None) if n in false_alarms else trial for n, trial in enumerate(trials)]


def _grow_from_seeds(
    images: Images, seeds: IntArray, partners: Ragged, required: IntArray, free: BoolArray
) -> list[Trial[Group] | None]:
    """Groups that grow from seeds and their free partners, where these are not too few."""
    nothing = np.empty(0, dtype=np.int64)
    trials: list[Trial[Group] | None] = [Trial(None, nothing)] * len(seeds)
    own = partners.take(seeds)
    own = own.masked(free[own.rows])
    enough = np.flatnonzero(own.sizes >= required[seeds])
    if len(enough):
        lines, started_from = best_starts(images, seeds[enough], own.take(enough), free)
        grown = _grow(images, lines, free, seeds[enough])
        for number, trial, before in zip(enough.tolist(), grown, started_from, strict=True):
            counted = own[number] if required[seeds[number]] > 1 else nothing
            trials[number] = trial and Trial(trial.found, np.concatenate([before, trial.depends_on, counted]))
    return trials


def _grow(
    images: Images, lines: Lines, free: BoolArray, seeds: IntArray | None = None, before: Ragged | None = None
) -> list[Trial[Group] | None]:
    """Groups that lines collect; None where an earlier line is likely to take the seed."""
    lines, inliers, depends_on, deferred = refine_groups(images, lines, free, seeds, before)
    return [
        None if deferred[number] else Trial(Group(lines.line(number), own), needed)
        for number, (own, needed) in enumerate(zip(inliers, depends_on, strict=True))
    ]


def _reassign(images: Images, groups: list[Group], min_support: int) -> list[Group]:
    """Groups after each path went to the line that it fits best, without those that lost too many paths."""
    paths = images.paths
    if not groups:
        return []
    lines = Lines.from_list([group.line for group in groups])
    candidates, cost = collect_inliers(images, lines, np.ones(len(paths), dtype=bool))
    owner = candidates.owner
    # a path between two lines stays with the better supported one unless the other is clearly better
    cost = cost - np.log(np.maximum(candidates.sizes, 1))[owner]
    row = paths.row[candidates.rows]
    rank = np.lexsort((owner, cost, row))
    best = np.zeros(len(row), dtype=bool)
    best[rank[first_of_each(row[rank])]] = True
    inliers = candidates.masked(best)
    enough = np.flatnonzero(inliers.sizes >= min_support)
    inliers = inliers.take(enough)
    lines = fit_lines(paths.columns, inliers, lines.take(enough))
    own = paths.take(inliers.rows)
    specular = ~is_diffuse(own, cos_incidence(own, lines.frames(inliers.owner)), inliers.start)
    rest = inliers.masked(specular)
    enough = np.flatnonzero(rest.sizes >= min_support)
    fewer = np.flatnonzero((rest.sizes < inliers.sizes)[enough])
    lines, inliers = lines.take(enough), rest.take(enough)
    lines = lines.with_replaced(fewer, fit_lines(paths.columns, inliers.take(fewer), lines.take(fewer)))
    return [Group(lines.line(number), rows) for number, rows in enumerate(inliers)]
