"""Vertical cylinders of an environment, poles and arcs: what they reflect and what they block."""

from typing import NamedTuple

import numpy as np

from erm.geometry.cylinders import reflection_azimuths, spreading_factor
from erm.geometry.vertical import azimuth_of, unit
from erm.maps.environment import Environment
from erm.tracing.faces import FACE_THICKNESS, Faces


class Cylinders(NamedTuple):
    """Parts of vertical cylinders, all of a circle or an arc of it."""

    label: np.ndarray  # (cylinder,) index of the reflector in the environment
    centre: np.ndarray  # (cylinder, 2) m
    radius: np.ndarray  # (cylinder,) m, positive
    first: np.ndarray  # (cylinder,) degree, azimuth of the first end, seen from the centre
    sweep: np.ndarray  # (cylinder,) degree, counter-clockwise to the second end; 360 of a pole
    base: np.ndarray  # (cylinder,) m
    top: np.ndarray  # (cylinder,) m

    def contain(self, azimuth: np.ndarray, height: np.ndarray) -> np.ndarray:
        """Whether (cylinder, n) points at azimuths [degree] and heights [m] are on the cylinders; not of NaN."""
        columns = (column[:, None] for column in (self.first, self.sweep, self.base, self.top))
        first, sweep, base, top = columns
        with np.errstate(invalid="ignore"):
            return ((azimuth - first) % 360 <= sweep) & (height >= base) & (height <= top)

    def leave_free(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """Whether (...) no cylinder blocks the lines between points (..., 3); not those that they touch or end on."""
        shape = first.shape[:-1]
        start, end = first.reshape(-1, 3), second.reshape(-1, 3)
        free: np.ndarray = np.ones(len(start), dtype=bool)
        if len(self.label):
            along = end - start
            out = start[None, :, :2] - self.centre[:, None]  # (cylinder, line, 2)
            a = np.maximum((along[:, :2] ** 2).sum(-1), FACE_THICKNESS**2)
            b = (out * along[:, :2]).sum(-1)
            root = np.sqrt(np.maximum(b**2 - a * ((out**2).sum(-1) - self.radius[:, None] ** 2), 0.0))
            inside = FACE_THICKNESS / np.sqrt(a)
            for share in ((-b - root) / a, (-b + root) / a):
                met = out + share[..., None] * along[:, :2]
                height = start[:, 2] + share * along[:, 2]
                hit = (root > inside * a) & (share > inside) & (share < 1 - inside)
                free &= ~(hit & self.contain(azimuth_of(met), height)).any(axis=0)
        return free.reshape(shape)


class CylinderReflections(NamedTuple):
    """Single reflections off cylinders."""

    cylinder: np.ndarray  # (path,) row of the cylinders
    point: np.ndarray  # (path, 3) m
    normal: np.ndarray  # (path, 3) unit normals on the side of the antennas
    spreading: np.ndarray  # (path,) m; replaces the path length in the spreading loss


class CylinderPaths(NamedTuple):
    """Paths off one cylinder and as many flat faces as they have further bounces."""

    vertices: np.ndarray  # (path, bounce, 3) m
    reflector: np.ndarray  # (path, bounce) index in the environment
    normal: np.ndarray  # (path, bounce, 3)
    spreading: np.ndarray  # (path,) m


def cylinders_of(environment: Environment, kinds: tuple[str, ...] = ("pole", "arc")) -> Cylinders:
    """Cylinders of some kinds of reflectors."""
    table = environment.reflectors
    label = np.flatnonzero(np.isin(table.kind.values, kinds))
    centre = table.centre.values[label]
    ends = azimuth_of(table.end_points.values[label] - centre[:, None])
    whole = table.kind.values[label] == "pole"
    sweep = np.where(whole, 0.0, ends[:, 1] - ends[:, 0]) % 360
    return Cylinders(
        label,
        centre,
        np.abs(table.radius.values[label]),
        ends[:, 0],
        np.where(sweep == 0, 360.0, sweep),
        table.base.values[label],
        table.top.values[label],
    )


def reflections(cylinders: Cylinders, tx: np.ndarray, rx: np.ndarray) -> CylinderReflections:
    """Single reflections of the path between two antennas (3,) off cylinders, without regard to what is in the way.

    Both sides of a face reflect. The height of the point is proportional to the horizontal length from the transmitter,
    as on any vertical face. The spreading length is ``L`` over the root of `erm.geometry.cylinders.spreading_factor`.
    """
    azimuth = reflection_azimuths(tx, rx, cylinders.centre, cylinders.radius)
    point = cylinders.centre[:, None] + cylinders.radius[:, None, None] * unit(azimuth)
    to_tx, to_rx = tx[:2] - point, rx[:2] - point
    level1, level2 = np.linalg.norm(to_tx, axis=-1), np.linalg.norm(to_rx, axis=-1)
    height = tx[2] + (rx[2] - tx[2]) * level1 / (level1 + level2)
    cylinder, number = np.nonzero(cylinders.contain(azimuth, height))
    kept = (cylinder, number)
    outward = unit(azimuth[kept])
    side = np.sign((to_tx[kept] * outward).sum(-1))  # the same of both antennas where they see a reflection
    level = level1[kept] + level2[kept]
    length = np.hypot(level, tx[2] - rx[2])
    cos_elevation = level / length
    cosine = np.abs((to_tx[kept] * outward).sum(-1)) / level1[kept] * cos_elevation
    factor = spreading_factor(
        level1[kept] / cos_elevation,
        level2[kept] / cos_elevation,
        side * cylinders.radius[cylinder],
        cosine,
        cos_elevation,
    )
    return CylinderReflections(
        cylinder,
        np.column_stack([point[kept], height[kept]]),
        np.column_stack([side[:, None] * outward, np.zeros(len(side))]),
        length / np.sqrt(factor),
    )


def single_bounces(cylinders: Cylinders, tx: np.ndarray, rx: np.ndarray) -> CylinderPaths:
    """Paths between two antennas (3,) off one cylinder; poles reflect on the outside only."""
    found = reflections(cylinders, tx, rx)
    outside = (found.normal[:, :2] * (found.point[:, :2] - cylinders.centre[found.cylinder])).sum(-1) > 0
    kept = outside | (cylinders.sweep[found.cylinder] < 360)
    columns = (found.point[:, None], cylinders.label[found.cylinder, None], found.normal[:, None], found.spreading)
    return CylinderPaths(*(column[kept] for column in columns))


def double_bounces(cylinders: Cylinders, faces: Faces, tx: np.ndarray, rx: np.ndarray) -> list[CylinderPaths]:
    """Paths between two antennas (3,) off a flat face and a cylinder, in both orders.

    The image of the transmitter in a face before the cylinder sees a single bounce, and so does, with the path
    reversed, that of the receiver in a face after it.
    """
    found = []
    for face in np.arange(len(faces.label))[:, None]:
        for start, end, order in ((tx, rx, [0, 1]), (rx, tx, [1, 0])):
            image = faces.mirror(start, face)[0]
            bent = single_bounces(cylinders, image, end)
            point = bent.vertices[:, 0]
            here, there = faces.distance(point, face), faces.distance(image, face)
            crosses = (here * there < 0) & (np.abs(here) > FACE_THICKNESS)
            share = np.where(crosses, here, 0.0) / np.where(crosses, here - there, 1.0)
            met = point + share[:, None] * (image - point)
            kept = crosses & faces.contains(met, face)
            vertices = np.stack([met, point], axis=1)[kept][:, order]
            label = np.column_stack([np.tile(faces.label[face], len(point)), bent.reflector[:, 0]])[kept][:, order]
            normal = np.stack([np.tile(faces.normal[face], (len(point), 1)), bent.normal[:, 0]], axis=1)[kept][:, order]
            found.append(CylinderPaths(vertices, label, normal, bent.spreading[kept]))
    return found
