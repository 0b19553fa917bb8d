"""Back-to-back de-embedding: take the instrument's own response out of correlated captures."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from erm.common.errors import DataError
from sounder.cir.matched_filter import MatchedFilter
from sounder.instrument.description import Sounder
from sounder.instrument.waveform import held_template
from sounder.recordings.recording import BackToBack

REGULARISATION = 1e-4
"""Power added to ``|B|^2``, relative to its mean in the band: -40 dB, 20 dB under the held chip's edge at 540 MHz."""

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


@dataclass(frozen=True)
class Deembedding:
    """Linear filter from a correlation to a calibrated CIR.

    With ``C = FFT(c)`` the spectrum of a correlation with the held template ``t``, ``B`` the spectrum of the averaged
    back-to-back capture (correlated likewise, so that ``T*`` cancels) and ``S21`` the attenuator,

    ``H = C G,   G = W B* S21 k / (|B|^2 + eps)``,   ``h = IFFT(H) N / sum(V)``,   ``V = W |B|^2 / (|B|^2 + eps)``.

    ``W`` is a raised cosine (Hann) over the band kept, zero outside it and at DC; ``k`` is the ratio of the two
    recordings' scales over the transmit antenna's gain. One path of amplitude ``a`` gives a peak of height ``a`` and
    the shape ``pulse``; where ``eps`` is small against ``|B|^2``, whatever the instrument.

    The Hann window's sidelobes start at -31 dB and fall at 18 dB an octave: under -70 dB beyond 10 ns for 1.08 GHz.
    The spectral nulls carry no weight: Nyquist lies outside the band. DC holds 1/(N+1) of an m-sequence's power and
    all of the receiver's offset, so it is not measured at all; see :meth:`apply`.

    Attributes
    ----------
    transfer : array complex (sample,)
        ``G``.
    pulse : array complex (sample,)
        CIR of a single path of gain 1 and delay 0; its peak is 1.
    weight : array (sample,)
        ``V`` with DC filled in between its neighbours; ``pulse`` is its transform.
    noise : array (sample,)
        Spectral density of what white receiver noise becomes, ``|T G|^2`` with ``T`` the template's spectrum; mean 1.
    sample_rate : float
        [Hz]
    """

    transfer: Complex
    pulse: Complex
    weight: Real
    noise: Real
    sample_rate: float

    @cached_property
    def matched_filter(self) -> MatchedFilter:
        """What finds a single path in a CIR; the positions of a campaign share it."""
        return MatchedFilter.of(self.weight, self.noise)

    def apply(self, correlation: NDArray[np.complexfloating]) -> Complex:
        """De-embed correlations.

        The DC bin that no capture holds adds one constant to the whole CIR. It is restored as the constant that makes
        the median over delay of the real and of the imaginary part zero: a channel is empty at most delays.

        Parameters
        ----------
        correlation : array complex (..., sample)

        Returns
        -------
        array complex (..., sample)
            CIR; path gain amplitude, the receive antenna included.
        """
        cir = np.fft.ifft(np.fft.fft(np.asarray(correlation, complex)) * self.transfer)
        offset = np.median(cir.real, axis=-1) + 1j * np.median(cir.imag, axis=-1)
        return cir - offset[..., None]


def band_window(sounder: Sounder) -> Real:
    """Raised cosine over the band kept [1]: one at the carrier, zero at the edges and beyond; shape (sample,)."""
    waveform = sounder.waveform
    frequency = np.abs(np.fft.fftfreq(waveform.samples, 1 / waveform.sample_rate))
    inside = np.clip(frequency / (sounder.bandwidth / 2), 0, 1)
    return 0.5 + 0.5 * np.cos(np.pi * inside)


def make_deembedding(b2b: BackToBack, mean_correlation: Complex, sounder: Sounder, scale_factor: float) -> Deembedding:
    """Make the de-embedding filter from a back-to-back recording.

    Parameters
    ----------
    b2b : BackToBack
        The recording with the attenuator in the antennas' place.
    mean_correlation : array complex (sample,)
        Its captures, correlated with the held template and averaged.
    sounder : Sounder
        The description of the recordings to be de-embedded.
    scale_factor : float
        Amplitude of one LSB in them [sqrt(mW)].

    Returns
    -------
    Deembedding

    Raises
    ------
    DataError
        The back-to-back is of another sequence or rate, is empty, or its attenuator was not measured over the band.
    """
    _require_same_sounder(b2b, sounder)
    if not np.any(mean_correlation):
        raise DataError(f"{b2b.source}: all back-to-back samples are zero; record it again")
    _require_peak(b2b, mean_correlation, sounder)
    waveform = sounder.waveform
    frequency: Real = np.fft.fftfreq(waveform.samples, 1 / waveform.sample_rate).astype(float)
    window = band_window(sounder)
    window[0] = 0.0
    inside = window > 0
    template = np.conj(np.fft.fft(held_template(waveform)))
    known = np.where(inside, np.fft.fft(mean_correlation) / np.where(inside, template, 1), 0)
    power = np.abs(known) ** 2
    regularised = power + REGULARISATION * power[inside].mean()
    kept = window * power / regularised
    kept[0] = (kept[1] + kept[-1]) / 2
    amplitude = scale_factor / b2b.scale_factor
    if not b2b.includes_tx_antenna:
        amplitude /= 10 ** (sounder.tx_antenna.gain / 20)
    through = attenuation(b2b, frequency + sounder.carrier.frequency, inside)
    norm = waveform.samples / kept.sum()
    transfer = np.where(inside, window * np.conj(known) / regularised / np.where(inside, template, 1), 0)
    transfer = transfer * through * amplitude * norm
    noise = np.abs(template * transfer) ** 2
    return Deembedding(
        transfer=transfer,
        pulse=np.fft.ifft(kept) * norm,
        weight=kept,
        noise=noise / noise.mean(),
        sample_rate=waveform.sample_rate,
    )


def attenuation(b2b: BackToBack, frequency: Real, inside: NDArray[np.bool_]) -> Complex:
    """Complex transmission of the attenuator at the carrier-band frequencies.

    Magnitude in dB and unwrapped phase are interpolated linearly, which keeps the delay of the device.

    Raises
    ------
    DataError
        The measured S21 does not cover the band kept.
    """
    if b2b.s21 is None:
        return np.full(frequency.shape, 10 ** (-b2b.attenuation / 20), complex)
    measured, s21 = b2b.s21
    low, high = frequency[inside].min(), frequency[inside].max()
    if measured.min() > low or measured.max() < high:
        raise DataError(
            f"{b2b.source}: the attenuator was measured from {measured.min() / 1e9:.2f} to {measured.max() / 1e9:.2f} "
            f"GHz; the band kept is {low / 1e9:.2f} to {high / 1e9:.2f} GHz"
        )
    gain = np.interp(frequency, measured, 20 * np.log10(np.abs(s21)))
    phase = np.interp(frequency, measured, np.unwrap(np.angle(s21)))
    return 10 ** (gain / 20) * np.exp(1j * phase)


def _require_same_sounder(b2b: BackToBack, sounder: Sounder) -> None:
    theirs, ours = b2b.sounder, sounder
    pairs = {
        "samples a capture": (b2b.captures.shape[1], ours.waveform.samples),
        "sample rate [Hz]": (theirs.waveform.sample_rate, ours.waveform.sample_rate),
        "carrier [Hz]": (theirs.carrier.frequency, ours.carrier.frequency),
    }
    for name, (have, want) in pairs.items():
        if have != want:
            raise DataError(
                f"{b2b.source}: back-to-back of another sounder: {name} {have:g}, the recording has {want:g}; "
                "pass the back-to-back of this sounder with --calibration"
            )


def _require_peak(b2b: BackToBack, correlation: Complex, sounder: Sounder) -> None:
    """Refuse a capture in which the described sequence does not stand out."""
    # The right sequence gathers the power around one delay. Any other m-sequence spreads it: a quarter of it lies in
    # a quarter of the period, and its highest peak, 383 of 1023 at worst, holds 14 % more.
    power = np.abs(correlation - correlation.mean()) ** 2
    near = np.roll(power, power.size // 8 - int(np.argmax(power)))[: power.size // 4]
    gathered = near.sum() / power.sum()
    if gathered < 0.6:
        waveform = sounder.waveform
        raise DataError(
            f"{b2b.source}: back-to-back of another sounder: the sequence of {sounder.name} (order {waveform.order}, "
            f"polynomial {list(waveform.polynomial)}, {waveform.direction}) does not stand out in it "
            f"({100 * gathered:.0f} % of its power around one delay, expected 60); "
            "run sounder info on it to find what it holds"
        )
