"""The permutations that turn correlation with an m-sequence into a Walsh-Hadamard transform."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

IntArray = npt.NDArray[np.int64]


class Permutations(NamedTuple):
    """Permutations of an m-sequence ``s`` of ``N = 2**order - 1`` chips.

    ``(-1)**s[(n - k) % N] == polarity * (-1)**popcount(input[n] & output[k])`` for all n, k: with
    ``z[input[n]] = x[n]`` and ``z[0] = 0``, the circular correlation at delay k is ``polarity`` times entry
    ``output[k]`` of the natural-order Walsh-Hadamard transform of z.
    """

    order: int
    input: IntArray
    output: IntArray
    polarity: int


def permutations(chips: npt.ArrayLike) -> Permutations:
    """Find the permutations of an m-sequence.

    The state of the shift register, ``V[n] = sum_j s[n + j] 2**j``, takes every value 1..N once. Because
    ``s`` obeys a linear recurrence, ``s[n - k]`` is a linear function (over GF(2)) of that state; ``L[k]``
    holds its coefficients, read off at the states that have a single bit.

    Parameters
    ----------
    chips : array (N,)
        The sequence, 0 and 1, of ``N = 2**order - 1`` chips, any shift, either direction. The complement of
        an m-sequence (one more 0 than 1) is taken as that m-sequence with polarity -1.

    Raises
    ------
    ValueError
        The sequence is no m-sequence, nor the complement of one.

    References
    ----------
    M. Cohn and A. Lempel, "On fast M-sequence transforms", IEEE Trans. Inf. Theory 23(1), 1977.

    Examples
    --------
    >>> permutations([1, 0, 1])
    Permutations(order=2, input=array([1, 2, 3]), output=array([1, 3, 2]), polarity=1)
    """
    s = np.asarray(chips)
    order = s.size.bit_length()
    if s.ndim != 1 or s.size != (1 << order) - 1 or order < 2 or not np.isin(s, (0, 1)).all():
        raise ValueError(
            f"sequence: {s.size} chips with values {np.unique(s)[:4].tolist()}; expected 2**order - 1 chips of 0 and 1"
        )
    s = s.astype(np.int64)
    polarity = 1
    if s.sum() == s.size // 2:
        s, polarity = 1 - s, -1
    state = np.sum([np.roll(s, -j) << j for j in range(order)], axis=0)
    time_of = np.zeros(s.size + 1, np.int64)
    time_of[state] = np.arange(s.size)
    lags = np.arange(s.size)
    output = np.sum([s[(time_of[1 << j] - lags) % s.size] << j for j in range(order)], axis=0)
    # All states visited and s[n - 1] linear in the state at n: that is the linear recurrence, and every lag
    # follows.
    if len(np.unique(state)) != s.size or not np.array_equal(_parity(state & output[1]), np.roll(s, 1)):
        raise ValueError(
            f"sequence: {s.size} chips that are no m-sequence of order {order} and no complement of one; "
            "correlate with other sequences by scipy.fft"
        )
    return Permutations(order, state, output, polarity)


def _parity(words: IntArray) -> IntArray:
    """Return the parity of the bits of words below 2**16."""
    for shift in (8, 4, 2, 1):
        words = words ^ (words >> shift)
    return words & 1
