"""The whole study: from simulation to the page."""

from collections.abc import Sequence
from pathlib import Path

from erm.common import console
from erm.common.page import Page
from erm.letter import (
    corridor,
    errors,
    outlook,
    parity,
    prediction,
    published,
    reconstruction,
    room,
    routes,
    sections,
    spatial,
    sweeps,
    verification,
)
from erm.letter.captures import Cached, Campaign, Captures, Change

PAGE = "letter.md"


def run(
    out: Path, captures: Captures, *, parameters: Sequence[sweeps.SweptParameter] = sweeps.SWEPT_PARAMETERS
) -> Path:
    """Repeat the letter's studies and write the page.

    Parameters
    ----------
    out : Path
        Folder of the page ``letter.md``, its ``figures``, the table of all numbers ``parity.csv``, and the tables
        that follow from the printed points alone (``table_3.csv``, ``reflection_points.csv``).
    captures : Captures
        The instrument.
    parameters : sequence of SweptParameter
        Settings to sweep.

    Returns
    -------
    Path
        The page.
    """
    page = Page(out, PAGE)
    simulation, measurement = captures.campaign(room.SCENE), captures.campaign(routes.SCENE)
    sensed = {}
    kinds = {
        "with thermal noise": (simulation, Change()),
        "without thermal noise": (simulation, Change(noise=False, snapshots=1)),
        "without noise or rays of higher order": (simulation.to_order(1), Change(noise=False, snapshots=1)),
    }
    for label, (campaign, change) in kinds.items():
        with console.progress(f"L-shaped room, {label}", len(campaign.links)) as advance:
            sensed[label] = room.sense(campaign, captures, change, progress=advance)
    with console.progress("routes", len(measurement.links) + len(published.TABLE_2[corridor.ROUTE])) as advance:
        studied = routes.study(measurement, captures, progress=advance)
        inside = corridor.from_inside(measurement, captures, progress=advance)
    by_route = routes.errors_by_route(studied)
    table = parity.rows(next(iter(sensed.values())), by_route, inside)
    _tables(page, table)
    sections.opening(page)
    parity.parity(page, table)
    sections.set_ups(page, simulation, measurement)
    limits = room.switches(simulation), room.grids(simulation), room.placements(simulation)
    verification.ray_tracing(page, *limits, sensed)
    verification.figures(page, simulation, sensed)
    spatial.daps(page, studied, captures)
    reconstruction.reconstruction(page, studied, inside)
    errors.errors(page, studied, by_route)
    _outlook(page, measurement, Cached(captures), parameters)
    return page.write()


def _outlook(page: Page, campaign: Campaign, captures: Captures, parameters: Sequence[sweeps.SweptParameter]) -> None:
    """Write the sections on sweeps and prediction."""
    with console.progress(
        "sweeps", len(sweeps.OFFSETS) * sum(len(parameter.values) for parameter in parameters)
    ) as advance:
        outlook.future_work(
            page, sweeps.sweep(campaign, captures, parameters, offsets=sweeps.OFFSETS, progress=advance)
        )
    dense = sweeps.along(campaign, sweeps.DENSEST, sweeps.LINES[:1])
    mpcs = captures.measure(dense).mpcs
    route = prediction.shifted_route(dense)
    outlook.motivation(page, prediction.predict(mpcs, dense, route, prediction.COUNTS), len(route.links))


def _tables(page: Page, table: Sequence[parity.Row]) -> None:
    """Write the tables for other programs."""
    texts = {
        "parity.csv": parity.as_csv(table),
        "table_3.csv": published.as_csv(published.table_3()),
        "reflection_points.csv": published.points_csv(),
    }
    for name, text in texts.items():
        page.file(name, text)
