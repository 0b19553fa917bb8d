"""Errors that all measurements share are found and removed; tables without such errors stay as they are."""

import numpy as np
import pytest

from erm.survey.calibration import Calibration, apply, calibrate

from .streets import street

pytestmark = pytest.mark.slow


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


def test_only_direct_paths_show_that_there_is_no_common_error():
    """Images that leave the clock open are no proof that it is right."""
    covariance = np.diag([0.1, 1e-9, 1.0]) ** 2
    assert Calibration(0.1, 8e-10, covariance=covariance, images=4).common
    assert not Calibration(0.1, 8e-10, covariance=covariance, images=4, direct_paths=5).common
    assert Calibration(5.0, 8e-10, covariance=covariance, images=4, direct_paths=5).common
    assert not Calibration().common


def test_an_empty_table_is_calibrated_by_nothing():
    table = street().isel(mpc=[])
    found = calibrate(table)
    assert found.ambiguous == ("heading", "clock", "gain")
    assert apply(table, found).sizes["mpc"] == 0
