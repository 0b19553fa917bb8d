"""Image method: the sequences of faces that can reflect a path, and the reflection points."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from erm.tracing.faces import FACE_THICKNESS, Faces
from erm.tracing.obstacles import Obstacles

BATCH = 500_000
"""Pairs (sequence, face) that are examined at once; limits memory to about ten arrays of this size."""


@dataclass(frozen=True)
class Sequences:
    """Sequences of faces that a path meets, and the image of the transmitter behind each face.

    Parameters
    ----------
    face : array (sequence, bounce) of int
    image : array (sequence, bounce, 3)
        Image after the reflections up to and including this one [m].
    last_wall : array (sequence,) of int
        Last vertical face of the sequence, through which the image is seen; -1 if there is none.
    """

    face: np.ndarray
    image: np.ndarray
    last_wall: np.ndarray

    def take(self, chosen: np.ndarray) -> "Sequences":
        """Choose sequences by a mask or by indices."""
        return Sequences(self.face[chosen], self.image[chosen], self.last_wall[chosen])


def sequences(faces: Faces, tx: np.ndarray, max_order: int) -> Iterator[Sequences]:
    """Sequences of 1, 2, ... max_order faces that may reflect a path.

    A sequence is dropped if the image lies on the next face. It is also dropped if, in the plan view, the next wall is
    entirely outside the wedge from the image through the last wall, or entirely behind that wall. Ground and ceiling
    move images vertically and do not change the wedge. `specular_paths` decides about the remaining sequences.

    Parameters
    ----------
    faces : Faces
    tx : array (3,)
        Position of the transmitter [m].
    max_order : int
        Largest number of reflections.
    """
    grown = Sequences(np.zeros((1, 0), dtype=int), np.zeros((1, 0, 3)), np.array([-1]))
    for _ in range(max_order):
        step = max(1, BATCH // max(1, len(faces.label)))
        parts = [
            _extend(faces, tx, grown.take(np.arange(i, min(i + step, len(grown.face)))))
            for i in range(0, max(1, len(grown.face)), step)
        ]
        grown = Sequences(
            np.concatenate([part.face for part in parts]),
            np.concatenate([part.image for part in parts]),
            np.concatenate([part.last_wall for part in parts]),
        )
        yield grown


def _extend(faces: Faces, tx: np.ndarray, shorter: Sequences) -> Sequences:
    """All sequences with one more face that pass the tests of `sequences`."""
    count, order = shorter.face.shape
    image = shorter.image[:, -1] if order else np.tile(tx, (count, 1))
    possible = np.abs(image @ faces.normal.T - faces.offset) > FACE_THICKNESS
    if order:
        possible[np.arange(count), shorter.face[:, -1]] = False
    is_wall = faces.normal[:, 2] == 0
    behind_window = shorter.last_wall >= 0
    possible[np.ix_(behind_window, is_wall)] &= _in_wedge(
        faces, image[behind_window, :2], shorter.last_wall[behind_window], np.flatnonzero(is_wall)
    )
    which, added = np.nonzero(possible)
    mirrored = faces.mirror(image[which], added)
    return Sequences(
        np.concatenate([shorter.face[which], added[:, None]], axis=1),
        np.concatenate([shorter.image[which], mirrored[:, None]], axis=1),
        np.where(is_wall[added], added, shorter.last_wall[which]),
    )


def _in_wedge(faces: Faces, apex: np.ndarray, window: np.ndarray, wall: np.ndarray) -> np.ndarray:
    """Whether walls (w,) may be visible from apexes (n, 2) through windows (n,): (n, w), true when in doubt."""
    left = faces.start[window] - apex
    right = left + faces.along[window] * faces.length[window, None]
    orientation = np.sign(_cross(left, right))[:, None, None]
    ends = np.stack([faces.start[wall], faces.start[wall] + faces.along[wall] * faces.length[wall, None]], axis=1)
    toward = ends[None] - apex[:, None, None]  # (n, w, end, 2)
    inside_left = (orientation * _cross(left[:, None, None], toward) > 0).any(-1)
    inside_right = (orientation * _cross(toward, right[:, None, None]) > 0).any(-1)
    normal, offset = faces.normal[window, :2], faces.offset[window]
    apex_side = np.sign((apex * normal).sum(-1) - offset)[:, None, None]
    beyond = apex_side * (np.einsum("wbx,nx->nwb", ends, normal) - offset[:, None, None]) < -FACE_THICKNESS
    return inside_left & inside_right & beyond.any(-1)


def specular_paths(
    faces: Faces, tx: np.ndarray, rx: np.ndarray, candidates: Sequences, obstacles: Obstacles
) -> tuple[np.ndarray, np.ndarray]:
    """Reflection points of the sequences that reflect a path from transmitter to receiver.

    They are found backwards from the receiver: the line to the last image meets the last face at the last reflection
    point; the line from there to the image before meets the face before, and so on. A path exists if each line crosses
    its face inside the rectangle and no leg is blocked.

    Parameters
    ----------
    faces : Faces
    tx, rx : array (3,)
        Positions of the antennas [m].
    candidates : Sequences
        Sequences of one length.
    obstacles : Obstacles
        What blocks legs.

    Returns
    -------
    vertices : array (path, bounce, 3)
        Reflection points in the order from transmitter to receiver [m].
    face : array (path, bounce) of int
        Face of each reflection.
    """
    order = candidates.face.shape[1]
    target = np.tile(rx, (len(candidates.face), 1))
    vertices = np.zeros((len(target), order, 3))
    for bounce in reversed(range(order)):
        face, image = candidates.face[:, bounce], candidates.image[:, bounce]
        here, there = faces.distance(target, face), faces.distance(image, face)
        crossing = (here * there < 0) & (np.abs(here) > FACE_THICKNESS)
        candidates, target, vertices = candidates.take(crossing), target[crossing], vertices[crossing]
        share = here[crossing] / (here[crossing] - there[crossing])
        target = target + share[:, None] * (image[crossing] - target)
        inside = faces.contains(target, face[crossing])
        candidates, target, vertices = candidates.take(inside), target[inside], vertices[inside]
        vertices[:, bounce] = target
    route = polyline(tx, vertices, rx)
    free = obstacles.leave_free(route[:, :-1], route[:, 1:]).all(axis=-1)
    return vertices[free], candidates.face[free]


def polyline(tx: np.ndarray, vertices: np.ndarray, rx: np.ndarray) -> np.ndarray:
    """Corners (path, bounce + 2, 3) of paths, with the antennas."""
    ends = (np.broadcast_to(end, (len(vertices), 1, 3)) for end in (tx, rx))
    first, last = ends
    return np.concatenate([first, vertices, last], axis=1)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
