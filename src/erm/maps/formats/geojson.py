"""Environment as GeoJSON: walls are LineStrings, poles Points.

Coordinates are local metres. For an environment with a georeference they are longitude and latitude in WGS 84, as
RFC 7946 requires, of points in the local plane z = 0.
"""

import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from erm.common.errors import DataError
from erm.common.storage import atomic_path
from erm.maps.features import Shape, read_features
from erm.maps.formats.columns import COVARIANCES, DEFAULTS, ENDS, Columns
from erm.maps.georeference import Georeference, declared_frame, place_in_frame

DIGITS = 11
"""Decimal digits of longitude and latitude [degree]: 1 micrometre."""
SHAPES = {"wall": "LineString", "pole": "Point"}


def write(columns: Columns, scene: dict[str, Any], path: Path) -> None:
    """Write a FeatureCollection. Numbers that are not finite become null, as JSON has none."""
    ends = np.stack([columns[name] for name in ENDS], axis=-1).astype(float).reshape(-1, 2, 2)
    if scene["georeference"]:
        try:
            geodetic = Georeference.from_dict(scene["georeference"]).to_geodetic(ends)
        except DataError as error:
            raise DataError(f"{path}: {error}") from error
        ends = np.round(geodetic[..., :2], DIGITS)
    features = []
    for index, kind in enumerate(columns["kind"]):
        first, second = ends[index].tolist()
        properties = {name: _plain(columns[name][index]) for name in DEFAULTS}
        coordinates = first if kind == "pole" else [first, second]
        geometry = {"type": SHAPES[kind], "coordinates": coordinates}
        features.append({"type": "Feature", "geometry": geometry, "properties": properties})
    text = json.dumps({"type": "FeatureCollection", **scene, "features": features}, indent=1, allow_nan=False)
    with atomic_path(path) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")


def read(path: Path) -> tuple[Columns, dict[str, Any]]:
    """Read a file of `write`, or a hand-drawn one. Each segment of a line or of a polygon is a wall."""
    shapes, document = read_features(path, "walls (LineString) and poles (Point)")
    try:
        crs, frame = declared_frame(document)
        rows = [row for shape in shapes for row in rows_of_shape(shape, crs, frame)]
    except DataError as error:
        raise DataError(f"{path}: {error}") from error
    return table_of_rows(rows), document


def rows_of_shape(shape: Shape, crs: str | None, frame: Georeference | None) -> list[dict[str, Any]]:
    """Rows of the reflectors of one shape: a point is a pole, each segment of a line or ring is a wall."""
    points = place_in_frame(shape.points, crs, frame).tolist()
    row = dict(shape.properties)
    if len(points) == 1:
        row.setdefault("kind", "pole")
        points *= 2
    elif len(points) > 2:  # several walls cannot have one normal
        row = {name: value for name, value in row.items() if name not in ("normal", "offset", *COVARIANCES)}
    return [row | dict(zip(ENDS, [*first, *second], strict=True)) for first, second in pairwise(points)]


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
