"""Search for cylinders: pairs of surface elements that turn toward each other, and the paths that agree with them."""

from collections.abc import Callable
from itertools import compress
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from erm.common.odds import TWENTY_TO_ONE
from erm.geometry.vertical import FloatArray
from erm.mpcs.standard_errors import SIGMAS
from erm.reconstruction.curved.agreement import NearElements, centre_misfit, path_log_odds, predictive_log_odds
from erm.reconstruction.curved.elements import ROUNDING, Elements, elements_of, normals_azimuth
from erm.reconstruction.curved.fit import CylinderFit, compared, compared_with_each, fit_cylinders
from erm.reconstruction.curved.pairs import (
    RADII,
    THINNEST,
    best_of_each,
    cylinders_of_elements,
    is_possible,
    log_prior,
    radius_densities,
)
from erm.reconstruction.model.fit import CHI_SQUARED_GATE
from erm.reconstruction.model.loss import log_odds_of_loss
from erm.reconstruction.model.paths import BoolArray, IntArray, Paths
from erm.reconstruction.model.ragged import Ragged
from erm.reconstruction.poles.evidence import ClutterDensity
from erm.reconstruction.search.false_alarm import log_probability_of_view
from erm.reconstruction.search.refine_groups import best_of_each_link

MIN_PATHS = 4
"""Fewest links of a cylinder: two paths have four values for its three parameters, the third and fourth confirm."""
MAX_SEEDS = 600
"""Paths from which cylinders are searched, evenly drawn. Chosen: bounds the time in large campaigns."""
NEIGHBOURS = 160
"""Paths near a seed that are its partners and that score it. Chosen: bounds time."""
BATCH = 64
"""Seeds or cylinders worked on at once: a few MiB. Chosen; not derived."""
MAX_REFINEMENTS = 6
"""Repetitions of collecting and fitting the paths of a cylinder. Chosen; not derived."""


Fit = Callable[[Ragged, FloatArray], tuple[FloatArray, FloatArray]]
"""Parameters and covariances of cylinders from their inliers and starts."""


class CurvedFace(NamedTuple):
    """A cylinder, its paths, and the evidence for it."""

    fit: CylinderFit
    inliers: IntArray  # (inlier,) rows of the paths
    log_odds: FloatArray  # (inlier,) of each to be off the cylinder and not clutter
    log_clutter: FloatArray  # (inlier,) log density of clutter about each, as in `Elements`
    log_volume: float  # of the cylinder's parameters, prior included (Laplace)
    log_view: float  # log probability that just these of the links in view received it; 0 as long as it is not asked

    @property
    def is_thin(self) -> bool:
        """Whether the radius follows from the loss only, as of a thin pole."""
        return bool(abs(self.fit.radius) < SIGMAS * np.sqrt(self.fit.covariance[2, 2]))

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
        self._near = NearElements(self.elements)
        self._place = np.cumsum(background) - 1
        self._background = background
        self._density = ClutterDensity(paths.take(background), self.elements.point[background])
        self._links = paths.take(np.unique(paths.link, return_index=True)[1])

    def run(self) -> list[CurvedFace]:
        """Cylinders that are likelier than clutter; their paths may overlap."""
        count = len(self.paths)
        if count < MIN_PATHS:
            return []
        seeds = np.unique(np.linspace(0, count - 1, min(count, MAX_SEEDS)).astype(np.int64))
        return self._faces(*self._settled(*self._best_pairs(seeds), self._fit_elements))

    def refine(self, parameters: FloatArray, covariance: FloatArray, free: IntArray | None = None) -> CurvedFace | None:
        """Let a cylinder collect the paths that agree with it, and fit it to these, until they no longer change."""
        faces = [self.seen(face) for face in self._faces(parameters[None], covariance[None], free)]
        return faces[0] if faces and faces[0].evidence > TWENTY_TO_ONE else None

    def _faces(self, parameters: FloatArray, covariance: FloatArray, free: IntArray | None = None) -> list[CurvedFace]:
        """Cylinders, exact by Fermat's principle, that are likelier than clutter, whatever other links received."""
        parameters, covariance = self._settled(parameters, covariance, self._fit_paths, free)
        of, rows, _ = self._agreeing(parameters, covariance, free)
        paths, normal, shape = self.paths.take(rows), self.normal[rows], parameters[of]
        chi2, *columns = compared_with_each(paths, normal, shape)
        own = self.elements.take(rows)
        odds = path_log_odds(chi2, own) + log_odds_of_loss(own.loss - columns[2], own.loss_std)
        inside = chi2 < CHI_SQUARED_GATE
        count = np.bincount(of, inside, len(parameters))
        volume = 1.5 * np.log(2 * np.pi) + np.linalg.slogdet(covariance)[1] / 2 + log_prior(parameters[:, 2])
        # clutter is nowhere less dense than everywhere on average
        possible = np.bincount(of[inside], odds[inside], len(parameters)) + volume > TWENTY_TO_ONE
        edges = np.searchsorted(of, np.arange(len(parameters) + 1))
        found: list[CurvedFace] = []
        taken: list[set[int]] = []
        for number in np.flatnonzero(possible & (count >= MIN_PATHS)).tolist():
            kept = np.arange(edges[number], edges[number + 1])
            agreeing = rows[kept].tolist()
            larger = [place for place, one in enumerate(taken) if one.issuperset(agreeing)]
            if any(self._is_likely(found, place) for place in larger):
                continue
            kept = kept[inside[kept]]
            clutter = self._local_clutter(own.take(kept), rows[kept])
            fit = CylinderFit(
                parameters[number, :2],
                float(parameters[number, 2]),
                covariance[number],
                chi2[kept],
                *(column[kept] for column in columns),
            )
            denser = np.maximum(clutter - own.log_clutter[kept], 0.0)
            face = CurvedFace(
                fit, rows[kept], odds[kept] - denser, own.log_clutter[kept] + denser, float(volume[number]), 0.0
            )
            if face.evidence > TWENTY_TO_ONE:
                found.append(face)
                taken.append(set(face.inliers.tolist()))
        return found

    def _is_likely(self, faces: list[CurvedFace], place: int) -> bool:
        """Whether one of some faces is likelier than clutter; that what other links received was asked is kept."""
        faces[place] = self.seen(faces[place])
        return faces[place].evidence > TWENTY_TO_ONE

    def _best_pairs(self, seeds: IntArray) -> tuple[FloatArray, FloatArray]:
        """Parameters (pair, 3) and covariances (pair, 3, 3) of likely pairs of seeds and partners, likeliest first."""
        near = np.asarray(self.tree.query(self.elements.point[seeds], min(NEIGHBOURS, len(self.paths)))[1])
        found: list[tuple[FloatArray, FloatArray, FloatArray]] = []
        for first in range(0, len(seeds), BATCH):
            rows, own = near[first : first + BATCH], seeds[first : first + BATCH]
            radius, density = radius_densities(self.elements.take(own[:, None]), self.elements.take(rows))
            at, one = np.nonzero(density > 0)
            if not len(at):
                continue
            # prior to the measurement every octave of radius is equally likely, convex or concave
            octave = np.floor(np.log2(np.abs(radius[at, one])))
            at, one = (index[best_of_each(density[at, one], octave, radius[at, one] > 0, at)] for index in (at, one))
            both = np.stack([own[at], rows[at, one]], axis=-1)
            of = np.repeat(np.arange(len(at)), 2)
            parameters, covariance = cylinders_of_elements(self.elements.take(both.ravel()), of, radius[at, one])
            score = self._best_of_links(parameters, covariance, rows[at]) + log_prior(parameters[:, 2])
            score[~is_possible(parameters[:, 2])] = -np.inf
            best = best_of_each(score, parameters[:, 2] > 0, at)
            best = best[score[best] > TWENTY_TO_ONE]
            found.append((score[best], parameters[best], covariance[best]))
        if not found:
            return np.empty((0, 3)), np.empty((0, 3, 3))
        score, parameters, covariance = (np.concatenate(part) for part in zip(*found, strict=True))
        order = np.argsort(-score, kind="stable")
        return parameters[order], covariance[order]

    def _best_of_links(self, parameters: FloatArray, covariance: FloatArray, rows: IntArray) -> FloatArray:
        """Sum (cylinder,) of the log odds, where positive, of the best one of rows (cylinder, n) of each link."""
        own = self.elements.take(rows)
        odds = np.maximum(predictive_log_odds(own, parameters[:, None], covariance[:, None]), 0.0)
        best = np.zeros((len(rows), int(self.elements.link.max()) + 1))
        np.maximum.at(best, (np.arange(len(rows))[:, None], own.link), odds)
        return np.asarray(best.sum(axis=-1))

    def _settled(
        self, parameters: FloatArray, covariance: FloatArray, fit: Fit, free: IntArray | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Cylinders after collecting the free paths that agree, and fitting to these, until they no longer change.

        Those that clutter explains better are left out. Many starts end in the same cylinder. The likeliest is first.
        """
        done: dict[bytes, tuple[float, FloatArray, FloatArray]] = {}
        before: list[bytes] = [b""] * len(parameters)
        for last in range(MAX_REFINEMENTS + 1):
            of, rows, odds = self._agreeing(parameters, covariance, free)
            inliers = Ragged.from_pairs(of, rows, len(parameters))
            score = np.bincount(of, odds, len(parameters)) + log_prior(parameters[:, 2])
            left: dict[bytes, int] = {}
            for number in np.flatnonzero((inliers.sizes >= MIN_PATHS) & (score > TWENTY_TO_ONE)).tolist():
                key = inliers[number].tobytes()
                if key == before[number] or last == MAX_REFINEMENTS:
                    done.setdefault(key, (float(score[number]), parameters[number], covariance[number]))
                elif key not in done:
                    left.setdefault(key, number)
            if not left:
                break
            kept = np.array(list(left.values()))
            inliers = inliers.take(kept)
            parameters, covariance = fit(inliers, parameters[kept])
            # a pole so thin that its radius is 0 within its error may come out thinner than any
            parameters[np.abs(parameters[:, 2]) <= RADII[0], 2] = THINNEST
            possible = is_possible(parameters[:, 2])
            parameters, covariance = parameters[possible], covariance[possible]
            before = list(compress(left, possible))
        best = sorted(done.values(), key=lambda one: -one[0])
        return np.array([one[1] for one in best]).reshape(-1, 3), np.array([one[2] for one in best]).reshape(-1, 3, 3)

    def _fit_elements(self, inliers: Ragged, start: FloatArray) -> tuple[FloatArray, FloatArray]:
        return cylinders_of_elements(self.elements.take(inliers.rows), inliers.owner, start[:, 2])

    def _fit_paths(self, inliers: Ragged, start: FloatArray) -> tuple[FloatArray, FloatArray]:
        return fit_cylinders(self.paths.take(inliers.rows), self.normal[inliers.rows], inliers.owner, start)

    def _agreeing(
        self, parameters: FloatArray, covariance: FloatArray, free: IntArray | None
    ) -> tuple[IntArray, IntArray, FloatArray]:
        """Pairs (pair,) of cylinders and free paths that agree, the best of each link, and their log odds."""
        allowed = None if free is None else np.isin(np.arange(len(self.paths)), free)
        parts = [(np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64), np.empty(0))]
        for first in range(0, len(parameters), BATCH):
            some = slice(first, first + BATCH)
            of, rows = self._near.of(parameters[some], covariance[some])
            if allowed is not None:
                of, rows = of[allowed[rows]], rows[allowed[rows]]
            own = self.elements.take(rows)
            chi2, width = centre_misfit(own, parameters[some][of], covariance[some][of])
            inside = np.flatnonzero(chi2 < CHI_SQUARED_GATE)
            best = inside[best_of_each_link(of[inside], own.link[inside], rows[inside], chi2[inside])]
            odds = -chi2[best] / 2 - np.log(2 * np.pi) - width[best] - own.log_clutter[best]
            parts.append((of[best] + first, rows[best], odds))
        of, rows, odds = (np.concatenate(part) for part in zip(*parts, strict=True))
        return of, rows, odds

    def seen(self, face: CurvedFace) -> CurvedFace:
        """Face with the probability that other links received nothing; it lowers the evidence."""
        if face.log_view:
            return face
        view = log_probability_of_view(len(face.inliers), self._in_view(face.fit, face.inliers))
        return face._replace(log_view=view)

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
        return np.log(density * np.maximum(np.abs(own.turned[:, 0]), ROUNDING))
