"""Damage of an instrument is told, mended where it is certain, and left out where it is not."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

from sounder.cir.impulse_response import calibrate, impulse_responses
from sounder.quality.check import check_responses
from sounder.remark import Code
from sounder.twin import receiver

pytestmark = pytest.mark.slow

DIRECTION = 3, 1  # azimuth 30, elevation 0, where the path is


@pytest.fixture(scope="module")
def measured(description):
    """A clean recording of two paths, its captures, and its filter."""
    sounder = description()
    paths = {"coefficient": [1e-6, 3e-7], "delay": [100e-9, 180e-9], "azimuth": [31.0, 200.0], "elevation": [2.0, 1.0]}
    dataset = xr.Dataset({key: ("path", values) for key, values in paths.items()})
    ends = {"tx_position": (30, 0, 2), "rx_position": (0, 0, 2)}
    recording = receiver.record(dataset, sounder, name="P", snapshots=4, **ends)
    shape = recording.azimuth.size, recording.elevation.size
    captures = np.stack([[recording.captures(a, e) for e in range(shape[1])] for a in range(shape[0])])
    return recording, captures, calibrate(receiver.back_to_back(sounder, 60.0), recording)


def check(measured, damage=None, trust_all=False, **changes):
    recording, captures, filter_ = measured
    captures = captures.copy()
    if damage is not None:
        captures[DIRECTION] = damage(captures[DIRECTION])
    recording = replace(recording, read=lambda a, e, which: captures[a, e][which], **changes)
    cir, remarks = impulse_responses(recording, filter_)
    checked, remarks = check_responses(cir, recording, filter_, remarks, trust_all=trust_all)
    return checked["cir"].values, remarks


@pytest.fixture(scope="module")
def clean(measured):
    return check(measured)


def codes(remarks):
    assert all(remark.azimuth == 30 and remark.elevation == 0 for remark in remarks)
    return {remark.code for remark in remarks}


def test_a_clean_recording_has_no_remark(clean):
    assert clean[1] == []


def test_shifted_snapshots_are_shifted_back(measured, clean):
    def lose(captures):
        captures[2:] = np.roll(captures[2:], -77, axis=1)
        return captures

    cir, remarks = check(measured, lose)
    assert codes(remarks) == {Code.SNAPSHOTS_SHIFTED}
    assert (remarks[0].snapshot, remarks[0].figure) == (2, -77)
    # A shift by whole samples of a periodic sequence is exact. The constant that no correlation measures is not: it is
    # a median over delay, of each snapshot or of their mean.
    assert np.abs(cir - clean[0])[DIRECTION].max() < 1e-3 * np.abs(clean[0][DIRECTION]).max()


def test_a_burst_in_one_snapshot_is_averaged_away(measured, clean):
    def burst(captures):
        noise = np.random.default_rng(1).normal(0, 5 * captures.std(), (100, 2))
        captures[1, 200:300] = np.clip(captures[1, 200:300] + noise, -32000, 32000)
        return captures

    cir, remarks = check(measured, burst)
    assert codes(remarks) == {Code.BURST}
    assert remarks[0].snapshot == 1
    peak = np.abs(clean[0][DIRECTION]).max()
    assert np.abs(cir[DIRECTION]).max() == pytest.approx(peak, rel=0.01)


def noise(captures):
    return np.random.default_rng(1).normal(0, captures.std(), captures.shape).astype(np.int16)


def limited(captures):
    signal = captures[..., 0] + 1j * captures[..., 1]
    signal /= np.maximum(np.abs(signal) / np.sqrt(np.mean(np.abs(signal) ** 2)), 1)
    return np.rint(np.stack([signal.real, signal.imag], -1)).astype(np.int16)


def tone(captures):
    samples = np.arange(captures.shape[0] * captures.shape[1]).reshape(captures.shape[:2])
    wave = 0.5 * captures.std() * np.exp(2j * np.pi * 49 / captures.shape[1] * samples)
    return (captures + np.stack([wave.real, wave.imag], -1)).astype(np.int16)


@pytest.mark.parametrize(
    ("damage", "code"),
    [(noise, Code.DEAD), (limited, Code.COMPRESSED), (tone, Code.TONE)],
    ids=["noise", "limit", "tone"],
)
def test_a_damaged_direction_is_left_out_unless_all_is_trusted(measured, damage, code):
    cir, remarks = check(measured, damage)
    assert code in codes(remarks)
    assert np.isnan(cir[DIRECTION]).all()
    assert np.isfinite(cir).all(axis=-1).sum() == cir[..., 0].size - 1
    cir, remarks = check(measured, damage, trust_all=True)
    assert code in codes(remarks)
    assert np.isfinite(cir).all()


def test_a_direction_that_repeats_another_is_left_out(measured):
    recording, captures, _ = measured
    cir, remarks = check(measured, lambda _: captures[2, 1], agc_gain=np.full_like(recording.agc_gain, 3.0))
    assert Code.REPEATED in {remark.code for remark in remarks if remark.azimuth == 30}
    assert np.isnan(cir[DIRECTION]).all()


def test_a_gain_that_is_not_the_stated_one_shows_in_the_noise(measured):
    recording, _, _ = measured
    stated = recording.agc_gain.copy()
    stated[DIRECTION] += 10
    _, remarks = check(measured, agc_gain=stated)
    assert codes(remarks) == {Code.NOISE_LOW}
    _, remarks = check(measured, agc_gain=-recording.agc_gain)
    assert Code.GAIN_SIGN in {remark.code for remark in remarks}
