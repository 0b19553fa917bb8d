"""The shipped calibration files are what their script makes, and agree with each other."""

import runpy

import numpy as np
import pytest

from sounder import shipped
from sounder.instrument.antenna_pattern import Pattern
from sounder.instrument.description import load_sounder
from sounder.instrument.touchstone import read_s21
from sounder.instrument.waveform import identify
from sounder.processing.recording_summary import describe_back_to_back
from sounder.recordings import native
from sounder.twin.receiver import back_to_back

B2B = "back-to-back-132ghz.h5"
RECORDING = "recording-132ghz.h5"


@pytest.fixture(scope="module")
def sounder():
    return load_sounder(shipped.calibration("sounder-132ghz.toml"))


@pytest.fixture(scope="module")
def b2b():
    return native.back_to_back(shipped.calibration(B2B))


def test_the_script_makes_the_same_numbers_again(tmp_path, b2b):
    runpy.run_path(str(shipped.calibration("make_synthetic.py")))["main"](tmp_path)
    for name in ("horn-132ghz.csv", "attenuator-60db.s2p"):
        assert (tmp_path / name).read_text() == shipped.calibration(name).read_text()
    again = native.back_to_back(tmp_path / B2B)
    # another build of the FFT may round one sample the other way
    assert np.abs(again.captures.astype(int) - b2b.captures).max() <= 4
    assert again.scale_factor == b2b.scale_factor
    assert again.title == b2b.title
    ([made], [kept]) = (native.recordings(file) for file in (tmp_path / RECORDING, shipped.calibration(RECORDING)))
    for direction in ((0, 0), (7, 1)):
        assert np.abs(made.captures(*direction).astype(int) - kept.captures(*direction)).max() <= 4


def test_every_file_says_that_it_is_synthetic(b2b):
    assert dict(describe_back_to_back(b2b))["title"] == b2b.title
    assert b2b.title.startswith("SYNTHETIC ")
    [recording] = native.recordings(shipped.calibration(RECORDING))
    assert recording.name == "synthetic-two-paths"
    for name in ("horn-132ghz.csv", "attenuator-60db.s2p"):
        assert "SYNTHETIC" in shipped.calibration(name).read_text().splitlines()[0]


def test_back_to_back_is_of_this_sounder_through_this_attenuator(sounder, b2b):
    assert b2b.sounder == sounder
    band = sounder.carrier.frequency + np.array([-0.5, 0.5]) * sounder.waveform.sample_rate
    frequency, s21 = read_s21(shipped.calibration("attenuator-60db.s2p"), band=(band[0], band[1]))
    assert b2b.s21 is not None
    assert b2b.s21[0] == pytest.approx(frequency)
    assert b2b.s21[1] == pytest.approx(s21)
    assert b2b.attenuation == pytest.approx(60, abs=0.3)
    assert not b2b.includes_tx_antenna
    found = identify((b2b.captures.astype(float) @ [1, 1j]).mean(axis=0))
    assert found.polynomial == sounder.waveform.polynomial
    assert found.direction == sounder.waveform.direction


def test_back_to_back_does_not_clip_and_is_well_above_noise(sounder, b2b):
    assert np.abs(b2b.captures.astype(int)).max() < 2**15 - 1
    samples = b2b.captures.astype(float) @ [1, 1j] * b2b.scale_factor
    mean = samples.mean(axis=0)
    assert 10 * np.log10(np.mean(np.abs(mean) ** 2)) == pytest.approx(10 - 60, abs=1)
    # thermal noise of -75.2 dBm under -50 dBm leaves 25 dB before 15 dB of averaging
    residual = samples - mean
    assert 10 * np.log10(np.mean(np.abs(mean) ** 2) / np.mean(np.abs(residual) ** 2)) > 22


def test_a_campaign_with_default_faults_has_the_shipped_instrument(sounder, b2b):
    other = back_to_back(sounder, read_s21(shipped.calibration("attenuator-60db.s2p")), seed=1)
    spectra = [np.fft.fft((x.captures.astype(float) @ [1, 1j]).mean(axis=0)) for x in (other, b2b)]
    frequency = np.fft.fftfreq(sounder.waveform.samples, 1 / sounder.waveform.sample_rate)
    middle = (np.abs(frequency) < 450e6) & (frequency != 0)
    # SNR a bin: 25 + 15 dB less 9 dB for the chip's spectrum at 450 MHz, of both; 1022 bins, so 5 deviations:
    # the phases of the two oscillators wander by up to sqrt(2 pi 50 Hz 27 us) = 0.09 rad each
    ratio = spectra[0][middle] / spectra[1][middle]
    assert np.abs(np.abs(ratio) - 1).max() < 5 * np.sqrt(2) * 10 ** (-31 / 20)
    assert abs(np.angle(ratio.mean())) < 5 * np.sqrt(2) * 0.09


def test_horn_is_the_one_described(sounder):
    horn = Pattern.of(sounder.rx_antenna)
    for plane, hpbw in (("azimuth", 10.0), ("elevation", 9.0)):
        cut = np.asarray(getattr(sounder.rx_antenna.cut, plane))
        angle = np.asarray(sounder.rx_antenna.cut.angle)
        # the file's points are a degree apart: linear between, a parabola of 12 dB/hpbw^2 is off by 1/4 of that
        assert np.interp([-hpbw / 2, hpbw / 2], angle, cut) == pytest.approx(10 * np.log10(0.5), abs=3 / hpbw**2 + 0.05)
        inner = cut[(angle >= 0) & (angle < 40)]
        rising = np.flatnonzero(np.diff(inner) > 0)[0]
        assert inner[rising:].max() == pytest.approx(-22, abs=1.5)  # the highest sidelobe
        assert cut.min() >= -45
        assert cut[np.abs(angle) > 120].mean() == pytest.approx(-40, abs=3)
    assert horn.relative_gain(np.zeros(1), np.zeros(1))[0] == 0
