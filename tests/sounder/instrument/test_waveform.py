"""M-sequences have the properties Golomb proved, and a capture of one tells which it is."""

from math import gcd
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.io import loadmat
from scipy.signal import max_len_seq

from erm.common.errors import DataError
from sounder.instrument.waveform import (
    PRIMITIVE_POLYNOMIALS,
    band_limited_template,
    chips,
    held_template,
    identify,
    m_sequence,
)
from sounder.instrument.waveform_description import Waveform
from sounder.recordings.native import back_to_back
from sounder.shipped import calibration

ORDERS = range(7, 16)


def waveform(order: int = 9, polynomial: tuple[int, ...] | None = None, per_chip: int = 2, **keys) -> Waveform:
    polynomial = polynomial or PRIMITIVE_POLYNOMIALS[order]
    rates = {"chip_rate": 6e8, "samples_per_chip": per_chip, "sample_rate": 6e8 * per_chip}
    return Waveform(order=order, polynomial=polynomial, **rates, **keys)


def all_polynomials(order: int) -> list[tuple[int, ...]]:
    """Every primitive polynomial of an order, found by trying them all in the description."""
    found = []
    for taps in range(2 ** (order - 1)):
        polynomial = (order, *(e for e in range(order - 1, 0, -1) if taps >> (e - 1) & 1), 0)
        try:
            found.append(waveform(order, polynomial).polynomial)
        except ValueError:  # not primitive
            continue
    return found


def period(sequence: np.ndarray) -> int:
    """Smallest shift that leaves a periodic sequence as it is; it divides the length."""
    shifts = [n for n in range(1, sequence.size + 1) if sequence.size % n == 0]
    return next(n for n in shifts if np.array_equal(np.roll(sequence, n), sequence))


@pytest.mark.parametrize("order", ORDERS)
def test_properties_of_golomb(order):
    bits = m_sequence(order, PRIMITIVE_POLYNOMIALS[order])
    length = 2**order - 1
    assert bits.size == period(bits) == length
    assert bits.sum() == 2 ** (order - 1)  # balance: one 1 more than 0s
    spectrum = np.fft.fft(1.0 - 2.0 * bits)
    autocorrelation = np.fft.ifft(np.abs(spectrum) ** 2).real
    assert np.rint(autocorrelation[0]) == length
    # two values, L and -1; the FFT's rounding is far below a half
    assert np.abs(autocorrelation[1:] + 1).max() < 1e-6
    # half of the runs are single chips, a quarter double, ...
    runs = np.diff(np.flatnonzero(np.diff(np.concatenate([bits, bits]))))
    runs = runs[: np.cumsum(runs).searchsorted(length) + 1]
    assert np.count_nonzero(runs == 1) == pytest.approx(2 ** (order - 2), abs=1)
    assert runs.max() == order


@pytest.mark.parametrize("order", ORDERS)
def test_recurrence_is_that_of_the_polynomial(order):
    polynomial = PRIMITIVE_POLYNOMIALS[order]
    bits = np.tile(m_sequence(order, polynomial), 2)
    n = np.arange(2**order - 1)
    assert np.array_equal(bits[n + order], np.bitwise_xor.reduce([bits[n + e] for e in polynomial[1:]], axis=0))


@pytest.mark.parametrize("order", [7, 8, 9])
def test_there_are_as_many_primitive_polynomials_as_euler_says(order):
    # phi(2^m - 1) / m
    length = 2**order - 1
    assert len(all_polynomials(order)) == sum(gcd(n, length) == 1 for n in range(1, length)) / order


def test_held_template_correlates_to_1022_510_and_minus_2_with_itself():
    template = held_template(waveform())
    correlation = np.fft.ifft(np.abs(np.fft.fft(template)) ** 2).real
    values, counts = np.unique(np.rint(correlation).astype(int), return_counts=True)
    assert dict(zip(values.tolist(), counts.tolist(), strict=True)) == {1022: 1, 510: 2, -2: 1019}


@pytest.mark.parametrize("per_chip", [1, 2, 3, 4])
def test_band_limited_template_has_unit_power_and_nothing_beyond_the_main_lobe(per_chip):
    described = waveform(per_chip=per_chip)
    sent = band_limited_template(described)
    assert sent.shape == (511 * per_chip,)
    assert np.mean(np.abs(sent) ** 2) == pytest.approx(1)
    power = np.abs(np.fft.fft(sent)) ** 2
    frequency = np.abs(np.fft.fftfreq(sent.size, 1 / described.sample_rate))
    assert power[frequency > described.chip_rate].sum() < 1e-20 * power.sum()
    # below 0.9 of the edge the filter changes no bin but by the common scale
    edge = min(described.chip_rate, described.sample_rate / 2)
    inside = (frequency < 0.89 * edge) & (frequency > 0)
    ratio = np.fft.fft(sent)[inside] / np.fft.fft(held_template(described))[inside]
    assert np.ptp(np.abs(ratio)) < 1e-9
    assert np.abs(np.angle(ratio)).max() < 1e-9


def test_direction_and_polarity_are_what_they_say():
    forward = chips(waveform())
    assert np.array_equal(chips(waveform(direction="reversed")), forward[::-1])
    assert np.array_equal(chips(waveform(polarity="negative")), 1 - forward)


@pytest.mark.parametrize("polarity", ["positive", "negative"])
@pytest.mark.slow
def test_each_of_the_48_sequences_of_order_9_is_identified_through_an_instrument(polarity):
    # echoes and a tilt as a bad cable makes them, 10 dB of signal over noise a sample, any delay
    rng = np.random.default_rng(9)
    polynomials = all_polynomials(9)
    assert len(polynomials) == 48
    for polynomial in polynomials:
        described = waveform(9, polynomial, polarity=polarity)
        frequency = np.fft.fftfreq(1022)
        response = 1 + 0.25 * np.exp(-2j * np.pi * (frequency * 7.3 + rng.random()))
        response *= 10 ** (3 * frequency / 20) * np.exp(-2j * np.pi * frequency * rng.uniform(0, 1022))
        capture = np.fft.ifft(np.fft.fft(band_limited_template(described)) * response)
        capture += np.sqrt(0.05) * rng.standard_normal((1022, 2)) @ [1, 1j]
        found = identify(capture)
        assert (found.order, found.samples_per_chip, found.polarity) == (9, 2, polarity)
        identified = waveform(9, found.polynomial, direction=found.direction)
        # the description that was found makes the sequence that was sent, up to where it starts
        match = np.fft.ifft(
            np.fft.fft(1.0 - 2 * chips(identified)) * np.conj(np.fft.fft(1.0 - 2 * m_sequence(9, polynomial)))
        )
        assert np.abs(match).max() == pytest.approx(511)
        reciprocal = tuple(9 - e for e in reversed(polynomial))
        assert found.polynomial == min(polynomial, reciprocal)
        assert found.direction == ("forward" if polynomial < reciprocal else "reversed")


@pytest.mark.parametrize(("order", "per_chip"), [(7, 4), (8, 1), (10, 3), (11, 2), (13, 1)])
@pytest.mark.slow
def test_other_orders_and_rates_are_identified(order, per_chip):
    described = waveform(order, per_chip=per_chip, direction="reversed")
    found = identify(np.roll(band_limited_template(described), 1234 % described.samples))
    assert found.order == order
    assert found.samples_per_chip == per_chip
    assert (found.polynomial, found.direction) == (PRIMITIVE_POLYNOMIALS[order], "reversed")


@pytest.mark.parametrize(("order", "cross"), [(7, 41), (8, 95), (9, 113), (10, 383), (11, 287)])
def test_margin_is_what_the_worst_pair_of_sequences_leaves(order, cross):
    # largest crosscorrelation of two m-sequences: Sarwate and Pursley, Proc. IEEE 68 (1980), table I
    capture = 1.0 - 2.0 * m_sequence(order, PRIMITIVE_POLYNOMIALS[order])
    margin = 20 * np.log10((2**order - 1) / cross)
    assert identify(capture + 0j).margin == pytest.approx(margin, abs=1e-3)  # in single precision


def test_a_dc_offset_does_not_hide_the_sequence():
    capture = band_limited_template(waveform()) + 3.0
    assert identify(capture).polynomial == (9, 4, 0)


@pytest.mark.parametrize(
    ("capture", "expected"),
    [
        (np.zeros(1022, complex), "stands out"),
        (np.full(1022, np.nan + 0j), "stands out"),
        (np.random.default_rng(1).standard_normal((1022, 2)) @ [1, 1j], "no m-sequence of order 9 stands out"),
        (np.exp(0.3j * np.arange(1022)), "stands out"),
        (np.ones(1000, complex), "1000 samples per capture; expected the period of an m-sequence"),
    ],
)
def test_what_is_no_m_sequence_is_refused(capture, expected):
    with pytest.raises(DataError, match=expected):
        identify(capture)


def test_the_shipped_back_to_back_holds_the_described_sequence():
    b2b = back_to_back(calibration("back-to-back-132ghz.h5"))
    found = identify((b2b.captures @ [1, 1j]).mean(axis=0))
    assert found.polynomial == b2b.sounder.waveform.polynomial
    assert found.direction == b2b.sounder.waveform.direction


def test_a_vendors_sequence_is_x9_x4_1_backwards_and_inverted(shared_data: Path):
    tables = loadmat(shared_data / "instrument" / "ilmsens" / "m9_ov2.mat")
    # The vendor counts the taps 4 and 9 back in time, which is the polynomial run backwards, and sends a 1 as +1.
    bits = tables["tMLBSOrg"].ravel() > 0
    assert np.array_equal(bits, np.roll(bits, 4) ^ np.roll(bits, 9))
    for name in ("tBB_MLBS", "mDR_Ref_MLBS"):  # as ADC numbers, as a reference
        found = identify(tables[name].ravel().astype(complex))
        assert found.samples_per_chip == 2
        assert (found.polynomial, found.direction, found.polarity) == ((9, 4, 0), "reversed", "negative")


def test_a_ray_tracers_back_to_back_is_scipys_sequence(shared_data: Path):
    with h5py.File(shared_data / "raytraced" / "lroom_raw.h5") as file:
        mean = (file["b2b"][()] @ [1, 1j]).mean(axis=0)
    found = identify(mean)
    theirs = 1.0 - 2.0 * max_len_seq(9)[0]
    ours = 1.0 - 2.0 * chips(waveform(9, found.polynomial, direction=found.direction))
    assert np.abs(np.fft.ifft(np.fft.fft(theirs) * np.conj(np.fft.fft(ours)))).max() == pytest.approx(511)
    assert found.margin > 12


def test_two_periods_of_a_sequence_are_not_taken_for_a_longer_chip(description):
    sent = band_limited_template(description().waveform)
    rng = np.random.default_rng(6)
    noise = 0.3 * (rng.normal(size=2 * sent.size) + 1j * rng.normal(size=2 * sent.size))
    with pytest.raises(DataError, match="hold 2 periods of 1022; split each capture"):
        identify(np.tile(sent, 2) + noise)
