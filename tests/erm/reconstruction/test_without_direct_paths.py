"""Without direct paths the clock is not known: walls are found, and their covariances hold what nobody knows."""

import numpy as np
import pytest
from scipy.constants import c

from erm.mpcs.table import path_length
from erm.reconstruction.make_map import make_map

from ..survey.streets import street

CLOCK, HEADING = 4e-9, 4.0
NORTH, SOUTH = 10.0, -12.0
"""Where the two walls are [m]."""


@pytest.fixture(scope="module")
def mapped():
    table = street(16, 2)
    distance = np.linalg.norm(table["tx_position"].values - table["rx_position"].values, axis=-1)
    reflected = np.flatnonzero(path_length(table) > distance + 1.0)
    table = table.isel(mpc=reflected)
    unknown = table["los"] * 0 - 1
    return make_map(
        table.assign(delay=table["delay"] + CLOCK, azimuth=(table["azimuth"] + HEADING) % 360, los=unknown),
        history="test",
    )


@pytest.mark.slow
@pytest.mark.parametrize("wall", [NORTH, SOUTH])
def test_walls_are_found_to_their_covariances(mapped, wall):
    walls = mapped[0].reflectors
    middle = walls["end_points"].values[:, :, :2].mean(axis=1)
    best = int(np.argmax(walls["support"].values * (np.abs(middle[:, 1] - wall) < 2)))  # the clock is wrong by 1.2 m
    normal = np.deg2rad(walls["normal"].values[best])
    # the distance of the middle from the true wall, and how it moves with (normal [degree], offset)
    left = np.array([-np.sin(normal), np.cos(normal)])
    slope = np.array([-np.deg2rad(left @ middle[best]), 1.0])
    std = np.sqrt(slope @ walls["covariance"].values[best] @ slope)
    assert abs(middle[best, 1] - wall) < 3 * std
    assert std < 1.0


@pytest.mark.slow
def test_heading_is_found_and_the_clock_is_said_to_be_unknown_unless_chains_show_it(mapped):
    attributes = mapped[0].reflectors.attrs
    assert attributes["heading"] == pytest.approx(HEADING, abs=0.3)
    assert abs(attributes["clock"] - CLOCK) < 3 * attributes["clock_std"]
    known = attributes["clock_std"] < float(np.median(mapped[1]["delay_std"].values)) * 2
    assert known != ("clock" in attributes["ambiguous"].split())
    assert attributes["clock_std"] * c < 2.0
