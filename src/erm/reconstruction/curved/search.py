"""Search for cylinders: pairs of surface elements that turn toward each other, and the paths that agree with them."""

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from erm.common.odds import TWENTY_TO_ONE
from erm.geometry.vertical import FloatArray
from erm.mpcs.standard_errors import SIGMAS
from erm.reconstruction.curved.elements import Elements, elements_of, log_odds_of_loss, normals_azimuth
from erm.reconstruction.curved.fit import CylinderFit, compared, fit_cylinder
from erm.reconstruction.model.fit import CHI_SQUARED_GATE
from erm.reconstruction.model.paths import BoolArray, IntArray, Paths
from erm.reconstruction.poles.evidence import ClutterDensity, log_probability_of_view
from erm.reconstruction.search.refine_groups import best_of_each_link

PRIOR_DENSITY = 1e-3
"""Prior density of cylinders [1/m2]: one in a square of 30 m, as of poles. Chosen; not derived."""
RADII = (0.05, 300.0)
"""Radii that are considered [m], equally likely per octave: from a lamp post to a facade that bends by a degree in 5 m.
Chosen; not derived."""
MIN_PATHS = 4
"""Fewest links of a cylinder: two paths have four values for its three parameters, the third and fourth confirm."""
MAX_SEEDS = 600
"""Paths from which cylinders are searched, evenly drawn. Chosen: bounds the time in large campaigns."""
NEIGHBOURS = 160
"""Paths near a seed that are its partners and that score it. Chosen: bounds time."""
PAIRS = 4
"""Partners of a seed that are tried, those that determine the radius best. Chosen."""
MAX_REFINEMENTS = 6
"""Repetitions of collecting and fitting the paths of a cylinder. Chosen; not derived."""


class CurvedFace(NamedTuple):
    """A cylinder, its paths, and the evidence for it."""

    fit: CylinderFit
    inliers: IntArray  # (inlier,) rows of the paths
    log_odds: FloatArray  # (inlier,) of each to be off the cylinder and not clutter
    log_clutter: FloatArray  # (inlier,) log density of clutter about each, as in `Elements`
    log_volume: float  # of the cylinder's parameters, prior included (Laplace)
    log_view: float  # log probability that just these of the links in view received it

    @property
    def evidence(self) -> float:
        """Log odds of the cylinder against clutter."""
        return float(self.log_odds.sum()) + self.log_volume + self.log_view


class CylinderSearch:
    """Cylinders among paths.

    Parameters
    ----------
    paths : Paths
        All that may be single reflections, with any loss.
    background : array (path,) of bool
        Those that no plane explains for certain: cylinders are searched from them. Where they are dense, as before a
        rough facade, more agree by chance.
    """

    def __init__(self, paths: Paths, background: BoolArray) -> None:
        self.paths = paths
        self.elements = elements_of(paths)
        self.normal = normals_azimuth(self.elements)
        self.tree = cKDTree(self.elements.point)
        self._place = np.cumsum(background) - 1
        self._background = background
        self._density = ClutterDensity(paths.take(background), self.elements.point[background])
        self._links = paths.take(np.unique(paths.link, return_index=True)[1])

    def run(self) -> list[CurvedFace]:
        """Cylinders that are likelier than clutter; their paths may overlap."""
        count = len(self.paths)
        possible = np.flatnonzero(self._background)
        if count < MIN_PATHS or not len(possible):
            return []
        seeds = possible[np.unique(np.linspace(0, len(possible) - 1, min(len(possible), MAX_SEEDS)).astype(np.int64))]
        score, parameters, covariance = self._scores(seeds)
        found: list[CurvedFace] = []
        taken = np.zeros(count, dtype=bool)
        for at in np.argsort(-score, kind="stable").tolist():
            if score[at] < TWENTY_TO_ONE:
                break
            if taken[seeds[at]]:
                continue
            taken[seeds[at]] = True
            face = self.refine(parameters[at], covariance[at])
            if face is not None and face.evidence > TWENTY_TO_ONE:
                taken[face.inliers] = True
                found.append(face)
        return found

    def _scores(self, seeds: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Best score (seed,) of the pairs of each seed, their parameters (seed, 3) and covariances (seed, 3, 3)."""
        score = np.full(len(seeds), -np.inf)
        parameters, covariance = np.zeros((len(seeds), 3)), np.zeros((len(seeds), 3, 3))
        _, near = self.tree.query(self.elements.point[seeds], min(NEIGHBOURS, len(self.paths)))
        for at, (seed, rows) in enumerate(zip(seeds.tolist(), np.asarray(near), strict=True)):
            own = self.elements.take(rows)
            other = np.flatnonzero(own.link != self.paths.link[seed])
            start, error = pair_cylinders(self.elements.take(np.full(len(other), seed)), own.take(other))
            good = np.flatnonzero(np.isfinite(error[:, 2, 2]))
            best = good[np.argsort(error[good, 2, 2] / start[good, 2] ** 2, kind="stable")[:PAIRS]]
            for one in best.tolist():
                odds = np.maximum(predictive_log_odds(own, start[one], error[one]), 0.0)
                order = np.lexsort((-odds, own.link))
                first = order[np.r_[True, np.diff(own.link[order]) != 0]]
                value = float(odds[first].sum()) + log_prior(start[one, 2])
                if value > score[at]:
                    score[at], parameters[at], covariance[at] = value, start[one], error[one]
        return score, parameters, covariance

    def refine(self, parameters: FloatArray, covariance: FloatArray, free: IntArray | None = None) -> CurvedFace | None:
        """Let a cylinder collect the paths that agree with it, and fit it to these, until they no longer change."""
        rows = np.arange(len(self.paths)) if free is None else free
        near = self.elements.take(rows)
        before = np.empty(0, dtype=np.int64)
        fit: CylinderFit | None = None
        exact = False
        for _ in range(MAX_REFINEMENTS):
            chi2 = centre_misfit(near, parameters, covariance)[0]
            inside = np.flatnonzero(chi2 < CHI_SQUARED_GATE)
            best = best_of_each_link(np.zeros_like(inside), near.link[inside], inside, chi2[inside])
            inliers = np.sort(rows[inside[best]])
            if len(inliers) < MIN_PATHS:
                return None
            # first by the elements, which is linear, then by Fermat's principle
            exact |= np.array_equal(inliers, before)
            if exact and fit is not None and np.array_equal(inliers, before):
                break
            before = inliers
            if exact:
                own = self.paths.take(inliers)
                fit = fit_cylinder(own, self.normal[inliers], parameters[:2], float(parameters[2]))
                if fit is None:
                    return None
                parameters, covariance = np.array([*fit.centre, fit.radius]), fit.covariance
            else:
                parameters, covariance = cylinder_of_elements(self.elements.take(inliers), float(parameters[2]))
            if not RADII[0] < abs(parameters[2]) < RADII[1]:
                return None
        if fit is None:
            fit = fit_cylinder(self.paths.take(before), self.normal[before], parameters[:2], float(parameters[2]))
        return self.face(fit, before) if fit is not None else None

    def face(self, fit: CylinderFit, inliers: IntArray) -> CurvedFace | None:
        """Cylinder with the inliers that it reflects, and its evidence."""
        paths = self.paths.take(inliers)
        fit = compared(paths, self.normal[inliers], fit.centre, fit.radius, fit.covariance)
        kept = fit.chi_squared < CHI_SQUARED_GATE
        if abs(fit.radius) < SIGMAS * np.sqrt(fit.covariance[2, 2]):
            return None  # a thin pole, whose radius follows from its loss only
        if np.count_nonzero(kept) < MIN_PATHS:
            return None
        fit = fit._replace(
            chi_squared=fit.chi_squared[kept],
            normal=fit.normal[kept],
            point=fit.point[kept],
            excess_loss=fit.excess_loss[kept],
        )
        inliers = inliers[kept]
        own = self.elements.take(inliers)
        own = own._replace(log_clutter=np.maximum(own.log_clutter, self._local_clutter(own, inliers)))
        odds = path_log_odds(fit.chi_squared, own) + log_odds_of_loss(own.loss - fit.excess_loss, own.loss_std)
        view = log_probability_of_view(len(inliers), self._in_view(fit, inliers))
        volume = 1.5 * np.log(2 * np.pi) + np.linalg.slogdet(fit.covariance)[1] / 2 + log_prior(fit.radius)
        return CurvedFace(fit, inliers, odds, own.log_clutter, float(volume), view)

    def _in_view(self, fit: CylinderFit, inliers: IntArray) -> int:
        """Number of links that should have received a reflection between those that were received, and as strong."""
        normals = np.sort(fit.normal)
        gaps = np.diff(normals, append=normals[0] + 360)
        start = normals[(int(np.argmax(gaps)) + 1) % len(normals)]
        others = self._links.take(~np.isin(self._links.link, self.paths.link[inliers]))
        middle = np.full(len(others), start + (360 - gaps.max()) / 2)
        found = compared(others, middle, fit.centre, fit.radius, fit.covariance)
        received = fit.excess_loss + 20 * np.log10(self.paths.length[inliers])
        s1, s2 = (np.linalg.norm(found.point - end, axis=-1) for end in (others.tx, others.rx))
        with np.errstate(invalid="ignore"):
            strong = found.excess_loss + 20 * np.log10(s1 + s2) <= received.max()
            between = (found.normal - start) % 360 <= 360 - gaps.max()
        return len(inliers) + int(np.count_nonzero(strong & between))

    def _local_clutter(self, own: Elements, inliers: IntArray) -> FloatArray:
        """Log density (inlier,) of the other paths about the reflection points, as in `Elements`."""
        without = self._place[inliers[self._background[inliers]]]
        density = self._density.at(own.point, [without] * len(inliers))
        return np.log(density * np.maximum(np.abs(np.linalg.det(own.point_slopes)), 1e-12))


def path_log_odds(chi_squared: FloatArray, own: Elements) -> FloatArray:
    """Log odds (path,) of lengths and azimuths to be off a face that they agree with so well, and not clutter."""
    return np.asarray(-chi_squared / 2 - np.log(2 * np.pi) - own.log_clutter)


def pair_cylinders(first: Elements, second: Elements) -> tuple[FloatArray, FloatArray]:
    """Cylinders (pair, 3) through pairs of elements, and their covariances (pair, 3, 3); NaN where they disagree.

    Two elements are four equations ``c + a n = p`` for three unknowns: the radius is ``dp.dn / |dn|**2``, and what is
    left of ``dp - a dn`` has one degree of freedom.
    """
    dp, dn = first.point - second.point, first.normal - second.normal
    square = np.sum(dn**2, axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        radius = np.sum(dp * dn, axis=-1) / square
    usable = (np.abs(radius) > RADII[0]) & (np.abs(radius) < RADII[1])
    radius = np.where(usable, radius, 1.0)
    slopes = [one.centre_slopes(radius) for one in (first, second)]
    spread = [slope @ slope.swapaxes(-1, -2) for slope in slopes]
    normal_matrix, gradient = np.zeros((len(radius), 3, 3)), np.zeros((len(radius), 3))
    for one, covariance in zip((first, second), spread, strict=True):
        weight = np.linalg.inv(covariance + 1e-12 * np.eye(2))
        design = np.concatenate([np.broadcast_to(np.eye(2), covariance.shape), one.normal[:, :, None]], axis=-1)
        normal_matrix += design.swapaxes(-1, -2) @ weight @ design
        gradient += np.einsum("nij,njk,nk->ni", design.swapaxes(-1, -2), weight, one.point)
    usable &= np.linalg.cond(normal_matrix) < 1e13
    normal_matrix[~usable] = np.eye(3)
    errors = np.asarray(np.linalg.inv(normal_matrix), dtype=float)
    parameters = np.einsum("nij,nj->ni", errors, gradient)
    apart = dp - parameters[:, 2:] * dn
    chi2 = np.einsum("ni,nij,nj->n", apart, np.linalg.inv(spread[0] + spread[1] + 1e-12 * np.eye(2)), apart)
    radius = parameters[:, 2]
    usable &= (chi2 < CHI_SQUARED_GATE) & (np.abs(radius) > RADII[0]) & (np.abs(radius) < RADII[1])
    usable &= errors[:, 2, 2] < radius**2
    return np.where(usable[:, None], parameters, np.nan), np.where(usable[:, None, None], errors, np.nan)


def cylinder_of_elements(own: Elements, radius: float) -> tuple[FloatArray, FloatArray]:
    """Weighted least squares of ``c + a n = p``: cylinder (3,) and covariance (3, 3); weights are those of a radius."""
    slopes = own.centre_slopes(np.full(len(own.link), radius))
    weight = np.linalg.inv(slopes @ slopes.swapaxes(-1, -2) + 1e-12 * np.eye(2))
    design = np.concatenate([np.broadcast_to(np.eye(2), slopes.shape), own.normal[:, :, None]], axis=-1)
    weighted = design.swapaxes(-1, -2) @ weight
    covariance = np.linalg.pinv((weighted @ design).sum(axis=0), hermitian=True)
    return covariance @ np.einsum("nij,nj->i", weighted, own.point), covariance


def centre_misfit(own: Elements, parameters: FloatArray, covariance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Chi-squared (path,) of elements against a cylinder with its errors, and ``log sqrt|V| - log |D|`` (path,).

    ``V`` is the covariance of ``p - a n - c`` and ``|D|`` turns its density into one of length and azimuth.
    """
    slopes = own.centre_slopes(np.full(len(own.link), parameters[2]))
    design = np.concatenate([np.broadcast_to(np.eye(2), slopes.shape), own.normal[:, :, None]], axis=-1)
    spread = slopes @ slopes.swapaxes(-1, -2) + design @ covariance @ design.swapaxes(-1, -2)
    residual = own.point - parameters[:2] - parameters[2] * own.normal
    a, b, d = spread[:, 0, 0], spread[:, 0, 1], spread[:, 1, 1]
    determinant = np.maximum(a * d - b * b, 1e-24)
    east, north = residual.T
    chi2 = (east**2 * d - 2 * east * north * b + north**2 * a) / determinant
    turned = np.maximum(np.abs(np.linalg.det(slopes)), 1e-12)
    return chi2, np.log(determinant) / 2 - np.log(turned)


def predictive_log_odds(own: Elements, parameters: FloatArray, covariance: FloatArray) -> FloatArray:
    """Log odds (path,) of elements to be off a cylinder that is known so well, and not clutter."""
    chi2, width = centre_misfit(own, parameters, covariance)
    return np.asarray(-chi2 / 2 - np.log(2 * np.pi) - width - own.log_clutter)


def log_prior(radius: float) -> float:
    """Log prior density of a cylinder [1/m3]."""
    return float(np.log(PRIOR_DENSITY / (2 * abs(radius) * np.log(RADII[1] / RADII[0]))))
