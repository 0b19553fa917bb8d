"""Raw captures of one position and of the back-to-back connection. Captures are read when they are needed."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from erm.common.constants import FARTHEST, SAME_PLACE
from erm.common.errors import DataError
from erm.common.usage import shortened
from sounder.instrument.description import Sounder
from sounder.instrument.periodic import Periodic
from sounder.instrument.waveform_description import Waveform

Captures = NDArray[np.int16] | NDArray[np.complex64]
Kind = Literal["iq", "cir", "ctf"]
"""What captures are: samples of the received signal, impulse responses (correlated already), or transfer functions in
ascending order of frequency."""

CLIPPED_SHARE = 1e-3
"""Share of the numbers at the ends of the converter's range above which captures count as clipped. Chosen; not derived.
"""


@dataclass(frozen=True)
class Recording:
    """Captures of one position.

    :func:`sounder.open_recordings` opens recordings; :func:`sounder.impulse_responses` processes one.

    Attributes
    ----------
    name : str
        Name of the position.
    source : Path
        File that it is read from.
    sounder : Sounder
        The instrument.
    azimuth, elevation : array (azimuth,), (elevation,)
        Pointing directions of the horn: azimuth counter-clockwise from east, elevation above the horizon [degree].
    snapshots : int
        Captures for each direction.
    tx_position, rx_position : array (3,)
        Positions of the antennas, east, north, up [m].
    scale_factor : float
        Amplitude of one LSB at the port of the receive antenna [sqrt(mW)].
    agc_gain : array (azimuth, elevation)
        Receiver gain relative to the back-to-back captures [dB].
    valid : array (azimuth, elevation)
        False where the direction was not recorded.
    los : int
        1 for line of sight, 0 for none, -1 if not known.
    time : array (azimuth, elevation) or None
        Time of the first snapshot [s since 1970-01-01 UTC].
    read : callable
        ``read(azimuth_index, elevation_index, snapshots)`` returns int16 ``(snapshot, sample, iq)`` or complex64
        ``(snapshot, sample)`` for a slice of snapshots.
    kind : {"iq", "cir", "ctf"}
        What the captures are.
    inputs : tuple of Path
        Further files that it is read from.
    tx_azimuth, tx_elevation : array (tx_azimuth,), (tx_elevation,)
        Pointing directions of the transmit antenna [degree]; one of each where it was not turned.
    of_departure : callable or None
        ``of_departure(tx_azimuth_index, tx_elevation_index)`` returns the recording with this beam of the transmit
        antenna. Where there are several, the attributes above of each direction are those of the first.

    Examples
    --------
    >>> import sounder
    >>> from sounder import shipped
    >>> [recording] = sounder.open_recordings(shipped.calibration("recording-132ghz.h5"))
    >>> recording.name, recording.azimuth.size, recording.elevation.size, recording.snapshots
    ('synthetic-two-paths', 9, 3, 2)
    >>> recording.captures(7, 1).shape  # snapshots, samples, I and Q at azimuth 10, elevation 0
    (2, 1022, 2)
    >>> recording.missing
    []
    """

    name: str
    source: Path
    sounder: Sounder = field(repr=False)
    azimuth: NDArray[np.float64] = field(repr=False)
    elevation: NDArray[np.float64] = field(repr=False)
    snapshots: int
    tx_position: NDArray[np.float64]
    rx_position: NDArray[np.float64]
    scale_factor: float
    agc_gain: NDArray[np.float64] = field(repr=False)
    valid: NDArray[np.bool_] = field(repr=False)
    los: int
    time: NDArray[np.float64] | None = field(repr=False)
    read: Callable[[int, int, slice], Captures] = field(repr=False)
    kind: Kind = "iq"
    inputs: tuple[Path, ...] = ()
    tx_azimuth: NDArray[np.float64] = field(default_factory=lambda: np.zeros(1), repr=False)
    tx_elevation: NDArray[np.float64] = field(default_factory=lambda: np.zeros(1), repr=False)
    of_departure: "Callable[[int, int], Recording] | None" = field(default=None, repr=False)

    @property
    def departures(self) -> "list[Recording]":
        """The recording of each beam of the transmit antenna, azimuth-major; itself where there is one."""
        if self.of_departure is None:
            return [self]
        beams = np.ndindex(self.tx_azimuth.size, self.tx_elevation.size)
        return [replace(self.of_departure(a, e), sounder=self.sounder) for a, e in beams]

    def captures(self, azimuth_index: int, elevation_index: int, snapshots: slice = slice(None)) -> Captures:
        """Read the captures of one direction: int16 (snapshot, sample, iq) or complex64 (snapshot, sample)."""
        return self.read(azimuth_index, elevation_index, snapshots)

    @property
    def missing(self) -> list[tuple[float, float]]:
        """Directions of the described scan that were not recorded, as (azimuth, elevation) [degree]."""
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
    """Captures with an attenuator in place of the antennas. They hold the response of the instrument itself.

    :func:`sounder.recordings.native.back_to_back` reads one; :func:`sounder.calibrate` makes the de-embedding filter.

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
        Loss of the attenuator [dB]; used if ``s21`` is None.
    s21 : tuple of arrays (frequency,), (frequency,) or None
        Frequency [Hz] and complex transmission of the attenuator, if it was measured.
    includes_tx_antenna : bool
        True if the level already includes the gain of the transmit antenna, that is, refers to the EIRP.
    title : str
        One line.
    kind : {"iq", "cir", "ctf"}
        What the captures are; the same as in the recordings.
    sequence : Waveform, Periodic or None
        What responses of kind ``cir`` were correlated with, if the sounder is described without it.

    Raises
    ------
    DataError
        ``s21`` is zero or not a number somewhere.

    Examples
    --------
    >>> from sounder import shipped
    >>> from sounder.recordings.native import back_to_back
    >>> b2b = back_to_back(shipped.calibration("back-to-back-132ghz.h5"))
    >>> b2b.sounder.name, round(b2b.attenuation, 2), b2b.captures.shape[1:]
    ('132 GHz rotating-horn sounder', 60.08, (1022, 2))
    """

    source: Path
    sounder: Sounder = field(repr=False)
    captures: Captures = field(repr=False)
    scale_factor: float
    attenuation: float
    s21: tuple[NDArray[np.float64], NDArray[np.complex128]] | None = field(repr=False)
    includes_tx_antenna: bool
    title: str = "Back-to-back captures"
    kind: Kind = "iq"
    sequence: Waveform | Periodic | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        if 0 in self.captures.shape:
            raise DataError(f"{self.source}: the back-to-back holds no samples; record it again")
        if self.s21 is None:
            return
        frequency, s21 = self.s21
        bad = ~np.isfinite(s21) | (s21 == 0)
        if bad.any():
            raise DataError(
                f"{self.source}: S21 of the attenuator is zero or not a number at {bad.sum()} of {bad.size} "
                f"frequencies, first at {frequency[bad][0] / 1e9:.3f} GHz; expected finite numbers other than 0; "
                "measure the attenuator again"
            )


class PositionError(DataError):
    """What is wrong with one position of a file."""

    def __init__(self, problem: str, name: str = "") -> None:
        super().__init__(problem)
        self.name = name


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
    return float(np.mean((captures == -(2**15)) | (captures == 2**15 - 1)))


def line_of_sight(value: Any, who: Path | str, label: str = "los") -> int:
    """1 for line of sight, 0 for none, -1 if not known; anything else is refused."""
    if value not in (-1, 0, 1):
        raise DataError(f"{who}: {label} is {shortened(value)}; expected 1 (line of sight), 0 (none) or -1 (not known)")
    return int(value)


MAX_AGC_GAIN = 200.0
"""Largest gain of a receiver [dB]: it would make half a watt of the thermal noise of 1 Hz (-174 dBm)."""


def check(recording: Recording, samples: int) -> None:
    """Raise an error for a recording that cannot be processed.

    Parameters
    ----------
    recording : Recording
    samples : int
        Samples in each capture of the file.

    Raises
    ------
    DataError
        The number of samples is not the described one, a position is not finite, TX and RX coincide, or there is no
        capture.
    """
    who = f"{recording.source}: {recording.name}" if recording.name else str(recording.source)
    waveform = recording.sounder.waveform
    if samples > waveform.samples and samples % waveform.samples == 0:
        raise DataError(
            f"{recording.source}: {samples} samples per capture are {samples // waveform.samples} periods of the "
            f"{waveform.samples} that {recording.sounder.name} describes ({waveform.summary}); split each capture into "
            "its periods, as snapshots, or pass another description with --sounder"
        )
    if samples != waveform.samples:
        raise DataError(
            f"{recording.source}: {samples} samples per capture, but {recording.sounder.name} describes "
            f"{waveform.samples} ({waveform.summary}); "
            "pass its description with --sounder or export the recording again"
        )
    if recording.snapshots < 1:
        raise DataError(f"{who}: no snapshot; expected at least one for each direction")
    for label, position in (("tx_position", recording.tx_position), ("rx_position", recording.rx_position)):
        if not (np.abs(position) < FARTHEST).all():
            raise DataError(
                f"{who}: {label} is {position.tolist()}; expected three finite numbers [m] of a place on earth"
            )
    if (np.abs(recording.elevation) > 90).any():
        raise DataError(f"{who}: elevation is {recording.elevation.tolist()}; expected -90 to 90 degrees")
    gain = np.abs(recording.agc_gain[recording.valid])
    if not (gain <= MAX_AGC_GAIN).all():
        raise DataError(f"{who}: agc_gain is {gain.max():g} dB; expected at most {MAX_AGC_GAIN:g} dB in each direction")
    if np.linalg.norm(recording.tx_position - recording.rx_position) < SAME_PLACE:
        raise DataError(
            f"{who}: tx_position equals rx_position {recording.rx_position.tolist()}; expected two different positions"
        )
