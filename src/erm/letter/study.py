"""The whole study: from simulation to the page."""

from collections.abc import Sequence
from pathlib import Path

from erm import console
from erm.letter import outlook, prediction, published, room, routes, sections, sweeps, verification
from erm.letter.captures import Campaign, Captures, Change
from erm.letter.page import Page
from erm.storage import atomic_path

PAGE = "letter.md"


def run(out: Path, captures: Captures, *, knobs: Sequence[sweeps.Knob] = sweeps.KNOBS) -> Path:
    """Redo the letter's studies and write the page.

    Parameters
    ----------
    out : Path
        Folder of the page ``letter.md``, its ``figures``, and the tables that are computed from the letter's print
        alone (``table_3.csv``, ``reflection_points.csv``).
    captures : Captures
        The instrument.
    knobs : sequence of Knob
        Settings to sweep.

    Returns
    -------
    Path
        The page.
    """
    page = Page(out, PAGE)
    simulation, measurement = captures.campaign(room.SCENE), captures.campaign(routes.SCENE)
    _tables(out)
    sections.opening(page)
    sections.set_ups(page, simulation, measurement)
    sensed = {}
    kinds = {
        "with thermal noise": (simulation, Change()),
        "without thermal noise": (simulation, Change(noise=False, snapshots=1)),
        "without noise or rays of higher order": (simulation.to_order(1), Change(noise=False, snapshots=1)),
    }
    for label, (campaign, change) in kinds.items():
        with console.progress(f"L-shaped room, {label}", len(campaign.links)) as advance:
            sensed[label] = room.sense(campaign, captures, change, progress=advance)
    verification.ray_tracing(page, room.switches(simulation), room.grids(simulation), sensed)
    verification.figures(page, simulation, sensed)
    with console.progress("routes", len(measurement.links)) as advance:
        studied = routes.study(measurement, captures, progress=advance)
    sections.daps(page, studied, captures)
    sections.reconstruction(page, studied)
    sections.errors(page, studied, routes.errors_by_route(studied))
    _outlook(page, measurement, captures, knobs)
    return page.write()


def _outlook(page: Page, campaign: Campaign, captures: Captures, knobs: Sequence[sweeps.Knob]) -> None:
    """Sweeps and prediction."""
    with console.progress("sweeps", sum(len(knob.values) for knob in knobs)) as advance:
        outlook.future_work(page, sweeps.sweep(campaign, captures, knobs, progress=advance))
    dense = sweeps.along(campaign, sweeps.DENSEST, sweeps.LINES[:1])
    with console.progress("positions to predict from", len(dense.links)) as advance:
        mpcs = captures.measure(dense, progress=advance).mpcs
    route = prediction.beside(dense)
    outlook.motivation(page, prediction.predict(mpcs, dense, route), len(route.links))


def _tables(out: Path) -> None:
    """Tables from the letter's print alone."""
    texts = {
        "table_3.csv": published.as_csv(published.table_3()),
        "reflection_points.csv": published.points_csv(),
    }
    for name, text in texts.items():
        with atomic_path(out / name) as temporary:
            temporary.write_text(text, encoding="utf-8")
