"""What the page says of the ray-tracing verification."""

from collections.abc import Mapping, Sequence

import numpy as np

from erm.common.page import Page
from erm.figures import plot_error_cdf, plot_sensed_points
from erm.letter import published, room
from erm.letter.captures import Campaign
from erm.letter.methods import COLOURS
from erm.letter.outcome import true_points
from erm.maps.outline import outline_of

BARS = {"mean": 0.005, "rmse": 0.010}  # m, for merged walls
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
        ["from rays: delays on the grid 1/B", "planar reading", "higher order", "points", *HEADS],
        [
            ["the letter, printed", None, None, None, *row],
            *([one.resolution, one.planar, one.higher, *_cells(one)] for one in switched),
        ],
    )
    page.add(_placed(placed), _finer(grids))
    page.table(["grid", "points", *HEADS], [[one.label, *_cells(one)] for one in grids])
    page.add(
        "From captures, for the MPCs of first order that make the map; wanted of ours, merged: mean at most "
        f"{BARS['mean']} m, RMSE at most {BARS['rmse']} m.",
    )
    page.table(
        ["captures", "method", "points", *HEADS, "wanted"],
        [
            [kind, row.label, *_cells(row), _verdict(row) if row is one.rows[-1] else None]
            for kind, one in sensed.items()
            for row in one.rows
        ],
    )
    page.add(
        "How many MPCs make the map, and what keeps the others from it: the same MPCs searched again with one thing "
        "taken away. Without those that no path explains; with standard deviations widened by the RMS error that the "
        "single bounces truly have; as single bounces alone at their true delays and azimuths. The last two columns "
        "tell how many times that RMS error exceeds the standard deviation in the table. Where it is many times, paths "
        "of one wall do not agree within what the table says of them, and the column of standard deviations that hold "
        "tells what that costs."
    )
    page.table(
        [
            "captures",
            "median SNR [dB]",
            "MPCs",
            "single bounces measured",
            "make the map",
            "no single bounces among them",
            "without MPCs of no path",
            "standard deviations that hold",
            "without errors",
            "delay error",
            "azimuth error",
        ],
        [
            [
                kind,
                f"{one.snr:.0f}",
                one.mpcs,
                f"{one.measured} of {one.there}",
                one.accepted,
                one.false,
                one.of_known,
                one.of_honest,
                one.of_exact,
                *(f"{one.excess[name]:.1f} ×" for name in ("delay", "azimuth")),
            ]
            for kind, one in sensed.items()
        ],
    )
    page.add(
        "Why the search left single bounces that were measured, in its own words:\n\n"
        + "\n".join(
            f"- captures {kind}: {', '.join(f'{count} {why}' for why, count in one.left.items()) or 'none left'}"
            for kind, one in sensed.items()
        )
    )


def figures(page: Page, campaign: Campaign, sensed: Mapping[str, room.Sensed]) -> None:
    """Layout with simulated and sensed points, and the CDF of their distances."""
    kind, shown = next(iter(sensed.items()))
    rx = np.array([link.rx[:2] for link in campaign.links])
    tx = np.unique([link.tx[:2] for link in campaign.links], axis=0)
    merged = shown.table["wall_point"].values[:, :2]
    there, count = true_points(campaign), len(merged)
    page.figure(
        "room",
        plot_sensed_points(outline_of(campaign.environment), there, merged, tx=tx, rx=rx),
        f"The L-shaped room in plan: {len(there)} reflection points of the rays (simulated), and {count} of the merged "
        f"walls (sensed) from captures {kind} at {len(rx)} positions of the RX.",
    )
    page.figure(
        "room_cdf",
        plot_error_cdf({row.label: row.error for row in shown.rows}, colours=COLOURS),
        f"Distance between the sensed and the simulated point in plan: the same {count} MPCs by three methods, from "
        f"captures {kind}. The letter prints a mean of 0.02 m and an RMSE of 0.03 m.",
    )


def _alone(switched: Sequence[room.Switched]) -> str:
    rmse = {(one.resolution, one.planar, one.higher): one.statistics["rmse"] for one in switched}
    return (
        "Reflection points sensed from the rays, with each approximation on and off. Without any the equations are "
        f"exact. Alone, delays on the grid of 1/1.2 GHz cost an RMSE of {rmse[True, False, False]:.2f} m, the planar "
        f"reading with antennas at 4 and 2 m {rmse[False, True, False]:.2f} m, rays of second order taken for first "
        f"{rmse[False, False, True]:.2f} m; {published.ROOM_ERRORS['rmse']} m are printed."
    )


def _placed(placed: Mapping[str, Sequence[room.Row]]) -> str:
    """Whether another place of the transmitter would give the printed number."""
    printed = published.ROOM_ERRORS["rmse"]
    rmse = {name: sorted(row.statistics["rmse"] for row in rows) for name, rows in placed.items()}
    under = {name: sum(one <= printed for one in values) for name, values in rmse.items()}
    spans = {name: f"{values[0]:.3f} to {values[-1]:.3f} m ({under[name]} of {len(values)} places at most {printed} m)"
             for name, values in rmse.items()}  # fmt: skip
    return (
        "Where the letter's antennas stood is not printed. With the transmitter at each of the receivers' places in "
        f"turn, the RMSE of delays on the grid of 1/1.2 GHz alone is {spans['resolution']}; that of the planar reading "
        f"alone {spans['planar']}."
    )


def _finer(grids: Sequence[room.Row]) -> str:
    printed = published.ROOM_ERRORS
    nearest = min(grids, key=lambda one: abs(np.log(one.statistics["rmse"] / printed["rmse"])))
    found = nearest.statistics
    return (
        f"With heights and first order alone, delays on a grid of {nearest.label} are enough to make the printed "
        f"numbers in this room: mean {found['mean']:.3f} m (printed {printed['mean']}), RMSE {found['rmse']:.3f} m "
        f"({printed['rmse']}), largest {found['max']:.3f} m ({printed['max']}), {100 * found['small']:.0f} % under "
        f"{room.SMALL} m (85 %):"
    )


def _cells(row: room.Row) -> list[object]:
    found = row.statistics
    small = f"{100 * found['small']:.0f} %"
    return [int(found["count"]), *(found[name] for name in ("min", "max", "mean", "rmse")), small]


def _verdict(row: room.Row) -> str:
    found = row.statistics
    return "holds" if all(found[name] <= bar for name, bar in BARS.items()) else "**missed**"
