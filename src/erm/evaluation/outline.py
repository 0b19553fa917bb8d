"""Evaluation with a known outline: errors of reflection points and of walls.

The letter's ``D_Error`` is the distance to the line of the face. It does not contain errors along the face, which an
azimuth error makes. The distance to the face itself and, where the true points are known, the full error are given
too. RMSE is the root of the mean square; the letter's "RMSE" is the standard deviation.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from erm.geometry.vertical import FloatArray, angle_difference, azimuth_of, reflection_point
from erm.maps.environment import Environment
from erm.maps.outline import faces_of_map
from erm.mpcs.table import path_length

if TYPE_CHECKING:
    import xarray as xr

MATCH_DISTANCE, MATCH_ANGLE = 1.0, 10.0
"""A wall within this distance and angle of a face is a match [m], [degree]; chosen."""
MATCH_SPACING = 0.5
"""Spacing of the samples of a wall for matching, and of an outline for completeness [m]; chosen."""
COVER_DISTANCE = 0.25
"""A face covers the parts of a wall within this distance [m]; chosen."""
COVER_SPACING = 0.05
"""Spacing of the samples of a wall for covered lengths [m]; chosen."""


class PointErrors(NamedTuple):
    """Errors (point,) of reflection points."""

    face: npt.NDArray[np.int64]
    """Index of the nearest outline segment."""
    distance: FloatArray
    """Distance to this segment [m]."""
    perpendicular: FloatArray
    """Distance to the infinite line of this segment [m]."""
    full: FloatArray | None
    """Distance to the true point [m]."""


def point_errors(points: npt.ArrayLike, outline: FloatArray, true_points: npt.ArrayLike | None = None) -> PointErrors:
    """Errors of reflection points against an outline.

    Parameters
    ----------
    points : array (point, 2 or more)
        Reflection points, east/north [m].
    outline : array (segment, 2 ends, 2)
        Known faces, at least one [m].
    true_points : array (point, 2 or more), optional
        True reflection points [m].
    """
    xy = np.asarray(points, dtype=float)[..., :2].reshape(-1, 2)
    start, along = outline[:, 0], outline[:, 1] - outline[:, 0]
    length = np.linalg.norm(along, axis=-1)
    direction = along / length[:, None]
    offset = xy[:, None] - start
    reach = np.sum(offset * direction, axis=-1)
    across = np.abs(offset[..., 0] * direction[:, 1] - offset[..., 1] * direction[:, 0])
    beyond = reach - np.clip(reach, 0, length)
    distance = np.hypot(across, beyond)
    face = np.argmin(distance, axis=-1) if len(xy) else np.empty(0, dtype=np.int64)
    rows = np.arange(len(xy))
    full = None
    if true_points is not None:
        truth = np.asarray(true_points, dtype=float)[..., :2].reshape(-1, 2)
        full = np.linalg.norm(xy - truth, axis=-1)
    return PointErrors(face, distance[rows, face], across[rows, face], full)


def summary(errors: npt.ArrayLike) -> dict[str, float]:
    """``count``, ``min``, ``max``, ``mean``, ``median``, ``std`` and ``rmse`` of errors; NaN if there are no errors.

    ``std`` is the population standard deviation, so ``rmse**2 = mean**2 + std**2``.
    """
    errors = np.asarray(errors, dtype=float)
    if errors.size == 0:
        return {"count": 0} | dict.fromkeys(("min", "max", "mean", "median", "std", "rmse"), float("nan"))
    return {
        "count": int(errors.size),
        "min": float(errors.min()),
        "max": float(errors.max()),
        "mean": float(errors.mean()),
        "median": float(np.median(errors)),
        "std": float(errors.std()),
        "rmse": float(np.sqrt(np.mean(errors**2))),
    }


def evaluate_points(
    points: npt.ArrayLike, outline: FloatArray, true_points: npt.ArrayLike | None = None
) -> dict[str, dict[str, float]]:
    """Summaries of `point_errors`: ``perpendicular``, ``distance`` and, with ``true_points``, ``full``."""
    errors = point_errors(points, outline, true_points)
    result = {"perpendicular": summary(errors.perpendicular), "distance": summary(errors.distance)}
    return result if errors.full is None else result | {"full": summary(errors.full[np.isfinite(errors.full)])}


def evaluate_mpcs(
    located: "xr.Dataset", environment: Environment, outline: FloatArray
) -> dict[str, dict[str, dict[str, float]]]:
    """Errors of the reflection points of a map, for three ways to compute the points.

    Parameters
    ----------
    located, environment : xarray.Dataset, Environment
        Table and map of `erm.reconstruct`.
    outline : array (segment, 2 ends, 2)
        Known faces [m].

    Returns
    -------
    dict
        ``single``: the point of each path alone; ``merged``: the point on the wall of all paths; ``planar``: the
        letter's equations, which use the slant length. Each has summaries (`summary`) of errors [m] ``perpendicular``
        to the line of the face, ``distance`` to the face, and ``full`` to the point where the face reflects the path
        (`specular_points`).

    Examples
    --------
    >>> import erm
    >>> import xarray as xr
    >>> street = erm.Environment.walls([[[-60, 10], [60, 10]]], top=40.0)
    >>> links = [erm.predict(street, (0, 0, 9), (x, -4, 2), 132e9) for x in (10, 14, 18, 22)]
    >>> environment, located = erm.reconstruct(erm.select(xr.concat(links, dim="mpc")))
    >>> errors = erm.evaluate_mpcs(located, environment, street.reflectors["end_points"].values)
    >>> {kind: round(errors[kind]["perpendicular"]["rmse"], 2) for kind in errors}
    {'single': 0.0, 'merged': 0.0, 'planar': 0.5}
    """
    kept = on_walls(located, environment)
    path = (kept["tx_position"].values, kept["rx_position"].values, path_length(kept), kept["azimuth"].values)
    planar, _ = reflection_point(*path, planar=True)
    points = {"single": kept["reflection_point"].values, "merged": kept["wall_point"].values, "planar": planar}
    true = specular_points(*path[:2], outline[point_errors(points["merged"], outline).face])
    return {kind: evaluate_points(value, outline, true) for kind, value in points.items()}


def specular_points(tx: FloatArray, rx: FloatArray, faces: FloatArray) -> FloatArray:
    """Points (path, 2) where the infinite lines of faces reflect paths [m]; NaN if the antennas are on different sides.

    Parameters
    ----------
    tx, rx : array (path, 2 or more)
        Positions of the antennas [m].
    faces : array (path, 2 ends, 2)
        Face of each path [m].
    """
    along = faces[:, 1] - faces[:, 0]
    n = np.stack([-along[:, 1], along[:, 0]], axis=-1) / np.linalg.norm(along, axis=-1)[:, None]
    behind, before = (np.sum((end[:, :2] - faces[:, 0]) * n, axis=-1) for end in (tx, rx))
    share = np.where(behind * before > 0, before, np.nan) / np.where(behind * before > 0, behind + before, 1.0)
    image = tx[:, :2] - 2 * behind[:, None] * n
    return rx[:, :2] + share[:, None] * (image - rx[:, :2])


def on_walls(located: "xr.Dataset", environment: Environment) -> "xr.Dataset":
    """MPCs of `erm.reconstruct` that walls reflected: the accepted ones without those of poles."""
    is_wall = np.r_[environment.reflectors["kind"].values == "wall", False]  # the last is for index -1, no wall
    return located.isel(mpc=np.flatnonzero(is_wall[located["wall"].values]))


def evaluate_walls(
    environment: Environment, outline: FloatArray, hits: npt.ArrayLike | None = None, *, min_hits: int = 3
) -> dict[str, Any]:
    """Match the walls and arcs of a map to the faces of an outline; in what follows an arc is a wall, too.

    A wall is sampled every `MATCH_SPACING`. A sample matches the nearest face that is parallel to the wall within
    `MATCH_ANGLE`, if it is within `MATCH_DISTANCE`. A wall is false unless more than half of its samples match a face.
    Faces that samples of the other walls match are found.

    Parameters
    ----------
    environment : Environment
        The map.
    outline : array (segment, 2 ends, 2)
        Known faces [m].
    hits : array (segment,), optional
        Number of paths that each face reflected. If given, ``found`` and ``missed`` count only faces with at least
        ``min_hits`` paths; no method can find the others.

    Returns
    -------
    dict
        Numbers of ``walls`` in the map, of ``false`` ones among these, and of ``found`` and ``missed`` faces;
        ``completeness``, the share of the length of the outline that has a wall, and ``correctness``, the share of the
        length of the walls that lies on a face (`covered_share`); summaries ``angle_error`` [degree] and
        ``offset_error`` [m] of the true walls; ``matches``, the face of each wall, -1 for a false one. The offset error
        is the distance of the middle of a wall from the line of its face. Errors are those of straight walls.

    Examples
    --------
    >>> import erm
    >>> import numpy as np
    >>> outline = np.array([[[-60.0, 0.0], [60.0, 0.0]], [[-60.0, 20.0], [60.0, 20.0]]])
    >>> environment = erm.Environment.walls([[[-30, 0.1], [30, 0.1]], [[70, -5], [70, 5]]])
    >>> result = erm.evaluate_walls(environment, outline)
    >>> {name: result[name] for name in ("walls", "false", "found", "missed", "matches")}
    {'walls': 2, 'false': 1, 'found': 1, 'missed': 1, 'matches': [0, -1]}
    """
    walls = faces_of_map(environment)
    segments = np.concatenate([np.empty((0, 2, 2)), *walls])
    matches: list[int] = []
    angles: list[float] = []
    offsets: list[float] = []
    seen = np.zeros(len(outline), dtype=bool)
    for wall in walls:
        parts = [nearest_parallel_faces(segment, outline, MATCH_SPACING) for segment in wall]
        faces, distances = (np.concatenate([part[i] for part in parts]) for i in (0, 1))
        on_face = faces[distances < MATCH_DISTANCE]
        if 2 * len(on_face) <= len(faces):
            matches.append(-1)
            continue
        seen[on_face] = True
        main = int(np.bincount(on_face).argmax())
        matches.append(main)
        if len(wall) == 1:
            angles.append(float(parts[0][2][main]))
            middle = point_errors([wall[0].mean(axis=0)], outline[main : main + 1])
            offsets.append(float(middle.perpendicular[0]))
    wanted = np.ones(len(outline), dtype=bool) if hits is None else np.asarray(hits) >= min_hits
    return {
        "walls": len(walls),
        "false": matches.count(-1),
        "found": int(np.sum(seen & wanted)),
        "missed": int(np.sum(~seen & wanted)),
        "completeness": covered_share(outline[wanted], segments),
        "correctness": covered_share(segments, outline),
        "angle_error": summary(angles),
        "offset_error": summary(offsets),
        "matches": matches,
    }


def covered_share(segments: FloatArray, others: FloatArray) -> float:
    """Share of the length of segments that has a parallel segment of ``others`` within `COVER_DISTANCE`.

    For the walls of a map and an outline it is the correctness of the map; for the outline and the walls it is the
    completeness. NaN if the length is 0.

    Parameters
    ----------
    segments, others : array (segment, 2 ends, 2)
        [m].
    """
    covered = total = 0.0
    for segment in segments:
        length = float(np.linalg.norm(segment[1] - segment[0]))
        covered += length * float(np.mean(covered_samples(segment, others, COVER_SPACING)))
        total += length
    return covered / total if total else float("nan")


def covered_samples(segment: FloatArray, others: FloatArray, step: float) -> npt.NDArray[np.bool_]:
    """Whether each sample of a segment, every ``step`` [m], has a parallel segment within `COVER_DISTANCE`."""
    return nearest_parallel_faces(segment, others, step)[1] < COVER_DISTANCE


def face_hits(points: npt.ArrayLike, outline: FloatArray, tolerance: float = 0.05) -> npt.NDArray[np.int64]:
    """Number (segment,) of true reflection points on each face of an outline."""
    errors = point_errors(points, outline)
    return np.bincount(errors.face[errors.distance <= tolerance], minlength=len(outline))


def rounded(result: Mapping[str, Any], digits: int = 4) -> dict[str, Any]:
    """Round the numbers of a nested result for JSON; NaN becomes None, named tuples become dictionaries."""

    def plain(value: Any) -> Any:
        if hasattr(value, "_asdict"):
            value = value._asdict()
        if isinstance(value, Mapping):
            return {key: plain(entry) for key, entry in value.items()}
        if isinstance(value, list):
            return [plain(entry) for entry in value]
        if isinstance(value, float):
            return round(value, digits) if np.isfinite(value) else None
        return value

    return {key: plain(value) for key, value in result.items()}


def nearest_parallel_faces(
    wall: FloatArray, outline: FloatArray, step: float
) -> tuple[npt.NDArray[np.int64], FloatArray, FloatArray]:
    """Nearest parallel face of each sample of a wall, and its distance [m]; angle (face,) to the wall [degree]."""
    length = float(np.linalg.norm(wall[1] - wall[0]))
    count = max(1, round(length / step))
    share = (np.arange(count) + 0.5) / count
    samples = wall[0] + share[:, None] * (wall[1] - wall[0])
    own, theirs = azimuth_of(wall[1] - wall[0]), azimuth_of(outline[:, 1] - outline[:, 0])
    angle = np.abs(angle_difference(2 * theirs, 2 * own)) / 2  # lines have no direction
    parallel = np.flatnonzero(angle < MATCH_ANGLE)
    if len(parallel) == 0:
        return np.zeros(len(samples), dtype=np.int64), np.full(len(samples), np.inf), angle
    errors = point_errors(samples, outline[parallel])
    return parallel[errors.face], errors.distance, angle
