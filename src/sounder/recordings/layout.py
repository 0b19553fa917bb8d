"""Layout: a small TOML that says where a foreign HDF5 or MATLAB file keeps what a recording needs."""

from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from sounder.toml import Alternatives, Table, read_toml

Axis = Literal["position", "azimuth", "elevation", "direction", "snapshot", "sample", "iq"]


class Reference(Table):
    """Where a value stands in the file: a dataset, or an attribute (of the root, or of the dataset ``of``)."""

    dataset: str | None = None
    attribute: str | None = None
    of: str | None = None

    @model_validator(mode="after")
    def _one(self) -> Self:
        if (self.dataset is None) == (self.attribute is None):
            raise ValueError("a reference names either a dataset or an attribute")
        return self


ELSEWHERE = '{ dataset = "name" }, { attribute = "name" } or { attribute = "name", of = "dataset" }'
Number = Annotated[float | Reference, Alternatives(f"a number, {ELSEWHERE}")]
Numbers = Annotated[tuple[float, ...] | Reference, Alternatives(f"a list of numbers, {ELSEWHERE}")]
Points = Annotated[
    tuple[float, float, float] | tuple[tuple[float, float, float], ...] | Reference,
    Alternatives(f"three numbers, a list of such, {ELSEWHERE}"),
]


class Samples(Table):
    """A block of captures.

    ``dataset`` holds I and Q along the axis ``iq``, or complex numbers and no such axis; two real datasets are named
    by ``dataset`` (I) and ``imaginary`` (Q). ``axes`` names the axes in the order the file stores them; a MATLAB 7.3
    file stores them in the reverse of the order MATLAB shows. The axis ``direction`` holds azimuths and elevations
    one after the other; ``slowest`` says which of them changes last.
    """

    dataset: str
    imaginary: str | None = None
    axes: tuple[Axis, ...]
    slowest: Literal["azimuth", "elevation"] = "elevation"

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if len(set(self.axes)) != len(self.axes):
            raise ValueError("axes names one axis twice")
        if "sample" not in self.axes:
            raise ValueError("axes does not name sample")
        if "direction" in self.axes and {"azimuth", "elevation"} & set(self.axes):
            raise ValueError("axes names direction as well as azimuth or elevation")
        if self.imaginary is not None and "iq" in self.axes:
            raise ValueError("axes names iq, but I and Q stand in datasets of their own")
        return self


class Grid(Table):
    """Horn directions [degree]; a compass azimuth is clockwise from north, a zenith angle is from straight up."""

    azimuth: Numbers
    elevation: Numbers
    azimuth_convention: Literal["east_counterclockwise", "compass"] = "east_counterclockwise"
    elevation_convention: Literal["horizon", "zenith"] = "horizon"


class Positions(Table):
    """Antenna positions, east/north/up [m]: one, or one a position; and what else is known of each position.

    In ``name``, ``{}`` stands for the position's number (``{:02d}`` for two digits) and ``{file}`` for the file's name.
    """

    tx: Points
    rx: Points
    los: Annotated[int | Reference, Alternatives(f"1, 0, -1, {ELSEWHERE}")] = -1
    name: str | None = None

    @model_validator(mode="after")
    def _formats(self) -> Self:
        try:
            (self.name or "").format(0, file="")
        except (LookupError, ValueError):
            raise ValueError(
                f"name is \"{self.name}\"; expected text with {{}} in the number's and {{file}} in the file's place"
            ) from None
        return self


class Attenuated(Samples):
    """The back-to-back captures inside the file, through ``attenuation`` [dB]."""

    attenuation: Number
    scale_factor: Number | None = None
    includes_tx_antenna: bool = False

    @model_validator(mode="after")
    def _one_connection(self) -> Self:
        if extra := set(self.axes) - {"snapshot", "sample", "iq"}:
            raise ValueError(f"axes of the back-to-back names {', '.join(sorted(extra))}")
        return self


class Layout(Table):
    """How a foreign file is laid out; see ``docs/formats.md``.

    ``sounder`` overrides single keys of the sounder description; its values may be references too.
    """

    captures: Samples
    scale_factor: Number = 1.0
    agc_gain: Number = 0.0
    grid: Grid
    positions: Positions
    back_to_back: Attenuated | None = None
    sounder: dict[str, Any] = Field(default_factory=dict)
    time: Annotated[Reference | None, Field(description="time of each direction [s since 1970-01-01 UTC]")] = None


def load_layout(path: Path | str) -> Layout:
    """Read a layout.

    Raises
    ------
    DataError
        The file is missing, not TOML, or has an unknown key or a value that does not fit.
    """
    return Layout.from_tables(read_toml(path), path)
