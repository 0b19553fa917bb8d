"""Errors that all measurements share are found and removed; tables without such errors stay as they are."""

import numpy as np
import pytest
import xarray as xr

import erm
from erm.survey.calibration import apply, calibrate


def street(count: int = 12, seed: int = 1) -> xr.Dataset:
    """Paths of receivers in a street with two walls, to 0.1 ns and 0.5 degrees."""
    rng = np.random.default_rng(seed)
    walls = erm.Environment.walls([[[-60, 10], [60, 10]], [[-60, -12], [60, -12]]], top=40.0)
    receivers = np.column_stack([rng.uniform(8, 50, count), rng.uniform(-9, 8, count), np.full(count, 1.5)])
    table = xr.concat([erm.predict(walls, (0, 0, 9), rx, 132e9) for rx in receivers], dim="mpc")
    n = table.sizes["mpc"]
    return table.assign(
        delay=table["delay"] + 1e-10 * rng.standard_normal(n),
        azimuth=table["azimuth"] + 0.5 * rng.standard_normal(n),
        delay_std=("mpc", np.full(n, 1e-10)),
        azimuth_std=("mpc", np.full(n, 0.5)),
    )


@pytest.mark.parametrize(("heading", "clock", "gain"), [(5.0, 3e-9, 55.0), (-40.0, -2e-8, -30.0), (170.0, 4e-7, 0.0)])
def test_common_errors_are_found_and_removed(heading, clock, gain):
    true = street()
    table = true.assign(
        azimuth=true["azimuth"] + heading, delay=true["delay"] + clock, path_gain=true["path_gain"] + gain
    )
    found = calibrate(table)
    # twelve direct paths: 0.5 / sqrt(12) = 0.14 degrees, 0.03 ns; four standard errors
    assert abs(found.heading - heading) < 0.6
    assert abs(found.clock - clock) < 1.2e-10
    assert abs(found.gain - gain) < 1.0
    mended = apply(table, found)
    assert np.abs(mended["delay"] - true["delay"]).max() < 1.2e-10
    assert mended.attrs["common_clock_std"] < 1e-10


def test_a_table_without_errors_stays_as_it_is():
    for seed in range(5):
        table = street(seed=seed)
        mended = apply(table, calibrate(table))
        for name in ("azimuth", "delay", "path_gain"):
            np.testing.assert_array_equal(mended[name], table[name])


def test_an_empty_table_is_calibrated_by_nothing():
    table = street().isel(mpc=[])
    found = calibrate(table)
    assert found.ambiguous == ("heading", "clock", "gain")
    assert apply(table, found).sizes["mpc"] == 0
