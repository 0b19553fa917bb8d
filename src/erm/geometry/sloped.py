r"""A single reflection off a plane of any slope, located by delay, azimuth and elevation together.

`erm.geometry.vertical` assumes vertical faces and needs no elevation. With a measured elevation the geometry is the
same in space: ``u`` is the unit vector toward which the receiver looks to see the path, ``d = rx - tx``, and the mirror
image of the transmitter is ``VA = rx + L u`` with the slant length ``L``. The face is the plane halfway between TX and
VA, and the reflection point is where the ray from RX to VA crosses it. A single diffuse
reflection comes from the same point, although there is no mirror.

Results are NaN where the path is not longer than the direct one, or the elevation is unknown.

References
----------
Chang et al., Eqs. 1-3, with vectors in space in place of those in the plane.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from erm.geometry.vertical import ROUNDING, FloatArray, azimuth_of, distance_to_reflection


class SlopedFace(NamedTuple):
    """Faces ``n.p = offset``, ``n`` toward the antennas, and their reflection points."""

    point: FloatArray  # (..., 3) m, reflection point
    normal: FloatArray  # (...) degree, azimuth of n
    tilt: FloatArray  # (...) degree, elevation of n: 0 of a wall, 90 of the ground, -90 of a ceiling
    offset: FloatArray  # (...) m


def sloped_face(
    tx: npt.ArrayLike, rx: npt.ArrayLike, path_length: npt.ArrayLike, azimuth: npt.ArrayLike, elevation: npt.ArrayLike
) -> SlopedFace:
    """Locate the single reflection of a path off a plane of any slope.

    The reflection point lies ``r = (L**2 - |d|**2) / (2 (L + u.d))`` along ``u`` from the receiver.

    Parameters
    ----------
    tx, rx : array (..., 3)
        Antenna positions, east/north/up [m].
    path_length : array (...)
        Propagation delay times the speed of light [m].
    azimuth, elevation : array (...)
        Direction toward which the receiver looks to see the path [degree].

    Returns
    -------
    SlopedFace
        All NaN where the path is not longer than the direct one, or the elevation is unknown. The azimuth of the normal
        of a level face is arbitrary.

    Examples
    --------
    The ground between two antennas at a height of 3 m:

    >>> face = sloped_face([0, 0, 3], [8, 0, 3], 10.0, 180.0, np.rad2deg(np.arcsin(-0.6)))
    >>> (face.point.round(3) + 0).tolist(), face.tilt.round(3).item()
    ([4.0, 0.0, 0.0], 90.0)
    """
    tx, rx, length, toward = _path(tx, rx, path_length, azimuth, elevation)
    image = rx + length[..., None] * toward
    n = tx - image
    n = n / np.linalg.norm(n, axis=-1, keepdims=True)
    tilt = np.rad2deg(np.arctan2(n[..., 2], np.hypot(n[..., 0], n[..., 1])))
    return SlopedFace(
        rx + distance_to_reflection(rx - tx, length, toward)[..., None] * toward,
        np.where(np.isnan(tilt), np.nan, azimuth_of(n)),
        tilt,
        np.sum(n * (tx + image), axis=-1) / 2,
    )


def sloped_covariance(
    tx: npt.ArrayLike,
    rx: npt.ArrayLike,
    path_length: npt.ArrayLike,
    azimuth: npt.ArrayLike,
    elevation: npt.ArrayLike,
    covariance: npt.ArrayLike,
) -> tuple[FloatArray, FloatArray]:
    r"""First-order covariances of the reflection point and of the face.

    With ``v = VA - tx`` and ``du`` from the slopes of ``u`` by azimuth and elevation,

    .. math:: \mathrm{d}p = u\,\mathrm{d}r + r\,\mathrm{d}u, \qquad
              \mathrm{d}r = \frac{(L - r)\,\mathrm{d}L - r\,d\cdot\mathrm{d}u}{L + u\cdot d}, \qquad
              \mathrm{d}n = -(1 - n n')\,\mathrm{d}v / |v|, \quad \mathrm{d}v = u\,\mathrm{d}L + L\,\mathrm{d}u,

    and the offset ``n.(tx + VA) / 2`` changes by ``dn.(tx + VA) / 2 + n.dv / 2``.

    Parameters
    ----------
    tx, rx, path_length, azimuth, elevation
        See `sloped_face`.
    covariance : array (..., 3, 3)
        Of (path length [m], azimuth [degree], elevation [degree]).

    Returns
    -------
    point : array (..., 3, 3)
        East/north/up [m2]; NaN where there is no face.
    face : array (..., 3, 3)
        Of (normal [degree], tilt [degree], offset [m]); NaN likewise. The variance of the normal grows as
        ``1 / cos(tilt)**2``; for a level face it is not finite.

    Examples
    --------
    An elevation error of 1 degree tilts the face and, 3 m above the origin, shifts its offset:

    >>> point, face = sloped_covariance([0, 0, 3], [6, 2, 3], 10.0, 126.87, 0.0, np.diag([0, 0, 1.0]))
    >>> (np.sqrt(np.abs(np.diagonal(face))).round(3) + 0).tolist()
    [0.0, 1.0, 0.052]
    """
    tx, rx, length, toward = _path(tx, rx, path_length, azimuth, elevation)
    d = rx - tx
    r = distance_to_reflection(d, length, toward)
    du = np.stack([np.zeros_like(toward), *_direction_slopes(azimuth, elevation, toward)], axis=-1)  # (..., 3, 3)
    dl = np.array([1.0, 0.0, 0.0])
    denominator = length + np.sum(toward * d, axis=-1)
    dr = (length - r)[..., None] * dl - r[..., None] * np.sum(d[..., None] * du, axis=-2)
    dr = dr / denominator[..., None]
    of_point = toward[..., None] * dr[..., None, :] + r[..., None, None] * du
    image = rx + length[..., None] * toward
    size = np.linalg.norm(tx - image, axis=-1)
    n = (tx - image) / size[..., None]
    dv = toward[..., None] * dl + length[..., None, None] * du
    dn = (n[..., None] * np.sum(n[..., None] * dv, axis=-2, keepdims=True) - dv) / size[..., None, None]
    cos_tilt = np.hypot(n[..., 0], n[..., 1])
    with np.errstate(divide="ignore", invalid="ignore"):  # a level face has no azimuth
        by_normal = np.stack([-n[..., 1], n[..., 0], np.zeros_like(cos_tilt)], axis=-1) / cos_tilt[..., None]
        by_tilt = np.stack([-n[..., 2] * by_normal[..., 1], n[..., 2] * by_normal[..., 0], cos_tilt], axis=-1)
        dphi = np.sum(by_normal[..., None] * dn, axis=-2) / cos_tilt[..., None]
    do = np.sum((tx + image)[..., None] * dn + n[..., None] * dv, axis=-2) / 2
    of_face = np.stack([np.rad2deg(dphi), np.rad2deg(np.sum(by_tilt[..., None] * dn, axis=-2)), do], axis=-2)
    given = np.asarray(covariance, dtype=float)
    point, face = (slopes @ given @ np.swapaxes(slopes, -1, -2) for slopes in (of_point, of_face))
    return point, face


def _path(
    tx: npt.ArrayLike, rx: npt.ArrayLike, path_length: npt.ArrayLike, azimuth: npt.ArrayLike, elevation: npt.ArrayLike
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Antennas, length (NaN if not longer than the direct path) and unit vector toward the arrival."""
    tx, rx, length = (np.asarray(value, dtype=float) for value in (tx, rx, path_length))
    direct = np.sum((rx - tx) ** 2, axis=-1)
    length = np.where((length > 0) & (length**2 > direct * (1 + ROUNDING)), length, np.nan)
    up, around = np.broadcast_arrays(*(np.deg2rad(np.asarray(angle, dtype=float)) for angle in (elevation, azimuth)))
    toward = np.stack([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)], axis=-1)
    return tx, rx, length, toward


def _direction_slopes(
    azimuth: npt.ArrayLike, elevation: npt.ArrayLike, toward: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Slopes (..., 3) of the unit vector (..., 3) by azimuth and by elevation [1/degree]."""
    around = np.deg2rad(np.broadcast_to(np.asarray(azimuth, dtype=float), toward.shape[:-1]))
    cos_elevation = np.cos(np.deg2rad(np.asarray(elevation, dtype=float)))
    up = toward[..., 2]
    by_azimuth = np.stack([-toward[..., 1], toward[..., 0], np.zeros_like(around)], axis=-1)
    by_elevation = np.stack(
        [-up * np.cos(around), -up * np.sin(around), np.broadcast_to(cos_elevation, up.shape)], axis=-1
    )
    return np.deg2rad(by_azimuth), np.deg2rad(by_elevation)
