"""Maps on disk. Each format is one module; the suffix of the file chooses it."""

from collections.abc import Callable
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any

from erm.common.errors import DataError, OptionError
from erm.common.gate.files import require_file
from erm.common.outputs import require_suffix

if TYPE_CHECKING:
    import xarray as xr

    from erm.maps.environment import Environment
    from erm.maps.formats.columns import Columns

Writer = Callable[["Columns", dict[str, Any], Path], None]
Reader = Callable[[Path], tuple["Columns", dict[str, Any]]]


HDF5, GEOJSON = (".h5", ".hdf5", ".nc"), (".geojson", ".json")
MAPS = (*HDF5, *GEOJSON, ".gpkg", ".csv")
"""Suffixes of the formats that are written and read."""
PLACED = (".gpkg", ".dxf")
"""Suffixes of the formats whose coordinates may be in a projected system."""
DRAWINGS = (".dxf", ".obj", ".ply", ".xml")
"""Suffixes of the formats that are only written. They hold shapes without errors and support."""
DRAWING_HEIGHT, DRAWING_MARGIN, DRAWING_FREQUENCY = 30.0, 50.0, 132e9
"""Defaults of `write_map` for drawings [m], [m], [Hz]; heights and margins are chosen."""


def write_map(
    environment: "Environment",
    path: Path | str,
    *,
    mpcs: "xr.Dataset | None" = None,
    positions: "xr.Dataset | None" = None,
    height: float = DRAWING_HEIGHT,
    margin: float = DRAWING_MARGIN,
    frequency: float = DRAWING_FREQUENCY,
    scattering: float = 0.0,
    crs: str | None = None,
) -> None:
    """Write a map in the format of the suffix. The file is written completely or not at all.

    Maps can be read again: .h5, .geojson, .gpkg and .csv. Drawings cannot: .dxf, .ply, .obj and .xml (a scene for
    Mitsuba and Sionna RT, with its meshes beside it).

    Parameters
    ----------
    environment : Environment
        The map.
    path : path
        The file.
    mpcs : xarray.Dataset, optional
        MPCs that the map was made from. HDF5 keeps them in the group ``/mpc``; GeoPackage has layers of their
        reflection points and antennas; other formats do not keep them.
    positions : xarray.Dataset, optional
        Positions without the errors of the survey. HDF5 keeps them in the group ``/positions``, GeoPackage in the
        layer ``rx``.
    height, margin : float
        Drawings only. Walls without upper end are cut at this height above the ground; ground and ceiling extend
        by this margin beyond the walls [m]. See `erm.maps.formats.surfaces.extrude`.
    frequency : float
        Only .xml: materials that the ray tracer does not know are evaluated at this frequency [Hz].
    scattering : float
        Only .xml: scattering coefficient, 0 to 1, of faces whose roughness is not known. See
        `erm.maps.formats.mitsuba.constants`.
    crs : str, optional
        Only .gpkg and .dxf of an environment with an origin: coordinate system, by a name or code that PROJ knows,
        such as "EPSG:25832" or "ETRS89 / UTM zone 32N". Default: WGS 84 for .gpkg, local metres for .dxf.

    Raises
    ------
    DataError
        The suffix names no format, the folder is not writable, or an optional library is missing.
    OptionError
        The format cannot be in a coordinate system of its own, the system is not known, or there is no origin.

    Examples
    --------
    >>> import erm
    >>> from tempfile import TemporaryDirectory
    >>> street = erm.Environment.walls([[[-60, 10], [60, 10]]], top=20.0)
    >>> with TemporaryDirectory() as folder:
    ...     erm.write_map(street, f"{folder}/street.geojson")
    ...     erm.write_map(street, f"{folder}/street.obj", margin=10.0)  # a drawing
    """
    from erm.maps.formats.columns import to_columns, to_scene

    path = Path(path)
    require_format(path)
    if crs is not None:
        crs = _known_system(path, crs, environment)
    if path.suffix.lower() in DRAWINGS:
        _draw(environment, path, height, margin, frequency, scattering, crs)
        return
    columns, scene = to_columns(environment.reflectors), to_scene(environment)
    if path.suffix.lower() in HDF5:
        from erm.maps.formats import hdf5

        hdf5.write(columns, scene, path, {"/mpc": mpcs, "/positions": positions})
        return
    if path.suffix.lower() == ".gpkg":
        from erm.maps.formats import geopackage

        geopackage.write(columns, scene, path, mpcs=mpcs, positions=positions, crs=crs)
        return
    write, _ = _format_of(path)
    write(columns, scene, path)


def read_map(path: Path | str) -> "Environment":
    """Read a map in the format of the suffix: one of `write_map`, or a hand-drawn file with fewer columns.

    Parameters
    ----------
    path : path
        A .h5, .geojson, .gpkg or .csv file.

    Raises
    ------
    DataError
        The file is missing, is not what its suffix says, or breaks a rule of environments.

    Examples
    --------
    >>> import erm
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     erm.write_map(erm.Environment.walls([[[-60, 10], [60, 10]]]), f"{folder}/street.csv")
    ...     environment = erm.read_map(f"{folder}/street.csv")
    >>> environment.reflectors["end_points"].values.tolist()
    [[[-60.0, 10.0], [60.0, 10.0]]]
    """
    from erm.maps.formats.columns import to_environment

    path = Path(path)
    require_file(path)
    suffix = path.suffix.lower()
    if suffix in DRAWINGS:
        raise DataError(f"{path}: drawings cannot be read; give the map that the drawing was made from")
    if suffix not in MAPS:
        raise DataError(f"{path}: unknown format {suffix!r}; expected a map: {', '.join(MAPS)}")
    _, read = _format_of(path)
    try:
        return to_environment(*read(path))
    except DataError as error:
        text = str(error)
        raise error if text.startswith(str(path)) else DataError(f"{path}: {text}") from error


def require_format(path: Path) -> None:
    """Refuse a file that `write_map` cannot write. Call it before anything is computed.

    Raises
    ------
    OptionError
        The suffix names no format.
    DataError
        The library of the format is not installed.
    """
    require_suffix(path, *MAPS, *DRAWINGS)
    suffix = path.suffix.lower()
    if suffix == ".dxf":
        from erm.maps.formats import dxf

        dxf.library(path)
    elif suffix == ".gpkg":
        from erm.maps.formats import geopackage

        geopackage.library(path)


def read_measured(path: Path | str) -> "tuple[xr.Dataset | None, xr.Dataset | None]":
    """Read what a map was made from: its MPCs and its positions, as `write_map` takes them; None where it has none.

    Parameters
    ----------
    path : path
        Map; only HDF5 holds them.
    """
    path = Path(path)
    if path.suffix.lower() not in HDF5:
        return None, None
    from erm.maps.formats.hdf5 import read_group

    return read_group(path, "/mpc"), read_group(path, "/positions")


def _known_system(path: Path, crs: str, environment: "Environment") -> str:
    """Code of a coordinate system that the file can be in."""
    from erm.maps.georeference import known_system

    if path.suffix.lower() not in PLACED:
        raise OptionError(f"{path}: coordinates of this format cannot be in {crs}; choose {' or '.join(PLACED)}")
    if environment.georeference is None:
        raise OptionError(f"{path}: the map has no origin, so it cannot be in {crs}; give its latitude and longitude")
    return known_system(crs, metres=path.suffix.lower() == ".dxf")


def _draw(
    environment: "Environment",
    path: Path,
    height: float,
    margin: float,
    frequency: float,
    scattering: float,
    crs: str | None,
) -> None:
    """Write one of the `DRAWINGS`."""
    from erm.maps.formats import dxf, mitsuba, obj, ply
    from erm.maps.formats.surfaces import extrude

    if not (0 < height < inf and 0 < margin < inf):
        raise OptionError(f"{path}: height {height:g} m, margin {margin:g} m; expected positive numbers")
    if not 0 < frequency < inf:
        raise OptionError(f"{path}: frequency {frequency:g} Hz; expected a positive number")
    if not 0 <= scattering < 1:
        raise OptionError(f"{path}: scattering {scattering:g}; expected 0 to less than 1")
    suffix = path.suffix.lower()
    if suffix == ".dxf":
        dxf.write(environment, path, height=height, margin=margin, crs=crs)
        return
    surfaces = extrude(environment, height=height, margin=margin)
    if suffix == ".ply":
        ply.write(surfaces, path)
    elif suffix == ".obj":
        obj.write(surfaces, path)
    else:
        mitsuba.write(surfaces, environment.materials, frequency, path, scattering=scattering)


def _format_of(path: Path) -> tuple[Writer, Reader]:
    """Writer and reader of one of `MAPS`; each format is imported when it is used."""
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
