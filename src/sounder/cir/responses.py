"""Captures that are responses already: impulse responses over delay, and transfer functions over frequency."""

from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import NDArray

from erm.common.errors import DataError
from sounder.instrument.description import Sounder
from sounder.instrument.periodic import Periodic
from sounder.instrument.waveform import chips, held_template
from sounder.instrument.waveform_description import Sweep, Waveform
from sounder.kernels.correlation.m_sequence import MSequenceCorrelator
from sounder.recordings.recording import BackToBack, Captures, Kind

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


class ResponseCorrelator:
    """Stands in for a correlator where captures are responses: nothing is correlated.

    An impulse response passes as it is. A transfer function ``H`` (sample,) in ascending order of frequency becomes
    ``IFFT(H)``; its entry ``samples // 2`` belongs to the carrier.

    Parameters
    ----------
    samples : int
        Samples of a capture.
    over_frequency : bool
        Captures are transfer functions.

    Examples
    --------
    A path of one sample's delay, as a transfer function of eight frequencies:

    >>> frequency = np.arange(-4, 4)
    >>> response = ResponseCorrelator(8, over_frequency=True).correlate(np.exp(-2j * np.pi * frequency / 8)[None])
    >>> np.abs(response[0]).round(6).tolist()
    [0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    """

    def __init__(self, samples: int, *, over_frequency: bool) -> None:
        self.samples = samples
        self._over_frequency = over_frequency

    def correlate(self, captures: Captures) -> NDArray[np.complex64]:
        """Impulse responses, complex64 (snapshot, sample), of int16 (snapshot, sample, 2) or complex64 captures."""
        plain = captures[..., 0] + 1j * captures[..., 1] if captures.dtype.kind == "i" else captures.astype(complex)
        return self.correlate_mean(plain).astype(np.complex64)

    def correlate_mean(self, captures: NDArray[np.complexfloating]) -> Complex:
        """Impulse responses (..., sample) in double precision."""
        if self._over_frequency:
            return np.fft.ifft(np.fft.ifftshift(captures, axes=-1), axis=-1)
        return np.asarray(captures, complex)

    def accumulator(self) -> "ResponseAccumulator":
        """Return empty sums that are fed in blocks."""
        return ResponseAccumulator(self)


class TemplateCorrelator(ResponseCorrelator):
    """Circular correlation with a period of any waveform.

    Parameters
    ----------
    waveform : Periodic
    """

    def __init__(self, waveform: Periodic) -> None:
        super().__init__(waveform.samples, over_frequency=False)
        self._reference = np.conj(np.fft.fft(waveform.sampled))

    def correlate_mean(self, captures: NDArray[np.complexfloating]) -> Complex:
        """Correlations (..., sample) in double precision."""
        from scipy.fft import fft, ifft  # slow to import

        return np.asarray(ifft(fft(np.asarray(captures, complex)) * self._reference))


class ResponseAccumulator:
    """Mean and mean power of responses that arrive in blocks."""

    def __init__(self, correlator: ResponseCorrelator) -> None:
        self._correlator, self._count = correlator, 0
        self._sum, self._power = np.zeros(correlator.samples, complex), np.zeros(correlator.samples)

    def add(self, captures: Captures) -> None:
        """Add captures (snapshot, sample)."""
        responses = self._correlator.correlate(captures)
        self._sum += responses.sum(axis=0, dtype=complex)
        self._power += np.sum(np.abs(responses) ** 2, axis=0, dtype=float)
        self._count += len(responses)

    def result(self) -> tuple[NDArray[np.complex64], NDArray[np.float64]]:
        """Mean response, complex64 (sample,), and mean power, float64 (sample,)."""
        return (self._sum / self._count).astype(np.complex64), self._power / self._count


def power_of_responses(
    blocks: Iterable[Captures],
    correlator: ResponseCorrelator,
    deembed: Callable[[NDArray[np.complexfloating]], Complex],
) -> Complex:
    """Root of the mean power of de-embedded responses, with the phase of their mean (sample,)."""
    total, mean, count = np.zeros(correlator.samples), np.zeros(correlator.samples, complex), 0
    for captures in blocks:
        responses = deembed(correlator.correlate(captures))
        total += np.sum(np.abs(responses) ** 2, axis=0)
        mean += responses.sum(axis=0)
        count += len(responses)
    return np.sqrt(total / count) * np.exp(1j * np.angle(mean))


Correlator = MSequenceCorrelator | ResponseCorrelator


def correlator_of(kind: Kind, sounder: Sounder) -> Correlator:
    """Correlator for captures of a kind.

    Raises
    ------
    DataError
        The kind does not go with what the sounder sends.
    """
    if kind == "iq":
        sent = sounder.sent
        if isinstance(sent, Waveform):
            return MSequenceCorrelator(chips(sent), sent.samples_per_chip)
        return TemplateCorrelator(sent)
    if kind == "ctf" and not isinstance(sounder.waveform, Sweep):
        raise DataError(f"{sounder.name} sends an m-sequence; transfer functions need a sweep")
    return ResponseCorrelator(sounder.waveform.samples, over_frequency=kind == "ctf")


def reference_spectrum(kind: Kind, sounder: Sounder) -> Complex:
    """Spectrum (sample,) that captures of a kind were correlated with here; 1 for those that are responses."""
    if kind == "iq":
        return np.conj(np.fft.fft(held_template(sounder.sent)))
    return np.ones(sounder.waveform.samples, complex)


def noise_density(b2b: BackToBack, sounder: Sounder, response: Complex) -> Real:
    """Density (sample,) of the noise in correlated captures of the kind of ``b2b``, where that of captures is white.

    Correlation gives noise the spectrum of the template. Frequencies of a sweep have the same noise. A sweep's impulse
    response has that of its pulse, ``response``, by which its frequencies were weighted.
    """
    sequence = sounder.waveform if b2b.sequence is None else b2b.sequence
    if not isinstance(sequence, Sweep):
        return cut_density(held_template(sequence), sounder.waveform.samples)
    return np.abs(response) ** 2 if b2b.kind == "cir" else np.ones(sequence.samples)


def cut_density(template: Complex | Real, samples: int) -> Real:
    """Spectral density of noise behind a correlator, in a response that was cut to fewer samples than the period.

    The covariance ``r`` of the noise is the circular autocorrelation of the template (N,). A cut of L samples holds
    ``L - l`` pairs at the lag ``l``, and its discrete spectrum takes the lag ``l - L`` for the same, so that it has the
    density ``FFT(((L - l) r[l] + l r[l - L]) / L)``. For ``L = N`` this is ``|FFT(template)|^2`` (T. Chan, An optimal
    circulant preconditioner for Toeplitz systems, SIAM J. Sci. Stat. Comput. 9(4), 1988).

    Parameters
    ----------
    template : array (N,)
    samples : int
        L.

    Returns
    -------
    array (L,)

    Examples
    --------
    A chip that is held over two samples, in a period of eight and cut to four:

    >>> cut_density(np.array([1.0, 1, 0, 0, 0, 0, 0, 0]), 4).round(6).tolist()
    [3.5, 2.0, 0.5, 2.0]
    """
    covariance = np.fft.ifft(np.abs(np.fft.fft(template)) ** 2)
    lag = np.arange(samples)
    period = covariance.size
    wrapped = (samples - lag) * covariance[lag % period] + lag * covariance[(lag - samples) % period]
    return np.asarray(np.fft.fft(wrapped / samples).real)
