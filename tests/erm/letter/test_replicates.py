"""Scatter of repeated experiments."""

import numpy as np
import pytest

from erm.letter.replicates import difference, is_significant, mean, standard_error, with_error


def test_the_error_of_a_mean_falls_with_the_root_of_the_count():
    values = [1.0, 2.0, 3.0]
    assert mean(values) == 2.0
    assert standard_error(values) == pytest.approx(1 / np.sqrt(3))
    assert standard_error(values * 4) == pytest.approx(np.std(values * 4, ddof=1) / np.sqrt(12))


def test_one_value_has_no_error_and_what_gave_nothing_does_not_count():
    assert np.isnan(standard_error([2.0]))
    assert mean([2.0, np.nan]) == 2.0
    assert np.isnan(mean([np.nan]))
    assert with_error([np.nan]) == "–"


def test_what_the_places_do_to_both_settings_falls_out_of_their_difference():
    former = np.array([0.1, 0.5, 0.9])
    step = difference(former + 0.05, former)
    assert step == pytest.approx((0.05, 0.0), abs=1e-15)
    assert is_significant(step)
    assert not is_significant(difference([0.1, 0.9, 0.5], former))


def test_means_are_written_with_their_errors():
    assert with_error([0.5, 0.6, 0.7], percent=True) == "60 % ± 6"
    assert with_error([0.012]) == "0.012"
