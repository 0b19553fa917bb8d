"""From selected components to a map: common images found, walls told from chains of bounces, extents measured."""

from dataclasses import replace
from itertools import compress
from typing import TYPE_CHECKING

import numpy as np

from erm.common.constants import c
from erm.geometry.vertical import distinct_rows
from erm.maps.environment import Environment
from erm.mpcs.reasons import Reason
from erm.mpcs.selection import fits_vertical_face, rise
from erm.mpcs.table import path_length
from erm.reconstruction.assemble import assemble
from erm.reconstruction.decision.adjust import adjusted
from erm.reconstruction.decision.decide import Verdict, decide
from erm.reconstruction.decision.pieces import Links
from erm.reconstruction.delay_wraps import later, with_later
from erm.reconstruction.model.extent import Legs
from erm.reconstruction.model.paths import IntArray, Paths
from erm.reconstruction.model.wall import Wall
from erm.reconstruction.poles.poles import Pole, find_poles
from erm.reconstruction.search.bent_facades import unbent
from erm.reconstruction.search.consensus import find_groups
from erm.reconstruction.search.greedy import Group
from erm.reconstruction.search.search import joined, search

if TYPE_CHECKING:
    import xarray as xr

OF_PATHS = (
    *("tx_position", "rx_position", "delay", "azimuth", "elevation", "delay_std", "azimuth_std", "elevation_std"),
    *("link", "reflection_loss", "reflection_loss_std", "frequency"),
)


def reconstruct(
    table: "xr.Dataset", *, min_support: int = 3, max_gap: float = 15.0, start: IntArray | None = None
) -> tuple[Environment, "xr.Dataset"]:
    """Merge the faces of all positions into walls.

    Parameters
    ----------
    table : xarray.Dataset
        Selected components, from `erm.mpcs.selection.select`.
    min_support : int
        Fewest antenna pairs whose paths must share a wall. Two faces always agree on some wall within their
        errors; the third is the first that can contradict, so 3 is the least that is evidence.
    max_gap : float
        Reflection points on one line further apart than this are ends of different walls [m].
    start : array (mpc,) of int, optional
        ``image`` of an earlier result for the rows that it had, `erm.reconstruction.search.search.FRESH` for those
        that are added to it (`erm.reconstruction.extend`). What agreed before is not searched again; which images are
        walls is decided anew.

    Returns
    -------
    environment : Environment
        Best supported wall first. Walls reach one Fresnel zone beyond their outermost reflection points and down
        to the ground; there is a ground if a bounce off it was seen.
    table : xarray.Dataset
        The table with ``image`` (number of the common image that the path points to, a wall's or a chain's, -1 none),
        ``wall`` (index of the reflector, -1 none), ``wall_point`` (mpc, xyz) [m], where the merged wall reflects this
        path, and ``periods``, by how many of ``wrap_period`` the ``delay`` is longer than it was given: of components
        that share a wall with other positions only so (`erm.reconstruction.delay_wraps`). Components without a wall
        are no longer accepted and say why. Attributes ``delay_std`` [s] and ``azimuth_std`` [degree] are the median
        errors that the residuals agree with.
    """
    rows = np.flatnonzero(table["accepted"].values)
    certain = rows[table["reflection_loss"].values[rows] <= table.attrs["max_reflection_loss"]]
    known = table["errors_known"].values[certain]
    before = None if start is None else start[certain]
    paths, groups = search(paths_of(table, certain), known, min_support, table.attrs.get("errors_count", 0), before)
    if len(certain) < len(rows):
        paths, groups = joined(paths, groups, paths_of(table, rows), np.searchsorted(rows, certain), min_support)
    sure, as_measured = len(paths), len(groups)
    paths, groups, longer = _with_later(table, paths, groups, min_support)
    left = np.zeros(len(paths), dtype=bool)
    left[np.searchsorted(rows, certain)] = True  # the others make no wall longer
    left[np.concatenate([np.empty(0, dtype=np.int64), *(group.members for group in groups)])] = False
    straight = unbent(paths, groups[:as_measured], left, min_support)
    groups, as_measured = straight + groups[as_measured:], len(straight)

    def decided() -> Verdict:
        candidates = [Wall(paths, group.line, group.members) for group in groups]
        return decide(candidates, _witnesses(paths, groups), lines_of_sight(table), _links(table), max_gap)

    verdict = decided()
    # what is not believed of delays that nobody measured is no evidence about the others either
    taken = np.concatenate([np.empty(0, dtype=np.int64), *(wall.members for wall in verdict.walls)])
    believed = [n < as_measured or bool(np.isin(group.members, taken).all()) for n, group in enumerate(groups)]
    if not all(believed):
        groups = list(compress(groups, believed))
        verdict = decided()
    table = _unwrapped(table, longer, verdict.walls, sure)
    verdict, chains = _adjusted(table, verdict, paths, max_gap)
    in_line = [*verdict.walls, *(wall for wall, why in verdict.rejected if why != Reason.CHANCE)]
    taken = np.concatenate([chains, *(wall.paths.row for wall in in_line)])
    poles, of_poles = _poles(table, taken, verdict.walls, min_support)
    environment, enriched = assemble(verdict, chains, poles, of_poles, table)
    image = np.full(table.sizes["mpc"], -1)
    for number, group in enumerate(groups):
        image[paths.row[group.members[group.members < sure]]] = number
    enriched = enriched.assign(image=("mpc", image))
    if len(paths):
        typical = {"delay_std": paths.length_std / c, "azimuth_std": paths.azimuth_std}
        enriched = enriched.assign_attrs({name: float(np.median(std)) for name, std in typical.items()})
    return environment, enriched


def _with_later(
    table: "xr.Dataset", paths: Paths, groups: list[Group], min_support: int
) -> tuple[Paths, list[Group], "xr.Dataset"]:
    """The paths and, after them, those that agree with others if their delays wrapped; and the rows of the latter."""
    import xarray as xr

    free = ~np.isin(table["reason"].values, (Reason.DIRECT_PATH, Reason.GROUND_REFLECTION))
    for group in groups:
        free[paths.row[group.members]] = False
    longer, row = later(table, free)
    count = len(paths)
    if len(row) < min_support:
        return paths, groups, longer.isel(mpc=slice(0))
    both = paths_of(xr.concat([table, longer], dim="mpc"), np.r_[paths.row, table.sizes["mpc"] + np.arange(len(row))])
    both = replace(both, row=np.r_[paths.row, row])
    both, grown = joined(paths, groups, both, np.arange(count), min_support)
    period = np.r_[np.zeros(count), longer["wrap_period"].values * c]
    groups = with_later(both, groups, grown, period, min_support)
    members = np.concatenate([np.empty(0, dtype=np.int64), *(group.members for group in groups)])
    used = np.unique(members[members >= count])
    kept = np.r_[np.arange(count), used]
    groups = [Group(group.line, np.searchsorted(kept, group.members)) for group in groups]
    return both.take(kept), groups, longer.isel(mpc=used - count)


def _unwrapped(table: "xr.Dataset", longer: "xr.Dataset", walls: list[Wall], count: int) -> "xr.Dataset":
    """The table with rows of ``longer`` in place of those that walls took from there: paths from ``count`` on."""
    import xarray as xr

    source = np.arange(table.sizes["mpc"])
    if not longer.sizes["mpc"]:
        return table.assign(periods=("mpc", np.zeros_like(source)))
    for wall in walls:
        wrapped = wall.members >= count
        source[wall.paths.row[wrapped]] = table.sizes["mpc"] + wall.members[wrapped] - count
    chosen = xr.concat([table, longer], dim="mpc").isel(mpc=source)
    periods = np.round((chosen["delay"].values - table["delay"].values) / table["wrap_period"].values)
    return chosen.assign(periods=("mpc", np.nan_to_num(periods).astype(np.int64)))


def _adjusted(table: "xr.Dataset", verdict: Verdict, paths: Paths, max_gap: float) -> tuple[Verdict, IntArray]:
    """Walls fitted to the chains of bounces off them, too; and the rows of these, however much they lost.

    Not where receivers are uncertain: what these are off by is in a wall's own path and in the chains alike.
    """
    if table.attrs.get("rx_std", 0.0) > 0:
        return verdict, np.empty(0, dtype=np.int64)
    nowhere = (Reason.DIRECT_PATH, Reason.GROUND_REFLECTION, Reason.TOO_SHORT)
    free = ~np.isin(table["reason"].values, nowhere) & fits_vertical_face(table)
    free[np.concatenate([np.empty(0, dtype=np.int64), *(wall.paths.row for wall in verdict.walls)])] = False
    rest = paths_of(table, np.flatnonzero(free))
    widened = (
        std * float(np.median(of / table[name].values[paths.row] / unit)) if len(paths) else std
        for std, of, name, unit in (
            (rest.length_std, paths.length_std, "delay_std", c),
            (rest.azimuth_std, paths.azimuth_std, "azimuth_std", 1.0),
        )
    )
    walls, rows = adjusted(verdict.walls, rest.with_errors(*widened), max_gap)
    return verdict._replace(walls=walls), rows


def _poles(table: "xr.Dataset", taken: IntArray, walls: list[Wall], min_support: int) -> tuple[list[Pole], Paths]:
    """Poles among the components that no wall and no chain has, and these components."""
    gain = table["path_gain"].values
    strongest = np.full(table["cluster"].values.max(initial=-1) + 1, -np.inf)
    np.maximum.at(strongest, table["cluster"].values, gain)
    possible = np.isin(table["reason"].values, (Reason.ACCEPTED, Reason.LOSS)) & (
        gain == strongest[table["cluster"].values]
    )
    possible[taken] = False
    paths = paths_of(table, np.flatnonzero(possible & fits_vertical_face(table)))
    return find_poles(paths, walls, min_support), paths


def _witnesses(paths: Paths, groups: list[Group]) -> list[Wall]:
    """Lines that two links share: too few for a wall, enough to explain a chain of bounces by."""
    left = np.ones(len(paths), dtype=bool)
    for group in groups:
        left[group.members] = False
    rest = paths.take(left)
    return [Wall(rest, group.line, group.members) for group in find_groups(rest, 2)]


def lines_of_sight(table: "xr.Dataset") -> Legs:
    """Direct paths known to be clear."""
    clear = (table["los"].values == 1) | ((table["reason"].values == Reason.DIRECT_PATH) & (table["los"].values != 0))
    _, first = np.unique(table["link"].values[clear], return_index=True)
    return Legs(table["tx_position"].values[clear][first], table["rx_position"].values[clear][first])


def _links(table: "xr.Dataset") -> Links:
    """All antenna pairs."""
    _, first = np.unique(table["link"].values, return_index=True)
    return Links(table["tx_position"].values[first], table["rx_position"].values[first])


def paths_of(table: "xr.Dataset", rows: IntArray) -> Paths:
    """Return the accepted rows as arrays, in an order that neither frame nor row numbers decide."""
    chosen = table[list(OF_PATHS)].isel(mpc=rows)
    length, loss = path_length(chosen), chosen["reflection_loss"].values
    tx = chosen["tx_position"].values
    return Paths(
        tx=tx,
        rx=chosen["rx_position"].values,
        length=length,
        azimuth=chosen["azimuth"].values,
        length_std=chosen["delay_std"].values * c,
        azimuth_std=chosen["azimuth_std"].values,
        link=chosen["link"].values,
        transmitter=distinct_rows(tx)[1],
        loss=loss,
        loss_std=chosen["reflection_loss_std"].values,
        wavelength=c / chosen["frequency"].values,
        rise=rise(chosen),
        rise_std=chosen["elevation_std"].values,
        row=rows,
    )
