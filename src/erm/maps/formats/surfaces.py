"""Reflectors as triangle meshes: walls are rectangles, arcs strips of them, poles prisms, ground and ceiling plates."""

from dataclasses import dataclass

import numpy as np

from erm.geometry.vertical import FloatArray, azimuth_of, unit
from erm.maps.arcs import arc_points
from erm.maps.environment import CEILING, GROUND, Environment, Slab

POLE_SIDES = 16
"""Sides of the prism of a pole; chosen."""


@dataclass(frozen=True)
class Surface:
    """Triangles of one reflector.

    Parameters
    ----------
    index : int
        Row of the reflector; -1 for the ground, -2 for the ceiling.
    kind : str
        ``wall``, ``pole``, ``arc``, ``ground`` or ``ceiling``.
    material : str
        Name of its material.
    vertices : array (vertex, 3)
        East, north, up [m].
    faces : array (face, 3) of int
        Vertices of each triangle, counter-clockwise as seen from outside.
    """

    index: int
    kind: str
    material: str
    vertices: FloatArray
    faces: np.ndarray


def extrude(environment: Environment, *, height: float, margin: float) -> list[Surface]:
    """Surfaces of all reflectors, then of ground and ceiling. Each has its own vertices.

    A wall has no thickness: two triangles that face the direction of ``normal``. A pole is a closed prism of 16 sides
    whose corners lie on its radius; its volume is ``8 sin(pi/8) / pi`` = 97.4 % of the cylinder's. The ground faces up,
    the ceiling down. Both are rectangles along the axes that extend ``margin`` beyond the reflectors, or beyond the
    origin if there are none.

    Parameters
    ----------
    environment : Environment
    height : float
        Walls and poles without upper edge end at this height above the ground [m], or at the ceiling if there is one.
        One whose base is higher has this height above its base.
    margin : float
        How far ground and ceiling extend beyond the reflectors [m].
    """
    table = environment.reflectors
    base, top = finite_edges(environment, height)
    ends, radius, normal = table.end_points.values, table.radius.values, table.normal.values
    surfaces = []
    for index, (kind, material) in enumerate(zip(table.kind.values, table.material.values, strict=True)):
        if kind == "pole":
            vertices, faces = _prism(ends[index, 0], radius[index], base[index], top[index])
        elif kind == "arc":
            vertices, faces = _strip(ends[index], table.centre.values[index], radius[index], base[index], top[index])
        else:
            vertices, faces = _rectangle(ends[index], normal[index], base[index], top[index])
        surfaces.append(Surface(index, str(kind), str(material), vertices, faces))
    for index, kind, slab in ((GROUND, "ground", environment.ground), (CEILING, "ceiling", environment.ceiling)):
        if slab:
            vertices = _plate(environment, slab, margin)
            faces = _fan(4) if kind == "ground" else _fan(4)[:, ::-1]
            surfaces.append(Surface(index, kind, slab.material, vertices, faces))
    return surfaces


def finite_edges(environment: Environment, height: float) -> tuple[FloatArray, FloatArray]:
    """Finite heights of lower and upper edges (reflector,) [m]; see `extrude`."""
    table = environment.reflectors
    base, top = table.base.values, table.top.values
    floor = environment.ground.height if environment.ground else 0.0
    cut = environment.ceiling.height if environment.ceiling else floor + height
    low = np.where(np.isfinite(base), base, np.where(floor < top, floor, top - height))
    high = np.where(np.isfinite(top), top, np.where(cut > low, cut, low + height))
    return low, high


def _fan(corners: int) -> np.ndarray:
    """Triangles (corners - 2, 3) of a convex polygon."""
    later = np.arange(1, corners - 1)
    return np.stack([np.zeros_like(later), later, later + 1], axis=-1)


def _rectangle(ends: FloatArray, normal: float, base: float, top: float) -> tuple[FloatArray, np.ndarray]:
    """Two triangles that face the direction of the normal."""
    along = ends[1] - ends[0]
    # in this order the corners turn counter-clockwise as seen from the right of first -> second end
    right = np.array([along[1], -along[0]])
    if unit(normal) @ right < 0:
        ends = ends[::-1]
    heights = np.array([base, base, top, top])
    return np.column_stack([ends[[0, 1, 1, 0]], heights]), _fan(4)


def _strip(
    ends: FloatArray, centre: FloatArray, radius: float, base: float, top: float
) -> tuple[FloatArray, np.ndarray]:
    """Rectangles along an arc, each with its own corners, that face the antennas: outward where it is convex."""
    points = arc_points(ends, centre, radius)
    parts = [
        _rectangle(chord, float(azimuth_of((chord.mean(axis=0) - centre) * np.sign(radius))), base, top)
        for chord in np.stack([points[:-1], points[1:]], axis=1)
    ]
    corners = [4 * number + faces for number, (_, faces) in enumerate(parts)]
    return np.concatenate([vertices for vertices, _ in parts]), np.concatenate(corners)


def _prism(centre: FloatArray, radius: float, base: float, top: float) -> tuple[FloatArray, np.ndarray]:
    """Closed prism: lower ring of corners, then upper ring."""
    ring = centre + radius * unit(np.arange(POLE_SIDES) * 360 / POLE_SIDES)
    low = np.arange(POLE_SIDES)
    after = (low + 1) % POLE_SIDES
    high = low + POLE_SIDES
    sides = [np.stack([low, after, after + POLE_SIDES], -1), np.stack([low, after + POLE_SIDES, high], -1)]
    caps = _fan(POLE_SIDES)
    vertices = np.concatenate([np.column_stack([ring, np.full(POLE_SIDES, z)]) for z in (base, top)])
    return vertices, np.concatenate([*sides, caps[:, ::-1], caps + POLE_SIDES])


def _plate(environment: Environment, slab: Slab, margin: float) -> FloatArray:
    """Corners of a horizontal rectangle below or above all reflectors, counter-clockwise as seen from above."""
    table = environment.reflectors
    points, reach = table.end_points.values, np.abs(table.radius.values)[:, None, None]
    extremes = np.concatenate([points - reach, points + reach]).reshape(-1, 2) if len(points) else np.zeros((1, 2))
    (west, south), (east, north) = extremes.min(axis=0) - margin, extremes.max(axis=0) + margin
    level = slab.height
    return np.array([[west, south, level], [east, south, level], [east, north, level], [west, north, level]])
