"""Command line of ``sounder``: from raw captures to impulse responses, DAPS and MPCs, and to the map."""

import math
import sys
from collections.abc import Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from erm.common import console
from erm.common.messages import note, write_json
from erm.common.outputs import protect_inputs, require_folder
from sounder.cli.check import check
from sounder.cli.examples import EXAMPLES
from sounder.cli.parameters import parameters
from sounder.cli.report import report
from sounder.cli.verify import verify
from sounder.options import Averaging, FigureFormat, Method, Omnidirectional, Options

app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # markup would swallow units in brackets
    help="Process raw captures of a radio channel sounder.\n\n"
    "MPC: multipath component. DAPS: delay-angular power spectrum. PDP: power delay profile. Product: file with "
    "the results of one position. Back-to-back: recording through an attenuator in place of the antennas.",
)

Layout = Annotated[Path | None, typer.Option(help="Layout (TOML) of a foreign HDF5 or MATLAB file.")]
Description = Annotated[
    Path | None,
    typer.Option(
        "--sounder", help="Sounder description (TOML). Default: the one in the recording, or the shipped one."
    ),
]


@app.command()
def demo(
    out: Annotated[Path, typer.Option(help="Folder for all files of the demo.")] = Path("demo-output"),
) -> None:
    """Run all steps on a simulated example campaign.

    The raw captures are simulated and processed to MPCs. The map is made from the MPCs and compared with the truth.
    """
    require_folder(out)
    from sounder.campaign.demo import run_demo

    run_demo(out)


@app.command()
def simulate(
    scene: Annotated[Path, typer.Argument(help="Scene (TOML): environment, positions, sounder.")],
    out: Annotated[Path, typer.Option(help="Folder for raw recordings, back-to-back recording and truth.")],
) -> None:
    """Simulate the raw recordings of a scene.

    The true environment and the true paths are also written.
    """
    require_folder(out)
    from sounder.twin.scene import load_scene
    from sounder.twin.simulate import simulate

    loaded = load_scene(scene)
    with console.progress("simulating", len(loaded.receivers)) as advance:
        recordings = simulate(loaded, out, progress=advance)
    print(f"{out}: {console.counted(len(recordings), 'recording')}")


@app.command()
def info(
    file: Annotated[Path, typer.Argument(help="Raw recording, back-to-back recording or product.")],
    layout: Layout = None,
    sounder: Description = None,
    each: Annotated[bool, typer.Option("--each", help="Show all details of each position.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Show the content of a file and the problems in its data."""
    from sounder.processing.summary import HEADER, Table, describe_file, describe_foreign_file, remarks_of

    tables: list[Table] = []
    failures: list[str] = []
    if layout is None:
        tables.append((HEADER, describe_file(file, sounder)))
    else:
        tables, failures = describe_foreign_file(file, layout, sounder, in_full=each or as_json)
    if as_json:
        _print_info(tables, remarks_of(file) if layout is None else [])
    else:
        for header, rows in tables:
            console.show(header, rows)
    console.report_failures(failures)


@app.command()
def convert(
    file: Annotated[Path, typer.Argument(help="Recording in any readable format.")],
    out: Annotated[
        Path, typer.Option(help="Recording (.h5, .sigmf-meta), or a folder if the file holds several positions.")
    ],
    layout: Layout = None,
    sounder: Description = None,
) -> None:
    """Convert a recording to the native format, or to SigMF."""
    protect_inputs((out,), (file,))
    if out.suffix.lower() not in (".h5", ".sigmf-meta", ".sigmf-data"):
        require_folder(out)
    from sounder.processing.convert import convert_file

    with console.progress("converting", 1):
        outcome = convert_file(file, out, layout=layout, sounder=sounder)
    print(f"{out}: {console.counted(len(outcome.products), 'recording')}")
    _report(outcome.notes, outcome.failures)


@app.command()
def process(
    recordings: Annotated[
        list[Path], typer.Argument(readable=False, help="Raw recordings with one or many positions each.")
    ],
    out: Annotated[Path, typer.Option(help="Folder for the products, one file for each position.")],
    calibration: Annotated[
        Path | None, typer.Option(help="Back-to-back recording. Not needed if a foreign file holds one.")
    ] = None,
    layout: Layout = None,
    sounder: Description = None,
    positions: Annotated[
        Path | None, typer.Option(help="Table of positions (.csv), as the layout describes it.")
    ] = None,
    skip: Annotated[list[str] | None, typer.Option(help="Name of a position to leave out; may be repeated.")] = None,
    averaging: Annotated[
        Averaging, typer.Option(help="Averaging over the snapshots of a direction.")
    ] = Options.averaging,
    threshold: Annotated[
        str,
        typer.Option(
            help="What counts as an MPC: cfar (noise makes at most 1 MPC in 20 positions; cfar:0.01: 1 in 100), usc "
            "(12 dB over noise), nyu (5 dB over noise, which 4 % of the noise exceeds, and 25 dB under the peak), or "
            "numbers: dB over noise, dynamic range [dB], delay gate [s], as in 10,30,4e-7."
        ),
    ] = Options.threshold,
    method: Annotated[
        Method, typer.Option(help="Fit of MPCs: jointly (sage), one after another (clean), or each peak alone (peaks).")
    ] = Options.method,
    omnidirectional: Annotated[
        Omnidirectional,
        typer.Option(help="Omnidirectional PDP: synthesis from MPCs, sum of all beams, or strongest beam."),
    ] = Options.omnidirectional,
    keep_cir: Annotated[bool, typer.Option("--keep-cir", help="Keep the impulse responses in the products.")] = False,
    trust_all: Annotated[
        bool, typer.Option("--trust-all", help="Only report problems of the data; correct nothing, leave out nothing.")
    ] = False,
    threads: Annotated[
        int | None, typer.Option(min=1, help="Threads in each process; default: one for each processor.")
    ] = None,
    workers: Annotated[int, typer.Option(min=1, help="Processes on this machine. Each processes one position.")] = 1,
    scheduler: Annotated[
        str | None, typer.Option(help="Running dask scheduler (tcp://host:port), used in place of --workers.")
    ] = None,
) -> None:
    """Process raw recordings to impulse responses, DAPS and MPCs."""
    require_folder(out)
    from sounder.campaign.survey import remarks_on_survey
    from sounder.processing.jobs import gather
    from sounder.processing.pipeline import process

    options = Options(averaging, threshold, method, omnidirectional, keep_cir, trust_all)
    jobs, failures = gather(
        recordings, calibration=calibration, layout=layout, sounder=sounder, positions=positions, skip=skip or ()
    )
    with console.progress("processing positions", len(jobs)) as advance:
        outcome = process(
            jobs, out, options=options, threads=threads, workers=workers, scheduler=scheduler, progress=advance
        )
    print(f"{out}: {console.counted(len(outcome.products), 'product')}")
    failures += [*outcome.failures, *remarks_on_survey(outcome.products)]
    _report(outcome.notes, failures, internal=outcome.internal)


@app.command()
def run(
    campaign: Annotated[Path, typer.Argument(help="Campaign (TOML): recordings and options.")],
    out: Annotated[
        Path | None, typer.Option(help="Folder for all outputs. Default: the campaign file without its suffix.")
    ] = None,
    workers: Annotated[
        int | None, typer.Option(min=1, help="Processes on this machine. Default: processing.workers of the campaign.")
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(help="Running dask scheduler. Default: processing.scheduler of the campaign.")
    ] = None,
    watch: Annotated[
        bool,
        typer.Option("--watch", help="Process recordings as they appear: print their quality, update map and page."),
    ] = False,
    interval: Annotated[float, typer.Option(min=0.1, help="--watch: time between two looks at the files [s].")] = 5.0,
) -> None:
    """Make products, tables, map, figures and report of a campaign.

    Existing products are kept if their input files and options are the same.
    """
    from sounder.campaign.description import load_campaign
    from sounder.campaign.run import run_campaign

    chosen = {"workers": workers, "scheduler": scheduler}
    given = {name: value for name, value in chosen.items() if value is not None}
    if watch:
        from sounder.campaign.watch import watch_campaign

        watch_campaign(campaign, out, processing=given, interval=interval, tell=partial(print, flush=True))
        return
    result = run_campaign(load_campaign(campaign).processed_by(**given), out)
    for line in result.summary:
        print(line)
    _report(result.notes, result.failures, internal=result.internal)


@app.command()
def figures(
    products: Annotated[list[Path], typer.Argument(readable=False, help="Products of `sounder process`.")],
    out: Annotated[Path, typer.Option(help="Folder for the figures.")],
    overlay: Annotated[bool, typer.Option("--overlay", help="Also draw two positions in one polar diagram.")] = False,
    elevations: Annotated[
        bool, typer.Option("--elevations", help="Also draw the DAPS with a panel for each elevation.")
    ] = False,
    file_format: Annotated[FigureFormat, typer.Option("--format", help="File format.")] = "png",
) -> None:
    """Draw DAPS, MPCs and PDP of products.

    The DAPS is drawn twice: as a polar diagram, and over delay and azimuth with the MPCs.
    """
    from sounder.figures.processes import draw_products

    if overlay and len(products) != 2:
        raise typer.BadParameter(f"--overlay needs two products, got {len(products)}")
    require_folder(out)
    with console.progress("drawing", len(products)) as advance:
        written, failures = draw_products(
            products, out, suffix=file_format, overlay=overlay, elevations=elevations, progress=advance
        )
    print(f"{out}: {console.counted(len(written), 'figure')}")
    console.report_failures(failures)


@app.command()
def score(
    products: Annotated[
        list[Path], typer.Argument(readable=False, help="Products of `sounder process`, or MPC tables (.csv).")
    ],
    truth: Annotated[Path, typer.Option(help="truth/paths.h5 of `sounder simulate`, an MPC table or a product.")],
    delay_gate: Annotated[
        float, typer.Option(help="Largest difference between an MPC and its path: delay [s].")
    ] = 1e-9,
    azimuth_gate: Annotated[float, typer.Option(help="The same: azimuth [degree].")] = 5.0,
    elevation_gate: Annotated[float, typer.Option(help="The same: elevation [degree].")] = math.inf,
    gain_gate: Annotated[float, typer.Option(help="The same: path gain [dB].")] = 10.0,
    dynamic_range: Annotated[
        float, typer.Option(help="A path is required if it is at most this far below the strongest path [dB].")
    ] = 25.0,
    least_snr: Annotated[
        float, typer.Option(help="A path is required if its SNR is at least this, where the noise is known [dB].")
    ] = 10.0,
    out: Annotated[Path | None, typer.Option(help="Folder for a table of all paths and for figures.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Compare MPCs with true paths.

    The score gives the numbers of found paths and false MPCs, and the errors. If the stated standard deviations are
    right, 68 % of the errors are within one standard deviation and 95 % within two.
    """
    from sounder.figures.score_files import write_score
    from sounder.mpc.score import Gates
    from sounder.processing.scoring import score_products

    if out:
        require_folder(out)
        protect_inputs((out / "paths.csv",), (*products, truth))
    gates = Gates(delay_gate, azimuth_gate, elevation_gate, gain_gate)
    result, problems = score_products(products, truth, gates=gates, dynamic_range=dynamic_range, least_snr=least_snr)
    _print_score(result.summary(), as_json)
    if out:
        print(f"{out}: {len(write_score(result, out))} files", file=sys.stderr if as_json else sys.stdout)
    console.report_failures(problems)


app.command()(check)
app.command()(parameters)
app.command()(report)
app.command()(verify)
console.add_options(app, EXAMPLES)


def _print_info(tables: Sequence[tuple[Sequence[str], Iterable[Sequence[object]]]], remarks: list[Any]) -> None:
    """Print what `sounder info` shows as JSON: labels and texts of each table, and the remarks one by one."""
    contents: list[dict[str, Any]] = []
    for _, rows in tables:
        texts: dict[str, Any] = {}
        for label, text in rows:
            texts.setdefault(str(label), []).append(text)
        contents.append({label: each[0] if len(each) == 1 else each for label, each in texts.items()})
    write_json({"contents": contents, "remarks": remarks})


def _print_score(summary: dict[str, Any], as_json: bool) -> None:
    from erm.evaluation.outline import rounded

    if as_json:
        write_json(rounded(summary, digits=15))
        return
    print(f"{summary['found']} of {summary['paths']} paths found; {summary['false']} of {summary['mpcs']} MPCs false")
    names = ("count", "rmse", "bias", "median_absolute", "within_1_std", "within_2_std")
    errors = summary["errors"].items()
    console.show(
        ["error", *names], ([f"{name} [{row['unit']}]", *(f"{row[key]:.3g}" for key in names)] for name, row in errors)
    )


def _report(notes: list[str], failures: list[str], *, internal: bool = False) -> None:
    """Print notes and failures on stderr, and exit with 1 or 70 if anything failed."""
    for line in notes:
        note(f"note: {line}")
    console.report_failures(failures, internal=internal)


def main() -> None:
    """Run the command line."""
    console.run(app)
