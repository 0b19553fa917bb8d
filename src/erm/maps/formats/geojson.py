"""Environment as GeoJSON: walls are LineStrings, poles Points, arcs LineStrings along the face.

Coordinates are local metres. For an environment with a georeference they are longitude and latitude in WGS 84, as
RFC 7946 requires, of points in the local plane z = 0.
"""

import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from erm.common.atomic import atomic_path
from erm.common.errors import DataError
from erm.geometry.vertical import FloatArray
from erm.maps.arcs import arc_points, circle_through
from erm.maps.features import Shape, read_features
from erm.maps.formats.columns import CENTRE, COVARIANCES, DEFAULTS, ENDS, Columns
from erm.maps.georeference import Georeference, declared_frame, place_in_frame

DIGITS = 11
"""Decimal digits of longitude and latitude [degree]: 1 micrometre."""


def write(columns: Columns, scene: dict[str, Any], path: Path) -> None:
    """Write a FeatureCollection. Numbers that are not finite become null, as JSON has none."""
    frame = Georeference.from_dict(scene["georeference"]) if scene["georeference"] else None
    features = []
    for index, (kind, points) in enumerate(zip(columns["kind"], shapes_of(columns), strict=True)):
        properties = {name: _plain(columns[name][index]) for name in DEFAULTS if name not in CENTRE}
        if kind == "arc":
            properties["centre"] = _placed(np.array([columns[name][index] for name in CENTRE]), frame, path)
        coordinates = _placed(points, frame, path)
        geometry = {"type": "Point", "coordinates": coordinates[0]} if kind == "pole" else None
        geometry = geometry or {"type": "LineString", "coordinates": coordinates}
        features.append({"type": "Feature", "geometry": geometry, "properties": properties})
    text = json.dumps({"type": "FeatureCollection", **scene, "features": features}, indent=1, allow_nan=False)
    with atomic_path(path) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")


def shapes_of(columns: Columns) -> list[FloatArray]:
    """Points (point, 2) of each reflector: two of a wall, one of a pole, many along an arc [m]."""
    ends = np.stack([columns[name] for name in ENDS], axis=-1).astype(float).reshape(-1, 2, 2)
    centres = np.stack([columns[name] for name in CENTRE], axis=-1).astype(float)
    return [
        own[:1] if kind == "pole" else arc_points(own, centre, radius) if kind == "arc" else own
        for own, kind, centre, radius in zip(ends, columns["kind"], centres, columns["radius"], strict=True)
    ]


def _placed(points: FloatArray, frame: Georeference | None, path: Path) -> list[Any]:
    """Points in the coordinates of the file."""
    if frame is not None:
        try:
            points = np.round(frame.to_geodetic(points)[..., :2], DIGITS)
        except DataError as error:
            raise DataError(f"{path}: {error}") from error
    return list(points.tolist())


def read(path: Path) -> tuple[Columns, dict[str, Any]]:
    """Read a file of `write`, or a hand-drawn one. Each segment of a line or of a polygon is a wall."""
    shapes, document = read_features(path, "walls and arcs (LineString) and poles (Point)")
    try:
        crs, frame = declared_frame(document)
        rows = [row for shape in shapes for row in rows_of_shape(shape, crs, frame)]
    except DataError as error:
        raise DataError(f"{path}: {error}") from error
    return table_of_rows(rows), document


def rows_of_shape(shape: Shape, crs: str | None, frame: Georeference | None) -> list[dict[str, Any]]:
    """Rows of the reflectors of one shape: a point is a pole, each segment of a line or ring is a wall.

    A line of the kind ``arc`` is one reflector; without ``centre`` its circle is that through its points.
    """
    points = place_in_frame(shape.points, crs, frame).tolist()
    row = dict(shape.properties)
    if len(points) == 1:
        row.setdefault("kind", "pole")
        points *= 2
    elif row.get("kind") == "arc":
        return [_arc(points, row, crs, frame)]
    elif len(points) > 2:  # several walls cannot have one normal
        row = {name: value for name, value in row.items() if name not in ("normal", "offset", *COVARIANCES)}
    return [row | dict(zip(ENDS, [*first, *second], strict=True)) for first, second in pairwise(points)]


def _arc(points: list[list[float]], row: dict[str, Any], crs: str | None, frame: Georeference | None) -> dict[str, Any]:
    """Row of an arc, from its first to its last point counter-clockwise."""
    through, size, ahead = circle_through(points)
    given = row.pop("centre", None)
    if given is None and all(np.isfinite(row.get(name, np.nan)) for name in CENTRE):
        centre = np.array([row[name] for name in CENTRE], dtype=float)
    elif given is None:
        centre = through
        row["radius"] = np.copysign(size, row.get("radius") or size)
    else:
        try:
            centre = place_in_frame(np.array(given, dtype=float).reshape(1, 2), crs, frame)[0]
        except (TypeError, ValueError):
            raise DataError(f"centre of an arc is {given!r}; expected two numbers") from None
    ends = (points[0], points[-1]) if ahead else (points[-1], points[0])
    return row | dict(zip((*ENDS, *CENTRE), [*ends[0], *ends[1], *centre.tolist()], strict=True))


def table_of_rows(rows: list[dict[str, Any]]) -> Columns:
    """Columns of rows; missing values get their defaults."""
    columns: Columns = {name: np.array([row[name] for row in rows], dtype=float) for name in ENDS}
    for name in DEFAULTS:
        if any(name in row for row in rows):
            columns[name] = np.array([row.get(name, DEFAULTS[name]) for row in rows], dtype=object)
    return columns


def _plain(value: Any) -> Any:
    plain = value.item()
    return plain if isinstance(plain, (str, int)) or np.isfinite(plain) else None
