"""Figures show what they are given, in one colour a thing, and hide nothing."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.colors import to_hex

from erm.environment import Environment
from erm.figures import PALETTE, plot_error_cdf, plot_map
from erm.mpc_table import empty_table, make_table
from erm.reconstruct import reconstruct
from erm.select import select

OUTLINE = np.array([[[0.0, 0.0], [50.0, 0.0]], [[500.0, 0.0], [500.0, 50.0]]])


@pytest.fixture(autouse=True)
def closed():
    yield
    plt.close("all")


def one_path():
    return select(
        make_table(
            {"position": "RX1", "tx_position": [0.0, 10.0, 20.0], "rx_position": [40.0, 10.0, 1.5]}
            | {"frequency": 132e9, "delay": [1.7e-7], "azimuth": [207.0], "path_gain": [-111.0]}
        )
    )


def test_a_map_has_equal_axes_in_metres_and_a_legend_beside_it():
    environment = Environment.walls([[[5, 0], [30, 0]]]).with_poles([[20, 5]], 0.1)
    axes = plot_map(environment, table=one_path(), outline=OUTLINE)
    axes.figure.canvas.draw()
    assert axes.get_aspect() == 1
    assert axes.get_xlabel() == "East (m)"
    assert axes.get_ylabel() == "North (m)"
    legend = axes.get_legend()
    assert {text.get_text() for text in legend.get_texts()} == {
        "merged wall",
        "pole",
        "reflection point",
        "RX",
        "TX",
        "known outline",
    }
    assert not legend.get_window_extent().overlaps(axes.patch.get_window_extent())


def test_the_view_is_that_of_the_map_not_of_the_whole_outline():
    axes = plot_map(Environment.walls([[[5, 0], [30, 0]]]), outline=OUTLINE)
    assert axes.get_xlim()[1] < 100
    assert plot_map(outline=OUTLINE).get_xlim()[1] > 500


def test_a_thing_has_one_colour_everywhere():
    table = one_path()
    first = plot_map(table=table)
    second = plot_map(Environment.walls([[[5, 0], [30, 0]]]), table=table, outline=OUTLINE)

    def colours(axes):
        return {
            item.get_label(): to_hex(
                np.ravel(item.get_edgecolor() if item.get_label() == "reflection point" else item.get_facecolor())[:4]
            )
            for item in axes.collections
            if item.get_label() in ("TX", "RX", "reflection point")
        }

    expected = {"TX": PALETTE["TX"], "RX": PALETTE["RX"], "reflection point": PALETTE["RP"]}
    assert colours(first) == colours(second) == expected


def test_an_empty_map_is_drawn():
    environment, table = reconstruct(select(empty_table()))
    axes = plot_map(environment, table=table)
    assert axes.get_legend() is None


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
