"""The slopes of predicted paths are those of the predictions."""

import numpy as np

from erm.survey.residuals import residuals

from .worlds import random_world

STEP = 1e-5


def test_slopes_are_derivatives() -> None:
    rng = np.random.default_rng(1)
    paths, faces, errors = random_world(rng)
    errors = errors[paths.position]
    found = residuals(paths, faces, errors)
    for column in range(4):
        change = np.zeros(4)
        change[column] = STEP
        ahead, behind = (residuals(paths, faces, errors + sign * change).value for sign in (1, -1))
        np.testing.assert_allclose((behind - ahead) / (2 * STEP), found.by_position[:, :, column], atol=1e-4, rtol=1e-5)
    for face in range(len(faces.normal)):
        for column, name in enumerate(("normal", "offset")):
            change = STEP * (np.arange(len(faces.normal)) == face)
            ahead, behind = (
                residuals(paths, faces._replace(**{name: getattr(faces, name) + sign * change}), errors).value
                for sign in (1, -1)
            )
            expected = np.sum(found.by_face[:, :, :, column] * (paths.faces == face)[:, None, :], axis=-1)
            np.testing.assert_allclose((behind - ahead) / (2 * STEP), expected, atol=1e-4, rtol=1e-5)
