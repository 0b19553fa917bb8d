"""Eliminating positions gives the solution, the covariance and the traces of the whole normal matrix."""

import numpy as np

from erm.survey.residuals import Residuals
from erm.survey.schur import BLOCK, Pattern, normal_equations, solve, total

PATHS, FACES, POSITIONS = 60, 4, 7
SHARED, ALL = 2 * FACES, 2 * FACES + BLOCK * POSITIONS


def test_equal_to_dense_least_squares() -> None:
    rng = np.random.default_rng(1)
    residual = Residuals(
        rng.standard_normal((PATHS, 2)),
        rng.standard_normal((PATHS, 2, 4)),
        rng.standard_normal((PATHS, 2, BLOCK)),
    )
    faces, position = rng.integers(0, FACES, (PATHS, 2)), rng.integers(0, POSITIONS, PATHS)
    columns = (2 * faces[:, :, None] + np.arange(2)).reshape(PATHS, -1)
    weight = rng.uniform(0.2, 1.0, (PATHS, 2))
    pattern = Pattern.of(columns, position, SHARED, POSITIONS)
    parts = [normal_equations(residual, kind, weight[:, kind], pattern) for kind in range(2)]
    both = total(parts, np.array([1.0, 0.5]))
    both = both._replace(block=both.block + np.eye(BLOCK))
    found = solve(both, pattern)

    matrices, gradient = [], np.zeros(ALL)
    for kind, factor in enumerate((1.0, 0.5)):
        slopes = np.zeros((PATHS, ALL))
        np.add.at(slopes, (np.arange(PATHS)[:, None], columns), residual.by_face[:, kind])
        slopes[np.arange(PATHS)[:, None], SHARED + BLOCK * position[:, None] + np.arange(BLOCK)] = residual.by_position[
            :, kind
        ]
        matrices.append(slopes.T @ (weight[:, kind, None] * slopes))
        gradient += factor * slopes.T @ (weight[:, kind] * residual.value[:, kind])
    prior = np.diag(np.r_[np.zeros(SHARED), np.ones(BLOCK * POSITIONS)])
    covariance = np.linalg.inv(matrices[0] + 0.5 * matrices[1] + prior)
    step = covariance @ gradient

    np.testing.assert_allclose(np.r_[found.shared, found.block.ravel()], step, rtol=1e-9)
    np.testing.assert_allclose(found.shared_covariance, covariance[:SHARED, :SHARED], rtol=1e-8, atol=1e-12)
    blocks = covariance[SHARED:, SHARED:].reshape(POSITIONS, BLOCK, POSITIONS, BLOCK)
    own = blocks[np.arange(POSITIONS), :, np.arange(POSITIONS)]
    np.testing.assert_allclose(found.block_covariance(), own, rtol=1e-8, atol=1e-12)
    added = rng.standard_normal((BLOCK, SHARED))
    every = np.hstack([np.tile(added, (POSITIONS, 1)), np.eye(BLOCK * POSITIONS)])
    blocks = (every @ covariance @ every.T).reshape(POSITIONS, BLOCK, POSITIONS, BLOCK)
    own = blocks[np.arange(POSITIONS), :, np.arange(POSITIONS)]
    np.testing.assert_allclose(found.block_covariance(added), own, rtol=1e-8, atol=1e-12)
    for part, matrix in zip(parts, matrices, strict=True):
        np.testing.assert_allclose(found.trace(part), np.trace(covariance @ matrix), rtol=1e-9)
