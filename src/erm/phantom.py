"""Walls that are not there: double bounces taken for single ones, and what gives them away."""

from collections.abc import Callable, Sequence
from itertools import permutations

import numpy as np

from erm.geometry import FloatArray, angle_difference, azimuth_of, bisector
from erm.merge import GATE
from erm.wall import BoolArray, Legs, Line, Paths, Wall, anchors, chi_squared

STEP = 1e-4  # degree and metre, of finite differences; mirrors are smooth over hundreds of these


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


def share_hidden_wall(wall: Wall, other: Wall, known: Wall) -> bool:
    """Whether two walls are the two orders of one double bounce, off a known wall and one nobody saw alone.

    If ``wall`` is the image of "hidden, then known", undoing the known mirror leaves the hidden wall; "known,
    then hidden" must then explain the paths of ``other``. Two real walls meet this by accident only.
    """
    tx = wall.paths.tx[0, :2]

    def hidden_then_known(candidate: Line, mirror: Line) -> Line:
        image = anchors(mirror, anchors(candidate, tx))
        normal, offset = bisector(tx - candidate.pivot, image - candidate.pivot)
        return Line(float(normal), float(offset), np.zeros((2, 2)), candidate.pivot)

    def known_then_hidden(candidate: Line, mirror: Line) -> Line:
        ends = (anchors(mirror, tx) - candidate.pivot, anchors(candidate, tx) - candidate.pivot)
        normal, offset = bisector(*ends)
        return Line(float(normal), float(offset), np.zeros((2, 2)), candidate.pivot)

    climb = other.paths.tx[:, 2] - other.paths.rx[:, 2]
    for hidden_in, reverse in ((hidden_then_known, False), (known_then_hidden, True)):
        hidden = _with_covariance(hidden_in, wall.line, known.line)
        chain = (hidden, known.line) if reverse else (known.line, hidden)
        if np.mean(_misfit_of_chain(other.paths, chain, climb) < GATE) > 0.5:
            return True
    return False


def _with_covariance(function: Callable[[Line, Line], Line], a: Line, b: Line) -> Line:
    """Line that a function makes of two others, with the covariance that follows from theirs."""
    value = function(a, b)
    slopes = []
    for moved in (
        lambda d: (a._replace(normal=a.normal + d), b),
        lambda d: (a._replace(offset=a.offset + d), b),
        lambda d: (a, b._replace(normal=b.normal + d)),
        lambda d: (a, b._replace(offset=b.offset + d)),
    ):
        up, down = function(*moved(STEP)), function(*moved(-STEP))
        turn = float(angle_difference(up.normal, down.normal))
        slopes.append([turn / (2 * STEP), (up.offset - down.offset) / (2 * STEP)])
    jacobian = np.transpose(slopes)
    covariance = np.zeros((4, 4))
    covariance[:2, :2], covariance[2:, 2:] = a.covariance, b.covariance
    return value._replace(covariance=jacobian @ covariance @ jacobian.T)


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

    slopes = []
    covariance = np.zeros((2 * len(chain), 2 * len(chain)))
    for i, line in enumerate(chain):
        covariance[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = line.covariance
        for up, down in (
            (line._replace(normal=line.normal + STEP), line._replace(normal=line.normal - STEP)),
            (line._replace(offset=line.offset + STEP), line._replace(offset=line.offset - STEP)),
        ):
            ends = (predicted([*chain[:i], moved, *chain[i + 1 :]]) for moved in (up, down))
            slopes.append(difference(*ends) / (2 * STEP))
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
