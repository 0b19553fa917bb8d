"""Command line of the sounder: from raw captures to impulse responses, DAPS and MPCs."""

import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from erm.common import console
from erm.common.errors import DataError
from erm.common.outputs import protect_inputs, require_folder
from sounder.options import Averaging, FigureFormat, Method, Omnidirectional, Options, Threshold

if TYPE_CHECKING:
    from sounder.processing.position import Outcome

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # markup would swallow units in brackets
    help="Process raw captures of a radio channel sounder.",
)

console.add_version(app)

Layout = Annotated[Path | None, typer.Option(help="How a foreign HDF5 or MATLAB file is laid out (TOML).")]
Description = Annotated[
    Path | None, typer.Option("--sounder", help="Sounder description (TOML); default: that of the recording.")
]


@app.command()
def demo(
    out: Annotated[Path, typer.Option(help="Folder for everything the demo makes.")] = Path("demo-output"),
) -> None:
    """Run the whole chain on the letter's campaign.

    It is simulated, processed from the raw captures, reconstructed and scored.
    """
    require_folder(out)
    from sounder.campaign.demo import run_demo

    run_demo(out)


@app.command()
def simulate(
    scene: Annotated[Path, typer.Argument(help="Scene (TOML): environment, positions, instrument.")],
    out: Annotated[Path, typer.Option(help="Folder for raw recordings, back-to-back and truth.")],
) -> None:
    """Simulate the raw recordings of a scene.

    Its truth, environment and paths, is written beside them.
    """
    require_folder(out)
    from sounder.twin.scene import load_scene
    from sounder.twin.simulate import simulate

    loaded = load_scene(scene)
    with console.progress("simulating", len(loaded.receivers)) as advance:
        written = simulate(loaded, out, progress=advance)
    print(f"{out}: {console.counted(len(written), 'recording')}")


@app.command()
def info(
    file: Annotated[Path, typer.Argument(help="Raw recording, back-to-back recording or product.")],
    layout: Layout = None,
    sounder: Description = None,
    each: Annotated[
        bool, typer.Option("--each", help="Describe each position in full, however many there are.")
    ] = False,
) -> None:
    """Describe what a file holds and whether it is healthy."""
    from sounder.processing.summary import HEADER, Table, describe_file, describe_foreign_file

    tables: list[Table] = []
    failures: list[str] = []
    if layout is None:
        tables.append((HEADER, describe_file(file)))
    else:
        tables, failures = describe_foreign_file(file, layout, sounder, in_full=each)
    for header, rows in tables:
        console.show(header, rows)
    console.report_failures(failures)


@app.command()
def convert(
    file: Annotated[Path, typer.Argument(help="Recording in any readable format.")],
    out: Annotated[Path, typer.Option(help="Native recording (.h5); a folder if the file holds several positions.")],
    layout: Layout = None,
    sounder: Description = None,
) -> None:
    """Convert a recording to the native format."""
    protect_inputs((out,), (file,))
    if out.suffix.lower() != ".h5":
        require_folder(out)
    from sounder.processing.convert import convert_file

    with console.progress("converting", 1):
        outcome = convert_file(file, out, layout=layout, sounder=sounder)
    _report(outcome, out, "recording")


@app.command()
def process(
    recordings: Annotated[
        list[Path], typer.Argument(readable=False, help="Raw recordings, one or many positions each.")
    ],
    out: Annotated[Path, typer.Option(help="Folder for the products, one file a position.")],
    calibration: Annotated[
        Path | None, typer.Option(help="Back-to-back recording (.h5); a foreign file may hold its own.")
    ] = None,
    layout: Layout = None,
    sounder: Description = None,
    averaging: Annotated[Averaging, typer.Option(help="Over the snapshots of a direction.")] = Options.averaging,
    threshold: Annotated[
        Threshold, typer.Option(help="Least power of an MPC: noise + 12 dB (usc), or max(peak - 25, noise + 5) (nyu).")
    ] = Options.threshold,
    method: Annotated[
        Method, typer.Option(help="MPCs: fitted jointly (sage), one after the other (clean), as they stand (peaks).")
    ] = Options.method,
    omnidirectional: Annotated[
        Omnidirectional, typer.Option(help="Omnidirectional PDP: sum of the beams, or strongest beam.")
    ] = Options.omnidirectional,
    keep_cir: Annotated[bool, typer.Option("--keep-cir", help="Keep the impulse responses in the product.")] = False,
    threads: Annotated[int | None, typer.Option(min=1, help="Threads a process; default one a processor.")] = None,
    workers: Annotated[int, typer.Option(min=1, help="Processes on this machine, a position each.")] = 1,
    scheduler: Annotated[
        str | None, typer.Option(help="Running dask scheduler (tcp://host:port); goes before --workers.")
    ] = None,
) -> None:
    """Process raw recordings to impulse responses, DAPS and MPCs."""
    require_folder(out)
    from sounder.processing.jobs import gather
    from sounder.processing.pipeline import process

    options = Options(averaging, threshold, method, omnidirectional, keep_cir)
    jobs, failures = gather(recordings, calibration=calibration, layout=layout, sounder=sounder)
    with console.progress("processing positions", len(jobs)) as advance:
        outcome = process(
            jobs, out, options=options, threads=threads, workers=workers, scheduler=scheduler, progress=advance
        )
    outcome.failures[:0] = failures
    _report(outcome, out, "product")


@app.command()
def run(
    campaign: Annotated[Path, typer.Argument(help="Campaign (TOML): recordings, and what is made of them.")],
    out: Annotated[
        Path | None, typer.Option(help="Folder for all that is made; default one beside the campaign, named after it.")
    ] = None,
) -> None:
    """Make products, MPC table, map, figures and report of a campaign.

    Positions that were processed before, from the same files with the same options, are not processed again.
    """
    from sounder.campaign.run import run_campaign

    result = run_campaign(campaign, out)
    for line in result.summary:
        print(line)
    for note in result.notes:
        print(f"note: {note}", file=sys.stderr)
    console.report_failures(result.failures)


@app.command()
def figures(
    products: Annotated[list[Path], typer.Argument(readable=False, help="Products of `sounder process`.")],
    out: Annotated[Path, typer.Option(help="Folder for the figures.")],
    overlay: Annotated[bool, typer.Option("--overlay", help="Draw two positions into one polar DAPS.")] = False,
    file_format: Annotated[FigureFormat, typer.Option("--format", help="File format.")] = "png",
) -> None:
    """Draw DAPS, MPCs and PDP of products.

    The DAPS is drawn in polar form, and in cartesian form with the MPCs over it.
    """
    from sounder.figures.files import draw_overlay, draw_product

    if overlay and len(products) != 2:
        raise typer.BadParameter(f"--overlay takes two products, got {len(products)}")
    require_folder(out)
    failures = []
    written: list[Path] = []
    with console.progress("drawing", len(products)) as advance:
        for product in products:
            try:
                written += draw_product(product, out, suffix=file_format)
            except DataError as error:
                failures.append(str(error))
            advance()
        if overlay and not failures:
            written += draw_overlay(products[0], products[1], out, suffix=file_format)
    print(f"{out}: {console.counted(len(written), 'figure')}")
    console.report_failures(failures)


@app.command()
def score(
    products: Annotated[
        list[Path], typer.Argument(readable=False, help="Products of `sounder process`, or MPC tables (.csv).")
    ],
    truth: Annotated[Path, typer.Option(help="truth/paths.h5 of `sounder simulate`, an MPC table or a product.")],
    delay_gate: Annotated[float, typer.Option(help="How far an MPC may be off its path [s].")] = 1e-9,
    azimuth_gate: Annotated[float, typer.Option(help="The same [degree].")] = 5.0,
    elevation_gate: Annotated[float, typer.Option(help="The same [degree].")] = math.inf,
    gain_gate: Annotated[float, typer.Option(help="The same [dB].")] = 10.0,
    dynamic_range: Annotated[float, typer.Option(help="Paths to be found: so far under the strongest [dB],")] = 25.0,
    least_snr: Annotated[float, typer.Option(help="and so far over the noise, where it is known [dB].")] = 10.0,
    out: Annotated[Path | None, typer.Option(help="Folder for a table of all paths and figures.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Judge MPCs by the paths that were there.

    How many were found, how many made up, how far off they are, and how honest about it: of the errors, 68 % should lie
    within one stated standard deviation and 95 % within two.
    """
    import json

    from erm.evaluation.outline import rounded
    from sounder.figures.files import score_products, write_score
    from sounder.mpc.score import Gates

    if out:
        require_folder(out)
        protect_inputs((out / "paths.csv",), (*products, truth))
    gates = Gates(delay_gate, azimuth_gate, elevation_gate, gain_gate)
    judged, complaints = score_products(products, truth, gates=gates, dynamic_range=dynamic_range, least_snr=least_snr)
    summary = judged.summary()
    if as_json:
        print(json.dumps(rounded(summary, digits=15), indent=2))
    else:
        print(
            f"{summary['found']} of {summary['paths']} paths found; {summary['false']} of {summary['mpcs']} MPCs false"
        )
        names = ("count", "rmse", "bias", "median_absolute", "within_1_std", "within_2_std")
        console.show(
            ["error", *names],
            (
                [f"{name} [{row['unit']}]", *(f"{row[key]:.3g}" for key in names)]
                for name, row in summary["errors"].items()
            ),
        )
    if out:
        print(f"{out}: {len(write_score(judged, out))} files", file=sys.stderr if as_json else sys.stdout)
    console.report_failures(complaints)


def _report(outcome: "Outcome", out: Path, what: str) -> None:
    print(f"{out}: {console.counted(len(outcome.products), what)}")
    for note in outcome.notes:
        print(f"note: {note}", file=sys.stderr)
    console.report_failures(outcome.failures)


def main() -> None:
    """Run the command line."""
    console.run(app)
