"""What is known in advance of a back-to-back recording: equal snapshots, one path, a linear device, stated levels."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from erm.common.significance import FALSE_ALARM
from sounder.cir.deembedding import band_window
from sounder.instrument.description import Sounder
from sounder.instrument.touchstone import transmission
from sounder.instrument.waveform import held_template
from sounder.kernels.correlation.reference import as_complex
from sounder.recordings.recording import BackToBack, Captures

TESTS = 3
"""Tests of a back-to-back that share `FALSE_ALARM`: of its histogram, of products of compression, of other paths."""
PRODUCT_LEVEL = -55.0
"""Level below which what lies outside the response is of no account [dB]: the noise of a recording is seldom so far
below its strongest path, and ordinary converters and mixers make products of -60 dB: those of the twin up to -59 dB in
300 instruments (`benchmarks/damage_calibration.py`)."""
REFLECTION_LEVEL = -10.0
"""Highest level of a reflection in the cables [dB]: two ends with 5 dB return loss each, a VSWR of 3.6."""
CABLE_REACH = 100e-9
"""Longest delay of such a reflection [s]: there and back in 10 m of cable at 0.67 of the speed of light."""
PULSE_CELLS = 10
"""Resolution cells before the response beyond which its window has fallen below -80 dB."""

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


@dataclass(frozen=True)
class Response:
    """Response of the instrument in a back-to-back recording.

    Attributes
    ----------
    snapshots : array complex (snapshot, sample)
        Impulse response of each snapshot, over the band kept [LSB].
    mean : array complex (sample,)
        Their mean.
    peak : int
        Sample of its maximum.
    reach : int
        Samples after the peak up to which reflections in the cables may come.
    before : int
        Samples before the peak to which the pulse reaches.
    """

    snapshots: Complex
    mean: Complex
    peak: int
    reach: int
    before: int

    @classmethod
    def of(cls, captures: Captures, sounder: Sounder) -> "Response":
        """Divide the spectra of captures by that of the sequence, in the band kept."""
        waveform = sounder.sent
        samples = as_complex(captures)
        window = band_window(sounder)
        window[0] = 0.0  # the receiver's offset
        template = np.fft.fft(held_template(waveform))
        inside = window > 0
        spectra = np.fft.fft(samples) * np.where(inside, window, 0.0) / np.where(inside, template, 1.0)
        spectra[:, 0] = (spectra[:, 1] + spectra[:, -1]) / 2
        each = np.fft.ifft(spectra)
        mean = each.mean(axis=0)
        cell = waveform.sample_rate / sounder.bandwidth
        return cls(
            each,
            mean,
            int(np.argmax(np.abs(mean))),
            min(round(CABLE_REACH * waveform.sample_rate), waveform.samples // 4),
            int(np.ceil(PULSE_CELLS * cell)),
        )

    @property
    def centred(self) -> Complex:
        """Mean response with its peak at index ``before`` (sample,)."""
        return np.roll(self.mean, self.before - self.peak)

    @property
    def outside(self) -> Complex:
        """The part of the mean response in which a linear instrument has nothing but noise."""
        return self.centred[self.before + self.reach :]


def slipped_snapshots(response: Response) -> list[tuple[int, int]]:
    """Snapshots that start at another sample than most.

    The cross-correlation of a snapshot with another of the same response is largest at lag 0, whatever the response.

    Returns
    -------
    list of (int, int)
        Number of the snapshot and its lag behind most others [sample].
    """
    peaks = np.argmax(np.abs(response.snapshots), axis=1)
    common = np.bincount(peaks).argmax()
    reference = np.fft.fft(response.snapshots[np.flatnonzero(peaks == common)[0]])
    lags = np.argmax(np.abs(np.fft.ifft(np.fft.fft(response.snapshots) * np.conj(reference))), axis=1)
    half = response.mean.size // 2
    lags = (lags + half) % response.mean.size - half
    return [(int(i), int(lag)) for i, lag in enumerate(lags) if lag]


def outside_level(response: Response) -> tuple[float, float]:
    """Level of the strongest sample outside the response of a linear instrument, and the bound on it [dB].

    Outside its pulse and the reflections in the cables a linear instrument has noise only. Its power per sample is
    exponential, with the median ``m ln 2``; the largest of ``n`` samples exceeds ``m ln(n / p)`` with chance ``p``.
    """
    power = np.abs(response.outside) ** 2
    peak = np.abs(response.mean[response.peak]) ** 2
    bound = max(_noise(power) * np.log(power.size * TESTS / FALSE_ALARM) / peak, 10 ** (PRODUCT_LEVEL / 10))
    return _db(power.max() / peak), _db(bound)


def compression_level(response: Response, sounder: Sounder) -> tuple[float, float]:
    """Level of the products of compression, and the bound on it [dB].

    An amplifier or a converter that compresses multiplies the m-sequence with shifts of itself. Such a product is the
    sequence again, at another shift (shift-and-add; Golomb, 1967): a false path at a delay that all recordings share.
    The captures are predicted from the response, ``y = t * h``. Compression adds ``a |y|^2 y``, whose response ``g``
    outside ``h`` is known; ``a`` is fitted. The power of the fit in noise alone is exponential.
    """
    linear = response.centred.copy()
    linear[response.before + response.reach :] = 0
    template = np.fft.fft(held_template(sounder.sent))
    predicted = np.fft.ifft(np.fft.fft(linear) * template)
    window = band_window(sounder)
    cubic = np.fft.fft(np.abs(predicted) ** 2 * predicted) * window / np.where(window > 0, template, 1.0)
    expected = np.fft.ifft(cubic)[response.before + response.reach :]
    found = response.outside
    energy = np.vdot(expected, expected).real
    fitted = np.abs(np.vdot(expected, found)) ** 2 / energy
    largest = np.max(np.abs(expected) ** 2) / energy / np.abs(response.mean[response.peak]) ** 2
    bound = max(_noise(np.abs(found) ** 2) * np.log(TESTS / FALSE_ALARM) * largest, 10 ** (PRODUCT_LEVEL / 10))
    return _db(fitted * largest), _db(bound)


def _noise(power: Real) -> float:
    """Mean of exponential noise among few stronger samples."""
    return float(np.median(power) / np.log(2))


def reflection_level(response: Response) -> tuple[float, float]:
    """Level of the strongest reflection in the cables [dB], and its delay [sample]."""
    power = np.abs(response.centred[response.before : response.before + response.reach]) ** 2
    # the slope of the pulse is no reflection: only what rises again
    rising = np.flatnonzero((power[1:-1] > power[:-2]) & (power[1:-1] >= power[2:])) + 1
    if not rising.size:
        return -np.inf, 0.0
    best = rising[np.argmax(power[rising])]
    return _db(power[best] / power[0]), float(best)


def level_error(b2b: BackToBack, sounder: Sounder, response: Response) -> float | None:
    """How much stronger the back-to-back is than transmitter and attenuator make it [dB]; None if it is not known.

    ``P_rx = P_tx - A``. The power is that of the mean capture, so that noise does not count, without its offset.
    """
    power = sounder.transmitter.power
    if power is None or b2b.scale_factor == RELATIVE_SCALE:
        return None
    mean = as_complex(b2b.captures).mean(axis=0)
    received = _db(np.var(mean)) + 20 * np.log10(b2b.scale_factor)
    expected = power - loss(b2b, sounder) + (sounder.tx_antenna.gain if b2b.includes_tx_antenna else 0.0)
    return float(received - expected)


RELATIVE_SCALE = 1.0
"""Scale factor of recordings whose unit is not known."""


def loss(b2b: BackToBack, sounder: Sounder) -> float:
    """Loss of the attenuator at the carrier [dB]."""
    if b2b.s21 is None:
        return b2b.attenuation
    return -_db(float(np.abs(transmission(*b2b.s21, np.array([sounder.carrier.frequency]))[0]) ** 2))


def group_delay(b2b: BackToBack, sounder: Sounder) -> float | None:
    """Group delay of the measured attenuator over the band kept [s]; None without S21."""
    if b2b.s21 is None:
        return None
    frequency, s21 = b2b.s21
    inside = np.abs(frequency - sounder.carrier.frequency) <= sounder.bandwidth / 2
    if inside.sum() < 2:
        return None
    slope = np.polyfit(frequency[inside] - sounder.carrier.frequency, np.unwrap(np.angle(s21[inside])), 1)[0]
    return float(-slope / (2 * np.pi))


def peak_delay(response: Response) -> float:
    """Delay of the peak, by a parabola through the decibels of three samples [sample]."""
    size = response.mean.size
    left, middle, right = (_db(np.abs(response.mean[(response.peak + k) % size]) ** 2) for k in (-1, 0, 1))
    return response.peak + 0.5 * (left - right) / (left - 2 * middle + right)


def _db(power: float | np.floating) -> float:
    return float(10 * np.log10(np.maximum(power, np.finfo(float).tiny)))
