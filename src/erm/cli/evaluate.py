"""The command ``erm evaluate``: a map judged by a known outline, or by what it predicts."""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from erm.common import console
from erm.common.outputs import protect_inputs, require_suffix

if TYPE_CHECKING:
    from erm.geometry.vertical import FloatArray
    from erm.maps.environment import Environment

HELD = {
    "positions": "positions left out",
    "components": "their strongest components",
    "right": "share of these that are predicted",
    "positions_right": "share of positions with all of these predicted",
    "positions_located": "the same, by delay and azimuth alone",
    "positions_reported": "the same, by the gains that the table reports, whatever the elevation",
    "positions_compatible": "the same, gains within what the measurement is sure of",
    "delay": "of those predicted: median error of delay [s]",
    "azimuth": "median error of azimuth [degree]",
    "gain": "median error of gain [dB]",
}
SUMMARY = ("count", "min", "max", "mean", "median", "std", "rmse")


def evaluate(
    environment: Annotated[Path, typer.Argument(help="Map: .h5, .geojson, .gpkg or .csv.", show_default=False)],
    mpcs: Annotated[
        list[Path] | None,
        typer.Argument(readable=False, help="MPCs whose reflection points are judged too.", show_default=False),
    ] = None,
    outline: Annotated[
        Path | None, typer.Option(help="Known outline (.geojson) or true map.", show_default=False)
    ] = None,
    leave_one_out: Annotated[
        bool,
        typer.Option(
            "--leave-one-out",
            help="Predict each position of the MPCs from a map made of the others, by the defaults.",
        ),
    ] = False,
    z_slice: Annotated[
        float | None, typer.Option(help="Keep outline features with this z_slice_m; default the lowest.")
    ] = None,
    min_visible: Annotated[
        float,
        typer.Option(min=0.0, max=1.0, help="Keep outline features with more than this share visible from a receiver."),
    ] = 0.0,
    figure: Annotated[
        Path | None, typer.Option(help="Also draw the map over the outline (.png, .pdf, .svg).", show_default=False)
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Judge a map by a known outline, or by what it predicts."""
    if leave_one_out == (outline is not None):
        raise typer.BadParameter("say what to judge by: either --outline FILE or --leave-one-out")
    if leave_one_out and not mpcs:
        raise typer.BadParameter("--leave-one-out needs the MPCs that the map was made from")
    if leave_one_out and figure:
        raise typer.BadParameter("--figure draws the map over an outline; give --outline FILE")
    require_suffix(figure, ".png", ".pdf", ".svg")
    protect_inputs((figure,), [environment, *(mpcs or []), *([outline] if outline else [])])
    from erm.maps.formats import read_map
    from erm.maps.outline import known_faces

    found = read_map(environment)
    if outline is None:
        _by_prediction(mpcs or [], as_json)
    else:
        truth = known_faces(outline, z_slice=z_slice, min_visible=min_visible, georeference=found.georeference)
        _by_outline(found, truth, mpcs or [], figure, as_json)


def _by_prediction(mpcs: list[Path], as_json: bool) -> None:
    """Leave one position out after the other."""
    from erm.evaluation.leave_one_out import leave_one_out, score
    from erm.evaluation.outline import rounded
    from erm.mpcs.files import read_mpcs

    table, complaints = read_mpcs(mpcs)
    held = score(leave_one_out(table))
    if as_json:
        print(json.dumps(rounded(held, digits=14), indent=2))
    else:
        console.show(["leave one out", "result"], ([HELD[name], f"{value:.3g}"] for name, value in held.items()))
    console.report_failures(complaints)


def _by_outline(
    found: "Environment", truth: "FloatArray", mpcs: list[Path], figure: Path | None, as_json: bool
) -> None:
    """Hold walls, and the reflection points of MPCs, against known faces."""
    from erm.evaluation.completeness import completeness, receivers_of
    from erm.evaluation.outline import evaluate_mpcs, evaluate_walls, rounded
    from erm.mpcs.files import read_mpcs
    from erm.mpcs.selection import select
    from erm.reconstruction.reconstruct import reconstruct

    result: dict[str, Any] = {"walls": evaluate_walls(found, truth)}
    complaints: list[str] = []
    located = None
    if mpcs:
        table, complaints = read_mpcs(mpcs)
        environment, located = reconstruct(select(table))
        result["points"] = evaluate_mpcs(located, environment, truth)
        seen = completeness(found, truth, receivers_of(table))
        result["visible"] = [row._asdict() for row in seen]
    if figure:
        from erm.figures import plot_map

        console.save_figure(plot_map(found, table=located, outline=truth), figure)
    if as_json:
        print(json.dumps(rounded(result), indent=2))
    else:
        _print(result, len(truth))
    console.report_failures(complaints)


def _print(result: Mapping[str, Any], faces: int) -> None:
    walls = result["walls"]
    print(
        f"{console.counted(walls['walls'], 'wall')}, {walls['false']} false; "
        f"on {walls['found']} of {console.counted(faces, 'face')} of the outline, seen by a receiver or not"
    )
    shares = {
        "the length on the map is on a face": walls["correctness"],
        "the outline has a wall": walls["completeness"],
    }
    print("; ".join(f"{_digits(100 * share) or '-'} % of {what}" for what, share in shares.items()))
    errors = {"walls: offset [m]": walls["offset_error"], "walls: angle [degree]": walls["angle_error"]}
    for kind, summaries in result.get("points", {}).items():
        errors |= {f"points, {kind}: {name} [m]": summary for name, summary in summaries.items()}
    errors = {label: row for label, row in errors.items() if row["count"]}
    if errors:
        console.show(
            ["error", *SUMMARY], ([label, *(_digits(row[name]) for name in SUMMARY)] for label, row in errors.items())
        )
    if "visible" in result:
        console.show(
            ["seen by receivers", "outline [m]", "with a wall [%]"],
            (
                [f"{row['receivers']} or more", f"{row['length']:.0f}", _digits(100 * row["share"])]
                for row in result["visible"]
            ),
        )


def _digits(value: float) -> str:
    """Return a count as it is, an error to three significant digits, nothing for NaN."""
    return str(value) if isinstance(value, int) else "" if math.isnan(value) else f"{value:.3g}"
