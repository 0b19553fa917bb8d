"""Facades with relief: piers, recessed and slightly tilted panes are one facade (`erm.reconstruction.model.relief`).

The parts of a facade alternate along it; the faces of a bent or stepped one follow one another (`bent_facades`).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import betaln

from erm.common.odds import TWENTY_TO_ONE
from erm.geometry.vertical import FloatArray
from erm.reconstruction.model.extent import SOLID_GAP
from erm.reconstruction.model.fit import fit_line
from erm.reconstruction.model.line import PLANE_SPAN, Line
from erm.reconstruction.model.loss import is_diffuse
from erm.reconstruction.model.paths import BoolArray, IntArray, Paths
from erm.reconstruction.model.ragged import first_of_each
from erm.reconstruction.model.relief import ROUNDS, relief_of
from erm.reconstruction.model.wall import cos_incidence
from erm.reconstruction.search.bent_facades import FREE, TAKEN, beside, clutter_cost
from erm.reconstruction.search.false_alarm import DISTURBED_SHARE
from erm.reconstruction.search.greedy import Group
from erm.reconstruction.search.images import Images


def merge_rough_facades(
    paths: Paths, groups: Sequence[Group], free: BoolArray, min_support: int
) -> tuple[Paths, list[Group]]:
    """Merge the groups, and the free paths, that are parts of one facade with relief.

    Other groups may be walls of their own, anywhere within `PLANE_SPAN`. Free paths may be clutter, with their density,
    or paths of the plane of the largest group that others disturb, `DISTURBED_SHARE` of all; parts are any share.
    The planes may be steps that follow one another, so that few neighbours along the facade are off different ones.

    Parameters
    ----------
    paths : Paths
    groups : sequence of Group
    free : array (path,) of bool
        Paths of no group.
    min_support : int
        Fewest paths of a facade.

    Returns
    -------
    paths : Paths
        With the scatter of their facades.
    groups : list of Group
    """
    if not groups:
        return paths, []
    images = Images(paths)
    owner = np.where(free, FREE, TAKEN)
    for number, group in enumerate(groups):
        owner[group.inliers] = number
    cost = clutter_cost(paths, free)
    scatter = paths.scatter.copy()
    merged: dict[int, Group] = {}
    gone: set[int] = set()
    for first in sorted(range(len(groups)), key=lambda number: -len(groups[number].inliers)):
        if first in gone or len(groups[first].inliers) < min_support:
            continue
        parts, others = _parts(images, groups, first, owner)
        rows = np.concatenate([groups[first].inliers, parts])
        line, widths, odds = _fit(paths, groups, first, rows, owner, cost) if len(parts) else (None, None, -np.inf)
        owner[groups[first].inliers] = TAKEN  # a part of no smaller one
        if line is None or odds < TWENTY_TO_ONE:
            continue
        order = np.argsort(rows)
        merged[first] = Group(line, rows[order])
        scatter[rows] = widths
        owner[rows] = TAKEN
        gone |= others
    kept = [merged.get(number, group) for number, group in enumerate(groups) if number not in gone]
    wider = replace(paths, scatter=scatter)
    return wider.with_errors(*np.hypot([paths.length_std, paths.azimuth_std], scatter.T)), kept


def _parts(images: Images, groups: Sequence[Group], first: int, owner: IntArray) -> tuple[IntArray, set[int]]:
    """Paths (n,) that may be off other parts of a group's facade, one of a link, and the groups of such paths."""
    paths, (line, inliers) = images.paths, groups[first]
    frame = line.frame()
    near = beside(images, groups[first])
    near = near[owner[near] != TAKEN]
    place = np.full(len(paths), np.nan)
    for rows in (inliers, near):
        place[rows] = frame.along(np.stack(frame.reflection_points(paths.columns.take(rows)), axis=-1))
    low, high = place[inliers].min(), place[inliers].max()
    links, parts, others = paths.link[inliers], [np.empty(0, dtype=np.int64)], set()
    number, count = np.unique(owner[near][owner[near] >= 0], return_counts=True)
    for other in number[np.argsort(-count, kind="stable")].tolist():
        theirs = groups[other].inliers
        alternate = np.isin(theirs, near) & (place[theirs] > low) & (place[theirs] < high)
        beyond = np.isin(theirs, near) & ~np.isin(paths.link[theirs], links)
        if 2 * min(np.count_nonzero(alternate), np.count_nonzero(beyond)) >= len(theirs):
            parts.append(theirs[beyond])
            links = np.r_[links, paths.link[theirs[beyond]]]
            others.add(other)
            low, high = min(low, place[theirs[beyond]].min()), max(high, place[theirs[beyond]].max())
    rows = near[(owner[near] == FREE) & ~np.isin(paths.link[near], links)]
    rows = rows[(place[rows] > low - SOLID_GAP) & (place[rows] < high + SOLID_GAP)]
    both = paths.take(np.r_[inliers, rows])
    rows = rows[~is_diffuse(both, cos_incidence(both, frame), np.array([0, len(both)]))[len(inliers) :]]
    rows = rows[np.lexsort((rows, paths.loss[rows], paths.link[rows]))]
    return np.concatenate([*parts, rows[first_of_each(paths.link[rows])]]), others


def _fit(
    paths: Paths, groups: Sequence[Group], first: int, rows: IntArray, owner: IntArray, cost: FloatArray
) -> tuple[Line, FloatArray, float]:
    """Mean plane of paths, the scatter (path, 2) about it, and the log odds that it is one facade with relief."""
    own, line = paths.take(rows), groups[first].line
    relief = relief_of(own, line)
    for _ in range(ROUNDS):
        widths = relief.widths(*relief.scatter())
        wider = own.with_errors(*np.hypot([own.length_std, own.azimuth_std], widths.T))
        line = fit_line(wider, line)
        relief = relief_of(own, line)
    scatter = relief.scatter()
    # clutter of the same length and azimuth: its cost is -2 ln(2 pi s_L s_a r)
    clutter = -cost[rows] / 2 - np.log(2 * np.pi * own.length_std * own.azimuth_std)
    clutter += np.log(np.abs(relief.length_by_offset * relief.azimuth_by_turn))
    free = owner[rows] == FREE
    of_free = float((relief.log_density(*scatter) - clutter)[free].sum())
    of_groups = [relief.take(owner[rows] == other).mean() for other in set(owner[rows].tolist()) - {FREE, first}]
    planes = sum(float(one.log_density(*scatter)[0] + np.log(PLANE_SPAN * 360)) for one in of_groups)
    count, others = len(rows), int(np.count_nonzero(free))
    disturbed = others * np.log(DISTURBED_SHARE) + (count - others) * np.log(1 - DISTURBED_SHARE)
    odds = planes + _log_share(others, count) + min(of_free, -disturbed)
    frame = line.frame()
    along = frame.along(np.stack(frame.reflection_points(own.columns), axis=-1))
    apart = owner[rows] != first
    changes = int(np.count_nonzero(np.diff(apart[np.argsort(along, kind="stable")])))
    if np.ptp(along) > SOLID_GAP * (changes + 1):  # else no part is long enough for a face
        odds += min(_log_share(int(np.count_nonzero(apart)), count) - _log_share(changes, count - 1), 0.0)
    return line, relief.widths(*scatter), odds


def _log_share(some: int, count: int) -> float:
    """Log probability that just these of so many are others, every share of others equally likely."""
    return float(betaln(some + 1, count - some + 1))
