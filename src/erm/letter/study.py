"""The whole study: from simulation to the page."""

from pathlib import Path

from erm import console
from erm.letter import published, room, routes, sections
from erm.letter.captures import Captures, Change
from erm.letter.page import Page
from erm.storage import atomic_path

PAGE = "letter.md"


def run(out: Path, captures: Captures) -> Path:
    """Redo the letter's studies and write the page.

    Parameters
    ----------
    out : Path
        Folder of the page ``letter.md``, its ``figures``, and the tables that are computed from the letter's print
        alone (``table_3.csv``, ``reflection_points.csv``).
    captures : Captures
        The instrument.

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
    sections.ray_tracing(page, room.switches(simulation), sensed)
    sections.room_figures(page, simulation, sensed)
    with console.progress("routes", len(measurement.links)) as advance:
        studied = routes.study(measurement, captures, progress=advance)
    sections.daps(page, studied, captures)
    sections.reconstruction(page, studied)
    sections.errors(page, studied, routes.errors_by_route(studied))
    return page.write()


def _tables(out: Path) -> None:
    """Tables from the letter's print alone."""
    texts = {
        "table_3.csv": published.as_csv(published.table_3()),
        "reflection_points.csv": published.points_csv(),
    }
    for name, text in texts.items():
        with atomic_path(out / name) as temporary:
            temporary.write_text(text, encoding="utf-8")
