"""The sounder description: what the instrument is, read from TOML, frozen and validated."""

from itertools import pairwise
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from sounder.instrument.antenna_description import Antenna
from sounder.instrument.antenna_files import read_cut
from sounder.toml import NotNegative, Positive, Table, read_toml

LINES = 16
"""Least number of spectral lines kept: a delay is a slope of the phase over these."""


class Waveform(Table):
    """The transmitted m-sequence.

    ``polynomial`` lists the exponents of the primitive characteristic polynomial, highest first: ``[9, 4, 0]`` is
    ``x^9 + x^4 + 1``, that is ``s[n+9] = s[n+4] xor s[n]``. ``direction`` is the order in which the chips are sent,
    ``polarity`` the sign of a 0 bit.
    """

    order: Annotated[int, Field(ge=7, le=15)]
    polynomial: tuple[int, ...]
    direction: Literal["forward", "reversed"] = "forward"
    polarity: Literal["positive", "negative"] = "positive"
    chip_rate: Positive
    samples_per_chip: Annotated[int, Field(ge=1, le=4)]
    sample_rate: Positive

    @property
    def chips(self) -> int:
        """Chips in a period, ``2**order - 1``."""
        return 2**self.order - 1

    @property
    def samples(self) -> int:
        """Samples in a period, and so in a capture."""
        return self.chips * self.samples_per_chip

    @property
    def period(self) -> float:
        """Length of the sequence, the largest unambiguous delay [s]."""
        return self.samples / self.sample_rate

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        expected = self.chip_rate * self.samples_per_chip
        if abs(self.sample_rate / expected - 1) > 1e-9:
            raise ValueError(
                f"sample_rate is {self.sample_rate:g} Hz, but chip_rate x samples_per_chip is {expected:g} Hz"
            )
        exponents = sorted(set(self.polynomial), reverse=True)
        if list(self.polynomial) != exponents or exponents[:1] != [self.order] or exponents[-1] != 0:
            raise ValueError(
                f"polynomial is {list(self.polynomial)}; expected falling exponents from {self.order} (the order) to 0"
            )
        if (period := _register_period(self.order, self.polynomial)) != self.chips:
            raise ValueError(
                f"polynomial is {list(self.polynomial)}, which is not primitive: its sequence repeats after {period} "
                f"chips, not {self.chips}"
            )
        return self


def _register_period(order: int, polynomial: tuple[int, ...]) -> int:
    """Steps after which the shift register of a polynomial is in its first state again."""
    taps = sum(1 << exponent for exponent in polynomial if exponent < order)
    state, steps = 1, 0
    while steps == 0 or state != 1:
        state = state >> 1 | ((state & taps).bit_count() & 1) << order - 1
        steps += 1
    return steps


class Carrier(Table):
    """Carrier and how it is made: ``frequency = lo_frequency * multiplier + if_frequency`` [Hz]."""

    frequency: Positive
    if_frequency: NotNegative
    lo_frequency: Positive
    multiplier: Annotated[int, Field(ge=1)]

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        made = self.lo_frequency * self.multiplier + self.if_frequency
        if abs(made / self.frequency - 1) > 1e-9:
            raise ValueError(
                f"frequency is {self.frequency / 1e9:g} GHz, but lo_frequency x multiplier + if_frequency is "
                f"{self.lo_frequency / 1e9:g} x {self.multiplier} + {self.if_frequency / 1e9:g} = {made / 1e9:g} GHz"
            )
        return self


class Scan(Table):
    """Directions the horn looks at [degree]: azimuth counter-clockwise from east, elevation above the horizon."""

    azimuth: tuple[float, ...]
    elevation: tuple[float, ...]

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        for name, values in (("azimuth", self.azimuth), ("elevation", self.elevation)):
            if not values or any(b <= a for a, b in pairwise(values)):
                raise ValueError(f"{name} must hold rising values, at least one")
        if self.azimuth[-1] - self.azimuth[0] >= 360:
            raise ValueError("azimuth goes round more than once; list each direction once")
        if min(self.elevation) < -90 or max(self.elevation) > 90:
            raise ValueError("elevation leaves -90..90 degree")
        return self


class Transmitter(Table):
    """Power into the transmit antenna [dBm]."""

    power: float


class Clock(Table):
    """How the clock wanders against the back-to-back's.

    ``step`` is the standard deviation [s] of its random walk from one direction of the scan to the next.
    """

    step: NotNegative = 0.0


class Artefact(Table):
    """A copy that the instrument makes of every path: how much later [s], and how strong at most [dB].

    The level is relative to the path in the same beam. Copies that come earlier have a negative delay.
    """

    delay: float
    level: Annotated[float, Field(lt=0)]

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.delay == 0:
            raise ValueError("delay is 0; expected how much later [s] than its path the copy comes")
        return self


class Processing(Table):
    """Choices about the instrument that processing needs.

    ``bandwidth`` is kept by the de-embedding [Hz], full width about the carrier; default 0.9 of the main lobe.
    ``artefact`` lists copies of paths that are not to be taken for paths.
    """

    bandwidth: Positive | None = None
    artefact: tuple[Artefact, ...] = ()


class Sounder(Table):
    """A channel sounder.

    Examples
    --------
    >>> sounder = load_sounder("calibration/sounder-132ghz.toml")  # doctest: +SKIP
    >>> sounder.waveform.samples  # doctest: +SKIP
    1022
    """

    name: str
    waveform: Waveform
    carrier: Carrier
    tx_antenna: Antenna
    rx_antenna: Antenna
    scan: Scan
    transmitter: Transmitter
    clock: Clock = Clock()
    processing: Processing = Processing()

    @property
    def bandwidth(self) -> float:
        """Bandwidth kept by the de-embedding [Hz].

        The spectrum of a chip held over ``samples_per_chip`` samples has its first null at the chip rate; for two
        samples a chip that is exactly Nyquist. Nine tenths of the main lobe leave the null out.
        """
        widest = min(2 * self.waveform.chip_rate, self.waveform.sample_rate)
        return self.processing.bandwidth or 0.9 * widest

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        widest = min(2 * self.waveform.chip_rate, self.waveform.sample_rate)
        if self.bandwidth >= widest:
            raise ValueError(
                f"processing.bandwidth is {self.bandwidth / 1e9:g} GHz; the chips fill less than {widest / 1e9:g} GHz"
            )
        if self.bandwidth * self.waveform.period < LINES:
            least = LINES / self.waveform.period
            raise ValueError(
                f"processing.bandwidth is {self.bandwidth:g} Hz; expected {least:g} Hz or more, {LINES} spectral lines"
            )
        return self


def load_sounder(path: Path | str) -> Sounder:
    """Read a sounder description.

    The antenna cuts it names are read from the description's own folder.

    Raises
    ------
    DataError
        A file is missing or malformed, has an unknown key or an inconsistent value.
    """
    tables = read_toml(path)
    for antenna in (tables.get("tx_antenna"), tables.get("rx_antenna")):
        if isinstance(antenna, dict) and isinstance(antenna.get("cut"), str):
            antenna["cut"] = read_cut(Path(path).parent / antenna["cut"])
    return Sounder.from_tables(tables, path)
