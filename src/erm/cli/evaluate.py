"""The command ``erm evaluate``: a map against a known outline, or predictions against measurements."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from erm.cli.arguments import FIGURES, MapFile, three_digits
from erm.common import console
from erm.common.messages import write_json
from erm.common.outputs import protect_inputs, require_suffix

LEFT_OUT = {
    "positions": "positions left out",
    "components": "their strongest MPCs",
    "right": "share of these that are predicted",
    "positions_right": "share of positions with all of these predicted",
    "positions_located": "the same by delay and azimuth alone",
    "positions_reported": "the same with the gains of the table, at any elevation",
    "positions_compatible": "the same with gains within the errors of the measurement",
    "delay": "median delay error of the predicted MPCs [s]",
    "azimuth": "median azimuth error [degree]",
    "gain": "median gain error [dB]",
}
STATISTICS = ("count", "min", "max", "mean", "median", "std", "rmse")


def evaluate(
    environment: MapFile,
    mpcs: Annotated[
        list[Path] | None,
        typer.Argument(readable=False, help="MPCs. Their reflection points are also evaluated.", show_default=False),
    ] = None,
    outline: Annotated[
        Path | None, typer.Option(help="Known outline (.geojson) or true map.", show_default=False)
    ] = None,
    leave_one_out: Annotated[
        bool,
        typer.Option(
            "--leave-one-out",
            help="Predict each position from a map of all other positions. The maps use default options.",
        ),
    ] = False,
    z_slice: Annotated[
        float | None, typer.Option(help="Use outline features with this z_slice_m. Default: the lowest.")
    ] = None,
    min_visible: Annotated[
        float,
        typer.Option(min=0.0, max=1.0, help="Use an outline feature only if receivers see more than this share of it."),
    ] = 0.0,
    figure: Annotated[
        Path | None, typer.Option(help="Also draw the map over the outline (.png, .pdf, .svg).", show_default=False)
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Compare a map with an outline, or with measurements."""
    if leave_one_out == (outline is not None):
        raise typer.BadParameter("give either --outline FILE or --leave-one-out")
    if leave_one_out and not mpcs:
        raise typer.BadParameter("--leave-one-out needs the MPCs that the map was made from")
    if leave_one_out and figure:
        raise typer.BadParameter("--figure draws the map over an outline; give --outline FILE")
    require_suffix(figure, *FIGURES)
    protect_inputs((figure,), [environment, *(mpcs or []), *([outline] if outline else [])])
    from erm.maps.formats import read_map

    found = read_map(environment)
    if outline is None:
        problems = _by_prediction(mpcs or [], as_json)
    else:
        from erm.maps.outline import known_faces

        faces = known_faces(outline, z_slice=z_slice, min_visible=min_visible, georeference=found.georeference)
        problems = _by_outline(found, faces, mpcs or [], figure, as_json)
    console.report_failures(problems)


def _by_prediction(mpcs: list[Path], as_json: bool) -> list[str]:
    from erm.evaluation.leave_one_out import leave_one_out, score
    from erm.evaluation.outline import rounded
    from erm.mpcs.files import read_mpcs

    table, problems = read_mpcs(mpcs)
    result = score(leave_one_out(table))
    if as_json:
        write_json(rounded(result, digits=14))
    else:
        console.show(["leave one out", "result"], ([LEFT_OUT[name], f"{value:.3g}"] for name, value in result.items()))
    return problems


def _by_outline(found: Any, faces: Any, mpcs: list[Path], figure: Path | None, as_json: bool) -> list[str]:
    from erm.evaluation.evaluate_map import evaluate_map
    from erm.evaluation.outline import rounded
    from erm.mpcs.files import read_mpcs
    from erm.mpcs.selection import select
    from erm.reconstruction.reconstruct import reconstruct

    table, problems = read_mpcs(mpcs)
    reconstructed = reconstruct(select(table)) if mpcs else None
    result = evaluate_map(found, faces, reconstructed)
    if figure:
        from erm.figures import plot_map

        with console.drawing():
            axes = plot_map(found, table=reconstructed and reconstructed[1], outline=faces, annotated=True)
            console.save_figure(axes, figure)
    if as_json:
        write_json(rounded(result))
    else:
        _print(result, len(faces))
    return problems


def _print(result: Mapping[str, Any], faces: int) -> None:
    walls = result["walls"]
    print(
        f"{console.counted(walls['walls'], 'wall')}, {walls['false']} false; "
        f"{walls['found']} of {console.counted(faces, 'face')} of the outline found, receivers see them or not"
    )
    shares = {
        "of the length of the walls lies on a face": walls["correctness"],
        "of the outline has a wall": walls["completeness"],
    }
    print("; ".join(f"{three_digits(100 * share) or '-'} % {what}" for what, share in shares.items()))
    errors = {"walls: offset [m]": walls["offset_error"], "walls: angle [degree]": walls["angle_error"]}
    for kind, statistics in result.get("points", {}).items():
        errors |= {f"points, {kind}: {name} [m]": row for name, row in statistics.items()}
    errors = {label: row for label, row in errors.items() if row["count"]}
    if errors:
        rows = ([label, *(three_digits(row[name]) for name in STATISTICS)] for label, row in errors.items())
        console.show(["error", *STATISTICS], rows)
    if "visible" in result:
        console.show(
            ["seen by receivers", "outline [m]", "with a wall [%]"],
            (
                [f"{row.receivers} or more", f"{row.length:.0f}", three_digits(100 * row.share)]
                for row in result["visible"]
            ),
        )
