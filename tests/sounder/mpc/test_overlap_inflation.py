"""How much neighbours inflate the errors of a path, by closed form."""

import numpy as np
import pytest

from sounder.cir.deembedding import Deembedding
from sounder.instrument.antenna_description import Antenna
from sounder.kernels.extraction.records import PATH
from sounder.mpc.scan import Scan
from sounder.mpc.uncertainty import beam_power, overlap_inflation

SIZE, RATE = 1022, 1.2e9
LINES = 919
"""Lines of a flat band, symmetric about the carrier."""


@pytest.fixture(scope="module")
def scan(bench):
    """Beams of a Gaussian horn with noise of power 1, white within a flat band."""
    band = (np.abs(np.fft.fftfreq(SIZE, 1 / SIZE)) <= LINES // 2).astype(float)
    filter_ = Deembedding(transfer=band + 0j, pulse=np.fft.ifft(band), weight=band, noise=band, sample_rate=RATE)
    horn = Antenna(gain=24.5, hpbw_azimuth=10.0, hpbw_elevation=9.0)
    sounder = bench.sounder.model_copy(update={"rx_antenna": horn})
    azimuth, elevation = np.arange(0.0, 360.0, 10.0), np.array([-9.0, 0.0, 9.0])
    beams = azimuth.size * elevation.size
    cir, noise = np.zeros((beams, SIZE), np.complex64), np.ones(beams)
    return Scan(cir, azimuth, elevation, noise, noise, filter_, sounder)


def inflation(scan, *paths, snr, group=-1):
    """Of paths of delay [sample] and azimuth, with the highest SNR that the margin of the pattern allows."""
    found = np.zeros(len(paths), PATH)
    for record, (delay, azimuth) in zip(found, paths, strict=True):
        record["delay"], record["azimuth"] = delay, azimuth
    found["amplitude"] = np.sqrt(snr) / scan.pattern_margin
    return overlap_inflation(found, beam_power(found, scan), np.full(len(found), group), scan)


def test_alone_a_path_is_known_as_well_as_alone(scan):
    np.testing.assert_array_equal(inflation(scan, (10.0, 40.0), (17.0, 40.0), (300.0, 40.0), snr=1e4), 1.0)
    assert inflation(scan, snr=1e4).shape == (0, 2)


@pytest.mark.parametrize("late", [0.7, 1.0, 1.6, 2.5])
def test_a_strong_neighbour_in_the_same_beams_takes_what_its_pulse_shares(scan, late):
    """Two unit vectors with inner product r: an amplitude beside another unknown one has the variance 1 / (1 - |r|^2).

    For a flat band of width ``B``, ``r = sinc(B t)``; of the derivative by delay, of squared norm ``(pi B)^2 / 3``, the
    other pulse takes the square of ``r' / sqrt(1 - r^2)``.
    """
    cycles = LINES / SIZE * late
    r = np.sinc(cycles)
    slope = (np.cos(np.pi * cycles) - r) / late
    delay, magnitude = inflation(scan, (100.0, 40.0), (100.0 + late, 40.0), snr=1e9)[0]
    assert magnitude == pytest.approx(1 / (1 - r**2), rel=1e-3)
    full = (np.pi * LINES / SIZE) ** 2 / 3
    assert delay == pytest.approx(1 / (1 - slope**2 / (1 - r**2) / full), rel=1e-3)


def test_a_neighbour_that_these_beams_do_not_see_takes_nothing(scan):
    weak = inflation(scan, (100.0, 40.0), (101.0, 220.0), snr=10.0)  # 30 dB under 10 dB over the noise
    np.testing.assert_allclose(weak, 1.0, atol=0.02)
    assert (inflation(scan, (100.0, 40.0), (101.0, 40.0), snr=1e-3) < 1.01).all()


def test_paths_that_were_fitted_together_hold_each_other_already(scan):
    paths = (100.0, 40.0), (100.5, 40.0)
    assert (inflation(scan, *paths, snr=1e9)[:, 0] > 2).all()
    np.testing.assert_array_equal(inflation(scan, *paths, snr=1e9, group=3), 1.0)
