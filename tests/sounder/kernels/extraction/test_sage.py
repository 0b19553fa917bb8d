"""Successive cancellation: what is taken out is what was there."""

import numpy as np
import pytest

from sounder.instrument.antenna_description import Antenna
from sounder.instrument.antenna_pattern import Pattern
from sounder.kernels.extraction.peak_search import new_search
from sounder.kernels.extraction.records import PATH
from sounder.kernels.extraction.sage import Effort, cancel
from sounder.kernels.extraction.workspace import workspace

SIZE = 300
SAGE = Effort(removes=1, refits=3, passes=2)
PATTERN = Pattern.of(Antenna(gain=24.5, hpbw_azimuth=10.0, hpbw_elevation=9.0))
LOOKS = np.array([[a, e] for a in range(0, 360, 10) for e in (-9, 0, 9)], float)


@pytest.fixture
def beams_of(hann):
    """Beams of paths (amplitude, delay [sample], azimuth, elevation), with a phase of its own in each beam."""

    def make(paths, rng):
        beams = np.zeros((len(LOOKS), SIZE), complex)
        for amplitude, delay, azimuth, elevation in paths:
            g = 10 ** (PATTERN.beam_gain(azimuth, elevation, LOOKS[:, 0], LOOKS[:, 1]) / 20)
            each = amplitude * g * np.exp(2j * np.pi * rng.random(len(LOOKS)))
            beams += each[:, None] * hann.row(delay, SIZE)
        return beams

    return make


@pytest.fixture
def run(make_view):
    def cancelled(beams, *, noise=1e-8, capacity=50, effort=SAGE):
        left = beams.astype(np.complex64)
        view = make_view(PATTERN, LOOKS, np.where(np.isfinite(beams[:, 0]), noise, np.nan), 36, 3, True)
        work = workspace(view)
        found, removed = np.zeros((capacity, 2), PATH), np.zeros((capacity, len(LOOKS)), np.complex64)
        count, complete = cancel(left, view, effort, work, new_search(left, work), found, removed)
        return found[:count, 0], left, complete

    return cancelled


def noise_of(rng, power=1e-8):
    return np.sqrt(power / 2) * (rng.standard_normal((len(LOOKS), SIZE, 2)) @ [1, 1j])


def test_paths_are_found_and_nothing_is_left(run, beams_of):
    rng = np.random.default_rng(1)
    paths = [(1.0, 40.3, 3.0, 2.0), (0.5, 120.8, 358.0, -7.0), (0.2, 299.6, 181.0, 0.0)]
    found, left, complete = run(beams_of(paths, rng) + noise_of(rng))
    assert complete
    assert len(found) == 3
    found = found[np.argsort(-found["amplitude"])]
    expected = np.array(paths)
    got = np.stack([found[name] for name in ("amplitude", "delay", "azimuth", "elevation")], axis=-1)
    got[:, 2] = expected[:, 2] + (got[:, 2] - expected[:, 2] + 180) % 360 - 180
    got[:, 1] = expected[:, 1] + (got[:, 1] - expected[:, 1] + SIZE / 2) % SIZE - SIZE / 2
    # 66 dB over the noise for the weakest: 5e-4 of amplitude, and 1e-3 of the widths of pulse and beam
    np.testing.assert_allclose(got, expected, atol=0.01)
    # The table is good to 2.4e-4 of a path; where a path stands under a tenth of the noise it stays: 1.1 of the noise
    assert np.mean(np.abs(left) ** 2) < 1.2 * 1e-8 + np.mean(np.abs(beams_of(paths, rng)) ** 2) * 2.4e-4**2


def test_missing_beams_are_passed_over(run, beams_of):
    rng = np.random.default_rng(2)
    beams = beams_of([(1.0, 40.3, 3.0, 2.0)], rng) + noise_of(rng)
    beams[60:] = np.nan
    found, left, _ = run(beams)
    assert len(found) == 1
    assert found["azimuth"][0] == pytest.approx(3.0, abs=0.01)
    assert np.isfinite(left[:60]).all()
    assert np.isnan(left[60:]).all()


def test_a_full_table_is_not_complete(run, beams_of):
    rng = np.random.default_rng(3)
    paths = [(1.0 - 0.1 * k, 20.0 + 40 * k, 50.0 * k, 0.0) for k in range(6)]
    beams = beams_of(paths, rng) + noise_of(rng)
    found, _, complete = run(beams, capacity=4)
    assert len(found) == 4
    assert not complete
    assert run(beams, capacity=6)[2]


def test_silence_holds_no_paths(run):
    found, left, complete = run(np.zeros((len(LOOKS), SIZE)))
    assert len(found) == 0
    assert complete
    assert not left.any()


@pytest.mark.parametrize(("apart", "tolerance"), [(2.7, 0.01), (3.0, 0.005), (4.0, 0.005)])
def test_paths_within_each_others_pulse_are_told_apart(run, beams_of, apart, tolerance):
    """The pulse is 4.4 samples wide from null to null; two of them are two, with no third between."""
    rng = np.random.default_rng(4)
    for _ in range(12):
        delay, azimuth, more = rng.uniform(20, 270), rng.uniform(0, 350), rng.uniform(1, 8)
        paths = np.array([(1.0, delay, azimuth, 0.0), (0.6, delay + apart, azimuth + more, 0.0)])
        found, *_ = run(beams_of(paths, rng) + noise_of(rng, 1e-6), noise=1e-6)
        assert len(found) == 2, (delay, azimuth)
        found = found[np.argsort(-found["amplitude"])]
        got = np.stack([found["amplitude"], found["delay"]], axis=-1)
        # noise at -60 dB: 1e-3 / sqrt(2) of amplitude, divided by 0.8 rad a sample of delay, and by 0.6; four times.
        # The rest is what rounds of fitting leave of an overlap of 0.2 at 2.7 samples and under 0.1 from 3 on.
        np.testing.assert_allclose(got, paths[:, :2], atol=tolerance + 4e-3)
