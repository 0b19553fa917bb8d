"""Flat faces of an environment as arrays, and what they hide from one another."""

from dataclasses import dataclass

import numpy as np

from erm.maps.environment import CEILING, GROUND, Environment

# nearer to a face than this a point counts as on it [m]: far above rounding, far below a wavelength
ON_FACE = 1e-6


@dataclass(frozen=True)
class Faces:
    """Walls, then ground and ceiling: planes ``n.p = d`` with a rectangle on each.

    A point of the plane is on the face when ``0 <= (p - start).along <= length`` and ``base <= z <= top``;
    the infinite slabs have ``along`` = 0.

    Parameters
    ----------
    label : array (face,) of int
        Index in the environment's reflectors; `GROUND` or `CEILING`.
    normal : array (face, 3)
        Unit vector.
    offset : array (face,)
        ``d`` [m].
    start, along : array (face, 2)
        First end point [m] and unit vector toward the second.
    length, base, top : array (face,)
        [m].
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
        """Signed distances of points (..., 3) from faces that broadcast against them."""
        return (points * self.normal[face]).sum(-1) - self.offset[face]

    def mirror(self, points: np.ndarray, face: np.ndarray) -> np.ndarray:
        """Images (..., 3) of points (..., 3) in the planes of faces (...)."""
        return points - 2 * self.distance(points, face)[..., None] * self.normal[face]

    def holds(self, points: np.ndarray, face: np.ndarray, margin: float = 0.0) -> np.ndarray:
        """Whether points (..., 3) of the planes are on the faces (...), or within a margin [m] of them."""
        reach = ((points[..., :2] - self.start[face]) * self.along[face]).sum(-1)
        height = points[..., 2]
        across = (reach >= -margin) & (reach <= self.length[face] + margin)
        return across & (height >= self.base[face] - margin) & (height <= self.top[face] + margin)


def faces_of(environment: Environment) -> Faces:
    """Faces of all walls and slabs; poles are not flat."""
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


def clear(faces: Faces, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Whether nothing stands between pairs of points.

    A face hides one point from the other when they lie on different sides of its plane and the line between
    them meets it. Points on a face (`ON_FACE`) are not hidden by that face, so a ray leaves the wall it is
    reflected by.

    Parameters
    ----------
    faces : Faces
    first, second : array (..., 3)
        [m].

    Returns
    -------
    array (...) of bool
    """
    shape = first.shape[:-1]
    first, second = first.reshape(-1, 3), second.reshape(-1, 3)
    before = first @ faces.normal.T - faces.offset
    after = second @ faces.normal.T - faces.offset
    apart = (before * after < 0) & (np.abs(before) > ON_FACE) & (np.abs(after) > ON_FACE)
    pair, face = np.nonzero(apart)
    share = before[pair, face] / (before[pair, face] - after[pair, face])
    met = first[pair] + share[:, None] * (second[pair] - first[pair])
    hidden = faces.holds(met, face, margin=ON_FACE)  # the margin closes the joints of walls
    free = np.ones(len(first), dtype=bool)
    free[pair[hidden]] = False
    return free.reshape(shape)
