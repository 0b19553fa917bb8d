"""A sounder and its channel in float64 and FFTs: what the processing must undo, without the twin's converter."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from numpy.typing import NDArray

from sounder import shipped
from sounder.cir.deembedding import Deembedding, make_deembedding
from sounder.instrument.antenna_pattern import Pattern
from sounder.instrument.description import Sounder, load_sounder
from sounder.instrument.waveform import band_limited_template, held_template
from sounder.recordings.recording import BackToBack

Path4 = tuple[float, float, float, float]  # path gain [dB], delay [s], azimuth, elevation [degree]


@dataclass(frozen=True)
class Bench:
    """Ideal bench: a sounder whose system response is ``system`` and whose attenuator is perfect."""

    sounder: Sounder
    system: NDArray[np.complex128]
    filter_: Deembedding

    @property
    def frequency(self) -> NDArray[np.float64]:
        return np.fft.fftfreq(self.system.size, 1 / self.sounder.waveform.sample_rate)

    @property
    def sent(self) -> NDArray[np.complex128]:
        """Spectrum that a wire in the channel's place would bring to the receiver."""
        return np.fft.fft(band_limited_template(self.sounder.waveform)) * self.system

    def correlate(self, captures: NDArray[np.complex128]) -> NDArray[np.complex128]:
        template = np.fft.fft(held_template(self.sounder.waveform))
        return np.fft.ifft(np.fft.fft(captures) * np.conj(template))

    def cir(self, channel: NDArray[np.complex128], offset: complex = 0.0) -> NDArray[np.complex128]:
        """De-embedded response of transfer functions (..., sample) between the antennas' ports."""
        tx = 10 ** (self.sounder.tx_antenna.gain / 20)
        return self.filter_.apply(self.correlate(np.fft.ifft(channel * tx * self.sent) + offset))

    def noise(self, rng: np.random.Generator, directions: int) -> NDArray[np.complex128]:
        """CIRs of white receiver noise, scaled to mean power 1."""
        white = rng.standard_normal((directions, self.system.size, 2)) @ [1, 1j] / np.sqrt(2)
        template = np.fft.fft(held_template(self.sounder.waveform))
        gain = np.sum(np.abs(template * self.filter_.transfer) ** 2) / self.system.size
        return self.filter_.apply(self.correlate(white)) / np.sqrt(gain)

    def scan(
        self, paths: Sequence[Path4], *, noise: float | None = None, seed: int = 0, same_phase: bool = False
    ) -> xr.Dataset:
        """CIRs of all directions of the scan.

        Every beam sees every path with a phase of its own, as a horn whose cable bends does. ``noise`` is the mean
        noise power of a CIR [dB].
        """
        rng = np.random.default_rng(seed)
        azimuth, elevation = (np.asarray(angles) for angles in (self.sounder.scan.azimuth, self.sounder.scan.elevation))
        horn = Pattern.of(self.sounder.rx_antenna)
        spectra = np.zeros((azimuth.size, elevation.size, self.system.size), complex)
        for gain, delay, path_azimuth, path_elevation in paths:
            toward = horn.beam_gain(path_azimuth, path_elevation, azimuth[:, None], elevation[None, :])
            phase = np.zeros(toward.shape) if same_phase else rng.uniform(0, 2 * np.pi, toward.shape)
            amplitude = 10 ** ((gain + horn.gain + toward) / 20) * np.exp(1j * phase)
            spectra += amplitude[..., None] * np.exp(-2j * np.pi * self.frequency * delay)
        cir = self.cir(spectra)
        if noise is not None:
            cir += self.noise(rng, azimuth.size * elevation.size).reshape(cir.shape) * 10 ** (noise / 20)
        return self.dataset(cir.astype(np.complex64))

    def dataset(self, cir: NDArray[Any]) -> xr.Dataset:
        scan, waveform = self.sounder.scan, self.sounder.waveform
        return xr.Dataset(
            {"cir": (("azimuth", "elevation", "delay"), cir)},
            coords={
                "azimuth": np.asarray(scan.azimuth),
                "elevation": np.asarray(scan.elevation),
                "delay": np.arange(waveform.samples) / waveform.sample_rate,
            },
        )


def ripple(frequency: NDArray[np.float64], seed: int, strength: float = 1.0) -> NDArray[np.complex128]:
    """Random system response that can be inverted: three echoes, together under 0.6, a delay and a tilt."""
    rng = np.random.default_rng(seed)
    levels = 0.2 * strength * rng.random(3) * np.exp(2j * np.pi * rng.random(3))
    echoes = np.exp(-2j * np.pi * np.multiply.outer(frequency, rng.uniform(0, 20e-9, 3))) @ levels
    tilt = 10 ** (strength * rng.uniform(-3, 3) * frequency / 20e9)
    return (1 + echoes) * tilt * np.exp(-2j * np.pi * frequency * rng.uniform(0, 60e-9))


def describe(**tables: dict[str, Any]) -> Sounder:
    """The shipped description with keys of its tables replaced."""
    described = load_sounder(shipped.calibration("sounder-132ghz.toml")).model_dump()
    for name, table in tables.items():
        described[name] = {**described[name], **table}
    return Sounder.from_tables(described, "test")


def make_back_to_back(sounder: Sounder, spectrum: NDArray[np.complex128], **changes: Any) -> BackToBack:
    """Back-to-back of one capture with the given spectrum, as if the attenuator were 0 dB unless told."""
    made = BackToBack(
        source=Path("b2b.h5"),
        sounder=sounder,
        captures=np.fft.ifft(spectrum)[None].astype(np.complex64),
        scale_factor=1.0,
        attenuation=0.0,
        s21=None,
        includes_tx_antenna=False,
    )
    return replace(made, **changes)


def make_bench(
    sounder: Sounder | None = None,
    seed: int | None = None,
    offset: complex = 0.0,
    spectrum: NDArray[np.complex128] | float = 1.0,
    **through: Any,
) -> Bench:
    """Bench of a sounder (default: the shipped one), its system response drawn from ``seed`` (None: ideal).

    ``offset`` is the receiver's DC offset in the back-to-back capture, ``spectrum`` the true transmission of the
    attenuator in it, and ``through`` what is said about it.
    """
    sounder = sounder or describe()
    waveform = sounder.waveform
    frequency = np.fft.fftfreq(waveform.samples, 1 / waveform.sample_rate)
    system = np.ones(waveform.samples, complex) if seed is None else ripple(frequency, seed)
    sent = np.fft.fft(band_limited_template(waveform)) * system
    captured = np.fft.fft(np.fft.ifft(sent * spectrum) + offset)
    correlated = np.fft.ifft(captured * np.conj(np.fft.fft(held_template(waveform))))
    b2b = make_back_to_back(sounder, captured, **through)
    return Bench(sounder, system, make_deembedding(b2b, correlated, sounder, 1.0))


@pytest.fixture(scope="session")
def bench() -> Bench:
    return make_bench()


@pytest.fixture(scope="session")
def bench_maker() -> Callable[..., Bench]:
    return make_bench


@pytest.fixture(scope="session")
def description() -> Callable[..., Sounder]:
    return describe


@pytest.fixture(scope="session")
def back_to_back_maker() -> Callable[..., BackToBack]:
    return make_back_to_back
