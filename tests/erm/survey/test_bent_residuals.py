"""Paths off cylinders in the adjustment: slopes are those of differences, and radius, centre and survey come out."""

from dataclasses import replace

import numpy as np
import pytest

from erm.survey.bundle import SurveyStd, adjust
from erm.survey.residuals import BentPaths, Faces, MeasuredPaths, bent_residuals

PILLAR = np.array([[6.0, 5.0, 0.5]])
NO_FACES = Faces(np.empty(0), np.empty(0), np.empty((0, 2)))


def measured(errors: np.ndarray, cylinders: np.ndarray, rx: np.ndarray, noise: float, seed: int) -> BentPaths:
    """One path of each position off each cylinder, as positions with errors measure it."""
    count, rng = len(rx), np.random.default_rng(seed)
    number, position = np.repeat(np.arange(len(cylinders)), count), np.tile(np.arange(count), len(cylinders))
    tx = np.zeros((len(number), 2))
    toward = cylinders[number, :2] - (tx + rx[position]) / 2
    normal = np.rad2deg(np.arctan2(-toward[:, 1], -toward[:, 0]))
    std = np.tile([0.01, 0.3], (len(number), 1))
    exact = MeasuredPaths(tx, rx[position], np.full(len(number), 2.0), 0 * std, std, position, number[:, None][:, :0])
    predicted = -bent_residuals(BentPaths(exact, number, normal, cylinders), cylinders, errors[position]).value * std
    value = predicted + noise * std * rng.standard_normal(std.shape)
    paths = MeasuredPaths(tx, rx[position], exact.height_difference, value, std, position, exact.faces)
    return BentPaths(paths, number, normal, cylinders)


@pytest.mark.parametrize("radius", [0.5, -20.0])
def test_slopes_are_those_of_differences(radius):
    rng = np.random.default_rng(3)
    centre = np.array([6.0, 5.0]) if radius > 0 else np.array([1.0, -2.0])
    cylinders = np.array([[*centre, radius]])
    rx = rng.uniform(-4, 4, (8, 2))
    errors = np.zeros((8, 4))
    bent = measured(errors, cylinders, rx, 1.0, 1)
    found = bent_residuals(bent, cylinders, errors)
    assert np.all(found.by_face != 0)
    for k in range(3):
        moved = bent_residuals(bent, cylinders + 1e-6 * np.eye(3)[k], errors)
        assert found.by_face[:, :, k] == pytest.approx((found.value - moved.value) / 1e-6, rel=1e-4, abs=1e-3)
    for k in range(4):
        moved = bent_residuals(bent, cylinders, errors + 1e-6 * np.eye(4)[k])
        assert found.by_position[:, :, k] == pytest.approx((found.value - moved.value) / 1e-6, rel=1e-4, abs=1e-3)


def test_pillars_show_their_radii_and_where_receivers_stood():
    rng = np.random.default_rng(5)
    cylinders = np.array([[6.0, 5.0, 0.5], [-7.0, 4.0, 0.3], [1.0, -8.0, 0.4], [9.0, -6.0, 0.25]])
    count = 30
    rx = rng.uniform(-4, 4, (count, 2))
    errors = np.column_stack([0.1 * rng.standard_normal((count, 2)), np.zeros((count, 2))])
    bent = measured(errors, cylinders, rx, 1.0, 2)
    bent = bent._replace(cylinders=cylinders + rng.normal(0, 0.05, cylinders.shape))
    own = bent.paths.take(np.arange(count))
    there = -(rx + errors[:, :2])
    length = np.hypot(np.hypot(*there.T), own.height_difference)
    value = np.column_stack([length, np.rad2deg(np.arctan2(*there.T[::-1]))])
    direct = replace(own, measured=value + own.std * rng.standard_normal((count, 2)))
    found = adjust(direct, NO_FACES, count, SurveyStd(0.1, 0.0, 0.0), bent=bent)
    std = np.sqrt(np.diagonal(found.cylinder_covariance, axis1=1, axis2=2))
    assert np.all(std < 0.1)
    assert np.sqrt(np.mean(((found.cylinders - cylinders) / std) ** 2)) < 1.6
    assert np.std((found.errors - errors)[:, :2]) < 0.5 * np.std(errors[:, :2])
