"""What the page says of the letter's future work and of its motivation: sweeps, and prediction."""

from collections.abc import Sequence

from erm.common.page import Page
from erm.letter.figures import plot_predictions, plot_sweeps
from erm.letter.outcome import ON_WALL
from erm.letter.prediction import ASIDE, Predicted
from erm.letter.replicates import CLEAR, is_clear, mean, with_error
from erm.letter.sweeps import SPACING, Gain, Setback, Sweep, gains, setbacks

MEASURES = {"completeness": "completeness", "point_error": "the RP error", "wall_error": "the wall error"}

LADDER = {
    "of_known": "without the MPCs of no path",
    "of_honest": "with standard deviations that hold",
    "of_exact": "with the single bounces alone and without errors",
}
"""Switches of `erm.letter.ablation`, in words."""


def future_work(page: Page, sweeps: Sequence[Sweep]) -> None:
    """Sweeps of positions and instrument."""
    usual, replicates = sweeps[0].outcomes[sweeps[0].usual], len(sweeps[0].outcomes[0])
    page.add(
        "## Future work: denser positions, finer rotation, better instruments",
        "Routes 1 and 3 as straight lines, measured again through full captures with one setting changed at a time; "
        f"the others stay as the letter has them, with positions every {SPACING:g} m. Every setting is "
        f"measured {replicates} times, with positions that begin further along: ± is the standard error of the mean. "
        "Completeness is the share of the true reflection points of the densest positions that lie within "
        f"{ON_WALL} m of a wall of the map; the RP error is the RMSE in plan of single MPCs' points to the true ones; "
        "the wall error is that of merged points across their face. Counts are means.",
    )
    page.table(
        [
            "setting",
            "value",
            "positions",
            "median SNR [dB]",
            "MPCs",
            "of no path",
            "single bounces measured",
            "completeness",
            "false walls",
            "RP error [m]",
            "of paths that every value found [m]",
            "wall error [m]",
        ],
        [
            [
                one.knob.name,
                f"{value:g} {one.knob.unit}",
                *(f"{mean([getattr(o, name) for o in row]):.0f}" for name in ("positions", "snr", "mpcs", "stray")),
                f"{mean([o.measured for o in row]):.0f} of {mean([o.there for o in row]):.0f}",
                with_error([o.completeness for o in row], percent=True),
                f"{mean([o.false for o in row]):.1f}",
                *(
                    with_error([getattr(o, name) for o in row])
                    for name in ("point_error", "shared_error", "wall_error")
                ),
            ]
            for one in sweeps
            for value, row in zip(one.knob.values, one.outcomes, strict=True)
        ],
    )
    page.figure(
        "sweeps",
        plot_sweeps(sweeps),
        f"Completeness, RP error and wall error over {len(sweeps)} settings, "
        f"{sum(len(one.outcomes) for one in sweeps)} values, {replicates} runs each, with standard errors; dotted: the "
        f"letter's, with {' or '.join(str(n) for n in sorted({o.positions for o in usual}))} positions. Effort grows "
        "to the right. Dashed and dotted: the experiments below.",
    )
    page.add(
        "\n".join(f"- {_pays(sweeps, field, name)}" for field, name in MEASURES.items()).join(
            ("**What pays most**, beyond the letter's settings:\n\n", "")
        )
    )
    _why(page, sweeps)


def _why(page: Page, sweeps: Sequence[Sweep]) -> None:
    """Experiments that tell what a setting's map lacks."""
    page.add(
        "**Why more effort can bring less.** The same MPCs are searched again with one thing taken away: without those "
        "that no path explains (remainders of stronger ones, and paths that were not told apart); with standard "
        "deviations widened by the RMS error that the single bounces truly have; and as single bounces alone at their "
        "true delays and azimuths. The last column tells how many times the RMS error of the single bounces exceeds "
        "the standard deviation that their table gives them, in delay or azimuth, whichever is worse. RP errors do not "
        "hang on the search: where those of the paths that every value found rise too, the MPCs themselves are worse. "
        "A beam narrower than the step of the scan leaves gaps; *HPBW = step* turns both.",
    )
    page.table(
        [
            "setting",
            "value",
            "completeness",
            *LADDER.values(),
            "wall error [m]",
            LADDER["of_honest"],
            "error over its standard deviation",
        ],
        [
            [
                one.knob.name,
                f"{value:g} {one.knob.unit}",
                *(with_error([getattr(o, f) for o in row], percent=True) for f in ("completeness", *LADDER)),
                *(with_error([getattr(o, f) for o in row]) for f in ("wall_error", "wall_honest")),
                f"{mean([o.excess for o in row]):.1f}",
            ]
            for one in sweeps
            for value, row in zip(one.knob.values, one.outcomes, strict=True)
        ],
    )
    found = setbacks(sweeps)
    if not found:
        page.add(
            f"No step of more effort costs completeness by more than {CLEAR:g} standard errors: what falls in the "
            "figure is scatter."
        )
        return
    page.add(
        f"Steps of more effort that cost completeness by more than {CLEAR:g} standard errors, and what becomes of "
        "the loss with each thing taken away; all other falls in the figure are scatter.\n\n"
        + "\n".join(f"- {_told(step)}" for step in found)
    )


def _told(step: Setback) -> str:
    lost = step.lost["completeness"]
    gone = [words for field, words in LADDER.items() if not _remains(step.lost[field])]
    values = ", ".join(
        f"{100 * step.lost[f][0]:+.0f} ± {100 * step.lost[f][1]:.0f} {words}" for f, words in LADDER.items()
    )
    end = f"It is gone {_listed(gone)}." if gone else "None of these brings it back: less was measured."
    return (
        f"{step.knob.name} from {step.former:g} to {step.later:g} {step.knob.unit}: {100 * lost[0]:+.0f} ± "
        f"{100 * lost[1]:.0f} percentage points; {values}. {end}"
    )


def _remains(step: tuple[float, float]) -> bool:
    return step[0] < 0 and is_clear(step)


def _pays(sweeps: Sequence[Sweep], field: str, name: str) -> str:
    first, *others = gains(sweeps, field)
    level = 0.0 if field == "completeness" else 1.0
    if first.mean <= level:
        return f"{name}: nothing of these brings more."
    rivals = [
        one.knob.name for one in others if not is_clear((first.mean - one.mean, (first.error**2 + one.error**2) ** 0.5))
    ]
    tie = f", which its error does not tell from {_listed(rivals)}" if rivals else ""
    return f"{name}: **{first.knob.name}** of {first.value:g} {first.knob.unit}, {_brought(first, field)}{tie}."


def _listed(names: Sequence[str]) -> str:
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def _brought(gain: Gain, field: str) -> str:
    if field == "completeness":
        return f"{100 * gain.mean:+.0f} ± {100 * gain.error:.0f} percentage points"
    return f"{gain.mean:.1f} ± {gain.error:.1f} times smaller"


def motivation(page: Page, predictions: Sequence[Predicted], positions: int) -> None:
    """Prediction of the channel along a new route."""
    most = max(len(one.replicates) for one in predictions)
    page.add(
        "## Why it matters: predicting the channel",
        f"Maps of {predictions[0].positions} to {predictions[-1].positions} positions on route 1 predict the reflected "
        f"paths, up to two bounces, at {positions} positions of a route {ASIDE[0]:g} m further east that nobody "
        "measured. A predicted path within 1 ns and 3° of a true one is that path. Every number of positions is tried "
        f"with {most} choices of them, spread over the route; ± is the standard error. What is predicted falsely is "
        "tried again with the map's walls cut back to where a face truly stands on the ground: what that takes away "
        "came off walls that reach over openings. (A map's walls go down to the ground.)",
    )
    page.table(
        [
            "positions",
            "reflectors",
            "true power predicted",
            "false power",
            "false, walls cut back",
            "RMS error of the reflected power [dB]",
        ],
        [
            [
                one.positions,
                f"{mean(one.of('walls')):.1f}",
                *(with_error(one.of(field), percent=True) for field in ("power", "false", "false_cut")),
                with_error(one.of("level")),
            ]
            for one in predictions
        ],
    )
    page.figure(
        "prediction",
        plot_predictions(predictions),
        f"Share of the reflected power that is predicted, and the RMS error of its sum over {positions} new "
        f"positions, against the positions behind the map ({sum(len(one.replicates) for one in predictions)} maps), "
        "with standard errors.",
    )
