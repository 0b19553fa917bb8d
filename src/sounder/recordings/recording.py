"""Raw captures of one position, and of the back-to-back connection; nothing is read until it is asked for."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from erm.common.errors import DataError
from sounder.instrument.description import Sounder

Captures = NDArray[np.int16] | NDArray[np.complex64]

CLIPPED_SHARE = 1e-3
"""Share of the numbers at the ends of the converter's range above which captures count as clipped. Chosen; not derived.
"""


@dataclass(frozen=True)
class Recording:
    """Captures of one position.

    Attributes
    ----------
    name : str
        Name of the position.
    source : Path
        File it is read from; inputs are never written to.
    sounder : Sounder
        The instrument.
    azimuth, elevation : array (azimuth,), (elevation,)
        Directions the horn looked at [degree].
    snapshots : int
        Captures a direction.
    tx_position, rx_position : array (3,)
        East, north, up [m].
    scale_factor : float
        Amplitude of one LSB [sqrt(mW) at the receive antenna's port].
    agc_gain : array (azimuth, elevation)
        Receiver gain over its setting in the back-to-back capture [dB].
    valid : array (azimuth, elevation)
        False where the direction was not recorded.
    los : int
        1 line of sight, 0 none, -1 not known.
    time : array (azimuth, elevation) or None
        Time of the first snapshot [s since 1970-01-01 UTC].
    read : callable
        ``read(azimuth_index, elevation_index, snapshots)`` returns int16 ``(snapshot, sample, iq)`` or complex64
        ``(snapshot, sample)`` for a slice of snapshots.
    """

    name: str
    source: Path
    sounder: Sounder
    azimuth: NDArray[np.float64]
    elevation: NDArray[np.float64]
    snapshots: int
    tx_position: NDArray[np.float64]
    rx_position: NDArray[np.float64]
    scale_factor: float
    agc_gain: NDArray[np.float64]
    valid: NDArray[np.bool_]
    los: int
    time: NDArray[np.float64] | None
    read: Callable[[int, int, slice], Captures] = field(repr=False)

    def captures(self, azimuth_index: int, elevation_index: int, snapshots: slice = slice(None)) -> Captures:
        """Read captures of one direction: int16 (snapshot, sample, iq) or complex64 (snapshot, sample)."""
        return self.read(azimuth_index, elevation_index, snapshots)

    @property
    def missing(self) -> list[tuple[float, float]]:
        """Directions of the description's scan that were not recorded, as (azimuth, elevation) [degree]."""
        have = {
            (round(float(a) % 360, 6), round(float(e), 6))
            for i, a in enumerate(self.azimuth)
            for j, e in enumerate(self.elevation)
            if self.valid[i, j]
        }
        scan = self.sounder.scan
        wanted = [(a % 360, e) for e in scan.elevation for a in scan.azimuth]
        return [(a, e) for a, e in wanted if (round(a, 6), round(e, 6)) not in have]


@dataclass(frozen=True)
class BackToBack:
    """Captures with the antennas replaced by an attenuator; they hold the instrument's own response.

    Attributes
    ----------
    source : Path
        File it is read from.
    sounder : Sounder
        The instrument.
    captures : array int16 (snapshot, sample, iq) or complex64 (snapshot, sample)
    scale_factor : float
        Amplitude of one LSB [sqrt(mW)].
    attenuation : float
        Loss of the attenuator [dB]; used where ``s21`` is None.
    s21 : tuple of arrays (frequency,), (frequency,) or None
        Frequency [Hz] and complex transmission of the attenuator, where it was measured.
    includes_tx_antenna : bool
        True if the level already counts the transmit antenna's gain (referred to the EIRP).
    title : str
        What it is, one line.
    """

    source: Path
    sounder: Sounder
    captures: Captures
    scale_factor: float
    attenuation: float
    s21: tuple[NDArray[np.float64], NDArray[np.complex128]] | None
    includes_tx_antenna: bool
    title: str = "Back-to-back captures"


def clipped_share(captures: Captures) -> float:
    """Share of the numbers of int16 captures at the ends of the converter's range; 0 for complex captures.

    Examples
    --------
    >>> import numpy as np
    >>> clipped_share(np.array([[[0, 32767], [-32768, 5]]], np.int16))
    0.5
    """
    if captures.dtype != np.int16:
        return 0.0
    return np.count_nonzero((captures == -(2**15)) | (captures == 2**15 - 1)) / captures.size


def check(recording: Recording, samples: int) -> None:
    """Refuse a recording that cannot be processed.

    Parameters
    ----------
    recording : Recording
    samples : int
        Samples a capture found in the file.

    Raises
    ------
    DataError
        The sample count is not the description's, a position is not finite, TX and RX coincide, or there is no capture.
    """
    who = f"{recording.source}: {recording.name}" if recording.name else str(recording.source)
    waveform = recording.sounder.waveform
    if samples != waveform.samples:
        raise DataError(
            f"{recording.source}: {samples} samples a capture, but {recording.sounder.name} describes "
            f"{waveform.samples} (order {waveform.order}, {waveform.samples_per_chip} samples a chip); "
            "pass --sounder or re-export the recording"
        )
    if recording.snapshots < 1:
        raise DataError(f"{who}: no snapshot; expected at least one capture a direction")
    for label, position in (("tx_position", recording.tx_position), ("rx_position", recording.rx_position)):
        if not np.isfinite(position).all():
            raise DataError(f"{who}: {label} is {position.tolist()}; expected three finite metres")
    if np.allclose(recording.tx_position, recording.rx_position):
        raise DataError(f"{who}: tx_position equals rx_position {recording.rx_position.tolist()}; expected two places")
