"""I and Q exchanged, conjugated, or a sample apart, in a recording or in its back-to-back.

A recording and its back-to-back hold the same instrument. De-embedding divides it out and leaves the pulse. If I and Q
are exchanged in one of them, or Q has the other sign, the instrument of one is divided by the conjugate of that of the
other: ripple and tilt of the response stay, and the pulse gets worse. Undoing the exchange makes it better. The
template is real, so that the exchange commutes with the correlation and can be undone in the CIR.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from sounder.cir.deembedding import Deembedding
from sounder.cir.power_spectrum import noise_power
from sounder.quality.noise_floor import FALSE_ALARM
from sounder.remark import Code, Remark

STRONGEST = 12
"""Directions that are compared: those with the strongest paths. Chosen."""
LEAST_SNR = 100.0
"""Peak over noise that a direction must have [1]: below 20 dB noise makes pulses as bad as the exchange does."""
REACH = 24
"""Samples on either side of the peak over which a pulse is judged. Chosen."""
OVERSAMPLING = 4
"""Points a sample at which it is judged, so that the place of the peak between samples does not count."""
LEAST_LOSS = 0.006
"""Loss of sharpness of the pulse itself that the exchange must make to be seen [1]: an even response makes none. Below,
dense paths make as much (`benchmarks/damage_calibration.py`)."""
FEWEST = 3
"""Fewest directions that tell. Chosen."""
PHASES = np.exp(1j * np.pi * np.arange(8) / 8)
"""Carrier phases over which the effect of a delay of Q is averaged."""

Complex = NDArray[np.complexfloating]
Real = NDArray[np.float64]


def exchanged(correlation: Complex) -> Complex:
    """Conjugate; I and Q exchanged is the same but for a constant phase."""
    return np.conj(correlation)


def q_earlier(correlation: Complex) -> Complex:
    """Q a sample earlier: undoes a delay of Q."""
    return correlation.real + 1j * np.roll(correlation.imag, -1, axis=-1)


def q_later(correlation: Complex) -> Complex:
    """Q a sample later: undoes a delay of I."""
    return correlation.real + 1j * np.roll(correlation.imag, 1, axis=-1)


class Change(NamedTuple):
    """Something that may have been done to I and Q."""

    undo: Callable[[Complex], Complex]
    code: Code
    least_gain: float
    """Gain of sharpness by undoing it, over the loss that it makes to the pulse itself, from which on it is told."""


# In 60 random streets and instruments the gain by undoing an exchange is 0.6 to 1.3 if there is one, and less than -0.6
# if there is none. That of a delay depends on the phase of the carrier: 0.02 to 2.3, and less than -0.02.
CHANGES = (
    Change(exchanged, Code.QUADRATURE_EXCHANGED, 0.3),
    Change(q_earlier, Code.QUADRATURE_DELAYED, 0.05),
    Change(q_later, Code.QUADRATURE_DELAYED, 0.05),
)


def remarks_on_quadrature(responses: Complex, deembedding: Deembedding) -> list[Remark]:
    """Whether the pulses of the strongest directions are better with I and Q exchanged or shifted.

    Parameters
    ----------
    responses : array complex (azimuth, elevation, sample)
        CIRs; NaN where nothing was recorded.
    deembedding : Deembedding
        The filter that made them.

    Returns
    -------
    list of Remark
        At most one.
    """
    flat = responses.reshape(-1, responses.shape[-1])
    power = np.abs(flat) ** 2
    ratio = power.max(axis=-1) / noise_power(power)
    strong = np.flatnonzero(np.nan_to_num(ratio) > LEAST_SNR)
    strong = strong[np.argsort(-ratio[strong])][:STRONGEST]
    if strong.size < FEWEST:
        return []
    seen = _correlation(flat[strong], deembedding)
    alone = _correlation(deembedding.pulse * PHASES[:, None], deembedding)
    sharp, sharp_alone = _sharpness(seen, deembedding), _sharpness(alone, deembedding)
    best = 0.0
    remark: list[Remark] = []
    for undo, code, least_gain in CHANGES:
        loss = float(np.mean(sharp_alone - _sharpness(undo(alone), deembedding)))
        gains = _sharpness(undo(seen), deembedding) - sharp
        gain = float(gains.mean())
        error = gains.std() / np.sqrt(gains.size - 1)
        certain = gain > student.isf(FALSE_ALARM, gains.size - 1) * error
        if loss > LEAST_LOSS and certain and gain > max(least_gain * loss, best):
            best, remark = gain, [Remark(code, figure=gain / loss, bound=least_gain)]
    return remark


def _correlation(responses: Complex, deembedding: Deembedding) -> Complex:
    """Correlation (direction, sample) that a filter made into CIRs, within its band."""
    transfer = deembedding.transfer
    inside = np.abs(transfer) > 1e-3 * np.abs(transfer).max()  # the window falls to zero at the edges of the band
    return np.fft.ifft(np.where(inside, np.fft.fft(responses) / np.where(inside, transfer, 1.0), 0.0))


def _sharpness(correlation: Complex, deembedding: Deembedding) -> Real:
    """Logarithm of ``sum p^2 / (sum p)^2`` over the power ``p`` about the peak (direction,): higher is sharper."""
    spectra = np.fft.fft(correlation) * deembedding.transfer
    spectra[:, 0] = (spectra[:, 1] + spectra[:, -1]) / 2
    half = spectra.shape[1] // 2
    padded = np.zeros((len(spectra), spectra.shape[1] * OVERSAMPLING), complex)
    padded[:, :half], padded[:, -half:] = spectra[:, :half], spectra[:, -half:]
    power = np.abs(np.fft.ifft(padded)) ** 2
    about = np.argmax(power, axis=1)[:, None] + np.arange(-REACH * OVERSAMPLING, REACH * OVERSAMPLING + 1)
    near = np.take_along_axis(power, about % power.shape[1], axis=1)
    return np.asarray(np.log(np.sum(near**2, axis=1) / np.sum(near, axis=1) ** 2))
