"""Environments on disk: a format is one file, chosen by the suffix."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from erm.errors import DataError

if TYPE_CHECKING:
    from erm.environment import Environment
    from erm.formats.columns import Columns

Writer = Callable[["Columns", dict[str, Any], Path], None]
Reader = Callable[[Path], tuple["Columns", dict[str, Any]]]


def write_environment(environment: "Environment", path: Path | str) -> None:
    """Write an environment as .h5, .geojson, .gpkg or .csv, by the suffix; whole or not at all.

    Raises
    ------
    DataError
        The suffix is none of these, the folder is not writable, or an optional library is missing.
    """
    from erm.formats.columns import to_columns, to_scene

    path = Path(path)
    write, _ = _format_of(path)
    write(to_columns(environment.reflectors), to_scene(environment), path)


def read_environment(path: Path | str) -> "Environment":
    """Read an environment, by the suffix; the inverse of `write_environment`.

    Raises
    ------
    DataError
        The file is missing, is not what its suffix says, or breaks a rule of environments.
    """
    from erm.formats.columns import to_environment

    path = Path(path)
    _, read = _format_of(path)
    if not path.is_file():
        raise DataError(f"{path}: no such file")
    try:
        return to_environment(*read(path))
    except DataError as error:
        text = str(error)
        raise error if text.startswith(str(path)) else DataError(f"{path}: {text}") from error


def _format_of(path: Path) -> tuple[Writer, Reader]:
    """Return the pair (writer, reader) of a suffix; each format is imported when used."""
    suffix = path.suffix.lower()
    if suffix in (".h5", ".hdf5", ".nc"):
        from erm.formats import hdf5

        return hdf5.write, hdf5.read
    if suffix in (".geojson", ".json"):
        from erm.formats import geojson

        return geojson.write, geojson.read
    if suffix == ".gpkg":
        from erm.formats import geopackage

        return geopackage.write, geopackage.read
    if suffix == ".csv":
        from erm.formats import text

        return text.write, text.read
    raise DataError(f"{path}: unknown format {suffix!r}; choose .h5, .geojson, .gpkg or .csv")
