"""A campaign: from its recordings to products, table, map, figures and report, without what is there already."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import xarray as xr
from matplotlib.figure import Figure
from numpy.typing import NDArray

from erm.common import console
from erm.common.errors import DataError
from erm.common.optional import require_library
from erm.common.outputs import protect_inputs, require_folder
from erm.common.page import Page
from erm.common.storage import clear_leftovers, open_group, provenance
from erm.evaluation.completeness import Completeness, completeness, receivers_of
from erm.evaluation.outline import evaluate_mpcs, evaluate_walls
from erm.figures import plot_map
from erm.maps.environment import Environment
from erm.maps.formats import require_format, write_map
from erm.maps.outline import known_faces
from erm.mpcs.files import read_mpcs, write_mpcs
from erm.mpcs.reflection_points import write_reflection_points
from erm.mpcs.selection import select
from erm.reconstruction.extend import with_images
from erm.reconstruction.reconstruct import reconstruct
from sounder.campaign.description import Campaign
from sounder.campaign.page import tell
from sounder.campaign.result import Result
from sounder.figures.files import draw_product, drawn_before, figure_paths
from sounder.processing.pipeline import process

PRODUCTS, FIGURES, TABLE, POINTS, REPORT = "products", "figures", "mpcs.csv", "reflection-points.csv", "report.md"


def run_campaign(campaign: Campaign, out: Path) -> Result:
    """Make everything that comes of a campaign.

    Products and figures that are there and would be made the same are not made again; table, map and report, which take
    seconds, are. Products in the folder that are not of this campaign are not used.

    Parameters
    ----------
    campaign : Campaign
        From :func:`sounder.campaign.description.load_campaign`.
    out : Path
        Folder for all that is made.

    Raises
    ------
    DataError
        Nothing could be processed: a line for each thing that is wrong; or the folder cannot be written to.
    """
    outline = _ready(campaign, out)
    jobs, failures = campaign.jobs(out)
    protect_inputs(outputs(campaign, out), {*campaign.named, *(job.recording.source for job in jobs)})
    page = Page(out, REPORT)
    page.remove_outdated()
    for path in outputs(campaign, out):
        clear_leftovers(path)
    asked = campaign.processing
    with console.progress("processing positions", len(jobs)) as advance:
        outcome = process(
            jobs,
            out / PRODUCTS,
            options=asked.options,
            threads=asked.threads,
            workers=asked.workers,
            scheduler=asked.scheduler,
            resume=True,
            progress=advance,
        )
    failures += outcome.failures
    if not outcome.products:
        raise DataError("\n".join([*failures, f"{out}: no map; no position could be processed"]))
    table, complaints = read_mpcs(outcome.products)
    write_mpcs(table, out / TABLE)
    environment, located = chart(campaign, table, outcome.products)
    for suffix in campaign.map.formats:
        write_map(environment, out / f"map.{suffix}", mpcs=with_images(table, located))
    write_reflection_points(located, out / POINTS)
    result = Result(
        out,
        map_figure(campaign, out),
        len(jobs),
        {product: open_group(product) for product in outcome.products},
        outcome.already,
        table,
        located,
        environment,
        outline,
        notes=outcome.notes,
    )
    if outline is not None:
        result.score = judged(result, outline)
    result.failures = [*failures, *complaints, *_draw(campaign, result)]
    tell(campaign, result, page)
    page.write()
    return result


def outputs(campaign: Campaign, out: Path) -> list[Path]:
    """Files that are made beside products and the figures of positions."""
    maps = [f"map.{suffix}" for suffix in campaign.map.formats]
    return [map_figure(campaign, out), *(out / name for name in (TABLE, POINTS, REPORT, *maps))]


def map_figure(campaign: Campaign, out: Path) -> Path:
    """File of the figure of the map."""
    return out / FIGURES / f"map.{campaign.figures.format}"


def _ready(campaign: Campaign, out: Path) -> NDArray[Any] | None:
    """Refuse at once what would fail at last; return the faces to judge the map by."""
    require_folder(out)
    place = campaign.map.georeference
    if place is not None:
        require_library("pyproj", "gis", f"{campaign.source}: map.origin", "leave it out")
    for suffix in campaign.map.formats:
        require_format(out / f"map.{suffix}")
    outline = campaign.map.outline
    return None if outline is None else known_faces(outline, georeference=place)


def chart(campaign: Campaign, table: xr.Dataset, products: Sequence[Path]) -> tuple[Environment, xr.Dataset]:
    """Reconstruct the map from an MPC table; it is placed on earth where the campaign says so."""
    asked = campaign.map
    selected = select(
        table,
        threshold=asked.threshold,
        max_reflection_loss=asked.max_loss,
        ground_height=asked.ground,
        rx_std=asked.rx_std,
    )
    environment, located = reconstruct(selected, min_support=asked.min_support)
    options = {"threshold": asked.threshold, "max_reflection_loss": asked.max_loss, "ground_height": asked.ground}
    options |= {"min_support": asked.min_support, "rx_std": asked.rx_std}
    origin = provenance("Reconstructed environment", "sounder run", inputs=products, options=options)
    environment.reflectors.attrs.update(origin)
    return replace(environment, georeference=asked.georeference), located


def judged(result: Result, outline: NDArray[Any]) -> dict[str, Any]:
    """What an outline says of the map.

    Returns
    -------
    dict
        ``walls`` of :func:`erm.evaluation.outline.evaluate_walls`, ``points`` of
        :func:`erm.evaluation.outline.evaluate_mpcs` and ``visible`` of
        :func:`erm.evaluation.completeness.completeness`.
    """
    seen: list[Completeness] = []
    if result.table.sizes["mpc"]:
        seen = completeness(result.environment, outline, receivers_of(result.table))
    return {
        "walls": evaluate_walls(result.environment, outline),
        "points": evaluate_mpcs(result.located, result.environment, outline),
        "visible": seen,
    }


def _draw(campaign: Campaign, result: Result) -> list[str]:
    """Draw the map and the positions that are wanted; return what failed."""
    names = {product: str(root["position"].item()) for product, root in result.products.items()}
    wanted = [product for product, name in names.items() if campaign.figures.wanted(name)]
    failures = []
    with console.progress("drawing", len(wanted) + 1) as advance:
        _draw_map(result)
        advance()
        for product in wanted:
            try:
                result.figures[product] = _drawn(product, result.out / FIGURES, campaign.figures.format)
            except DataError as error:
                failures.append(str(error))
            advance()
    if isinstance(campaign.figures.positions, tuple):
        unknown = [name for name in campaign.figures.positions if name not in names.values()]
        asked = f"{campaign.source}: figures.positions"
        failures += [f"{asked}: {name} is no position that was processed" for name in unknown]
    return failures


def _draw_map(result: Result) -> None:
    axes = Figure(figsize=(7.0, 6.0), layout="constrained").add_subplot()
    numbers = [str(i) for i in range(result.environment.reflectors.sizes["reflector"])]
    plot_map(result.environment, table=result.located, outline=result.outline, names=numbers, ax=axes)
    console.save_figure(axes, result.map_figure)


def _drawn(product: Path, out: Path, suffix: str) -> list[Path]:
    """Figures of a product, drawn unless they were."""
    there = figure_paths(product, out, suffix=suffix)
    for path in there:
        clear_leftovers(path)
    return there if drawn_before(product, there) else draw_product(product, out, suffix=suffix)
