"""What the page says of the letter's future work and of its motivation: sweeps, and prediction."""

from collections.abc import Sequence

from erm.letter.page import Page
from erm.letter.prediction import ASIDE, Prediction
from erm.letter.sweeps import ON_WALL, Sweep, gains
from erm.study_figures import plot_predictions, plot_sweeps


def future_work(page: Page, sweeps: Sequence[Sweep]) -> None:
    """Sweeps of positions and instrument."""
    usual = sweeps[0].at_usual()
    page.add(
        "## Future work: denser positions, finer rotation, better instruments",
        "Routes 1 and 3 as straight lines, measured again through full captures with one setting changed at a time; "
        f"the others stay as the letter has them, with positions every {sweeps[0].knob.usual:g} m. Completeness is "
        f"the share of the true reflection points of the densest positions that lie within {ON_WALL} m of a wall of "
        "the map; the RP error is the RMSE in plan of single MPCs' points to the true ones; the wall error is that "
        "of merged points across their face.",
    )
    page.table(
        [
            "setting",
            "value",
            "positions",
            "median SNR [dB]",
            "MPCs",
            "of no path",
            "completeness",
            "false walls",
            "RP error [m]",
            "wall error [m]",
        ],
        [
            [
                one.knob.name,
                f"{o.value:g} {one.knob.unit}",
                o.positions,
                f"{o.snr:.0f}",
                o.mpcs,
                o.stray,
                f"{100 * o.completeness:.0f} %",
                o.false,
                o.point_error,
                o.wall_error,
            ]
            for one in sweeps
            for o in one.outcomes
        ],
    )
    page.figure(
        "sweeps",
        plot_sweeps(sweeps),
        f"Completeness, RP error and wall error over {len(sweeps)} settings, "
        f"{sum(len(one.outcomes) for one in sweeps)} values; dotted: the letter's, with {usual.positions} positions. "
        "Effort grows to the right.",
    )
    page.add(
        _what_pays(sweeps),
        "MPCs of no path are remainders of stronger ones and paths that were not told apart. Where a setting adds "
        "more of them than of true ones, as a scan in steps of a quarter of the beam does, walls can be lost "
        "although every single MPC is located better.",
    )


def motivation(page: Page, predictions: Sequence[Prediction], positions: int) -> None:
    """Prediction of the channel along a new route."""
    page.add(
        "## Why it matters: predicting the channel",
        f"Maps of 3 to {predictions[-1].positions} positions on route 1 predict the reflected paths, up to two "
        f"bounces, at {positions} positions of a route {ASIDE[0]:g} m further east that nobody measured. A predicted "
        "path within 1 ns and 3° of a true one is that path. A predicted path that is false is one off a wall of the "
        "map that reaches over an opening: reflection points on one line with up to 15 m between them count as one "
        "wall, unless a path is known to pass between them.",
    )
    page.table(
        ["positions", "reflectors", "true power predicted", "false power", "RMS error of the reflected power [dB]"],
        [
            [one.positions, one.walls, f"{100 * one.power:.0f} %", f"{100 * one.false:.0f} %", one.level]
            for one in predictions
        ],
    )
    page.figure(
        "prediction",
        plot_predictions(predictions),
        f"Share of the reflected power that is predicted, and the RMS error of its sum over {positions} new "
        f"positions, against the positions behind the map ({len(predictions)} maps).",
    )


def _what_pays(sweeps: Sequence[Sweep]) -> str:
    brought = gains(sweeps)
    most = {name: max(brought, key=lambda knob: brought[knob][name]) for name in next(iter(brought.values()))}
    return (
        f"**What pays most**, beyond the letter's settings: for completeness {most['completeness']} "
        f"({100 * brought[most['completeness']]['completeness']:+.0f} percentage points); for the RP error "
        f"{most['point_error']} ({brought[most['point_error']]['point_error']:.1f} times smaller); for the wall error "
        f"{most['wall_error']} ({brought[most['wall_error']]['wall_error']:.1f} times smaller). Every value is one run "
        "with other MPCs in reach of each other: where a column does not rise or fall throughout its steps are "
        "scatter, and factors under 2 say little. More SNR or a finer scan also brings weak paths of several bounces "
        "and what sidelobes leave of others, which the search must tell from walls; that can cost completeness."
    )
