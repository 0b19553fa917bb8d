"""Figures show what they are given, in one colour a thing, and hide nothing."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.colors import to_hex

from erm.figures import PALETTE, mark_width, plot_map, plot_sensed_points
from erm.maps.environment import Environment
from erm.mpcs.selection import select
from erm.mpcs.table import empty_table, make_table
from erm.reconstruction.reconstruct import reconstruct

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


@pytest.mark.slow
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


def test_sensed_points_stand_over_the_true_ones():
    square = np.array([[[0, 0], [4, 0]], [[4, 0], [4, 4]]], dtype=float)
    there, sensed = np.array([[1.0, 0], [2, 0]]), np.array([[1.1, 0], [2, 0.1]])
    axes = plot_sensed_points(square, there, sensed, tx=np.array([[1.0, 2]]), rx=np.array([[3.0, 2]]))
    drawn = {item.get_label(): item.get_offsets() for item in axes.collections}
    np.testing.assert_array_equal(drawn["simulated"], there)
    np.testing.assert_array_equal(drawn["sensed"], sensed)


def test_a_width_is_marked_from_end_to_end_with_its_label():
    axes = mark_width(plot_map(outline=OUTLINE), np.array([10.0, 0.0]), np.array([10.0, 40.0]), "40 m")
    arrow, label = axes.texts
    assert (arrow.xyann, arrow.xy) == ((10.0, 40.0), (10.0, 0.0))
    assert (label.get_text(), label.xy) == ("40 m", (10.0, 20.0))


@pytest.mark.slow
def test_names_hide_neither_antennas_nor_points():
    # receivers close about two poles, but for a gap of 120 degrees below one and above the other
    turn = np.radians(np.linspace(-30, 210, 30))
    ring = 2.5 * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    place = Environment.walls([[[0, 0], [30, 0]]]).with_poles([[10, 20], [25, 30]], 0.1)
    rx = np.column_stack(
        [np.vstack([ring + np.array([10, 20]), ring * np.array([1, -1]) + np.array([25, 30])]), np.full(60, 1.5)]
    )
    table = make_table(
        {
            "position": np.array([f"RX{i}" for i in range(60)]),
            "tx_position": np.array([0.0, 60.0, 9.0]),
            "rx_position": rx,
        }
        | {"frequency": 132e9, "delay": np.full(60, 1e-6), "azimuth": np.zeros(60), "path_gain": np.full(60, -99.0)}
    )
    axes = plot_map(place, table=table, names=["W0", "P1", "P2"])
    axes.figure.canvas.draw()
    names = [text for text in axes.texts if text.get_text() in ("W0", "P1", "P2")]
    assert len(names) == 3
    centres = axes.transData.transform(rx[:, :2])
    hidden = [text.get_text() for text in names if text.get_window_extent().count_contains(centres)]
    assert hidden == []
