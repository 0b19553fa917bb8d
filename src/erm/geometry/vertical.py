"""A single reflection off a vertical face, in closed form.

All functions share one picture, seen from above. Let ``d = rx - tx``, let ``u`` be the horizontal unit vector toward
which the receiver looks to see the path, and let ``L_h`` be the horizontal length of the path. The mirror image of the
transmitter in the face is the *virtual anchor* ``VA = rx + L_h u``. The face is the perpendicular bisector of TX and
VA, and the reflection point is where the ray from RX to VA crosses it.

``L_h**2 = L**2 - (z_tx - z_rx)**2`` is exact for vertical faces: unfolded at a vertical mirror, the path is a straight
line from the height of one antenna to that of the other. With ``planar=True`` the slant length ``L`` is used in place
of ``L_h``, as printed in the letter. This is wrong by metres if the antennas' heights differ by tens of metres; it
exists for comparison.

Positions are arrays (..., 3), east/north/up [m]; a last dimension of 2 means equal heights. All arguments are broadcast
against each other. Results are NaN where the path is not longer than the direct one, for there is no face then.
"""

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

ROUNDING = 1e-9
"""Relative excess of a squared length that is rounding: 50 nm on 100 m. Chosen; not derived."""


def unit(azimuth: npt.ArrayLike) -> FloatArray:
    """Horizontal unit vectors (..., 2) of azimuths (...) [degree, counter-clockwise from east].

    Examples
    --------
    >>> unit([0, 90]).round(3).tolist()
    [[1.0, 0.0], [0.0, 1.0]]
    """
    angle = np.deg2rad(np.asarray(azimuth, dtype=float))
    vector = np.empty((*angle.shape, 2))
    vector[..., 0], vector[..., 1] = np.cos(angle), np.sin(angle)
    return vector


def azimuth_of(vector: npt.ArrayLike) -> FloatArray:
    """Azimuth (...) of horizontal vectors (..., 2 or more) [degree, counter-clockwise from east, in [0, 360)].

    The azimuth of a vector without horizontal part is 0.

    Examples
    --------
    >>> azimuth_of([[0, 1], [0, -1]]).tolist()
    [90.0, 270.0]
    """
    vector = np.asarray(vector, dtype=float)
    return np.rad2deg(np.arctan2(vector[..., 1], vector[..., 0])) % 360


def angle_difference(a: npt.ArrayLike, b: npt.ArrayLike) -> FloatArray:
    """Difference ``a - b`` (...) of angles [degree, in [-180, 180)].

    Examples
    --------
    >>> angle_difference([350, 10], 0).tolist()
    [-10.0, 10.0]
    """
    difference = np.asarray(a, dtype=float) - np.asarray(b, dtype=float)
    # the remainder of floats takes six times as long
    return np.asarray(difference - 360 * np.floor((difference + 180) / 360))


def horizontal_length(
    tx: npt.ArrayLike, rx: npt.ArrayLike, path_length: npt.ArrayLike, *, planar: bool = False
) -> FloatArray:
    """Length of a path seen from above, if it was reflected by vertical faces only.

    Parameters
    ----------
    tx, rx : array (..., 2 or 3)
        Antenna positions [m].
    path_length : array (...)
        Propagation delay times the speed of light [m].
    planar : bool
        Take the slant length for the horizontal one, as in the letter.

    Returns
    -------
    array (...)
        ``sqrt(L**2 - (z_tx - z_rx)**2)`` [m]; NaN unless it exceeds the horizontal distance TX-RX by more than
        rounding.

    Examples
    --------
    >>> horizontal_length([0, 0, 4], [6, 0, 1], 13.0).round(3).item()
    12.649
    """
    tx, rx, length = (np.asarray(value, dtype=float) for value in (tx, rx, path_length))
    height_difference = 0.0 if planar or tx.shape[-1] == 2 else tx[..., 2] - rx[..., 2]
    squared = length**2 - height_difference**2
    direct = np.sum((rx[..., :2] - tx[..., :2]) ** 2, axis=-1)
    return np.sqrt(np.where((length > 0) & (squared > direct * (1 + ROUNDING)), squared, np.nan))


def virtual_anchor(
    tx: npt.ArrayLike,
    rx: npt.ArrayLike,
    path_length: npt.ArrayLike,
    azimuth: npt.ArrayLike,
    *,
    planar: bool = False,
) -> FloatArray:
    """Mirror image of the transmitter in the face, ``VA = rx + L_h u``.

    All paths of one transmitter off one vertical face have the same virtual anchor.

    Parameters
    ----------
    tx, rx, path_length, azimuth, planar
        See `reflection_point`.

    Returns
    -------
    array (..., 2)
        East/north [m]; NaN where the path is not longer than the direct one.

    Examples
    --------
    A face 5 m north of the transmitter mirrors it to 10 m north:

    >>> virtual_anchor([0, 0], [6, 2], 10.0, azimuth_of([-6, 8])).round(3).tolist()
    [0.0, 10.0]
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
    """Locate the single reflection of a path off a vertical face.

    The reflection point lies ``r = (L_h**2 - |d|**2) / (2 (L_h + u.d))`` along ``u`` from the receiver.

    Parameters
    ----------
    tx, rx : array (..., 2 or 3)
        Antenna positions, east/north/up [m].
    path_length : array (...)
        Propagation delay times the speed of light [m].
    azimuth : array (...)
        Direction toward which the receiver looks to see the path [degree, counter-clockwise from east].
    planar : bool
        Take the slant length for the horizontal one, as in the letter.

    Returns
    -------
    point : array (..., 2)
        Reflection point, east/north [m]; NaN where the path is not longer than the direct one.
    normal : array (...)
        Azimuth of the face's normal, on the antennas' side [degree, in [0, 360)]; NaN likewise.

    References
    ----------
    Chang et al., Eqs. 1-3, in closed form and with the antennas' heights.

    Examples
    --------
    >>> point, normal = reflection_point([0, 0], [6, 2], 10.0, azimuth_of([-6, 8]))
    >>> point.round(3).tolist(), normal.round(3).item()
    ([3.75, 5.0], 270.0)
    """
    tx, rx = np.asarray(tx, dtype=float), np.asarray(rx, dtype=float)
    toward = unit(azimuth)
    length = horizontal_length(tx, rx, path_length, planar=planar)
    point = rx[..., :2] + distance_to_reflection(rx[..., :2] - tx[..., :2], length, toward)[..., None] * toward
    normal = azimuth_of(tx[..., :2] - rx[..., :2] - length[..., None] * toward)
    return point, normal


def bounce_height(
    tx: npt.ArrayLike, rx: npt.ArrayLike, path_length: npt.ArrayLike, azimuth: npt.ArrayLike
) -> FloatArray:
    """Height (...) of the reflection point on a vertical face, ``z_rx + (z_tx - z_rx) r / L_h`` [m].

    It lies between the heights of the antennas, for the path has a constant slope. Positions need a height; see
    `reflection_point` for the arguments.

    Examples
    --------
    >>> bounce_height([0, 0, 9], [6, 2, 1], 12.806, azimuth_of([-6, 8])).round(2).item()
    4.0
    """
    tx, rx = np.asarray(tx, dtype=float), np.asarray(rx, dtype=float)
    length = horizontal_length(tx, rx, path_length)
    r = distance_to_reflection(rx[..., :2] - tx[..., :2], length, unit(azimuth))
    return rx[..., 2] + (tx[..., 2] - rx[..., 2]) * r / length


def face_line(
    tx: npt.ArrayLike,
    rx: npt.ArrayLike,
    path_length: npt.ArrayLike,
    azimuth: npt.ArrayLike,
    *,
    planar: bool = False,
) -> tuple[FloatArray, FloatArray]:
    """Line of the face that a path was reflected off: the points ``p`` with ``n.p = offset``.

    Parameters
    ----------
    tx, rx, path_length, azimuth, planar
        See `reflection_point`.

    Returns
    -------
    normal : array (...)
        Azimuth of ``n``, on the antennas' side [degree, in [0, 360)]; NaN where the path is not longer than the direct
        one.
    offset : array (...)
        Signed distance of the line from the origin along ``n`` [m]; NaN likewise.

    Examples
    --------
    >>> normal, offset = face_line([0, 0], [6, 2], 10.0, azimuth_of([-6, 8]))
    >>> normal.round(3).item(), offset.round(3).item()
    (270.0, -5.0)
    """
    tx = np.asarray(tx, dtype=float)
    return bisector(tx[..., :2], virtual_anchor(tx, rx, path_length, azimuth, planar=planar))


def bisector(near: npt.ArrayLike, far: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Mirror line of points (..., 2 or more) and their images: normal (...) [degree] toward ``near``, offset (...) [m].

    Examples
    --------
    >>> [value.item() for value in bisector([4.0, 0.0], [0.0, 0.0])]
    [0.0, 2.0]
    """
    near, far = np.asarray(near, dtype=float)[..., :2], np.asarray(far, dtype=float)[..., :2]
    normal = azimuth_of(near - far)
    return normal, np.sum(unit(normal) * (near + far) / 2, axis=-1)


def mirrored(point: npt.ArrayLike, normal: npt.ArrayLike, offset: npt.ArrayLike) -> FloatArray:
    """Mirror images (..., 2) of points (..., 2 or more) in lines, ``p + 2 (offset - n.p) n`` [m].

    Examples
    --------
    >>> mirrored([1.0, 2.0], 90.0, 5.0).round(3).tolist()
    [1.0, 8.0]
    """
    point = np.asarray(point, dtype=float)[..., :2]
    n = unit(normal)
    return point + 2 * (np.asarray(offset, dtype=float) - np.sum(n * point, axis=-1))[..., None] * n


def distance_to_reflection(d: FloatArray, length: FloatArray, toward: FloatArray) -> FloatArray:
    """Distance (...) from the receiver to the reflection point, ``r = (L**2 - |d|**2) / (2 (L + u.d))`` [m].

    Parameters
    ----------
    d : array (..., dimension)
        ``rx - tx`` [m], seen from above or in space.
    length : array (...)
        Length of the path in the same dimensions [m].
    toward : array (..., dimension)
        Unit vector ``u`` toward the arrival.
    """
    return (length**2 - np.sum(d**2, axis=-1)) / (2 * (length + np.sum(toward * d, axis=-1)))
