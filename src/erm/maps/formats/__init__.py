"""Environments on disk: a format is one module, chosen by the suffix."""

from collections.abc import Callable
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any

from erm.common.errors import DataError, OptionError
from erm.common.outputs import require_suffix
from erm.common.storage import require_file

if TYPE_CHECKING:
    from erm.maps.environment import Environment
    from erm.maps.formats.columns import Columns

Writer = Callable[["Columns", dict[str, Any], Path], None]
Reader = Callable[[Path], tuple["Columns", dict[str, Any]]]


HDF5, GEOJSON = (".h5", ".hdf5", ".nc"), (".geojson", ".json")
MAPS = (*HDF5, *GEOJSON, ".gpkg", ".csv")
"""Formats that are written and read."""
DRAWINGS = (".dxf", ".obj", ".ply", ".xml")
"""Formats that are written only: they hold shapes, not what is known about them."""
HEIGHT, MARGIN, FREQUENCY = 30.0, 50.0, 132e9
"""What `write_environment` takes for its options."""


def write_environment(
    environment: "Environment",
    path: Path | str,
    *,
    height: float = HEIGHT,
    margin: float = MARGIN,
    frequency: float = FREQUENCY,
) -> None:
    """Write an environment by the suffix; whole or not at all.

    Maps, to be read again, are .h5, .geojson, .gpkg and .csv; drawings are .dxf, .ply, .obj and .xml (for Mitsuba
    and Sionna RT, with meshes beside it).

    Parameters
    ----------
    environment : Environment
    path : path
        The file.
    height, margin : float
        Of drawings: where walls without end are cut, and how far ground and ceiling reach [m]; see
        `erm.maps.formats.surfaces.extrude`.
    frequency : float
        Of .xml: where materials that the ray tracer does not know are evaluated [Hz].

    Raises
    ------
    DataError
        The suffix is none of these, the folder is not writable, or an optional library is missing.
    """
    from erm.maps.formats.columns import to_columns, to_scene

    path = Path(path)
    require_format(path)
    if path.suffix.lower() in DRAWINGS:
        _draw(environment, path, height, margin, frequency)
    else:
        write, _ = _format_of(path)
        write(to_columns(environment.reflectors), to_scene(environment), path)


def read_environment(path: Path | str) -> "Environment":
    """Read an environment, by the suffix; the inverse of `write_environment`.

    Raises
    ------
    DataError
        The file is missing, is not what its suffix says, or breaks a rule of environments.
    """
    from erm.maps.formats.columns import to_environment

    path = Path(path)
    require_file(path)
    suffix = path.suffix.lower()
    if suffix in DRAWINGS:
        raise DataError(f"{path}: a drawing, which is not read again; give the map it was made from")
    if suffix not in MAPS:
        raise DataError(f"{path}: unknown format {suffix!r}; expected a map: {', '.join(MAPS)}")
    _, read = _format_of(path)
    try:
        return to_environment(*read(path))
    except DataError as error:
        text = str(error)
        raise error if text.startswith(str(path)) else DataError(f"{path}: {text}") from error


def require_format(path: Path) -> None:
    """Refuse what `write_environment` cannot write, before there is anything to write.

    Raises
    ------
    OptionError
        The suffix names no format.
    DataError
        The format's library is missing.
    """
    require_suffix(path, *MAPS, *DRAWINGS)
    suffix = path.suffix.lower()
    if suffix == ".dxf":
        from erm.maps.formats import dxf

        dxf.library(path)
    elif suffix == ".gpkg":
        from erm.maps.formats import geopackage

        geopackage.library(path)


def _draw(environment: "Environment", path: Path, height: float, margin: float, frequency: float) -> None:
    """Write one of the `DRAWINGS`."""
    from erm.maps.formats import dxf, mitsuba, obj, ply
    from erm.maps.formats.surfaces import extrude

    if not all(0 < value < inf for value in (height, margin, frequency)):
        raise OptionError(f"{path}: height {height}, margin {margin}, frequency {frequency}; expected positive numbers")
    suffix = path.suffix.lower()
    if suffix == ".dxf":
        dxf.write(environment, path, height=height, margin=margin)
        return
    surfaces = extrude(environment, height=height, margin=margin)
    if suffix == ".ply":
        ply.write(surfaces, path)
    elif suffix == ".obj":
        obj.write(surfaces, path)
    else:
        mitsuba.write(surfaces, environment.materials, frequency, path)


def _format_of(path: Path) -> tuple[Writer, Reader]:
    """Return the pair (writer, reader) of one of `MAPS`; each format is imported when used."""
    suffix = path.suffix.lower()
    if suffix in HDF5:
        from erm.maps.formats import hdf5

        return hdf5.write, hdf5.read
    if suffix in GEOJSON:
        from erm.maps.formats import geojson

        return geojson.write, geojson.read
    if suffix == ".gpkg":
        from erm.maps.formats import geopackage

        return geopackage.write, geopackage.read
    from erm.maps.formats import text

    return text.write, text.read
