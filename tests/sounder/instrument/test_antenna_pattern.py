"""Patterns and the angles off boresight."""

import numpy as np
import pytest

from sounder.instrument.antenna_cut import widest_gap
from sounder.instrument.antenna_description import Antenna
from sounder.instrument.antenna_pattern import Pattern, off_boresight

GAUSSIAN = Antenna(gain=24.5, hpbw_azimuth=10.0, hpbw_elevation=9.0)


def unit(azimuth, elevation):
    a, e = np.radians(azimuth), np.radians(elevation)
    return np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)], axis=-1)


def test_half_power_at_half_the_beamwidth():
    pattern = Pattern.of(GAUSSIAN)
    assert pattern.relative_gain(0.0, 0.0) == 0.0
    # 12 (1/2)^2 = 3.00 dB; the tables are exact where they are read here
    for off in ((5.0, 0.0), (-5.0, 0.0), (0.0, 4.5), (0.0, -4.5)):
        assert pattern.relative_gain(*off) == pytest.approx(-3.0, abs=1e-12)
    assert pattern.relative_gain(5.0, 4.5) == pytest.approx(-6.0, abs=1e-12)
    assert pattern.relative_gain(90.0, 0.0) == -30.0
    assert pattern.sidelobe_level == -30.0


def test_flat_antenna_is_the_same_everywhere():
    pattern = Pattern.of(Antenna(gain=3.0, pattern="flat"))
    rng = np.random.default_rng(1)
    assert not pattern.directive
    assert (pattern.beam_gain(*rng.uniform(-90, 90, (4, 50))) == 0).all()


def test_measured_cuts_are_taken_relative_to_boresight(bench):
    angle = (-180.0, -10.0, 0.0, 10.0, 180.0)
    cut = {"angle": angle, "azimuth": (-39.0, -9.0, 1.0, -9.0, -39.0), "elevation": (-40.0, -14.0, 0.0, -12.0, -40.0)}
    pattern = Pattern.of(Antenna(gain=20.0, pattern="cut", hpbw_azimuth=6, hpbw_elevation=6, cut=cut))
    assert pattern.relative_gain(0.0, 0.0) == 0.0
    assert pattern.relative_gain(10.0, 0.0) == pytest.approx(-10.0)
    assert pattern.relative_gain(0.0, 10.0) == pytest.approx(-12.0)
    assert pattern.relative_gain(0.0, -5.0) > -7.0  # a line between the rows: a lobe is over it
    shipped = Pattern.of(bench.sounder.rx_antenna)
    # the first sidelobe of a uniform aperture is 13.3 dB down, of a cosine taper 23 dB: the horn is near the latter
    assert -25 < shipped.sidelobe_level < -18


@pytest.mark.parametrize(("step", "worst"), [(1.0, 0.001), (2.5, 0.001), (5.0, 0.3), (10.0, 1.0)])
def test_a_lobe_is_known_between_coarse_rows_and_what_they_leave_open_is_told(step, worst):
    """A Gaussian lobe over a floor; lines between its rows are ``3 (step / 10)^2`` dB off."""
    rows, looks = np.arange(-180.0, 180.5, step), np.arange(-10.0, 10.1, 0.5)
    lobe = np.maximum(-12 * (rows / 10) ** 2, -40)
    antenna = Antenna(
        gain=20.0,
        pattern="cut",
        hpbw_azimuth=10,
        hpbw_elevation=10,
        cut={"angle": tuple(rows), "azimuth": tuple(lobe), "elevation": tuple(lobe)},
    )
    error = np.abs(Pattern.of(antenna).relative_gain(looks, 0 * looks) + 12 * (looks / 10) ** 2).max()
    assert error < worst
    gap = widest_gap(antenna)
    assert gap.step == step
    assert error - 0.002 < gap.error  # 0.002 dB is left by the table
    assert (gap.error > 0.05) == (step > 2.5)


def test_looking_at_a_direction_it_is_on_boresight():
    rng = np.random.default_rng(2)
    azimuth, elevation = rng.uniform(0, 360, 500), rng.uniform(-80, 80, 500)
    # asin near 0 and atan2 near 0 are exact to rounding of the coordinates, 1e-16 rad
    np.testing.assert_allclose(off_boresight(azimuth, elevation, azimuth, elevation), 0, atol=1e-12)


def test_angles_off_boresight_are_a_rotation():
    """The frame's direction is a unit vector at the same angle from x as the direction is from boresight."""
    rng = np.random.default_rng(3)
    azimuth, look_azimuth = rng.uniform(0, 360, (2, 500))
    elevation, look_elevation = rng.uniform(-85, 85, (2, 500))
    own = unit(*off_boresight(azimuth, elevation, look_azimuth, look_elevation))
    cosine = np.sum(unit(azimuth, elevation) * unit(look_azimuth, look_elevation), axis=-1)
    # asin of a number known to 1e-16 is known to 1e-8 near the poles
    np.testing.assert_allclose(own[:, 0], cosine, atol=1e-8)
    # left of the boresight is +y, above it +z
    left = np.stack([-np.sin(np.radians(look_azimuth)), np.cos(np.radians(look_azimuth)), 0 * azimuth], axis=-1)
    np.testing.assert_allclose(own[:, 1], np.sum(unit(azimuth, elevation) * left, axis=-1), atol=1e-8)


def test_turning_antenna_and_direction_together_changes_nothing():
    rng = np.random.default_rng(4)
    pattern = Pattern.of(GAUSSIAN)
    azimuth, look, by = rng.uniform(0, 360, (3, 200))
    elevation, tilt = rng.uniform(-20, 20, (2, 200))
    np.testing.assert_allclose(
        pattern.beam_gain(azimuth + by, elevation, look + by, tilt),
        pattern.beam_gain(azimuth, elevation, look, tilt),
        atol=1e-9,  # the steepest place of the cut, 40 dB a degree, times 1e-13 degree of rounding
    )


def test_high_directions_are_seen_by_beams_of_all_azimuths():
    """10 degree of azimuth are 1.7 degree of arc at 80 degree elevation."""
    aside, _ = off_boresight(10.0, 80.0, 0.0, 80.0)
    arc = np.degrees(np.arccos(unit(10.0, 80.0) @ unit(0.0, 80.0)))
    assert arc == pytest.approx(10 * np.cos(np.radians(80)), rel=0.02)
    assert aside == pytest.approx(arc, rel=0.02)
