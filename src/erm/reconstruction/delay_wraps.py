"""Wrapped delays: a longer delay is accepted where other positions agree with it.

A sounder that repeats its sequence measures delays modulo its period. A path that is much longer than the direct one
then has a wrong delay in the table; only geometry can show whether it has.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import compress
from typing import TYPE_CHECKING

import numpy as np

from erm.common.constants import c
from erm.common.odds import THOUSAND_TO_ONE, TWENTY_TO_ONE
from erm.geometry.vertical import FloatArray
from erm.mpcs.elevation import gain_at_elevation, vertical_face_elevation
from erm.mpcs.faces import FACE_COLUMNS, with_faces
from erm.mpcs.selection import MAX_GAIN_EXCESS, fits_vertical_wall, reflection_loss
from erm.mpcs.table import path_length
from erm.reconstruction.model.fit import fit_line, misfit
from erm.reconstruction.model.line import Line, seed_line
from erm.reconstruction.model.paths import BoolArray, IntArray, Paths
from erm.reconstruction.model.ragged import concatenate_rows
from erm.reconstruction.model.wall import Wall
from erm.reconstruction.search.false_alarm import evidence, log_odds_at_best
from erm.reconstruction.search.greedy import Group
from erm.reconstruction.search.search import add_uncertain_paths

if TYPE_CHECKING:
    import xarray as xr

CHANGED_COLUMNS = ("delay", "reflection_loss", "reflection_loss_std", *FACE_COLUMNS)
"""Columns of a table that change with the delay."""


def add_wrapped_paths(
    table: "xr.Dataset", measured: Paths, free: BoolArray, paths: Paths, groups: list[Group], min_support: int
) -> tuple[Paths, list[Group], "xr.Dataset"]:
    """Add the paths that agree with others if their delays wrapped.

    Parameters
    ----------
    table : xarray.Dataset
        From `erm.mpcs.selection.select`.
    measured : Paths
        All MPCs of the table.
    free : array (mpc,) of bool
        MPCs that are neither a direct path nor a ground reflection.
    paths, groups : Paths, list of Group
        The paths that were searched, and their groups.
    min_support : int

    Returns
    -------
    paths : Paths
        The paths that were searched, and after them the wrapped ones that agree with others.
    groups : list of Group
    wrapped : xarray.Dataset
        Rows of the latter, as they are with longer delays.
    """
    free = free.copy()
    for group in groups:
        free[paths.row[group.inliers]] = False
    wrapped, hypotheses = _hypotheses(table, measured, free)
    count = len(paths)
    if len(hypotheses) < min_support:
        return paths, groups, wrapped.isel(mpc=slice(0))
    both = Paths.concatenate([measured.take(paths.row), hypotheses])
    both, grown = add_uncertain_paths(paths, groups, both, np.arange(count), min_support)
    period = np.r_[np.zeros(count), wrapped["wrap_period"].values * c]
    groups = _accepted(both, groups, grown, period)
    inliers = concatenate_rows(group.inliers for group in groups)
    used = np.unique(inliers[inliers >= count])
    kept = np.r_[np.arange(count), used]
    groups = [Group(group.line, np.searchsorted(kept, group.inliers)) for group in groups]
    return both.take(kept), groups, wrapped.isel(mpc=used - count)


def with_wrapped_delays(
    table: "xr.Dataset", measured: Paths, wrapped: "xr.Dataset", walls: Sequence[Wall], count: int
) -> tuple["xr.Dataset", Paths]:
    """Add whole periods to the delays of the MPCs that walls explain only so.

    Parameters
    ----------
    table, measured : xarray.Dataset, Paths
        All MPCs.
    wrapped : xarray.Dataset
        From `add_wrapped_paths`.
    walls : sequence of Wall
    count : int
        Number of paths with the delays as measured; they come first.

    Returns
    -------
    table : xarray.Dataset
        With ``periods``, the number of periods added to each delay.
    measured : Paths
        All MPCs of this table.
    """
    periods = np.zeros(table.sizes["mpc"], dtype=np.int64)
    rows = concatenate_rows(wall.paths.row[wall.inliers >= count] for wall in walls)
    if not len(rows):
        return table.assign(periods=("mpc", periods)), measured
    chosen = wrapped.isel(mpc=concatenate_rows(wall.inliers[wall.inliers >= count] for wall in walls) - count)
    periods[rows] = np.round((chosen["delay"].values - table["delay"].values[rows]) / chosen["wrap_period"].values)
    table = table.assign(periods=("mpc", periods)).assign({name: table[name].copy() for name in CHANGED_COLUMNS})
    for name in CHANGED_COLUMNS:
        table[name].values[rows] = chosen[name].values
    return table, Paths.from_table(table, measured.clutter)


def _hypotheses(table: "xr.Dataset", measured: Paths, free: BoolArray) -> tuple["xr.Dataset", Paths]:
    """Free MPCs as they are if their delays are too short by one or more periods.

    Parameters
    ----------
    table, measured : xarray.Dataset, Paths
    free : array (mpc,) of bool

    Returns
    -------
    wrapped : xarray.Dataset
        Columns of the table. An MPC may be there several times, or not at all: a single reflection loses at most
        ``max_reflection_loss``, does not gain, arrives at the elevation of a path of that length, and comes from
        within the distance at which free space gives the weakest path of the table. Those are left out that are
        likelier there by chance, whatever image they may be of.
    paths : Paths
        These. Any one of the hypotheses about an MPC may agree with others by chance: clutter is as many times as
        dense about each.
    """
    rows = np.flatnonzero(free & np.isfinite(table["wrap_period"].values))
    # free space gives the weakest path of a table at this distance: nothing is received from beyond
    reach = path_length(table) * 10 ** ((reflection_loss(table) + table["path_gain"].values) / 20)
    weakest = (table["path_gain"] + 2 * table["path_gain_std"]).values.min(initial=np.inf)  # for certain
    reach = float((reach * 10 ** (-weakest / 20)).max(initial=0.0))
    limit = float(table.attrs["max_reflection_loss"])
    shortest, wrap = path_length(table)[rows], table["wrap_period"].values[rows]
    count = np.maximum(np.floor((reach - shortest) / (wrap * c)), 0).astype(np.int64)
    row = np.repeat(rows, count)
    number = 1 + np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)
    longer = table.isel(mpc=row)
    longer = longer.assign(delay=longer["delay"] + number * longer["wrap_period"])
    gain, std = gain_at_elevation(longer, vertical_face_elevation(longer))
    loss = reflection_loss(longer) + longer["path_gain"].values - gain
    # a longer path of this gain would be stronger than free space
    possible = (loss + 2 * std > -MAX_GAIN_EXCESS) & (loss <= limit) & fits_vertical_wall(longer)
    longer = longer.assign(reflection_loss=("mpc", loss), reflection_loss_std=("mpc", std))
    longer, row = longer.isel(mpc=np.flatnonzero(possible)), row[possible]
    clutter = measured.clutter[row] * np.bincount(row)[row]
    paths = replace(Paths.from_table(longer, clutter), row=row, transmitter=measured.transmitter[row])
    worth = np.flatnonzero(log_odds_at_best(paths) > 0)
    return with_faces(longer.isel(mpc=worth)), paths.take(worth)


def _accepted(paths: Paths, groups: list[Group], grown: list[Group], period: FloatArray) -> list[Group]:
    """Groups with the wrapped paths that agree with them, and new groups of wrapped paths.

    Parameters
    ----------
    paths : Paths
        Those as measured, and after them the wrapped ones.
    groups : list of Group
        Of the former. They lose none of these paths.
    grown : list of Group
        Of all paths, searched from ``groups``. A new group must be likelier than chance, and must fit clearly worse
        with one period more or less: receivers on a line with the image agree on it with any number of periods.
    period : array (path,)
        Of the wrapped paths [m], 0 for the others.
    """
    count = np.count_nonzero(period == 0)
    owner = np.full(count, -1)
    for number, group in enumerate(groups):
        owner[group.inliers] = number
    extended: list[IntArray] = [group.inliers for group in groups]
    new = []
    for group in grown:
        as_measured, hypotheses = group.inliers[group.inliers < count], group.inliers[group.inliers >= count]
        if not len(hypotheses):
            continue
        shared = np.bincount(owner[as_measured] + 1, minlength=len(groups) + 1)[1:]
        if shared.any():
            before = extended[np.argmax(shared)]
            other_links = ~np.isin(paths.link[hypotheses], paths.link[before])
            extended[np.argmax(shared)] = np.r_[before, hypotheses[other_links]]
        # two links agree on some wall whatever their delays
        elif len(group.inliers) > 2 and _is_period_certain(
            paths.take(group.inliers), group.line, period[group.inliers]
        ):
            new.append(group)
    likely = evidence([Wall(paths, group.line, group.inliers) for group in new]) > TWENTY_TO_ONE
    known = [
        group if len(inliers) == len(group.inliers) else Group(fit_line(paths.take(inliers), group.line), inliers)
        for group, inliers in zip(groups, extended, strict=True)
    ]
    return known + list(compress(new, likely))


def _is_period_certain(paths: Paths, line: Line, period: FloatArray) -> bool:
    """Whether one period (path,) [m] more or less, of the paths that have any, is a thousand times less likely."""
    best = paths.take(np.array([np.argmin(np.where(period > 0, paths.azimuth_std, np.inf))]))
    limit = _chi_squared(paths, line) + 2 * THOUSAND_TO_ONE
    for step in (-period, period):
        start = replace(best, length=best.length + np.sign(step.sum()) * period.max())
        if np.isfinite(start.virtual_anchors()).all():
            other = replace(paths, length=paths.length + step)
            if _chi_squared(other, fit_line(other, seed_line(start))) < limit:
                return False
    return True


def _chi_squared(paths: Paths, line: Line) -> float:
    """Chi-squared of paths against a line that is taken as exact; infinite if an antenna is behind it."""
    return float(np.sum(misfit(paths, line._replace(covariance=np.zeros((2, 2))))))
