"""Averages of captures whose phases are not known, against the truth."""

import hypothesis
import numpy as np
import pytest
from hypothesis import strategies as st

from sounder.cir.phase_alignment import align_snapshots, average_on_line, common_offsets, phase_line
from sounder.instrument.waveform import m_sequence
from sounder.kernels.correlation.m_sequence import MSequenceCorrelator

CORRELATOR = MSequenceCorrelator(m_sequence(9, (9, 4, 0)), 2)


def captures_of(rng, phases, snr, scale=300.0, integers=False):
    """Snapshots of two paths in noise of variance 1 a sample [times scale], and their clean correlation.

    ``snr`` is the power of the paths over that of the noise in the samples of a capture [dB].
    """
    channel = np.roll(CORRELATOR.template, 50) + 0.3j * np.roll(CORRELATOR.template, 90)
    channel *= 10 ** (snr / 20) / np.sqrt(np.mean(np.abs(channel) ** 2))
    noise = rng.standard_normal((len(phases), 1022, 2)) @ [1, 1j] / np.sqrt(2)
    captures = (scale * (np.exp(1j * phases)[:, None] * channel + noise)).astype(np.complex64)
    clean = CORRELATOR.correlate((scale * channel).astype(np.complex64)[None])[0]
    if integers:
        captures = np.rint(captures.view(np.float32).reshape(len(phases), 1022, 2)).astype(np.int16)
    return captures, clean


def phases_of(rng, kind, snapshots):
    turns = {
        "random": lambda: rng.random(snapshots),
        "drift": lambda: np.cumsum(rng.normal(0, 0.05, snapshots)),
        "offset": lambda: rng.uniform(-0.25, 0.25) * np.arange(snapshots),
        "still": lambda: np.full(snapshots, rng.random()),
    }
    return 2 * np.pi * turns[kind]()


@pytest.mark.slow
@hypothesis.given(
    seed=st.integers(0, 2**32 - 1),
    kind=st.sampled_from(["random", "drift", "offset", "still"]),
    snapshots=st.integers(2, 300),
    integers=st.booleans(),
)
@hypothesis.settings(max_examples=15, deadline=None)
def test_gain_is_true_whatever_the_phases(seed, kind, snapshots, integers):
    """Within 0.1 dB at 10 dB a capture."""
    rng = np.random.default_rng(seed)
    captures, clean = captures_of(rng, phases_of(rng, kind, snapshots), 10.0, integers=integers)
    found = align_snapshots([captures[:200], captures[200:]] if snapshots > 200 else [captures], CORRELATOR)
    # the noise of the gain is 10 + 30 + 3 dB below it for two snapshots: 0.06 dB, within 0.1 dB in 9 of 10 cases only
    bound = 0.1 if snapshots > 16 else 0.3
    assert 20 * np.log10(np.abs(found.mean[50] / clean[50])) == pytest.approx(0, abs=bound)


@pytest.mark.parametrize("kind", ["random", "drift", "offset", "still"])
def test_what_no_capture_shows_is_aligned_all_the_same(kind):
    """At -15 dB a capture 200 snapshots keep 95 % of the power that a still channel keeps."""
    rng = np.random.default_rng(7)
    kept = []
    for _ in range(4):
        captures, clean = captures_of(rng, phases_of(rng, kind, 200), -15.0)
        kept.append(np.vdot(clean, align_snapshots([captures], CORRELATOR).mean) / np.vdot(clean, clean))
    # E is 15 dB in a capture: its phase is known to 0.13 rad and 1.6 % of the power lost, but for the length of phasors
    assert np.mean(np.abs(kept) ** 2) > 0.95


def test_noise_has_no_phase():
    """Noise alone is not aligned, which would leave more of it."""
    rng = np.random.default_rng(8)
    for snapshots in (2, 5, 50, 300):
        captures, _ = captures_of(rng, np.zeros(snapshots), -200.0)
        found = align_snapshots([captures[:256], captures[256:]] if snapshots > 256 else [captures], CORRELATOR)
        assert found is None


def test_weak_directions_are_averaged_at_the_carrier_offset_of_others():
    """At -28 dB a capture 200 snapshots of unknown phases show nothing; turned by a known offset, all of the gain."""
    rng = np.random.default_rng(9)
    captures, clean = captures_of(rng, 0.7 * np.arange(200), -28.0)
    assert align_snapshots([captures], CORRELATOR) is None
    unknown, known = (average_on_line([captures], CORRELATOR, offset) for offset in (0.0, 0.7))
    share = np.abs(np.vdot(clean, known.mean) / np.vdot(clean, clean))
    # 200 * 1022 samples at -28 dB: 25 dB, 4 % of the gain
    assert share == pytest.approx(1, abs=0.15)
    assert np.abs(np.vdot(clean, unknown.mean) / np.vdot(clean, clean)) < 0.15


def test_carrier_offset_and_drift_are_measured():
    rng = np.random.default_rng(10)
    jitter = rng.normal(0, 0.2, 200)
    captures, _ = captures_of(rng, 1.2 + jitter - 0.9 * np.arange(200), 10.0)
    found = align_snapshots([captures], CORRELATOR)
    # of 200 phases to 0.2 rad the slope is known to sqrt(12) * 0.2 / 200**1.5 = 2.4e-4, the deviation to a twentieth
    assert found.offset == pytest.approx(-0.9, abs=1e-3)
    assert found.drift == pytest.approx(0.2, rel=0.2)
    assert found.coherence == pytest.approx(1, abs=0.01)


def test_random_phases_are_on_no_line():
    rng = np.random.default_rng(11)
    lines = [phase_line(np.exp(2j * np.pi * rng.random(200)))[0] for _ in range(100)]
    # one in twenty at most
    assert np.isnan(lines).sum() >= 88


def test_coherence_falls_where_the_channel_changes():
    """Two paths of equal gain, of which one turns at random: alignment follows one of them, and says what is lost."""
    rng = np.random.default_rng(12)
    one, other = (1000 * np.roll(CORRELATOR.template, delay) for delay in (50, 51))
    turning = np.exp(2j * np.pi * rng.random((200, 1)))
    found = align_snapshots([(one + turning * other).astype(np.complex64)], CORRELATOR)
    assert found.coherence < 0.9


def test_offsets_of_weak_directions_are_interpolated():
    offsets = np.array([np.nan, 0.1, np.nan, 0.3, np.nan])
    np.testing.assert_allclose(common_offsets(offsets, 100), [0.1, 0.1, 0.2, 0.3, 0.3])
    # over two snapshots the phase passes less than half a radian
    np.testing.assert_array_equal(common_offsets(offsets, 2), np.zeros(5))
    np.testing.assert_array_equal(common_offsets(np.full(3, np.nan), 100), np.zeros(3))
    # across half a turn the way is short: from 3.1 to -3.1 over pi, not over 0
    assert abs(common_offsets(np.array([3.1, np.nan, -3.1]), 9)[1]) == pytest.approx(np.pi)
