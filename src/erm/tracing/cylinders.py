"""Specular reflection by vertical cylinders: lamp posts, pillars, masts."""

import numpy as np


def pole_reflections(
    tx: np.ndarray, rx: np.ndarray, centre: np.ndarray, radius: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Reflection points on vertical cylinders.

    In the plan view the point lies on the arc between the directions to the two antennas, where the angles of incidence
    and reflection are equal. Their difference grows along the arc, so bisection finds the point. Its height is
    proportional to the horizontal length from the transmitter, as on any vertical face.

    Parameters
    ----------
    tx, rx : array (3,)
        Positions of the antennas [m].
    centre : array (pole, 2)
        Centres of the poles [m].
    radius : array (pole,)
        Radii of the poles [m].

    Returns
    -------
    point : array (pole, 3)
        Reflection points [m]; NaN if an antenna is inside the pole or the pole is between the antennas.
    normal : array (pole, 3)
        Outward unit normals at these points.
    """
    to_tx, to_rx = tx[:2] - centre, rx[:2] - centre
    start = np.arctan2(to_tx[:, 1], to_tx[:, 0])
    arc = (np.arctan2(to_rx[:, 1], to_rx[:, 0]) - start + np.pi) % (2 * np.pi) - np.pi
    low, high = np.zeros(len(centre)), np.ones(len(centre))
    for _ in range(60):  # 60 halvings reach the resolution of floats
        middle = (low + high) / 2
        outward = _outward(start + middle * arc)
        bounce = outward * radius[:, None]
        before = _angle(to_tx - bounce, outward) < _angle(to_rx - bounce, outward)
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    outward = _outward(start + low * arc)
    bounce = outward * radius[:, None]
    first, second = to_tx - bounce, to_rx - bounce
    lit = ((first * outward).sum(-1) > 0) & ((second * outward).sum(-1) > 0)
    to_point, total = np.hypot(*first.T), np.hypot(*first.T) + np.hypot(*second.T)
    height = tx[2] + (rx[2] - tx[2]) * to_point / total
    point = np.concatenate([centre + bounce, height[:, None]], axis=1)
    normal = np.concatenate([outward, np.zeros((len(centre), 1))], axis=1)
    return np.where(lit[:, None], point, np.nan), normal


def pole_spreading(
    tx: np.ndarray, rx: np.ndarray, point: np.ndarray, normal: np.ndarray, radius: np.ndarray
) -> np.ndarray:
    """Length that replaces the path length in ``lambda / (4 pi L)`` after reflection by a vertical cylinder.

    Geometric optics: the reflected wavefront keeps its radius ``s1`` along the axis and has ``1/rho = 1/s1 +
    2 cos(el)^2 / (a cos(theta))`` around it, with radius ``a``, elevation ``el`` of the ray and incidence
    ``theta``; ``sqrt(rho s1 / ((rho + s2) (s1 + s2))) / s1`` is then one over::

        sqrt(L (L + 2 s1 s2 cos(el)^2 / (a cos(theta)))),   L = s1 + s2

    This is symmetric in the two antennas and tends to ``L`` for a flat wall, ``a`` to infinity. It holds for
    radii of many wavelengths.

    Parameters
    ----------
    tx, rx : array (3,)
        Positions of the antennas [m].
    point, normal : array (pole, 3)
        Results of `pole_reflections`.
    radius : array (pole,)
        Radii of the poles [m].

    Returns
    -------
    array (pole,)
        Lengths [m].

    References
    ----------
    R. G. Kouyoumjian, P. H. Pathak, Proc. IEEE 62 (1974) 1448-1461, caustic distances of a reflected ray;
    C. A. Balanis, Advanced Engineering Electromagnetics, section 13.2.
    """
    first, second = point - tx, rx - point
    s1, s2 = np.linalg.norm(first, axis=-1), np.linalg.norm(second, axis=-1)
    level = (first[:, :2] ** 2).sum(-1) / s1**2
    cosine = -(first * normal).sum(-1) / s1
    return np.sqrt((s1 + s2) * (s1 + s2 + 2 * s1 * s2 * level / (radius * cosine)))


def _outward(azimuth: np.ndarray) -> np.ndarray:
    return np.stack([np.cos(azimuth), np.sin(azimuth)], axis=-1)


def _angle(ray: np.ndarray, normal: np.ndarray) -> np.ndarray:
    along = (ray * normal).sum(-1)
    across = np.abs(ray[:, 0] * normal[:, 1] - ray[:, 1] * normal[:, 0])
    return np.arctan2(across, along)
