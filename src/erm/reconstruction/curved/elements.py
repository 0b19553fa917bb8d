r"""Surface elements: the reflection point ``p`` and normal ``n`` that each path gives, with their first-order errors.

All elements of a cylinder with centre ``c`` and signed radius ``a`` obey ``p - a n = c`` (`erm.geometry.cylinders`):
given ``a``, each path is a measurement of the centre. The errors of ``p`` and ``n`` come from the same length and
azimuth, so that with ``D = dp - a dn`` the covariance of that centre is ``D S D'``.
"""

from typing import Any, NamedTuple

import numpy as np

from erm.geometry.vertical import FloatArray, azimuth_of, distance_to_reflection, horizontal_length, unit
from erm.reconstruction.model.paths import BoolArray, IntArray, Paths

ROUNDING = 1e-12
"""Variance of rounding errors of points that are otherwise exact [m2]."""


class Elements(NamedTuple):
    """Surface elements of paths.

    The covariance of ``p - a n`` is a polynomial of the radius ``a``, and so is ``|D|``.
    """

    point: FloatArray  # (path, 2) m
    normal: FloatArray  # (path, 2) unit vectors toward the antennas
    spread: FloatArray  # (path, 3, 3) m2: by power of the radius; variance east, covariance, variance north
    turned: FloatArray  # (path, 2) determinants of D by power of the radius, per standard errors; n turns one way only
    log_clutter: FloatArray  # (path,) log density of clutter of a link, per standard errors of length and azimuth
    loss: FloatArray  # (path,) dB
    loss_std: FloatArray  # (path,) dB
    link: IntArray  # (path,)

    def take(self, rows: IntArray | BoolArray) -> "Elements":
        """Return the elements of an index (...,) or mask."""
        rows = np.flatnonzero(rows) if rows.dtype == bool else rows
        columns: list[Any] = [column.take(rows, axis=0) for column in self]  # ten times as fast as column[rows]
        return Elements(*columns)

    def centre_covariance(self, radius: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Covariance ``D S D'`` (...) of the centres that elements (...) give for radii: east, both, north [m2]."""
        a = radius[..., None]
        east, both, north = np.moveaxis(
            self.spread[..., 0, :] + a * (self.spread[..., 1, :] + a * self.spread[..., 2, :]), -1, 0
        )
        return east + ROUNDING, both, north + ROUNDING


def elements_of(paths: Paths) -> Elements:
    r"""Surface elements of paths.

    With ``v = rx + L_h u - tx`` the normal is ``n = -v / |v|``, so ``dn = -(1 - n n') dv / |v|``; the point is
    ``rx + r u`` (`erm.geometry.vertical_covariance`).
    """
    d = paths.rx[:, :2] - paths.tx[:, :2]
    length = horizontal_length(paths.tx, paths.rx, paths.length)
    u, left = unit(paths.azimuth), unit(paths.azimuth + 90)
    r = distance_to_reflection(d, length, u)
    denominator = length + np.sum(u * d, axis=-1)
    dl = paths.length_std * paths.length / length
    da = np.deg2rad(paths.azimuth_std)
    dr = np.stack([(length - r) / denominator * dl, -r * np.sum(left * d, axis=-1) / denominator * da], axis=-1)
    of_point = u[:, :, None] * dr[:, None, :]  # (path, 2, 2) by length and azimuth in standard errors
    of_point[:, :, 1] += (r * da)[:, None] * left
    v = d + length[:, None] * u
    size = np.linalg.norm(v, axis=-1)
    n = -v / size[:, None]
    dv = np.stack([u * dl[:, None], left * (length * da)[:, None]], axis=-1)
    of_normal = -(dv - n[:, :, None] * np.sum(n[:, :, None] * dv, axis=1, keepdims=True)) / size[:, None, None]
    mixed = of_point @ of_normal.swapaxes(-1, -2)
    powers = (
        of_point @ of_point.swapaxes(-1, -2),
        -mixed - mixed.swapaxes(-1, -2),
        of_normal @ of_normal.swapaxes(-1, -2),
    )
    slope = of_point[:, 0, 0] * of_normal[:, 1, 1] + of_normal[:, 0, 0] * of_point[:, 1, 1]
    slope -= of_point[:, 0, 1] * of_normal[:, 1, 0] + of_normal[:, 0, 1] * of_point[:, 1, 0]
    excess = paths.length - np.linalg.norm(paths.tx - paths.rx, axis=-1)
    links = max(len(np.unique(paths.link)), 1)
    density = len(paths) / links / (max(float(np.ptp(excess)) if len(paths) else 0.0, 1.0) * 360)
    return Elements(
        paths.rx[:, :2] + r[:, None] * u,
        n,
        np.stack([power[:, [0, 0, 1], [0, 1, 1]] for power in powers], axis=1),
        np.stack([np.linalg.det(of_point), -slope], axis=-1),
        np.log(density * paths.length_std * paths.azimuth_std),
        paths.loss,
        paths.loss_std,
        np.unique(paths.link, return_inverse=True)[1],
    )


def normals_azimuth(elements: Elements) -> FloatArray:
    """Azimuths (path,) of the normals [degree]."""
    return azimuth_of(elements.normal)
