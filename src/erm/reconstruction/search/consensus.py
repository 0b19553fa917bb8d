"""Common images: paths off one vertical wall share the transmitter's mirror image, whatever the receiver.

Taken for single bounces, the paths of a transmitter point to images; where those of several receivers agree, there is a
wall, or a chain of walls that looks like one. Everything is looked up in a tree of these images, so the work grows
in proportion to the number of paths.
"""

from collections.abc import Sequence

import numpy as np

from erm.reconstruction.model.fit import fit_lines
from erm.reconstruction.model.line import Lines
from erm.reconstruction.model.loss import scattered
from erm.reconstruction.model.paths import BoolArray, IntArray, Paths
from erm.reconstruction.model.ragged import Ragged, first_of_each
from erm.reconstruction.search.density import COMPANY, fewest_partners
from erm.reconstruction.search.greedy import Group, Trial, Turns
from erm.reconstruction.search.images import Images, side_by_side
from erm.reconstruction.search.refine_groups import gather, settle
from erm.reconstruction.search.starts import best_starts


def find_groups(
    paths: Paths, min_support: int, known: Sequence[Group] = (), seeds: BoolArray | None = None
) -> list[Group]:
    """Explain the paths by lines that at least ``min_support`` links agree on.

    Seeds are taken in the order of how many partners agree with them, then of their loss. Each seed and its partners
    make two-path lines; the one most paths agree with gathers these and is fitted to them until they no longer
    change, and they are taken out. In the end every path goes to the line it fits best.

    Parameters
    ----------
    known : sequence of Group
        Lines of an earlier search in a part of the paths; they gather first.
    seeds : array (path,) of bool, optional
        Paths that new lines may start from; by default all.
    """
    if len(paths) == 0:
        return []
    near = side_by_side(paths)
    place = np.empty_like(near)
    place[near] = np.arange(len(near))
    known = [Group(group.line, np.sort(place[group.members])) for group in known]
    groups = _found(paths.take(near), min_support, known, None if seeds is None else seeds[near])
    return [Group(group.line, np.sort(near[group.members])) for group in groups]


def _found(paths: Paths, min_support: int, known: Sequence[Group], seeds: BoolArray | None) -> list[Group]:
    """`find_groups` of one path at least, of which those are near each other in memory whose images are."""
    images = Images(paths)
    turns = Turns[Group](paths.row, max(min_support, 2))
    if known:
        lines, members = Lines.of([group.line for group in known]), Ragged.of_lists([group.members for group in known])
        turns.take(
            np.arange(len(known)), lambda some, free: _grown(images, lines.take(some), free, before=members.take(some))
        )
    partners = images.partners(seeds)
    agreeing = partners.distinct(paths.link)
    several = len(images.transmitters) > 1  # a wall may have one path from each of several transmitters
    enough = agreeing >= (1 if several else min_support - 1)
    order = np.lexsort((paths.row, paths.length, np.round(paths.loss, 6), -agreeing))
    if seeds is not None:
        enough &= seeds
        agreeing[~(turns.free | seeds)] = COMPANY  # their partners were not looked for, but a group has them
    fewest = fewest_partners(images, agreeing)
    enough &= agreeing >= fewest
    left = images

    def tried(seeds: IntArray, free: BoolArray) -> list[Trial[Group] | None]:
        nonlocal left
        left = left.without(free)
        return _from_seeds(left, seeds, partners, fewest, free)

    turns.take(order[enough[order]], tried, partners)
    return _reassigned(images, turns.found, min_support)


def _from_seeds(
    images: Images, seeds: IntArray, partners: Ragged, fewest: IntArray, free: BoolArray
) -> list[Trial[Group] | None]:
    """Groups that grow from seeds and their free partners, where these are not too few."""
    nothing = np.empty(0, dtype=np.int64)
    trials: list[Trial[Group] | None] = [Trial(None, nothing)] * len(seeds)
    own = partners.take(seeds)
    own = own.kept(free[own.rows])
    some = np.flatnonzero(own.sizes >= fewest[seeds])
    if len(some):
        lines, seen = best_starts(images, seeds[some], own.take(some), free)
        for number, trial, before in zip(some.tolist(), _grown(images, lines, free, seeds[some]), seen, strict=True):
            counted = own[number] if fewest[seeds[number]] > 1 else nothing
            trials[number] = trial and Trial(trial.found, np.concatenate([before, trial.seen, counted]))
    return trials


def _grown(
    images: Images, lines: Lines, free: BoolArray, seeds: IntArray | None = None, before: Ragged | None = None
) -> list[Trial[Group] | None]:
    """Groups that lines gather; None of those whose seeds an earlier one is likely to take."""
    lines, members, seen, later = settle(images, lines, free, seeds, before)
    return [
        None if later[number] else Trial(Group(lines.one(number), own), before)
        for number, (own, before) in enumerate(zip(members, seen, strict=True))
    ]


def _reassigned(images: Images, groups: list[Group], min_support: int) -> list[Group]:
    """Groups after each path went to the line it fits best; those that lost too many are gone."""
    paths = images.paths
    if not groups:
        return []
    lines = Lines.of([group.line for group in groups])
    claims, cost = gather(images, lines, np.ones(len(paths), dtype=bool))
    owner = claims.owner
    # a path between two lines stays with the better supported one unless the other is clearly better
    cost = cost - np.log(np.maximum(claims.sizes, 1))[owner]
    row = paths.row[claims.rows]
    rank = np.lexsort((owner, cost, row))
    best = np.zeros(len(row), dtype=bool)
    best[rank[first_of_each(row[rank])]] = True
    members = claims.kept(best)
    enough = np.flatnonzero(members.sizes >= min_support)
    members = members.take(enough)
    lines = fit_lines(paths.rays, members, lines.take(enough))
    one = paths.take(members.rows)
    frames = lines.frames(members.owner)
    cosine = np.clip((frames.depth(one.tx) + frames.depth(one.rx)) / one.length, 0, 1)
    mirrored = ~scattered(one, cosine, members.start)
    before = members.sizes
    left = members.kept(mirrored)
    enough = np.flatnonzero(left.sizes >= min_support)
    lines, members, fewer = lines.take(enough), left.take(enough), np.flatnonzero((left.sizes < before)[enough])
    lines = lines.put(fewer, fit_lines(paths.rays, members.take(fewer), lines.take(fewer)))
    return [Group(lines.one(number), own) for number, own in enumerate(members)]
