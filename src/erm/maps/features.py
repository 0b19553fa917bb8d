"""Features of GeoJSON: points and lines of any geometry, with their properties.

References
----------
RFC 7946, The GeoJSON format, 2016; the member ``crs`` is of its predecessor, the GeoJSON specification of 2008.
"""

from collections.abc import Iterator
from math import isfinite
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from erm.common.errors import DataError
from erm.common.gate.nesting import parse_json
from erm.common.text_files import read_text
from erm.geometry.vertical import FloatArray

PARTS = {"MultiPoint": "Point", "MultiLineString": "LineString", "MultiPolygon": "Polygon"}


class Shape(NamedTuple):
    """A point, a line, or a ring of a polygon."""

    points: FloatArray
    """East and north, or longitude and latitude (point, 2); one point or several."""
    properties: dict[str, Any]
    """Properties of the feature."""


def read_features(path: Path, expected: str) -> tuple[list[Shape], dict[str, Any]]:
    """Read all shapes of a FeatureCollection, a Feature or a geometry. Features without geometry are passed over.

    Parameters
    ----------
    path : Path
    expected : str
        What the file should be, for errors.

    Returns
    -------
    shapes : list of Shape
    document : dict
        The whole file; its members ``georeference`` and ``crs`` tell where the coordinates are.

    Raises
    ------
    DataError
        The file is missing or is not GeoJSON.
    """
    text = read_text(path, expected)
    try:
        document = parse_json(text)
    except ValueError as error:
        raise DataError(f"{path}: not JSON ({error}); expected {expected}") from None
    if not isinstance(document, dict) or "type" not in document:
        raise DataError(f"{path}: has no GeoJSON type; expected {expected}")
    features = document.get("features") if document["type"] == "FeatureCollection" else [document]
    if not isinstance(features, list):
        raise DataError(f"{path}: features is not a list; expected {expected}")
    shapes: list[Shape] = []
    for index, feature in enumerate(features):
        try:
            is_feature = feature["type"] == "Feature"
            geometry = feature["geometry"] if is_feature else feature
            properties = (feature.get("properties") if is_feature else None) or {}
            if geometry is not None:
                shapes += [Shape(points, dict(properties)) for points in points_of(geometry)]
        except (KeyError, TypeError, ValueError, IndexError, AttributeError, OverflowError) as error:
            raise DataError(f"{path}: feature {index} is not GeoJSON ({error}); expected {expected}") from None
    return shapes, document


def points_of(geometry: dict[str, Any]) -> Iterator[FloatArray]:
    """Points (point, 2) of every point, line and ring of a geometry.

    Raises
    ------
    ValueError, TypeError, KeyError
        It is no geometry, or a position does not have two finite numbers.

    Examples
    --------
    >>> [ring.tolist() for ring in points_of({"type": "Polygon", "coordinates": [[[0, 0], [4, 0], [0, 3], [0, 0]]]})]
    [[[0.0, 0.0], [4.0, 0.0], [0.0, 3.0], [0.0, 0.0]]]
    """
    kind = geometry["type"]
    if kind == "GeometryCollection":
        for part in geometry["geometries"]:
            yield from points_of(part)
        return
    parts = geometry["coordinates"] if kind in PARTS else [geometry["coordinates"]]
    for part in parts:
        match PARTS.get(kind, kind):
            case "Point":
                yield _positions([part])
            case "LineString":
                yield _positions(part)
            case "Polygon":
                yield from map(_positions, part)
            case _:
                raise ValueError(f"type {kind}")


def number(properties: dict[str, Any], name: str) -> float | None:
    """Property that is a number, also one written as text; None if there is none.

    Raises
    ------
    DataError
        The property is something else.
    """
    value = properties.get(name)
    if value is None or value == "":
        return None
    try:
        return float(value)
    except (TypeError, ValueError):
        raise DataError(f"property {name} is {value!r}; expected a number") from None


def _positions(positions: list[Any]) -> FloatArray:
    points = [[float(value) for value in position[:2]] for position in positions]
    if not points or any(len(point) != 2 or not all(map(isfinite, point)) for point in points):
        raise ValueError("a position does not have two finite numbers")
    return np.array(points)
