"""From selected MPCs to a map: find common images, separate walls from chains of reflections, measure extents."""

from functools import partial
from itertools import compress
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from erm.common.constants import c
from erm.common.odds import TWENTY_TO_ONE
from erm.maps.environment import Environment
from erm.mpcs.ground import is_ground_companion
from erm.mpcs.reasons import Reason
from erm.mpcs.selection import fits_vertical_wall
from erm.reconstruction.assemble import assemble
from erm.reconstruction.bundle_walls import bundle_walls
from erm.reconstruction.curved.faces import (
    Curved,
    beside_walls,
    chains_off,
    find_curved_faces,
    standing,
    without_ghosts_of_poles,
)
from erm.reconstruction.decision.decide import Decision, KnownCurved, decide_walls
from erm.reconstruction.decision.pieces import Links
from erm.reconstruction.delay_wraps import add_wrapped_paths, with_wrapped_delays
from erm.reconstruction.model.extent import Legs
from erm.reconstruction.model.line import Lines, seed_lines
from erm.reconstruction.model.paths import BoolArray, IntArray, Paths
from erm.reconstruction.model.ragged import concatenate_rows
from erm.reconstruction.model.wall import Wall
from erm.reconstruction.poles.poles import find_poles
from erm.reconstruction.search.bent_facades import split_bent_facades
from erm.reconstruction.search.consensus import find_groups
from erm.reconstruction.search.false_alarm import log_odds_at_best
from erm.reconstruction.search.greedy import Group
from erm.reconstruction.search.rough_facades import merge_rough_facades
from erm.reconstruction.search.search import add_uncertain_paths, search_groups
from erm.survey.bundle import SurveyStd
from erm.survey.positions import PositionErrors

if TYPE_CHECKING:
    import xarray as xr


def reconstruct(
    table: "xr.Dataset", *, min_support: int = 3, max_gap: float = 15.0, start: IntArray | None = None
) -> tuple[Environment, "xr.Dataset"]:
    """Reconstruct the walls and poles that reflected the MPCs of all positions.

    Parameters
    ----------
    table : xarray.Dataset
        Selected MPCs, from `erm.select`.
    min_support : int
        Fewest antenna pairs that must share a wall. Two paths always agree on some wall within their errors. The third
        is the first one that can contradict, so 3 is the smallest number that is evidence.
    max_gap : float
        Reflection points on one line further apart than this are on different walls [m].
    start : array (mpc,) of int, optional
        ``image`` of an earlier result for the MPCs that it had, `erm.reconstruction.search.search.NEW_MPC` for those
        that are new (see `erm.reconstruction.extend`). Earlier MPCs are not searched again; which images are walls is
        decided again.

    Returns
    -------
    environment : Environment
        The wall with the most MPCs first. Walls reach one Fresnel zone, up to half a metre, beyond their outermost
        reflection points, and down to the ground. There is a ground if a ground reflection was received.
    table : xarray.Dataset
        The table with ``image``, the number of the common image that a path points to, of a wall or a chain, -1 for
        none; ``wall``, the index of the reflector, -1 for none; ``wall_point`` (mpc, xyz) [m], where the merged wall
        reflects the path; and ``periods``, the number of ``wrap_period`` added to the ``delay`` of MPCs that share a
        wall with other positions only so (`erm.reconstruction.delay_wraps`). MPCs without a reflector are no longer
        ``accepted`` and have another ``reason``. The attributes ``delay_std`` [s] and ``azimuth_std`` [degree] are the
        median errors that agree with the residuals.

    Examples
    --------
    Receivers beside a facade, 10 m north of the transmitter:

    >>> import erm, xarray as xr
    >>> street = erm.Environment.walls([[[-60, 10], [60, 10]]], top=40.0)
    >>> receivers = [(10, -4, 2), (14, -2, 2), (18, -5, 2), (22, -3, 2)]
    >>> table = xr.concat([erm.predict(street, (0, 0, 9), rx, 132e9) for rx in receivers], dim="mpc")
    >>> environment, located = erm.reconstruct(erm.select(table))
    >>> walls = environment.reflectors
    >>> walls["normal"].values.round(3).tolist(), walls["offset"].values.round(3).tolist()
    ([270.0], [-10.0])
    >>> int((located["wall"] == 0).sum())
    4
    """
    rx, heading, clock = (table.attrs.get(f"{name}_std", 0.0) for name in ("rx", "heading", "clock"))
    given = SurveyStd(rx, heading, clock * c)
    found = locate_walls(
        table, PositionErrors.none(table, given), min_support=min_support, max_gap=max_gap, start=start
    )
    return as_map(found, min_support=min_support, max_gap=max_gap)


class LocatedWalls(NamedTuple):
    """Walls and curved faces of a table, and what they explain."""

    table: "xr.Dataset"
    """As selected; delays with whole periods added where walls explain them only so."""
    measured: Paths
    """All MPCs of the table."""
    paths: Paths
    """Those that were searched."""
    images: list[IntArray]
    """Paths of each common image, as measured."""
    decision: Decision
    curved: Curved
    chains: IntArray
    """Rows of the table that were reflected off several walls."""
    positions: PositionErrors
    """Errors that walls, chains and direct paths show."""
    evidence: float
    """Log-likelihood ratio of chains off the walls to paths from anywhere, if they were asked for the clock; else 0."""


def locate_walls(
    table: "xr.Dataset",
    positions: PositionErrors,
    *,
    min_support: int = 3,
    max_gap: float = 15.0,
    start: IntArray | None = None,
) -> LocatedWalls:
    """Find walls, and the errors of positions.

    Parameters
    ----------
    table, min_support, max_gap, start
        See `reconstruct`.
    positions : PositionErrors
        What was removed from the table.
    """
    measured = Paths.from_table(table)
    # the others agree with anything
    rows = np.flatnonzero(table["accepted"].values & (log_odds_at_best(measured) > 0))
    certain = rows[measured.loss[rows] <= table.attrs["max_reflection_loss"]]
    paths, groups = search_groups(
        measured.take(certain),
        table["errors_known"].values[certain],
        min_support,
        table.attrs.get("errors_count", 0),
        None if start is None else start[certain],
    )
    if len(certain) < len(rows):
        at = np.searchsorted(rows, certain)
        paths, groups = add_uncertain_paths(paths, groups, measured.take(rows), at, min_support)
    curved, groups = find_curved_faces(table, measured, paths, groups, min_support)
    table = _without_curved(table, curved)
    count, number_as_measured = len(paths), len(groups)
    told = (Reason.DIRECT_PATH, Reason.GROUND_REFLECTION, Reason.CURVED_FACE, Reason.UNCERTAIN)
    free = ~np.isin(table["reason"].values, told)
    paths, groups, wrapped = add_wrapped_paths(table, measured, free, paths, groups, min_support)
    ungrouped = np.zeros(len(paths), dtype=bool)
    ungrouped[np.searchsorted(rows, certain)] = True  # the others do not extend a wall
    ungrouped[concatenate_rows(group.inliers for group in groups)] = False
    ungrouped[np.isin(paths.row, np.r_[curved.rows, curved.thin_rows])] = False
    as_measured = split_bent_facades(paths, groups[:number_as_measured], ungrouped, min_support)
    ungrouped[concatenate_rows(group.inliers for group in as_measured)] = False
    paths, as_measured = merge_rough_facades(paths, as_measured, ungrouped, min_support)
    groups = as_measured + groups[number_as_measured:]
    known = KnownCurved(standing(curved, max_gap), partial(chains_off, curved))
    decision = _decide(table, paths, groups, max_gap, min_support, known)
    # groups with longer delays that are not walls are no evidence about other candidates
    taken = concatenate_rows(wall.inliers for wall in decision.walls)
    valid = [n < len(as_measured) or bool(np.isin(group.inliers, taken).all()) for n, group in enumerate(groups)]
    if not all(valid):
        groups = list(compress(groups, valid))
        decision = _decide(table, paths, groups, max_gap, min_support, known)
    table, measured = with_wrapped_delays(table, measured, wrapped, decision.walls, count)
    curved = beside_walls(curved, decision.walls)
    decision, curved, chains, positions, evidence = bundle_walls(table, measured, decision, curved, positions, max_gap)
    images = [group.inliers[group.inliers < count] for group in groups]
    return LocatedWalls(table, measured, paths, images, decision, curved, chains, positions, evidence)


def as_map(found: LocatedWalls, *, min_support: int = 3, max_gap: float = 15.0) -> tuple[Environment, "xr.Dataset"]:
    """Find poles beside walls, and make the map; arguments and results are those of `reconstruct`."""
    table, measured, paths, images, decision, curved, chains, _, _ = found
    candidates = [wall for wall, why in decision.rejected if why != Reason.FALSE_ALARM]
    explained = np.concatenate([chains, *(wall.paths.row for wall in [*decision.walls, *candidates])])
    pole_paths = measured.take(_may_be_off_poles(table, explained))
    off_curved, _ = chains_off(curved, pole_paths, Lines.from_list([wall.line for wall in decision.walls]))
    pole_paths = pole_paths.take(np.setdiff1d(np.arange(len(pole_paths)), off_curved))
    poles = find_poles(pole_paths, decision.walls, min_support)
    curved = without_ghosts_of_poles(curved, poles, decision.walls)
    environment, located = assemble(decision, chains, poles, pole_paths, table, curved, max_gap)
    image = np.full(table.sizes["mpc"], -1)
    for number, own in enumerate(images):
        image[paths.row[own]] = number
    located = located.assign(image=("mpc", image))
    if len(paths):
        errors = {"delay_std": paths.length_std / c, "azimuth_std": paths.azimuth_std}
        located = located.assign_attrs({name: float(np.median(std)) for name, std in errors.items()})
    return environment, located


def _without_curved(table: "xr.Dataset", curved: Curved) -> "xr.Dataset":
    """Return the table with the MPCs off curved faces marked; those off thin poles lose more than walls."""
    reason, accepted = table["reason"].values.astype(object), table["accepted"].values.copy()
    for rows, why in ((curved.rows, Reason.CURVED_FACE), (curved.thin_rows, Reason.LOSS)):
        reason[rows], accepted[rows] = why, False
    return table.assign(reason=("mpc", reason.astype(np.str_)), accepted=("mpc", accepted))


def _decide(
    table: "xr.Dataset", paths: Paths, groups: list[Group], max_gap: float, min_support: int, curved: KnownCurved
) -> Decision:
    """Decide which groups are walls."""
    candidates = [Wall(paths, group.line, group.inliers) for group in groups]
    minor, links = _minor_walls(table, paths, groups), _links(table)
    return decide_walls(candidates, minor, lines_of_sight(table), links, max_gap, min_support, curved)


def _may_be_off_poles(table: "xr.Dataset", explained: IntArray) -> BoolArray:
    """MPCs (mpc,) that may be off poles: the strongest one of each cluster, unless a wall or a chain explains it."""
    gain, cluster = table["path_gain"].values, table["cluster"].values
    strongest = np.full(cluster.max(initial=-1) + 1, -np.inf)
    np.maximum.at(strongest, cluster, gain)
    possible = np.isin(table["reason"].values, (Reason.ACCEPTED, Reason.LOSS)) & (gain == strongest[cluster])
    possible[explained] = False
    return possible & fits_vertical_wall(table) & ~is_ground_companion(table)


def _minor_walls(table: "xr.Dataset", paths: Paths, groups: list[Group]) -> list[Wall]:
    """Lines that one or two links saw: too few for a wall, enough to explain a chain of reflections.

    Of a path that no other shares, the line is that of its length and azimuth, if it is hardly there by chance.
    """
    free = table["accepted"].values[paths.row]
    for group in groups:
        free[group.inliers] = False
    rest = paths.take(free)
    pairs = [Wall(rest, group.line, group.inliers) for group in find_groups(rest, 2, least_evidence=-np.inf)]
    alone = log_odds_at_best(rest) > TWENTY_TO_ONE
    alone[concatenate_rows(wall.inliers for wall in pairs)] = False
    lines = seed_lines(rest)
    return pairs + [Wall(rest, lines.line(row), np.array([row])) for row in np.flatnonzero(alone).tolist()]


def lines_of_sight(table: "xr.Dataset") -> Legs:
    """Direct paths known to be unobstructed."""
    clear = (table["los"].values == 1) | ((table["reason"].values == Reason.DIRECT_PATH) & (table["los"].values != 0))
    _, first = np.unique(table["link"].values[clear], return_index=True)
    return Legs(table["tx_position"].values[clear][first], table["rx_position"].values[clear][first])


def _links(table: "xr.Dataset") -> Links:
    """All antenna pairs."""
    _, first = np.unique(table["link"].values, return_index=True)
    return Links(table["tx_position"].values[first], table["rx_position"].values[first])
