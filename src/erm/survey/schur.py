r"""Sparse least squares with one small block of parameters a position, which are eliminated first (Schur complement).

The normal matrix of shared parameters ``s`` and the four errors ``p`` of each position is

.. math:: \begin{pmatrix} A & C \\ C^T & B \end{pmatrix}, \qquad B\ \text{block diagonal}.

With ``T = B**-1 C'``, the covariance of the shared parameters is ``S = (A - C T)**-1``. That of the errors of position
``i`` is ``B_i**-1 + T_i S T_i'``. Time grows in proportion to the positions; only the shared parameters have a
dense matrix. ``C`` and ``T`` are stored where a position has a path that shows the shared parameter, four numbers each:
these places do not change from step to step.

References
----------
Triggs et al., Bundle adjustment, a modern synthesis (2000), section 6.
"""

from typing import NamedTuple

import numpy as np
from scipy import sparse

from erm.geometry.vertical import FloatArray
from erm.survey.residuals import IntArray, Residuals

BLOCK = 4
"""Errors of one position."""


class Pattern(NamedTuple):
    """Which parameters show in which paths."""

    columns: IntArray  # (path, slope) shared parameter of each slope
    position: IntArray  # (path,)
    entry: IntArray  # (path, slope), of the pair of a position and a shared parameter
    entry_position: IntArray  # (entry,) ascending
    entry_column: IntArray  # (entry,)
    shared: int
    positions: int

    @classmethod
    def of(cls, columns: IntArray, position: IntArray, shared: int, positions: int) -> "Pattern":
        """Return the pattern of paths with shared parameters (path, slope) and positions (path,)."""
        pair, entry = np.unique(position[:, None] * max(shared, 1) + columns, return_inverse=True)
        at, column = np.divmod(pair, max(shared, 1))
        return cls(columns, position, entry.reshape(columns.shape), at, column, shared, positions)

    def matrix(self, entries: FloatArray) -> sparse.bsr_array:
        """Matrix (4 position, shared) of entries (entry, 4)."""
        start = np.searchsorted(self.entry_position, np.arange(self.positions + 1))
        shape = (BLOCK * self.positions, self.shared)
        return sparse.bsr_array((entries[:, :, None], self.entry_column, start), shape=shape)


class NormalEquations(NamedTuple):
    """Normal matrix and gradient of shared parameters (shared,) and of errors (position, 4)."""

    shared: FloatArray  # A (shared, shared)
    cross: FloatArray  # C (entry, 4)
    block: FloatArray  # B (position, 4, 4)
    shared_gradient: FloatArray  # (shared,)
    block_gradient: FloatArray  # (position, 4)

    def scaled(self, std: FloatArray) -> "NormalEquations":
        """Return the equations of errors in units of their standard deviations (4,); these may be 0."""
        return NormalEquations(
            self.shared,
            self.cross * std,
            self.block * std[:, None] * std,
            self.shared_gradient,
            self.block_gradient * std,
        )


class Solution(NamedTuple):
    """Solution of normal equations and its covariance."""

    pattern: Pattern
    shared: FloatArray  # (shared,)
    block: FloatArray  # (position, 4)
    shared_covariance: FloatArray  # (shared, shared)
    block_inverse: FloatArray  # B**-1 (position, 4, 4)
    transfer: FloatArray  # T (entry, 4)
    spread: FloatArray  # T S (position, 4, shared)

    def scaled(self, std: FloatArray) -> "Solution":
        """Return the solution in the units of errors (4,) that it measures in their standard deviations."""
        return self._replace(
            block=self.block * std,
            block_inverse=self.block_inverse * std[:, None] * std,
            transfer=self.transfer * std,
            spread=self.spread * std[:, None],
        )

    def block_covariance(self, added: FloatArray | None = None) -> FloatArray:
        """Covariance (position, 4, 4) of the errors, or of errors plus ``added`` (4, shared) shared ones."""
        of_entry = self._spread_of_entries()
        own = _sums(self.pattern.entry_position, of_entry[:, :, None] * self.transfer[:, None, :], len(self.block))
        covariance = self.block_inverse + own
        if added is None:
            return covariance
        both = self.spread @ added.T
        return np.asarray(covariance + added @ self.shared_covariance @ added.T - both - both.swapaxes(-1, -2))

    def trace(self, part: NormalEquations) -> float:
        """Trace of the covariance times a part of the normal matrix: parameters that this part determines."""
        inner = np.einsum("eij,ej->ei", part.block[self.pattern.entry_position], self.transfer)
        own = float(np.sum(self.block_inverse * part.block) + np.sum(part.shared * self.shared_covariance))
        return own + float(np.sum((inner - 2 * part.cross) * self._spread_of_entries()))

    def _spread_of_entries(self) -> FloatArray:
        return self.spread[self.pattern.entry_position, :, self.pattern.entry_column]


def normal_equations(residual: Residuals, kind: int, weight: FloatArray, pattern: Pattern) -> NormalEquations:
    """Weighted normal equations of one measured quantity.

    Parameters
    ----------
    residual : Residuals
        Its slopes ``by_face`` (path, 2, slope) by shared parameters.
    kind : int
        The quantity.
    weight : array (path,)
    pattern : Pattern
    """
    shared, positions = pattern.shared, pattern.positions
    value = residual.value[:, kind] * weight
    by_shared, by_position = residual.by_face[:, kind], residual.by_position[:, kind]
    of_shared, of_position = by_shared * weight[:, None], by_position * weight[:, None]
    place = pattern.columns[:, :, None] * shared + pattern.columns[:, None, :]
    return NormalEquations(
        _sums(place, of_shared[:, :, None] * by_shared[:, None, :], shared**2).reshape(shared, shared),
        _sums(pattern.entry, of_shared[:, :, None] * by_position[:, None, :], len(pattern.entry_position)),
        _sums(pattern.position, of_position[:, :, None] * by_position[:, None, :], positions),
        _sums(pattern.columns, value[:, None] * by_shared, shared),
        _sums(pattern.position, value[:, None] * by_position, positions),
    )


def total(parts: list[NormalEquations], factors: FloatArray) -> NormalEquations:
    """Sum of normal equations, each with its factor."""
    return NormalEquations(
        *(sum(f * p for p, f in zip(column, factors, strict=True)) for column in zip(*parts, strict=True))
    )


def solve(equations: NormalEquations, pattern: Pattern) -> Solution:
    """Solve normal equations. The normal matrix must be positive definite."""
    inverse = np.asarray(np.linalg.inv(equations.block), dtype=float)
    transfer = np.einsum("eij,ej->ei", inverse[pattern.entry_position], equations.cross)
    across = pattern.matrix(transfer)
    reduced = equations.shared - (pattern.matrix(equations.cross).T @ across).toarray()
    own = np.einsum("pij,pj->pi", inverse, equations.block_gradient)
    of_own = np.sum(equations.cross * own[pattern.entry_position], axis=-1)
    gradient = equations.shared_gradient - _sums(pattern.entry_column, of_own, pattern.shared)
    # parameters in units of their own errors: degrees and metres differ by orders of magnitude
    scale = 1 / np.sqrt(np.diag(reduced))
    covariance = np.linalg.inv(reduced * scale[:, None] * scale) * scale[:, None] * scale
    shared = covariance @ gradient
    spread = np.asarray(across @ covariance).reshape(*own.shape, pattern.shared)
    return Solution(pattern, shared, own - (across @ shared).reshape(own.shape), covariance, inverse, transfer, spread)


def _sums(number: IntArray, values: FloatArray, count: int) -> FloatArray:
    """Sums (count, ...) of the values (*n, ...) of each number (*n,)."""
    rest = values.shape[number.ndim :]
    size = int(np.prod(rest))
    place = number.reshape(-1, 1) * size + np.arange(size)
    sums = np.bincount(place.ravel(), values.ravel(), count * size)
    return sums.astype(np.float64).reshape(count, *rest)
