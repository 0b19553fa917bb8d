"""How good a map is: reflection points and walls against a known outline.

The letter's ``D_Error``, the distance to the face's line, is blind to errors along the face, which an azimuth
error makes; so the distance to the outline itself and, where the true points are known, the full error stand
beside it. RMSE means the root of the mean square; the letter's "RMSE" is the standard deviation.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from erm.geometry.vertical import FloatArray, angle_difference, azimuth_of, reflection_point
from erm.maps.environment import Environment
from erm.maps.outline import outline_of
from erm.mpcs.table import path_length

if TYPE_CHECKING:
    import xarray as xr

FOUND_DISTANCE = 1.0  # m; a wall nearer than this to a face stands for it
FOUND_ANGLE = 10.0  # degree
STEP = 0.5  # m; spacing of the points by which two walls are matched
CLOSE = 0.25  # m; a stretch of wall nearer than this to a face stands where the face does
FINE = 0.05  # m; spacing of the points by which lengths are measured


class PointErrors(NamedTuple):
    """Errors (point,) of reflection points."""

    face: npt.NDArray[np.int64]  # index of the nearest outline segment
    distance: FloatArray  # m, to the nearest point of that segment
    perpendicular: FloatArray  # m, to its line, infinite both ways
    full: FloatArray | None  # m, to the true point


def point_errors(points: npt.ArrayLike, outline: FloatArray, true_points: npt.ArrayLike | None = None) -> PointErrors:
    """Errors of reflection points against an outline.

    Parameters
    ----------
    points : array (point, 2 or more)
        East/north [m].
    outline : array (segment, 2 ends, 2)
        Known faces, at least one [m].
    true_points : array (point, 2 or more), optional
        Where the paths truly bounced [m].
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
    """``count``, ``min``, ``max``, ``mean``, ``median``, ``std`` and ``rmse`` of errors [m]; NaN where there are none.

    ``std`` is the population's, by n, and ``rmse**2 = mean**2 + std**2``.
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
    merged: "xr.Dataset", environment: Environment, outline: FloatArray
) -> dict[str, dict[str, dict[str, float]]]:
    """Judge the accepted reflection points of `erm.reconstruction.reconstruct` three ways.

    Returns
    -------
    dict
        `evaluate_points` of ``single``, the point of each path by itself; ``merged``, where the wall of
        all paths reflects it; ``planar``, by the letter's equations with the slant delay. The true point is where the
        face that the wall stands for reflects the path (`specular_points`).
    """
    kept = on_walls(merged, environment)
    path = (kept["tx_position"].values, kept["rx_position"].values, path_length(kept), kept["azimuth"].values)
    planar, _ = reflection_point(*path, planar=True)
    points = {"single": kept["reflection_point"].values, "merged": kept["wall_point"].values, "planar": planar}
    true = specular_points(*path[:2], outline[point_errors(points["merged"], outline).face])
    return {kind: evaluate_points(value, outline, true) for kind, value in points.items()}


def specular_points(tx: FloatArray, rx: FloatArray, faces: FloatArray) -> FloatArray:
    """Where (path, 2) faces, if they go on, reflect the paths between antennas; NaN if these stand on two sides of one.

    Parameters
    ----------
    tx, rx : array (path, 2 or more)
        [m].
    faces : array (path, 2 ends, 2)
        One for each path [m].
    """
    along = faces[:, 1] - faces[:, 0]
    n = np.stack([-along[:, 1], along[:, 0]], axis=-1) / np.linalg.norm(along, axis=-1)[:, None]
    behind, before = (np.sum((end[:, :2] - faces[:, 0]) * n, axis=-1) for end in (tx, rx))
    share = np.where(behind * before > 0, before, np.nan) / np.where(behind * before > 0, behind + before, 1.0)
    image = tx[:, :2] - 2 * behind[:, None] * n
    return rx[:, :2] + share[:, None] * (image - rx[:, :2])


def on_walls(merged: "xr.Dataset", environment: Environment) -> "xr.Dataset":
    """Components of `erm.reconstruction.reconstruct` that a wall reflected: accepted ones but those off poles."""
    is_wall = np.r_[environment.reflectors["kind"].values == "wall", False]  # the last for index -1, none
    return merged.isel(mpc=np.flatnonzero(is_wall[merged["wall"].values]))


def evaluate_walls(
    environment: Environment, outline: FloatArray, hits: npt.ArrayLike | None = None, *, min_hits: int = 3
) -> dict[str, Any]:
    """Match the walls of a map to the faces of an outline.

    A wall is sampled every ``STEP``. A sample stands for the nearest face that is parallel to the wall within
    ``FOUND_ANGLE``, if it lies within ``FOUND_DISTANCE`` of it. A wall most of whose samples stand for no
    face is false; the faces that samples of the others stand for are found.

    Parameters
    ----------
    environment : Environment
        The map.
    outline : array (segment, 2 ends, 2)
        Known faces [m].
    hits : array (segment,), optional
        How many paths bounced off each face. With it ``found`` and ``missed`` count only the faces that at
        least ``min_hits`` paths hit; no method can find the others.

    Returns
    -------
    dict
        ``walls`` in the map, of these ``false`` ones, ``found`` and ``missed`` faces of the outline,
        ``completeness`` and ``correctness`` (`covered_share`), ``angle_error`` [degree] and ``offset_error`` [m]
        summaries over the true walls, and ``matches`` (for each wall the face that most of it stands for, -1 if
        false). The offset error is the distance of a wall's middle from the line of its face.
    """
    walls = outline_of(environment)
    matches: list[int] = []
    angles: list[float] = []
    offsets: list[float] = []
    seen = np.zeros(len(outline), dtype=bool)
    for wall in walls:
        faces, distances, turned = faces_behind(wall, outline, STEP)
        on_face = faces[distances < FOUND_DISTANCE]
        if 2 * len(on_face) <= len(faces):
            matches.append(-1)
            continue
        seen[on_face] = True
        main = int(np.bincount(on_face).argmax())
        matches.append(main)
        angles.append(float(turned[main]))
        middle = point_errors([(wall[0] + wall[1]) / 2], outline[main : main + 1])
        offsets.append(float(middle.perpendicular[0]))
    wanted = np.ones(len(outline), dtype=bool) if hits is None else np.asarray(hits) >= min_hits
    return {
        "walls": len(walls),
        "false": matches.count(-1),
        "found": int(np.sum(seen & wanted)),
        "missed": int(np.sum(~seen & wanted)),
        "completeness": covered_share(outline[wanted], walls),
        "correctness": covered_share(walls, outline),
        "angle_error": summary(angles),
        "offset_error": summary(offsets),
        "matches": matches,
    }


def covered_share(segments: FloatArray, others: FloatArray) -> float:
    """Share of the length of segments that has a parallel one of others within ``CLOSE``.

    Of a map's walls against an outline it is the map's correctness; of an outline against the map its
    completeness. NaN where there is no length.

    Parameters
    ----------
    segments, others : array (segment, 2 ends, 2)
        [m].
    """
    covered = total = 0.0
    for segment in segments:
        length = float(np.linalg.norm(segment[1] - segment[0]))
        covered += length * float(np.mean(covered_samples(segment, others, FINE)))
        total += length
    return covered / total if total else float("nan")


def covered_samples(segment: FloatArray, others: FloatArray, step: float) -> npt.NDArray[np.bool_]:
    """Whether a parallel one of others lies within ``CLOSE`` of each sample, every ``step`` [m], of a segment."""
    return faces_behind(segment, others, step)[1] < CLOSE


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


def faces_behind(
    wall: FloatArray, outline: FloatArray, step: float
) -> tuple[npt.NDArray[np.int64], FloatArray, FloatArray]:
    """For samples of a wall: nearest parallel face and its distance [m]; and each face's angle [degree]."""
    length = float(np.linalg.norm(wall[1] - wall[0]))
    count = max(1, round(length / step))
    share = (np.arange(count) + 0.5) / count
    samples = wall[0] + share[:, None] * (wall[1] - wall[0])
    own, theirs = azimuth_of(wall[1] - wall[0]), azimuth_of(outline[:, 1] - outline[:, 0])
    turned = np.abs(angle_difference(2 * theirs, 2 * own)) / 2  # lines, not arrows
    parallel = np.flatnonzero(turned < FOUND_ANGLE)
    if len(parallel) == 0:
        return np.zeros(len(samples), dtype=np.int64), np.full(len(samples), np.inf), turned
    errors = point_errors(samples, outline[parallel])
    return parallel[errors.face], errors.distance, turned
