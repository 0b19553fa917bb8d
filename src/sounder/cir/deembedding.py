"""Back-to-back de-embedding: remove the response of the instrument from correlated captures."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from erm.common.errors import DataError
from sounder.cir.amplitudes import wall_of_sequence
from sounder.cir.matched_filter import MatchedFilter
from sounder.cir.power_spectrum import noise_power
from sounder.cir.responses import noise_density, reference_spectrum
from sounder.instrument.description import Sounder
from sounder.instrument.periodic import Periodic
from sounder.instrument.touchstone import transmission
from sounder.instrument.waveform_description import Waveform
from sounder.recordings.recording import BackToBack

REGULARISATION = 1e-4
"""Power added to ``|B|^2``, relative to its mean in the band: -40 dB. At the edge of the default band, 0.9 of the main
lobe, held chips are at -19 dB."""

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


@dataclass(frozen=True)
class Deembedding:
    """Linear filter from a correlation to a calibrated channel impulse response (CIR).

    With the spectrum ``C = FFT(c)`` of a correlation with the held template, the spectrum ``B`` of the averaged
    back-to-back capture (correlated with the same template, which cancels) and the attenuator ``S21``,

    ``H = C G,   G = W B* S21 k / (|B|^2 + eps)``,   ``h = IFFT(H) N / sum(V)``,   ``V = W |B|^2 / (|B|^2 + eps)``.

    ``W`` is a raised cosine (Hann) over the band kept, zero outside it and at DC. ``k`` is the ratio of the scales of
    the two recordings over the gain of the transmit antenna. A path of amplitude ``a`` gives a peak of height ``a``
    and the shape ``pulse``. This holds for any instrument, as long as ``eps`` is small against ``|B|^2``.

    The sidelobes of the Hann window start at -31 dB and fall by 18 dB an octave: below -70 dB beyond 10 ns for
    1.08 GHz. The nulls of the held chips lie outside the band. DC holds 1/(N+1) of the power of an m-sequence and the
    whole offset of the receiver, so it is not measured; see :meth:`apply`.

    Attributes
    ----------
    transfer : array complex (sample,)
        ``G``.
    pulse : array complex (sample,)
        CIR of a single path of gain 1 and delay 0; its peak is 1.
    weight : array (sample,)
        ``V``, with DC interpolated between its neighbours; ``pulse`` is its transform.
    noise : array (sample,)
        Spectral density of white receiver noise behind the filter, ``|T G|^2`` with the spectrum ``T`` of the
        template; mean 1.
    sample_rate : float
        [Hz]
    self_noise : float
        Noise that a path of power 1 brings along in one snapshot, and receiver noise, in the back-to-back [1]. A path
        raises the noise floor by no more than this.
    wall : float
        Share of the samples close to the largest amplitude that the sequence makes by itself [1]; see
        `sounder.cir.amplitudes.wall_of_sequence`.
    measures_dc : bool
        Whether the bin at the carrier is measured, as in transfer functions.
    """

    transfer: Complex
    pulse: Complex
    weight: Real
    noise: Real
    sample_rate: float
    self_noise: float = 0.0
    wall: float = 0.0
    measures_dc: bool = False

    @cached_property
    def matched_filter(self) -> MatchedFilter:
        """Matched filter for a single path in a CIR; computed once."""
        return MatchedFilter.of(self.weight, self.noise)

    def apply(self, correlation: NDArray[np.complexfloating]) -> Complex:
        """De-embed correlations.

        The DC bin is not measured. It would add a constant to the whole CIR; this constant is chosen so that the median
        over delay of the real and of the imaginary part is zero, because a channel is empty at most delays.

        Parameters
        ----------
        correlation : array complex (..., sample)

        Returns
        -------
        array complex (..., sample)
            CIR: amplitude of the path gain, including the receive antenna.
        """
        cir = np.fft.ifft(np.fft.fft(np.asarray(correlation, complex)) * self.transfer)
        if self.measures_dc:
            return cir
        offset = np.median(cir.real, axis=-1) + 1j * np.median(cir.imag, axis=-1)
        return cir - offset[..., None]


def band_window(sounder: Sounder) -> Real:
    """Raised cosine over the band kept (sample,): 1 at the carrier, 0 at the edges and beyond."""
    waveform = sounder.waveform
    frequency = np.abs(np.fft.fftfreq(waveform.samples, 1 / waveform.sample_rate))
    inside = np.clip(frequency / (sounder.bandwidth / 2), 0, 1)
    window = 0.5 + 0.5 * np.cos(np.pi * inside)
    if isinstance(waveform, Periodic):  # lines that are not sent are not measured
        power = np.abs(np.fft.fft(waveform.sampled)) ** 2
        window[power <= REGULARISATION * power.mean()] = 0.0
    return window


def make_deembedding(b2b: BackToBack, mean_correlation: Complex, sounder: Sounder, scale_factor: float) -> Deembedding:
    """Make the de-embedding filter from a back-to-back recording.

    Parameters
    ----------
    b2b : BackToBack
        Recording with an attenuator in place of the antennas.
    mean_correlation : array complex (sample,)
        Its captures, averaged and correlated with the held template.
    sounder : Sounder
        Description of the recordings to be de-embedded.
    scale_factor : float
        Amplitude of one LSB in these recordings [sqrt(mW)].

    Returns
    -------
    Deembedding

    Raises
    ------
    DataError
        The back-to-back recording is of another sounder or empty, or its S21 does not cover the band.
    """
    _require_same_sounder(b2b, sounder)
    if not np.any(mean_correlation):
        raise DataError(f"{b2b.source}: all back-to-back samples are zero; record it again")
    waveform = sounder.waveform
    frequency: Real = np.fft.fftfreq(waveform.samples, 1 / waveform.sample_rate).astype(float)
    window = band_window(sounder)
    measures_dc = b2b.kind == "ctf"
    if not measures_dc:
        window[0] = 0.0
    inside = window > 0
    template = reference_spectrum(b2b.kind, sounder)
    response = np.where(inside, np.fft.fft(mean_correlation) / np.where(inside, template, 1), 0)
    gathers = mean_correlation  # around one delay
    if isinstance(waveform, Periodic):  # of which the correlation may have sidelobes, but the response has none
        gathers = np.fft.ifft(response * window / np.where(inside, np.conj(template), 1))
    _require_peak(b2b, gathers, sounder)
    power = np.abs(response) ** 2
    regularised = power + REGULARISATION * power[inside].mean()
    kept = window * power / regularised
    if not measures_dc:
        kept[0] = (kept[1] + kept[-1]) / 2
    amplitude = scale_factor / b2b.scale_factor
    if not b2b.includes_tx_antenna:
        amplitude /= 10 ** (sounder.tx_antenna.gain / 20)
    through = _attenuator(b2b, frequency + sounder.carrier.frequency, inside)
    norm = waveform.samples / kept.sum()
    transfer = np.where(inside, window * np.conj(response) / regularised / np.where(inside, template, 1), 0)
    transfer = transfer * through * amplitude * norm
    noise = noise_density(b2b, sounder, response) * np.abs(transfer) ** 2
    return Deembedding(
        transfer=transfer,
        pulse=np.fft.ifft(kept) * norm,
        weight=kept,
        noise=noise / noise.mean(),
        sample_rate=waveform.sample_rate,
        self_noise=_self_noise(mean_correlation) * len(b2b.captures),
        wall=wall_of_sequence(b2b.captures) if b2b.kind == "iq" else 0.0,
        measures_dc=measures_dc,
    )


def _self_noise(correlation: Complex) -> float:
    """Noise floor of a correlation relative to its peak."""
    power = np.abs(correlation - np.median(correlation.real) - 1j * np.median(correlation.imag)) ** 2
    return float(noise_power(power) / power.max())


def _attenuator(b2b: BackToBack, frequency: Real, inside: NDArray[np.bool_]) -> Complex:
    """Complex transmission of the attenuator at frequencies (sample,) [Hz], measured or nominal."""
    if b2b.s21 is None:
        return np.full(frequency.shape, 10 ** (-b2b.attenuation / 20), complex)
    measured, s21 = b2b.s21
    low, high = frequency[inside].min(), frequency[inside].max()
    if measured.min() > low or measured.max() < high:
        raise DataError(
            f"{b2b.source}: the attenuator was measured from {measured.min() / 1e9:.2f} to {measured.max() / 1e9:.2f} "
            f"GHz; expected the band kept, {low / 1e9:.2f} to {high / 1e9:.2f} GHz; measure it over the whole band"
        )
    return transmission(measured, s21, frequency)


def _require_same_sounder(b2b: BackToBack, sounder: Sounder) -> None:
    pairs = {
        "samples per capture": (b2b.captures.shape[1], sounder.waveform.samples),
        "sample rate [Hz]": (b2b.sounder.waveform.sample_rate, sounder.waveform.sample_rate),
        "carrier [Hz]": (b2b.sounder.carrier.frequency, sounder.carrier.frequency),
    }
    for name, (found, expected) in pairs.items():
        if found != expected:
            raise DataError(
                f"{b2b.source}: back-to-back of another sounder: {name} {found:g}, the recording has {expected:g}; "
                "pass the back-to-back of this sounder with --calibration"
            )


def _require_peak(b2b: BackToBack, correlation: Complex, sounder: Sounder) -> None:
    """Refuse a capture in which the described sequence does not stand out.

    The right sequence gathers the power around one delay. Any other m-sequence spreads it: a quarter of the power lies
    in a quarter of the period, and the highest peak, 383 of 1023 at worst, adds 14 %. The threshold of 60 % lies
    between; it is chosen, not derived.
    """
    power = np.abs(correlation - correlation.mean()) ** 2
    near = np.roll(power, power.size // 8 - int(np.argmax(power)))[: power.size // 4]
    gathered = near.sum() / power.sum()
    if gathered < 0.6:
        if b2b.kind != "iq":
            raise DataError(
                f"{b2b.source}: {100 * gathered:.0f} % of the power of the back-to-back is around one delay; "
                "expected at least 60 %; check its cables, and that it is of this sounder"
            )
        waveform = sounder.sent
        which = waveform.summary
        if isinstance(waveform, Waveform):
            which = f"order {waveform.order}, polynomial {list(waveform.polynomial)}, {waveform.direction}"
        raise DataError(
            f"{b2b.source}: back-to-back of another sounder: the sequence of {sounder.name} ({which}) does not stand "
            "out in it "
            f"({100 * gathered:.0f} % of its power around one delay, expected at least 60 %); "
            "sounder info on it shows the sequence that it holds"
        )
