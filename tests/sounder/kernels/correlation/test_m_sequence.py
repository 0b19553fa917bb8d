"""Correlation with m-sequences: known values, and agreement with float64 FFTs."""

import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from sounder.kernels.correlation import portable, reference
from sounder.kernels.correlation.m_sequence import MSequenceCorrelator

# float32 rounds each of the m <= 15 additions to 2**-24 of its result, which is below the peak; errors add up as
# sqrt(m) at random. Sums of 32 equal powers round by 5e-7 at worst.
OF_PEAK = 1e-6


def agree(iq, chips, spc):
    """Hold averages and single correlations of captures to float64."""
    correlator = MSequenceCorrelator(chips, spc)
    template = reference.chip_template(chips, spc)
    mean, power = reference.average(iq, template)
    got_mean, got_power = correlator.average(iq)
    assert got_mean.dtype == np.complex64
    assert got_power.dtype == np.float64
    assert np.abs(got_mean - mean).max() <= OF_PEAK * np.abs(mean).max()
    assert np.abs(got_power - power).max() <= OF_PEAK * power.max()


@pytest.fixture
def rng():
    return np.random.default_rng(20240229)


def full_scale(rng, snapshots, samples):
    return rng.integers(-32768, 32768, (snapshots, samples, 2)).astype(np.int16)


def test_template_correlates_to_1022_510_and_minus_2(m_sequence, path):
    chips = m_sequence(9)
    expected = np.full(1022, -2.0)
    expected[[0, 1, -1]] = 1022, 510, 510
    template = reference.chip_template(chips, 2)
    iq = np.zeros((3, 1022, 2), np.int16)
    iq[..., 0] = template
    correlator = MSequenceCorrelator(chips, 2)
    mean, power = correlator.average(iq)
    np.testing.assert_array_equal(mean, expected)
    np.testing.assert_array_equal(power, expected**2)
    np.testing.assert_array_equal(correlator.correlate(iq), np.tile(expected, (3, 1)))
    np.testing.assert_array_equal(correlator.correlate_mean(template), expected)


def test_a_delay_moves_the_peak_to_later_samples(m_sequence, path):
    chips = m_sequence(9)
    iq = np.zeros((1, 1022, 2), np.int16)
    iq[0, :, 1] = np.roll(reference.chip_template(chips, 2), 37)
    mean, _ = MSequenceCorrelator(chips, 2).average(iq)
    assert mean[37] == 1022j
    assert mean[36] == mean[38] == 510j


def test_complement_turns_the_sign(m_sequence, path, rng):
    iq = full_scale(rng, 3, 1022)
    mean, power = MSequenceCorrelator(m_sequence(9), 2).average(iq)
    other, same = MSequenceCorrelator(1 - m_sequence(9), 2).average(iq)
    np.testing.assert_array_equal(other, -mean)
    np.testing.assert_array_equal(same, power)


@pytest.mark.parametrize("taps", [(0, 4), (0, 5), (0, 3, 4, 6), (0, 4, 5, 8)])
@pytest.mark.parametrize(
    "change", [lambda s: s, lambda s: s[::-1], lambda s: np.roll(s, 200)], ids=["", "reversed", "rolled"]
)
def test_any_sequence_of_order_9(m_sequence, path, rng, taps, change):
    agree(full_scale(rng, 5, 1022), change(m_sequence(9, taps)), 2)


@pytest.mark.parametrize(
    "make",
    [
        lambda rng: rng.integers(-1, 2, (33, 1022, 2)),
        lambda rng: np.full((4, 1022, 2), -32768),
        lambda rng: rng.choice([-32768, 32767], (6, 1022, 2)),
        lambda rng: np.repeat(rng.integers(-9000, 9000, (1, 1022, 2)), 1000, axis=0),
        lambda rng: full_scale(rng, 1, 1022),
    ],
    ids=["one LSB", "all at the negative rail", "both rails", "equal captures", "one capture"],
)
def test_any_data(m_sequence, path, rng, make):
    agree(make(rng).astype(np.int16), m_sequence(9), 2)


@pytest.mark.parametrize(
    ("order", "spc"), [(7, 1), (8, 2), (9, 3), (10, 4), (11, 2), (12, 1), (13, 3), (14, 4), (15, 2), (15, 4)]
)
def test_any_order_on_the_portable_path(m_sequence, monkeypatch, rng, order, spc):
    monkeypatch.setenv("SOUNDER_PORTABLE_KERNELS", "1")
    chips = m_sequence(order)
    agree(full_scale(rng, 5, spc * chips.size), chips, spc)


@pytest.mark.slow
@pytest.mark.parametrize(("order", "spc"), [(9, 1), (11, 2), (12, 3), (15, 4)])
def test_any_order_in_registers(m_sequence, registers, rng, order, spc):
    chips = m_sequence(order)
    agree(full_scale(rng, 3, spc * chips.size), chips, spc)


def test_every_sample_reaches_the_result(m_sequence, path, rng):
    """One LSB more in one sample is seen: in the mean as 1/snapshots at every delay."""
    correlator = MSequenceCorrelator(m_sequence(9), 2)
    iq = rng.integers(-100, 100, (8, 1022, 2)).astype(np.int16)
    for place in [(0, 0, 0), (7, 1021, 1), (3, 1020, 0), (5, 511, 1)]:
        before, power_before = correlator.average(iq)
        iq[place] += 1
        after, power_after = correlator.average(iq)
        # Values below 2**15 in float32 are known to 2**-9.
        np.testing.assert_allclose(np.abs(after - before), 1 / 8, atol=2**-8)
        assert not np.array_equal(power_after, power_before)


@pytest.mark.parametrize("snapshots", [1, 2, 7])
def test_complex_captures_are_the_same_captures(m_sequence, path, rng, snapshots):
    iq = full_scale(rng, snapshots, 1022)
    correlator = MSequenceCorrelator(m_sequence(9), 2)
    floats = reference.as_complex(iq).astype(np.complex64)
    mean, power = correlator.average(iq)
    mean_of_floats, power_of_floats = correlator.average(floats)
    np.testing.assert_allclose(mean_of_floats, mean, atol=OF_PEAK * np.abs(mean).max())
    np.testing.assert_allclose(power_of_floats, power, atol=OF_PEAK * power.max())
    np.testing.assert_array_equal(correlator.correlate(floats), correlator.correlate(iq))


def test_single_correlations_average_to_the_averages(m_sequence, path, rng):
    iq = full_scale(rng, 70, 1022)
    correlator = MSequenceCorrelator(m_sequence(9), 2)
    each = correlator.correlate(iq).astype(complex)
    mean, power = correlator.average(iq)
    np.testing.assert_allclose(mean, each.mean(0), atol=OF_PEAK * np.abs(each).max())
    np.testing.assert_allclose(power, (np.abs(each) ** 2).mean(0), atol=OF_PEAK * power.max())


def test_one_vector_in_double_precision(m_sequence, path, rng):
    chips = m_sequence(9)
    x = rng.standard_normal(1022) + 1j * rng.standard_normal(1022)
    expected = reference.correlate(x, reference.chip_template(chips, 2))
    got = MSequenceCorrelator(chips, 2).correlate_mean(x)
    np.testing.assert_allclose(got, expected, atol=1e-13 * np.abs(expected).max())


@pytest.mark.parametrize("kind", ["int16", "complex64"])
def test_blocks_do_not_matter_to_the_last_bit(m_sequence, path, rng, kind):
    iq = full_scale(rng, 301, 1022)
    if kind == "complex64":
        iq = reference.as_complex(iq).astype(np.complex64)
    correlator = MSequenceCorrelator(m_sequence(9), 2)
    mean, power = correlator.average(iq)
    for edges in ([128, 256], [1, 2, 4, 33, 100, 300], [150]):
        sums = correlator.accumulator()
        for block in np.split(iq, edges):
            sums.add(block)
        got_mean, got_power = sums.result()
        assert sums.count == 301
        np.testing.assert_array_equal(got_mean, mean)
        np.testing.assert_array_equal(got_power, power)


def test_sums_of_long_recordings_do_not_overflow(m_sequence, path):
    """The negative rail, 70 000 times: beyond 32 bits. Every chip's sum is equal, so every delay is -1 chip of it."""
    correlator = MSequenceCorrelator(m_sequence(9), 2)
    sums = correlator.accumulator()
    block = np.full((1000, 1022, 2), -32768, np.int16)
    for _ in range(70):
        sums.add(block)
    mean, power = sums.result()
    np.testing.assert_array_equal(mean, -2 * -32768 * (1 + 1j))
    np.testing.assert_allclose(power, 2 * 65536.0**2, rtol=1e-12)


def test_other_memory_layouts_are_the_same_captures(m_sequence, path, rng, tmp_path):
    iq = full_scale(rng, 6, 1022)
    correlator = MSequenceCorrelator(m_sequence(9), 2)
    mean, _ = correlator.average(iq)
    iq.tofile(tmp_path / "captures")
    mapped = np.memmap(tmp_path / "captures", np.int16, "r", shape=iq.shape)
    unaligned = np.frombuffer(b"." + iq.tobytes(), np.uint8)[1:].view(np.int16).reshape(iq.shape)
    assert not unaligned.flags.aligned
    for same in (mapped, iq.astype(">i2"), np.asfortranarray(iq), np.repeat(iq, 2, axis=0)[::2], unaligned):
        np.testing.assert_array_equal(correlator.average(same)[0], mean)


@pytest.mark.parametrize("kind", ["int16", "complex64"])
def test_threads_that_share_a_correlator_get_the_same_bits(m_sequence, path, rng, kind):
    iq = full_scale(rng, 13 * 35, 1022).reshape(13, 35, 1022, 2)
    if kind == "complex64":
        iq = reference.as_complex(iq).astype(np.complex64)
    correlator = MSequenceCorrelator(m_sequence(9), 2)
    with ThreadPoolExecutor(4) as pool:
        for direction, averages in zip(iq, pool.map(correlator.average, iq), strict=True):
            np.testing.assert_array_equal(averages, correlator.average(direction))


def test_every_entry_point_has_one_signature(m_sequence, monkeypatch, tmp_path, rng):
    """Two in one cache file could be exchanged by processes that start together."""
    monkeypatch.setenv("SOUNDER_PORTABLE_KERNELS", "1")
    for order, spc in ((7, 1), (9, 2)):
        correlator = MSequenceCorrelator(m_sequence(order), spc)
        iq = full_scale(rng, 3, correlator.samples)
        iq.setflags(write=order == 7)
        correlator.average(iq)
        correlator.correlate(iq)
        correlator.accumulator().add(iq[:1])
    for kernel in (portable.add_int16, portable.means, portable.correlate_float32):
        assert len(kernel.signatures) == 1


def test_correlators_travel(m_sequence, path, rng):
    correlator = MSequenceCorrelator(m_sequence(9), 2)
    iq = full_scale(rng, 2, 1022)
    there = pickle.loads(pickle.dumps(correlator))
    np.testing.assert_array_equal(there.average(iq)[0], correlator.average(iq)[0])


@pytest.mark.parametrize(
    ("iq", "message"),
    [
        (np.zeros((4, 1020, 2), np.int16), "expected .snapshot, 1022."),
        (np.zeros((1022, 2), np.int16), "expected .snapshot, 1022."),
        (np.zeros((4, 1022, 2), np.float32), "expected int16"),
        (np.zeros((4, 1022, 2), np.uint16), "expected int16"),
        (np.zeros((4, 1022), np.complex128), "complex64"),
        (np.zeros((4, 1022), np.int16), "expected int16"),
        (np.zeros((0, 1022, 2), np.int16), "0 snapshots"),
    ],
)
def test_captures_that_do_not_fit_are_refused(m_sequence, iq, message):
    with pytest.raises(ValueError, match=message):
        MSequenceCorrelator(m_sequence(9), 2).average(iq)


def test_sequences_out_of_range_are_refused(m_sequence):
    with pytest.raises(ValueError, match="order 9 at 5 samples"):
        MSequenceCorrelator(m_sequence(9), 5)
    with pytest.raises(ValueError, match="0 snapshots"):
        MSequenceCorrelator(m_sequence(9), 2).accumulator().result()
