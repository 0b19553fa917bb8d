"""The instrument's twin: propagation paths in, raw captures out, as the receiver would have stored them."""

import zlib
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sounder.instrument.antenna_pattern import Pattern
from sounder.instrument.description import Clock, Sounder
from sounder.instrument.touchstone import transmission
from sounder.instrument.waveform import band_limited_template
from sounder.recordings.recording import BackToBack, Captures, Recording
from sounder.twin.faults import Complex, Faults, Real

if TYPE_CHECKING:
    import xarray as xr

DWELL = 1.0
"""Time the scan spends on a direction [s]."""


def transfer_functions(paths: "xr.Dataset", sounder: Sounder, azimuth: Real, elevation: Real) -> Complex:
    """Channel between the antennas' ports for each direction the horn looks at.

    ``H(f) = sum_p a_p g_tx g_rx(p) exp(-2j pi f tau_p)``, with ``a_p`` the coefficient between isotropic
    antennas (it holds the carrier's phase), ``g`` the amplitude gains and ``f`` from the carrier. On the grid
    of ``N`` samples at the sample rate a delay beyond the period wraps, as it does for the periodic sequence.
    The transmit antenna has its boresight gain toward every path: which way it looks is not part of the
    description.

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
    toward = horn.beam_gain(
        paths["azimuth"].values,
        paths["elevation"].values,
        np.asarray(azimuth)[:, None, None],
        np.asarray(elevation)[None, :, None],
    )
    gain = toward + horn.gain + sounder.tx_antenna.gain
    delayed = np.exp(-2j * np.pi * np.multiply.outer(paths["delay"].values, _frequency(sounder)))
    transfer: Complex = (10 ** (gain / 20) * paths["coefficient"].values) @ delayed
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
    start: float | None = None,
) -> Recording:
    """Recording of one position that the sounder would make of these paths.

    Captures are made when they are read, one direction at a time; seed, name and direction alone decide them.
    The horn turns through the azimuths at each elevation in turn.

    Parameters
    ----------
    paths : xarray.Dataset
        As for :func:`transfer_functions`; length 0 is legal and gives noise.
    sounder : Sounder
    name : str
        Of the position.
    tx_position, rx_position : array (3,)
        East, north, up [m].
    snapshots : int
        Captures a direction.
    los : int
        1, 0 or -1, stored as it is.
    faults : Faults, optional
        The default ones if None.
    seed : int
    start : float, optional
        Time of the first capture [s since 1970-01-01 UTC].

    Returns
    -------
    Recording
    """
    faults = Faults() if faults is None else faults
    place = (seed, zlib.crc32(name.encode()))
    azimuth, elevation = np.asarray(sounder.scan.azimuth), np.asarray(sounder.scan.elevation)
    spectra = transfer_functions(paths, sounder, azimuth, elevation) * _sent(sounder, faults)
    _drift(spectra, sounder, azimuth, faults, place)
    received = np.mean(np.abs(spectra) ** 2, axis=-1) / sounder.waveform.samples  # Parseval
    gain = np.zeros(received.shape)
    if faults.agc:
        noise = faults.thermal_noise.power(sounder.waveform.sample_rate) if faults.thermal_noise else 0.0
        gain = faults.agc.gain(received + noise, faults.converter.full_scale)

    def read(a: int, e: int, which: slice) -> Captures:
        rng = np.random.default_rng((*place, 1, a, e))
        captures: Captures = _receive(spectra[a, e], float(gain[a, e]), snapshots, sounder, faults, rng)[which]
        return captures

    order: Real = np.arange(received.size, dtype=float).reshape(received.T.shape).T
    return Recording(
        name=name,
        source=Path(f"twin of {sounder.name}"),
        sounder=sounder.model_copy(
            update={"clock": Clock(step=faults.delay_drift.step if faults.delay_drift else 0.0)}
        ),
        azimuth=azimuth,
        elevation=elevation,
        snapshots=snapshots,
        tx_position=np.asarray(tx_position, float),
        rx_position=np.asarray(rx_position, float),
        scale_factor=faults.converter.scale_factor,
        agc_gain=gain,
        valid=np.ones(received.shape, bool),
        los=los,
        time=None if start is None else start + DWELL * order,
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
    """Back-to-back recording: transmitter and receiver joined by an attenuator, without antennas.

    ``B(f) = sqrt(P_tx) S(f) R(f) S21(f)``; the receiver gain is the reference setting and nothing turns, so
    there is neither AGC nor drift.

    Parameters
    ----------
    sounder : Sounder
    attenuator : tuple of arrays (frequency,), (frequency,) or float
        Frequency [Hz] and S21 of the attenuator, or its loss [dB] when nothing else is known.
    snapshots : int
    faults : Faults, optional
        The default ones if None.
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
        captures=_receive(_sent(sounder, faults) * through, 0.0, snapshots, sounder, faults, rng),
        scale_factor=faults.converter.scale_factor,
        attenuation=loss,
        s21=s21,
        includes_tx_antenna=False,
    )


def _frequency(sounder: Sounder) -> Real:
    """Baseband frequencies of a capture's FFT [Hz]."""
    waveform = sounder.waveform
    return np.asarray(np.fft.fftfreq(waveform.samples, 1 / waveform.sample_rate), np.float64)


def _sent(sounder: Sounder, faults: Faults) -> Complex:
    """Spectrum at the receiver if the channel were a wire: power, sequence, system response [sqrt(mW)]."""
    sent: Complex = 10 ** (sounder.transmitter.power / 20) * np.fft.fft(band_limited_template(sounder.waveform))
    return sent * faults.system_response.response(_frequency(sounder)) if faults.system_response else sent


def _drift(spectra: Complex, sounder: Sounder, azimuth: Real, faults: Faults, place: tuple[int, int]) -> None:
    """Apply what changes from direction to direction to spectra (azimuth, elevation, sample), in place."""
    if faults.cable_drift:
        spectra *= faults.cable_drift.factor(np.random.default_rng((*place, 2)), azimuth)[:, None, None]
    if faults.delay_drift:
        late = faults.delay_drift.delay(np.random.default_rng((*place, 3)), spectra.shape[0] * spectra.shape[1])
        in_scan_order = late.reshape(spectra.shape[1], spectra.shape[0]).T
        spectra *= np.exp(-2j * np.pi * np.multiply.outer(in_scan_order, _frequency(sounder)))


def _receive(
    spectrum: Complex, gain: float, snapshots: int, sounder: Sounder, faults: Faults, rng: np.random.Generator
) -> NDArray[np.int16]:
    """Captures int16 (snapshot, sample, iq) of one direction.

    In the order of the hardware: local oscillator, noise, receiver gain [dB], quadrature mixer, offset,
    converter.
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
