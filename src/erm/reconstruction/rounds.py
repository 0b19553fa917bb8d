"""Search walls, adjust walls and survey, search again with the errors of the survey removed, until nothing changes."""

from typing import TYPE_CHECKING, Any

from erm.maps.environment import Environment
from erm.mpcs.selection import select, with_errors
from erm.reconstruction.model.paths import IntArray
from erm.reconstruction.reconstruct import as_map, locate_walls
from erm.survey.bundle import SurveyStd
from erm.survey.positions import from_direct_paths

if TYPE_CHECKING:
    import xarray as xr

MAX_ROUNDS = 3
"""Searches at most: the second finds what the first missed with inexact positions, the third confirms it."""


def reconstruct_survey(
    table: "xr.Dataset",
    given: SurveyStd,
    *,
    common: bool,
    min_support: int = 3,
    start: IntArray | None = None,
    **options: Any,
) -> tuple[Environment, "xr.Dataset"]:
    """Reconstruct a map and the errors of positions, headings and clocks.

    The first search allows for the errors that are given or that direct paths show.

    Parameters
    ----------
    table : xarray.Dataset
        MPC table.
    given : SurveyStd
        Standard deviations of errors of positions that are known; the others are estimated.
    common : bool
        Whether all positions may share an error of heading and clock.
    min_support, start
        See `erm.reconstruct`.
    **options
        Of `erm.select`.

    Returns
    -------
    environment : Environment
    located : xarray.Dataset
        Table of `erm.reconstruct` with the receivers where they stood, and `PositionErrors.described`.
    """
    table = with_errors(table)
    positions = from_direct_paths(table, given, common=common)
    for _ in range(MAX_ROUNDS):
        before, selected = positions, select(positions.corrected(table), **options)
        found = locate_walls(selected, before, min_support=min_support, start=start)
        positions = found.positions
        if not positions.moves(before, table):
            break
    environment, located = as_map(found, min_support=min_support)
    return environment, positions.described(located)
