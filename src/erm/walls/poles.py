"""Poles from paths: lamp posts and columns throw a weak path from one and the same point to every receiver.

Where all paths off one wall share an image, all paths off one pole share their reflection point; and what they lose
tells its radius, for the wave spreads behind a convex face the more the thinner that is.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree
from scipy.special import gammainc

from erm.geometry import FloatArray, angle_difference, azimuth_of, point_covariance, reflection_point
from erm.walls.chance import UNSEEN
from erm.walls.conflicts import BEYOND
from erm.walls.consensus import find_groups
from erm.walls.extent import Footprint, Legs, footprint, stretches
from erm.walls.images import GATE
from erm.walls.loss import weighted_quantile
from erm.walls.paths import IntArray, Paths
from erm.walls.pieces import SOLID_GAP
from erm.walls.wall import Wall

REACH = 2.0  # m; members' points lie this near to a pole
DEPTH = 0.05  # m; a path ends on the pole's surface, not in its centre
THINNEST, THICKEST = 0.02, 1.0  # m; radius
ALIKE = 3.0  # dB; scatter of radii from the losses of one pole's paths
LEAST_LOSS = 6.0  # dB; a cylinder seen from farther than its radius loses more
PLENTY = 4  # links; of fewer it is asked whether they agree by chance
RING = 10.0  # outer radius of the ring about a pole that is counted, in radii of the gate
ACCIDENTS = 0.001  # poles that chance may be expected to make of as few links
OFF_WALL = 0.5  # m; what is nearer to a wall is its roughness, or a pilaster
ALONE = 3.0  # m; points closer than this to each other are the roughness of a wall that nobody saw


class Pole(NamedTuple):
    """A vertical cylinder and the paths off it."""

    centre: FloatArray  # (2,) m
    covariance: FloatArray  # (2, 2) m2
    radius: float  # m
    top: float  # m, of the highest reflection point
    members: IntArray


def find_poles(paths: Paths, walls: Sequence[Wall], min_support: int) -> list[Pole]:
    """Poles that at least ``min_support`` links agree on, none of whose paths a wall explains.

    A point must explain delays and azimuths of its paths, their losses must tell one radius, and the legs must not
    pass through walls.

    Parameters
    ----------
    paths : Paths
        Those that no wall has, of whatever loss.
    walls : sequence of Wall
        Walls of the map.
    """
    rows = np.flatnonzero(paths.loss > LEAST_LOSS)
    paths = paths.take(rows)
    if len(paths) < min_support:
        return []
    chain = np.full(len(paths), -1)
    for number, group in enumerate(find_groups(paths, 3)):
        chain[group.members] = number
    points, _ = reflection_point(paths.tx, paths.rx, paths.length, paths.azimuth)
    spread = point_covariance(paths.tx, paths.rx, paths.length, paths.azimuth, *_errors(paths))
    tree = cKDTree(points)
    near = tree.query_ball_point(points, REACH)
    free = np.ones(len(paths), dtype=bool)
    prints = [footprint(wall, stretches(wall, SOLID_GAP)) for wall in walls]
    poles: list[Pole] = []
    links = np.array([len(np.unique(paths.link[one])) for one in near])
    for seed in np.lexsort((paths.length, -links)):
        if links[seed] < min_support or not free[seed]:
            continue
        around = np.asarray(near[seed], dtype=np.int64)
        around = around[free[around]]
        pole = _pole(paths, points[seed], spread[seed], around, min_support)
        if pole is None:
            continue
        free[pole.members] = False
        if len(pole.members) < PLENTY and _accidents(paths, pole) > ACCIDENTS:
            continue
        of_chain = np.bincount(chain[pole.members] + 1)[1:].max(initial=0) >= len(pole.members) / 2
        if not of_chain and not _at_wall(pole, prints) and not _hidden(paths.take(pole.members), pole, prints):
            poles.append(pole)
    centres = np.array([pole.centre for pole in poles]).reshape(-1, 2)
    crowd = np.linalg.norm(centres[:, None] - centres, axis=-1) < ALONE
    return [p._replace(members=rows[p.members]) for p, near_by in zip(poles, crowd, strict=True) if near_by.sum() == 1]


def _at_wall(pole: Pole, prints: Sequence[Footprint]) -> bool:
    """Whether a pole stands on a wall, or where it may go on."""
    for print_ in prints:
        along = print_.line.along(pole.centre)
        beside = print_.low.min() - BEYOND < along < print_.high.max() + BEYOND
        if beside and abs(print_.line.depth(pole.centre)) < OFF_WALL:
            return True
    return False


def _pole(paths: Paths, start: FloatArray, spread: FloatArray, around: IntArray, min_support: int) -> Pole | None:
    """The pole that paths around a start agree on, if they do."""
    place, covariance = start, spread
    members = np.empty(0, dtype=np.int64)
    for _ in range(8):
        chi2 = _misfit(paths.take(around), place, covariance)
        inside = np.flatnonzero(chi2 < GATE)
        inside = inside[np.lexsort((chi2[inside], paths.link[around[inside]]))]
        _, first = np.unique(paths.link[around[inside]], return_index=True)
        gathered = np.sort(around[inside[first]])
        if len(gathered) < min_support:
            return None
        place, covariance = _fit(paths.take(gathered), place)
        if np.array_equal(gathered, members):
            break
        members = gathered
    one = paths.take(members)
    radii, heights = _radii(one, place)
    weight = 1 / (one.loss_std**2 + ALIKE**2)
    middle = weighted_quantile(10 * np.log10(radii), weight, 0.5)
    apart = np.abs(10 * np.log10(radii) - middle) / np.hypot(1.0, one.loss_std / ALIKE)
    # gains beyond the fan are all wrong alike, so their errors are not averaged
    error = float(np.sum(weight * one.loss_std) / np.sum(weight))
    thinnest, thickest = 10 ** ((middle - error) / 10), 10 ** ((middle + error) / 10)
    if weighted_quantile(apart, weight, 0.5) > ALIKE or thickest < THINNEST or thinnest > THICKEST:
        return None
    radius = float(np.clip(10 ** (middle / 10), THINNEST, THICKEST))
    # the fitted point is on the surface, on the side of the antennas
    inward = place - (one.tx[:, :2].mean(axis=0) + one.rx[:, :2].mean(axis=0)) / 2
    return Pole(place + radius * inward / np.linalg.norm(inward), covariance, radius, float(heights.max()), members)


def _misfit(paths: Paths, place: FloatArray, covariance: FloatArray) -> FloatArray:
    """Chi-squared (path,) of paths against a point of some covariance."""
    residual, jacobian = _residuals(paths, place)
    length_std, azimuth_std = _errors(paths)
    own = jacobian @ covariance @ jacobian.swapaxes(1, 2)
    own[:, 0, 0] += length_std**2
    own[:, 1, 1] += azimuth_std**2
    return np.einsum("ni,nij,nj->n", residual, np.linalg.inv(own), residual)


def _accidents(paths: Paths, pole: Pole) -> float:
    """Poles of as many links that would be found if all paths came from anywhere, as many as about this one.

    With ``n`` paths in the ring from one to `RING` radii of the gate, the gate holds ``m = (n + 1/2) / (RING**2 - 1)``
    by chance. Each of the ``N`` paths lays a point, and ``N P(Poisson(m) >= support - 1)`` have as much company.
    """
    others = np.ones(len(paths), dtype=bool)
    others[pole.members] = False
    inward = pole.centre - (paths.tx[pole.members, :2].mean(axis=0) + paths.rx[pole.members, :2].mean(axis=0)) / 2
    surface = pole.centre - pole.radius * inward / np.linalg.norm(inward)
    chi2 = _misfit(paths.take(others), surface, pole.covariance)
    chance = (np.count_nonzero((chi2 > GATE) & (chi2 < RING**2 * GATE)) + UNSEEN) / (RING**2 - 1)
    # P(Poisson(m) >= k) is the regularised incomplete gamma function P(k, m)
    return float(len(paths) * gammainc(max(len(pole.members) - 1, 1), chance))


def _errors(paths: Paths) -> tuple[FloatArray, FloatArray]:
    return np.hypot(paths.length_std, DEPTH), paths.azimuth_std


def _residuals(paths: Paths, place: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Measured minus predicted (length, azimuth) of paths by way of a point, and the slopes by its position.

    Seen from above the path is ``|tx - p| + |p - rx|`` long, and unfolded at a vertical face it climbs evenly.
    """
    first, second = place - paths.tx[:, :2], place - paths.rx[:, :2]
    d1, d2 = np.hypot(*first.T), np.hypot(*second.T)
    slant = np.hypot(d1 + d2, paths.tx[:, 2] - paths.rx[:, 2])
    toward = second / d2[:, None]
    left = np.stack([-toward[:, 1], toward[:, 0]], axis=-1)
    residual = np.stack([paths.length - slant, angle_difference(paths.azimuth, azimuth_of(second))], axis=-1)
    by_length = (first / d1[:, None] + toward) * ((d1 + d2) / slant)[:, None]
    return residual, np.stack([by_length, np.rad2deg(left / d2[:, None])], axis=1)


def _fit(paths: Paths, place: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Weighted least-squares point of paths, and its covariance."""
    scale = 1 / np.stack(_errors(paths), axis=-1)
    for _ in range(10):
        residual, jacobian = _residuals(paths, place)
        design = (jacobian * scale[..., None]).reshape(-1, 2)
        covariance = np.linalg.inv(design.T @ design).astype(float)
        step = covariance @ design.T @ (residual * scale).ravel()
        place = place + step
        if np.abs(step).max() < 1e-9:
            break
    return place, covariance


def _radii(paths: Paths, place: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Radius (path,) of a perfectly reflecting pole that loses what each path lost, and the heights of the bounces.

    `erm.poles.pole_spreading` solved for ``a``: with ``q`` the power lost, ``a = 2 s1 s2 cos(el)**2 / (cos(theta) L
    (q - 1))``. A pole that does not reflect perfectly comes out too thin.
    """
    first, second = place - paths.tx[:, :2], place - paths.rx[:, :2]
    d1, d2 = np.hypot(*first.T), np.hypot(*second.T)
    height = paths.rx[:, 2] + (paths.tx[:, 2] - paths.rx[:, 2]) * d2 / (d1 + d2)
    length = np.hypot(d1 + d2, paths.tx[:, 2] - paths.rx[:, 2])
    level = (d1 + d2) / length
    between = np.sum(first * second, axis=-1) / (d1 * d2)
    cosine = np.sqrt((1 + np.clip(between, -0.999, 1)) / 2) * level
    lost = 10 ** (paths.loss / 10)
    s1, s2 = d1 / level, d2 / level
    return 2 * s1 * s2 * level**2 / (cosine * length * np.maximum(lost - 1, 1e-9)), height


def _hidden(paths: Paths, pole: Pole, prints: Sequence[Footprint]) -> bool:
    """Whether most of the paths of a pole would have to pass through walls."""
    point = np.column_stack([np.tile(pole.centre, (len(paths), 1)), _radii(paths, pole.centre)[1]])
    legs = Legs(np.vstack([paths.tx, paths.rx]), np.vstack([point, point]))
    behind = np.zeros(len(legs.start), dtype=bool)
    for print_ in prints:
        behind |= print_.blocks(legs)
    return bool(np.mean(behind.reshape(2, -1).any(axis=0)) > 0.5)
