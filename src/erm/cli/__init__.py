"""Command line: MPCs to a map, a map to its score, a map to the paths it predicts, the letter redone."""

import math
import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from erm.cli.evaluate import evaluate
from erm.cli.export import export
from erm.common import console
from erm.common.errors import OptionError
from erm.common.outputs import protect_inputs, require_folder, require_suffix

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # markup would swallow units in brackets
    help="Reconstruct the environment from multipath components, judge it, and predict from it.",
)
console.add_version(app)
Point = tuple[float, float, float]
MapFile = Annotated[Path, typer.Argument(help="Map: .h5, .geojson, .gpkg or .csv.", show_default=False)]


class Threshold(StrEnum):
    """How single reflections are told from others."""

    consistency = "consistency"
    fixed = "fixed"
    letter = "letter"


@app.command()
def reconstruct(
    mpcs: Annotated[
        list[Path],
        typer.Argument(readable=False, help="MPC tables (.csv) and products of `sounder process`, any mixture."),
    ],
    out: Annotated[Path, typer.Option(help="Map to write: .h5, .geojson, .gpkg, .csv; or a format of `erm export`.")],
    rps: Annotated[Path | None, typer.Option(help="Also write the accepted reflection points (.csv).")] = None,
    figure: Annotated[Path | None, typer.Option(help="Also draw the map (.png, .pdf, .svg).")] = None,
    threshold: Annotated[
        Threshold, typer.Option(help="Single reflections: by consistency, below a fixed loss, or the letter's Eq. 4.")
    ] = Threshold.consistency,
    max_loss: Annotated[
        float | None,
        typer.Option(min=0.0, help="Largest loss [dB]; 20 for consistency, 12 for fixed.", show_default=False),
    ] = None,
    min_support: Annotated[int, typer.Option(min=1, help="Antenna pairs that must share a wall.")] = 3,
    add_to: Annotated[
        Path | None,
        typer.Option(help="Map (.h5) to whose MPCs these are added; what agreed before is not searched again."),
    ] = None,
    ground: Annotated[float, typer.Option(help="Height of the ground [m].")] = 0.0,
    rx_std: Annotated[float, typer.Option(min=0.0, help="Standard error of the receivers' coordinates [m].")] = 0.0,
) -> None:
    """Reconstruct the walls that reflected the components."""
    inputs = {path for path in (*mpcs, add_to) if path is not None}
    protect_inputs((out, rps, figure), inputs)
    require_suffix(rps, ".csv")
    require_suffix(figure, ".png", ".pdf", ".svg")
    import numpy as np

    from erm.common.storage import provenance
    from erm.maps.formats import require_format, write_map
    from erm.mpcs.files import read_mpcs
    from erm.mpcs.reflection_points import write_reflection_points
    from erm.mpcs.selection import select
    from erm.reconstruction.extend import added, read_members, with_images
    from erm.reconstruction.reconstruct import reconstruct as merge_walls
    from erm.reconstruction.summary import left_out

    require_format(out)
    table, complaints = read_mpcs(mpcs)
    if complaints and not table.sizes["mpc"]:
        console.report_failures(
            [*complaints, f"{out}: not written; none of {len(mpcs)} files holds a usable component"]
        )
    table, start = added(*read_members(add_to), table) if add_to else (table, None)
    selected = select(
        table, threshold=threshold.value, max_reflection_loss=max_loss, ground_height=ground, rx_std=rx_std
    )
    environment, merged = merge_walls(selected, min_support=min_support, start=start)
    options = {"threshold": threshold.value, "max_reflection_loss": max_loss, "ground_height": ground}
    options |= {"min_support": min_support, "rx_std": rx_std}
    there = sorted(path for path in inputs if path.is_file())
    origin = provenance("Reconstructed environment", "erm reconstruct", inputs=there, options=options)
    environment.reflectors.attrs.update(origin)
    write_map(environment, out, mpcs=with_images(table, merged))
    if rps:
        write_reflection_points(merged, rps)
    if figure:
        from erm.figures import plot_map

        numbers = [str(i) for i in range(environment.reflectors.sizes["reflector"])]
        console.save_figure(plot_map(environment, table=merged, names=numbers), figure)
    walls = environment.reflectors
    kind = walls["kind"].values
    length = np.linalg.norm(walls["end_points"].values[:, 1] - walls["end_points"].values[:, 0], axis=-1)
    east, north = walls["end_points"].values.mean(axis=1).T
    normal = np.round(walls["normal"].values, 2) % 360  # and not 360.00
    columns = [normal, walls["offset"].values, east, north, length, walls["top"].values]
    rows = np.column_stack(columns)
    console.show(
        [
            "reflector",
            "kind",
            "normal [degree]",
            "offset [m]",
            "east [m]",
            "north [m]",
            "length [m]",
            "top [m]",
            "paths",
        ],
        (
            [i, name, *map(_number, row), n]
            for i, (name, row, n) in enumerate(zip(kind, rows, walls["support"].values, strict=True))
        ),
    )
    found = f"{console.counted(np.sum(kind == 'wall'), 'wall')} and {console.counted(np.sum(kind == 'pole'), 'pole')}"
    print(f"{out}: {found} from {int(merged.accepted.sum())} of {table.sizes['mpc']} components")
    for line in left_out(merged, min_support):
        print(line)
    if "delay_std" in merged.attrs:
        errors = merged.attrs["delay_std"] * 1e9, merged.attrs["azimuth_std"]
        source = merged.attrs["errors_from"]
        print(f"typical errors: {errors[0]:.2g} ns, {errors[1]:.2g} degrees; from {source} and the residuals")
    console.report_failures(complaints)


@app.command()
def predict(
    environment: MapFile,
    tx: Annotated[Point, typer.Option(help="Transmitter, east north up [m].", show_default=False)],
    rx: Annotated[Point, typer.Option(help="Receiver, east north up [m].", show_default=False)],
    frequency: Annotated[float, typer.Option(min=1e6, max=1e13, help="Carrier [Hz].")] = 132e9,
    max_order: Annotated[int, typer.Option(min=0, max=3, help="Most reflections a path.")] = 2,
    out: Annotated[Path | None, typer.Option(help="Also write the paths as an MPC table (.csv).")] = None,
) -> None:
    """Predict the paths between two places nobody measured."""
    from erm.maps.formats import read_map
    from erm.mpcs.files import write_mpcs
    from erm.tracing.predict import predict as predicted

    protect_inputs((out,), (environment,))
    require_suffix(out, ".csv")
    for option, place in (("--tx", tx), ("--rx", rx)):
        if not all(map(math.isfinite, place)):
            raise OptionError(f"{option} is {place}; expected three finite numbers, east north up [m]")
    if tx == rx:
        raise OptionError(f"--tx and --rx are both {tx}; expected two places")
    mpcs = predicted(read_map(environment), tx, rx, frequency, max_order=max_order)
    if out:
        write_mpcs(mpcs, out)
    names = ("azimuth", "elevation", "path_gain", "order")
    columns = (mpcs["delay"].values * 1e9, *(mpcs[name].values for name in names))
    console.show(
        ["delay [ns]", "azimuth [degree]", "elevation [degree]", "path gain [dB]", "reflections"],
        ([*map(_number, row[:-1]), int(row[-1])] for row in zip(*columns, strict=True)),
    )
    if not mpcs.sizes["mpc"]:
        print(f"no path of at most {console.counted(max_order, 'reflection')} from TX to RX", file=sys.stderr)


@app.command()
def letter(out: Annotated[Path, typer.Option(help="Folder for the page, its tables and figures.")]) -> None:
    """Redo the letter's studies, by its method and by this one.

    Captures are simulated, which takes minutes; the result is one page, letter.md, with figures as PDF and PNG.
    """
    require_folder(out)
    from erm.letter.captures import installed
    from erm.letter.study import run

    print(run(out, installed()))


app.command()(evaluate)
app.command()(export)


def main() -> None:
    """Run the command line."""
    console.run(app)


def _number(value: float) -> str:
    """Return a count as it is, other numbers to the hundredth, nothing for NaN."""
    return str(value) if isinstance(value, int) else "" if math.isnan(value) else f"{value:.2f}"
