"""First-order errors of reflection points and of vertical faces, from those of path length and azimuth.

Names and conventions are those of `erm.geometry.vertical`. With ``t`` the unit vector to the left of ``u``,
``du = t da`` and ``dL_h = L / L_h dL``. Results are NaN where the path is not longer than the direct one.
"""

import numpy as np
import numpy.typing as npt

from erm.geometry.vertical import FloatArray, distance_to_reflection, horizontal_length, unit


def point_covariance(
    tx: npt.ArrayLike,
    rx: npt.ArrayLike,
    path_length: npt.ArrayLike,
    azimuth: npt.ArrayLike,
    path_length_std: npt.ArrayLike,
    azimuth_std: npt.ArrayLike,
) -> FloatArray:
    r"""First-order covariance of the reflection point.

    With ``h = z_tx - z_rx`` the point is ``(rx + r u, z_rx + h r / L_h)``, and

    .. math:: \partial r/\partial L_h = (L_h - r)/(L_h + u\cdot d), \qquad
              \partial r/\partial \alpha = -r\,(t\cdot d)/(L_h + u\cdot d).

    Seen from above, an azimuth error moves the point along the tangent to the bistatic ellipse, hence along the face,
    and off it only in second order.

    Parameters
    ----------
    tx, rx, path_length, azimuth
        See `erm.geometry.vertical.reflection_point`.
    path_length_std, azimuth_std : array (...)
        Independent standard errors [m], [degree].

    Returns
    -------
    array (..., 3, 3)
        East/north/up covariance [m2]; the part of up is 0 for antennas without heights.

    Examples
    --------
    An azimuth error of 1 degree, of a path off a face in the north, moves the point along the face only:

    >>> covariance = point_covariance([0, 0], [6, 2], 10.0, 126.87, 0.0, 1.0)
    >>> np.sqrt(np.diagonal(covariance).clip(0)).round(3).tolist()
    [0.082, 0.0, 0.0]
    """
    tx, rx, slant = (np.asarray(value, dtype=float) for value in (tx, rx, path_length))
    length = horizontal_length(tx, rx, slant)
    toward, left = unit(azimuth), unit(np.asarray(azimuth, dtype=float) + 90)
    d = rx[..., :2] - tx[..., :2]
    r = distance_to_reflection(d, length, toward)
    height_difference = 0.0 if tx.shape[-1] == 2 else tx[..., 2] - rx[..., 2]
    denominator = length + np.sum(toward * d, axis=-1)
    dr = np.stack([(length - r) / denominator, -r * np.sum(left * d, axis=-1) / denominator], axis=-1)
    horizontal = toward[..., None, :] * dr[..., None]
    horizontal[..., 1, :] += r[..., None] * left
    up = dr * (height_difference / length)[..., None]
    up[..., 0] -= height_difference * r / length**2
    by_length, by_azimuth = np.moveaxis(np.concatenate([horizontal, up[..., None]], axis=-1), -2, 0)
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

    With ``v = VA - tx = d + L_h u``, ``n = -v/|v|`` and ``m`` the unit vector to the left of ``n``,

    .. math:: \mathrm{d}\phi = -m\cdot\mathrm{d}v/|v|, \qquad
              \mathrm{d}o = (m\cdot tx)\,\mathrm{d}\phi + n\cdot\mathrm{d}v/2, \qquad
              \mathrm{d}v = u\,\mathrm{d}L_h + L_h t\,\mathrm{d}\alpha.

    Parameters
    ----------
    tx, rx, path_length, azimuth, path_length_std, azimuth_std
        See `point_covariance`.

    Returns
    -------
    array (..., 2, 2)
        Covariance of (normal [degree], offset [m]).

    Examples
    --------
    >>> covariance = line_covariance([0, 0], [6, 2], 10.0, 126.87, 0.1, 1.0)
    >>> np.sqrt(np.diagonal(covariance)).round(3).tolist()
    [0.871, 0.066]
    """
    tx, rx, slant = (np.asarray(value, dtype=float) for value in (tx, rx, path_length))
    length = horizontal_length(tx, rx, slant)
    toward, left = unit(azimuth), unit(np.asarray(azimuth, dtype=float) + 90)
    v = rx[..., :2] - tx[..., :2] + length[..., None] * toward
    size = np.linalg.norm(v, axis=-1)
    n = -v / size[..., None]
    m = np.stack([-n[..., 1], n[..., 0]], axis=-1)

    def slope(dv: FloatArray) -> FloatArray:
        dphi = -np.sum(m * dv, axis=-1) / size
        do = np.sum(m * tx[..., :2], axis=-1) * dphi + np.sum(n * dv, axis=-1) / 2
        return np.stack([np.rad2deg(dphi), do], axis=-1)

    by_length = slope(toward * (slant / length)[..., None])
    by_azimuth = slope(left * length[..., None])
    return _propagated(by_length, by_azimuth, path_length_std, np.deg2rad(azimuth_std))


def _propagated(
    by_length: FloatArray, by_azimuth: FloatArray, length_std: npt.ArrayLike, azimuth_std: npt.ArrayLike
) -> FloatArray:
    """``J diag(length_std**2, azimuth_std**2) J'`` from the two columns (..., n) of ``J``."""
    columns = np.stack(
        [
            by_length * np.asarray(length_std, dtype=float)[..., None],
            by_azimuth * np.asarray(azimuth_std, dtype=float)[..., None],
        ],
        axis=-1,
    )
    return columns @ np.swapaxes(columns, -1, -2)
