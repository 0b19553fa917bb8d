"""Elements that agree with cylinders, found in groups of elements that are alike in place and normal."""

from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from erm.geometry.vertical import FloatArray
from erm.reconstruction.curved.elements import ROUNDING, Elements
from erm.reconstruction.model.fit import CHI_SQUARED_GATE
from erm.reconstruction.model.paths import IntArray
from erm.reconstruction.model.ragged import Ragged

ELEMENTS_TOGETHER = 16
"""Elements of a group at most. Chosen: bounds time; results do not depend on it."""
RADIUS_OF_GROUPS = 30.0
"""Radius of the cylinders for which groups are narrowest [m]: they are those of near centres. Chosen as above."""


class NearElements:
    """Search of the elements that may agree with cylinders.

    For the radius ``a`` an element gives the centre ``p - a n``. Groups of elements alike in ``p`` and ``n`` give
    centres within ``max |dp| + |a| max |dn|`` of that of their means, so that most groups are left out at once.

    Parameters
    ----------
    elements : Elements
    """

    def __init__(self, elements: Elements) -> None:
        self.elements = elements
        tree = cKDTree(np.hstack([elements.point, RADIUS_OF_GROUPS * elements.normal]), leafsize=ELEMENTS_TOGETHER)
        groups: list[IntArray] = []
        nodes: list[Any] = [tree.tree] if len(elements.point) else []
        while nodes:
            node = nodes.pop()
            if node.split_dim < 0:
                groups.append(tree.indices[node.start_idx : node.end_idx].astype(np.int64))
            else:
                nodes += [node.lesser, node.greater]
        self._groups = Ragged.from_lists(groups)
        start, size = self._groups.start[:-1], self._groups.sizes[:, None]
        self._trace = elements.spread[:, :, 0] + elements.spread[:, :, 2]  # by power of the radius
        self._largest = np.maximum.reduceat(np.abs(self._trace[self._groups.rows]), start).T
        means, widths = [], []
        for column in (elements.point[self._groups.rows], elements.normal[self._groups.rows]):
            mean = np.add.reduceat(column, start) / size
            apart = np.linalg.norm(column - mean[self._groups.owner], axis=-1)
            means.append(mean)
            widths.append(np.maximum.reduceat(apart, start))
        self._means, self._widths = means, widths

    def of(self, parameters: FloatArray, covariance: FloatArray) -> tuple[IntArray, IntArray]:
        """Pairs (pair,) of cylinders (cylinder, 3) and elements that may be in the gate of `centre_misfit`.

        No eigenvalue of ``V`` exceeds its trace: ``d' V**-1 d >= |d|**2 / tr V``.
        """
        centre, radius, both = parameters[:, :2], parameters[:, 2], covariance[:, :2, 2]
        of_cylinder = np.trace(covariance, axis1=1, axis2=2) + 2 * ROUNDING
        size = np.abs(radius)[:, None]
        (point, normal), (width, turn), (constant, linear, square) = self._means, self._widths, self._largest
        trace = constant + size * (linear + size * square)
        trace = trace + (of_cylinder + 2 * np.linalg.norm(both, axis=-1))[:, None]
        away = sum((point[:, i] - centre[:, i, None] - radius[:, None] * normal[:, i]) ** 2 for i in range(2))
        of, group = np.nonzero(away < (np.sqrt(CHI_SQUARED_GATE * trace) + width + size * turn) ** 2)
        members = self._groups.take(group)
        of, rows = of[members.owner], members.rows
        point, normal, radius = self.elements.point[rows], self.elements.normal[rows], radius[of]
        constant, linear, square = self._trace[rows].T
        trace = constant + radius * (linear + radius * square) + 2 * np.sum(both[of] * normal, axis=-1)
        away = np.sum((point - centre[of] - radius[:, None] * normal) ** 2, axis=-1)
        near = np.flatnonzero(away < CHI_SQUARED_GATE * (trace + of_cylinder[of]))
        return of[near], rows[near]


def centre_misfit(own: Elements, parameters: FloatArray, covariance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Chi-squared (...) of elements (...) against cylinders (..., 3) with their errors.

    Also ``log sqrt|V| - log |D|`` (...): ``V`` is the covariance of ``p - a n - c`` and ``|D|`` turns its density
    into one of length and azimuth.
    """
    east, north, radius = (parameters[..., i] for i in range(3))
    c = covariance
    x, y = own.normal[..., 0], own.normal[..., 1]
    a, b, d = own.centre_covariance(np.broadcast_to(radius, x.shape))
    a = a + c[..., 0, 0] + x * (2 * c[..., 0, 2] + x * c[..., 2, 2])
    b = b + c[..., 0, 1] + x * c[..., 1, 2] + y * (c[..., 0, 2] + x * c[..., 2, 2])
    d = d + c[..., 1, 1] + y * (2 * c[..., 1, 2] + y * c[..., 2, 2])
    determinant = np.maximum(a * d - b * b, ROUNDING**2)
    east = own.point[..., 0] - east - radius * x
    north = own.point[..., 1] - north - radius * y
    chi2 = (east * east * d - 2 * east * north * b + north * north * a) / determinant
    turned = np.abs(own.turned[..., 0] + radius * own.turned[..., 1])
    return chi2, np.log(determinant) / 2 - np.log(np.maximum(turned, ROUNDING))


def predictive_log_odds(own: Elements, parameters: FloatArray, covariance: FloatArray) -> FloatArray:
    """Log odds (...) of elements (...) to be off cylinders that are known so well, and not clutter."""
    chi2, width = centre_misfit(own, parameters, covariance)
    return np.asarray(-chi2 / 2 - np.log(2 * np.pi) - width - own.log_clutter)


def path_log_odds(chi_squared: FloatArray, own: Elements) -> FloatArray:
    """Log odds (path,) of lengths and azimuths to be off a face that they agree with so well, and not clutter."""
    return np.asarray(-chi_squared / 2 - np.log(2 * np.pi) - own.log_clutter)
