"""From selected components to a map: common images found, walls told from chains of bounces, extents measured."""

from itertools import compress
from typing import TYPE_CHECKING

import numpy as np

from erm.common.constants import c
from erm.maps.environment import Environment
from erm.mpcs.reasons import Reason
from erm.mpcs.selection import fits_vertical_face
from erm.reconstruction.assemble import assemble
from erm.reconstruction.decision.adjust import adjusted
from erm.reconstruction.decision.decide import Verdict, decide
from erm.reconstruction.decision.pieces import Links
from erm.reconstruction.delay_wraps import unwrapped, with_later
from erm.reconstruction.model.extent import Legs
from erm.reconstruction.model.paths import BoolArray, IntArray, Paths
from erm.reconstruction.model.ragged import concatenated
from erm.reconstruction.model.wall import Wall
from erm.reconstruction.poles.poles import find_poles
from erm.reconstruction.search.bent_facades import unbent
from erm.reconstruction.search.consensus import find_groups
from erm.reconstruction.search.greedy import Group
from erm.reconstruction.search.search import joined, search

if TYPE_CHECKING:
    import xarray as xr


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
    measured = Paths.from_table(table)
    rows = np.flatnonzero(table["accepted"].values)
    certain = rows[measured.loss[rows] <= table.attrs["max_reflection_loss"]]
    known = table["errors_known"].values[certain]
    before = None if start is None else start[certain]
    count = table.attrs.get("errors_count", 0)
    paths, groups = search(measured.take(certain), known, min_support, count, before)
    if len(certain) < len(rows):
        paths, groups = joined(paths, groups, measured.take(rows), np.searchsorted(rows, certain), min_support)
    sure, as_measured = len(paths), len(groups)
    free = ~np.isin(table["reason"].values, (Reason.DIRECT_PATH, Reason.GROUND_REFLECTION))
    paths, groups, longer = with_later(table, measured, free, paths, groups, min_support)
    left = np.zeros(len(paths), dtype=bool)
    left[np.searchsorted(rows, certain)] = True  # the others make no wall longer
    left[concatenated(group.members for group in groups)] = False
    straight = unbent(paths, groups[:as_measured], left, min_support)
    groups, as_measured = straight + groups[as_measured:], len(straight)

    def decided() -> Verdict:
        candidates = [Wall(paths, group.line, group.members) for group in groups]
        return decide(candidates, _witnesses(paths, groups), lines_of_sight(table), _links(table), max_gap)

    verdict = decided()
    # what is not believed of delays that nobody measured is no evidence about the others either
    taken = concatenated(wall.members for wall in verdict.walls)
    believed = [n < as_measured or bool(np.isin(group.members, taken).all()) for n, group in enumerate(groups)]
    if not all(believed):
        groups = list(compress(groups, believed))
        verdict = decided()
    table, measured = unwrapped(table, measured, longer, verdict.walls, sure)
    verdict, chains = _adjusted(table, measured, verdict, paths, max_gap)
    in_line = [*verdict.walls, *(wall for wall, why in verdict.rejected if why != Reason.CHANCE)]
    taken = np.concatenate([chains, *(wall.paths.row for wall in in_line)])
    of_poles = measured.take(_off_poles(table, taken))
    poles = find_poles(of_poles, verdict.walls, min_support)
    environment, enriched = assemble(verdict, chains, poles, of_poles, table)
    image = np.full(table.sizes["mpc"], -1)
    for number, group in enumerate(groups):
        image[paths.row[group.members[group.members < sure]]] = number
    enriched = enriched.assign(image=("mpc", image))
    if len(paths):
        typical = {"delay_std": paths.length_std / c, "azimuth_std": paths.azimuth_std}
        enriched = enriched.assign_attrs({name: float(np.median(std)) for name, std in typical.items()})
    return environment, enriched


def _adjusted(
    table: "xr.Dataset", measured: Paths, verdict: Verdict, paths: Paths, max_gap: float
) -> tuple[Verdict, IntArray]:
    """Walls fitted to the chains of bounces off them, too; and the rows of these, however much they lost.

    Not where receivers are uncertain: what these are off by is in a wall's own path and in the chains alike.
    """
    if table.attrs.get("rx_std", 0.0) > 0:
        return verdict, np.empty(0, dtype=np.int64)
    nowhere = (Reason.DIRECT_PATH, Reason.GROUND_REFLECTION, Reason.TOO_SHORT)
    free = ~np.isin(table["reason"].values, nowhere) & fits_vertical_face(table)
    free[concatenated(wall.paths.row for wall in verdict.walls)] = False
    rest = measured.take(free)
    if len(paths):
        length = float(np.median(paths.length_std / measured.length_std[paths.row]))
        azimuth = float(np.median(paths.azimuth_std / measured.azimuth_std[paths.row]))
        rest = rest.with_errors(rest.length_std * length, rest.azimuth_std * azimuth)
    walls, rows = adjusted(verdict.walls, rest, max_gap)
    return verdict._replace(walls=walls), rows


def _off_poles(table: "xr.Dataset", taken: IntArray) -> BoolArray:
    """Components (mpc,) that may be off poles: of each cluster the strongest, if no wall and no chain has it."""
    gain, cluster = table["path_gain"].values, table["cluster"].values
    strongest = np.full(cluster.max(initial=-1) + 1, -np.inf)
    np.maximum.at(strongest, cluster, gain)
    possible = np.isin(table["reason"].values, (Reason.ACCEPTED, Reason.LOSS)) & (gain == strongest[cluster])
    possible[taken] = False
    return possible & fits_vertical_face(table)


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
