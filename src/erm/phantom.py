"""Walls that are not there: double bounces taken for single ones, and what gives them away."""

from collections.abc import Sequence
from itertools import permutations

import numpy as np

from erm.geometry import FloatArray, angle_difference, azimuth_of
from erm.merge import GATE
from erm.wall import BoolArray, Legs, Line, Paths, Wall, anchors, chi_squared


def bounced_twice(paths: Paths, walls: Sequence[Line], ground_height: float) -> BoolArray:
    """Paths (path,) that two bounces explain: off two of the walls, or off a wall and the ground.

    The image of the image, ``VA_ab = mirror_b(mirror_a(tx))``, is as fixed a point as the image in one wall.
    Paths off both walls agree on it from everywhere, so support alone cannot tell them from a third wall.
    """
    explained = np.zeros(len(paths), dtype=bool)
    climb = paths.tx[:, 2] - paths.rx[:, 2]
    from_ground = paths.tx[:, 2] + paths.rx[:, 2] - 2 * ground_height
    for a, b in permutations(walls, 2):
        explained |= _misfit_of_chain(paths, (a, b), climb) < GATE
    for a in walls:
        explained |= _misfit_of_chain(paths, (a,), from_ground) < GATE
    return explained


def _misfit_of_chain(paths: Paths, chain: Sequence[Line], climb: FloatArray) -> FloatArray:
    """Chi-squared (path,) of paths against successive mirrors, the mirrors' uncertainty included."""

    def predicted(lines: Sequence[Line]) -> FloatArray:
        image = paths.tx[:, :2]
        for line in lines:
            image = anchors(line, image)
        seen = image - paths.rx[:, :2]
        return np.stack([np.hypot(np.linalg.norm(seen, axis=-1), climb), azimuth_of(seen)], axis=-1)

    def difference(a: FloatArray, b: FloatArray) -> FloatArray:
        return np.stack([a[:, 0] - b[:, 0], angle_difference(a[:, 1], b[:, 1])], axis=-1)

    step = 1e-4  # degree and metre; the predictions are smooth over hundreds of these
    slopes = []
    covariance = np.zeros((2 * len(chain), 2 * len(chain)))
    for i, line in enumerate(chain):
        covariance[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = line.covariance
        for up, down in (
            (line._replace(normal=line.normal + step), line._replace(normal=line.normal - step)),
            (line._replace(offset=line.offset + step), line._replace(offset=line.offset - step)),
        ):
            ends = (predicted([*chain[:i], moved, *chain[i + 1 :]]) for moved in (up, down))
            slopes.append(difference(*ends) / (2 * step))
    measured = np.stack([paths.length, paths.azimuth], axis=-1)
    return chi_squared(paths, difference(measured, predicted(chain)), np.stack(slopes, axis=-1), covariance)


def obstructs(wall: Wall, kept: Sequence[Wall], sight: Legs) -> bool:
    """Whether a wall contradicts better supported ones.

    It does if most of its own paths would have to pass through them, or if two or more of their paths, or
    lines of sight, would have to pass through it. The last bounce of a double bounce always lies nearer to
    the receiver than the point a single bounce would have come from, so phantoms stand behind real walls.
    """
    behind = np.zeros(2 * wall.support, dtype=bool)
    cut = np.count_nonzero(wall.blocks(sight))
    for other in kept:
        behind |= other.blocks(wall.legs())
        cut += np.count_nonzero(np.any(wall.blocks(other.legs()).reshape(2, -1), axis=0))
    return bool(np.mean(np.any(behind.reshape(2, -1), axis=0)) > 0.5 or cut >= 2)
