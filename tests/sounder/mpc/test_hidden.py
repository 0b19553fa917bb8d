"""Paths from directions that were not recorded: what is left of them is not listed, other paths are."""

import numpy as np
import pytest

from .extraction import mpcs, near

STRONG, WEAK = (-100.0, 100e-9, 67.0, 1.0), (-115.0, 300e-9, 200.0, 0.0)
NOISE = -160.0  # the sidelobes of the strong path are 20 dB over it


@pytest.fixture
def scan(bench):
    return bench.scan([STRONG, WEAK], noise=NOISE + bench.sounder.rx_antenna.gain)


def without(scan, azimuths, elevations):
    cir = scan.copy(deep=True)
    gone = cir["azimuth"].isin(azimuths) & cir["elevation"].isin(elevations)
    cir["cir"] = cir["cir"].where(~gone)
    return cir


@pytest.mark.slow
def test_sidelobes_of_a_path_that_no_recorded_beam_looks_at_are_not_listed(bench, scan):
    table = mpcs(bench, [], scan=without(scan, [50, 60, 70, 80], [-9, 0, 9]))
    assert table.sizes["mpc"] == 1
    assert near(table, WEAK).sizes["mpc"] == 1
    assert table.attrs["paths_outside_fan"] > 0


def test_a_path_is_listed_where_one_beam_is_missing(bench, scan):
    table = mpcs(bench, [], scan=without(scan, [70], [0]))
    assert table.sizes["mpc"] == 2
    [gain] = near(table, STRONG)["path_gain"].values
    np.testing.assert_allclose(gain, STRONG[0], atol=1.0)


def test_the_azimuth_beside_a_missing_beam_is_as_vague_as_the_beams_leave_it(bench, scan):
    """A path 4 degree from its beam toward the missing one is seen by no other beam of its elevation."""
    weak = (-115.0, 300e-9, 204.0, 0.0)
    noisy = bench.scan([weak], noise=-115.0)
    whole = mpcs(bench, [], scan=noisy)
    vague = mpcs(bench, [], scan=without(noisy, [210], [-9, 0, 9]))
    assert whole["azimuth_std"].item() < 1.0 < 6.0 < vague["azimuth_std"].item() < 10.0
    assert whole["path_gain_std"].item() < 1.0 < 10.0 < vague["path_gain_std"].item()


def test_the_beam_on_the_other_side_settles_the_azimuth_beside_a_missing_one(bench):
    """A path toward the beam on the other side, which sees so much of it that it does not come from the missing one."""
    middle = (-115.0, 300e-9, 204.0, 0.0)
    table = mpcs(bench, [], scan=without(bench.scan([middle], noise=-130.0), [190], [-9, 0, 9]))
    assert abs(table["azimuth"].item() - 204.0) < 1.0 > table["azimuth_std"].item()
