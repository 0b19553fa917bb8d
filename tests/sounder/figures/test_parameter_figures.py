"""Figures of channel parameters: what they draw is what the numbers say."""

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

from sounder.figures.parameters import cdf_page, parameter_cdf, path_loss
from sounder.parameters.statistics import campaign_statistics


@pytest.fixture
def parameters() -> xr.Dataset:
    distance = np.array([10.0, 20.0, 40.0, 80.0])
    table = xr.Dataset({"distance": ("position", distance), "path_loss": ("position", 70 + 20 * np.log10(distance))})
    table["path_loss_std"] = ("position", [0.5, 0.5, np.nan, 40.0])
    table["coherence_bandwidth"] = ("position", [3e6, np.inf, 1e6, np.nan])
    table["frequency"], table["los"] = ("position", [132e9] * 4), ("position", [1, 1, 1, 1])
    return table


def test_the_fit_goes_through_positions_on_a_line(parameters):
    ax = path_loss(parameters, campaign_statistics(parameters), Figure().add_subplot())
    (fit,) = [line for line in ax.lines if str(line.get_label()).startswith("LoS, floating")]
    assert "β = 2.00" in fit.get_label()
    np.testing.assert_allclose(fit.get_ydata(), 70 + 20 * np.log10(fit.get_xdata()), atol=1e-6)
    assert np.ptp(ax.get_ylim()) < 40  # the error of 40 dB does not set the scale
    ax.figure.draw_without_rendering()
    assert ax.get_legend().get_window_extent().y0 >= ax.bbox.y1  # the legend hides no position


def test_infinite_values_keep_a_distribution_below_one(parameters):
    ax = parameter_cdf(parameters, "coherence_bandwidth", Figure().add_subplot())
    (line,) = ax.lines
    assert line.get_label() == "LoS (3, 1 infinite)"
    np.testing.assert_allclose(line.get_xdata(), [1, 1, 3])  # MHz
    np.testing.assert_allclose(line.get_ydata(), [0, 1 / 3, 2 / 3])


def test_a_page_has_a_panel_for_each_parameter_that_is_known(parameters):
    assert [ax.get_xlabel() for ax in cdf_page(parameters).axes] == ["Coherence bandwidth (MHz)"]
    assert path_loss(parameters.isel(position=[]), [], Figure().add_subplot()).lines[:] == []
