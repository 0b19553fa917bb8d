"""Curves show what they are given: distributions of errors, and means with their standard errors."""

import dataclasses
from itertools import pairwise

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.colors import to_hex

from erm.figures import plot_error_cdf
from erm.letter.figures import plot_predictions, plot_sweeps
from erm.letter.outcome import Outcome
from erm.letter.prediction import Predicted, Prediction
from erm.letter.sweeps import SWEPT_PARAMETERS, Sweep


@pytest.fixture(autouse=True)
def closed():
    yield
    plt.close("all")


def test_the_error_curve_climbs_from_nothing_to_all():
    axes = plot_error_cdf({"here": [0.3, 0.1, 0.2], "nothing": []})
    x, y = axes.lines[0].get_data()
    np.testing.assert_allclose(x, [0.1, 0.1, 0.2, 0.3])  # no zero: the axis may be logarithmic
    np.testing.assert_allclose(y, [0, 1 / 3, 2 / 3, 1])
    assert axes.get_xlabel() == "Error (m)"
    assert "n = 3, RMSE 0.22 m" in axes.get_legend().get_texts()[0].get_text()


def test_curves_of_unlike_size_share_a_logarithmic_axis():
    assert plot_error_cdf({"fine": [0.001, 0.002], "coarse": [1.0, 2.0]}).get_xscale() == "log"
    assert plot_error_cdf({"here": [0.1, 0.2], "there": [1.0, 2.0]}).get_xscale() == "linear"


def test_a_curve_keeps_the_colour_it_is_given():
    axes = plot_error_cdf({"first": [0.1, 0.2], "ours": [0.1, 0.3]}, colours={"ours": "#123456"})
    assert to_hex(axes.lines[1].get_color()) == "#123456"


def test_a_prediction_stands_at_its_mean_with_its_standard_error():
    made = [Prediction(5, power, 0.0, 0.0, 3.0) for power in (0.2, 0.4, 0.6)]
    left, right = plot_predictions([Predicted(4, tuple(made)), Predicted(9, (made[2],))]).axes
    curve, _, (bars,) = left.containers[0].lines
    assert curve.get_ydata() == pytest.approx([0.4, 0.6])
    low, high = bars.get_segments()[0][:, 1]
    assert (high - low) / 2 == pytest.approx(0.2 / np.sqrt(3))  # s = 0.2, n = 3
    assert right.get_ylabel() == "RMS error of the power (dB)"


@pytest.mark.slow
def test_sweeps_fit_a_page_and_their_names_do_not_meet():
    rng = np.random.default_rng(5)
    fields = [field.name for field in dataclasses.fields(Outcome)]
    made = [
        [[Outcome(**dict.fromkeys(fields, rng.random())) for _ in range(3)] for _ in parameter.values]
        for parameter in SWEPT_PARAMETERS
    ]
    figure = plot_sweeps(
        [Sweep(parameter, tuple(map(tuple, rows))) for parameter, rows in zip(SWEPT_PARAMETERS, made, strict=True)]
    )
    width, height = figure.get_size_inches()
    assert width < height < 12  # upright; A4 is 11.7 high
    figure.canvas.draw()
    boxes = [axes.get_legend().get_window_extent() for axes in figure.axes if axes.get_legend()]
    assert len(boxes) == 3
    assert all(left.x1 < right.x0 for left, right in pairwise(boxes))
    assert not any(a.get_tightbbox().overlaps(b.get_window_extent()) for a, b in pairwise(figure.axes[3:]))
