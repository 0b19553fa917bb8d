"""Mirror images: where a path bounced once, and the face it bounced off, in closed form with its errors.

One picture carries every function here. With ``d = rx - tx`` seen from above, ``u`` the horizontal unit
vector toward which the receiver looks to see the path and ``L_h`` the path's horizontal length, the
transmitter's mirror image in the face is the *virtual anchor* ``VA = rx + L_h u``. The face is the
perpendicular bisector of TX and VA, and the reflection point is where the ray from RX to VA crosses it.

``L_h**2 = L**2 - (z_tx - z_rx)**2`` is exact for vertical faces: unfolded at a vertical mirror, the path is a
straight line that climbs from one antenna's height to the other's. With ``planar=True`` the slant length
``L`` is used as printed in the letter, which is wrong by metres when the antennas' heights differ by tens of
metres; it exists to be compared.

Positions are (..., 3) arrays, east/north/up [m]; a trailing dimension of 2 is read as equal heights. All
arguments broadcast against each other. Results are NaN where the path is not longer than the direct one:
there is no face then.
"""

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
ROUNDING = 1e-9  # of the squared length; less excess than that is arithmetic, 50 nm on 100 m


def horizontal_length(
    tx: npt.ArrayLike, rx: npt.ArrayLike, path_length: npt.ArrayLike, *, planar: bool = False
) -> FloatArray:
    """Length of a path seen from above, given that it met vertical faces only.

    Parameters
    ----------
    tx, rx : array (..., 2 or 3)
        Antenna positions [m].
    path_length : array (...)
        Propagation delay times the speed of light [m].
    planar : bool
        Take the slant length for the horizontal one, as the letter does.

    Returns
    -------
    array (...)
        ``sqrt(L**2 - (z_tx - z_rx)**2)`` [m]; NaN unless it is longer than the horizontal distance TX-RX by
        more than rounding.
    """
    tx, rx, length = (np.asarray(value, dtype=float) for value in (tx, rx, path_length))
    climb = 0.0 if planar or tx.shape[-1] == 2 else tx[..., 2] - rx[..., 2]
    squared = length**2 - climb**2
    direct = np.sum((rx[..., :2] - tx[..., :2]) ** 2, axis=-1)
    return np.sqrt(np.where((length > 0) & (squared > direct * (1 + ROUNDING)), squared, np.nan))


def unit(azimuth: npt.ArrayLike) -> FloatArray:
    """Horizontal unit vectors (..., 2) of azimuths [degree, counter-clockwise from east]."""
    angle = np.deg2rad(np.asarray(azimuth, dtype=float))
    vector = np.empty((*angle.shape, 2))
    vector[..., 0], vector[..., 1] = np.cos(angle), np.sin(angle)
    return vector


def distinct_rows(points: FloatArray) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """First row (place,) of each different point (n, coordinate), ordered by coordinates, and place (n,) of each.

    What ``np.unique(points, axis=0)`` tells, in a quarter of its time: that compares rows byte by byte.
    """
    order = np.lexsort(points.T[::-1])
    ranked = points[order]
    new = np.ones(len(points), dtype=bool)
    new[1:] = (ranked[1:] != ranked[:-1]).any(axis=1)
    place = np.empty(len(points), dtype=np.int64)
    place[order] = np.cumsum(new) - 1
    return order[new], place


def azimuth_of(vector: npt.ArrayLike) -> FloatArray:
    """Azimuth in [0, 360) of horizontal vectors (..., 2 or more) [degree, counter-clockwise from east]."""
    vector = np.asarray(vector, dtype=float)
    return np.rad2deg(np.arctan2(vector[..., 1], vector[..., 0])) % 360


def angle_difference(a: npt.ArrayLike, b: npt.ArrayLike) -> FloatArray:
    """``a - b`` the short way round, in [-180, 180) [degree]."""
    apart = np.asarray(a, dtype=float) - np.asarray(b, dtype=float)
    return np.asarray(apart - 360 * np.floor((apart + 180) / 360))  # the remainder of floats takes six times as long


def virtual_anchor(
    tx: npt.ArrayLike,
    rx: npt.ArrayLike,
    path_length: npt.ArrayLike,
    azimuth: npt.ArrayLike,
    *,
    planar: bool = False,
) -> FloatArray:
    """Mirror image of the transmitter in the face, ``rx + L_h u``.

    All paths off one vertical face, whatever the receiver, share it.

    Returns
    -------
    array (..., 2)
        East/north [m]; NaN where the path is not longer than the direct one.
    """
    rx = np.asarray(rx, dtype=float)
    length = horizontal_length(tx, rx, path_length, planar=planar)
    return rx[..., :2] + length[..., None] * unit(azimuth)


def reflection_point(
    tx: npt.ArrayLike,
    rx: npt.ArrayLike,
    path_length: npt.ArrayLike,
    azimuth: npt.ArrayLike,
    *,
    planar: bool = False,
) -> tuple[FloatArray, FloatArray]:
    """Locate the single bounce of a path on a vertical face.

    The bounce lies ``r = (L_h**2 - |d|**2) / (2 (L_h + u.d))`` along ``u`` from the receiver.

    Parameters
    ----------
    tx, rx : array (..., 2 or 3)
        Antenna positions, east/north/up [m].
    path_length : array (...)
        Propagation delay times the speed of light [m].
    azimuth : array (...)
        Direction toward which the receiver looks to see the path [degree, counter-clockwise from east].
    planar : bool
        Take the slant length for the horizontal one, as the letter does.

    Returns
    -------
    point : array (..., 2)
        Reflection point, east/north [m]; NaN where the path is not longer than the direct one.
    normal : array (...)
        Azimuth of the face's normal, on the antennas' side, in [0, 360) [degree].

    References
    ----------
    Chang et al., Eqs. 1-3, in closed form and with the antennas' heights.
    """
    tx, rx = np.asarray(tx, dtype=float), np.asarray(rx, dtype=float)
    toward = unit(azimuth)
    length = horizontal_length(tx, rx, path_length, planar=planar)
    point = rx[..., :2] + _reach(tx, rx, length, toward)[..., None] * toward
    normal = azimuth_of(tx[..., :2] - rx[..., :2] - length[..., None] * toward)
    return point, normal


def bounce_height(
    tx: npt.ArrayLike, rx: npt.ArrayLike, path_length: npt.ArrayLike, azimuth: npt.ArrayLike
) -> FloatArray:
    """Height of the bounce on a vertical face: ``z_rx + (z_tx - z_rx) r / L_h`` [m].

    The height is linear in the horizontal path length, so it always lies between the antennas' heights.
    """
    tx, rx = np.asarray(tx, dtype=float), np.asarray(rx, dtype=float)
    length = horizontal_length(tx, rx, path_length)
    return rx[..., 2] + (tx[..., 2] - rx[..., 2]) * _reach(tx, rx, length, unit(azimuth)) / length


def face_line(
    tx: npt.ArrayLike,
    rx: npt.ArrayLike,
    path_length: npt.ArrayLike,
    azimuth: npt.ArrayLike,
    *,
    planar: bool = False,
) -> tuple[FloatArray, FloatArray]:
    """Line of the face a path bounced off: the points ``p`` with ``n.p = offset``.

    Returns
    -------
    normal : array (...)
        Azimuth of ``n``, on the antennas' side, in [0, 360) [degree].
    offset : array (...)
        Signed distance of the line from the origin along ``n`` [m].
    """
    tx = np.asarray(tx, dtype=float)
    return bisector(tx[..., :2], virtual_anchor(tx, rx, path_length, azimuth, planar=planar))


def bisector(near: npt.ArrayLike, far: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Mirror line of a point and its image: normal [degree] toward ``near``, and offset [m]."""
    near, far = np.asarray(near, dtype=float)[..., :2], np.asarray(far, dtype=float)[..., :2]
    normal = azimuth_of(near - far)
    return normal, np.sum(unit(normal) * (near + far) / 2, axis=-1)


def mirrored(point: npt.ArrayLike, normal: npt.ArrayLike, offset: npt.ArrayLike) -> FloatArray:
    """Mirror image (..., 2) of points in lines, ``p + 2 (offset - n.p) n``."""
    point = np.asarray(point, dtype=float)[..., :2]
    n = unit(normal)
    return point + 2 * (np.asarray(offset, dtype=float) - np.sum(n * point, axis=-1))[..., None] * n


def point_covariance(
    tx: npt.ArrayLike,
    rx: npt.ArrayLike,
    path_length: npt.ArrayLike,
    azimuth: npt.ArrayLike,
    path_length_std: npt.ArrayLike,
    azimuth_std: npt.ArrayLike,
) -> FloatArray:
    r"""First-order covariance of the reflection point.

    With ``t`` the unit vector left of ``u`` and ``h = z_tx - z_rx``, the point is ``(rx + r u, z_rx + h r / L_h)``, and

    .. math:: \partial r/\partial L_h = (L_h - r)/(L_h + u\cdot d), \qquad
              \partial r/\partial \alpha = -r\,(t\cdot d)/(L_h + u\cdot d),

    with ``du = t da`` and :math:`\partial L_h/\partial L = L/L_h`. Seen from above, an azimuth error moves it along
    the tangent to the bistatic ellipse, hence along the face, and off it only in second order.

    Parameters
    ----------
    path_length_std, azimuth_std : array (...)
        Independent standard errors [m], [degree].

    Returns
    -------
    array (..., 3, 3)
        East/north/up covariance [m2]; of antennas without heights that of up is zero.
    """
    tx, rx, slant = (np.asarray(value, dtype=float) for value in (tx, rx, path_length))
    length = horizontal_length(tx, rx, slant)
    toward, left = unit(azimuth), unit(np.asarray(azimuth, dtype=float) + 90)
    reach = _reach(tx, rx, length, toward)
    apart = rx[..., :2] - tx[..., :2]
    climb = 0.0 if tx.shape[-1] == 2 else tx[..., 2] - rx[..., 2]
    sum_ = length + np.sum(toward * apart, axis=-1)
    further = np.stack([(length - reach) / sum_, -reach * np.sum(left * apart, axis=-1) / sum_], axis=-1)
    level = toward[..., None, :] * further[..., None]
    level[..., 1, :] += reach[..., None] * left
    up = further * (climb / length)[..., None]
    up[..., 0] -= climb * reach / length**2
    by_length, by_azimuth = np.moveaxis(np.concatenate([level, up[..., None]], axis=-1), -2, 0)
    by_length = by_length * (slant / length)[..., None]
    return _propagated(by_length, by_azimuth, path_length_std, np.deg2rad(azimuth_std))


def line_covariance(
    tx: npt.ArrayLike,
    rx: npt.ArrayLike,
    path_length: npt.ArrayLike,
    azimuth: npt.ArrayLike,
    path_length_std: npt.ArrayLike,
    azimuth_std: npt.ArrayLike,
) -> FloatArray:
    r"""First-order covariance of the face's (normal, offset).

    With ``v = VA - tx = d + L_h u``, ``n = -v/|v|`` and ``m`` the unit vector left of ``n``,

    .. math:: \mathrm{d}\phi = -m\cdot\mathrm{d}v/|v|, \qquad
              \mathrm{d}o = (m\cdot tx)\,\mathrm{d}\phi + n\cdot\mathrm{d}v/2, \qquad
              \mathrm{d}v = u\,\mathrm{d}L_h + L_h t\,\mathrm{d}\alpha.

    Returns
    -------
    array (..., 2, 2)
        Covariance of (normal [degree], offset [m]).
    """
    tx, rx, slant = (np.asarray(value, dtype=float) for value in (tx, rx, path_length))
    length = horizontal_length(tx, rx, slant)
    toward, left = unit(azimuth), unit(np.asarray(azimuth, dtype=float) + 90)
    v = rx[..., :2] - tx[..., :2] + length[..., None] * toward
    size = np.linalg.norm(v, axis=-1)
    n = -v / size[..., None]
    m = np.stack([-n[..., 1], n[..., 0]], axis=-1)

    def change(dv: FloatArray) -> FloatArray:
        turn = -np.sum(m * dv, axis=-1) / size
        shift = np.sum(m * tx[..., :2], axis=-1) * turn + np.sum(n * dv, axis=-1) / 2
        return np.stack([np.rad2deg(turn), shift], axis=-1)

    by_length = change(toward * (slant / length)[..., None])
    by_azimuth = change(left * length[..., None])
    return _propagated(by_length, by_azimuth, path_length_std, np.deg2rad(azimuth_std))


def _reach(tx: FloatArray, rx: FloatArray, length: FloatArray, toward: FloatArray) -> FloatArray:
    """Horizontal distance (...) from the receiver to the bounce [m]."""
    apart = rx[..., :2] - tx[..., :2]
    return (length**2 - np.sum(apart**2, axis=-1)) / (2 * (length + np.sum(toward * apart, axis=-1)))


def _propagated(
    by_length: FloatArray, by_azimuth: FloatArray, length_std: npt.ArrayLike, azimuth_std: npt.ArrayLike
) -> FloatArray:
    """``J diag(length_std**2, azimuth_std**2) J'`` from the two columns (..., 2) of ``J``."""
    columns = np.stack(
        [
            by_length * np.asarray(length_std, dtype=float)[..., None],
            by_azimuth * np.asarray(azimuth_std, dtype=float)[..., None],
        ],
        axis=-1,
    )
    return columns @ np.swapaxes(columns, -1, -2)
