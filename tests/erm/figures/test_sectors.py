"""Sectors stand where their components arrive, and every component is marked by what explains it."""

import matplotlib.pyplot as plt
import numpy as np
import pytest

from erm.evaluation.explain import Sector
from erm.figures import plot_sectors
from erm.mpcs.table import make_table


@pytest.fixture(autouse=True)
def closed():
    yield
    plt.close("all")


@pytest.fixture
def polar():
    axes = plt.figure(layout="constrained").add_subplot(projection="polar")
    axes.set_rlim(0, 100)
    return axes


def test_a_sector_spans_its_azimuths_and_is_told_in_the_legend(polar):
    axes = plot_sectors([Sector("direct", 80, 100, 1), Sector("W1", 350, 370, 3), Sector("W1", 200, 220, 2)], polar)
    first = axes.patches[0]
    assert np.degrees([first.get_x(), first.get_x() + first.get_width()]) == pytest.approx([80, 100])
    assert [text.get_text() for text in axes.figure.legends[0].get_texts()] == ["direct (1)", "W1 (5)"]


def test_every_component_is_marked_by_the_number_of_its_bounces(polar):
    columns = {"delay": [1e-8, 2e-8, 3e-8, 4e-8], "azimuth": [0.0, 90.0, 180.0, 270.0], "path_gain": [-100.0] * 4}
    ends = {"position": "RX", "tx_position": [0.0, 0, 10], "rx_position": [2.0, 0, 2], "frequency": 132e9}
    labels = ["direct", "W1+ground", "W1+W2", ""]
    plot_sectors([Sector("W1", 85, 95, 2)], polar, table=make_table(ends | columns), labels=labels)
    drawn = {item.get_label(): item.get_offsets()[:, 1].tolist() for item in polar.collections}
    assert drawn == {
        "at most one reflection (2)": pytest.approx([10, 20]),  # ns
        "several reflections (1)": pytest.approx([30]),
        "not explained (1)": pytest.approx([40]),
    }


def test_a_name_stands_where_its_sector_is_alone(polar):
    plot_sectors([Sector("W1", 0, 60, 1), Sector("W2", 30, 70, 1)], polar)
    places = {text.get_text(): np.degrees(text.get_position()[0]) for text in polar.texts}
    assert places["W1"] < 30
    assert places["W2"] > 60
