"""Spectral lines stand out of fades of any width."""

import numpy as np
import pytest

from sounder.cir.deembedding import Deembedding
from sounder.quality.spectrum import BLOCKS, spectral_lines

SIZE = 1022
FLAT = Deembedding(np.ones(SIZE, complex), np.eye(1, SIZE)[0].astype(complex), np.ones(SIZE), np.ones(SIZE), 1.2e9)


@pytest.mark.parametrize("tone", [False, True])
def test_a_tone_stands_out_of_a_channel_and_a_fade_as_wide_as_a_block_does_not(tone):
    """The fade is 20 dB deep, with its edges where a block may begin or end; a tone in it is as strong as the rest."""
    rng = np.random.default_rng(1)
    frequency = np.fft.fftfreq(SIZE)
    noise = 1e-5 / SIZE
    for middle in np.arange(0.1, 0.3, 0.25 / BLOCKS):
        transfer = 1 - 0.9 * np.exp(-((BLOCKS * (frequency - middle)) ** 6))
        transfer[round(middle * SIZE)] += 2 * tone
        channel = np.fft.ifft(transfer) + np.sqrt(noise / 2) * (rng.normal(size=(SIZE, 2)) @ [1, 1j])
        line, bound = spectral_lines(channel[None], np.array([noise]), FLAT)
        assert (line[0] > bound) == tone
