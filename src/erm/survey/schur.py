r"""Sparse least squares with one small block of parameters a position, which are eliminated first (Schur complement).

The normal matrix of shared parameters ``s`` and the four errors ``p`` of each position is

.. math:: \begin{pmatrix} A & C \\ C^T & B \end{pmatrix}, \qquad B\ \text{block diagonal}.

With ``T = B**-1 C'``, the covariance of the shared parameters is ``S = (A - C T)**-1``. That of the errors of position
``i`` is ``B_i**-1 + T_i S T_i'``. Time grows in proportion to the positions; only the shared parameters have a
dense matrix.

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


class NormalEquations(NamedTuple):
    """Normal matrix and gradient of shared parameters (shared,) and of errors (position, 4)."""

    shared: sparse.csr_array  # A (shared, shared)
    cross: sparse.csr_array  # C (shared, 4 position)
    block: FloatArray  # B (position, 4, 4)
    shared_gradient: FloatArray  # (shared,)
    block_gradient: FloatArray  # (position, 4)

    def scaled(self, std: FloatArray) -> "NormalEquations":
        """Return the equations of errors in units of their standard deviations (4,); these may be 0."""
        scale = sparse.diags_array(np.tile(std, len(self.block)))
        return NormalEquations(
            self.shared,
            self.cross @ scale,
            self.block * std[:, None] * std,
            self.shared_gradient,
            self.block_gradient * std,
        )


class Solution(NamedTuple):
    """Solution of normal equations and its covariance."""

    shared: FloatArray  # (shared,)
    block: FloatArray  # (position, 4)
    shared_covariance: FloatArray  # (shared, shared)
    block_inverse: FloatArray  # B**-1 (position, 4, 4)
    transfer: sparse.csr_array  # T (4 position, shared)

    def scaled(self, std: FloatArray) -> "Solution":
        """Return the solution in the units of errors (4,) that it measures in their standard deviations."""
        scale = sparse.diags_array(np.tile(std, len(self.block)))
        inverse = self.block_inverse * std[:, None] * std
        return self._replace(block=self.block * std, block_inverse=inverse, transfer=(scale @ self.transfer).tocsr())

    def block_covariance(self, added: sparse.csr_array | None = None) -> FloatArray:
        """Covariance (position, 4, 4) of the errors, or of errors plus ``added`` (4 position, shared) shared ones."""
        slope = -self.transfer if added is None else added - self.transfer
        spread = slope @ self.shared_covariance
        count = len(self.block_inverse)
        dense = np.asarray(slope.todense()).reshape(count, BLOCK, -1)
        return self.block_inverse + np.einsum("pis,pjs->pij", spread.reshape(count, BLOCK, -1), dense)

    def trace(self, part: NormalEquations) -> float:
        """Trace of the covariance times a part of the normal matrix: parameters that this part determines."""
        across = part.cross @ self.transfer
        inner = _block_diagonal(part.block) @ self.transfer
        reduced = part.shared - across - across.T + self.transfer.T @ inner
        own = float(np.einsum("pij,pji->", self.block_inverse, part.block))
        return own + float((reduced * self.shared_covariance).sum())


def normal_equations(
    residual: Residuals, kind: int, weight: FloatArray, columns: IntArray, position: IntArray, count: tuple[int, int]
) -> NormalEquations:
    """Weighted normal equations of one measured quantity.

    Parameters
    ----------
    residual : Residuals
    kind : int
        The quantity.
    weight : array (path,)
    columns : array (path, bounce, 2) of int
        Shared parameter of each slope by a face.
    position : array (path,) of int
    count : (int, int)
        Numbers of shared parameters and of positions.
    """
    root = np.sqrt(weight)
    value = residual.value[:, kind] * root
    paths, shared = len(value), count[0]
    by_face = residual.by_face[:, kind].reshape(paths, -1) * root[:, None]
    by_position = residual.by_position[:, kind] * root[:, None]
    of_face = sparse.csr_array(
        (by_face.ravel(), (np.repeat(np.arange(paths), by_face.shape[1]), columns.ravel())), shape=(paths, shared)
    )
    start = np.arange(0, paths * BLOCK + 1, BLOCK)
    column = (BLOCK * position[:, None] + np.arange(BLOCK)).ravel()
    of_position = sparse.csr_array((by_position.ravel(), column, start), shape=(paths, BLOCK * count[1]))
    block = np.zeros((count[1], BLOCK, BLOCK))
    for i in range(BLOCK):
        for j in range(i + 1):
            block[:, i, j] = block[:, j, i] = np.bincount(position, by_position[:, i] * by_position[:, j], count[1])
    return NormalEquations(
        (of_face.T @ of_face).tocsr(),
        (of_face.T @ of_position).tocsr(),
        block,
        np.asarray(of_face.T @ value),
        np.asarray(of_position.T @ value).reshape(-1, BLOCK),
    )


def total(parts: list[NormalEquations], factors: FloatArray) -> NormalEquations:
    """Sum of normal equations, each with its factor."""
    return NormalEquations(
        *(
            sum((f * p for p, f in zip(column, factors, strict=True)), start=0 * column[0])
            for column in zip(*parts, strict=True)
        )
    )


def solve(equations: NormalEquations) -> Solution:
    """Solve normal equations. The normal matrix must be positive definite."""
    inverse = np.asarray(np.linalg.inv(equations.block), dtype=float)
    eliminate = _block_diagonal(inverse)
    transfer = (eliminate @ equations.cross.T).tocsr()
    reduced = (equations.shared - equations.cross @ transfer).toarray()
    own = np.einsum("pij,pj->pi", inverse, equations.block_gradient)
    gradient = equations.shared_gradient - equations.cross @ own.ravel()
    # parameters in units of their own errors: degrees and metres differ by orders of magnitude
    scale = 1 / np.sqrt(np.diag(reduced))
    covariance = np.linalg.inv(reduced * scale[:, None] * scale) * scale[:, None] * scale
    shared = covariance @ gradient
    block = own - (transfer @ shared).reshape(own.shape)
    return Solution(shared, block, covariance, inverse, transfer)


def _block_diagonal(blocks: FloatArray) -> sparse.bsr_array:
    """Matrix with blocks (n, 4, 4) on its diagonal."""
    count = len(blocks)
    return sparse.bsr_array((blocks, np.arange(count), np.arange(count + 1)), shape=(BLOCK * count, BLOCK * count))
