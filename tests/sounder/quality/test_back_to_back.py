"""What damages a back-to-back recording is told; a clean one of any instrument is not remarked."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from sounder.cir.amplitudes import rail
from sounder.instrument.stated import Connection
from sounder.kernels.correlation.reference import as_complex
from sounder.quality import back_to_back as check
from sounder.quality.calibration import check_back_to_back
from sounder.remark import Code

from .links import SOUNDER, connected


def codes(b2b, sounder=SOUNDER) -> list[Code]:
    return [remark.code for remark in check_back_to_back(b2b, sounder).remarks]


def integers(samples) -> np.ndarray:
    parts = np.stack([samples.real, samples.imag], axis=-1)
    return np.clip(np.rint(parts), -32768, 32767).astype(np.int16)


def compressed(captures) -> np.ndarray:
    samples = as_complex(captures)
    level = np.sqrt(np.mean(np.abs(samples) ** 2))
    return integers(level * np.tanh(np.abs(samples) / level) * np.exp(1j * np.angle(samples)))


def limited(captures) -> np.ndarray:
    most = np.quantile(np.abs(captures), 0.9)
    return np.clip(captures, -most, most).astype(np.int16)  # far below full scale


def slipped(captures) -> np.ndarray:
    changed = captures.copy()
    changed[5:9] = np.roll(changed[5:9], 1, axis=1)
    return changed


def echoed(captures) -> np.ndarray:
    samples = as_complex(captures)
    return integers(samples + 0.01 * np.roll(samples, 400, axis=1))


@pytest.mark.parametrize("seed", range(8))
def test_clean_instruments_are_not_remarked(seed: int) -> None:
    assert codes(connected(seed)) == []


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    ("change", "code"),
    [
        (compressed, Code.BACK_TO_BACK_COMPRESSED),
        (limited, Code.BACK_TO_BACK_LIMITED),
        (slipped, Code.BACK_TO_BACK_SLIPPED),
        (echoed, Code.BACK_TO_BACK_PATHS),
    ],
)
def test_damage_of_the_samples_is_told(change: Callable, code: Code, seed: int) -> None:
    clean = connected(seed)
    assert codes(replace(clean, captures=change(clean.captures))) == [code]


@pytest.mark.parametrize("kind", [np.int16, np.complex64])
def test_walls_are_seen_in_every_data_type(kind) -> None:
    captures = connected().captures
    if kind is np.complex64:
        captures = (as_complex(captures) * 1.7e-5).astype(np.complex64)
    share, bound = rail(captures, check.TESTS)
    assert share < bound
    parts = captures.view(np.float32) if kind is np.complex64 else captures
    most = np.quantile(np.abs(parts), 0.99)
    cut = np.clip(parts, -most, most)
    share, bound = rail(cut.view(np.complex64) if kind is np.complex64 else cut, check.TESTS)
    assert bound < share < 0.02  # 1 % of the numbers are at the two ends


def test_slipped_snapshots_are_left_out_of_the_calibration() -> None:
    clean = connected()
    checked = check_back_to_back(replace(clean, captures=slipped(clean.captures)), SOUNDER)
    kept = np.delete(clean.captures, range(5, 9), axis=0)
    assert np.array_equal(checked.usable.captures, kept)
    trusted = check_back_to_back(replace(clean, captures=slipped(clean.captures)), SOUNDER, trust_all=True)
    assert len(trusted.usable.captures) == len(clean.captures)


@pytest.mark.parametrize(
    "change",
    [
        {"attenuation": 40.0},
        {"scale_factor": 10 * connected().scale_factor},
        {"includes_tx_antenna": True},  # the antenna has 24.5 dB
    ],
)
def test_levels_are_compared_with_the_power(change) -> None:
    assert codes(replace(connected(), **change)) == [Code.BACK_TO_BACK_LEVEL]


def test_an_attenuator_is_passive_and_causal() -> None:
    frequency = np.linspace(131e9, 133e9, 201)
    s21 = 1e-3 * np.exp(-2j * np.pi * frequency * 1.5e-9)
    clean = replace(connected(), s21=(frequency, s21))
    assert codes(clean) == []
    for wrong in (np.conj(s21), 20 * np.log10(np.abs(s21)) + 0j, s21 / 4):
        assert Code.ATTENUATOR in codes(replace(clean, s21=(frequency, wrong)))


def test_a_stated_delay_shows_a_capture_that_is_late() -> None:
    clean = connected()
    response = check.Response.of(clean.captures, SOUNDER)
    delay = check.peak_delay(response) / SOUNDER.waveform.sample_rate
    stated = SOUNDER.model_copy(update={"back_to_back": Connection(delay=delay)})
    assert codes(clean, stated) == []
    late = replace(clean, captures=np.roll(clean.captures, 1, axis=1))
    assert codes(late) == []
    assert codes(late, stated) == [Code.BACK_TO_BACK_DELAY]
