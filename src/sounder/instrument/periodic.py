"""Waveforms that repeat and are no m-sequence: description and template."""

from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from erm.common.errors import DataError
from erm.common.text_files import read_table
from sounder.instrument import codes
from sounder.toml import Positive, Table, file_inside

Whole = Annotated[int, Field(ge=1)]
NEEDED = {
    "gold": ("order", "polynomial", "second_polynomial"),
    "gps_ca": ("prn",),
    "zadoff_chu": ("length", "root"),
    "chirp": ("samples", "bandwidth"),
    "multitone": ("samples", "tones"),
    "template": ("template",),
}
"""Keys of each kind of waveform."""
CHIPS = ("gold", "gps_ca", "zadoff_chu")
KEPT = 0.9
"""Share of the main lobe that the de-embedding keeps; see `sounder.instrument.description.Sounder.bandwidth`."""


class Periodic(Table):
    """A waveform that repeats.

    Attributes
    ----------
    kind : str
    sample_rate : float
        [Hz]
    chip_rate : float, optional
        Of ``gold``, ``gps_ca`` and ``zadoff_chu`` [Hz]; default: the sample rate. Samples a chip need not be whole.
    samples : int
        Samples in a period. Default: as many as the chips take. A longer period ends in zeros, a shorter one is cut.
    order, polynomial, second_polynomial, shift
        Of ``gold``: see `sounder.instrument.codes.gold`.
    prn : int
        Of ``gps_ca``: number of the satellite.
    length, root : int
        Of ``zadoff_chu``.
    bandwidth : float
        Of ``chirp`` [Hz].
    tones : int
        Of ``multitone``: number of tones, at neighbouring lines of the spectrum. Tones that are further apart repeat
        within the period, so that delays are ambiguous: their period is shorter.
    template : tuple of tuple of float
        I and Q of a period. In a file, ``file`` names a text table with the columns ``i`` and ``q`` beside it.

    Examples
    --------
    >>> waveform = Periodic(kind="gps_ca", prn=1, chip_rate=1.023e6, sample_rate=4e6)
    >>> waveform.samples, waveform.period
    (4000, 0.001)
    """

    kind: Literal["gold", "gps_ca", "zadoff_chu", "chirp", "multitone", "template"]
    sample_rate: Positive
    chip_rate: Positive | None = None
    samples: Annotated[int, Field(ge=16)]
    order: Annotated[int, Field(ge=3, le=15)] | None = None
    polynomial: tuple[int, ...] | None = None
    second_polynomial: tuple[int, ...] | None = None
    shift: int = 0
    prn: Annotated[int, Field(ge=1, le=32)] | None = None
    length: Whole | None = None
    root: Whole | None = None
    bandwidth: Positive | None = None
    tones: Whole | None = None
    template: tuple[tuple[float, float], ...] | None = None

    @model_validator(mode="before")
    @classmethod
    def _complete(cls, tables: Any) -> Any:
        if not isinstance(tables, dict) or tables.get("kind") not in NEEDED:
            return tables
        if absent := [key for key in NEEDED[tables["kind"]] if tables.get(key) is None]:
            raise ValueError(f"kind is {tables['kind']}, which needs {', '.join(absent)}")
        return tables if tables.get("samples") else {**tables, "samples": _natural_length(tables)}

    @model_validator(mode="after")
    def _makes_sense(self) -> Self:
        if self.kind == "gold":
            for polynomial in (self.polynomial, self.second_polynomial):
                if polynomial is None or polynomial[0] != self.order or polynomial[-1] != 0:
                    raise ValueError(f"polynomial is {polynomial}; expected exponents from {self.order} to 0")
        if self.kind == "chirp" and self.bandwidth is not None and self.bandwidth > self.sample_rate:
            raise ValueError(f"bandwidth is {self.bandwidth:g} Hz; expected at most the sample rate")
        if self.kind == "multitone" and int(self.tones or 0) // 2 + 1 > self.samples // 2:
            raise ValueError(f"{self.tones} tones do not fit into {self.samples} lines")
        return self

    @property
    def period(self) -> float:
        """Length of the period, the largest unambiguous delay [s]."""
        return self.samples / self.sample_rate

    @property
    def main_lobe(self) -> float:
        """Width of the main lobe of held chips, or of a band of which the part that is kept holds the tones [Hz]."""
        if self.kind in CHIPS:
            return min(2 * (self.chip_rate or self.sample_rate), self.sample_rate)
        if self.kind == "multitone" and self.tones is not None:
            return min((self.tones + 1) / self.period / KEPT, self.sample_rate)
        return min((self.bandwidth or self.sample_rate) / KEPT, self.sample_rate)

    @property
    def summary(self) -> str:
        """The waveform in a few words."""
        return f"{self.kind.replace('_', ' ')}, period of {self.samples} samples"

    @property
    def sampled(self) -> NDArray[np.complex128]:
        """Template of the correlator (sample,): chips are held until the next begins."""
        if self.kind == "chirp":
            return codes.chirp(self.samples, float(self.bandwidth or 0) * self.period)
        if self.kind == "multitone":
            return codes.multitone(self.samples, int(self.tones or 0))
        if self.kind == "template":
            row = np.array(self.template) @ [1, 1j]
            at = np.arange(self.samples)
        else:
            row = self._chips()
            at = np.floor(np.arange(self.samples) * (self.chip_rate or self.sample_rate) / self.sample_rate + ROUNDING)
        found = np.zeros(self.samples, complex)
        inside = at < row.size
        found[inside] = row[at[inside].astype(int)]
        return found

    def _chips(self) -> NDArray[np.complex128]:
        if self.kind == "gps_ca":
            return codes.gps_ca(int(self.prn or 1))
        if self.kind == "zadoff_chu":
            return codes.zadoff_chu(int(self.length or 1), int(self.root or 1))
        first, second = tuple(self.polynomial or ()), tuple(self.second_polynomial or ())
        return codes.gold(int(self.order or 0), first, second, self.shift)


ROUNDING = 1e-9
"""What a chip may begin early by [chips], so that rounding does not make it begin a sample late."""


def _natural_length(tables: dict[str, Any]) -> int:
    """Samples that the chips of a waveform take.

    Raises
    ------
    ValueError
        It is no whole number.
    """
    kind = tables["kind"]
    if kind == "template":
        return len(tables["template"])
    chips = {"gps_ca": 1023, "zadoff_chu": tables.get("length"), "gold": 2 ** int(tables.get("order") or 0) - 1}[kind]
    exact = float(chips or 0) * float(tables["sample_rate"]) / float(tables.get("chip_rate") or tables["sample_rate"])
    if abs(exact - round(exact)) > ROUNDING * exact:
        raise ValueError(f"{chips} chips take {exact:g} samples; expected a whole number, or the key samples")
    return round(exact)


def with_template(tables: dict[str, Any], path: Path) -> dict[str, Any]:
    """Read the template that the table ``waveform`` of a TOML file names, if it does.

    Raises
    ------
    DataError
        The file is elsewhere or is no table of I and Q.
    """
    waveform = tables.get("waveform")
    if not isinstance(waveform, dict) or not isinstance(waveform.get("file"), str):
        return tables
    source = file_inside(path, waveform["file"], "waveform.file")
    table = read_table(source, "a table of I and Q")
    try:
        rows = [(float(i), float(q)) for i, q in zip(table.column("i"), table.column("q"), strict=True)]
    except ValueError:
        raise DataError(f"{source}: not a table of numbers with the columns i and q") from None
    rest = {key: value for key, value in waveform.items() if key != "file"}
    return {**tables, "waveform": {"kind": "template", **rest, "template": rows}}
