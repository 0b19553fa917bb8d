r"""A single bounce off a plane of any slope: the face told by delay, azimuth and elevation together.

`erm.geometry.vertical` takes faces for vertical, which needs no elevation. Where elevation was measured, the picture
is the same in space: ``u`` is the unit vector toward which the receiver looks to see the path, ``d = rx - tx``, and the
transmitter's mirror image is ``VA = rx + L u`` with the slant length ``L``. The face is the plane halfway between TX
and VA, and the reflection point is where the ray from RX to VA crosses it. A scattered single bounce has its point
there, too, although no mirror stands there.

Results are NaN where the path is not longer than the direct one, or the elevation unknown.

References
----------
Chang et al., Eqs. 1-3, with the vectors of space in place of those of the plane.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from erm.geometry.vertical import ROUNDING, FloatArray, azimuth_of


class SlopedFace(NamedTuple):
    """Faces ``n.p = offset``, ``n`` toward the antennas, and where they reflect."""

    point: FloatArray  # (..., 3) m, reflection point
    normal: FloatArray  # (...) degree, azimuth of n
    tilt: FloatArray  # (...) degree, elevation of n: 0 of a wall, 90 of the ground, -90 of a ceiling
    offset: FloatArray  # (...) m


def sloped_face(
    tx: npt.ArrayLike, rx: npt.ArrayLike, path_length: npt.ArrayLike, azimuth: npt.ArrayLike, elevation: npt.ArrayLike
) -> SlopedFace:
    """Locate the single bounce of a path on a plane of any slope.

    The bounce lies ``r = (L**2 - |d|**2) / (2 (L + u.d))`` along ``u`` from the receiver.

    Parameters
    ----------
    tx, rx : array (..., 3)
        Antenna positions, east/north/up [m].
    path_length : array (...)
        Propagation delay times the speed of light [m].
    azimuth, elevation : array (...)
        Direction toward which the receiver looks to see the path [degree].
    """
    tx, rx, length, toward = _path(tx, rx, path_length, azimuth, elevation)
    image = rx + length[..., None] * toward
    n = tx - image
    n = n / np.linalg.norm(n, axis=-1, keepdims=True)
    tilt = np.rad2deg(np.arctan2(n[..., 2], np.hypot(n[..., 0], n[..., 1])))
    return SlopedFace(
        rx + _reach(tx, rx, length, toward)[..., None] * toward,
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

    With the slopes ``t_a``, ``t_e`` of ``u`` by azimuth and elevation,

    .. math:: \mathrm{d}p = u\,\mathrm{d}r + r\,\mathrm{d}u, \qquad
              \mathrm{d}r = \frac{(L - r)\,\mathrm{d}L - r\,d\cdot\mathrm{d}u}{L + u\cdot d}, \qquad
              \mathrm{d}n = -(1 - n n')\,\mathrm{d}v / |v|, \quad \mathrm{d}v = u\,\mathrm{d}L + L\,\mathrm{d}u,

    and the offset, ``n.(tx + VA) / 2``, moves by ``dn.(tx + VA) / 2 + n.dv / 2``.

    Parameters
    ----------
    covariance : array (..., 3, 3)
        Of (path length [m], azimuth [degree], elevation [degree]).

    Returns
    -------
    point : array (..., 3, 3)
        East/north/up [m2].
    face : array (..., 3, 3)
        Of (normal [degree], tilt [degree], offset [m]). Toward a level face the azimuth of its normal means less and
        less, and its variance grows as ``1 / cos(tilt)**2``.
    """
    tx, rx, length, toward = _path(tx, rx, path_length, azimuth, elevation)
    reach, apart = _reach(tx, rx, length, toward), rx - tx
    du = np.stack([np.zeros_like(toward), *_turned(azimuth, elevation, toward)], axis=-1)  # (..., 3, 3 parameters)
    dl = np.array([1.0, 0.0, 0.0])
    sum_ = length + np.sum(toward * apart, axis=-1)
    dr = ((length - reach)[..., None] * dl - reach[..., None] * np.sum(apart[..., None] * du, axis=-2)) / sum_[
        ..., None
    ]
    of_point = toward[..., None] * dr[..., None, :] + reach[..., None, None] * du
    image = rx + length[..., None] * toward
    size = np.linalg.norm(tx - image, axis=-1)
    n = (tx - image) / size[..., None]
    dv = toward[..., None] * dl + length[..., None, None] * du
    dn = (n[..., None] * np.sum(n[..., None] * dv, axis=-2, keepdims=True) - dv) / size[..., None, None]
    level = np.hypot(n[..., 0], n[..., 1])
    with np.errstate(divide="ignore", invalid="ignore"):
        aside = np.stack([-n[..., 1], n[..., 0], np.zeros_like(level)], axis=-1) / level[..., None]
        above = np.stack([-n[..., 2] * aside[..., 1], n[..., 2] * aside[..., 0], level], axis=-1)
        turn = np.sum(aside[..., None] * dn, axis=-2) / level[..., None]
    shift = np.sum((tx + image)[..., None] * dn + n[..., None] * dv, axis=-2) / 2
    of_face = np.stack([np.rad2deg(turn), np.rad2deg(np.sum(above[..., None] * dn, axis=-2)), shift], axis=-2)
    given = np.asarray(covariance, dtype=float)
    return tuple(slopes @ given @ np.swapaxes(slopes, -1, -2) for slopes in (of_point, of_face))


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


def _turned(azimuth: npt.ArrayLike, elevation: npt.ArrayLike, toward: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Slopes (..., 3) of the unit vector by azimuth and elevation [1/degree]."""
    around = np.deg2rad(np.broadcast_to(np.asarray(azimuth, dtype=float), toward.shape[:-1]))
    level = np.cos(np.deg2rad(np.asarray(elevation, dtype=float)))
    by_azimuth = np.stack([-toward[..., 1], toward[..., 0], np.zeros_like(around)], axis=-1)
    up = toward[..., 2]
    by_elevation = np.stack([-up * np.cos(around), -up * np.sin(around), np.broadcast_to(level, up.shape)], axis=-1)
    return np.deg2rad(by_azimuth), np.deg2rad(by_elevation)


def _reach(tx: FloatArray, rx: FloatArray, length: FloatArray, toward: FloatArray) -> FloatArray:
    """Distance (...) from the receiver to the bounce [m]."""
    apart = rx - tx
    return (length**2 - np.sum(apart**2, axis=-1)) / (2 * (length + np.sum(toward * apart, axis=-1)))
