r"""Ghosts: cylinders whose paths a chain of two reflections, off a cylinder and a plane, explains as well.

A plane before the cylinder mirrors the transmitter, one after it the receiver and the azimuth of arrival; the rest is a
single bounce. A chain off two known faces has no free parameter, one off a known cylinder and an unknown plane has two
(the image in the plane), and one off a known plane and an unknown cylinder has three, as the ghost has. The
explanations are compared by their evidence (Laplace's method), faces with the most evidence first.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from erm.common.odds import TWENTY_TO_ONE
from erm.geometry.cylinders import Bounce, bounce
from erm.geometry.vertical import (
    FloatArray,
    angle_difference,
    azimuth_of,
    bisector,
    horizontal_length,
    mirrored,
    reflection_point,
    unit,
)
from erm.reconstruction.curved.agreement import path_log_odds
from erm.reconstruction.curved.pairs import log_prior
from erm.reconstruction.curved.search import MIN_PATHS, CurvedFace, CylinderSearch
from erm.reconstruction.model.fit import CHI_SQUARED_GATE
from erm.reconstruction.model.line import Line, Lines
from erm.reconstruction.model.loss import LOSS_RANGE, TYPICAL_LOSS, log_odds_of_loss
from erm.reconstruction.model.paths import BoolArray, IntArray, Paths
from erm.reconstruction.search.images import neighbours

MAX_STEPS = 12
"""Gauss-Newton steps of a chain at most. Chosen; not derived."""
STEP = 1e-6
"""Step of differences [m, degree]."""
IMAGE_DENSITY = 1e-4
"""Prior density of images [1/m2]: one in a square of 100 m. Chosen; not derived."""


class Seen(NamedTuple):
    """Antennas and azimuths (path,) in the mirror of the planes of a chain, and the cylinder between them."""

    tx: FloatArray  # (path, 2)
    rx: FloatArray  # (path, 2)
    azimuth: FloatArray  # (path,)
    centre: FloatArray  # (path, 2)
    radius: FloatArray  # (path,)


class Cylinder(NamedTuple):
    """A known cylinder."""

    centre: FloatArray  # (2,) m
    radius: float  # m
    covariance: FloatArray  # (3, 3) m2, of east, north and radius

    @classmethod
    def of(cls, face: CurvedFace) -> "Cylinder":
        """Return that of a curved face."""
        return cls(face.fit.centre, face.fit.radius, face.fit.covariance)


Chain = Callable[[Paths, FloatArray], Seen]
"""What paths are in the mirrors of a chain of given parameters (path, parameter)."""


def without_ghosts(
    faces: Sequence[CurvedFace], search: CylinderSearch, lines: list[Line], free: BoolArray
) -> list[CurvedFace]:
    """Curved faces that chains off better ones, and off walls, do not explain.

    Parameters
    ----------
    faces : sequence of CurvedFace
        Their inliers are indices of the paths of the search.
    search : CylinderSearch
    lines : sequence of Line
        Walls of the map.
    free : array (path,) of bool
        Paths that walls do not explain. A chain may explain more of them than the ghost does.
    """
    free = free.copy()
    accepted: list[CurvedFace] = []
    for face in sorted(faces, key=lambda face: (_is_behind(face, search.paths, lines), -face.evidence)):
        own = search.paths.take(face.inliers)
        explained, _ = explained_by_chains(own, [Cylinder.of(known) for known in accepted], Lines.from_list(lines))
        if len(explained):
            rest = np.delete(face.inliers, explained)
            if len(rest) < MIN_PATHS:
                continue
            again = search.refine(np.array([*face.fit.centre, face.fit.radius]), face.fit.covariance, rest)
            if again is None or again.evidence < TWENTY_TO_ONE:
                continue
            face = again
        own = search.paths.take(face.inliers)
        chains = [one for known in accepted for one in _chains_with_plane(own, known)]
        chains += [one for line in lines for one in _chains_with_cylinder(own, face, line)]
        rest = np.setdiff1d(np.flatnonzero(free), face.inliers)
        if all(_evidence(search, face, rest, *one) < face.evidence for one in chains):
            accepted.append(face)
            free[face.inliers] = False
    return accepted


def explained_by_chains(own: Paths, cylinders: Sequence[Cylinder], lines: Lines) -> tuple[IntArray, IntArray]:
    """Pairs (pair,) of paths and walls: a chain off the wall and a known cylinder, in either order, explains the path.

    A pair is there as often as chains explain it.
    """
    pairs = [(np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64))]
    for cylinder in cylinders:
        for wall_first in (True, False):
            path, wall = _near_in_mirrors(own, cylinder, lines, wall_first=wall_first)
            some = own.take(path)
            tx, rx, azimuth = _in_mirrors(some, lines.take(wall), wall_first=wall_first)
            centre, radius = np.tile(cylinder.centre, (len(path), 1)), np.full(len(path), cylinder.radius)
            seen = Seen(tx, rx, azimuth, centre, radius)
            agree = _chi_squared(some, seen, cylinder.covariance) < CHI_SQUARED_GATE
            pairs.append((path[agree], wall[agree]))
    path, wall = (np.concatenate(column) for column in zip(*pairs, strict=True))
    return path, wall


def _in_mirrors(own: Paths, lines: Lines, *, wall_first: bool) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Antennas (path, 2) and azimuths (path,) in the mirror of a line, or of one each, before or after a cylinder.

    The antenna on the other side of the cylinder may be behind a line: its image is NaN.
    """
    n = unit(lines.normal)
    tx, rx = own.tx[:, :2], own.rx[:, :2]
    antenna = tx if wall_first else rx
    depth = (np.sum((antenna - lines.pivot) * n, axis=-1) - lines.offset)[:, None]
    image = np.where(depth > 0, antenna - 2 * depth * n, np.nan)
    return (image, rx, own.azimuth) if wall_first else (tx, image, 2 * (lines.normal + 90) - own.azimuth)


def _near_in_mirrors(own: Paths, cylinder: Cylinder, lines: Lines, *, wall_first: bool) -> tuple[IntArray, IntArray]:
    """Pairs (pair,) of paths and lines, where a path may meet a cylinder in the mirror of the line before or after it.

    A reflection is within a radius of the axis. The length differs from that over the axis by at most two radii then,
    and the azimuth from that of the axis, or of its image, by at most ``asin(radius / distance)``.
    """
    gate = np.sqrt(CHI_SQUARED_GATE)
    # a metre of centre or radius changes a length by two metres at most
    reach = abs(cylinder.radius) + gate * np.sqrt(8 * np.trace(cylinder.covariance))
    length = horizontal_length(own.tx, own.rx, own.length)
    tolerance = 2 * reach + gate * own.length_std * own.length / length
    mirrored_axis = mirrored(cylinder.centre - lines.pivot, lines.normal, lines.offset) + lines.pivot
    rx = own.rx[:, :2]
    before, after = (own.tx[:, :2], rx) if wall_first else (rx, own.tx[:, :2])
    leg = length - np.linalg.norm(cylinder.centre - after, axis=-1)  # that the wall is on
    possible = np.flatnonzero(leg + tolerance > 0)
    if wall_first:
        seen = _are_toward(own.take(possible), np.broadcast_to(cylinder.centre, (len(possible), 2)), reach)
        possible = possible[seen]
        path, line = np.repeat(possible, len(lines.normal)), np.tile(np.arange(len(lines.normal)), len(possible))
    else:
        shortest = leg[possible] - tolerance[possible]
        aside = np.where(shortest > reach, np.arcsin(np.minimum(reach / np.maximum(shortest, reach), 1.0)), np.pi)
        turned = np.minimum(aside + gate * np.deg2rad(own.azimuth_std[possible]), np.pi)
        places = rx[possible] + leg[possible, None] * unit(own.azimuth[possible])
        widest = tolerance[possible] + 2 * np.abs(leg[possible]) * np.sin(turned / 2)
        near = neighbours(cKDTree(mirrored_axis), places, widest)
        path, line = possible[near.owner], near.rows
    distance = np.linalg.norm(mirrored_axis[line] - before[path], axis=-1)
    near = np.abs(distance - leg[path]) <= tolerance[path]
    in_front = np.sum((before[path] - lines.pivot[line]) * unit(lines.normal)[line], axis=-1) > lines.offset[line]
    path, line = path[near & in_front], line[near & in_front]
    if not wall_first:
        seen = _are_toward(own.take(path), mirrored_axis[line], reach)
        path, line = path[seen], line[seen]
    return path, line


def _are_toward(own: Paths, axis: FloatArray, reach: float) -> BoolArray:
    """Whether (path,) paths may arrive from within a reach of the axes (path, 2) of cylinders."""
    apart = axis - own.rx[:, :2]
    distance = np.linalg.norm(apart, axis=-1)
    aside = np.where(distance > reach, np.rad2deg(np.arcsin(np.minimum(reach / distance, 1.0))), 180.0)
    toward = np.abs(angle_difference(own.azimuth, azimuth_of(apart)))
    return np.asarray(toward <= aside + np.sqrt(CHI_SQUARED_GATE) * own.azimuth_std)


def _is_behind(face: CurvedFace, paths: Paths, lines: Sequence[Line]) -> bool:
    """Whether most reflection points are behind a wall, or the line beyond its ends: images are, faces seldom."""
    own = paths.take(face.inliers)
    behind = [(one.signed_distance(own.rx) > 0) & (one.signed_distance(face.fit.point) < 0) for one in lines]
    return any(np.mean(one) > 0.5 for one in behind)


def _chains_with_cylinder(own: Paths, face: CurvedFace, line: Line) -> list[tuple[Chain, FloatArray, float]]:
    """Chains off a wall and an unknown cylinder: function, start and log prior of the parameters."""
    lines = Lines.from_list([line])
    found: list[tuple[Chain, FloatArray, float]] = []
    for wall_first in (True, False):

        def chain(own: Paths, p: FloatArray, wall_first: bool = wall_first) -> Seen:
            return Seen(*_in_mirrors(own, lines, wall_first=wall_first), p[:, :2], p[:, 2])

        point, normal = _elements(own, chain(own, np.ones((len(own), 3))))
        n = unit(normal)
        design = np.concatenate([np.tile(np.eye(2), (len(own), 1)), n.reshape(-1, 1)], axis=1)
        if not np.isfinite(point).all():
            continue
        start = np.linalg.lstsq(design, point.reshape(-1), rcond=None)[0]
        if np.isfinite(start).all() and abs(start[2]) > STEP:
            found.append((chain, start, log_prior(float(start[2]))))
    return found


def _chains_with_plane(own: Paths, known: CurvedFace) -> list[tuple[Chain, FloatArray, float]]:
    """Chains off a known cylinder and an unknown plane: function, start and log prior of the parameters."""
    centre, radius = known.fit.centre, known.fit.radius
    tx, rx = own.tx[:, :2], own.rx[:, :2]
    length = horizontal_length(own.tx, own.rx, own.length)
    u = unit(own.azimuth)
    main = tx[0]

    def known_cylinder(own: Paths) -> tuple[FloatArray, FloatArray]:
        return np.tile(centre, (len(own), 1)), np.full(len(own), radius)

    def first_plane(own: Paths, p: FloatArray) -> Seen:
        """The plane before the cylinder, given by the image of the first transmitter."""
        normal, offset = bisector(main, p)
        return Seen(mirrored(own.tx, normal, offset), own.rx[:, :2], own.azimuth, *known_cylinder(own))

    def last_plane(own: Paths, p: FloatArray) -> Seen:
        """The plane after the cylinder, given by the image of its centre."""
        normal, offset = bisector(centre, p)
        azimuth = 2 * (normal + 90) - own.azimuth
        return Seen(own.tx[:, :2], mirrored(own.rx, normal, offset), azimuth, *known_cylinder(own))

    # the ray from the receiver meets the circle, or passes it nearby, and is reflected there toward the image
    ahead = np.sum((centre - rx) * u, axis=-1)
    aside = np.sum((centre - rx) ** 2, axis=-1) - ahead**2
    reach = ahead - np.sign(radius) * np.sqrt(np.maximum(radius**2 - aside, 0.0))
    point = rx + reach[:, None] * u
    n = (point - centre) / np.maximum(np.linalg.norm(point - centre, axis=-1, keepdims=True), STEP)
    turned = u - 2 * np.sum(u * n, axis=-1, keepdims=True) * n
    of_tx = np.median(point + (length - reach)[:, None] * turned, axis=0)
    # the path to the surface is shorter than that to the axis by up to a radius, twice that with the leg behind it
    from_axis = length - np.linalg.norm(tx - centre, axis=-1)
    images = [rx + (from_axis + share * radius)[:, None] * u for share in (0.0, 0.5, 1.0, 1.5, 2.0)]
    of_centre = np.median(min(images, key=lambda one: float(np.ptp(one, axis=0).sum())), axis=0)
    prior = float(np.log(IMAGE_DENSITY))
    return [(first_plane, of_tx, prior), (last_plane, of_centre, prior)]


def _elements(own: Paths, seen: Seen) -> tuple[FloatArray, FloatArray]:
    """Reflection points and normals of the cylinder of a chain, from what was measured."""
    height = own.tx[:, 2] - own.rx[:, 2]
    tx, rx = np.column_stack([seen.tx, height]), np.column_stack([seen.rx, np.zeros(len(own))])
    return reflection_point(tx, rx, own.length, seen.azimuth)


def _bounce(own: Paths, seen: Seen) -> Bounce:
    """Reflections of a chain off its cylinder, nearest to what was measured."""
    _, normal = _elements(own, seen)
    return bounce(seen.tx, seen.rx, seen.centre, seen.radius, normal)


def _compare(own: Paths, seen: Seen, found: Bounce) -> FloatArray:
    """Measured minus predicted length and azimuth (path, 2) of a chain, in standard errors; NaN where impossible."""
    slant = np.hypot(found.length, own.tx[:, 2] - own.rx[:, 2])
    residual = np.stack([own.length - slant, angle_difference(seen.azimuth, found.azimuth)], axis=-1)
    return residual / np.stack([own.length_std, own.azimuth_std], axis=-1)


def _chi_squared(own: Paths, seen: Seen, covariance: FloatArray) -> FloatArray:
    """Chi-squared (path,) of a chain off known faces, the error of the cylinder included; infinite if impossible."""
    found = _bounce(own, seen)
    std = np.stack([own.length_std, own.azimuth_std], axis=-1)
    slopes = np.stack([found.length_slopes, found.azimuth_slopes], axis=1) / std[:, :, None]
    residual = _compare(own, seen, found)
    usable = np.isfinite(slopes).all(axis=(1, 2)) & np.isfinite(residual).all(axis=1)
    chi2 = np.full(len(own), np.inf)
    spread = np.eye(2) + slopes[usable] @ covariance @ slopes[usable].swapaxes(-1, -2)
    chi2[usable] = np.einsum("ni,nij,nj->n", residual[usable], np.linalg.inv(spread), residual[usable])
    return chi2


def _evidence(
    search: CylinderSearch, ghost: CurvedFace, rest: IntArray, chain: Chain, start: FloatArray, prior: float
) -> float:
    """Log odds of a chain with unknown parameters against clutter: paths that it does not explain are clutter.

    It is fitted to the paths of a ghost, and may explain others, at most one of each link.
    """
    parameters, count = start.copy(), len(start)
    normal_matrix = np.eye(count)
    steps = np.vstack([np.zeros(count), STEP * np.eye(count)])  # all differences at once
    own = search.paths.take(np.tile(ghost.inliers, count + 1))
    for _ in range(MAX_STEPS):
        seen = chain(own, np.repeat(parameters + steps, len(ghost.inliers), axis=0))
        residual, *moved = _compare(own, seen, _bounce(own, seen)).reshape(count + 1, -1, 2)
        slopes = np.stack([(residual - one) / STEP for one in moved], axis=-1)
        usable = np.isfinite(residual).all(axis=1) & np.isfinite(slopes).all(axis=(1, 2))
        if np.count_nonzero(usable) < MIN_PATHS:
            return -np.inf
        design, value = slopes[usable].reshape(-1, count), residual[usable].ravel()
        weight = 1 / np.maximum(np.abs(value) / 2.0, 1.0)
        normal_matrix = (design * weight[:, None]).T @ design
        step = np.linalg.lstsq(normal_matrix, design.T @ (weight * value), rcond=None)[0]
        parameters = parameters + step
        if not np.isfinite(parameters).all():
            return -np.inf
        if step @ normal_matrix @ step < 1e-4:
            break
    rows = np.r_[ghost.inliers, rest]
    own, elements = search.paths.take(rows), search.elements.take(rows)
    clutter = np.maximum(elements.log_clutter[len(ghost.inliers) :], ghost.log_clutter.mean())
    elements = elements._replace(log_clutter=np.r_[ghost.log_clutter, clutter])
    seen = chain(own, np.tile(parameters, (len(own), 1)))
    residual = _compare(own, seen, _bounce(own, seen))
    chi2 = np.where(np.isfinite(residual[:, 0]), np.sum(residual**2, axis=-1), np.inf)
    odds = path_log_odds(chi2, elements) + log_odds_of_loss(
        elements.loss - _excess(seen, own), elements.loss_std, 2 * TYPICAL_LOSS, np.sqrt(2) * LOSS_RANGE
    )
    best = np.zeros(int(own.link.max()) + 1)
    np.maximum.at(best, own.link, odds)
    volume = count / 2 * np.log(2 * np.pi) - np.linalg.slogdet(normal_matrix)[1] / 2
    return float(best.sum() + volume + prior + ghost.log_view)


def _excess(seen: Seen, own: Paths) -> FloatArray:
    """Loss (path,) by the divergence of the cylinder of a chain, the rays taken as level [dB]."""
    found = _bounce(own, seen)
    s1 = np.linalg.norm(found.point - seen.tx, axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = 1 + 2 * s1 * (found.length - s1) / (found.length * seen.radius * found.cosine)
        return np.nan_to_num(10 * np.log10(np.abs(ratio)))
