"""The effect of a setting is reported with its scatter, a loss with its cause."""

from dataclasses import replace

import numpy as np
import pytest

from erm.letter.outcome import Outcome
from erm.letter.outlook import _describe as describe
from erm.letter.sweeps import Sweep, SweptParameter, completeness_drops, gains
from erm.letter.sweeps import _with_shared as with_shared

PLAIN = Outcome(
    positions=5, snr=30.0, mpcs=50, stray=3, available=20, measured=18, completeness=0.6, of_explained=0.6,
    of_corrected=0.6, of_exact=0.6, excess=1.0, false=0, point_error=0.1, shared_error=0.1, wall_error=0.01,
    wall_corrected=0.01,
)  # fmt: skip
KNOB = SweptParameter("gain", "dB", (1.0, 2.0, 3.0), 1.0, None)


def sweep_of(**fields) -> Sweep:
    """A sweep of three values and three replicates that scatter by 0.01, with fields (value,) of their means."""
    rows = []
    for i in range(3):
        values = {name: means[i] for name, means in fields.items()}
        rows.append(tuple(replace(PLAIN, **{n: v + 0.01 * k for n, v in values.items()}) for k in (-1, 0, 1)))
    return Sweep(KNOB, tuple(rows))


def test_the_best_of_more_effort_is_what_it_brings():
    (gain,) = gains([sweep_of(completeness=[0.5, 0.8, 0.7])], "completeness")
    assert (gain.value, gain.mean) == pytest.approx((2.0, 0.3))
    (gain,) = gains([sweep_of(point_error=[0.4, 0.2, 0.1])], "point_error")
    assert gain.value == 3.0
    assert gain.mean == pytest.approx(4.0, rel=0.05)


def test_a_fall_within_the_scatter_is_none():
    rows = [[0.5, 0.6, 0.7], [0.7, 0.5, 0.55]]
    parameter = SweptParameter("gain", "dB", (1.0, 2.0), 1.0, None)
    one = Sweep(parameter, tuple(tuple(replace(PLAIN, completeness=v) for v in row) for row in rows))
    assert completeness_drops([one]) == []


def test_a_loss_that_corrected_errors_remove_is_attributed_to_them():
    one = sweep_of(completeness=[0.6, 0.6, 0.3], of_explained=[0.6, 0.6, 0.3], of_corrected=[0.6, 0.6, 0.6])
    (step,) = completeness_drops([one])
    assert (step.former, step.later) == (2.0, 3.0)
    assert "There is no loss with corrected standard deviations" in describe(step)
    assert "without the MPCs of no path" not in describe(step).split("There is no loss")[1]


def test_the_shared_error_is_that_of_the_paths_that_every_value_found():
    rows = [[(PLAIN, {("RX", 0): 3.0, ("RX", 1): 9.0})], [(PLAIN, {("RX", 0): 4.0})]]
    (first,), (second,) = with_shared(rows)
    assert (first.shared_error, second.shared_error) == (3.0, 4.0)
    assert np.isnan(with_shared([[(PLAIN, {})]])[0][0].shared_error)
