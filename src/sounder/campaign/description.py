"""Campaign file (TOML): recordings, processing options, map options and figures."""

import glob
import re
from collections.abc import Collection, Iterable
from dataclasses import fields
from pathlib import Path
from typing import Annotated, Any, Literal, Self, get_args

from pydantic import AfterValidator, BeforeValidator, Field, PrivateAttr, ValidationError, model_validator

from erm.common.errors import DataError, OptionError
from erm.maps.georeference import Georeference
from erm.mpcs.options import Threshold as SelectionThreshold
from sounder.campaign.result import PRODUCTS
from sounder.options import Averaging, FigureFormat, Method, Omnidirectional, Options, Threshold
from sounder.processing.jobs import Explained, Job, gather
from sounder.toml import Alternatives, NotNegative, Positive, RelativePath, Table, describe, read_toml

MapFormat = Literal["h5", "geojson", "gpkg", "csv", "dxf", "ply", "obj", "xml"]


def _not_empty(values: tuple[Any, ...]) -> tuple[Any, ...]:
    # pydantic's min_length would count invalid items as missing
    if not values:
        raise ValueError("is empty; expected at least one")
    return values


def _threshold(value: Any) -> str:
    """Text of a threshold: of a name or numbers as on the command line, a number, or a table of numbers by name."""
    try:
        if isinstance(value, dict):
            return str(Threshold(**value))
        return str(Threshold.of(f"{value}" if isinstance(value, float | int) else value))
    except TypeError:
        known = ", ".join(field.name for field in fields(Threshold))
        raise ValueError(f"found {value!r}; expected a number for each of {known} that you give") from None
    except OptionError as error:
        raise ValueError(str(error).replace("threshold is", "found").removeprefix("threshold: ")) from None


class Recordings(Table):
    """Files with one back-to-back, for example those of a day.

    In ``files``, ``*`` stands for any part of a name and ``**`` for any folders. ``calibration``, ``layout``,
    ``sounder``, ``positions`` and ``skip`` are the options of ``sounder process``.
    """

    files: Annotated[tuple[str, ...], AfterValidator(_not_empty)]
    calibration: RelativePath | None = None
    layout: RelativePath | None = None
    sounder: RelativePath | None = None
    positions: RelativePath | None = None
    skip: tuple[str, ...] = ()

    @property
    def explained(self) -> Explained:
        """Files that explain the recordings."""
        return Explained(self.calibration, self.layout, self.sounder, self.positions)

    @model_validator(mode="after")
    def _calibrated(self) -> Self:
        if self.calibration is None and self.layout is None:
            raise ValueError("calibration is missing; expected a back-to-back recording, or a layout that names one")
        return self


class Processing(Table):
    """Options of ``sounder process``. ``threads``, ``workers`` and ``scheduler`` do not change the products."""

    averaging: Averaging = Options.averaging
    threshold: Annotated[str, BeforeValidator(_threshold)] = Options.threshold
    method: Method = Options.method
    omnidirectional: Omnidirectional = Options.omnidirectional
    keep_cir: bool = Options.keep_cir
    trust_all: bool = Options.trust_all
    threads: Annotated[int | None, Field(ge=1)] = None
    workers: Annotated[int, Field(ge=1)] = 1
    scheduler: str | None = None

    @property
    def options(self) -> Options:
        """Options that every product stores."""
        names = (field.name for field in fields(Options))
        return Options(**{name: getattr(self, name) for name in names})


class Map(Table):
    """Options of ``erm reconstruct``, and what else is made of the map.

    ``origin`` is latitude and longitude [degree] and optionally height [m] of the local (0, 0, 0); ``heading`` is the
    bearing of the local y axis, as in :class:`erm.Georeference`; ``crs`` is the system of GeoPackage and DXF. The map
    is scored against the known ``outline``.
    """

    threshold: SelectionThreshold = "consistency"
    max_loss: Positive | None = None
    min_support: Annotated[int, Field(ge=1)] = 3
    ground: float = 0.0
    rx_std: NotNegative | None = None
    heading_std: NotNegative | None = None
    clock_std: NotNegative | None = None
    as_given: bool = False
    origin: Annotated[
        tuple[float, float] | tuple[float, float, float] | None,
        Alternatives("latitude, longitude and, optionally, height"),
    ] = None
    heading: float = 0.0
    crs: str | None = None
    outline: RelativePath | None = None
    formats: tuple[MapFormat, ...] = ("h5", "geojson")

    @property
    def georeference(self) -> Georeference | None:
        """Georeference of the local frame; None without ``origin``."""
        if self.origin is None:
            return None
        latitude, longitude, *height = self.origin
        return Georeference(latitude, longitude, sum(height), self.heading)

    @model_validator(mode="after")
    def _check_georeference(self) -> Self:
        if self.heading and self.origin is None:
            raise ValueError("heading is given without origin; expected both or neither")
        if self.crs is not None and self.origin is None:
            raise ValueError("crs is given without origin; expected both or neither")
        try:
            self.georeference  # noqa: B018 (it checks its numbers)
        except DataError as error:
            raise ValueError(str(error)) from None
        return self


class Figures(Table):
    """Figures of positions (polar and cartesian DAPS, PDP): of all, of none, or of those listed."""

    format: FigureFormat = "png"
    positions: Annotated[
        Literal["all", "none"] | tuple[str, ...], Alternatives('"all", "none" or a list of names of positions')
    ] = "all"

    def wanted(self, position: str) -> bool:
        """Whether to draw a position."""
        return self.positions == "all" or (self.positions != "none" and position in self.positions)


class Campaign(Table):
    """A measurement campaign.

    Attributes
    ----------
    name : str
        Title of the report. Default in a file: the name of the file.
    recordings : tuple of Recordings
        In a file: one table, or an array of tables with a back-to-back each.
    processing : Processing
    map : Map
    figures : Figures
    out : Path
        Folder for all outputs. Default in a file: a folder beside it, named after it.
    """

    name: str
    recordings: Annotated[tuple[Recordings, ...], AfterValidator(_not_empty)]
    processing: Processing = Processing()
    map: Map = Map()
    figures: Figures = Figures()
    out: RelativePath
    _source: Path = PrivateAttr()

    def model_post_init(self, context: Any) -> None:
        """Keep the path of the campaign file."""
        self._source = context

    def processed_by(self, **options: Any) -> Self:
        """Return the same campaign with other options of `Processing`."""
        return self.model_copy(update={"processing": self.processing.model_copy(update=options)})

    @property
    def source(self) -> Path:
        """Campaign file."""
        return self._source

    @property
    def inputs(self) -> list[Path]:
        """The campaign file and all files that it names, without the recordings."""
        groups = self.recordings
        each = dict.fromkeys(path for group in groups for path in sorted(group.explained.files))
        return [path for path in (self.source, *each, self.map.outline) if path is not None]

    def files(self, out: Path) -> list[dict[str, list[Path]]]:
        """Recordings of each pattern, for each table of recordings; ``out`` as for `jobs`."""
        inputs = {path.resolve() for path in self.inputs}
        outputs = [(out / name).resolve() for name in (PRODUCTS, *(f"map.{one}" for one in get_args(MapFormat)))]
        return [
            {pattern: _matched(pattern, self.source.parent, inputs, outputs) for pattern in group.files}
            for group in self.recordings
        ]

    def jobs(self, out: Path, only: Collection[Path] | None = None) -> tuple[list[Job], list[str]]:
        """Open all recordings.

        Parameters
        ----------
        out : Path
            Folder of the outputs, which patterns do not match.
        only : collection of Path, optional
            Recordings that are opened, of those of the campaign.

        Returns
        -------
        jobs : list of Job
            For :func:`sounder.process`.
        failures : list of str
            One line for each file, position or table of recordings that cannot be used.
        """
        jobs: list[Job] = []
        failures: list[str] = []
        for group, patterns in zip(self.recordings, self.files(out), strict=True):
            files: list[Path] = []
            for pattern, found in patterns.items():
                if not found:
                    failures.append(f"{self.source}: recordings.files: {pattern} matches no file")
                files += [file for file in found if only is None or file in only]
            try:
                opened, refused = gather(list(dict.fromkeys(files)), **vars(group.explained), skip=group.skip)
            except DataError as error:  # of this table of recordings alone
                failures.append(str(error))
                continue
            jobs += opened
            failures += refused
        return jobs, failures


def load_campaign(path: Path | str) -> Campaign:
    r"""Read a campaign file. Paths in it are relative to its folder.

    Raises
    ------
    DataError
        The file is missing or not TOML, or has an unknown key or an invalid value.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import sounder
    >>> folder = pathlib.Path(tempfile.mkdtemp())
    >>> text = '[recordings]\nfiles = ["RX*.h5"]\ncalibration = "back-to-back.h5"'
    >>> _ = (folder / "street.toml").write_text(text)
    >>> campaign = sounder.load_campaign(folder / "street.toml")
    >>> campaign.name, campaign.out.name, campaign.map.threshold
    ('street', 'street', 'consistency')
    """
    path = Path(path)
    tables = read_toml(path)
    for name in ("name", "out"):
        tables.setdefault(name, path.stem)
    single = isinstance(tables.get("recordings"), dict)
    if single:
        tables["recordings"] = [tables["recordings"]]
    try:
        return Campaign.model_validate(tables, context=path)
    except ValidationError as error:
        problem = describe(error, Campaign)
        raise DataError(f"{path}: {problem.replace('recordings.0', 'recordings') if single else problem}") from None


def _matched(pattern: str, folder: Path, inputs: set[Path], outputs: Iterable[Path]) -> list[Path]:
    """File of a name, or files of a pattern without other ``inputs`` and without ``outputs`` and what they hold."""
    if not glob.has_magic(pattern) or (folder / pattern).exists():
        return [folder / pattern]
    paths = [folder / name for name in sorted(glob.glob(pattern, root_dir=folder, recursive=True), key=_natural_order)]

    def is_recording(path: Path) -> bool:
        return path.resolve() not in inputs and not any(path.resolve().is_relative_to(output) for output in outputs)

    return [path for path in paths if path.is_file() and is_recording(path)]


def _natural_order(name: str) -> list[Any]:
    """Sort key that puts RX2 before RX10."""
    return [int(part) if part.isdecimal() else part for part in re.split(r"(\d+)", name)]
