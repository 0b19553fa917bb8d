"""Chains of reflections off vertical faces, in closed form: the image of an image, and how it moves with the faces.

Seen from above, a face is the line ``n.(p - pivot) = offset``. It mirrors a point ``I`` to
``I + 2 (offset - n.(I - pivot)) n``. A chain mirrors the transmitter in each of its faces, the one nearest to the
transmitter first; the receiver sees the path in the direction of the last image, at its distance.
"""

import numpy as np
import numpy.typing as npt

from erm.geometry.vertical import FloatArray, mirrored, unit

NO_FACE = -1
"""Fills up chains that are shorter than others."""


def chain_images(
    points: FloatArray, faces: npt.NDArray[np.int64], normal: FloatArray, offset: FloatArray, pivot: FloatArray
) -> tuple[list[FloatArray], FloatArray]:
    """Images of points in the faces of chains.

    Parameters
    ----------
    points : array (path, 2)
        Transmitters [m].
    faces : array (path, bounce) of int
        Faces that each path met, the one nearest to the transmitter first; `NO_FACE` mirrors nothing.
    normal, offset : array (face,)
        Azimuth of ``n`` [degree] and offset from the pivot [m].
    pivot : array (face, 2)
        [m].

    Returns
    -------
    places : list of array (path, 2)
        The points, and their image after each face [m].
    slopes : array (path, bounce, 2, 2)
        Of the last image by the (normal [degree], offset [m]) of each face. Later reflections mirror the slopes of
        earlier faces.

    Examples
    --------
    A corner of two faces mirrors a point through the corner, in either order:

    >>> normal, offset, pivot = np.array([0.0, 90.0]), np.zeros(2), np.zeros((2, 2))
    >>> places, _ = chain_images(np.array([[3.0, 4.0]] * 2), np.array([[0, 1], [1, 0]]), normal, offset, pivot)
    >>> places[-1].round(9).tolist()
    [[-3.0, -4.0], [-3.0, -4.0]]
    """
    places, slopes = [points], np.zeros((len(points), faces.shape[1], 2, 2))
    for bounce, of in enumerate(faces.T):
        met: npt.NDArray[np.int64] = np.flatnonzero(of != NO_FACE)
        face = of[met]
        n = unit(normal[face])
        before = places[-1][met] - pivot[face]
        reflection = np.eye(2) - 2 * n[:, :, None] * n[:, None, :]
        slopes[met, :bounce] = reflection[:, None] @ slopes[met, :bounce]
        slopes[met, bounce] = image_slopes(normal[face], offset[face], before)
        after = places[-1].copy()
        after[met] = mirrored(before, normal[face], offset[face]) + pivot[face]
        places.append(after)
    return places, slopes


def image_slopes(normal: FloatArray, offset: FloatArray, relative: FloatArray) -> FloatArray:
    """Slopes (n, 2, 2) of images by (normal [degree], offset [m]), of points (n, 2) relative to the pivots.

    With ``m`` the unit vector to the left of ``n``, the image moves by ``2 (offset - n.p) m - 2 (m.p) n`` per radian
    and by ``2 n`` per metre.
    """
    n = unit(normal)
    m = np.stack([-n[..., 1], n[..., 0]], axis=-1)
    distance, along = offset - np.sum(n * relative, axis=-1), np.sum(m * relative, axis=-1)
    return np.stack([np.deg2rad(2 * distance[..., None] * m - 2 * along[..., None] * n), 2 * n], axis=-1)
