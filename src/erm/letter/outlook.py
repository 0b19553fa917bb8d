"""Sections of the page on the letter's future work and motivation: sweeps and prediction."""

from collections.abc import Sequence

from erm.common.page import Page
from erm.letter.figures import plot_predictions, plot_sweeps
from erm.letter.outcome import ON_WALL
from erm.letter.prediction import SHIFT, Predicted
from erm.letter.replicates import SIGNIFICANT, is_significant, mean, with_error
from erm.letter.sweeps import SPACING, CompletenessDrop, Gain, Sweep, completeness_drops, gains

MEASURES = {"completeness": "completeness", "point_error": "RP error", "wall_error": "wall error"}

EXPERIMENTS = {
    "of_explained": "without the MPCs of no path",
    "of_corrected": "with corrected standard deviations",
    "of_exact": "with the single bounces alone and without errors",
}
"""Experiments of `erm.letter.ablation`, as the page names them."""


def future_work(page: Page, sweeps: Sequence[Sweep]) -> None:
    """Sweeps of positions and instrument."""
    usual, replicates = sweeps[0].outcomes[sweeps[0].usual], len(sweeps[0].outcomes[0])
    page.add(
        "## Future work: denser positions, finer rotation, better instruments",
        "Routes 1 and 3 are straight lines here. They are measured again with complete captures, with one setting "
        f"changed at a time; the other settings are the letter's, with positions every {SPACING:g} m. Each value is "
        f"measured {replicates} times with shifted positions; ± is the standard error of the mean. Completeness is the "
        "share of the true reflection points of the densest positions that lie within "
        f"{ON_WALL} m of a wall of the map. The RP error is the horizontal RMSE of the points of single MPCs. The wall "
        "error is the RMSE of merged points across their face. Counts are means.",
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
            "RP error of paths found with every value [m]",
            "wall error [m]",
        ],
        [
            [
                one.parameter.name,
                f"{value:g} {one.parameter.unit}",
                *(f"{mean([getattr(o, name) for o in row]):.0f}" for name in ("positions", "snr", "mpcs", "stray")),
                f"{mean([o.measured for o in row]):.0f} of {mean([o.available for o in row]):.0f}",
                with_error([o.completeness for o in row], percent=True),
                f"{mean([o.false for o in row]):.1f}",
                *(
                    with_error([getattr(o, name) for o in row])
                    for name in ("point_error", "shared_error", "wall_error")
                ),
            ]
            for one in sweeps
            for value, row in zip(one.parameter.values, one.outcomes, strict=True)
        ],
    )
    page.figure(
        "sweeps",
        plot_sweeps(sweeps),
        f"Completeness, RP error and wall error for {len(sweeps)} settings, "
        f"{sum(len(one.outcomes) for one in sweeps)} values, {replicates} runs each, with standard errors. The "
        "vertical dotted line is the letter's value, with "
        f"{' or '.join(str(n) for n in sorted({o.positions for o in usual}))} positions. "
        "Effort grows to the right. Dashed and dotted curves: the experiments below.",
    )
    page.add(
        "\n".join(f"- {_best_gain(sweeps, field, name)}" for field, name in MEASURES.items()).join(
            ("**What improves the map most**, beyond the letter's settings:\n\n", "")
        )
    )
    _why(page, sweeps)


def _why(page: Page, sweeps: Sequence[Sweep]) -> None:
    """Experiments that show why a map is incomplete."""
    page.add(
        "**Why more effort can give a worse map.** The same MPCs are reconstructed again with one cause of errors "
        "removed: without the MPCs that no path explains (residues of stronger ones, and paths that were not "
        "separated); with standard deviations widened by the true RMS error of the single bounces; and with the single "
        "bounces alone at their true delays and azimuths. The last column is the RMS error of the single bounces over "
        "the standard deviation in their table, of delay or azimuth, whichever is larger. RP errors do not depend on "
        "the reconstruction: where those of the paths found with every value rise too, the MPCs themselves are worse. "
        "A beam narrower than the step of the scan leaves gaps; *HPBW = step* changes both.",
    )
    page.table(
        [
            "setting",
            "value",
            "completeness",
            *EXPERIMENTS.values(),
            "wall error [m]",
            EXPERIMENTS["of_corrected"],
            "error over its standard deviation",
        ],
        [
            [
                one.parameter.name,
                f"{value:g} {one.parameter.unit}",
                *(with_error([getattr(o, f) for o in row], percent=True) for f in ("completeness", *EXPERIMENTS)),
                *(with_error([getattr(o, f) for o in row]) for f in ("wall_error", "wall_corrected")),
                f"{mean([o.excess for o in row]):.1f}",
            ]
            for one in sweeps
            for value, row in zip(one.parameter.values, one.outcomes, strict=True)
        ],
    )
    found = completeness_drops(sweeps)
    if not found:
        page.add(
            f"No step of more effort lowers completeness by more than {SIGNIFICANT:g} standard errors: the falls in "
            "the figure are scatter."
        )
        return
    page.add(
        f"These steps of more effort lower completeness by more than {SIGNIFICANT:g} standard errors. Each line shows "
        "the loss, and the loss with each cause removed. All other falls in the figure are scatter.\n\n"
        + "\n".join(f"- {_describe(step)}" for step in found)
    )


def _describe(step: CompletenessDrop) -> str:
    lost = step.lost["completeness"]
    gone = [words for field, words in EXPERIMENTS.items() if not _remains(step.lost[field])]
    values = ", ".join(
        f"{100 * step.lost[f][0]:+.0f} ± {100 * step.lost[f][1]:.0f} {words}" for f, words in EXPERIMENTS.items()
    )
    end = f"There is no loss {_listed(gone)}." if gone else "The loss remains in all of these: less was measured."
    return (
        f"{step.parameter.name} from {step.former:g} to {step.later:g} {step.parameter.unit}: {100 * lost[0]:+.0f} ± "
        f"{100 * lost[1]:.0f} percentage points; {values}. {end}"
    )


def _remains(step: tuple[float, float]) -> bool:
    return step[0] < 0 and is_significant(step)


def _best_gain(sweeps: Sequence[Sweep], field: str, name: str) -> str:
    first, *others = gains(sweeps, field)
    level = 0.0 if field == "completeness" else 1.0
    if first.mean <= level:
        return f"{name}: no setting improves it."
    rivals = [
        one.parameter.name
        for one in others
        if not is_significant((first.mean - one.mean, (first.error**2 + one.error**2) ** 0.5))
    ]
    tie = f" (within its error the same as {_listed(rivals)})" if rivals else ""
    return (
        f"{name}: **{first.parameter.name}** of {first.value:g} {first.parameter.unit}, {_brought(first, field)}{tie}."
    )


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
        f"paths, up to two bounces, at {positions} positions of a route {SHIFT[0]:g} m further east that was not "
        "measured. A predicted path within 1 ns and 3° of a true one counts as that path. Each number of positions is "
        f"tried with {most} choices of positions along the route; ± is the standard error. The prediction is repeated "
        "with the map's walls cut back to where a face truly stands on the ground. The false power that this removes "
        "came from walls that reach over openings. (The walls of a map go down to the ground.)",
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
        f"positions, against the number of positions of the map ({sum(len(one.replicates) for one in predictions)} "
        "maps), with standard errors.",
    )
