"""Layout: a TOML file that says where a foreign HDF5 or MATLAB file stores what a recording needs."""

from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from sounder.instrument.periodic import with_template
from sounder.recordings.recording import Kind
from sounder.toml import Alternatives, NotNegative, Table, read_toml

Axis = Literal["position", "tx", "rx", "tx_azimuth", "tx_elevation", "azimuth", "elevation", "snapshot", "sample", "iq"]
SAMPLES = ("delay", "frequency")
"""Other names of the axis ``sample``."""


class Reference(Table):
    """Where the file stores a value: a dataset, or an attribute of the root or of the dataset ``of``."""

    dataset: str | None = None
    attribute: str | None = None
    of: str | None = None

    @model_validator(mode="after")
    def _one(self) -> Self:
        if (self.dataset is None) == (self.attribute is None):
            raise ValueError("expected either a dataset or an attribute")
        return self


REFERENCES = '{ dataset = "name" }, { attribute = "name" } or { attribute = "name", of = "dataset" }'
Number = Annotated[float | Reference, Alternatives(f"a number, {REFERENCES}")]


def _evenly(value: Any) -> Any:
    """Numbers of ``{ start, stop, points }``, both ends included; other values as they are."""
    if not isinstance(value, dict) or "start" not in value:
        return value
    given = Evenly.model_validate(value)
    return tuple(np.linspace(given.start, given.stop, given.points).tolist())


class Evenly(Table):
    """Numbers of even spacing, both ends included."""

    start: float
    stop: float
    points: Annotated[int, Field(ge=1, le=2**24)]


Numbers = Annotated[
    tuple[float, ...] | Reference,
    Alternatives(f"a list of numbers, {{ start, stop, points }}, {REFERENCES}"),
    BeforeValidator(_evenly),
]
Points = Annotated[
    tuple[float, float, float] | tuple[tuple[float, float, float], ...] | Reference,
    Alternatives(f"three numbers, a list of these, {REFERENCES}"),
]


class Samples(Table):
    """A block of captures.

    ``dataset`` holds I and Q along the axis ``iq``, or complex numbers without this axis. If I and Q are two datasets,
    ``dataset`` names I and ``imaginary`` names Q. ``axes`` lists the axes in the order in which the file stores them; a
    MATLAB 7.3 file stores them in the reverse of the order that MATLAB shows. Several may lie along one axis of the
    dataset, as in ``"snapshot * azimuth * tx_azimuth"``, of which the first changes last; ``direction`` is
    ``"elevation * azimuth"``, or the other way round if ``slowest`` is azimuth. ``along`` is how many of the axes lie
    along each of the dataset; it follows from ``axes``.

    With ``flat``, ``dataset`` holds all samples one behind another, as in one row, whatever its shape; only ``iq`` is
    an axis of its own. The first capture begins at the sample ``start``, and captures are ``stride`` samples apart, by
    default their own length.
    """

    dataset: str
    imaginary: str | None = None
    axes: tuple[Axis, ...]
    along: tuple[int, ...] = ()
    slowest: Literal["azimuth", "elevation"] = "elevation"
    flat: bool = False
    start: Annotated[int, Field(ge=0)] = 0
    stride: Annotated[int, Field(ge=1)] | None = None

    @model_validator(mode="before")
    @classmethod
    def _named(cls, tables: Any) -> Any:
        axes = tables.get("axes") if isinstance(tables, dict) else None
        if not isinstance(axes, (list, tuple)) or not all(isinstance(axis, str) for axis in axes):
            return tables
        both = ("azimuth", "elevation") if tables.get("slowest") == "azimuth" else ("elevation", "azimuth")
        if "direction" in axes and set(both) & set(axes):
            raise ValueError("axes has direction and azimuth or elevation; expected one or the other")
        parts = [[part.strip() for part in axis.split("*")] for axis in axes]
        named = [part for group in parts for part in (both if group == ["direction"] else group)]
        along = [2 if group == ["direction"] else len(group) for group in parts]
        return {**tables, "axes": ["sample" if axis in SAMPLES else axis for axis in named], "along": along}

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if len(set(self.axes)) != len(self.axes):
            raise ValueError("axes lists an axis twice")
        if "sample" not in self.axes:
            raise ValueError("axes has no sample")
        if self.imaginary is not None and "iq" in self.axes:
            raise ValueError("axes has iq, but imaginary says that I and Q are two datasets")
        last = [axis for axis in self.axes if axis != "iq"][-1]
        if not self.flat and (self.start or self.stride is not None):
            raise ValueError("start and stride are for flat = true")
        if self.flat and (last != "sample" or self.axes.index("sample") < len(self.axes) - 2):
            raise ValueError("flat = true needs sample as the last of the axes, or iq behind it")
        return self


class ScanSamples(Samples):
    """Captures of a scan.

    ``kind`` says what they are: ``iq``, samples of the received signal; ``cir``, impulse responses, correlated already;
    ``ctf``, transfer functions (S21). ``frequency`` are those of a transfer function [Hz]; their spacing is constant.
    ``sample_rate`` is that of impulse responses [Hz]; without it they have that of the described waveform. ``window``
    names the window over frequency that impulse responses were made with, where there is no back-to-back. ``files`` are
    the names of touchstone files in a folder, with ``{azimuth}`` and ``{elevation}``.
    """

    kind: Kind = "iq"
    frequency: Numbers | None = None
    sample_rate: Number | None = None
    window: Literal["boxcar", "hann", "hamming", "blackman"] | None = None
    files: str | None = None

    @model_validator(mode="after")
    def _described(self) -> Self:
        if (self.kind == "ctf") != (self.frequency is not None):
            raise ValueError('kind "ctf" and the key frequency go together')
        if self.kind != "cir" and (self.sample_rate is not None or self.window is not None):
            raise ValueError('sample_rate and window are for kind "cir"')
        return self


class Grid(Table):
    """Directions of the horn [degree]. A compass azimuth is clockwise from north, a zenith angle is from up.

    ``tx_azimuth`` and ``tx_elevation`` are those of the transmit antenna, where it was turned or has several beams.
    """

    azimuth: Numbers
    elevation: Numbers
    tx_azimuth: Numbers = (0.0,)
    tx_elevation: Numbers = (0.0,)
    azimuth_convention: Literal["east_counterclockwise", "compass"] = "east_counterclockwise"
    elevation_convention: Literal["horizon", "zenith"] = "horizon"


Columns = tuple[str, str, str]
Deviation = Annotated[NotNegative | str, Alternatives("a number, or the name of a column")]


class PositionTable(Table):
    """A text table with a row for each position. All values but ``file``, ``frame`` and ``origin`` name columns.

    ``tx`` and ``rx`` are east, north, up [m], or with ``frame = "geodetic"`` latitude, longitude [degree] and height
    above the ellipsoid [m] in WGS 84; ``origin`` is then the place of the local (0, 0, 0) in the same form. The
    standard deviations, of each coordinate of an antenna [m] and of the zero of azimuth [degree], are numbers or
    columns.
    """

    file: str | None = None
    name: str
    tx: Columns | None = None
    rx: Columns | None = None
    los: str | None = None
    frame: Literal["local", "geodetic"] = "local"
    origin: tuple[float, float, float] | None = None
    tx_std: Deviation | None = None
    rx_std: Deviation | None = None
    heading_std: Deviation | None = None

    @model_validator(mode="after")
    def _placed(self) -> Self:
        if (self.frame == "geodetic") != (self.origin is not None):
            raise ValueError('frame = "geodetic" and origin go together')
        return self


class Positions(Table):
    """Positions of the antennas, east/north/up [m]: one for all, or one for each position; line of sight and name.

    With the axes ``tx`` and ``rx``, transmit and receive antennas at several places, each link is a position, the
    receive antenna counting first; ``tx`` and ``rx`` are then one for each of the antennas.

    In ``name``, ``{}`` is the number of the position, from ``first`` (``{:02d}`` for two digits), and ``{file}`` the
    name of the file; of a name such as ``int16_P01`` and ``file = "int16_{}"`` that is ``P01``. What ``table`` holds
    is looked up by the name.
    """

    tx: Points | None = None
    rx: Points | None = None
    los: Annotated[int | Reference, Alternatives(f"1, 0, -1, {REFERENCES}")] = -1
    name: str | None = None
    first: int = 0
    file: str = "{}"
    table: PositionTable | None = None

    @model_validator(mode="after")
    def _placed(self) -> Self:
        for end in ("tx", "rx"):
            given = getattr(self, end) is not None, self.table is not None and getattr(self.table, end) is not None
            if all(given):
                raise ValueError(f"{end} is given twice, as values and in the table; expected one")
            if not any(given):
                raise ValueError(f"{end}: missing; expected values, or columns of positions.table")
        if self.file.count("{}") != 1:
            raise ValueError(f'file is "{self.file}"; expected the names of files, with {{}} for what differs')
        return self

    @model_validator(mode="after")
    def _formats(self) -> Self:
        try:
            (self.name or "").format(0, file="")
        except (LookupError, ValueError):
            raise ValueError(
                f'name is "{self.name}"; expected text with {{}} for the number and {{file}} for the name of the file'
            ) from None
        return self


class BackToBackSamples(Samples):
    """Back-to-back captures through ``attenuation`` [dB], in the same file or in that of ``--calibration``.

    ``kind`` is that of the captures, or ``iq`` where those are impulse responses: it is then correlated with the
    described sequence, as a mean over the samples, and delayed by ``shift`` samples, where the responses were
    correlated with a sequence that begins so much later. ``frequency`` is that of the captures, if it is not given.
    """

    attenuation: Number
    kind: Kind | None = None
    frequency: Numbers | None = None
    shift: int = 0
    scale_factor: Number | None = None
    includes_tx_antenna: bool = False

    @model_validator(mode="after")
    def _one_connection(self) -> Self:
        if extra := set(self.axes) - {"snapshot", "sample", "iq"}:
            raise ValueError(f"axes has {', '.join(sorted(extra))}; expected snapshot, sample and iq at most")
        return self


class Layout(Table):
    """Layout of a foreign file; see ``docs/formats.md``.

    ``sounder`` overrides single keys of the sounder description. Its values may be references.
    """

    captures: ScanSamples
    scale_factor: Number = 1.0
    agc_gain: Number = 0.0
    grid: Grid
    positions: Positions
    back_to_back: BackToBackSamples | None = None
    sounder: dict[str, Any] = Field(default_factory=dict)
    time: Annotated[Reference | None, Field(description="time of each direction [s since 1970-01-01 UTC]")] = None

    @model_validator(mode="after")
    def _kinds(self) -> Self:
        kind = None if self.back_to_back is None else self.back_to_back.kind
        if kind not in (None, self.captures.kind) and (kind, self.captures.kind) != ("iq", "cir"):
            raise ValueError(f"back_to_back.kind is {kind}; expected {self.captures.kind}, as that of the captures")
        return self


def load_layout(path: Path | str) -> Layout:
    """Read a layout.

    Raises
    ------
    DataError
        The file is missing, not TOML, or has an unknown key or a value that does not fit.
    """
    tables = read_toml(path)
    if isinstance(tables.get("sounder"), dict):
        tables["sounder"] = with_template(tables["sounder"], Path(path))
    return Layout.from_tables(tables, path)
