"""Environment as GeoJSON: walls are LineStrings, poles Points.

Coordinates are local metres. For an environment with a georeference they are longitude and latitude in WGS 84, as
RFC 7946 requires, of points in the local plane z = 0.
"""

import json
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from erm.common.errors import DataError
from erm.common.storage import atomic_path
from erm.maps.formats.columns import COVARIANCES, DEFAULTS, ENDS, Columns
from erm.maps.georeference import Georeference, declared_frame

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
    """Read a file of `write`, or a hand-drawn one. A LineString of many points becomes several walls."""
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (UnicodeDecodeError, json.JSONDecodeError) as error:
        raise DataError(f"{path}: not GeoJSON ({error}); expected a FeatureCollection") from error
    if not isinstance(document, dict) or document.get("type") != "FeatureCollection":
        raise DataError(f"{path}: not a GeoJSON FeatureCollection of walls (LineString) and poles (Point)")
    features = document.get("features", [])
    if not isinstance(features, list):
        raise DataError(f"{path}: features is not a list; expected walls (LineString) and poles (Point)")
    rows: list[dict[str, Any]] = []
    for index, feature in enumerate(features):
        try:
            shape = feature["geometry"]
            rows += rows_of_shape(shape["type"], shape["coordinates"], feature.get("properties") or {})
        except (TypeError, ValueError, KeyError, AttributeError) as error:
            raise DataError(f"{path}: feature {index} is neither a LineString nor a Point ({error!r})") from error
    columns = table_of_rows(rows)
    geodetic, frame = declared_frame(document)
    if frame:
        local = frame.to_local(np.stack([columns[name] for name in ENDS], axis=-1).reshape(-1, 2, 2))[..., :2]
        columns |= dict(zip(ENDS, local.reshape(-1, 4).T, strict=True))
    elif geodetic:
        raise DataError(f"{path}: is in WGS 84 without a local origin; add the member georeference beside features")
    return columns, document


def rows_of_shape(kind: str, points: list[list[float]], properties: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Rows of the reflectors of one shape: a Point is a pole, each segment of a LineString is a wall."""
    row = dict(properties)
    if kind == "Point":
        # coordinates of a Point are numbers, those of a LineString are lists; the type does not say which
        points = [points, points] if np.isscalar(points[0]) else [*points, *points]  # type: ignore[list-item]
        row.setdefault("kind", "pole")
    elif kind != "LineString" or len(points) < 2:
        raise ValueError(kind)
    if len(points) > 2:  # several walls cannot have one normal
        row = {name: value for name, value in row.items() if name not in ("normal", "offset", *COVARIANCES)}
    ends = [[*first[:2], *second[:2]] for first, second in pairwise(points)]
    return [row | dict(zip(ENDS, map(float, four), strict=True)) for four in ends]


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
