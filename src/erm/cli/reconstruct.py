"""The command ``erm reconstruct``: MPCs to a map."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from erm.cli.arguments import FIGURES, hundredths
from erm.common import console
from erm.common.messages import note
from erm.common.outputs import protect_inputs, require_suffix
from erm.mpcs.options import Threshold

if TYPE_CHECKING:
    import xarray as xr

    from erm.maps.environment import Environment


def reconstruct(
    mpcs: Annotated[
        list[Path],
        typer.Argument(readable=False, help="MPC tables (.csv), products of `sounder process`, or both."),
    ],
    out: Annotated[Path, typer.Option(help="Map to write: .h5, .geojson, .gpkg, .csv; or a format of `erm export`.")],
    rps: Annotated[Path | None, typer.Option(help="Also write the accepted reflection points (.csv).")] = None,
    figure: Annotated[Path | None, typer.Option(help="Also draw the map (.png, .pdf, .svg).")] = None,
    threshold: Annotated[
        Threshold,
        typer.Option(
            help="How single reflections are selected: by consistency between positions, by a fixed largest "
            "loss, or by Eq. 4 of the letter."
        ),
    ] = "consistency",
    max_loss: Annotated[
        float | None,
        typer.Option(
            min=0.0, help="Largest reflection loss [dB]. Default: 20 for consistency, 12 for fixed.", show_default=False
        ),
    ] = None,
    min_support: Annotated[
        int, typer.Option(min=1, help="A wall needs MPCs from at least this number of antenna pairs.")
    ] = 3,
    add_to: Annotated[
        Path | None,
        typer.Option(help="Map (.h5) to which these MPCs are added. Its MPCs are not searched again."),
    ] = None,
    ground: Annotated[float, typer.Option(help="Height of the ground [m].")] = 0.0,
    rx_std: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            help="Standard error of each horizontal coordinate of the receivers [m]. Default: estimated.",
            show_default=False,
        ),
    ] = None,
    heading_std: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            help="Standard error of the azimuth zero of a position [degree]. Default: estimated.",
            show_default=False,
        ),
    ] = None,
    clock_std: Annotated[
        float | None,
        typer.Option(
            min=0.0, help="Standard error of the clock of a position [ns]. Default: estimated.", show_default=False
        ),
    ] = None,
    positions_out: Annotated[
        Path | None, typer.Option(help="Also write the corrected positions and the corrections (.csv).")
    ] = None,
    calibrated: Annotated[
        Path | None, typer.Option(help="Also write the MPCs with the errors of the survey removed (.csv).")
    ] = None,
    as_given: Annotated[
        bool, typer.Option("--as-given", help="Take azimuths, delays and gains as they are, without calibration.")
    ] = False,
) -> None:
    """Reconstruct the walls that reflected the MPCs."""
    inputs = {path for path in (*mpcs, add_to) if path is not None}
    protect_inputs((out, rps, figure, positions_out, calibrated), inputs)
    require_suffix(rps, ".csv")
    require_suffix(positions_out, ".csv")
    require_suffix(calibrated, ".csv")
    require_suffix(figure, *FIGURES)
    from erm.maps.formats import require_format, write_map
    from erm.mpcs.files import read_mpcs, write_mpcs
    from erm.mpcs.reflection_points import write_reflection_points
    from erm.reconstruction.extend import add_mpcs, read_map_mpcs, with_images
    from erm.reconstruction.make_map import make_map
    from erm.survey.position_files import positions_of, write_positions
    from erm.survey.report import warnings

    require_format(out)
    table, problems = read_mpcs(mpcs)
    if problems and not table.sizes["mpc"]:
        console.report_failures([*problems, f"{out}: not written; no file holds a usable MPC"])
    table, start = add_mpcs(*read_map_mpcs(add_to), table) if add_to else (table, None)
    environment, located = make_map(
        table,
        history="erm reconstruct",
        inputs=sorted(path for path in inputs if path.is_file()),
        start=start,
        threshold=threshold,
        max_reflection_loss=max_loss,
        min_support=min_support,
        ground_height=ground,
        rx_std=rx_std,
        heading_std=heading_std,
        clock_std=None if clock_std is None else clock_std * 1e-9,
        as_given=as_given,
    )
    write_map(environment, out, mpcs=with_images(table, located), positions=positions_of(located))
    if positions_out:
        write_positions(located, positions_out)
    if rps:
        write_reflection_points(located, rps)
    if calibrated:
        write_mpcs(
            table.assign({name: located[name] for name in ("rx_position", "delay", "azimuth", "path_gain")}), calibrated
        )
    if figure:
        _draw(environment, located, figure)
    _print_reflectors(environment)
    _print_summary(environment, located, out, min_support)
    print(environment.reflectors.attrs["calibration"])
    for warning in warnings(environment):
        note(warning)
    console.report_failures(problems)


@console.drawing()
def _draw(environment: "Environment", located: "xr.Dataset", path: Path) -> None:
    from erm.figures import plot_map

    numbers = [str(i) for i in range(environment.reflectors.sizes["reflector"])]
    console.save_figure(plot_map(environment, table=located, names=numbers, annotated=True), path)


def _print_reflectors(environment: "Environment") -> None:
    import numpy as np

    table = environment.reflectors
    ends = table["end_points"].values
    east, north = ends.mean(axis=1).T
    normal = np.round(table["normal"].values, 2) % 360  # 0.00, not 360.00
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=-1)
    numbers = np.column_stack([normal, table["offset"].values, east, north, length, table["top"].values])
    columns = (table["kind"].values, numbers, table["support"].values)
    header = ["normal [degree]", "offset [m]", "east [m]", "north [m]", "length [m]", "top [m]"]
    console.show(
        ["reflector", "kind", *header, "paths"],
        ([i, kind, *map(hundredths, row), n] for i, (kind, row, n) in enumerate(zip(*columns, strict=True))),
    )


def _print_summary(environment: "Environment", located: "xr.Dataset", out: Path, min_support: int) -> None:
    from erm.maps.reflectors import counted_reflectors
    from erm.reconstruction.summary import explain_unused

    found = counted_reflectors(environment.reflectors["kind"].values.tolist())
    print(f"{out}: {found} from {int(located['accepted'].sum())} of {located.sizes['mpc']} MPCs")
    for line in explain_unused(located, min_support):
        print(line)
    if "delay_std" in located.attrs:
        print(
            f"typical standard errors: {located.attrs['delay_std'] * 1e9:.2g} ns, {located.attrs['azimuth_std']:.2g} "
            f"degrees; from {located.attrs['errors_from']} and the residuals"
        )
