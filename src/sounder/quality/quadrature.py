"""I and Q exchanged, conjugated, or a sample apart, in recordings or in their back-to-back.

A recording and its back-to-back hold the same instrument. De-embedding divides it out and leaves the pulse. If I and Q
are exchanged in one of them, or Q has the other sign, the instrument of one is divided by the conjugate of that of the
other: ripple and tilt of the response stay, and the pulse gets worse. Undoing the exchange makes it better. The
template is real, so that the exchange commutes with the correlation and can be undone in the CIR.

Paths that are not resolved change pulses as much. An instrument is wired once: the evidence of all positions with one
back-to-back is summed, and a single position is told only if its own is enough.
"""

from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from erm.common.significance import CERTAIN
from sounder.cir.deembedding import Deembedding
from sounder.cir.power_spectrum import noise_power
from sounder.remark import Code, Remark

STRONGEST = 12
"""Directions that are compared: those with the strongest paths. Chosen."""
LEAST_SNR = 100.0
"""Peak over noise that a direction must have [1]: below 20 dB noise makes pulses as bad as the exchange does."""
REACH = 24
"""Samples on either side of the peak over which a pulse is judged. Chosen."""
OVERSAMPLING = 4
"""Points a sample at which it is judged, so that the place of the peak between samples does not count."""
PHASES = np.exp(1j * np.pi * np.arange(8) / 8)
"""Carrier phases over which the effect of a delay of Q is averaged."""
TAILS, SCATTER = 3.0, 0.5
"""Degrees of freedom and scale of what paths do to the mean gain of sharpness of a position, the latter in standard
deviations over its directions: the directions see the same few paths. Maximum likelihood over 120 random positions,
half of them with scattering (worlds of `benchmarks/quadrature.py`)."""

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
    relative: float
    """Standard deviation of the gain of sharpness by undoing it, over its mean."""


# The effect of a delay of Q is 1 - cos of twice the phase of the carrier, which differs from path to path: its relative
# standard deviation is 1 / sqrt(2). That of an exchange does not depend on it; a tenth is for what is not resolved.
CHANGES = (
    Change(exchanged, Code.QUADRATURE_EXCHANGED, 0.1),
    Change(q_earlier, Code.QUADRATURE_DELAYED, np.sqrt(0.5)),
    Change(q_later, Code.QUADRATURE_DELAYED, np.sqrt(0.5)),
)


def quadrature_evidence(responses: Complex, deembedding: Deembedding) -> list[float]:
    """Log-likelihood ratio of each of `CHANGES` to none.

    Undoing a change ``k`` that was made gains the sharpness ``L_k`` that the change costs the pulse of the filter
    itself, in the mean; undoing what was not made loses it. The mean gain ``g`` over directions with the standard
    deviation ``s`` has the error ``hypot(SCATTER s, r_k L_k)``, with a Student's distribution ``t``; the ratio is
    ``log t(g - L_k) - log t(g + L_k)``. An even response, which the exchange does not change, tells nothing.

    Parameters
    ----------
    responses : array complex (azimuth, elevation, sample)
        CIRs; NaN where nothing was recorded.
    deembedding : Deembedding
        The filter that made them.
    """
    flat = responses.reshape(-1, responses.shape[-1])
    power = np.abs(flat) ** 2
    ratio = power.max(axis=-1) / noise_power(power)
    strong = np.flatnonzero(np.nan_to_num(ratio) > LEAST_SNR)
    strong = strong[np.argsort(-ratio[strong])][:STRONGEST]
    if strong.size < 2:  # no standard deviation
        return [0.0] * len(CHANGES)
    seen = _correlation(flat[strong], deembedding)
    alone = _correlation(deembedding.pulse * PHASES[:, None], deembedding)
    sharp, sharp_alone = _sharpness(seen, deembedding), _sharpness(alone, deembedding)
    evidence = []
    for undo, _, relative in CHANGES:
        loss = float(np.mean(sharp_alone - _sharpness(undo(alone), deembedding)))
        gains = _sharpness(undo(seen), deembedding) - sharp
        error = np.hypot(SCATTER * gains.std(ddof=1), relative * loss)
        made, not_made = (((gains.mean() + sign * loss) / error) ** 2 for sign in (-1, 1))
        # Student's density has the logarithm -(TAILS + 1) / 2 log(1 + x^2 / TAILS) and a constant
        evidence.append(float((TAILS + 1) / 2 * (np.log1p(not_made / TAILS) - np.log1p(made / TAILS))))
    return evidence


def remarks_on_quadrature(evidence: Iterable[list[float]]) -> list[Remark]:
    """The change that the evidence of positions with one back-to-back makes certain, if any.

    Parameters
    ----------
    evidence : iterable of list of float
        Of each position, from :func:`quadrature_evidence`.

    Examples
    --------
    >>> remarks_on_quadrature([[3.0, -1.0, -1.0]])
    []
    >>> [remark] = remarks_on_quadrature([[3.0, -1.0, -1.0]] * 3)
    >>> remark.code.name, remark.figure
    ('QUADRATURE_EXCHANGED', 9.0)
    """
    total = np.sum([*evidence, [0.0] * len(CHANGES)], axis=0)
    best = int(total.argmax())
    if total[best] <= CERTAIN:
        return []
    code, figure = CHANGES[best].code, float(total[best])
    tens, asked = np.floor(figure / np.log(10)), np.ceil(CERTAIN / np.log(10))
    detail = f"{code.text}: the pulses speak for it by 10^{tens:.0f} to 1 (10^{asked:.0f} to 1 is certain)"
    return [Remark(code, figure=figure, bound=CERTAIN, detail=detail)]


def _correlation(responses: Complex, deembedding: Deembedding) -> Complex:
    """Correlation (direction, sample) that a filter made into CIRs, within its band."""
    transfer = deembedding.transfer
    inside = np.abs(transfer) > 1e-3 * np.abs(transfer).max()  # the window falls to zero at the edges of the band
    return np.fft.ifft(np.where(inside, np.fft.fft(responses) / np.where(inside, transfer, 1.0), 0.0))


def _sharpness(correlation: Complex, deembedding: Deembedding) -> Real:
    """Logarithm of ``sum p^2 / (sum p)^2`` over the power ``p`` about the peak (direction,): higher is sharper."""
    spectra = np.fft.fft(correlation) * deembedding.transfer
    spectra[:, 0] = (spectra[:, 1] + spectra[:, -1]) / 2
    spectra /= np.abs(spectra).max(axis=1, keepdims=True)  # powers of single precision, whatever the scale
    half = spectra.shape[1] // 2
    padded = np.zeros((len(spectra), fft.next_fast_len(spectra.shape[1] * OVERSAMPLING)), np.complex64)
    padded[:, :half], padded[:, -half:] = spectra[:, :half], spectra[:, -half:]
    power = np.abs(fft.ifft(padded)) ** 2
    about = np.argmax(power, axis=1)[:, None] + np.arange(-REACH * OVERSAMPLING, REACH * OVERSAMPLING + 1)
    near = np.take_along_axis(power, about % power.shape[1], axis=1)
    return np.asarray(np.log(np.sum(near**2, axis=1) / np.sum(near, axis=1) ** 2))
