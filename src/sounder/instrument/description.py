"""The sounder description: properties of the instrument, read from a TOML file and validated. It cannot be changed."""

from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Discriminator, Field, Tag, model_validator

from erm.common.errors import DataError
from sounder.instrument.antenna_description import Antenna
from sounder.instrument.antenna_files import read_cut
from sounder.instrument.periodic import Periodic, with_template
from sounder.instrument.stated import Connection, Receiver, Survey, Transmitter
from sounder.instrument.waveform_description import Sweep, Waveform
from sounder.toml import MOST_DECIBELS, NotNegative, Positive, Table, file_inside, read_toml

MIN_SPECTRAL_LINES = 16
"""Fewest spectral lines in the band kept. A delay is the slope of the phase over them. Chosen, not derived."""


def _kind(value: Any) -> str:
    if isinstance(value, Sweep) or (isinstance(value, dict) and "points" in value):
        return "<sweep>"
    return (
        "<periodic>" if isinstance(value, Periodic) or (isinstance(value, dict) and "kind" in value) else "<m-sequence>"
    )


AnyWaveform = Annotated[
    Annotated[Waveform, Tag("<m-sequence>")]
    | Annotated[Sweep, Tag("<sweep>")]
    | Annotated[Periodic, Tag("<periodic>")],
    Discriminator(_kind),
]
"""A sweep if it has points, another waveform if it has a kind, else an m-sequence."""


class Carrier(Table):
    """The carrier. Where the local oscillator is known, ``frequency = lo_frequency * multiplier + if_frequency``.

    Attributes
    ----------
    frequency : float
        Carrier frequency at the antennas [Hz].
    if_frequency : float
        Intermediate frequency [Hz].
    lo_frequency : float, optional
        Frequency of the local oscillator before its multiplier [Hz].
    multiplier : int
        Factor of the frequency multiplier.
    """

    frequency: Positive
    if_frequency: NotNegative = 0.0
    lo_frequency: Positive | None = None
    multiplier: Annotated[int, Field(ge=1)] = 1

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.lo_frequency is None:
            return self
        made = self.lo_frequency * self.multiplier + self.if_frequency
        if abs(made / self.frequency - 1) > 1e-9:
            raise ValueError(
                f"frequency is {self.frequency / 1e9:g} GHz, but lo_frequency x multiplier + if_frequency is "
                f"{self.lo_frequency / 1e9:g} x {self.multiplier} + {self.if_frequency / 1e9:g} = {made / 1e9:g} GHz"
            )
        return self


class Scan(Table):
    """Directions the horn is pointed at; every azimuth is combined with every elevation.

    Attributes
    ----------
    azimuth : tuple of float
        Ascending, within one turn [degree, counter-clockwise from east].
    elevation : tuple of float
        Ascending [degree above the horizon].
    """

    azimuth: tuple[float, ...]
    elevation: tuple[float, ...]

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        for name, values in (("azimuth", self.azimuth), ("elevation", self.elevation)):
            if not values or any(b <= a for a, b in pairwise(values)):
                raise ValueError(f"{name} must have one or more values in ascending order")
        if self.azimuth[-1] - self.azimuth[0] >= 360:
            raise ValueError("azimuth spans 360 degree or more; list each direction once")
        if min(self.elevation) < -90 or max(self.elevation) > 90:
            raise ValueError("elevation must lie within -90 to 90 degree")
        return self


class Clock(Table):
    """Drift of the clock since the back-to-back recording.

    Attributes
    ----------
    step : float
        Standard deviation of the clock's random walk from one direction of the scan to the next [s].
    start : {"common", "arbitrary"}
        Whether transmitter and receiver share the beginning of captures, as in the back-to-back recording, or each
        position begins at a time of its own.
    """

    step: NotNegative = 0.0
    start: Literal["common", "arbitrary"] = "common"


class Artefact(Table):
    """A copy of every path that the instrument makes.

    Attributes
    ----------
    delay : float
        Delay of the copy after its path [s]; negative for a copy that comes earlier.
    level : float
        Highest level of the copy relative to its path in the same beam [dB].
    """

    delay: float
    level: Annotated[float, Field(ge=-MOST_DECIBELS, lt=0)]

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.delay == 0:
            raise ValueError("delay is 0; expected the delay of the copy after its path [s]")
        return self


class Processing(Table):
    """What the processing needs to know about the instrument.

    Attributes
    ----------
    bandwidth : float, optional
        Bandwidth kept by the de-embedding, full width about the carrier [Hz]; see `Sounder.bandwidth` for the default.
    artefact : tuple of Artefact
        Copies of paths that are not reported as paths.
    """

    bandwidth: Positive | None = None
    artefact: tuple[Artefact, ...] = ()


class Sounder(Table):
    """Description of a channel sounder.

    :func:`load_sounder` reads it from a TOML file. Its attributes are the tables of that file; it cannot be changed.

    Attributes
    ----------
    name : str
        Shown in messages.
    waveform : Waveform, Periodic or Sweep
    carrier : Carrier
    tx_antenna, rx_antenna : Antenna
    scan : Scan
    transmitter : Transmitter
    receiver : Receiver
    back_to_back : Connection
    survey : Survey
    clock : Clock
    processing : Processing

    Examples
    --------
    >>> from sounder import load_sounder, shipped
    >>> sounder = load_sounder(shipped.calibration("sounder-132ghz.toml"))
    >>> sounder.waveform.samples
    1022
    >>> print(f"{sounder.waveform.period * 1e9:.1f} ns, {sounder.bandwidth / 1e9:g} GHz")
    851.7 ns, 1.08 GHz
    """

    name: str
    waveform: AnyWaveform
    carrier: Carrier
    tx_antenna: Antenna
    rx_antenna: Antenna
    scan: Scan
    transmitter: Transmitter = Transmitter()
    receiver: Receiver = Receiver()
    back_to_back: Connection = Connection()
    survey: Survey = Survey()
    clock: Clock = Clock()
    processing: Processing = Processing()

    @property
    def bandwidth(self) -> float:
        """Bandwidth kept by the de-embedding [Hz]: ``processing.bandwidth``, or 0.9 of the main lobe.

        The spectrum of held chips has its first null at the chip rate. The main lobe is twice as wide, or as wide as
        the sample rate if that is less. Nine tenths of it leave out the null. Of a sweep it is the whole band.
        """
        if isinstance(self.waveform, Sweep) and self.waveform.chip_rate is None:
            return self.processing.bandwidth or (self.waveform.points - 1) * self.waveform.step
        return self.processing.bandwidth or 0.9 * self.waveform.main_lobe

    @property
    def sequence(self) -> Waveform:
        """The m-sequence.

        Raises
        ------
        DataError
            The sounder sends something else.
        """
        if not isinstance(self.waveform, Waveform):
            raise DataError(f"{self.name} sends {self.waveform.summary}; expected a sounder that sends an m-sequence")
        return self.waveform

    @property
    def sent(self) -> Waveform | Periodic:
        """The waveform that repeats.

        Raises
        ------
        DataError
            The sounder sweeps the frequency.
        """
        if isinstance(self.waveform, Sweep):
            raise DataError(f"{self.name} sweeps the frequency; expected a sounder that sends a waveform")
        return self.waveform

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.bandwidth >= self.waveform.main_lobe:
            raise ValueError(
                f"processing.bandwidth is {self.bandwidth / 1e9:g} GHz; expected less than "
                f"{self.waveform.main_lobe / 1e9:g} GHz"
            )
        if self.bandwidth * self.waveform.period < MIN_SPECTRAL_LINES:
            least = MIN_SPECTRAL_LINES / self.waveform.period
            raise ValueError(
                f"processing.bandwidth is {self.bandwidth:g} Hz; expected {least:g} Hz or more, "
                f"{MIN_SPECTRAL_LINES} spectral lines"
            )
        return self


def load_sounder(path: Path | str) -> Sounder:
    """Read a sounder description.

    Parameters
    ----------
    path : path
        TOML file. Antenna cuts that it names are read from its folder or below.

    Raises
    ------
    DataError
        A file is missing or malformed, has an unknown key or an inconsistent value.

    Examples
    --------
    >>> from sounder import load_sounder, shipped
    >>> load_sounder(shipped.calibration("sounder-132ghz.toml")).name
    '132 GHz rotating-horn sounder'
    """
    tables = with_template(read_toml(path), Path(path))
    for antenna in (tables.get("tx_antenna"), tables.get("rx_antenna")):
        if isinstance(antenna, dict) and isinstance(antenna.get("cut"), str):
            antenna["cut"] = read_cut(file_inside(Path(path), antenna["cut"], "cut"))
    return Sounder.from_tables(tables, path)
