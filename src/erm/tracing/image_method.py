"""Image method: which sequences of faces can carry a reflected path, and where it bounces."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from erm.tracing.faces import ON_FACE, Faces, clear

# pairs (sequence, face) looked at in one go: some ten arrays of this many numbers are alive at once
BATCH = 500_000


@dataclass(frozen=True)
class Sequences:
    """Faces met one after another, and the transmitter's image behind each.

    Parameters
    ----------
    face : array (sequence, bounce) of int
    image : array (sequence, bounce, 3)
        After the mirrors up to and including this bounce [m].
    last_wall : array (sequence,) of int
        The last vertical face; -1 if there is none. It is the window the image is seen through.
    """

    face: np.ndarray
    image: np.ndarray
    last_wall: np.ndarray

    def take(self, chosen: np.ndarray) -> "Sequences":
        """Those of the sequences that are chosen (mask or indices)."""
        return Sequences(self.face[chosen], self.image[chosen], self.last_wall[chosen])


def sequences(faces: Faces, tx: np.ndarray, max_order: int) -> Iterator[Sequences]:
    """Sequences of 1, 2, ... max_order faces that are not impossible at first sight.

    A sequence is dropped when the image lies on the next face, or when seen from above the next wall is
    wholly outside the wedge from the image through the last wall, or wholly behind that wall. Slabs leave
    the wedge as it is, as they move images vertically. What remains is decided by `bounces`.

    Parameters
    ----------
    faces : Faces
    tx : array (3,)
        Transmitter [m].
    max_order : int
        Number of bounces.
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


def _extend(faces: Faces, tx: np.ndarray, short: Sequences) -> Sequences:
    """All sequences one bounce longer that pass the tests of `sequences`."""
    count, order = short.face.shape
    image = short.image[:, -1] if order else np.tile(tx, (count, 1))
    possible = np.abs(image @ faces.normal.T - faces.offset) > ON_FACE
    if order:
        possible[np.arange(count), short.face[:, -1]] = False
    is_wall = faces.normal[:, 2] == 0
    behind_window = short.last_wall >= 0
    possible[np.ix_(behind_window, is_wall)] &= _in_wedge(
        faces, image[behind_window, :2], short.last_wall[behind_window], np.flatnonzero(is_wall)
    )
    which, added = np.nonzero(possible)
    mirrored = faces.mirror(image[which], added)
    return Sequences(
        np.concatenate([short.face[which], added[:, None]], axis=1),
        np.concatenate([short.image[which], mirrored[:, None]], axis=1),
        np.where(is_wall[added], added, short.last_wall[which]),
    )


def _in_wedge(faces: Faces, apex: np.ndarray, window: np.ndarray, wall: np.ndarray) -> np.ndarray:
    """Whether walls (w,) may be lit from apexes (n, 2) through windows (n,): (n, w), true when in doubt."""
    left = faces.start[window] - apex
    right = left + faces.along[window] * faces.length[window, None]
    turn = np.sign(_cross(left, right))[:, None, None]
    ends = np.stack([faces.start[wall], faces.start[wall] + faces.along[wall] * faces.length[wall, None]], axis=1)
    seen = ends[None] - apex[:, None, None]  # (n, w, end, 2)
    inside_left = (turn * _cross(left[:, None, None], seen) > 0).any(-1)
    inside_right = (turn * _cross(seen, right[:, None, None]) > 0).any(-1)
    normal, offset = faces.normal[window, :2], faces.offset[window]
    apex_side = np.sign((apex * normal).sum(-1) - offset)[:, None, None]
    beyond = apex_side * (np.einsum("wbx,nx->nwb", ends, normal) - offset[:, None, None]) < -ON_FACE
    return inside_left & inside_right & beyond.any(-1)


def bounces(
    faces: Faces, tx: np.ndarray, rx: np.ndarray, candidates: Sequences, hiding: Faces
) -> tuple[np.ndarray, np.ndarray]:
    """Bounce points of the sequences that carry a path from transmitter to receiver.

    Backwards from the receiver: the line to the last image meets the last face at the last bounce, the line
    from there to the image before it the face before, and so on. A path exists when each line crosses its
    face inside the face's rectangle and no leg is hidden.

    Parameters
    ----------
    faces : Faces
    tx, rx : array (3,)
        [m].
    candidates : Sequences
        Of one length.
    hiding : Faces
        That no leg may pass through.

    Returns
    -------
    vertices : array (path, bounce, 3)
        In the order from transmitter to receiver [m].
    face : array (path, bounce) of int
    """
    order = candidates.face.shape[1]
    target = np.tile(rx, (len(candidates.face), 1))
    vertices = np.zeros((len(target), order, 3))
    for bounce in reversed(range(order)):
        face, image = candidates.face[:, bounce], candidates.image[:, bounce]
        here, there = faces.distance(target, face), faces.distance(image, face)
        crossing = (here * there < 0) & (np.abs(here) > ON_FACE)
        candidates, target, vertices = candidates.take(crossing), target[crossing], vertices[crossing]
        share = here[crossing] / (here[crossing] - there[crossing])
        target = target + share[:, None] * (image[crossing] - target)
        inside = faces.holds(target, face[crossing])
        candidates, target, vertices = candidates.take(inside), target[inside], vertices[inside]
        vertices[:, bounce] = target
    route = polyline(tx, vertices, rx)
    free = clear(hiding, route[:, :-1], route[:, 1:]).all(axis=-1)
    return vertices[free], candidates.face[free]


def polyline(tx: np.ndarray, vertices: np.ndarray, rx: np.ndarray) -> np.ndarray:
    """Corners (path, bounce + 2, 3) of paths, the antennas included."""
    ends = (np.broadcast_to(end, (len(vertices), 1, 3)) for end in (tx, rx))
    first, last = ends
    return np.concatenate([first, vertices, last], axis=1)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
