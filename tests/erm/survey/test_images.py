"""Heading and clock without any direct path: from images, where they show them."""

import numpy as np
import pytest
import xarray as xr

import erm
from erm.common.constants import c
from erm.survey.calibration import calibrate
from erm.survey.observations import Observations
from erm.survey.sharpness import Sharpness

from .streets import noisy, street

pytestmark = pytest.mark.slow


def without_direct_paths(table: xr.Dataset) -> xr.Dataset:
    direct = np.linalg.norm(table["tx_position"] - table["rx_position"], axis=1)
    return table.isel(mpc=np.flatnonzero(table["delay"].values * c - direct > 0.5))


def room(count: int = 30, seed: int = 3) -> xr.Dataset:
    rng = np.random.default_rng(seed)
    corners = [[0, 0], [11, 0], [11, 5], [6, 5], [6, 9], [0, 9]]
    walls = erm.Environment.walls([[a, b] for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)], top=3)
    receivers = np.column_stack([rng.uniform(0.5, 5.5, count), rng.uniform(0.5, 8.5, count), np.full(count, 1.2)])
    links = [erm.predict(walls, (4, 3, 1.8), rx, 132e9, max_order=2) for rx in receivers]
    return noisy(xr.concat(links, dim="mpc"), rng)


def test_a_room_shows_heading_and_clock_without_direct_paths():
    true = without_direct_paths(room())
    found = calibrate(true.assign(azimuth=true["azimuth"] + 5, delay=true["delay"] + 3e-9))
    assert found.direct_paths == 0
    # four standard errors, and an upper limit for these
    assert abs(found.heading - 5) < 4 * found.std("heading") < 0.8
    assert abs(found.clock - 3e-9) < 4 * found.std("clock") < 4e-10
    assert "clock" not in found.ambiguous


def test_a_street_does_not_show_the_clock_and_says_so():
    true = without_direct_paths(street())
    found = calibrate(true.assign(azimuth=true["azimuth"] + 5))
    assert "clock" in found.ambiguous
    assert found.remaining["clock"] > 1e-10


def test_images_are_sharpest_with_the_true_heading_and_clock():
    sharpness = Sharpness(Observations.of(room()))
    true = sharpness.evidence(0.0, 0.0)
    assert true > sharpness.evidence(0.0, 2.0) + 20
    assert true > sharpness.evidence(0.5, 0.0) + 20
    best = sharpness.search(0.3)[0]
    assert abs(best.heading) < 0.3
    assert abs(best.clock) < 0.1
