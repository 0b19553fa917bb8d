"""Heading and clock by least squares over common mirror images, with their covariance.

With the image ``c_k`` of path ``i`` at receiver ``r``, the residuals are::

    L_i - sqrt(|c_k - r|**2 + dz**2) - b,    a_i - arg(c_k - r) - h

The unknowns are ``h``, ``b`` and all images; those of direct paths are the transmitter itself. Errors of a position are
common to its rows: for ``n`` rows of weights ``w`` with a common error of variance ``s**2``, the inverse covariance is
``diag(w) - w w' s**2 / (1 + s**2 sum(w))`` (Sherman and Morrison).
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from erm.geometry.vertical import FloatArray, angle_difference
from erm.mpcs.antenna_pairs import distinct_rows
from erm.mpcs.standard_errors import SIGMAS, robust_std
from erm.survey.bundle import HUBER_THRESHOLD
from erm.survey.direct_paths import rank
from erm.survey.observations import IntArray, Observations

LOUDEST = 12
"""MPCs of each antenna pair that are used; chosen for time."""
FEWEST_LINKS = 3
"""Fewest antenna pairs of an image: two circles always meet."""
ROUNDS = 4
"""Rounds of assigning paths to images and fitting."""
STEPS = 8
"""Steps of Gauss and Newton in a round."""
BoolArray = npt.NDArray[np.bool_]


class ImageFit(NamedTuple):
    """Heading and clock with their covariance."""

    heading: float
    """[degree]"""
    clock: float
    """[m]"""
    covariance: FloatArray
    """Covariance (2, 2) of heading [degree] and clock [m]."""
    images: int
    """Number of common images."""
    paths: int
    """Number of MPCs that agree with them."""
    spreads: tuple[float, float]
    """Errors of single positions: clock [m], heading [degree]."""


def fit_images(
    seen: Observations,
    heading: float,
    clock: float,
    spreads: tuple[float, float],
    direct: BoolArray,
) -> ImageFit | None:
    """Fit heading, clock and common images, starting from good values.

    Parameters
    ----------
    seen : Observations
        MPCs of all antenna pairs.
    heading, clock : float
        Start [degree], [m].
    spreads : (float, float)
        Errors of single positions: clock [m], heading [degree].
    direct : array (mpc,) of bool
        MPCs that are direct paths.

    Returns
    -------
    ImageFit or None
        None if there is no common image.
    """
    loudness = np.where(np.isnan(seen.gain), -seen.length, seen.gain)
    usable = (direct | (rank(-loudness, seen.link) < LOUDEST)) & seen.may_be_off_vertical_walls
    seen, direct = seen.of_rows(usable), direct[usable]
    fit = None
    for _ in range(ROUNDS):
        problem = _Problem(seen, spreads)
        number, centres = problem.assign(heading, clock, direct)
        if not len(centres):
            return fit
        heading, clock, covariance, seen, spreads = problem.solve(heading, clock, number, centres, direct)
        fit = ImageFit(heading, clock, covariance, len(centres), int(np.count_nonzero(number >= 0)), spreads)
    return fit


class _Problem:
    def __init__(self, seen: Observations, spreads: tuple[float, float]) -> None:
        self.seen, self.spreads = seen, spreads
        self.place = seen.rx[seen.link]
        self.tx = seen.tx[seen.link]
        _, transmitter = distinct_rows(seen.tx)
        self.transmitter = transmitter[seen.link]
        self.length_std = np.hypot(seen.length_std, spreads[0])
        self.azimuth_std = np.hypot(seen.azimuth_std, spreads[1])

    def images(self, heading: float, clock: float) -> FloatArray:
        """Image (mpc, 2) of each path alone [m]."""
        climb = self.tx[:, 2] - self.place[:, 2]
        d = np.sqrt(np.maximum((self.seen.length - clock) ** 2 - climb**2, 1e-4))
        azimuth = np.deg2rad(self.seen.azimuth - heading)
        return self.place[:, :2] + d[:, None] * np.column_stack([np.cos(azimuth), np.sin(azimuth)])

    def residuals(self, heading: float, clock: float, image: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Residuals of length [m] and azimuth [degree], for images (..., mpc, 2)."""
        along = image - self.place[:, :2]
        length = np.sqrt(np.sum(along**2, axis=-1) + (self.tx[:, 2] - self.place[:, 2]) ** 2)
        azimuth = np.rad2deg(np.arctan2(along[..., 1], along[..., 0]))
        return self.seen.length - clock - length, angle_difference(self.seen.azimuth - heading, azimuth)

    def assign(self, heading: float, clock: float, direct: BoolArray) -> tuple[IntArray, FloatArray]:
        """Image number (mpc,) of each path, -1 for none, and start values (image, 2): those with most pairs first."""
        image = self.images(heading, clock)
        number = np.full(len(direct), -1)
        centres: list[FloatArray] = []
        free = ~direct
        length, azimuth = self.residuals(heading, clock, image[:, None])
        chi = (length / self.length_std) ** 2 + (azimuth / self.azimuth_std) ** 2
        near = (chi < SIGMAS**2) & (self.transmitter == self.transmitter[:, None])
        links = len(self.seen.tx)
        while True:
            shared = near & free
            support = _distinct(shared, self.seen.link, links)
            support[~free] = 0
            best = int(np.argmax(support)) if len(support) else 0
            if not len(support) or support[best] < FEWEST_LINKS:
                return number, np.array(centres).reshape(-1, 2)
            # one path of each antenna pair: the nearest
            rows = np.flatnonzero(shared[best])
            rows = rows[np.lexsort((chi[best, rows], self.seen.link[rows]))]
            rows = rows[np.unique(self.seen.link[rows], return_index=True)[1]]
            number[rows] = len(centres)
            weight = 1 / np.hypot(self.length_std[rows], 1e-3) ** 2
            centres.append(np.average(image[rows], axis=0, weights=weight))
            free[rows] = False

    def solve(
        self, heading: float, clock: float, number: IntArray, centres: FloatArray, direct: BoolArray
    ) -> tuple[float, float, FloatArray, Observations, tuple[float, float]]:
        """Least squares; return heading, clock, covariance, and table and spreads that agree with the residuals."""
        used = np.flatnonzero((number >= 0) | direct)
        one = _Problem(self.seen.of_rows(used), self.spreads)
        k, count = number[used], len(centres)
        x = np.r_[heading, clock, centres.ravel()]
        unknowns = len(x)
        place, target = one.place[:, :2], one.tx[:, :2]
        climb = one.tx[:, 2] - one.place[:, 2]
        rows = np.arange(len(used))
        moving = np.flatnonzero(k >= 0)
        for _ in range(STEPS):
            image = np.where((k >= 0)[:, None], x[2:].reshape(count, 2)[np.maximum(k, 0)], target)
            along = image - place
            level = np.hypot(along[:, 0], along[:, 1])
            slant = np.hypot(level, climb)
            residual = one.residuals(x[0], x[1], image)
            unit = along / level[:, None]
            slopes = (
                unit * (level / slant)[:, None],
                np.rad2deg(np.column_stack([-unit[:, 1], unit[:, 0]]) / level[:, None]),
            )
            matrix, vector = np.zeros((unknowns, unknowns)), np.zeros(unknowns)
            stds = (one.seen.length_std, one.seen.azimuth_std)
            for part in range(2):
                jacobian = np.zeros((len(used), unknowns))
                jacobian[rows, 1 - part] = 1.0
                for axis in range(2):
                    jacobian[moving, 2 + 2 * k[moving] + axis] = slopes[part][moving, axis]
                std = stds[part]
                total = np.hypot(std, self.spreads[part])
                weight = np.minimum(1.0, HUBER_THRESHOLD / np.maximum(np.abs(residual[part] / total), 1e-9)) / std**2
                matrix += (jacobian * weight[:, None]).T @ jacobian
                vector += jacobian.T @ (weight * residual[part])
                if self.spreads[part]:
                    links = len(self.seen.tx)
                    sums = np.zeros((links, unknowns + 1))
                    weighted = np.column_stack([jacobian, residual[part]]) * weight[:, None]
                    np.add.at(sums, one.seen.link, weighted)
                    share = np.bincount(one.seen.link, weight, minlength=links)
                    shrink = self.spreads[part] ** 2 / (1 + self.spreads[part] ** 2 * share)
                    matrix -= (sums[:, :-1] * shrink[:, None]).T @ sums[:, :-1]
                    vector -= sums[:, :-1].T @ (shrink * sums[:, -1])
            scale = np.sqrt(np.maximum(np.diag(matrix), 1e-12))
            inverse = np.linalg.pinv(matrix / np.outer(scale, scale), hermitian=True) / np.outer(scale, scale)
            step = inverse @ vector
            x = x + step
            if np.abs(step[:2]).max() < 1e-7:
                break
        seen = self.seen
        if not any(self.spreads):
            # two unknowns of each image take some of the residuals
            taken = np.sqrt(2 * len(used) / max(2 * len(used) - unknowns, 1))
            ratios = [robust_std(residual[part] / stds[part]) * taken for part in range(2)]
            seen = self.seen.with_errors(ratios[0], ratios[1])
        if any(self.spreads):
            links = len(self.seen.tx)
            # images take a part of these errors, so that residuals alone tell too little
            first, second = (
                max(_spread(residual[part], stds[part], one.seen.link, links), self.spreads[part]) for part in range(2)
            )
            spreads = first, second
        else:
            spreads = self.spreads
        return float(angle_difference(x[0], 0)), float(x[1]), inverse[:2, :2], seen, spreads


def _spread(residual: FloatArray, std: FloatArray, link: IntArray, links: int) -> float:
    """Standard deviation of an error that the rows of a position share, from the means of their residuals.

    The mean of ``n`` rows has the variance ``s**2 + std**2 / n``.
    """
    weight = np.bincount(link, 1 / std**2, minlength=links)
    seen = weight > 0
    mean = np.bincount(link, residual / std**2, minlength=links)[seen] / weight[seen]
    count = int(np.count_nonzero(seen))
    variance = float(np.mean(mean**2 - 1 / weight[seen])) * count / max(count - 2, 1)
    return float(np.sqrt(max(variance, 0.0)))


def _distinct(near: BoolArray, link: IntArray, links: int) -> IntArray:
    """Number (row,) of different antenna pairs among the columns that are near."""
    order = np.argsort(link, kind="stable")
    starts = np.searchsorted(link[order], np.arange(links))
    filled = np.flatnonzero(np.diff(np.r_[starts, len(link)]) > 0)
    return np.asarray(np.logical_or.reduceat(near[:, order], starts[filled], axis=1).sum(axis=1))
