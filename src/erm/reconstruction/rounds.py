"""Search walls, adjust walls and survey, search again with the errors of the survey removed, until nothing changes."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from erm.common.odds import TWENTY_TO_ONE
from erm.maps.environment import Environment
from erm.mpcs.selection import select, with_errors
from erm.reconstruction.model.paths import IntArray
from erm.reconstruction.reconstruct import LocatedWalls, as_map, locate_walls
from erm.survey.bundle import SurveyStd
from erm.survey.positions import PositionErrors, from_direct_paths

if TYPE_CHECKING:
    import xarray as xr

MAX_ROUNDS = 3
"""Searches at most: the second finds what the first missed with inexact positions, the third confirms it."""


def reconstruct_survey(
    table: "xr.Dataset",
    given: SurveyStd,
    *,
    common: bool,
    clocks: Sequence[float] = (),
    clock_doubt: float = 0.0,
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
    clocks : sequence of float
        Clocks [m] at which images agree nearly as well. One whose walls explain chains 20 times better is taken.
    clock_doubt : float
        Standard deviation [m] among them.
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
    positions = from_direct_paths(table, given, common=common, clock_doubt=clock_doubt)

    def located_with(positions: PositionErrors) -> LocatedWalls:
        return locate_walls(
            select(positions.corrected(table), **options), positions, min_support=min_support, start=start
        )

    found = located_with(positions)
    if len(clocks) > 1:
        starts = [positions.at_clock(clock) for clock in clocks]
        start_of_best, best = max(((one, located_with(one)) for one in starts), key=lambda pair: pair[1].evidence)
        if best.evidence > found.evidence + TWENTY_TO_ONE:
            positions, found = start_of_best, best
    for _ in range(MAX_ROUNDS - 1):
        if not found.positions.moves(positions, table):
            break
        positions = found.positions
        again = located_with(positions)
        # at the same clock the later search, which knew it, is the better one
        if again.evidence < found.evidence and again.positions.contradicts(found.positions):
            break
        found = again
    environment, located = as_map(found, min_support=min_support)
    return environment, found.positions.described(located)
