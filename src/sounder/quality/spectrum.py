"""Spectral lines: a tone of another transmitter or of the instrument stands out of the spectrum of a channel."""

from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import betaln

from erm.common.significance import FALSE_ALARM
from sounder.cir.deembedding import Deembedding

BLOCKS = 16
"""Parts of the band within which the spectrum of a channel is compared: 75 MHz of 1.2 GHz. Chosen; not derived."""
KEPT = 0.03
"""Weight of the de-embedding from which lines are compared: the edges of the band hold nothing. Chosen."""


def spectral_lines(
    responses: NDArray[np.complexfloating], level: NDArray[np.float64], deembedding: Deembedding
) -> tuple[NDArray[np.float64], float]:
    """Strongest spectral line of each direction, and the bound for a channel.

    The transfer function of many paths is a complex Gaussian process, and so is noise: the power of a line is
    exponential about the mean of its surroundings. A few strong paths vary less. They may fade over the whole of a
    block, at whose edge they are strong: each line is compared with two blocks that overlap by a half. De-embedding
    shapes noise, by a factor of ten and more: the spectrum is taken relative to noise of that shape and a flat channel.

    Parameters
    ----------
    responses : array complex (direction, sample)
    level : array (direction,)
        Mean noise power of a sample.
    deembedding : Deembedding
        Its weight is divided out.

    Returns
    -------
    line : array (direction,)
        Over the larger median of its blocks [dB].
    bound : float
        [dB]
    """
    size = responses.shape[-1]
    inside = np.flatnonzero(deembedding.weight > KEPT)
    inside = inside[np.argsort((inside + size // 2) % size)]
    half = max(size // BLOCKS // 2, 1)
    inside = inside[: inside.size // half * half]
    if inside.size < 2 * half or not len(responses):
        return np.full(len(responses), -np.inf), 0.0
    power = np.abs(np.fft.fft(responses)[:, inside] / deembedding.weight[inside]) ** 2
    noise = np.outer(size * level, deembedding.noise[inside] / deembedding.weight[inside] ** 2)
    expected = noise + np.maximum(power.mean(axis=1) - noise.mean(axis=1), 0)[:, None]
    expected[:, inside == 0] = np.inf  # not measured
    halves = (power / expected).reshape(len(power), -1, half)
    usual = np.partition(np.concatenate([halves[:, :-1], halves[:, 1:]], axis=-1), half)[..., half]
    about = np.maximum(usual[:, np.r_[0, : usual.shape[1]]], usual[:, np.r_[: usual.shape[1], -1]])
    line = np.max(halves.max(axis=-1) / about, axis=-1)
    return 10 * np.log10(line), 10 * float(np.log10(line_bound(inside.size * len(responses), 2 * half)))


@cache
def line_bound(lines: int, block: int) -> float:
    """Ratio of a line to the median of its block that the strongest of so many lines exceeds with `FALSE_ALARM`.

    A median ``m`` of ``n`` exponential powers of mean 1 has ``1 - exp(-m)`` distributed as ``Beta(k, k)`` with
    ``k = (n + 1) / 2``. A line exceeds ``b m`` with the probability ``E[exp(-b m)] = B(k, k + b) / B(k, k)``.

    Examples
    --------
    >>> round(line_bound(704 * 108, 64))  # 16 dB
    35
    """
    half = (block + 1) / 2
    wanted = np.log(FALSE_ALARM / lines)
    ratio: float = brentq(lambda b: betaln(half, half + b) - betaln(half, half) - wanted, 1.0, 1e4)
    return ratio
