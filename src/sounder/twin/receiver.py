"""The twin of the receiver: from propagation paths to raw captures as the instrument would store them."""

import zlib
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from erm.common.errors import DataError
from sounder.instrument.antenna_pattern import Pattern
from sounder.instrument.description import Sounder
from sounder.instrument.stated import Receiver
from sounder.instrument.touchstone import transmission
from sounder.instrument.waveform import band_limited_template
from sounder.recordings.recording import BackToBack, Captures, Recording
from sounder.twin.faults import Complex, Faults, Real

if TYPE_CHECKING:
    import xarray as xr


def transfer_functions(paths: "xr.Dataset", sounder: Sounder, azimuth: Real, elevation: Real) -> Complex:
    """Channel between the ports of the antennas, for each direction of the horn.

    ``H(f) = sum_p a_p g_tx g_rx(p) exp(-2j pi f tau_p)``, with the coefficient ``a_p`` between isotropic antennas
    (including the phase of the carrier), the amplitude gains ``g``, and the frequency ``f`` relative to the carrier. A
    delay beyond the period wraps, as it does with the periodic sequence. The transmit antenna has its boresight gain
    toward every path, because the description does not say where it is pointed.

    Parameters
    ----------
    paths : xarray.Dataset
        Dimension ``path``: ``coefficient``, ``delay`` [s], ``azimuth``, ``elevation`` [degree].
    sounder : Sounder
    azimuth, elevation : array (azimuth,), (elevation,)
        Directions of the scan [degree].

    Returns
    -------
    array complex (azimuth, elevation, sample)
        In the order of ``numpy.fft.fftfreq``.
    """
    horn = Pattern.of(sounder.rx_antenna)
    relative_gain = horn.beam_gain(
        paths["azimuth"].values,
        paths["elevation"].values,
        np.asarray(azimuth)[:, None, None],
        np.asarray(elevation)[None, :, None],
    )
    gain = relative_gain + horn.gain + sounder.tx_antenna.gain
    phase_factor = np.exp(-2j * np.pi * np.multiply.outer(paths["delay"].values, _frequency(sounder)))
    transfer: Complex = (10 ** (gain / 20) * paths["coefficient"].values) @ phase_factor
    return transfer


def record(
    paths: "xr.Dataset",
    sounder: Sounder,
    *,
    name: str,
    tx_position: ArrayLike,
    rx_position: ArrayLike,
    snapshots: int,
    los: int = -1,
    faults: Faults | None = None,
    seed: int = 0,
) -> Recording:
    """Record one position with given propagation paths.

    The captures of a direction are computed when they are read. They depend on seed, name and direction only. The scan
    covers all azimuths at one elevation before it moves to the next.

    Parameters
    ----------
    paths : xarray.Dataset
        As for :func:`transfer_functions`; without paths the recording holds noise.
    sounder : Sounder
    name : str
        Name of the position.
    tx_position, rx_position : array (3,)
        East, north, up [m].
    snapshots : int
        Captures a direction.
    los : int
        1 line of sight, 0 none, -1 not known; stored in the recording.
    faults : Faults, optional
        Default: those of an ordinary instrument.
    seed : int

    Returns
    -------
    Recording

    Examples
    --------
    >>> import xarray as xr
    >>> from sounder import load_sounder, shipped
    >>> path = {"coefficient": 1e-5, "delay": 100e-9, "azimuth": 10.0, "elevation": 0.0}
    >>> paths = xr.Dataset({key: ("path", [value]) for key, value in path.items()})
    >>> description = load_sounder(shipped.calibration("sounder-132ghz.toml"))
    >>> ends = {"tx_position": (30, 0, 2), "rx_position": (0, 0, 2)}
    >>> recording = record(paths, description, name="RX1", snapshots=2, **ends)
    >>> recording.captures(1, 1).shape  # snapshots, samples, I and Q at azimuth 10, elevation 0
    (2, 1022, 2)
    """
    faults = Faults() if faults is None else faults
    seeds = (seed, zlib.crc32(name.encode()))
    azimuth, elevation = np.asarray(sounder.scan.azimuth), np.asarray(sounder.scan.elevation)
    spectra = transfer_functions(paths, sounder, azimuth, elevation) * _sent_spectrum(sounder, faults)
    _apply_drifts(spectra, sounder, azimuth, faults, seeds)
    received = np.mean(np.abs(spectra) ** 2, axis=-1) / sounder.waveform.samples  # Parseval
    gain = np.zeros(received.shape)
    if faults.agc:
        noise = faults.thermal_noise.power(sounder.waveform.sample_rate) if faults.thermal_noise else 0.0
        gain = faults.agc.gain(received + noise, faults.converter.full_scale)

    def read(a: int, e: int, which: slice) -> Captures:
        rng = np.random.default_rng((*seeds, 1, a, e))
        captures = _received_captures(spectra[a, e], float(gain[a, e]), snapshots, sounder, faults, rng)
        return captures[which]

    return Recording(
        name=name,
        source=Path(f"twin of {sounder.name}"),
        sounder=_as_it_is(sounder, faults),
        azimuth=azimuth,
        elevation=elevation,
        snapshots=snapshots,
        tx_position=np.asarray(tx_position, float),
        rx_position=np.asarray(rx_position, float),
        scale_factor=faults.converter.scale_factor,
        agc_gain=gain,
        valid=np.ones(received.shape, bool),
        los=los,
        time=None,
        read=read,
    )


def back_to_back(
    sounder: Sounder,
    attenuator: tuple[Real, Complex] | float,
    *,
    snapshots: int = 32,
    faults: Faults | None = None,
    seed: int = 0,
) -> BackToBack:
    """Record the transmitter through an attenuator, without antennas.

    ``B(f) = sqrt(P_tx) S(f) R(f) S21(f)``. The receiver gain is the reference setting and the antenna does not turn, so
    there is neither AGC nor drift.

    Parameters
    ----------
    sounder : Sounder
    attenuator : tuple of arrays (frequency,), (frequency,) or float
        Frequency [Hz] and S21 of the attenuator, or its loss [dB].
    snapshots : int
    faults : Faults, optional
        Default: those of an ordinary instrument.
    seed : int

    Returns
    -------
    BackToBack
    """
    faults = Faults() if faults is None else faults
    s21 = None if isinstance(attenuator, (int, float)) else attenuator
    through: Complex | float
    if isinstance(attenuator, (int, float)):
        loss = float(attenuator)
        through = 10 ** (-loss / 20)
    else:
        carrier = sounder.carrier.frequency
        through = transmission(*attenuator, _frequency(sounder) + carrier)
        loss = -20 * float(np.log10(np.abs(transmission(*attenuator, np.array([carrier]))[0])))
    rng = np.random.default_rng((seed, 2))
    return BackToBack(
        source=Path(f"twin of {sounder.name}"),
        sounder=sounder,
        captures=_received_captures(_sent_spectrum(sounder, faults) * through, 0.0, snapshots, sounder, faults, rng),
        scale_factor=faults.converter.scale_factor,
        attenuation=loss,
        s21=s21,
        includes_tx_antenna=False,
    )


def _frequency(sounder: Sounder) -> Real:
    """Baseband frequencies of a capture's FFT [Hz]."""
    waveform = sounder.waveform
    return np.asarray(np.fft.fftfreq(waveform.samples, 1 / waveform.sample_rate), np.float64)


def _sent_spectrum(sounder: Sounder, faults: Faults) -> Complex:
    """Spectrum at the receiver through a channel of gain 1: power, sequence and system response [sqrt(mW)]."""
    if sounder.transmitter.power is None:
        raise DataError(f"{sounder.name}: transmitter.power is missing; expected the power to simulate [dBm]")
    sent: Complex = 10 ** (sounder.transmitter.power / 20) * np.fft.fft(band_limited_template(sounder.sequence))
    return sent * faults.system_response.response(_frequency(sounder)) if faults.system_response else sent


def _as_it_is(sounder: Sounder, faults: Faults) -> Sounder:
    """Description of a sounder that states clock and noise of the twin."""
    noise, step = faults.thermal_noise, faults.delay_drift.step if faults.delay_drift else 0.0
    figure = noise.stated_figure if noise else None
    return sounder.model_copy(
        update={"clock": sounder.clock.model_copy(update={"step": step}), "receiver": Receiver(noise_figure=figure)}
    )


def _apply_drifts(spectra: Complex, sounder: Sounder, azimuth: Real, faults: Faults, seeds: tuple[int, int]) -> None:
    """Apply the drifts from direction to direction to spectra (azimuth, elevation, sample), in place."""
    if faults.cable_drift:
        spectra *= faults.cable_drift.factor(np.random.default_rng((*seeds, 2)), azimuth)[:, None, None]
    if faults.delay_drift:
        delay = faults.delay_drift.delay(np.random.default_rng((*seeds, 3)), spectra.shape[0] * spectra.shape[1])
        delay = delay.reshape(spectra.shape[1], spectra.shape[0]).T
        spectra *= np.exp(-2j * np.pi * np.multiply.outer(delay, _frequency(sounder)))


def _received_captures(
    spectrum: Complex, gain: float, snapshots: int, sounder: Sounder, faults: Faults, rng: np.random.Generator
) -> NDArray[np.int16]:
    """Captures int16 (snapshot, sample, iq) of one direction.

    In the order of the hardware: local oscillator, noise, receiver gain [dB], quadrature mixer, offset, converter.
    """
    waveform = sounder.waveform
    shape = (snapshots, waveform.samples)
    signal = np.repeat(np.fft.ifft(spectrum)[None], snapshots, axis=0)
    if faults.phase_noise:
        signal *= np.exp(1j * faults.phase_noise.phase(rng, *shape, waveform.sample_rate))
    if faults.thermal_noise:
        deviation = np.sqrt(faults.thermal_noise.power(waveform.sample_rate) / 2)
        signal += deviation * rng.standard_normal((*shape, 2)).view(complex)[..., 0]
    signal *= 10 ** (gain / 20)
    if faults.iq_imbalance:
        signal = faults.iq_imbalance.apply(signal)
    if faults.dc_offset:
        signal += faults.converter.amplitude * complex(faults.dc_offset.i, faults.dc_offset.q)
    return faults.converter.convert(signal)
