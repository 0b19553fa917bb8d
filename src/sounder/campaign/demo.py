"""Demo: the campaign of the letter is simulated, processed from its files, reconstructed and scored."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from erm.common import console
from erm.common.errors import DataError
from erm.evaluation.evaluate_map import evaluate_map
from erm.evaluation.outline import evaluate_walls, face_hits, on_walls, point_errors, summary
from erm.figures import plot_error_cdf, plot_map
from erm.geometry.vertical import reflection_point
from erm.maps.environment import Environment
from erm.maps.formats import read_map, write_map
from erm.maps.outline import outline_of
from erm.mpcs.files import read_mpcs
from erm.mpcs.selection import select
from erm.mpcs.table import path_length
from erm.reconstruction.make_map import make_map
from sounder import shipped
from sounder.campaign.result import REPORT
from sounder.figures.files import draw_overlay, draw_product
from sounder.processing.jobs import gather
from sounder.processing.pipeline import process
from sounder.report.of_products import contents_of_map
from sounder.report.page import write_page
from sounder.twin.scene import load_scene
from sounder.twin.simulate import simulate

OVERLAID = (("RX2_L", "RX9_L"), ("RX2_N", "RX3_N"))
"""Pairs of positions whose DAPS the letter shows in one diagram."""
SPATIAL, PLANAR = "3-D (with heights)", "planar (as published)"
"""The two methods whose reflection points are compared, as the figure labels them."""


def run_demo(out: Path, *, scene: Path | None = None) -> dict[str, float]:
    """Simulate the campaign, process it, reconstruct the map, write the page and print the score.

    Parameters
    ----------
    out : Path
        Folder for raw recordings, truth, products, map, page and figures.
    scene : Path, optional
        Another scene. Default: that of the letter.

    Returns
    -------
    dict
        Score: ``walls``, ``false``, ``found``, ``missed`` (of the walls that at least three accepted MPCs hit), and
        the perpendicular RMSE of the RPs, ``rmse`` and ``planar_rmse`` [m].

    Raises
    ------
    DataError
        A position could not be processed, or the folder cannot be written to.
    """
    loaded = load_scene(scene or shipped.scene("uma.toml"))
    with console.progress("simulating positions", len(loaded.receivers)) as advance:
        recordings = simulate(loaded, out, progress=advance)
    jobs, failures = gather(recordings, calibration=out / "back-to-back.h5")
    with console.progress("processing positions", len(jobs)) as advance:
        outcome = process(jobs, out / "products", progress=advance)
    if failures or outcome.failures:
        raise DataError("; ".join(failures + outcome.failures))
    table, problems = read_mpcs(outcome.products)
    environment, located = make_map(table, history="sounder demo", inputs=outcome.products)
    write_map(environment, out / "map.geojson")
    truth = read_map(out / "truth" / "environment.geojson")
    score = score_map(environment, select(table), located, truth)
    with console.progress("drawing", len(OVERLAID) + 2) as advance:
        _draw(environment, located, truth, outcome.products, out / "figures", advance=advance)
    contents = contents_of_map(
        outcome.products, "sounder demo", "sounder demo from simulated captures", table, environment, located
    )
    outline = outline_of(truth)
    contents = replace(
        contents,
        outline=outline,
        score=evaluate_map(environment, outline, (environment, located)),
        files=["map.geojson", "figures/map.png", "truth/environment.geojson"],
        calibrations=[jobs[0].b2b],
    )
    write_page(contents, out / REPORT)
    _print(score, out, positions=len(recordings), mpcs=table.sizes["mpc"])
    console.report_failures(problems)
    return score


def score_map(
    environment: Environment, selected: xr.Dataset, located: xr.Dataset, truth: Environment
) -> dict[str, float]:
    """Score a map and its reflection points against the simulated environment.

    A wall can be found if at least three of the ``selected`` MPCs have their reflection point within half a metre of
    it.
    """
    outline = outline_of(truth)
    accepted = on_walls(located, environment)
    single = selected["reflection_point"].values[selected["accepted"].values]
    hits = face_hits(single, outline, tolerance=0.5)
    walls = evaluate_walls(environment, outline, hits)
    rmse = {kind: summary(errors)["rmse"] for kind, errors in _errors(accepted, outline).items()}
    return {
        **{name: walls[name] for name in ("walls", "false", "found", "missed")},
        "accepted": accepted.sizes["mpc"],
        "rmse": rmse[SPATIAL],
        "planar_rmse": rmse[PLANAR],
    }


def _errors(accepted: xr.Dataset, outline: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """Perpendicular errors of the reflection points of the same MPCs, by both methods [m]."""
    ends = accepted["tx_position"].values, accepted["rx_position"].values
    planar, _ = reflection_point(*ends, path_length(accepted), accepted["azimuth"].values, planar=True)
    return {
        SPATIAL: point_errors(accepted["reflection_point"].values, outline).perpendicular,
        PLANAR: point_errors(planar, outline).perpendicular,
    }


@console.drawing()
def _draw(
    environment: Environment,
    located: xr.Dataset,
    truth: Environment,
    products: list[Path],
    out: Path,
    *,
    advance: Callable[[], None],
) -> None:
    """Draw the map, the CDF of errors, the pairs of DAPS that the letter shows, and the figures of one position."""
    outline = outline_of(truth)
    console.save_figure(plot_map(environment, table=located, outline=outline, annotated=True), out / "map.png")
    accepted = on_walls(located, environment)
    console.save_figure(plot_error_cdf(_errors(accepted, outline)), out / "error_cdf.png")
    advance()
    made = {product.stem: product for product in products}
    for first, second in OVERLAID:
        if first in made and second in made:
            draw_overlay(made[first], made[second], out)
        advance()
    draw_product(products[0], out)
    advance()


def _print(score: dict[str, float], out: Path, *, positions: int, mpcs: int) -> None:
    wanted = score["found"] + score["missed"]
    rows = [
        ("positions", positions),
        ("MPCs", mpcs),
        ("accepted as single wall bounces", score["accepted"]),
        ("walls in the map", score["walls"]),
        ("false walls", score["false"]),
        ("walls hit by three or more accepted MPCs, found", f"{score['found']} of {wanted}"),
        ("RP perpendicular error, RMSE", f"{score['rmse']:.3f} m"),
        ("the same by the planar equations of the letter", f"{score['planar_rmse']:.3f} m"),
    ]
    console.show(["demo", "result"], rows)
    print(f"map: {out / 'figures' / 'map.png'}")
    print(f"report: {out / REPORT}")
