"""Errors of a table that states none are read off what is known: the direct paths."""

import numpy as np
import pytest
from scipy.constants import c

from erm.geometry.vertical import azimuth_of
from erm.mpcs.standard_errors import ASSUMED, errors_of_direct_paths, widen_errors
from erm.mpcs.table import make_table


def direct_paths(count, delay_std, azimuth_std, seed=3):
    rng = np.random.default_rng(seed)
    tx = np.array([0.0, 0.0, 20.0])
    rx = np.column_stack([rng.uniform(20, 90, count), rng.uniform(-40, 40, count), np.full(count, 1.5)])
    apart = tx - rx
    return make_table(
        {
            "position": np.array([f"RX{i}" for i in range(count)]),
            "tx_position": tx,
            "rx_position": rx,
            "frequency": 132e9,
            "delay": np.linalg.norm(apart, axis=-1) / c + delay_std * rng.standard_normal(count),
            "azimuth": azimuth_of(apart) + azimuth_std * rng.standard_normal(count),
            "path_gain": np.full(count, -100.0),
        }
    )


@pytest.mark.parametrize(("delay_std", "azimuth_std"), [(1e-10, 0.3), (3e-11, 2.0)])
def test_the_scatter_of_direct_paths_is_the_error(delay_std, azimuth_std):
    found = errors_of_direct_paths(direct_paths(400, delay_std, azimuth_std))
    # a median absolute deviation of 400 errors is right to 1.17 / sqrt(800) = 4 %; four of these
    assert found.delay == pytest.approx(delay_std, rel=0.17)
    assert found.azimuth == pytest.approx(azimuth_std, rel=0.17)
    assert (found.source, found.sample) == ("direct paths", 400)


def test_a_few_direct_paths_are_no_evidence():
    assert errors_of_direct_paths(direct_paths(4, 1e-10, 0.3)) == ASSUMED


def test_elevations_that_are_as_uncertain_as_those_beyond_a_fan_count_in_full():
    table = direct_paths(400, 1e-10, 0.3)
    apart = table["tx_position"].values - table["rx_position"].values
    known = np.rad2deg(np.arctan2(apart[:, 2], np.hypot(apart[:, 0], apart[:, 1])))
    std = np.where(np.arange(400) < 40, 5.0, 0.1)  # one path in ten is outside
    table["elevation"] = "mpc", known + std * np.random.default_rng(5).standard_normal(400)
    # the mean of 40 squares is right to sqrt(2 / 40) = 22 %, its root to 11 %; four of these
    assert errors_of_direct_paths(table).elevation == pytest.approx(np.sqrt(0.1) * 5.0, rel=0.45)


def test_errors_of_exact_paths_stay_positive():
    found = errors_of_direct_paths(direct_paths(20, 0.0, 0.0))
    assert min(found.delay, found.azimuth) > 0


def test_errors_are_widened_to_the_residuals_and_left_alone_where_these_are_as_stated_or_nothing():
    rng = np.random.default_rng(11)
    stated = np.full(400, 0.02)
    underrated = widen_errors(0.1 * rng.standard_normal(400), stated, stated)
    np.testing.assert_allclose(underrated, 0.1, rtol=0.17)  # as above
    for residual in (0.02 * rng.standard_normal(400), np.zeros(400)):
        np.testing.assert_array_equal(widen_errors(residual, stated, stated), stated)
