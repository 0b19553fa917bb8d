"""Section of the page on the ray-tracing verification."""

from collections.abc import Mapping, Sequence

import numpy as np

from erm.common.page import Page
from erm.figures import plot_error_cdf, plot_sensed_points
from erm.letter import published, room
from erm.letter.captures import Campaign
from erm.letter.methods import COLOURS
from erm.letter.outcome import true_points
from erm.maps.outline import outline_of

TARGETS = {"mean": 0.005, "rmse": 0.010}  # m; of merged walls. Targets of the study
HEADS = ["min [m]", "max [m]", "mean [m]", "RMSE [m]", f"under {room.SMALL} m"]


def ray_tracing(
    page: Page,
    switched: Sequence[room.Switched],
    grids: Sequence[room.Row],
    placed: Mapping[str, Sequence[room.Row]],
    sensed: Mapping[str, room.Sensed],
) -> None:
    """Fig. 2: the L-shaped room."""
    page.add("## Ray-tracing verification (Fig. 2)", _alone(switched))
    printed = published.ROOM_ERRORS
    row = [printed["min"], printed["max"], printed["mean"], printed["rmse"], f"{100 * printed['small']:.0f} %"]
    page.table(
        ["from rays: delays on the grid 1/B", "planar equations", "higher order", "points", *HEADS],
        [
            ["the letter, printed", None, None, None, *row],
            *([one.resolution, one.planar, one.higher, *_cells(one)] for one in switched),
        ],
    )
    page.add(_placed(placed), _finer(grids))
    page.table(["grid", "points", *HEADS], [[one.label, *_cells(one)] for one in grids])
    page.add(
        "From captures, for the MPCs of first order on the map. Targets of our merged walls: mean at most "
        f"{TARGETS['mean']} m, RMSE at most {TARGETS['rmse']} m.",
    )
    page.table(
        ["captures", "method", "points", *HEADS, "target"],
        [
            [kind, row.label, *_cells(row), _verdict(row) if row is one.rows[-1] else None]
            for kind, one in sensed.items()
            for row in one.rows
        ],
    )
    page.add(
        "The number of MPCs on the map, and what keeps the others off it. The same MPCs are reconstructed again with "
        "one cause removed: without the MPCs that no path explains; with standard deviations widened by the true RMS "
        "error of the single bounces; with the single bounces alone at their true delays and azimuths. The last two "
        "columns are this RMS error over the standard deviation in the table. Where the ratio is large, paths of one "
        "wall do not agree within their standard deviations; the column *corrected standard deviations* shows the cost."
    )
    page.table(
        [
            "captures",
            "median SNR [dB]",
            "MPCs",
            "single bounces measured",
            "on the map",
            "of these no single bounces",
            "without MPCs of no path",
            "corrected standard deviations",
            "without errors",
            "delay error / std",
            "azimuth error / std",
        ],
        [
            [
                kind,
                f"{one.snr:.0f}",
                one.mpcs,
                f"{one.measured} of {one.available}",
                one.accepted,
                one.false,
                one.of_explained,
                one.of_corrected,
                one.of_exact,
                *(f"{one.excess[name]:.1f} ×" for name in ("delay", "azimuth")),
            ]
            for kind, one in sensed.items()
        ],
    )
    page.add(
        "Why measured single bounces are not on the map:\n\n"
        + "\n".join(
            f"- captures {kind}: {', '.join(f'{count} {why}' for why, count in one.rejected.items()) or 'all are'}"
            for kind, one in sensed.items()
        )
    )


def figures(page: Page, campaign: Campaign, sensed: Mapping[str, room.Sensed]) -> None:
    """Layout with simulated and sensed points, and the CDF of their distances."""
    kind, shown = next(iter(sensed.items()))
    rx = np.array([link.rx[:2] for link in campaign.links])
    tx = np.unique([link.tx[:2] for link in campaign.links], axis=0)
    merged = shown.table["wall_point"].values[:, :2]
    true, count = true_points(campaign), len(merged)
    page.figure(
        "room",
        plot_sensed_points(outline_of(campaign.environment), true, merged, tx=tx, rx=rx),
        f"The L-shaped room in plan: {len(true)} reflection points of the rays (simulated), and {count} of the merged "
        f"walls (sensed) from captures {kind} at {len(rx)} positions of the RX.",
    )
    page.figure(
        "room_cdf",
        plot_error_cdf({row.label: row.error for row in shown.rows}, colours=COLOURS),
        f"Horizontal distance between the sensed and the simulated point: the same {count} MPCs by three methods, from "
        f"captures {kind}. The letter prints a mean of 0.02 m and an RMSE of 0.03 m.",
    )


def _alone(switched: Sequence[room.Switched]) -> str:
    rmse = {(one.resolution, one.planar, one.higher): one.statistics["rmse"] for one in switched}
    return (
        "Reflection points sensed from the rays, with each approximation on and off. With all of them off, the "
        f"equations are exact. The RMSE is {rmse[True, False, False]:.2f} m with delays on the grid of 1/1.2 GHz "
        f"alone, {rmse[False, True, False]:.2f} m with the planar equations alone (antennas at 4 and 2 m), and "
        f"{rmse[False, False, True]:.2f} m with rays of second order used as first order alone. The letter prints "
        f"{published.ROOM_ERRORS['rmse']} m."
    )


def _placed(placed: Mapping[str, Sequence[room.Row]]) -> str:
    """Errors for other places of the transmitter."""
    printed = published.ROOM_ERRORS["rmse"]
    rmse = {name: sorted(row.statistics["rmse"] for row in rows) for name, rows in placed.items()}
    under = {name: sum(one <= printed for one in values) for name, values in rmse.items()}
    spans = {name: f"{values[0]:.3f} to {values[-1]:.3f} m ({under[name]} of {len(values)} places at most {printed} m)"
             for name, values in rmse.items()}  # fmt: skip
    return (
        "The places of the letter's antennas are not printed. With the transmitter at the place of each receiver in "
        f"turn, the RMSE of delays on the grid of 1/1.2 GHz alone is {spans['resolution']}; that of the planar "
        f"equations alone is {spans['planar']}."
    )


def _finer(grids: Sequence[room.Row]) -> str:
    printed = published.ROOM_ERRORS
    nearest = min(grids, key=lambda one: abs(np.log(one.statistics["rmse"] / printed["rmse"])))
    found = nearest.statistics
    return (
        f"With heights and first order alone, delays on a grid of {nearest.label} give the printed numbers in this "
        f"room: mean {found['mean']:.3f} m (printed {printed['mean']}), RMSE {found['rmse']:.3f} m "
        f"({printed['rmse']}), largest {found['max']:.3f} m ({printed['max']}), {100 * found['small']:.0f} % under "
        f"{room.SMALL} m (85 %):"
    )


def _cells(row: room.Row) -> list[object]:
    found = row.statistics
    small = f"{100 * found['small']:.0f} %"
    return [int(found["count"]), *(found[name] for name in ("min", "max", "mean", "rmse")), small]


def _verdict(row: room.Row) -> str:
    found = row.statistics
    return "holds" if all(found[name] <= bar for name, bar in TARGETS.items()) else "**missed**"
