r"""A single reflection off a vertical cylinder: where it is, how it moves with the cylinder, how it spreads the wave.

Seen from above, the cylinder is a circle with centre ``c``. At the reflection point ``p`` let ``n`` be the unit normal
on the side of the antennas. The signed radius ``a`` is positive where the face is convex toward the antennas and
negative where it is concave, so that in both cases

.. math:: p = c + a n.

By Fermat's principle the length ``|tx - p| + |p - rx|`` is stationary: ``t.(u_tx + u_rx) = 0`` with ``t`` to the left
of ``n`` and unit vectors ``u`` from ``p`` to the antennas. Unfolded at the tangent plane the path has a constant slope,
so heights enter as for vertical planes (`erm.geometry.vertical`), to which all of this tends for large radii.

A measured path gives ``p`` and ``n`` in closed form (`erm.geometry.vertical.reflection_point`), whatever the face is.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from erm.geometry.vertical import FloatArray, azimuth_of, unit

NEWTON_STEPS = 12
"""Steps at most. Convergence is quadratic: six steps go from 0.1 to rounding."""
ON_CIRCLE = 1e-4
"""Deviation of the modulus of a root from 1 up to which it is on the circle: rounding of a quadruple root, a quarter
power. A false one is refused by what Newton's steps leave."""
ANGLE_TOLERANCE = 1e-9
"""Sine of the angle between incidence and reflection up to which a point reflects [rad]: 1e-8 of a degree."""


class Bounce(NamedTuple):
    """Reflections off cylinders, and their slopes by centre, east and north, and signed radius."""

    normal: FloatArray  # (...) degree, azimuth of n; NaN where nothing is reflected
    point: FloatArray  # (..., 2) m
    cosine: FloatArray  # (...) cosine of the angle of incidence, seen from above
    length: FloatArray  # (...) m, seen from above
    azimuth: FloatArray  # (...) degree, of arrival
    length_slopes: FloatArray  # (..., 3) per metre
    azimuth_slopes: FloatArray  # (..., 3) degree per metre
    azimuth_slopes_by_rx: FloatArray  # (..., 2) degree per metre that the receiver moves


def reflection_azimuths(
    tx: npt.ArrayLike, rx: npt.ArrayLike, centre: npt.ArrayLike, radius: npt.ArrayLike
) -> FloatArray:
    r"""Azimuths, seen from the axis, of all points of a circle that reflect between two antennas (Alhazen's problem).

    With the antennas as complex numbers ``a``, ``b`` in units of the radius from the centre, the points ``z`` of the
    circle where the directions to the antennas are symmetric about the normal obey

    .. math:: \bar a \bar b z^4 - (\bar a + \bar b) z^3 + (a + b) z - a b = 0

    and ``(a - z)(b - z) / z**2 > 0``; a negative value is a reflection between one antenna and the opposite of another.

    Parameters
    ----------
    tx, rx, centre : array (..., 2 or more)
        [m].
    radius : array (...)
        Of either sign [m].

    Returns
    -------
    array (..., 4)
        Degrees, NaN where there are fewer. Whether anything is in the way is not asked.

    Examples
    --------
    Two antennas in a round room see reflections off the near and the far wall, and off two points beside them:

    >>> np.sort(reflection_azimuths([1.0, 0.0], [-1.0, 0.0], [0.0, 0.0], 5.0)).round(6).tolist()
    [0.0, 90.0, 180.0, 270.0]
    """
    size = np.abs(np.asarray(radius, dtype=float))
    centre = np.asarray(centre, dtype=float)[..., :2]
    first, second = ((np.asarray(end, dtype=float)[..., :2] - centre) / size[..., None] for end in (tx, rx))
    a, b = np.broadcast_arrays(first[..., 0] + 1j * first[..., 1], second[..., 0] + 1j * second[..., 1])
    # the centre itself reflects from everywhere; a distance of 1e-9 radii keeps the polynomial of degree four
    a, b = (np.where(np.abs(end) < 1e-9, 1e-9, end) for end in (a, b))
    lead = np.conj(a * b)
    companion = np.zeros((*a.shape, 4, 4), dtype=complex)
    companion[..., 0, 0], companion[..., 0, 2] = np.conj(a + b) / lead, -(a + b) / lead
    companion[..., 0, 3] = a * b / lead
    companion[..., 1, 0] = companion[..., 2, 1] = companion[..., 3, 2] = 1.0
    z = np.linalg.eigvals(companion)
    a, b = a[..., None], b[..., None]
    on = np.abs(np.abs(z) - 1) < ON_CIRCLE
    azimuth = np.rad2deg(np.angle(z)) % 360
    azimuth[~(on & (np.real((a - z) * (b - z) / z**2) > 0))] = np.nan
    tx, rx, centre = (np.asarray(end, dtype=float)[..., None, :2] for end in (tx, rx, centre))
    return _polished(tx, rx, centre, size[..., None], azimuth) % 360


def bounce(
    tx: npt.ArrayLike, rx: npt.ArrayLike, centre: npt.ArrayLike, radius: npt.ArrayLike, near: npt.ArrayLike
) -> Bounce:
    r"""Reflection off cylinders near a given normal, with its slopes.

    A stationary length moves with the cylinder as if the point stood still on it: by ``-2 cos(theta) n`` per metre of
    the centre and ``-2 cos(theta)`` per metre of radius. The point moves along the face. With ``s1``, ``s2`` the
    distances to the antennas, and ``u_rx = cos(theta) n - sin(theta) t``, Fermat's condition gives

    .. math:: \mathrm{d}\phi = -\frac{\cos\theta\,(1/s_1 + 1/s_2)\, t\cdot\mathrm{d}c
        + \sin\theta\,(1/s_2 - 1/s_1)\,(n\cdot\mathrm{d}c + \mathrm{d}a)}{2 + a \cos\theta\,(1/s_1 + 1/s_2)},
        \qquad \mathrm{d}p = \mathrm{d}c + n\,\mathrm{d}a + a\,t\,\mathrm{d}\phi.

    The denominator is 0 at a caustic of a concave face. A receiver that moves turns the point by
    ``(cos(theta) t + sin(theta) n).dr / s2`` over the same denominator.

    Parameters
    ----------
    tx, rx, centre : array (..., 2 or more)
        [m].
    radius : array (...)
        Positive where convex toward the antennas [m].
    near : array (...)
        Azimuth of the normal from which the search starts [degree].

    Returns
    -------
    Bounce
        NaN where the search ends nowhere, or an antenna is behind the face.

    Examples
    --------
    A pillar between two antennas reflects on the side of both; one that is thicker shortens the path by 2 cos(theta):

    >>> found = bounce([5.0, 0.0], [0.0, 5.0], [0.0, 0.0], 1.0, 40.0)
    >>> found.normal.round(6).item(), found.length.round(2).item(), found.length_slopes[2].round(2).item()
    (45.0, 8.7, -1.17)
    """
    tx, rx, centre = (np.asarray(end, dtype=float)[..., :2] for end in (tx, rx, centre))
    radius, near = np.asarray(radius, dtype=float), np.asarray(near, dtype=float)
    normal = _polished(tx, rx, centre, radius, near)
    n = unit(normal)
    t = np.stack([-n[..., 1], n[..., 0]], axis=-1)
    point = centre + radius[..., None] * n
    to_tx, to_rx = tx - point, rx - point
    s1, s2 = np.linalg.norm(to_tx, axis=-1), np.linalg.norm(to_rx, axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        cosine = np.sum(n * to_rx, axis=-1) / s2
        sine = -np.sum(t * to_rx, axis=-1) / s2
        across, skew = cosine * (1 / s1 + 1 / s2), sine * (1 / s2 - 1 / s1)
        by_centre = across[..., None] * t + skew[..., None] * n
        turn = -np.concatenate([by_centre, skew[..., None]], axis=-1) / (2 + radius * across)[..., None]
        hidden = ~(np.minimum(cosine, np.sum(n * to_tx, axis=-1)) > 0)
        left = np.stack([to_rx[..., 1], -to_rx[..., 0]], axis=-1) / (s2**2)[..., None]  # of the ray to the point
    still = np.concatenate([left, np.sum(left * n, axis=-1)[..., None]], axis=-1)
    along = radius * np.sum(left * t, axis=-1)
    azimuth_slopes = np.rad2deg(still + along[..., None] * turn)
    with np.errstate(divide="ignore", invalid="ignore"):
        turn_by_rx = (cosine[..., None] * t + sine[..., None] * n) / (s2 * (2 + radius * across))[..., None]
    by_rx = np.rad2deg(along[..., None] * turn_by_rx - left)
    length_slopes = -2 * cosine[..., None] * np.concatenate([n, np.ones_like(n[..., :1])], axis=-1)
    azimuth = azimuth_of(-to_rx)
    found = Bounce(normal % 360, point, cosine, s1 + s2, azimuth, length_slopes, azimuth_slopes, by_rx)
    return Bounce(*(np.where(hidden.reshape(hidden.shape + (1,) * (v.ndim - hidden.ndim)), np.nan, v) for v in found))


def spreading_factor(
    s1: npt.ArrayLike, s2: npt.ArrayLike, radius: npt.ArrayLike, cosine: npt.ArrayLike, cos_elevation: npt.ArrayLike
) -> FloatArray:
    r"""Power that a cylinder reflects into a direction relative to a plane, by geometric optics.

    The reflected wavefront keeps its radius ``s1`` along the axis and has ``1/rho = 1/s1 + 2 cos(el)**2 / (a cos(th))``
    around it. The ratio is

    .. math:: \left| 1 + \frac{2 s_1 s_2 \cos^2 el}{(s_1 + s_2)\, a \cos\theta} \right|^{-1}.

    It is symmetric in the antennas, 1 for a plane, and infinite at a caustic of a concave face, where geometric optics
    fails. It holds for radii of many wavelengths.

    Parameters
    ----------
    s1, s2 : array (...)
        Distances of the reflection point from the antennas [m].
    radius : array (...)
        Negative where concave [m].
    cosine : array (...)
        Cosine of the angle of incidence, in space.
    cos_elevation : array (...)
        Cosine of the elevation of the ray.

    References
    ----------
    R. G. Kouyoumjian, P. H. Pathak, Proc. IEEE 62 (1974) 1448-1461, caustic distances of a reflected ray;
    C. A. Balanis, Advanced Engineering Electromagnetics, section 13.2.

    Examples
    --------
    >>> spreading_factor(10.0, 10.0, [0.1, 1e9, -20.0], 1.0, 1.0).round(4).tolist()
    [0.0099, 1.0, 2.0]
    """
    s1, s2, radius, cosine, cos_elevation = (
        np.asarray(value, dtype=float) for value in (s1, s2, radius, cosine, cos_elevation)
    )
    with np.errstate(divide="ignore"):
        return 1 / np.abs(1 + 2 * s1 * s2 * cos_elevation**2 / ((s1 + s2) * radius * cosine))


def _polished(
    tx: FloatArray, rx: FloatArray, centre: FloatArray, radius: FloatArray, azimuth: FloatArray
) -> FloatArray:
    """Normals [degree] after Newton's steps for Fermat's condition; NaN where they do not converge."""
    phi = np.deg2rad(azimuth)
    ends = [((end - centre)[..., 0], (end - centre)[..., 1]) for end in (tx, rx)]
    with np.errstate(divide="ignore", invalid="ignore"):
        for _ in range(NEWTON_STEPS):
            cosine, sine = np.cos(phi), np.sin(phi)
            value, slope = np.zeros_like(phi), np.zeros_like(phi)
            for east, north in ends:
                along, aside = cosine * east + sine * north - radius, cosine * north - sine * east
                distance = np.sqrt(along * along + aside * aside)
                of_t = aside / distance
                value, slope = value + of_t, slope - along / distance - radius * (1 - of_t * of_t) / distance
            if not np.any(np.abs(value) > ANGLE_TOLERANCE):
                break
            phi = phi + np.clip(-value / slope, -0.5, 0.5)
    return np.where(np.abs(value) < ANGLE_TOLERANCE, np.rad2deg(phi), np.nan)
