"""Run of a campaign: from its recordings to products, MPC table, map, figures and report."""

from collections.abc import Callable, Collection, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import xarray as xr
from numpy.typing import NDArray

from erm.common import console
from erm.common.errors import DataError, OptionError
from erm.common.kept import keeping
from erm.common.optional import require_library
from erm.common.outputs import locked, protect_inputs, require_folder
from erm.common.page import remove_outdated
from erm.common.storage import open_groups
from erm.evaluation.evaluate_map import evaluate_map
from erm.maps.environment import Environment
from erm.maps.formats import PLACED, require_format, write_map
from erm.maps.georeference import known_system
from erm.maps.outline import known_faces
from erm.mpcs.files import read_mpcs, write_mpcs
from erm.mpcs.reflection_points import write_reflection_points
from erm.reconstruction.extend import with_images
from erm.reconstruction.make_map import make_map
from erm.survey.position_files import positions_of
from erm.survey.report import warnings
from sounder.campaign.description import Campaign, load_campaign
from sounder.campaign.page import page_contents
from sounder.campaign.result import (
    FIGURES,
    PARAMETERS,
    POINT_DATA,
    POINTS,
    PRODUCTS,
    REPORT,
    STATISTICS,
    TABLE,
    CampaignResult,
    draw_map,
    map_figure,
)
from sounder.campaign.survey import remarks_on_power, remarks_on_survey
from sounder.figures.files import figure_paths, is_up_to_date
from sounder.figures.parameter_files import PARAMETER_FIGURES, draw_parameters
from sounder.figures.processes import Drawing
from sounder.parameters.statistics import Statistic, campaign_statistics
from sounder.processing.channel_parameters import channel_parameters
from sounder.processing.jobs import Job
from sounder.processing.parameter_tables import write_parameters, write_statistics
from sounder.processing.pipeline import process
from sounder.processing.point_data import write_point_data
from sounder.processing.position import Outcome
from sounder.report.page import write_page


def run_campaign(
    campaign: Campaign | Path | str,
    out: Path | str | None = None,
    *,
    only: Collection[Path] | None = None,
    processed: Callable[[Outcome], None] | None = None,
) -> CampaignResult:
    r"""Make products, MPC table, map, figures and report of a campaign.

    Products and figures that exist and would be made the same again are kept. Table, map and report, which take
    seconds, are always made again. Products in the folder that do not belong to the campaign are not used.

    Parameters
    ----------
    campaign : Campaign or path
        From :func:`sounder.load_campaign`, or its file.
    out : path, optional
        Folder for all files. Default: that of the campaign.
    only : collection of Path, optional
        Recordings that are used, of those of the campaign.
    processed : callable, optional
        Called with the outcome of each position as soon as it is known, before the map is made.

    Raises
    ------
    DataError
        No position could be processed (with a line for each problem), or the folder cannot be written to.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import sounder
    >>> from sounder import shipped
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "street.toml"
    >>> _ = path.write_text(
    ...     f"recordings.files = ['{shipped.calibration('recording-132ghz.h5')}']\n"
    ...     f"recordings.calibration = '{shipped.calibration('back-to-back-132ghz.h5')}'\n"
    ...     "figures.positions = 'none'"
    ... )
    >>> result = sounder.run_campaign(path)
    >>> sorted(file.name for file in result.out.iterdir() if file.suffix == ".csv")
    ['mpcs.csv', 'parameters.csv', 'point-data.csv', 'reflection-points.csv', 'statistics.csv']
    """
    if not isinstance(campaign, Campaign):
        campaign = load_campaign(campaign)
    out = campaign.out if out is None else Path(out)
    outline = _check_outputs(campaign, out)
    with locked(out), console.drawing(), keeping():
        return _run(campaign, out, outline, only, processed)


def _run(
    campaign: Campaign,
    out: Path,
    outline: NDArray[Any] | None,
    only: Collection[Path] | None,
    processed: Callable[[Outcome], None] | None,
) -> CampaignResult:
    jobs, failures = campaign.jobs(out, only)
    outputs = _outputs(campaign, out)
    protect_inputs(outputs, {*campaign.inputs, *(job.recording.source for job in jobs)})
    remove_outdated(out / REPORT)
    processing = campaign.processing
    figures: dict[Path, list[Path]] = {}
    with Drawing(out / FIGURES, suffix=campaign.figures.format) as drawing:

        def each(part: Outcome) -> None:
            for product in part.products:
                figures.update(_order_figures(campaign, product, out, drawing))
            if processed is not None:
                processed(part)

        with console.progress("processing positions", len(jobs)) as advance:
            outcome = process(
                jobs,
                out / PRODUCTS,
                options=processing.options,
                threads=processing.threads,
                workers=processing.workers,
                scheduler=processing.scheduler,
                resume=True,
                progress=advance,
                each=each,
            )
        failures += outcome.failures
        if not outcome.products:
            raise DataError("\n".join([*failures, f"{out}: no map; no position could be processed"]))
        roots = {product: open_groups(product, "/", "/mpc", "/quality", "/daps")[0] for product in outcome.products}
        result = _map_and_tables(campaign, out, outline, jobs, outcome, roots)
        result.figures = {product: figures[product] for product in roots if product in figures}
        result.failures = [*failures, *result.failures, *result.unknown_positions]
        _write_page(result)  # before the figures of positions, which take the most time
        if failed := _draw(result, drawing):
            result.failures += failed
            _write_page(result)
    return result


def _map_and_tables(
    campaign: Campaign,
    out: Path,
    outline: NDArray[Any] | None,
    jobs: Sequence[Job],
    outcome: Outcome,
    roots: dict[Path, xr.Dataset],
) -> CampaignResult:
    """All that is made from the products but for their own figures and the page."""
    table, problems = read_mpcs(outcome.products)
    write_mpcs(table, out / TABLE)
    parameters, statistics = _write_parameters(outcome.products, out)
    environment, located = _make_map(campaign, table, outcome.products)
    for suffix in campaign.map.formats:
        write_map(
            environment,
            out / f"map.{suffix}",
            mpcs=with_images(table, located),
            positions=positions_of(located),
            crs=campaign.map.crs if f".{suffix}" in PLACED else None,
        )
    write_reflection_points(located, out / POINTS)
    names = [str(root["position"].item()) for root in roots.values()]
    result = CampaignResult(
        campaign,
        out,
        len(jobs),
        roots,
        outcome.already,
        table,
        located,
        environment,
        parameters,
        statistics,
        list({job.b2b.source: job.b2b for job in jobs}.values()),
        outline,
        notes=[*outcome.notes, *warnings(environment), *remarks_on_power(table, located, names)],
        internal=outcome.internal,
    )
    if outline is not None:
        result.score = evaluate_map(environment, outline, (environment, located))
    result.failures = [*problems, *remarks_on_survey(outcome.products)]
    draw_map(result)
    if campaign.figures.positions != "none":
        draw_parameters(parameters, statistics, out / FIGURES, suffix=campaign.figures.format)
    return result


def _outputs(campaign: Campaign, out: Path) -> list[Path]:
    """Files that are made besides products and figures of positions."""
    maps = [f"map.{suffix}" for suffix in campaign.map.formats]
    return [
        map_figure(campaign, out),
        *(out / FIGURES / f"{name}.{campaign.figures.format}" for name in PARAMETER_FIGURES),
        *(out / name for name in (TABLE, PARAMETERS, STATISTICS, POINT_DATA, POINTS, REPORT, *maps)),
    ]


def _check_outputs(campaign: Campaign, out: Path) -> NDArray[Any] | None:
    """Refuse at the start what would fail at the end; return the known faces for the score."""
    require_folder(out)
    georeference = campaign.map.georeference
    if georeference is not None:
        require_library("pyproj", "gis", f"{campaign.source}: map.origin", "leave it out")
    if campaign.map.crs is not None:
        try:
            known_system(campaign.map.crs, metres="dxf" in campaign.map.formats)
        except OptionError as error:
            raise DataError(f"{campaign.source}: map.crs: {error}") from None
    for suffix in campaign.map.formats:
        require_format(out / f"map.{suffix}")
    outline = campaign.map.outline
    return None if outline is None else known_faces(outline, georeference=georeference)


def _write_parameters(products: Sequence[Path], out: Path) -> tuple[xr.Dataset, list[Statistic]]:
    """Channel parameters and their statistics, written as tables."""
    parameters, _ = channel_parameters(products)
    statistics = campaign_statistics(parameters)
    write_parameters(parameters, out / PARAMETERS)
    write_statistics(statistics, out / STATISTICS)
    write_point_data(parameters, out / POINT_DATA, products=products)
    return parameters, statistics


def _make_map(campaign: Campaign, table: xr.Dataset, products: Sequence[Path]) -> tuple[Environment, xr.Dataset]:
    """Reconstruct the map by the options of the campaign, and georeference it."""
    options = campaign.map
    environment, located = make_map(
        table,
        history="sounder run",
        inputs=products,
        threshold=options.threshold,
        max_reflection_loss=options.max_loss,
        min_support=options.min_support,
        ground_height=options.ground,
        rx_std=options.rx_std,
        heading_std=options.heading_std,
        clock_std=None if options.clock_std is None else options.clock_std * 1e-9,
        as_given=options.as_given,
    )
    return replace(environment, georeference=options.georeference), located


def _write_page(result: CampaignResult) -> None:
    write_page(page_contents(result), result.out / REPORT)


def _order_figures(campaign: Campaign, product: Path, out: Path, drawing: Drawing) -> dict[Path, list[Path]]:
    """Figures of a position by its product, if the campaign asks for them; those that are missing are ordered.

    Outdated figures are removed, so that the page never shows figures of another run.
    """
    (root,) = open_groups(product, "/")
    if not campaign.figures.wanted(str(root["position"].item())):
        return {}
    paths = figure_paths(product, out / FIGURES, suffix=campaign.figures.format)
    if not is_up_to_date(paths, product):
        for path in paths:
            with suppress(OSError):
                path.unlink()
        drawing.order(product)
    return {product: paths}


def _draw(result: CampaignResult, drawing: Drawing) -> list[str]:
    """Wait for the figures of products; return failures."""
    failures = []
    try:
        with console.progress("drawing", len(drawing)) as advance:
            for _, failure in drawing.results():
                failures += [failure] if failure else []
                advance()
    except DataError as error:
        failures.append(str(error))
    result.figures = {product: paths for product, paths in result.figures.items() if is_up_to_date(paths, product)}
    return failures
