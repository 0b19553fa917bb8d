"""Names on a map overlap nothing, each RX is tied to its TX, and scale and north are right."""

from itertools import combinations

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.offsetbox import AnchoredOffsetbox
from matplotlib.patches import FancyArrowPatch
from matplotlib.text import Text
from mpl_toolkits.axes_grid1.anchored_artists import AnchoredSizeBar

from erm.figures import plot_map
from erm.figures.map_marks import MAX_NAMED, round_length
from erm.maps.environment import Environment
from erm.maps.georeference import Georeference
from erm.mpcs.table import make_table


@pytest.fixture(autouse=True)
def closed():
    yield
    plt.close("all")


def campaign(rx, tx=(0.0, 40.0)):
    rx = np.asarray(rx, float)
    places = np.column_stack([rx, np.full(len(rx), 1.5)])
    names = [f"RX{i}_L" for i in range(len(rx))]
    return make_table(
        {"position": names, "tx_position": [*tx, 20.0], "rx_position": places, "frequency": 132e9}
        | {"delay": np.full(len(rx), 3e-7), "azimuth": np.zeros(len(rx)), "path_gain": np.full(len(rx), -110.0)}
    )


@pytest.mark.slow
def test_names_of_crowded_positions_do_not_overlap():
    rng = np.random.default_rng(1)
    rx = np.vstack([rng.uniform(0, 100, (12, 2)), rng.uniform(40, 55, (8, 2))])
    axes = plot_map(table=campaign(rx), annotated=True)
    axes.figure.canvas.draw()
    assert sorted(text.get_text() for text in axes.texts) == sorted(f"RX{i}_L" for i in range(20))
    boxes = [Text.get_window_extent(text) for text in axes.texts]
    assert not [pair for pair in combinations(boxes, 2) if pair[0].shrunk(0.9, 0.8).overlaps(pair[1].shrunk(0.9, 0.8))]


def test_each_rx_is_tied_to_its_tx():
    axes = plot_map(table=campaign([[10.0, 0.0], [20.0, 5.0]]), annotated=True)
    (lines,) = (one for one in axes.collections if isinstance(one, LineCollection))
    ends = np.array([path.vertices for path in lines.get_paths()])
    np.testing.assert_array_equal(ends, [[[0, 40], [10, 0]], [[0, 40], [20, 5]]])


def test_more_names_than_can_be_read_are_left_out():
    axes = plot_map(table=campaign(np.random.default_rng(2).uniform(0, 100, (MAX_NAMED + 1, 2))), annotated=True)
    assert len(axes.texts) == 0


@pytest.mark.parametrize("heading", [0.0, 90.0])
def test_the_arrow_shows_north_and_the_bar_is_as_long_as_it_says(heading):
    """With a heading of 90 degree the y axis looks east, so that north is to the left."""
    street = Environment.walls([[[0, 0], [100, 0]]], georeference=Georeference(48.1, 11.5, heading=heading))
    axes = plot_map(street, annotated=True)
    boxes = [one for one in axes.artists if isinstance(one, AnchoredOffsetbox)]
    (bar,) = (one for one in boxes if isinstance(one, AnchoredSizeBar))
    assert bar.size_bar.get_children()[0].get_width() == 20.0
    assert bar.txt_label.get_text() == "20 m"
    (north,) = (one for one in boxes if one is not bar)
    (arrow,) = (one for one in north.get_child().get_children() if isinstance(one, FancyArrowPatch))
    tail, tip = np.array(arrow._posA_posB)
    np.testing.assert_allclose((tip - tail) / np.linalg.norm(tip - tail), [[0, 1], [-1, 0]][heading > 0], atol=1e-9)


def test_round_lengths():
    assert [round_length(longest) for longest in (1.0, 1.9, 7.0, 499.0)] == [1.0, 1.0, 5.0, 200.0]
