"""Converters and amplifiers that limit are told from sequences whose amplitude is nearly constant."""

import numpy as np
import pytest

from sounder.cir.amplitudes import WALL, amplitude_wall, rail, wall_of_sequence

SAMPLES = 1022
DIRECTIONS = 108


def chips(seed: int) -> np.ndarray:
    """Spectrum of rectangular chips behind an instrument with a ripple of 1 dB."""
    signs = np.random.default_rng(seed).choice([-1.0, 1.0], SAMPLES // 2).repeat(2)
    return np.fft.fft(signs) * 10 ** (0.5 * np.cos(9 * np.fft.fftfreq(SAMPLES)) / 20)


def received(spectrum: np.ndarray, delay: float, phase: float, level: float, noise: np.ndarray) -> np.ndarray:
    turn = np.exp(-2j * np.pi * np.fft.fftfreq(SAMPLES) * delay + 1j * phase)
    samples = level * np.fft.ifft(spectrum * turn)
    return np.rint(np.stack([samples.real, samples.imag], axis=-1) + noise).astype(np.int16)


@pytest.mark.parametrize("level", [300.0, 4000.0, 20000.0])
def test_rectangular_chips_of_one_strong_path_are_not_limited(level) -> None:
    rng = np.random.default_rng(3)
    spectrum = chips(1)
    clean = received(spectrum, 0.0, 0.2, 8000.0, rng.normal(0, 2.4, (SAMPLES, 2)))
    bound = max(WALL, 2 * wall_of_sequence(clean[None]))
    walls = []
    for delay in rng.uniform(0, SAMPLES, 60):
        capture = received(spectrum, delay, rng.uniform(0, 2 * np.pi), level, rng.normal(0, 2.4, (SAMPLES, 2)))
        share, most = rail(capture, DIRECTIONS)
        assert share <= most
        walls.append(amplitude_wall(capture))
    assert WALL < max(walls) < bound  # a bound of 2 % would call some of them limited


@pytest.mark.parametrize("unit", [None, 2.5e-7])
def test_samples_at_the_ends_of_the_range_are_seen_below_the_rails(unit) -> None:
    rng = np.random.default_rng(5)
    capture = received(chips(1), 17.3, 1.0, 4000.0, rng.normal(0, 100, (SAMPLES, 2)))
    cut = np.clip(capture, -3400, 3400)
    if unit is not None:
        cut = ((cut[:, 0] + 1j * cut[:, 1]) * unit).astype(np.complex64)
    share, most = rail(cut, DIRECTIONS)
    assert share > 2 * most
