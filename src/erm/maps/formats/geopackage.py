"""Environment as GeoPackage for GIS programs, a layer for each kind of thing; needs the extra ``gis``."""

import json
import warnings
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from erm.common.atomic import atomic_path
from erm.common.errors import DataError
from erm.common.gate.geopackage import require_geopackage
from erm.common.gate.nesting import parse_json
from erm.common.messages import note
from erm.common.optional import require_library
from erm.common.printable import printable
from erm.maps.features import Shape, points_of
from erm.maps.formats.antennas import Points, antenna_points, reflection_points
from erm.maps.formats.columns import DEFAULTS, Columns
from erm.maps.formats.geojson import rows_of_shape, shapes_of, table_of_rows
from erm.maps.georeference import Georeference, place_in_system

if TYPE_CHECKING:
    import xarray as xr

LAYERS: Mapping[str, str] = {"walls": "wall", "poles": "pole", "arcs": "arc"}
"""Layers of reflectors, and the kind that each holds."""
NUMBER = "reflector"
"""Field of a reflector's number in the map."""
LOCAL_METRES = 'LOCAL_CS["local metres",UNIT["metre",1],AXIS["east",EAST],AXIS["north",NORTH]]'
"""Coordinate system without a place on earth; without any, GIS programs would guess one."""
WGS84 = "EPSG:4326"
"""WGS 84; GeoPackages hold longitude before latitude whatever the definition of the system says."""


def write(
    columns: Columns,
    scene: dict[str, Any],
    path: Path,
    *,
    mpcs: "xr.Dataset | None" = None,
    positions: "xr.Dataset | None" = None,
    crs: str | None = None,
) -> None:
    """Write the layers ``walls``, ``poles``, ``arcs``, ``reflection_points``, ``tx`` and ``rx``; only the first may be
    empty. Ground, ceiling, materials and origin are metadata of ``walls``.

    Coordinates are in ``crs`` (default: WGS 84) where the scene has an origin, and local metres where it has none.
    """
    import shapely

    frame = Georeference.from_dict(scene["georeference"]) if scene["georeference"] else None
    system = (crs or WGS84) if frame else None
    shapes, numbers = shapes_of(columns), np.arange(len(columns["kind"]))
    layers: dict[str, Points] = {}
    for layer, kind in LAYERS.items():
        rows = np.flatnonzero(columns["kind"] == kind)
        fields = {NUMBER: numbers[rows]} | {name: columns[name][rows] for name in DEFAULTS}
        layers[layer] = Points([shapes[row] for row in rows], fields)
    layers |= reflection_points(mpcs) | antenna_points(mpcs, positions)
    with atomic_path(path) as temporary:
        for layer, content in layers.items():
            if not len(content.places) and layer != "walls":
                continue
            placed = [place_in_system(points, system, frame) for points in content.places]
            metadata = {"environment": json.dumps(scene, allow_nan=False)} if layer == "walls" else None
            shape = shapely.Point if layer not in ("walls", "arcs") else shapely.LineString
            geometry = [shape(points) for points in placed]
            _write_layer(path, temporary, layer, geometry, content.fields, system or LOCAL_METRES, metadata)


def _write_layer(
    path: Path,
    temporary: Path,
    layer: str,
    shapes: list[Any],
    fields: Mapping[str, np.ndarray],
    crs: str,
    metadata: dict[str, str] | None,
) -> None:
    """Add a layer; GDAL raises errors of many types where it could not write everything, or prints them only."""
    pyogrio = library(path)
    try:
        pyogrio.raw.write(
            temporary,
            geometry=np.array([shape.wkb for shape in shapes], dtype=object),
            field_data=[column.astype(object) if column.dtype.kind == "U" else column for column in fields.values()],
            fields=np.array(list(fields)),
            layer=layer,
            driver="GPKG",
            geometry_type="Point" if layer not in ("walls", "arcs") else "LineString",
            crs=crs,
            layer_metadata=metadata,
        )
        there = pyogrio.read_info(temporary, layer=layer)["features"]
    except Exception as error:
        raise DataError(f"{path}: cannot be written ({error}); is the disk full?") from None
    if there != len(shapes):
        raise DataError(f"{path}: {there} of {len(shapes)} features of {layer} could be written; is the disk full?")


def read(path: Path) -> tuple[Columns, dict[str, Any]]:
    """Read a file of `write`, or the first layer of any other file. What GDAL finds odd about it is said in a note."""
    library(path)
    require_geopackage(path)
    with warnings.catch_warnings(record=True) as odd:
        warnings.simplefilter("always")
        try:
            rows, scene = _read(path)
        except DataError:
            raise
        except Exception as error:  # GDAL, GEOS and what is damaged raise errors of many types
            raise DataError(f"{path}: not a GeoPackage of reflectors ({error})") from error
    for text in dict.fromkeys(str(each.message) for each in odd):
        note(f"note: {path}: {printable(text)}")
    rows.sort(key=_number)  # as in the map; drawn ones come last
    return table_of_rows(rows), scene


def _read(path: Path) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Rows of all reflectors, and the scene."""
    rows: list[dict[str, Any]] = []
    scene: dict[str, Any] = {}
    for layer in _layers(path):
        crs, shapes, found = _read_layer(path, layer)
        scene |= found
        place = scene.get("georeference")
        frame = None if place is None else Georeference.from_dict(place)
        for shape in shapes:
            rows += rows_of_shape(shape, crs, frame)
    return rows, scene


def _number(row: Mapping[str, Any]) -> float:
    number = row.get(NUMBER)
    return float(number) if isinstance(number, (int, float, np.number)) and np.isfinite(number) else np.inf


def _layers(path: Path) -> list[str]:
    """Layers that hold reflectors."""
    names = [str(name) for name, _ in library(path).list_layers(path)]
    return [layer for layer in LAYERS if layer in names] if "walls" in names else names[:1]


def _read_layer(path: Path, layer: str) -> tuple[str | None, list[Shape], dict[str, Any]]:
    """Coordinate system, shapes, and the scene that the metadata hold."""
    import shapely

    pyogrio = library(path)
    facts = pyogrio.read_info(path, layer=layer)
    meta, _, geometries, fields = pyogrio.raw.read(path, layer=layer)
    shapes = []
    for index, shape in enumerate(shapely.from_wkb(geometries)):
        if shape is not None and not shape.is_empty:
            properties = {name: column[index] for name, column in zip(meta["fields"], fields, strict=True)}
            shapes += [Shape(points, properties) for points in points_of(json.loads(shapely.to_geojson(shape)))]
    return meta["crs"], shapes, dict(parse_json((facts.get("layer_metadata") or {}).get("environment", "{}")))


def library(path: Path) -> ModuleType:
    """Import pyogrio, or raise a DataError that says how to install it."""
    require_library("pyogrio.raw", "gis", f"{path}: GeoPackage", "choose .geojson")
    return require_library("pyogrio", "gis", f"{path}: GeoPackage", "choose .geojson")
