"""Delay and gain of a connected device, from its captures and a calibration."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from sounder.cir.deembedding import Deembedding
from sounder.instrument.description import Sounder
from sounder.instrument.touchstone import transmission
from sounder.instrument.waveform import held_template
from sounder.kernels.correlation.reference import as_complex
from sounder.quality.back_to_back import Response
from sounder.recordings.recording import BackToBack

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]


class Transfer(NamedTuple):
    """Delay [s] and gain [dB] of each snapshot over those of a known transmission."""

    delay: Real
    gain: Real


def measured_transfer(b2b: BackToBack, deembedding: Deembedding, known: Complex) -> Transfer:
    """Compare a connected device with its known transmission.

    With the measured spectrum ``H = R S V``, the known transmission ``S``, the weight ``V`` of the pulse, and the ratio
    ``R = g exp(j phi - j 2 pi f t)``, the delay error ``t`` maximises ``|sum H conj(S V) exp(j 2 pi f t)|``, and the
    gain error ``g`` is this maximum over ``sum |S V|^2``: the least-squares estimates in white noise.

    Parameters
    ----------
    b2b : BackToBack
        Captures of the device in place of the antennas.
    deembedding : Deembedding
        Calibration, for recordings with the scale of ``b2b``.
    known : array complex (sample,)
        ``S``, in the order of ``numpy.fft.fftfreq``.
    """
    sounder = b2b.sounder
    frequency: Real = np.fft.fftfreq(sounder.waveform.samples, 1 / sounder.waveform.sample_rate).astype(float)
    weight = deembedding.weight / deembedding.weight.sum() * deembedding.weight.size
    weight = np.where(frequency == 0, 0.0, weight)  # DC is not measured
    correlation = np.fft.fft(as_complex(b2b.captures)) * np.conj(np.fft.fft(held_template(sounder.sent)))
    measured = correlation * deembedding.transfer
    if not b2b.includes_tx_antenna:  # the calibration refers to the port of an isotropic antenna
        measured = measured * 10 ** (sounder.tx_antenna.gain / 20)
    expected = known * weight
    product = measured * np.conj(expected)
    energy = np.sum(np.abs(expected) ** 2)
    delays, gains = np.empty(len(product)), np.empty(len(product))
    for k, spectrum in enumerate(product):
        delays[k], height = _peak(spectrum, frequency, sounder)
        gains[k] = 20 * np.log10(height / energy)
    return Transfer(delays, gains)


def _peak(spectrum: Complex, frequency: Real, sounder: Sounder) -> tuple[float, float]:
    """Delay [s] and height of the maximum of the transform of a spectrum."""
    used = spectrum != 0
    line, turn = spectrum[used], 2j * np.pi * frequency[used]

    def height(delay: float) -> float:
        return float(np.abs(np.sum(line * np.exp(turn * delay))))

    coarse = int(np.argmax(np.abs(np.fft.ifft(spectrum))))
    step, size = 1 / sounder.waveform.sample_rate, spectrum.size
    start = ((coarse + size // 2) % size - size // 2) * step
    fine = minimize_scalar(
        lambda delay: -height(start + delay * step), bounds=(-1, 1), method="bounded", options={"xatol": 1e-6}
    )
    return start + float(fine.x) * step, -float(fine.fun)


def known_transmission(
    sounder: Sounder, s21: tuple[Real, Complex] | None, attenuation: float | None, delay: float | None
) -> Complex:
    """Transmission of a device at the frequencies of a capture (sample,): measured, or loss [dB] and delay [s]."""
    frequency: Real = np.fft.fftfreq(sounder.waveform.samples, 1 / sounder.waveform.sample_rate).astype(float)
    if s21 is not None:
        return transmission(*s21, frequency + sounder.carrier.frequency)
    gain = 10 ** (-(attenuation or 0.0) / 20)
    return np.asarray(gain * np.exp(-2j * np.pi * frequency * (delay or 0.0)))


def dynamic_range(b2b: BackToBack) -> float:
    """Peak of the mean response over the strongest sample outside pulse and cable reflections [dB]."""
    response = Response.of(b2b.captures, b2b.sounder)
    spurious = np.max(np.abs(response.outside))
    return float(20 * np.log10(np.abs(response.mean[response.peak]) / spurious))
