"""Known outlines for the evaluation of maps: GeoJSON LineStrings and Polygons, or the walls of a map."""

from itertools import pairwise
from math import isfinite
from pathlib import Path

import numpy as np

from erm.common.constants import FARTHEST
from erm.common.errors import DataError, OptionError
from erm.geometry.vertical import FloatArray
from erm.maps.arcs import arc_points
from erm.maps.environment import Environment
from erm.maps.features import number, read_features
from erm.maps.formats import read_map
from erm.maps.georeference import WGS84, Georeference, declared_frame, place_in_frame

MIN_SPAN = 0.1
"""An outline that spans less is taken to be in degrees, where 0.1 is 11 km [m]; chosen."""


MAX_FACES = 100_000
"""Most known faces; chosen: all of a city. A map is compared with each of them."""


def read_outline(
    path: Path | str,
    *,
    z_slice: float | None = None,
    min_visible: float = 0.0,
    georeference: Georeference | None = None,
) -> FloatArray:
    """Read the wall segments of a GeoJSON outline.

    Coordinates are local metres. They are longitude and latitude if the file has a member ``georeference``, or if the
    outline spans less than 0.1. A member ``crs`` names any other coordinate system.

    Parameters
    ----------
    path : path
        A FeatureCollection, Feature or geometry. Points and features without geometry are ignored.
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
        The file is missing or not GeoJSON, no wall is left after the filters, or the outline is not in local metres and
        no origin is known.
    """
    path = Path(path)
    if z_slice is not None and not isfinite(z_slice):
        raise OptionError(f"z_slice {z_slice} m; expected a finite number")
    shapes, document = read_features(path, "a GeoJSON outline of LineStrings or Polygons")
    try:
        slices = [number(shape.properties, "z_slice_m") for shape in shapes]
        visible = [number(shape.properties, "visible_from_any_rx_frac") for shape in shapes]
        known = sorted({value for value in slices if value is not None})
        level = z_slice if z_slice is not None else min(known, default=None)
        segments = [
            (first, second)
            for shape, slice_, seen in zip(shapes, slices, visible, strict=True)
            if slice_ in (None, level) and (seen is None or seen > min_visible)
            for first, second in pairwise(shape.points)
            if (first != second).any()
        ]
        if not segments:
            which = f"; slices in the file: {known}" if known else ""
            raise DataError(f"no LineString or Polygon is left{which}; relax z_slice or min_visible")
        points = np.asarray(segments)
        crs, own = declared_frame(document)
        with np.errstate(over="ignore"):
            span = np.ptp(points, axis=(0, 1)).max()
        if crs is None and span < MIN_SPAN:
            crs = WGS84
        placed = place_in_frame(points, crs, georeference or own)
        if not (np.abs(placed) < FARTHEST).all():
            raise DataError(f"a position is {np.abs(placed).max():g} m away, no place on earth")
        return placed
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
        faces = read_outline(path, z_slice=z_slice, min_visible=min_visible, georeference=georeference)
    else:
        faces = outline_of(read_map(path), georeference)
    if not 0 < len(faces) <= MAX_FACES:
        raise DataError(f"{path}: holds {len(faces) or 'no'} walls; expected 1 to {MAX_FACES} known faces near the map")
    return faces


def outline_of(environment: Environment, georeference: Georeference | None = None) -> FloatArray:
    """Segments (segment, 2 ends, 2) of the walls and arcs of an environment [m]; poles have none.

    If both ``georeference`` and the environment's own are given, the segments are in the frame of ``georeference``.
    """
    ends = np.concatenate([np.empty((0, 2, 2)), *faces_of_map(environment)])
    own = environment.georeference
    if own and georeference and own != georeference:
        return georeference.to_local(own.to_geodetic(ends))[..., :2]
    return ends


def faces_of_map(environment: Environment) -> list[FloatArray]:
    """Segments (segment, 2 ends, 2) of each wall, which has one, then of each arc, whose chords they are [m]."""
    table = environment.reflectors
    faces = list(table["end_points"].values[table["kind"].values == "wall"][:, None])
    for row in np.flatnonzero(table["kind"].values == "arc").tolist():
        end_points, centre = table["end_points"].values[row], table["centre"].values[row]
        points = arc_points(end_points, centre, float(table["radius"].values[row]))
        faces.append(np.stack([points[:-1], points[1:]], axis=1))
    return faces
