"""Permutations of m-sequences."""

import numpy as np
import pytest

from sounder.kernels.correlation.permutations import permutations


def signs_from(found, lag):
    """(-1)**s[n - lag] by the identity that the permutations promise."""
    parity = np.array([bin(word).count("1") % 2 for word in found.input & found.output[lag]])
    return found.polarity * (1 - 2 * parity)


@pytest.mark.parametrize("order", [7, 9, 12, 15])
def test_permuted_walsh_functions_are_the_shifted_sequences(m_sequence, order):
    s = m_sequence(order)
    found = permutations(s)
    assert found.order == order
    for lag in (0, 1, 5, s.size - 1):
        np.testing.assert_array_equal(signs_from(found, lag), 1 - 2 * np.roll(s, lag).astype(int))


@pytest.mark.parametrize("change", [lambda s: s[::-1], lambda s: np.roll(s, 123), lambda s: 1 - s])
def test_any_direction_shift_and_polarity_is_an_m_sequence(m_sequence, change):
    s = change(m_sequence(9))
    found = permutations(s)
    np.testing.assert_array_equal(signs_from(found, 7), 1 - 2 * np.roll(s, 7).astype(int))


def test_complement_is_known_by_its_extra_zero(m_sequence):
    assert permutations(m_sequence(9)).polarity == 1
    assert permutations(1 - m_sequence(9)).polarity == -1


def test_any_wrong_chip_is_noticed(m_sequence):
    for chip in range(0, 127, 9):
        s = m_sequence(7)
        s[chip] ^= 1
        with pytest.raises(ValueError, match="no m-sequence of order 7"):
            permutations(s)


def test_de_bruijn_like_sequence_that_is_not_linear_is_refused():
    """Every state of 4 bits but zero once, yet no linear recurrence (found by exhaustive search)."""
    s = np.array([1, 1, 1, 1, 0, 0, 1, 0, 1, 1, 0, 1, 0, 0, 0])
    state = {tuple(np.roll(s, -n)[:4]) for n in range(15)}
    assert len(state) == 15
    with pytest.raises(ValueError, match="no m-sequence"):
        permutations(s)


@pytest.mark.parametrize("chips", [np.zeros(511), np.ones(511), np.arange(511) % 2, np.zeros(512), np.full(7, 2)])
def test_sequences_that_are_none_are_refused(chips):
    with pytest.raises(ValueError, match="sequence: "):
        permutations(chips)
