"""Path gain as a function of the assumed elevation: beyond the fan it is the lobe of the highest beam."""

import numpy as np
import pytest
import xarray as xr

from sounder import shipped
from sounder.instrument.antenna_pattern import Pattern
from sounder.instrument.description import load_sounder
from sounder.mpc.directions import beam_directions
from sounder.mpc.elevation_gain import with_elevation_gain

DIRECTIONS = beam_directions(np.arange(0.0, 360.0, 10.0), [-9.0, 0.0, 9.0])


@pytest.fixture
def pattern():
    """A horn whose lobe is Gaussian down to -30 dB."""
    antenna = load_sounder(shipped.calibration("sounder-132ghz.toml")).rx_antenna
    return Pattern.of(antenna.model_copy(update={"pattern": "gaussian", "cut": None}))


def with_gains(pattern, elevation, std):
    elevation = np.atleast_1d(np.asarray(elevation, dtype=float))
    columns = {"azimuth": 130.0, "elevation": elevation, "elevation_std": std}
    table = xr.Dataset({name: ("mpc", np.broadcast_to(value, elevation.shape)) for name, value in columns.items()})
    return with_elevation_gain(table, DIRECTIONS, pattern)


def test_beyond_the_fan_the_gain_follows_the_lobe_of_the_edge_beam(pattern):
    # in the one beam that matters: 12 dB (x / 9)^2, x from its boresight; the beam below, 9 degrees further down the
    # same lobe, adds its square, under a hundredth in amplitude beyond 12 degrees
    elevation = np.array([12.0, 14.0, -13.0])
    found = with_gains(pattern, elevation, 4.0)
    np.testing.assert_allclose(found["gain_slope"], 24 / 81 * (elevation - np.copysign(9.0, elevation)), atol=0.1)
    np.testing.assert_allclose(found["gain_curvature"], 24 / 81, rtol=0.1)


def test_where_three_beams_see_a_path_its_gain_is_known_whatever_its_elevation_within_the_error(pattern):
    # at the middle of the fan the beams above and below change by as much either way
    found = with_gains(pattern, 0.0, 0.5)
    step = 0.1
    assert abs(float(found["gain_slope"][0]) * step + float(found["gain_curvature"][0]) * step**2 / 2) < 0.02


def test_an_antenna_alike_in_all_directions_knows_gains_without_elevations():
    flat = Pattern(0.0, np.zeros(1441), np.zeros(1441), 0.0)
    found = with_gains(flat, [0.0, 20.0], 5.0)
    np.testing.assert_allclose(found["gain_slope"], 0.0, atol=1e-12)
    np.testing.assert_allclose(found["gain_curvature"], 0.0, atol=1e-12)


def test_without_an_elevation_there_is_no_with_gains(pattern):
    assert np.isnan(with_gains(pattern, np.nan, np.nan)["gain_slope"].values).all()
