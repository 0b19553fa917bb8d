"""Which codes a capture holds, whatever its carrier offset."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

FALSE_ALARM = 0.01
"""Probability that noise passes for any of the codes; chosen."""


class Acquired(NamedTuple):
    """A code in a capture.

    Attributes
    ----------
    name : str
    level : float
        Power of its peak over the median of all delays [dB].
    delay : float
        Of the peak [s], modulo the period.
    offset : float
        Carrier offset [Hz].
    """

    name: str
    level: float
    delay: float
    offset: float


def acquire(
    samples: ArrayLike,
    templates: Mapping[str, NDArray[np.complexfloating]],
    sample_rate: float,
    *,
    max_offset: float = 10e3,
) -> list[Acquired]:
    """Find codes by the power of their correlations, summed over periods.

    The carrier offset is tried in steps of half a line of the spectrum, which costs 0.9 dB at most. In noise alone the
    sum over ``K`` periods has a gamma distribution of shape ``K``; a code counts as found if noise of all codes, delays
    and offsets that were tried exceeds its peak with the probability `FALSE_ALARM` at most.

    Parameters
    ----------
    samples : array complex (sample,)
        One period or more.
    templates : mapping
        Period of each code (sample,), all of one length.
    sample_rate : float
        [Hz]
    max_offset : float
        Largest carrier offset that is tried [Hz].

    Returns
    -------
    list of Acquired
        The strongest first.

    References
    ----------
    E. D. Kaplan and C. J. Hegarty, "Understanding GPS/GNSS", 3rd ed., 2017, section 8.5 (acquisition).

    Examples
    --------
    PRN 7 with noise 10 dB above it, 2300 Hz off the carrier, 30 samples late:

    >>> from sounder.instrument.periodic import Periodic
    >>> codes = {f"PRN {prn}": Periodic(kind="gps_ca", prn=prn, sample_rate=1.023e6).sampled for prn in (3, 7, 11)}
    >>> rng = np.random.default_rng(1)
    >>> noise = rng.normal(0, np.sqrt(5), (2, 4092)) * [[1], [1j]]
    >>> turned = np.exp(2j * np.pi * 2300 * np.arange(4092) / 1.023e6)
    >>> [found] = acquire(np.roll(np.tile(codes["PRN 7"], 4), 30) * turned + noise.sum(axis=0), codes, 1.023e6)
    >>> found.name, round(found.delay * 1.023e6), found.offset
    ('PRN 7', 30, 2500.0)
    """
    from scipy.fft import fft, ifft  # slow to import
    from scipy.special import gammainccinv

    length = len(next(iter(templates.values())))
    periods = np.asarray(samples, np.complex64)
    periods = periods[: periods.size // length * length].reshape(-1, length)
    line = sample_rate / length
    steps = int(max_offset / line)
    half = np.exp(-1j * np.pi * np.arange(length) / length).astype(np.complex64)
    spectra = [fft(periods), fft(periods * half)]
    tried = [(k, part) for k in range(-steps, steps + 1) for part in (0, 1)]
    cells = length * len(tried) * len(templates)
    shape = len(periods)
    bound = gammainccinv(shape, FALSE_ALARM / cells) / gammainccinv(shape, 0.5)
    found = []
    for name, template in templates.items():
        reference = np.conj(fft(np.asarray(template, np.complex64)))
        best = (0.0, 0, 0.0)
        for k, part in tried:
            power = np.sum(np.abs(ifft(np.roll(spectra[part], -k, axis=1) * reference)) ** 2, axis=0)
            peak = int(np.argmax(power))
            best = max(best, (float(power[peak] / np.median(power)), peak, (k + part / 2) * line))
        if best[0] > bound:
            found.append(Acquired(name, 10 * float(np.log10(best[0])), best[1] / sample_rate, best[2]))
    return sorted(found, key=lambda one: -one.level)
