"""``sounder parameters``: channel parameters of products and MPC tables."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from erm.common import console
from erm.common.messages import note, write_json
from erm.common.outputs import protect_inputs, require_folder, require_suffix
from sounder.options import Clustering, FigureFormat, Source


def parameters(
    products: Annotated[
        list[Path], typer.Argument(readable=False, help="Products of `sounder process`, or MPC tables (.csv).")
    ],
    out: Annotated[Path | None, typer.Option(help="Table with a row for each position: .csv, .tex or .h5.")] = None,
    statistics: Annotated[
        Path | None, typer.Option(help="Medians, 10 and 90 %, moments, fits of path loss: .csv or .tex.")
    ] = None,
    point_data: Annotated[Path | None, typer.Option(help="Point data by which groups merge theirs: .csv.")] = None,
    mpcs: Annotated[Path | None, typer.Option(help="Table with a row for each MPC of all positions: .csv.")] = None,
    figures: Annotated[
        Path | None, typer.Option(help="Folder for figures: distributions of parameters, path loss over distance.")
    ] = None,
    file_format: Annotated[FigureFormat, typer.Option("--format", help="File format of figures.")] = "png",
    threshold: Annotated[
        str | None,
        typer.Option(help="Which paths count: cfar, usc, nyu or numbers, as in `sounder process`. Default: all MPCs."),
    ] = None,
    source: Annotated[
        Source, typer.Option("--from", help="Compute from MPCs, or from the omnidirectional PDP of products.")
    ] = "mpcs",
    clusters: Annotated[Clustering, typer.Option(help="How MPCs are grouped into clusters.")] = "none",
    as_json: Annotated[bool, typer.Option("--json", help="Print the statistics as JSON.")] = False,
) -> None:
    """Compute path loss, spreads, K-factor and clusters.

    Medians of positions with and without line of sight are printed with their definitions.
    """
    require_suffix(out, ".csv", ".tex", ".h5")
    require_suffix(statistics, ".csv", ".tex")
    require_suffix(point_data, ".csv")
    require_suffix(mpcs, ".csv")
    if figures:
        require_folder(figures)
    protect_inputs((out, statistics, point_data, mpcs), products)
    from erm.evaluation.outline import rounded
    from erm.mpcs.files import read_mpcs, write_mpcs
    from sounder.parameters.statistics import campaign_statistics
    from sounder.processing import parameter_tables
    from sounder.processing.channel_parameters import channel_parameters, notes_on_parameters
    from sounder.processing.point_data import write_point_data

    table, problems = channel_parameters(products, threshold=threshold, source=source, clusters=clusters)
    summary = campaign_statistics(table)
    if out:
        parameter_tables.write_parameters(table, out)
    if statistics:
        parameter_tables.write_statistics(summary, statistics)
    if point_data:
        write_point_data(table, point_data, products=products, threshold=threshold)
    if mpcs:
        write_mpcs(read_mpcs(products)[0], mpcs)
    if figures:
        from sounder.figures.parameter_files import draw_parameters

        draw_parameters(table, summary, figures, suffix=file_format)
    if as_json:
        write_json([rounded(asdict(one), digits=15) for one in summary])
    else:
        console.show(*parameter_tables.summarise(summary))
        for definition in dict.fromkeys(table["definition"].values.tolist()):
            print(definition)
    for line in notes_on_parameters(table):
        note(f"note: {line}")
    console.report_failures(problems)
