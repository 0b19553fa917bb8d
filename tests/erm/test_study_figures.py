"""Figures of studies show what they are given."""

import matplotlib.pyplot as plt
import numpy as np
import pytest

from erm.explain import Sector
from erm.study_figures import plot_letter_points, plot_sectors, plot_sensed_points


@pytest.fixture(autouse=True)
def closed():
    yield
    plt.close("all")


def test_sensed_points_stand_over_the_true_ones():
    square = np.array([[[0, 0], [4, 0]], [[4, 0], [4, 4]]], dtype=float)
    there, sensed = np.array([[1.0, 0], [2, 0]]), np.array([[1.1, 0], [2, 0.1]])
    axes = plot_sensed_points(square, there, sensed, tx=np.array([[1.0, 2]]), rx=np.array([[3.0, 2]]))
    drawn = {item.get_label(): item.get_offsets() for item in axes.collections}
    np.testing.assert_array_equal(drawn["simulated"], there)
    np.testing.assert_array_equal(drawn["sensed"], sensed)


def test_a_sector_spans_its_azimuths_and_is_told_in_the_legend():
    axes = plt.figure(layout="constrained").add_subplot(projection="polar")
    axes.set_rlim(0, 100)
    plot_sectors([Sector("direct", 80, 100, 1), Sector("W1", 350, 370, 3), Sector("W1", 200, 220, 2)], axes)
    first = axes.patches[0]
    assert np.degrees([first.get_x(), first.get_x() + first.get_width()]) == pytest.approx([80, 100])
    assert [text.get_text() for text in axes.figure.legends[0].get_texts()] == ["direct (1)", "W1 (5)"]


def test_the_letters_points_are_all_drawn_north_up():
    left, right = plot_letter_points().axes
    drawn = {item.get_label(): item.get_offsets() for item in left.collections}
    assert len(drawn["published RP"]) == 10
    assert drawn["published RP"][:, 1].max() < 0
    assert len(right.collections[0].get_offsets()) == 8
