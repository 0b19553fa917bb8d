"""Components whose delay may be too short by a period: longer ones are believed where other positions agree.

A sounder that repeats its sequence knows delays modulo the period only. A path far longer than the direct one then
stands in the table at a wrong delay; whether it does, only geometry can tell.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from erm.common.constants import c
from erm.geometry.vertical import FloatArray
from erm.mpcs.elevation import gain_at_elevation, vertical_face_elevation
from erm.mpcs.selection import FACE_COLUMNS, GAIN_EXCESS, fits_vertical_face, reflection_loss, with_faces
from erm.reconstruction.decision.decide import LEAST_ODDS
from erm.reconstruction.model.fit import fit_line, misfit
from erm.reconstruction.model.line import Line, seed_line
from erm.reconstruction.model.paths import BoolArray, IntArray, Paths
from erm.reconstruction.model.ragged import concatenated
from erm.reconstruction.model.wall import Wall
from erm.reconstruction.search.false_alarm import odds_against_chance
from erm.reconstruction.search.greedy import Group
from erm.reconstruction.search.search import joined

if TYPE_CHECKING:
    import xarray as xr

FEWEST = 3  # links; two agree on some wall whatever their delays
TELLING = 13.8  # chi-squared by which another number of periods must fit worse; odds of a thousand
MOST = 2  # periods; what is longer is weaker than any sounder hears
CHANGED = ("delay", "reflection_loss", "reflection_loss_std", *FACE_COLUMNS)


def with_later(
    table: "xr.Dataset", measured: Paths, free: BoolArray, paths: Paths, groups: list[Group], min_support: int
) -> tuple[Paths, list[Group], "xr.Dataset"]:
    """The paths and, after them, those that agree with others if their delays wrapped; and the rows of the latter.

    Parameters
    ----------
    table : xarray.Dataset
        Selected components, from `erm.mpcs.selection.select`.
    measured : Paths
        All of them.
    free : array (mpc,) of bool
        Those that are neither a direct path nor off the ground.
    paths, groups : Paths, list of Group
        Those that were searched, and what they agree on.
    """
    free = free.copy()
    for group in groups:
        free[paths.row[group.members]] = False
    longer, row = _later(table, free)
    count = len(paths)
    if len(row) < min_support:
        return paths, groups, longer.isel(mpc=slice(0))
    hypotheses = replace(Paths.from_table(longer), row=row, transmitter=measured.transmitter[row])
    both = Paths.concatenate([measured.take(paths.row), hypotheses])
    both, grown = joined(paths, groups, both, np.arange(count), min_support)
    period = np.r_[np.zeros(count), longer["wrap_period"].values * c]
    groups = _with_hypotheses(both, groups, grown, period, min_support)
    members = concatenated(group.members for group in groups)
    used = np.unique(members[members >= count])
    kept = np.r_[np.arange(count), used]
    groups = [Group(group.line, np.searchsorted(kept, group.members)) for group in groups]
    return both.take(kept), groups, longer.isel(mpc=used - count)


def unwrapped(
    table: "xr.Dataset", measured: Paths, longer: "xr.Dataset", walls: Sequence[Wall], count: int
) -> tuple["xr.Dataset", Paths]:
    """The table and its paths, with the delays of ``longer`` where walls took these: paths from ``count`` on."""
    periods = np.zeros(table.sizes["mpc"], dtype=np.int64)
    wrapped = [wall.members >= count for wall in walls]
    rows = concatenated(wall.paths.row[late] for wall, late in zip(walls, wrapped, strict=True))
    if not len(rows):
        return table.assign(periods=("mpc", periods)), measured
    chosen = longer.isel(
        mpc=concatenated(wall.members[late] for wall, late in zip(walls, wrapped, strict=True)) - count
    )
    periods[rows] = np.round((chosen["delay"].values - table["delay"].values[rows]) / chosen["wrap_period"].values)
    table = table.assign(periods=("mpc", periods)).assign({name: table[name].copy() for name in CHANGED})
    for name in CHANGED:
        table[name].values[rows] = chosen[name].values
    return table, Paths.from_table(table)


def _later(table: "xr.Dataset", free: BoolArray) -> tuple["xr.Dataset", IntArray]:
    """Components as they are if their delays are too short by one or more periods.

    Parameters
    ----------
    table : xarray.Dataset
        Selected components, from `erm.mpcs.selection.select`.
    free : array (mpc,) of bool
        Those that nothing explains as they are.

    Returns
    -------
    later : xarray.Dataset
        Columns of the table; a component may be there more than once, or not: a single reflection neither loses more
        than ``max_reflection_loss`` nor gains, and arrives at the elevation of a path of that length.
    row : array (mpc,) of int
        Row of the table of each.
    """
    once = np.flatnonzero(free & np.isfinite(table["wrap_period"].values))
    rows = np.tile(once, MOST)
    longer = table.isel(mpc=rows)
    longer = longer.assign(delay=longer["delay"] + np.repeat(np.arange(1, MOST + 1), len(once)) * longer["wrap_period"])
    longer = with_faces(longer)
    gain, std = gain_at_elevation(longer, vertical_face_elevation(longer))
    loss = reflection_loss(longer) + longer["path_gain"].values - gain
    longer = longer.assign(reflection_loss=("mpc", loss), reflection_loss_std=("mpc", std))
    possible = (loss + 2 * std > -GAIN_EXCESS) & (loss <= table.attrs["max_reflection_loss"])
    kept = np.flatnonzero(possible & fits_vertical_face(longer))
    return longer.isel(mpc=kept), rows[kept]


def _with_hypotheses(
    paths: Paths, groups: list[Group], grown: list[Group], period: FloatArray, min_support: int
) -> list[Group]:
    """Groups with the later paths that agree with them, and new ones that these make.

    Parameters
    ----------
    paths : Paths
        Those as they were measured, and after them the later ones.
    groups : list of Group
        Of the former; they lose none of these.
    grown : list of Group
        Of all paths, searched from ``groups``. New ones of fewer than ``min_support`` paths as they were measured must
        have clearly more paths than chance brings together, and fit clearly worse a period earlier or later: receivers
        on a line with the image agree on it whatever the number of periods.
    period : array (path,)
        Of the later ones [m], 0 for the others.
    """
    count = np.count_nonzero(period == 0)
    owner = np.full(count, -1)
    for number, group in enumerate(groups):
        owner[group.members] = number
    gained: list[IntArray] = [group.members for group in groups]
    fresh = []
    for group in grown:
        as_measured, hypotheses = group.members[group.members < count], group.members[group.members >= count]
        if not len(hypotheses):
            continue
        of = np.bincount(owner[as_measured] + 1, minlength=len(groups) + 1)[1:]
        if of.any():
            before = gained[np.argmax(of)]
            other_links = ~np.isin(paths.link[hypotheses], paths.link[before])
            gained[np.argmax(of)] = np.r_[before, hypotheses[other_links]]
        elif len(group.members) >= FEWEST and _told(paths.take(group.members), group.line, period[group.members]):
            fresh.append(group)
    asked = [bool(np.count_nonzero(group.members < count) < min_support) for group in fresh]
    odds = odds_against_chance([Wall(paths, group.line, group.members) for group in fresh], asked)
    known = [
        group if len(members) == len(group.members) else Group(fit_line(paths.take(members), group.line), members)
        for group, members in zip(groups, gained, strict=True)
    ]
    return known + [group for group, own in zip(fresh, odds, strict=True) if own >= LEAST_ODDS]


def _told(paths: Paths, line: Line, period: FloatArray) -> bool:
    """Whether paths tell by how many periods (path,) [m] those that have any are late."""
    best = paths.take(np.array([np.argmin(np.where(period > 0, paths.azimuth_std, np.inf))]))
    limit = _strain(paths, line) + TELLING
    for step in (-period, period):
        start = replace(best, length=best.length + np.sign(step.sum()) * period.max())
        if np.isfinite(start.anchors()).all():
            other = replace(paths, length=paths.length + step)
            if _strain(other, fit_line(other, seed_line(start))) < limit:
                return False
    return True


def _strain(paths: Paths, line: Line) -> float:
    """Chi-squared of paths against a line that is taken as exact; infinite if one cannot be off it."""
    return float(np.sum(misfit(paths, line._replace(covariance=np.zeros((2, 2))))))
