"""A campaign: which recordings there are, how they are processed, what is made of them; read from TOML."""

import glob
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any, Literal, Self, get_args

from pydantic import AfterValidator, Field, PrivateAttr, ValidationError, model_validator

from erm.common.errors import DataError
from erm.maps.georeference import Georeference
from erm.mpcs.options import Threshold as Selection
from sounder.options import Averaging, FigureFormat, Method, Omnidirectional, Options, Threshold
from sounder.processing.jobs import Job, gather
from sounder.toml import Alternatives, NotNegative, Positive, RelativePath, Table, describe, read_toml

MapFormat = Literal["h5", "geojson", "gpkg", "csv", "dxf", "ply", "obj", "xml"]


def _some(values: tuple[Any, ...]) -> tuple[Any, ...]:
    # pydantic's own min_length counts what is wrong as missing
    if not values:
        raise ValueError("is empty; expected at least one")
    return values


class Recordings(Table):
    """Files that are read alike, with one back-to-back: those of a day.

    In ``files``, ``*`` stands for any part of a name and ``**`` for any folders. ``calibration``, ``layout`` and
    ``sounder`` are as in ``sounder process``.
    """

    files: Annotated[tuple[str, ...], AfterValidator(_some)]
    calibration: RelativePath | None = None
    layout: RelativePath | None = None
    sounder: RelativePath | None = None

    @model_validator(mode="after")
    def _calibrated(self) -> Self:
        if self.calibration is None and self.layout is None:
            raise ValueError("calibration is missing; expected a back-to-back recording, or a layout that names one")
        return self


class Processing(Table):
    """From captures to MPCs, as in ``sounder process``; the last three tell who works, and change no product."""

    averaging: Averaging = Options.averaging
    threshold: Threshold = Options.threshold
    method: Method = Options.method
    omnidirectional: Omnidirectional = Options.omnidirectional
    keep_cir: bool = Options.keep_cir
    threads: Annotated[int | None, Field(ge=1)] = None
    workers: Annotated[int, Field(ge=1)] = 1
    scheduler: str | None = None

    @property
    def options(self) -> Options:
        """What is stored in every product."""
        return Options(self.averaging, self.threshold, self.method, self.omnidirectional, self.keep_cir)


class Map(Table):
    """From MPCs to the map, as in ``erm reconstruct``.

    ``origin`` is latitude, longitude [degree] and perhaps height [m] of the local (0, 0, 0), ``heading`` the bearing of
    the local y axis, as in :class:`erm.maps.georeference.Georeference`. By ``outline`` the map is scored.
    """

    threshold: Selection = "consistency"
    max_loss: Positive | None = None
    min_support: Annotated[int, Field(ge=1)] = 3
    ground: float = 0.0
    rx_std: NotNegative = 0.0
    origin: Annotated[
        tuple[float, float] | tuple[float, float, float] | None,
        Alternatives("latitude, longitude and perhaps height"),
    ] = None
    heading: float = 0.0
    outline: RelativePath | None = None
    formats: tuple[MapFormat, ...] = ("h5", "geojson")

    @property
    def georeference(self) -> Georeference | None:
        """Place of the local frame on earth."""
        if self.origin is None:
            return None
        latitude, longitude, *height = self.origin
        return Georeference(latitude, longitude, sum(height), self.heading)

    @model_validator(mode="after")
    def _placed(self) -> Self:
        if self.heading and self.origin is None:
            raise ValueError("heading is given without an origin; expected both, or neither")
        try:
            self.georeference  # noqa: B018 (it says what is wrong with its numbers)
        except DataError as error:
            raise ValueError(str(error)) from None
        return self


class Figures(Table):
    """Figures of positions: DAPS in polar and cartesian form, and PDP; of all, of none, or of those named."""

    format: FigureFormat = "png"
    positions: Annotated[
        Literal["all", "none"] | tuple[str, ...], Alternatives('"all", "none" or a list of names of positions')
    ] = "all"

    def wanted(self, position: str) -> bool:
        """Whether a position is to be drawn."""
        return self.positions == "all" or (self.positions != "none" and position in self.positions)


class Campaign(Table):
    """A measurement campaign.

    Attributes
    ----------
    name : str
        Title of the report; in the file, that of the file if absent.
    recordings : tuple of Recordings
        In the file one table, or an array of tables with a back-to-back each.
    processing : Processing
    map : Map
    figures : Figures
    out : Path
        Folder for all that is made; in the file, one beside it and named after it if absent.
    """

    name: str
    recordings: Annotated[tuple[Recordings, ...], AfterValidator(_some)]
    processing: Processing = Processing()
    map: Map = Map()
    figures: Figures = Figures()
    out: RelativePath
    _source: Path = PrivateAttr()

    def model_post_init(self, context: Any) -> None:
        """Keep the name of the file."""
        self._source = context

    @property
    def source(self) -> Path:
        """The file."""
        return self._source

    @property
    def named(self) -> list[Path]:
        """Files that the campaign names, beside the recordings."""
        groups = self.recordings
        each = [path for group in groups for path in (group.calibration, group.layout, group.sounder)]
        return [path for path in (self.source, *each, self.map.outline) if path is not None]

    def jobs(self, out: Path) -> tuple[list[Job], list[str]]:
        """Open all recordings.

        Parameters
        ----------
        out : Path
            Folder of what is made, which patterns do not match.

        Returns
        -------
        jobs : list of Job
            For :func:`sounder.processing.pipeline.process`.
        failures : list of str
            One line for each file, position or group that cannot be used.
        """
        jobs: list[Job] = []
        failures: list[str] = []
        spared = {path.resolve() for path in self.named}
        made = [(out / name).resolve() for name in ("products", *(f"map.{suffix}" for suffix in get_args(MapFormat)))]
        for group in self.recordings:
            files: list[Path] = []
            for pattern in group.files:
                found = _matched(pattern, self.source.parent, spared, made)
                if not found:
                    failures.append(f"{self.source}: recordings.files: {pattern} matches no file")
                files += found
            try:
                how = {"calibration": group.calibration, "layout": group.layout, "sounder": group.sounder}
                opened, refused = gather(list(dict.fromkeys(files)), **how)
            except DataError as error:  # costs its group alone
                failures.append(str(error))
                continue
            jobs += opened
            failures += refused
        return jobs, failures


def load_campaign(path: Path | str) -> Campaign:
    """Read a campaign; files are named from its own folder.

    Raises
    ------
    DataError
        The file is missing, not TOML, or has an unknown key or a value that does not fit.
    """
    path = Path(path)
    tables = read_toml(path)
    for name in ("name", "out"):
        tables.setdefault(name, path.stem)
    alone = isinstance(tables.get("recordings"), dict)
    if alone:
        tables["recordings"] = [tables["recordings"]]
    try:
        return Campaign.model_validate(tables, context=path)
    except ValidationError as error:
        told = describe(error, Campaign)
        raise DataError(f"{path}: {told.replace('recordings.0', 'recordings') if alone else told}") from None


def _matched(pattern: str, folder: Path, spared: set[Path], made: Iterable[Path]) -> list[Path]:
    """Files of a name or a pattern; a pattern leaves out ``spared`` files, and what is ``made`` or lies in it."""
    if not glob.has_magic(pattern) or (folder / pattern).exists():
        return [folder / pattern]
    paths = [folder / name for name in sorted(glob.glob(pattern, root_dir=folder, recursive=True), key=_in_order)]

    def foreign(path: Path) -> bool:
        return path.resolve() not in spared and not any(path.resolve().is_relative_to(place) for place in made)

    return [path for path in paths if path.is_file() and foreign(path)]


def _in_order(name: str) -> list[Any]:
    """Key that puts RX2 before RX10."""
    return [int(part) if part.isdecimal() else part for part in re.split(r"(\d+)", name)]
