"""Flat faces of an environment as arrays, and the lines of sight that they block."""

from dataclasses import dataclass

import numpy as np

from erm.maps.environment import CEILING, GROUND, Environment

FACE_THICKNESS = 1e-6
"""A point within this distance of a face is on it [m]: far above rounding errors, far below a wavelength."""


@dataclass(frozen=True)
class Faces:
    """Walls, then ground and ceiling: planes ``n.p = d`` with a rectangle on each.

    A point of the plane is on the face when ``0 <= (p - start).along <= length`` and ``base <= z <= top``;
    the infinite slabs have ``along`` = 0.

    Parameters
    ----------
    label : array (face,) of int
        Index of the reflector in the environment, `GROUND` or `CEILING`.
    normal : array (face, 3)
        Unit normal ``n``.
    offset : array (face,)
        ``d`` [m].
    start, along : array (face, 2)
        First end point [m], and unit vector toward the second.
    length, base, top : array (face,)
        Length, and heights of the lower and upper edge [m].
    """

    label: np.ndarray
    normal: np.ndarray
    offset: np.ndarray
    start: np.ndarray
    along: np.ndarray
    length: np.ndarray
    base: np.ndarray
    top: np.ndarray

    def distance(self, points: np.ndarray, face: np.ndarray | slice = slice(None)) -> np.ndarray:
        """Signed distances [m] of points (..., 3) from faces; both broadcast."""
        return (points * self.normal[face]).sum(-1) - self.offset[face]

    def mirror(self, points: np.ndarray, face: np.ndarray) -> np.ndarray:
        """Images (..., 3) of points (..., 3) in the planes of faces (...)."""
        return points - 2 * self.distance(points, face)[..., None] * self.normal[face]

    def contains(self, points: np.ndarray, face: np.ndarray, margin: float = 0.0) -> np.ndarray:
        """Whether points (..., 3) of the planes are inside the rectangles of faces (...) widened by a margin [m]."""
        reach = ((points[..., :2] - self.start[face]) * self.along[face]).sum(-1)
        height = points[..., 2]
        across = (reach >= -margin) & (reach <= self.length[face] + margin)
        return across & (height >= self.base[face] - margin) & (height <= self.top[face] + margin)


def faces_of(environment: Environment) -> Faces:
    """Faces of all walls, of the ground and of the ceiling. Poles are not flat and not included."""
    table = environment.reflectors
    label = np.flatnonzero(table.kind.values == "wall")
    ends = table.end_points.values[label]
    span = ends[:, 1] - ends[:, 0]
    length = np.hypot(span[:, 0], span[:, 1])
    along = span / length[:, None]
    normal = np.stack([-along[:, 1], along[:, 0], np.zeros(len(label))], axis=-1)
    slabs = [(tag, slab.height) for tag, slab in ((GROUND, environment.ground), (CEILING, environment.ceiling)) if slab]
    more = len(slabs)
    return Faces(
        label=np.concatenate([label, np.array([tag for tag, _ in slabs], dtype=label.dtype)]),
        normal=np.concatenate([normal, np.tile([0.0, 0.0, 1.0], (more, 1))]),
        offset=np.concatenate([(normal[:, :2] * ends[:, 0]).sum(-1), [height for _, height in slabs]]),
        start=np.concatenate([ends[:, 0], np.zeros((more, 2))]),
        along=np.concatenate([along, np.zeros((more, 2))]),
        length=np.concatenate([length, np.zeros(more)]),
        base=np.concatenate([table.base.values[label], np.full(more, -np.inf)]),
        top=np.concatenate([table.top.values[label], np.full(more, np.inf)]),
    )


def is_unobstructed(faces: Faces, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Whether no face blocks the line between two points.

    A face blocks the line if the points lie on different sides of its plane and the line meets the face. A face does
    not block lines from its own points (`FACE_THICKNESS`), so that a ray can leave the wall that reflects it.

    Parameters
    ----------
    faces : Faces
    first, second : array (..., 3)
        Pairs of points [m].

    Returns
    -------
    array (...) of bool
    """
    shape = first.shape[:-1]
    first, second = first.reshape(-1, 3), second.reshape(-1, 3)
    before = first @ faces.normal.T - faces.offset
    after = second @ faces.normal.T - faces.offset
    apart = (before * after < 0) & (np.abs(before) > FACE_THICKNESS) & (np.abs(after) > FACE_THICKNESS)
    pair, face = np.nonzero(apart)
    share = before[pair, face] / (before[pair, face] - after[pair, face])
    met = first[pair] + share[:, None] * (second[pair] - first[pair])
    blocked = faces.contains(met, face, margin=FACE_THICKNESS)  # the margin closes the joints between walls
    free = np.ones(len(first), dtype=bool)
    free[pair[blocked]] = False
    return free.reshape(shape)
