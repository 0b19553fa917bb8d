"""Health of samples."""

import numpy as np
import pytest

from sounder.kernels.correlation.clipping import count_rails


@pytest.mark.parametrize("rail", [-32768, 32767])
@pytest.mark.parametrize("size", [1, 2**14, 2**16 + 3])  # more than int16 counts
def test_all_numbers_at_a_rail_are_counted(rail, size):
    assert count_rails(np.full(size, rail, np.int16)) == (size, True)


def test_numbers_beside_the_rails_are_not():
    rng = np.random.default_rng(1)
    captures = rng.integers(-32767, 32767, (40, 1022, 2)).astype(np.int16)
    assert count_rails(captures) == (0, True)
    where = rng.choice(captures.size, 17, replace=False)
    captures.reshape(-1)[where] = rng.choice([-32768, 32767], 17)
    assert count_rails(captures) == (17, True)


def test_one_number_that_is_not_zero_is_a_signal():
    captures = np.zeros((20, 1022, 2), np.int16)
    assert count_rails(captures) == (0, False)
    captures[13, 700, 1] = -1
    assert count_rails(captures) == (0, True)
