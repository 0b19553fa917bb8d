"""Faults of an instrument: one equation each, and each can be switched off."""

from typing import Annotated, Any, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator
from scipy.constants import k as boltzmann

from sounder.toml import MOST_DECIBELS, Decibels, NotNegative, NotNegativeDecibels, Table

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]
Seed = Annotated[int, Field(ge=0)]


class SystemResponse(Table):
    """Linear response of cables, filters and mixers, the same in a recording and in its back-to-back.

    ``R(f) = 10**(slope f / 20e9) exp(-2j pi f delay) (1 + sum_k c_k exp(-2j pi f t_k))``: a tilt, a delay, and echoes
    between mismatched ends. ``t_k`` is uniform up to ``longest_echo``. ``c_k`` is complex normal; its variance follows
    from ``ripple``, the standard deviation of ``20 log10 |R|``: ``ripple = 8.686 sqrt(sum_k var(c_k) / 2)``.
    Source: Pozar, Microwave Engineering, 4th ed., section 2.3 (multiple reflections on a line).

    Parameters
    ----------
    ripple : float
        Standard deviation over frequency [dB].
    slope : float
        Tilt [dB/GHz].
    delay, longest_echo : float
        Delay of the system, and longest delay of an echo after it [s].
    echoes : int
        Number of echoes.
    seed : int
        Each seed is another instrument.
    """

    ripple: Annotated[float, Field(ge=0, le=2)] = 0.6
    slope: Decibels = 1.5
    delay: NotNegative = 37e-9
    echoes: Annotated[int, Field(ge=1)] = 6
    longest_echo: NotNegative = 8e-9
    seed: Seed = 132

    def response(self, frequency: Real) -> Complex:
        """``R`` at baseband frequencies [Hz]."""
        rng = np.random.default_rng(self.seed)
        delays = rng.uniform(0, self.longest_echo, self.echoes)
        deviation = self.ripple / (20 / np.log(10)) * np.sqrt(2 / self.echoes)
        level = deviation * (rng.standard_normal(self.echoes) + 1j * rng.standard_normal(self.echoes)) / np.sqrt(2)
        echoes = np.exp(-2j * np.pi * np.multiply.outer(frequency, delays)) @ level
        tilt = 10 ** (self.slope * frequency / 20e9)
        response: Complex = tilt * np.exp(-2j * np.pi * frequency * self.delay) * (1 + echoes)
        return response


class PhaseNoise(Table):
    """Wiener phase of a free-running oscillator: increments of variance ``2 pi linewidth dt``.

    The phase continues from sample to sample and from one snapshot to the next.
    Source: Demir, Mehrotra, Roychowdhury, IEEE Trans. Circuits Syst. I 47 (2000) 655-674.

    Parameters
    ----------
    linewidth : float
        Full width at half maximum of the carrier's Lorentzian line [Hz].
    interval : float, optional
        Time from the start of one snapshot to the start of the next [s]; default without a pause.
    """

    linewidth: NotNegative = 50.0
    interval: NotNegative | None = None

    def phase(self, rng: np.random.Generator, snapshots: int, samples: int, sample_rate: float) -> Real:
        """Phase [rad], shape (snapshot, sample), starting from 0."""
        step = np.full((snapshots, samples), 1 / sample_rate)
        step[0, 0] = 0.0
        if self.interval is not None:
            step[1:, 0] = max(self.interval - (samples - 1) / sample_rate, 1 / sample_rate)
        increments = rng.standard_normal((snapshots, samples)) * np.sqrt(2 * np.pi * self.linewidth * step)
        walk: Real = np.cumsum(increments).reshape(snapshots, samples)
        return walk


class CableDrift(Table):
    """Phase and amplitude of a cable that bends as the antenna turns.

    ``phase cos(az - az_0)`` and ``amplitude cos(az - az_1)``, with ``az_0`` and ``az_1`` drawn for each position: the
    lowest harmonic of anything that is periodic in azimuth.

    Parameters
    ----------
    phase : float
        Largest phase [degree].
    amplitude : float
        Largest change of the gain [dB].
    """

    phase: NotNegative = 15.0
    amplitude: NotNegative = 0.15

    def factor(self, rng: np.random.Generator, azimuth: Real) -> Complex:
        """Complex factor at azimuths [degree]."""
        bend = np.cos(np.radians(azimuth) - rng.uniform(0, 2 * np.pi, (2, 1)))
        factor: Complex = 10 ** (self.amplitude * bend[1] / 20) * np.exp(1j * np.radians(self.phase) * bend[0])
        return factor


class DelayDrift(Table):
    """Random walk of the timing from direction to direction.

    It delays the sequence only. The phase of the carrier is that of `CableDrift`.

    Parameters
    ----------
    step : float
        Standard deviation of a step [s].
    """

    step: NotNegative = 1e-12

    def delay(self, rng: np.random.Generator, directions: int) -> Real:
        """Delay [s] at each direction in the order of the scan, 0 at the first."""
        steps = self.step * rng.standard_normal(directions)
        steps[:1] = 0.0
        return np.cumsum(steps)


class IQImbalance(Table):
    """Unequal gain and imperfect quadrature of the two mixers.

    ``y = alpha x + beta conj(x)``, ``alpha = (1 + g exp(-j phi)) / 2``, ``beta = (1 - g exp(j phi)) / 2``: I is kept, Q
    becomes ``g (Q cos(phi) - I sin(phi))``. The level of the image relative to the signal is
    ``10 log10(|beta / alpha|**2)``. Source: Windisch and Fettweis, Proc. IEEE ISCAS 2004.

    Parameters
    ----------
    gain : float
        Gain of Q over that of I [dB].
    phase : float
        Error of quadrature [degree].
    """

    gain: Decibels = 0.1
    phase: Annotated[float, Field(gt=-90, lt=90)] = 1.0

    def apply(self, signal: Complex) -> Complex:
        """Distort complex samples."""
        mismatch = 10 ** (self.gain / 20) * np.exp(1j * np.radians(self.phase))
        distorted: Complex = (1 + np.conj(mismatch)) / 2 * signal + (1 - mismatch) / 2 * np.conj(signal)
        return distorted


class DCOffset(Table):
    """Constant at the converter.

    Parameters
    ----------
    i, q : float
        Fraction of full scale [1].
    """

    i: Annotated[float, Field(gt=-1, lt=1)] = 0.002
    q: Annotated[float, Field(gt=-1, lt=1)] = -0.001


class ThermalNoise(Table):
    """White noise of power ``k T B F`` at the antenna port, with the sample rate ``B``.

    Source: Pozar, Microwave Engineering, 4th ed., section 10.2.

    Parameters
    ----------
    noise_figure : float
        ``10 log10 F`` [dB].
    temperature : float
        [K]
    """

    noise_figure: NotNegativeDecibels = 8.0
    temperature: NotNegative = 290.0

    @property
    def stated_figure(self) -> float | None:
        """Noise figure at 290 K of the same noise [dB]; None if there is less than that of a warm resistor."""
        if not self.temperature:
            return None
        figure = self.noise_figure + 10 * float(np.log10(self.temperature / 290.0))
        return figure if figure >= 0 else None

    def power(self, bandwidth: float) -> float:
        """Noise power [mW] in a bandwidth [Hz]."""
        return float(1e3 * boltzmann * self.temperature * bandwidth * 10 ** (self.noise_figure / 10))


class AGC(Table):
    """Gain control: a receiver gain for each direction, from the received power.

    ``gain = step floor((full_scale - headroom - power) / step)``, limited to 0 and ``maximum``. The gain is relative to
    the setting of the back-to-back recording.

    Parameters
    ----------
    step, maximum : float
        Step and largest value of the gain [dB].
    headroom : float
        Wanted distance of the mean power below full scale [dB].
    """

    step: Annotated[float, Field(gt=0, le=MOST_DECIBELS)] = 1.0
    maximum: NotNegativeDecibels = 50.0
    headroom: Decibels = 12.0

    def gain(self, power: Real, full_scale: float) -> Real:
        """Gain [dB] for received powers [mW] and the converter's full scale [dBm]."""
        wanted = full_scale - self.headroom - 10 * np.log10(np.maximum(power, np.finfo(float).tiny))
        gain: Real = np.clip(self.step * np.floor(wanted / self.step), 0, self.maximum)
        return gain


class Converter(Table):
    """Analogue-to-digital converter: clips at full scale, rounds to steps of ``2 full_scale / 2**bits``.

    Samples are stored left-justified in int16, so that a clipped sample is -32768 or 32767 whatever the bits. The
    converter cannot be switched off; with 16 bits and a full scale above the signal its errors are negligible.

    Parameters
    ----------
    bits : int
        Bits of I and of Q.
    full_scale : float
        Power of a carrier whose I and Q just reach full scale, at receiver gain 0 [dBm].
    """

    bits: Annotated[int, Field(ge=2, le=16)] = 14
    full_scale: Decibels = -42.0

    @property
    def amplitude(self) -> float:
        """Full scale of I and of Q [sqrt(mW)]."""
        return float(10 ** (self.full_scale / 20))

    @property
    def scale_factor(self) -> float:
        """Amplitude of one LSB of int16 [sqrt(mW)]."""
        return self.amplitude / 2**15

    def convert(self, signal: Complex) -> NDArray[np.int16]:
        """Samples (..., iq) of a signal in units of sqrt(mW)."""
        step = 2 ** (16 - self.bits)
        parts = np.stack([signal.real, signal.imag], axis=-1) / (self.scale_factor * step)
        return np.clip(np.rint(parts) * step, -(2**15), 2**15 - 1).astype(np.int16)


class Faults(Table):
    """Faults of an instrument; each is a table of parameters, or None if it is absent (``false`` in TOML).

    Examples
    --------
    >>> Faults(phase_noise=False, thermal_noise={"noise_figure": 6.0}).thermal_noise.noise_figure
    6.0
    """

    system_response: SystemResponse | None = SystemResponse()
    phase_noise: PhaseNoise | None = PhaseNoise()
    cable_drift: CableDrift | None = CableDrift()
    delay_drift: DelayDrift | None = DelayDrift()
    iq_imbalance: IQImbalance | None = IQImbalance()
    dc_offset: DCOffset | None = DCOffset()
    thermal_noise: ThermalNoise | None = ThermalNoise()
    agc: AGC | None = AGC()
    converter: Converter = Converter()

    @model_validator(mode="before")
    @classmethod
    def _switches(cls, tables: Any) -> Any:
        """``false`` for absent, ``true`` for the defaults: TOML has no null."""
        if not isinstance(tables, dict):
            return tables
        switches: dict[Any, Any] = {False: None, True: {}}
        return {key: switches[value] if isinstance(value, bool) else value for key, value in tables.items()}

    @classmethod
    def absent(cls, **present: Any) -> Self:
        """An instrument with the given faults only, and a converter of 16 bits."""
        switches: dict[str, Any] = dict.fromkeys(cls.model_fields, False) | {"converter": Converter(bits=16)}
        return cls(**(switches | present))
