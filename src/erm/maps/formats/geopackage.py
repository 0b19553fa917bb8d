"""Environment as GeoPackage for GIS programs, in local metres; needs the extra ``gis``."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from erm.common.errors import DataError
from erm.common.gate.geopackage import require_geopackage
from erm.common.gate.nesting import parse_json
from erm.common.optional import require_library
from erm.common.storage import atomic_path
from erm.maps.features import Shape, points_of
from erm.maps.formats.columns import DEFAULTS, Columns
from erm.maps.formats.geojson import rows_of_shape, shapes_of, table_of_rows
from erm.maps.georeference import Georeference

LAYER = "reflectors"
LOCAL_METRES = 'LOCAL_CS["local metres",UNIT["metre",1],AXIS["east",EAST],AXIS["north",NORTH]]'
"""Coordinate system without a place on earth; without any, GIS programs would guess one."""


def write(columns: Columns, scene: dict[str, Any], path: Path) -> None:
    """Write one layer of lines and points. Ground, ceiling and materials are its metadata."""
    pyogrio = library(path)
    import shapely

    shapes = [
        shapely.LineString(points) if len(points) > 1 else shapely.Point(points[0]) for points in shapes_of(columns)
    ]
    fields = [columns[name].astype(object) if columns[name].dtype.kind == "U" else columns[name] for name in DEFAULTS]
    with atomic_path(path) as temporary, _written(path, len(shapes), temporary):
        pyogrio.raw.write(
            temporary,
            geometry=np.array([shape.wkb for shape in shapes], dtype=object),
            field_data=fields,
            fields=np.array(list(DEFAULTS)),
            layer=LAYER,
            driver="GPKG",
            geometry_type="Unknown",
            crs=LOCAL_METRES,
            layer_metadata={"environment": json.dumps(scene, allow_nan=False)},
        )


@contextmanager
def _written(path: Path, count: int, temporary: Path) -> Iterator[None]:
    """Raise an error where GDAL could not write everything; it raises errors of many types, or prints them only."""
    pyogrio = library(path)
    try:
        yield
        there = pyogrio.read_info(temporary, layer=LAYER)["features"]
    except Exception as error:
        raise DataError(f"{path}: cannot be written ({error}); is the disk full?") from None
    if there != count:
        raise DataError(f"{path}: {there} of {count} reflectors could be written; is the disk full?")


def read(path: Path) -> tuple[Columns, dict[str, Any]]:
    """Read a file of `write`, or the first layer of any other file."""
    pyogrio = library(path)
    import shapely

    require_geopackage(path)
    try:
        layers = [str(name) for name, _ in pyogrio.list_layers(path)]
        layer = LAYER if LAYER in layers else layers[0]
        facts = pyogrio.read_info(path, layer=layer)
        meta, _, shapes, fields = pyogrio.raw.read(path, layer=layer)
        scene = dict(parse_json((facts.get("layer_metadata") or {}).get("environment", "{}")))
        geometries = shapely.from_wkb(shapes)
    except Exception as error:  # GDAL, GEOS and what is damaged raise errors of many types
        raise DataError(f"{path}: not a GeoPackage of reflectors ({error})") from error
    rows: list[dict[str, Any]] = []
    place = scene.get("georeference")
    frame = None if place is None else Georeference.from_dict(place)
    for index, shape in enumerate(geometries):
        if shape is None or shape.is_empty:
            continue
        properties = {name: column[index] for name, column in zip(meta["fields"], fields, strict=True)}
        for points in points_of(json.loads(shapely.to_geojson(shape))):
            rows += rows_of_shape(Shape(points, properties), meta["crs"], frame)
    return table_of_rows(rows), scene


def library(path: Path) -> ModuleType:
    """Import pyogrio, or raise a DataError that says how to install it."""
    require_library("pyogrio.raw", "gis", f"{path}: GeoPackage", "choose .geojson")
    return require_library("pyogrio", "gis", f"{path}: GeoPackage", "choose .geojson")
