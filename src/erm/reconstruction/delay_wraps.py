"""Components whose delay may be too short by a period: longer ones are believed where other positions agree.

A sounder that repeats its sequence knows delays modulo the period only. A path far longer than the direct one then
stands in the table at a wrong delay; whether it does, only geometry can tell.
"""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from erm.geometry.vertical import FloatArray
from erm.mpcs.elevation import gain_given, of_vertical_faces
from erm.mpcs.selection import GAIN_EXCESS, fits_vertical_face, reflection_loss, with_faces
from erm.reconstruction.decision.decide import LEAST_ODDS
from erm.reconstruction.model.fit import fit_line, misfit
from erm.reconstruction.model.line import Line, seed_line
from erm.reconstruction.model.paths import BoolArray, IntArray, Paths
from erm.reconstruction.model.wall import Wall
from erm.reconstruction.search.false_alarm import odds_against_chance
from erm.reconstruction.search.greedy import Group

if TYPE_CHECKING:
    import xarray as xr

FEWEST = 3  # links; two agree on some wall whatever their delays
TELLING = 13.8  # chi-squared by which another number of periods must fit worse; odds of a thousand
MOST = 2  # periods; what is longer is weaker than any sounder hears


def later(table: "xr.Dataset", free: BoolArray) -> tuple["xr.Dataset", IntArray]:
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
    import xarray as xr

    rows = np.flatnonzero(free & np.isfinite(table["wrap_period"].values))
    one = table.isel(mpc=rows)
    periods = [one.assign(delay=one["delay"] + k * one["wrap_period"]) for k in range(1, MOST + 1)]
    longer, row = with_faces(xr.concat(periods, dim="mpc")), np.tile(rows, MOST)
    gain, std = gain_given(longer, of_vertical_faces(longer))
    loss = reflection_loss(longer) + longer["path_gain"].values - gain
    longer = longer.assign(reflection_loss=("mpc", loss), reflection_loss_std=("mpc", std))
    possible = (loss + 2 * std > -GAIN_EXCESS) & (loss <= table.attrs["max_reflection_loss"])
    kept = np.flatnonzero(possible & fits_vertical_face(longer))
    return longer.isel(mpc=kept), row[kept]


def with_later(
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
