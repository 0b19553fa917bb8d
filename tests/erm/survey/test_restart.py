"""Positions are found from known images, whatever the last search made of them."""

import numpy as np

from erm.survey.bundle import SurveyStd
from erm.survey.positions import PositionErrors
from erm.survey.residuals import MeasuredPaths
from erm.survey.restart import Restarted, Sources, restart

STD = np.array([0.2, 0.2, 3.0, 0.15])
WRONG = np.array([0.6, -0.5, -8.0, 0.2])


def measured(errors, images, rng):
    """A path of each position from each image, with errors of 3 cm and 0.5 degrees, and as many from anywhere."""
    rx = rng.uniform(-10, 10, (len(errors), 2))
    own = (rx + errors[:, :2])[:, None]
    apart = images - own
    length = np.hypot(*np.moveaxis(apart, -1, 0)) + errors[:, 3, None] + 0.03 * rng.standard_normal(apart.shape[:2])
    azimuth = np.rad2deg(np.arctan2(apart[..., 1], apart[..., 0])) + errors[:, 2, None]
    azimuth += 0.5 * rng.standard_normal(length.shape)
    anywhere = rng.uniform([0, 0], [80, 360], (*length.shape, 2))
    both = np.concatenate([np.stack([length, azimuth], axis=-1), anywhere], axis=1)
    position = np.repeat(np.arange(len(errors)), both.shape[1])
    n = len(position)
    none = np.empty((n, 0), dtype=np.int64)
    std = np.tile([0.03, 0.5], (n, 1))
    return MeasuredPaths(np.zeros((n, 2)), rx[position], np.zeros(n), both.reshape(-1, 2), std, position, none)


def restarted(errors, images, last, rng):
    paths = measured(errors, images, rng)
    none = np.zeros(len(paths), dtype=np.int64)
    sources = Sources(images, np.zeros(len(images)), np.zeros(len(images), dtype=np.int64))
    return restart(paths, (none, none.astype(float)), sources, (np.zeros(4), STD), last)


def test_errors_are_found_to_their_covariance_from_a_wrong_start():
    rng = np.random.default_rng(3)
    errors = STD * rng.standard_normal((60, 4))
    images = rng.uniform(-60, 60, (12, 2))
    found = restarted(errors, images, np.tile(WRONG, (60, 1)), rng)
    assert np.count_nonzero(found.log_odds > 7) > 20  # the others find back by themselves
    assert (found.log_odds > -0.1).all()
    apart = found.errors - errors
    chi_squared = np.einsum("pi,pij,pj->p", apart, np.linalg.inv(found.covariance), apart)
    # mean of 60 values with 4 degrees of freedom: 4 +- 0.37; paths from anywhere add to it
    assert 3 < chi_squared.mean() < 5.5
    assert chi_squared.max() < 20  # 1 in 2000


def test_what_the_last_search_found_is_kept_where_it_is_right():
    rng = np.random.default_rng(4)
    errors = STD * rng.standard_normal((20, 4))
    found = restarted(errors, rng.uniform(-60, 60, (12, 2)), errors, rng)
    np.testing.assert_allclose(found.log_odds, 0.0, atol=1e-3)
    np.testing.assert_allclose(found.apart, 0.0, atol=1e-3)


def test_a_covariance_holds_both_of_two_likely_places():
    none = np.zeros((2, 4))
    apart = np.array([[1.0, 0.0, 0.0, 0.0]] * 2)
    small = np.tile(1e-4 * np.eye(4), (2, 1, 1))
    last = PositionErrors(np.arange(2), np.arange(2), none, small, small, SurveyStd(), False, True, np.ones(2))
    found = last.restarted(Restarted(none + apart, small, np.array([0.0, 20.0]), apart))
    np.testing.assert_allclose(found.errors, [[0, 0, 0, 0], [1, 0, 0, 0]])  # one as likely as the other; a new one
    np.testing.assert_allclose(found.covariance[:, 0, 0], [0.5001, 1e-4], rtol=1e-4)
