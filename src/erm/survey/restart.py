r"""Errors of positions found anew from images that are known, without knowing which path belongs to which image.

A search at a place that is wrong finds wrong paths for the images of its position, and these confirm the place. With
the errors ``e`` of a position, all its paths ``i`` and all sources ``j``, its transmitter and the images of this, the
likelihood that does not know which belong together is

.. math:: \prod_i \Big(\tfrac12 + \tfrac1{2 J} \sum_j N(m_i - p_j(e)) / u\Big) \; N(e),

``u`` the density of paths from anywhere. Expectation-maximisation climbs it from two starts: from the errors of the
last search, and from those that are expected without any, with the widths of the prior that shrink step by step
(deterministic annealing).

References
----------
Ueda and Nakano, Deterministic annealing EM algorithm (1998).
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from erm.geometry.vertical import FloatArray
from erm.mpcs.standard_errors import SIGMAS
from erm.mpcs.survey_widths import survey_widths
from erm.survey.residuals import Faces, IntArray, MeasuredPaths, residuals
from erm.survey.schur import BLOCK

NO_FACES = Faces(np.empty(0), np.empty(0), np.empty((0, 2)))
HEATS = (1.0, 0.5, 0.25, 0.125, 0.0)
"""Shares of the widths of the prior that are added to the standard errors, one after another: half of the one before,
down to where they are below the errors of a good measurement."""
STEPS = 4
"""Steps of Gauss and Newton at each width. Chosen; not derived."""
CHUNK = 10_000
"""Paths that are compared with all sources at once; for memory."""


class Sources(NamedTuple):
    """Where paths come from: transmitters and their mirror sources."""

    place: FloatArray  # (source, 2) m
    std: FloatArray  # (source,) m
    transmitter: IntArray  # (source,)


class Restarted(NamedTuple):
    """Errors of positions from a new start."""

    errors: FloatArray  # (position, 4)
    covariance: FloatArray  # (position, 4, 4)
    log_odds: FloatArray  # (position,), against the errors of the last search
    apart: FloatArray  # (position, 4), from the maximum near the errors of the last search


def restart(
    observations: MeasuredPaths,
    of_path: tuple[IntArray, FloatArray],
    sources: Sources,
    prior: tuple[FloatArray, FloatArray],
    errors: FloatArray,
) -> Restarted:
    """Find errors of positions from two starts.

    Parameters
    ----------
    observations : MeasuredPaths
        All paths that may be off vertical walls, or direct; their faces are not used.
    of_path : (array (path,) of int, array (path,))
        Transmitter, and squared deviation of the elevation in standard errors.
    sources : Sources
    prior : (array (4,), array (4,))
        Mean and standard deviations of the errors of a position.
    errors : array (position, 4)
        Of the last search.

    Examples
    --------
    A receiver is 0.5 m east of where it was surveyed. Its three paths point to three of six images:

    >>> place = np.array([[0.0, 40.0], [30.0, 0.0], [-25.0, -25.0], [0.0, 43.0], [33.0, 2.0], [-20.0, -25.0]])
    >>> apart = place[:3] - [0.5, 0.0]
    >>> measured = np.column_stack([np.hypot(*apart.T), np.rad2deg(np.arctan2(*apart.T[::-1]))])
    >>> none = np.zeros(3, dtype=int)
    >>> paths = MeasuredPaths(np.zeros((3, 2)), np.zeros((3, 2)), np.zeros(3), measured, np.tile([0.03, 0.5], (3, 1)),
    ...                      none, np.empty((3, 0), dtype=int))
    >>> sources = Sources(place, np.zeros(6), np.zeros(6, dtype=int))
    >>> prior = np.zeros(4), np.array([0.3, 0.3, 1.0, 0.01])
    >>> restart(paths, (none, none), sources, prior, np.array([[-1.0, 1.0, 0.0, 0.0]])).errors[0, :2].round(2).tolist()
    [0.5, 0.0]
    """
    problem = _Problem(observations, of_path, sources, prior, len(errors))
    old, _, old_evidence = problem.climb(errors, HEATS[-1:])
    new, covariance, evidence = problem.climb(np.tile(prior[0], (len(errors), 1)), HEATS)
    return Restarted(new, covariance, evidence - old_evidence, new - old)


class _Problem:
    """Pairs of paths and sources that may belong together."""

    def __init__(
        self,
        observations: MeasuredPaths,
        of_path: tuple[IntArray, FloatArray],
        sources: Sources,
        prior: tuple[FloatArray, FloatArray],
        positions: int,
    ) -> None:
        self.mean, self.std = prior
        transmitter, elevation_misfit = of_path
        self.positions, self.paths = positions, len(observations)
        length, azimuth = observations.measured.T
        widths = survey_widths(length, observations.height_difference, azimuth, np.diag(self.std**2)[None])
        width = np.stack(widths, axis=-1)
        parts = [
            _near(observations, width, transmitter, sources, self.mean, rows)
            for rows in np.array_split(np.arange(self.paths), -(-self.paths // CHUNK) or 1)
        ]
        self.row, source = (np.concatenate(column) for column in zip(*parts, strict=True))
        self.pairs = _paired(observations, sources, self.row, source)
        self.width = width[self.row]
        count = np.bincount(sources.transmitter, minlength=transmitter.max(initial=0) + 1)[transmitter[self.row]]
        extent = 360.0 * (np.ptp(length) if self.paths else 0.0) + 1.0
        self.weight = extent / (2 * np.pi * count) * np.exp(-elevation_misfit[self.row] / 2)
        self.position = observations.position

    def climb(self, errors: FloatArray, heats: Sequence[float]) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Errors (position, 4), their covariance, and the logarithm of their evidence (position,)."""
        z = np.divide(errors - self.mean, self.std, out=np.zeros_like(errors), where=self.std > 0)
        for heat in heats:
            wide = replace(self.pairs, std=np.hypot(self.pairs.std, heat * self.width))
            for _ in range(STEPS):
                covariance, step, log_likelihood = self._step(wide, z)
                z = z + step
        covariance, _, log_likelihood = self._step(self.pairs, z)
        volume = np.linalg.slogdet(covariance)[1] / 2
        evidence = log_likelihood - np.sum(z**2, axis=1) / 2 + volume
        return self.mean + z * self.std, covariance * self.std[:, None] * self.std, evidence

    def _step(self, pairs: MeasuredPaths, z: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Covariance and step of the errors in standard deviations, and the log-likelihood of the paths before it."""
        of = pairs.position
        found = residuals(pairs, NO_FACES, (self.mean + z * self.std)[of])
        ratio = self.weight * np.exp(-np.sum(found.value**2, axis=1) / 2) / pairs.std.prod(axis=1)
        total = 1 + np.bincount(self.row, ratio, minlength=self.paths)
        share = ratio / total[self.row]
        slopes = found.by_position * self.std
        matrix = np.tile(np.eye(BLOCK), (self.positions, 1, 1))
        gradient = -z.copy()
        for i in range(BLOCK):
            gradient[:, i] += np.bincount(
                of, share * np.einsum("pk,pk->p", slopes[:, :, i], found.value), minlength=self.positions
            )
            for j in range(BLOCK):
                product = share * np.einsum("pk,pk->p", slopes[:, :, i], slopes[:, :, j])
                matrix[:, i, j] += np.bincount(of, product, minlength=self.positions)
        covariance = np.asarray(np.linalg.inv(matrix), dtype=float)
        likelihood = np.bincount(self.position, np.log(total / 2), minlength=self.positions).astype(float)
        return covariance, np.einsum("pij,pj->pi", covariance, gradient), likelihood


def _near(
    observations: MeasuredPaths,
    width: FloatArray,
    transmitter: IntArray,
    sources: Sources,
    mean: FloatArray,
    rows: IntArray,
) -> tuple[IntArray, IntArray]:
    """Paths and sources that agree within twice `SIGMAS` of all errors."""
    row, source = np.nonzero(transmitter[rows, None] == sources.transmitter)
    row = rows[row]
    pairs = _paired(observations, sources, row, source)
    wide = replace(pairs, std=np.hypot(pairs.std, width[row]))
    value = residuals(wide, NO_FACES, np.tile(mean, (len(row), 1))).value
    near = np.abs(value).max(axis=1, initial=0.0) < 2 * SIGMAS
    return row[near], source[near]


def _paired(observations: MeasuredPaths, sources: Sources, row: IntArray, source: IntArray) -> MeasuredPaths:
    """Paths from sources, with the errors of these."""
    paths = observations.take(row)
    spread = sources.std[source]
    across = np.rad2deg(spread / np.maximum(paths.measured[:, 0], spread.max(initial=0.0) + 1e-9))
    std = np.hypot(paths.std, np.column_stack([spread, across]))
    return replace(paths, tx=sources.place[source], std=std)
