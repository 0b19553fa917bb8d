"""De-embedding gives the channel back, whatever the instrument."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from erm.common.errors import DataError
from sounder.cir.deembedding import REGULARISATION, band_window, make_deembedding
from sounder.instrument.waveform import PRIMITIVE_POLYNOMIALS, band_limited_template, held_template, m_sequence

SAMPLE = 1 / 1.2e9
PERIOD = 1022 * SAMPLE


def around(delay, center):
    """Delays relative to a center on the circle of one period."""
    return (delay - center + PERIOD / 2) % PERIOD - PERIOD / 2


def one_path(bench, delay, gain=1.0):
    return gain * np.exp(-2j * np.pi * bench.frequency * delay)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    seed=st.integers(0, 10**6),
    delay=st.one_of(st.floats(0, PERIOD), st.floats(PERIOD - 5e-9, PERIOD + 5e-9)),
    offset=st.complex_numbers(max_magnitude=0.2),
)
@pytest.mark.slow
def test_a_path_is_a_pulse_and_nothing_else(bench_maker, seed, delay, offset):
    bench = bench_maker(seed=seed, offset=offset)
    cir = bench.cir(one_path(bench, delay), offset=3 * offset)
    late = around(np.arange(1022) * SAMPLE, delay)
    level = 20 * np.log10(np.abs(cir) / np.abs(cir).max())
    # Hann's sidelobes fall by 18 dB an octave from -31 dB at 2.4 / 1.08 GHz: -70 dB at 10 ns. The regularisation bends
    # the window by up to 1e-4 / 0.1 near the edge, where it is under 0.01: under -75 dB.
    assert level[np.abs(late) > 10e-9].max() < -65
    assert abs(late[np.argmax(level)]) <= 0.5 * SAMPLE * (1 + 1e-6)


def test_pulse_is_what_a_path_makes_and_peaks_at_its_amplitude(bench_maker):
    for seed in range(10):
        bench = bench_maker(seed=seed)
        # Capturing the back-to-back in complex64 leaves 6e-8 of its power; the median of the restored DC adds
        # that of the pulse's sidelobes, under -90 dB at most delays.
        np.testing.assert_allclose(bench.cir(np.ones(1022)), bench.filter_.pulse, atol=1e-4)
        assert bench.filter_.pulse[0] == pytest.approx(1, abs=1e-12)
        assert np.argmax(np.abs(bench.filter_.pulse)) == 0


@pytest.mark.slow
def test_random_channels_through_random_instruments_come_back(bench_maker):
    """Amplitude, phase and delay of up to five paths, each a resolution cell or more from the others."""
    rng = np.random.default_rng(7)
    for seed in range(40):
        bench = bench_maker(seed=1000 + seed)
        count = int(rng.integers(1, 6))
        delays = 20e-9 + np.cumsum(rng.uniform(4e-9, 150e-9, count))
        gains = 10 ** (rng.uniform(-20, 0, count) / 20) * np.exp(2j * np.pi * rng.random(count))
        cir = bench.cir(gains @ np.exp(-2j * np.pi * np.multiply.outer(delays, bench.frequency)))
        # The band kept of the true channel: what an ideal instrument with this window would see.
        weight = band_window(bench.sounder)
        model = np.exp(-2j * np.pi * np.multiply.outer(delays, bench.frequency)) * weight / weight.sum() * 1022
        got, *_ = np.linalg.lstsq(np.fft.ifft(model).T, cir, rcond=None)
        # Regularisation: 1e-4 of the mean power, so 1e-4 in the middle and 1e-2 at the edge, where the window is 1 %.
        # The pulses overlap by the sidelobes of 4 ns, which magnifies the error of the weakest tenfold at most.
        np.testing.assert_allclose(got, gains, atol=2e-3)


def test_regularisation_costs_nothing_where_the_instrument_passes(bench_maker):
    bench = bench_maker(seed=3)
    through = np.abs(bench.sent) ** 2
    inside = band_window(bench.sounder) > 0
    inside[0] = False
    eps = REGULARISATION * through[inside].mean()
    ratio = bench.filter_.weight[inside] / band_window(bench.sounder)[inside]
    np.testing.assert_allclose(ratio, through[inside] / (through[inside] + eps), rtol=1e-5)
    # held chips are 20 log10(sinc(0.9)) = -19 dB at the band's edge
    assert ratio.min() > 0.98


def test_deembedding_is_linear(bench_maker):
    bench = bench_maker(seed=9)
    a, b = one_path(bench, 100e-9), one_path(bench, 300.3e-9)
    both = bench.cir(2 * a - 0.5j * b)
    # the restored DC is a median, which is not linear: it may differ by the sidelobes far out, under -80 dB
    np.testing.assert_allclose(both, 2 * bench.cir(a) - 0.5j * bench.cir(b), atol=2e-4)


def test_noise_gain_is_the_filters_norm(bench_maker):
    """White noise of power s2 a sample comes out with ``s2 / N sum |T G|^2``, and little over the matched filter's."""
    bench = bench_maker()
    template = np.fft.fft(held_template(bench.sounder.waveform))
    predicted = np.sum(np.abs(template * bench.filter_.transfer) ** 2) / 1022
    rng = np.random.default_rng(2)
    white = rng.standard_normal((400, 1022, 2)) @ [1, 1j] / np.sqrt(2)
    got = np.mean(np.abs(bench.filter_.apply(bench.correlate(white))) ** 2)
    # 400 captures of about 450 independent bins (Hann over 0.9 of the band): 1/sqrt(180000) = 0.24 %, 4 deviations
    assert got == pytest.approx(predicted, rel=0.01)
    # A matched filter has s2 / sum|x|^2 = s2 / (1022 P) for the same peak; the Hann window over a flat band loses
    # 10 log10(1.5), the inverse of the sinc up to 0.9 of its null some more: together under 3 dB.
    tx = 10 ** (bench.sounder.tx_antenna.gain / 10)
    loss = 10 * np.log10(predicted * tx * 1022)
    assert 0 < loss < 3


def test_attenuator_gives_absolute_gain_and_delay(bench_maker):
    """An attenuator of 60 dB, 1.7 ns and a slope of 3 dB/GHz is in the back-to-back, not in the channel."""
    frequency = np.linspace(131e9, 133e9, 401)

    def s21(f):
        return 10 ** ((-60 + 3e-9 * (f - 132e9)) / 20) * np.exp(-2j * np.pi * f * 1.7e-9)

    plain = bench_maker(seed=4)
    bench = bench_maker(seed=4, spectrum=s21(plain.frequency + 132e9), s21=(frequency, s21(frequency)))
    cir = bench.cir(one_path(bench, 200e-9, 1e-5))
    ideal = plain.cir(one_path(plain, 200e-9, 1e-5))
    # The regularisation sees a tilted spectrum: 1.6 dB at the edges, where its 1e-4 has 1e-2 weight.
    np.testing.assert_allclose(cir / 1e-5, ideal / 1e-5, atol=1e-3)
    assert np.abs(cir[240]) == pytest.approx(1e-5, rel=1e-3)


def test_attenuation_scale_and_antenna_move_the_level_by_their_decibels(bench_maker):
    at = 120 * SAMPLE
    plain = bench_maker()
    level = np.abs(plain.cir(one_path(plain, at)))[120]
    for change, db in (
        ({"attenuation": 60.0}, -60.0),
        ({"scale_factor": 0.1}, 20.0),  # the same numbers were smaller signals: less went through the cable
        ({"includes_tx_antenna": True}, plain.sounder.tx_antenna.gain),
    ):
        bench = bench_maker(**change)
        assert 20 * np.log10(np.abs(bench.cir(one_path(bench, at)))[120] / level) == pytest.approx(db, abs=1e-6)


def test_offset_of_the_receiver_leaves_no_trace(bench_maker):
    """DC is not measured; it is restored from the channel's being empty at most delays."""
    rng = np.random.default_rng(5)
    for seed in range(10):
        bench = bench_maker(seed=seed, offset=rng.standard_normal() + 1j)
        channel = one_path(bench, rng.uniform(0, PERIOD))
        with_, without = bench.cir(channel, offset=100 * np.exp(1j * seed)), bench.cir(channel)
        # the bin of DC is multiplied by exactly zero: only rounding of 100 * 511 * 1022 is left
        np.testing.assert_allclose(with_, without, atol=1e-9)
        assert abs(np.median(with_.real)) < 1e-12
        # One bin of 919 kept is worth about 1 / 460 of the peak; left out it would stand under all delays.
        empty = np.abs(around(np.arange(1022) * SAMPLE, np.argmax(np.abs(with_)) * SAMPLE)) > 50e-9
        assert np.abs(with_[empty]).max() < 1e-4


def test_null_of_the_held_chip_does_not_blow_up(bench_maker, description):
    """The held chip is zero at the chip rate; whatever band is asked for, noise there stays finite and weak."""
    for bandwidth in (0.2e9, 1.08e9, 1.19999e9):
        bench = bench_maker(description(processing={"bandwidth": bandwidth}), seed=6)
        transfer = np.abs(bench.filter_.transfer)
        assert np.isfinite(transfer).all()
        assert transfer[511] == 0
        assert transfer[0] == 0
        noise = bench.noise(np.random.default_rng(1), 4)
        assert np.isfinite(noise).all()
        # |B| / (|B|^2 + eps) is at most 1 / (2 sqrt(eps)) = 50 times the mean's inverse; the window is under 0.01 there
        middle = np.median(transfer[transfer > 0])
        assert transfer.max() < 20 * middle


@pytest.mark.parametrize("order", [7, 8, 10])
@pytest.mark.parametrize("samples_per_chip", [1, 2, 3, 4])
def test_other_sequences_and_rates(bench_maker, description, order, samples_per_chip):
    polynomial = {7: (7, 1, 0), 8: (8, 4, 3, 2, 0), 10: (10, 3, 0)}[order]
    rate = 600e6 * samples_per_chip
    waveform = {"order": order, "polynomial": polynomial, "samples_per_chip": samples_per_chip, "sample_rate": rate}
    bench = bench_maker(description(waveform=waveform, processing={"bandwidth": None}), seed=8)
    size = bench.system.size
    cir = bench.cir(one_path(bench, 40.25 / rate))
    band = bench.sounder.bandwidth
    late = (np.arange(size) - 40.25 + size / 2) % size - size / 2
    # first sidelobe of Hann at 2.4 / B; the DC bin, interpolated, is a wider part of shorter sequences
    assert 20 * np.log10(np.abs(cir[np.abs(late) / rate > 8 / band]).max()) < -50
    assert np.abs(cir).max() == pytest.approx(1, abs=0.1)


def test_another_sounders_back_to_back_is_refused(description, back_to_back_maker):
    ours = description()
    sent = np.fft.fft(band_limited_template(ours.waveform))
    good = back_to_back_maker(ours, sent)

    def correlated(b2b):
        return np.fft.ifft(np.fft.fft(b2b.captures[0]) * np.conj(np.fft.fft(held_template(ours.waveform))))

    make_deembedding(good, correlated(good), ours, 1.0)

    faster = description(waveform={"chip_rate": 700e6, "sample_rate": 1.4e9})
    with pytest.raises(
        DataError, match=r"b2b\.h5: back-to-back of another sounder: sample rate .* 1\.4e\+09.*1\.2e\+09"
    ):
        make_deembedding(replace(good, sounder=faster), correlated(good), ours, 1.0)
    elsewhere = description(carrier={"frequency": 138e9, "lo_frequency": 22e9})
    with pytest.raises(DataError, match=r"carrier \[Hz\] 1\.38e\+11, the recording has 1\.32e\+11"):
        make_deembedding(replace(good, sounder=elsewhere), correlated(good), ours, 1.0)
    longer = description(waveform={"order": 10, "polynomial": (10, 3, 0)})
    captures = np.zeros((1, longer.waveform.samples), np.complex64)
    with pytest.raises(DataError, match="samples per capture 2046, the recording has 1022"):
        make_deembedding(replace(good, captures=captures, sounder=longer), correlated(good), ours, 1.0)


@pytest.mark.parametrize("order", [7, 9, 10])
def test_back_to_back_of_another_sequence_of_the_same_length_is_refused(
    description, back_to_back_maker, bench_maker, order
):
    """All of them: preferred pairs, whose correlation is mostly -1, and the worst, peaking 8.5 dB under full gain."""
    ours = description(waveform={"order": order, "polynomial": PRIMITIVE_POLYNOMIALS[order]})
    template = np.fft.fft(held_template(ours.waveform))
    bits = m_sequence(order, PRIMITIVE_POLYNOMIALS[order])
    length, n = bits.size, np.arange(bits.size)
    cosets = {min((int(d) << k) % length for k in range(order)) for d in n[1:]}
    others = [d for d in cosets if d > 1 and np.gcd(d, length) == 1]
    assert len(others) == {7: 18, 9: 48, 10: 60}[order] - 1
    bench = bench_maker(ours, seed=order)
    for decimation in others:
        sent = np.fft.fft(np.repeat(1.0 - 2.0 * bits[decimation * n % length], 2)) * bench.system
        with pytest.raises(DataError, match="does not stand out"):
            make_deembedding(back_to_back_maker(ours, sent), np.fft.ifft(sent * np.conj(template)), ours, 1.0)


def test_empty_back_to_back_is_refused(description, back_to_back_maker):
    sounder = description()
    b2b = back_to_back_maker(sounder, np.zeros(1022))
    with pytest.raises(DataError, match=r"b2b\.h5: all back-to-back samples are zero; record it again"):
        make_deembedding(b2b, np.zeros(1022, complex), sounder, 1.0)


@pytest.mark.parametrize("wrong", [0.0, np.nan])
def test_attenuator_without_transmission_is_refused(bench_maker, wrong):
    frequency, s21 = np.linspace(131e9, 133e9, 11), np.full(11, 1e-3 + 0j)
    s21[5] = wrong
    with pytest.raises(DataError, match=r"zero or not a number at 1 of 11 frequencies, first at 132\.000 GHz"):
        bench_maker(s21=(frequency, s21))


def test_attenuator_that_was_not_measured_over_the_band_is_refused(bench_maker):
    frequency = np.linspace(131.9e9, 132.1e9, 11)
    with pytest.raises(
        DataError, match=r"measured from 131\.90 to 132\.10 GHz; expected the band kept, 131\.46 to 132\.54 GHz"
    ):
        bench_maker(s21=(frequency, np.full(11, 1e-3 + 0j)))
