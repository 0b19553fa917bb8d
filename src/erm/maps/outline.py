"""Known outlines for the evaluation of maps: GeoJSON LineStrings and Polygons, or the walls of a map."""

import json
from collections.abc import Iterator
from itertools import pairwise
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from erm.common.errors import DataError, OptionError
from erm.geometry.vertical import FloatArray
from erm.maps.environment import Environment
from erm.maps.formats import read_map
from erm.maps.georeference import Georeference, declared_frame

MIN_SPAN = 0.1
"""An outline that spans less is taken to be in degrees, where 0.1 is 11 km [m]; chosen."""


def read_outline(
    path: Path | str,
    *,
    z_slice: float | None = None,
    min_visible: float = 0.0,
    georeference: Georeference | None = None,
) -> FloatArray:
    """Read the wall segments of a GeoJSON outline.

    Coordinates are local metres. They are longitude and latitude if the file has a member ``georeference`` or a ``crs``
    that names WGS 84, or if the outline spans less than 0.1.

    Parameters
    ----------
    path : path
        A FeatureCollection, Feature or geometry. Points are ignored.
    z_slice : float, optional
        Use features with this ``z_slice_m`` [m]; default: the lowest of the file. Features without the property are
        always used.
    min_visible : float
        Use a feature only if receivers see more than this share of it (``visible_from_any_rx_frac``). Features without
        the property are always used.
    georeference : Georeference, optional
        Local frame of the map, for outlines in longitude and latitude; default: the frame in the file.

    Returns
    -------
    array (segment, 2 ends, 2)
        East/north [m].

    Raises
    ------
    DataError
        The file is missing or not GeoJSON, no wall is left after the filters, or the outline is in WGS 84 and no origin
        is known.
    """
    path = Path(path)
    if z_slice is not None and not isfinite(z_slice):
        raise OptionError(f"z_slice {z_slice} m; expected a finite number")
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror}); expected a GeoJSON outline") from None
    except ValueError as error:
        raise DataError(f"{path}: not JSON ({error}); expected a GeoJSON outline") from None
    if not isinstance(document, dict) or "type" not in document:
        raise DataError(f"{path}: has no GeoJSON type; expected LineStrings or Polygons")
    features = document.get("features", [document])
    slices = {value for feature in features if (value := _property(feature, "z_slice_m")) is not None}
    level = z_slice if z_slice is not None else min(slices, default=None)
    segments: list[Any] = []
    for feature in features:
        slice_ = _property(feature, "z_slice_m")
        visible = _property(feature, "visible_from_any_rx_frac")
        if (slice_ is None or slice_ == level) and (visible is None or visible > min_visible):
            try:
                segments += [
                    (a[:2], b[:2])
                    for line in _lines(feature.get("geometry", feature))
                    for a, b in pairwise(line)
                    if a[:2] != b[:2]
                ]
            except (KeyError, TypeError, AttributeError) as error:
                raise DataError(f"{path}: a feature is not GeoJSON ({error!r}); expected coordinates") from None
    if not segments:
        known = f"; slices in the file: {sorted(slices)}" if slices else ""
        raise DataError(f"{path}: no LineString or Polygon is left{known}; relax z_slice or min_visible")
    points = np.asarray(segments, dtype=float)
    try:
        geodetic, own = declared_frame(document)
        if not geodetic and np.ptp(points, axis=(0, 1)).max() >= MIN_SPAN:
            return points
        frame = georeference or own
        if frame is None:
            raise DataError(
                "is in degrees and no origin is known; write it in metres, or give the map an origin (erm export)"
            )
        return frame.to_local(points)[..., :2]
    except DataError as error:
        raise DataError(f"{path}: {error}") from error


def known_faces(
    path: Path,
    *,
    z_slice: float | None = None,
    min_visible: float = 0.0,
    georeference: Georeference | None = None,
) -> FloatArray:
    """Read known faces (segment, 2 ends, 2) from an outline or a map, chosen by the suffix [m].

    The options are those of `read_outline`.

    Raises
    ------
    DataError
        The file cannot be read, or holds no wall.
    """
    if path.suffix.lower() in (".geojson", ".json"):
        return read_outline(path, z_slice=z_slice, min_visible=min_visible, georeference=georeference)
    faces = outline_of(read_map(path), georeference)
    if len(faces) == 0:
        raise DataError(f"{path}: holds no wall; expected known faces")
    return faces


def outline_of(environment: Environment, georeference: Georeference | None = None) -> FloatArray:
    """Wall segments (segment, 2 ends, 2) of an environment [m]; poles have none.

    If both ``georeference`` and the environment's own are given, the segments are in the frame of ``georeference``.
    """
    table = environment.reflectors
    ends = table["end_points"].values[table["kind"].values == "wall"]
    own = environment.georeference
    if own and georeference and own != georeference:
        return georeference.to_local(own.to_geodetic(ends))[..., :2]
    return ends


def _property(feature: Any, name: str) -> float | None:
    """Property of a feature; None if it has none."""
    return (feature.get("properties") or {}).get(name) if isinstance(feature, dict) else None


def _lines(geometry: Any) -> Iterator[list]:
    """Coordinates of every line and ring of a geometry."""
    kind = geometry["type"]
    if kind == "LineString":
        yield geometry["coordinates"]
    elif kind in ("MultiLineString", "Polygon"):
        yield from geometry["coordinates"]
    elif kind == "MultiPolygon":
        for polygon in geometry["coordinates"]:
            yield from polygon
    elif kind == "GeometryCollection":
        for part in geometry["geometries"]:
            yield from _lines(part)
