"""What neighbours take from what is known of a path, by closed form."""

import numpy as np
import pytest

from sounder.instrument.antenna_description import Antenna
from sounder.instrument.antenna_pattern import Pattern
from sounder.kernels.extraction import columns
from sounder.mpc.cramer_rao import Band
from sounder.mpc.overlap import widening
from sounder.mpc.uncertainty import beams_seeing

RATE = 1.2e9
LOOKS = np.arange(0.0, 360.0, 10.0), np.array([-9.0, 0.0, 9.0])
HORN = Pattern.of(Antenna(gain=24.5, hpbw_azimuth=10.0, hpbw_elevation=9.0))
BAND = Band.rectangular(1.08e9, 1022)


def rows(*paths):
    found = np.zeros((len(paths), columns.COLUMNS))
    for row, (delay, azimuth) in zip(found, paths, strict=True):
        row[[columns.DELAY, columns.AZIMUTH]] = delay, azimuth
    return found


def widened(found, snr, *, pair=-1):
    seen = beams_seeing(found, np.ones(LOOKS[0].size * LOOKS[1].size), LOOKS, HORN)
    return widening(found, np.full(len(found), snr), seen, BAND, RATE, np.full(len(found), pair))


def test_alone_a_path_is_known_as_well_as_alone():
    np.testing.assert_array_equal(widened(rows((10.0, 40.0), (17.0, 40.0), (300.0, 40.0)), 1e4), 1.0)
    assert widened(rows(), 1e4).shape == (0, 2)


@pytest.mark.parametrize("late", [0.7, 1.0, 1.6, 2.5])
def test_a_strong_neighbour_in_the_same_beams_takes_what_its_pulse_shares(late):
    """Two unit vectors with inner product r: an amplitude beside another unknown one has the variance 1 / (1 - |r|^2).

    For a flat band ``r = sinc(B t)``; of the derivative by delay, of squared norm ``(pi B)^2 / 3``, the other pulse
    takes the square of ``r' / sqrt(1 - r^2)``.
    """
    found = rows((100.0, 40.0), (100.0 + late, 40.0))
    turns = 1.08e9 / RATE * late
    r = np.sinc(turns)
    slope = (np.cos(np.pi * turns) - r) / late
    delay, magnitude = widened(found, 1e9)[0]
    assert magnitude == pytest.approx(1 / (1 - r**2), rel=1e-3)
    full = (np.pi * 1.08e9 / RATE) ** 2 / 3
    assert delay == pytest.approx(1 / (1 - slope**2 / (1 - r**2) / full), rel=1e-3)


def test_a_neighbour_that_these_beams_do_not_see_takes_nothing():
    weak = widened(rows((100.0, 40.0), (101.0, 220.0)), 10.0)  # 30 dB under 10 dB over the noise
    np.testing.assert_allclose(weak, 1.0, atol=0.02)
    assert (widened(rows((100.0, 40.0), (101.0, 40.0)), 1e-3) < 1.01).all()


def test_paths_that_were_fitted_together_hold_each_other_already():
    found = rows((100.0, 40.0), (100.5, 40.0))
    assert (widened(found, 1e9)[:, 0] > 2).all()
    np.testing.assert_array_equal(widened(found, 1e9, pair=3), 1.0)
