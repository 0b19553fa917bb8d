"""What is sent: an m-sequence, or a sweep over frequencies."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from sounder.toml import Positive, Table


class Waveform(Table):
    """The transmitted m-sequence.

    Attributes
    ----------
    order : int
        The sequence has ``2**order - 1`` chips.
    polynomial : tuple of int
        Exponents of the primitive characteristic polynomial, highest first: ``(9, 4, 0)`` is ``x^9 + x^4 + 1``, that
        is ``s[n+9] = s[n+4] xor s[n]``.
    direction : {"forward", "reversed"}
        Order in which the chips are sent.
    polarity : {"positive", "negative"}
        Sign of a 0 bit.
    chip_rate, sample_rate : float
        [Hz]
    samples_per_chip : int
        Must be ``sample_rate / chip_rate``.
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

    @property
    def main_lobe(self) -> float:
        """Width of the main lobe of the held chips, at most the sample rate [Hz]."""
        return min(2 * self.chip_rate, self.sample_rate)

    @property
    def summary(self) -> str:
        """The sequence in a few words."""
        return f"order {self.order}, {self.samples_per_chip} samples per chip"

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
                f"polynomial is {list(self.polynomial)}; expected exponents in descending order from {self.order} "
                "(the order) to 0"
            )
        if (period := _register_period(self.order, self.polynomial)) != self.chips:
            raise ValueError(
                f"polynomial is {list(self.polynomial)}, which is not primitive: its sequence repeats after {period} "
                f"chips, not {self.chips}"
            )
        return self


def _register_period(order: int, polynomial: tuple[int, ...]) -> int:
    """Steps after which the shift register of a polynomial returns to its first state."""
    taps = sum(1 << exponent for exponent in polynomial if exponent < order)
    state, steps = 1, 0
    while steps == 0 or state != 1:
        state = state >> 1 | ((state & taps).bit_count() & 1) << order - 1
        steps += 1
    return steps


class Sweep(Table):
    """Frequencies at which a transfer function is measured, as by a vector network analyser.

    The middle one, of an even number the upper of the two, is the carrier.

    Attributes
    ----------
    points : int
        Number of frequencies.
    step : float
        Their spacing [Hz].
    chip_rate : float, optional
        Rate of the chips that impulse responses were correlated with [Hz].

    Examples
    --------
    >>> sweep = Sweep(points=801, step=5e6)
    >>> print(f"{sweep.sample_rate / 1e9:g} GHz, {sweep.period * 1e9:g} ns")
    4.005 GHz, 200 ns
    """

    points: Annotated[int, Field(ge=16)]
    step: Positive
    chip_rate: Positive | None = None

    @property
    def samples(self) -> int:
        """Frequencies in a sweep, and so samples in a response."""
        return self.points

    @property
    def sample_rate(self) -> float:
        """Inverse of the spacing of the delays of a response [Hz]."""
        return self.points * self.step

    @property
    def period(self) -> float:
        """Delay after which a response repeats [s]."""
        return 1 / self.step

    @property
    def main_lobe(self) -> float:
        """Width of the band, or of the main lobe of the held chips if that is less [Hz]."""
        return self.sample_rate if self.chip_rate is None else min(2 * self.chip_rate, self.sample_rate)

    @property
    def summary(self) -> str:
        """The sweep in a few words."""
        return f"{self.points} frequencies, {self.step / 1e6:g} MHz apart"
