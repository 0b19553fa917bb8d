"""Captures to CIRs: correlation, averages over snapshots, gain, and what is wrong with captures."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from erm.common.errors import DataError
from sounder.cir.impulse_response import calibrate, impulse_responses
from sounder.instrument.waveform import chips, held_template
from sounder.kernels.correlation.m_sequence import MSequenceCorrelator
from sounder.recordings.recording import CLIPPED_SHARE, Recording
from sounder.remark import Code, Remark

SCALE = 1e-6


@pytest.fixture(scope="module")
def small(description):
    """One direction of the shipped sounder."""
    return description(scan={"azimuth": (0.0,), "elevation": (0.0,)})


@pytest.fixture(scope="module")
def small_bench(bench_maker, small):
    return bench_maker(small)


def recording_of(sounder, captures, **changes):
    """Recording of captures (azimuth, elevation, snapshot, sample[, iq])."""
    shape = captures.shape[:2]
    made = Recording(
        name="RX1",
        source=Path("rx1.h5"),
        sounder=sounder,
        azimuth=10.0 * np.arange(shape[0]),
        elevation=9.0 * np.arange(shape[1]),
        snapshots=captures.shape[2],
        tx_position=np.zeros(3),
        rx_position=np.ones(3),
        scale_factor=SCALE,
        agc_gain=np.zeros(shape),
        valid=np.ones(shape, bool),
        los=-1,
        time=None,
        read=lambda a, e, which: captures[a, e, which],
    )
    return replace(made, **changes)


def sent(bench, delay=200 / 1.2e9, amplitude=1000.0):
    """One capture of a path, in LSB."""
    spectrum = bench.sent * np.exp(-2j * np.pi * bench.frequency * delay)
    return amplitude * np.fft.ifft(spectrum)


def as_int16(signal):
    return np.round(np.stack([signal.real, signal.imag], axis=-1)).astype(np.int16)


def white(rng, *shape):
    return rng.standard_normal((*shape, 2)) @ [1, 1j] / np.sqrt(2)


def responses(bench, captures, averaging="coherent", **changes):
    recording = recording_of(bench.sounder, captures, **changes)
    dataset, remarks = impulse_responses(recording, bench.filter_, averaging=averaging)
    return dataset["cir"].values, remarks


@pytest.mark.parametrize("polarity", [1, -1])
@pytest.mark.slow
def test_ideal_template_gives_1022_510_and_minus_2(small, polarity):
    correlator = MSequenceCorrelator(chips(small.waveform), 2)
    capture = (polarity * as_int16(held_template(small.waveform) + 0j))[None]
    (got,) = correlator.correlate(np.ascontiguousarray(capture, np.int16))
    # 511 chips of 2 samples: 1022 in line, half of the chips in line and half against their neighbours plus a chip
    # (1022 - 2) / 2 = 510 one sample off, and -1 a chip anywhere else
    expected = np.full(1022, -2.0)
    expected[[0, 1, -1]] = 1022, 510, 510
    assert np.array_equal(got, polarity * expected)


def test_delayed_template_peaks_at_its_delay(small):
    correlator = MSequenceCorrelator(chips(small.waveform), 2)
    delays = np.random.default_rng(1).integers(0, 1022, 20)
    captures = np.stack([as_int16(np.roll(held_template(small.waveform), d) + 0j) for d in delays])
    got = np.abs(correlator.correlate(captures))
    assert np.array_equal(np.argmax(got, axis=1), delays)


@pytest.mark.slow
def test_int16_and_complex_captures_of_the_same_numbers_are_the_same(small_bench):
    captures = as_int16(sent(small_bench))[None, None, None]
    integers, _ = responses(small_bench, captures)
    floats, _ = responses(small_bench, (captures[..., 0] + 1j * captures[..., 1]).astype(np.complex64))
    # float32 transforms of 1022 samples: some 1e-6 of the peak
    np.testing.assert_allclose(floats, integers, atol=3e-6 * np.abs(integers).max())


@pytest.mark.parametrize("snapshots", [4, 16, 64])
def test_coherent_mean_takes_10_log_s_off_the_noise(small_bench, snapshots):
    rng = np.random.default_rng(snapshots)
    noise = 300 * white(rng, 1, 1, snapshots, 1022)
    one, _ = responses(small_bench, as_int16(noise[:, :, :1]))
    all_, _ = responses(small_bench, as_int16(noise))
    gain = 10 * np.log10(np.mean(np.abs(one) ** 2) / np.mean(np.abs(all_) ** 2))
    # Each mean is over some 450 independent bins (Hann over 0.9 of the band): 0.2 dB each, 0.3 dB together; four times.
    assert gain == pytest.approx(10 * np.log10(snapshots), abs=1.2)


def test_phase_alignment_undoes_a_random_phase_a_snapshot(small_bench):
    """With S random phases the coherent mean keeps 1/S of the power; aligned, all of it."""
    rng = np.random.default_rng(3)
    phases = np.exp(2j * np.pi * rng.random(64))
    captures = as_int16((phases[:, None] * sent(small_bench) + 100 * white(rng, 64, 1022))[None, None])
    clean, _ = responses(small_bench, as_int16(sent(small_bench))[None, None, None])
    peak = np.abs(clean).max()
    coherent, _ = responses(small_bench, captures)
    aligned, _ = responses(small_bench, captures, "phase-aligned")
    assert np.abs(coherent).max() / peak == pytest.approx(abs(phases.mean()), abs=0.02)
    # Each snapshot's phase is read from its whole energy, 20 dB + 30 dB over the noise: 0.003 rad, cos = 1 - 1e-5;
    # the mean's noise is 20 + 30 + 18 dB under the peak, 4e-4 of it.
    assert np.abs(aligned).max() / peak == pytest.approx(1, abs=2e-3)
    noise = np.median(np.abs(aligned) ** 2) / np.log(2)
    single, _ = responses(small_bench, captures[:, :, :1])
    gain = 10 * np.log10(np.median(np.abs(single) ** 2) / np.log(2) / noise)
    assert gain == pytest.approx(10 * np.log10(64), abs=1.5)


def test_phase_alignment_of_a_stable_phase_is_the_coherent_mean(small_bench):
    captures = as_int16(np.tile(sent(small_bench), (1, 1, 8, 1)))
    coherent, _ = responses(small_bench, captures)
    aligned, _ = responses(small_bench, captures, "phase-aligned")
    np.testing.assert_allclose(aligned, coherent, atol=1e-5 * np.abs(coherent).max())


def test_power_average_keeps_the_power_of_a_moving_channel(small_bench):
    """Two paths whose phases are random from snapshot to snapshot keep their mean power; coherently they vanish."""
    rng = np.random.default_rng(4)
    near, far = sent(small_bench, 200 / 1.2e9), sent(small_bench, 500 / 1.2e9, 300.0)
    phases = np.exp(2j * np.pi * rng.random((256, 2)))
    captures = as_int16((phases @ np.stack([near, far]))[None, None])
    clean, _ = responses(small_bench, as_int16(near)[None, None, None])
    peak = np.abs(clean).max()
    power, _ = responses(small_bench, captures, "power")
    coherent, _ = responses(small_bench, captures)
    magnitude = np.abs(power[0, 0]) / peak
    # rounding to LSB and the sidelobes of the other path, -70 dB, are what there is besides
    assert magnitude[200] == pytest.approx(1.0, abs=2e-3)
    assert magnitude[500] == pytest.approx(0.3, abs=2e-3)
    # 256 random phases add up to 1/16 in the mean, over 4/16 once in 10 million
    assert np.abs(coherent).max() / peak < 0.25


@pytest.mark.parametrize("averaging", ["coherent", "phase-aligned", "power"])
def test_receiver_gain_is_taken_out(small_bench, averaging):
    one = sent(small_bench, amplitude=100.0)
    captures = np.stack([as_int16(one), as_int16(one * 10 ** (23 / 20))])[:, None, None]
    cir, _ = responses(small_bench, captures, averaging, agc_gain=np.array([[0.0], [23.0]]))
    level = 20 * np.log10(np.abs(cir).max(axis=-1)[:, 0])
    # rounding to LSB: 0.4 in 100 a sample, 30 dB less in the peak
    assert level[1] - level[0] == pytest.approx(0, abs=5e-3)


def test_zero_directions_are_left_out_and_reported(small_bench):
    captures = np.stack([as_int16(sent(small_bench)), np.zeros((1022, 2), np.int16)])[:, None, None]
    for averaging in ("coherent", "phase-aligned", "power"):
        cir, remarks = responses(small_bench, captures, averaging)
        assert np.isfinite(cir[0]).all()
        assert np.isnan(cir[1]).all()
        assert remarks == [Remark(Code.ALL_ZERO, 10.0, 0.0)]


def test_clipped_directions_are_used_and_reported(small_bench):
    loud = np.clip(as_int16(sent(small_bench, amplitude=20000.0)).astype(float) * 2, -32768, 32767).astype(np.int16)
    share = np.mean((loud == 32767) | (loud == -32768))
    assert share > 0.01
    cir, remarks = responses(small_bench, loud[None, None, None])
    assert np.isfinite(cir).all()
    (remark,) = remarks
    assert remark == Remark(Code.CLIPPED, 0.0, 0.0, figure=pytest.approx(share), bound=CLIPPED_SHARE)
    # samples that just touch the ends now and then are no clipping
    quiet = as_int16(sent(small_bench))
    quiet[0] = 32767
    assert responses(small_bench, quiet[None, None, None])[1] == []


def test_nothing_but_zeros_is_refused(small_bench):
    with pytest.raises(DataError, match=r"rx1\.h5: RX1: all samples are zero, in all directions"):
        responses(small_bench, np.zeros((2, 1, 3, 1022, 2), np.int16))


def test_directions_that_were_not_recorded_are_nan(small_bench):
    captures = np.stack([as_int16(sent(small_bench))] * 2)[:, None, None]
    cir, remarks = responses(small_bench, captures, valid=np.array([[False], [True]]))
    assert np.isnan(cir[0]).all()
    assert np.isfinite(cir[1]).all()
    assert remarks == []


def test_many_snapshots_pass_in_blocks(small_bench):
    """The mean of 700 snapshots is that of all, whichever blocks they are read in, and every one is read."""
    rng = np.random.default_rng(5)
    captures = as_int16(sent(small_bench) + 200 * white(rng, 700, 1022))[None, None]
    cir, _ = responses(small_bench, captures)
    mean = captures[0, 0].astype(float).mean(axis=0) @ [1, 1j]
    expected = small_bench.filter_.apply(small_bench.correlate(mean))
    np.testing.assert_allclose(cir[0, 0], expected, atol=3e-6 * np.abs(expected).max())


def test_back_to_back_calibrates_its_own_captures_to_one(small_bench, small, back_to_back_maker):
    """The cable measured through itself is the attenuator; int16 and complex back-to-backs alike."""
    captured = as_int16(sent(small_bench, 0.0))[None]
    b2b = back_to_back_maker(
        small, np.ones(1022), captures=captured, scale_factor=SCALE, attenuation=60.0, includes_tx_antenna=True
    )
    recording = recording_of(small, captured[None, None])
    for captures in (captured, (captured[..., 0] + 1j * captured[..., 1]).astype(np.complex64)):
        filter_ = calibrate(replace(b2b, captures=captures), recording)
        cir, _ = impulse_responses(recording, filter_)
        peak = cir["cir"].values[0, 0]
        assert np.argmax(np.abs(peak)) == 0
        # the regularisation takes 1e-4 at the middle of the band; the filter's norm takes it out again
        assert peak[0] == pytest.approx(1e-3, rel=1e-4)


def test_back_to_back_of_another_length_is_refused(small, back_to_back_maker, small_bench):
    recording = recording_of(small, as_int16(sent(small_bench))[None, None, None])
    b2b = back_to_back_maker(small, np.ones(2046))
    with pytest.raises(DataError, match="samples per capture 2046, the recording has 1022"):
        calibrate(b2b, recording)
    silent = back_to_back_maker(small, np.zeros(1022), captures=np.zeros((4, 1022, 2), np.int16))
    with pytest.raises(DataError, match="all back-to-back samples are zero"):
        calibrate(silent, recording)
