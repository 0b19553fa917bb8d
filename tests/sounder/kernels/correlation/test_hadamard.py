"""The plain loops against their numpy twins, called as they are written and compiled."""

import numba
import numpy as np
import pytest

from sounder.kernels.correlation import hadamard, reference


@numba.njit
def compiled_walsh_hadamard(z):
    hadamard.walsh_hadamard(z)


@pytest.mark.parametrize(
    "transform",
    [hadamard.walsh_hadamard, pytest.param(compiled_walsh_hadamard, marks=pytest.mark.slow)],
    ids=["Python", "compiled"],
)
@pytest.mark.parametrize("order", [7, 8, 9])  # they end with a pass of radix 2, 4 and 8
def test_the_transform_is_the_sum_over_walsh_functions(transform, order):
    z = np.random.default_rng(order).integers(-9, 10, (2**order, hadamard.ROW)).astype(float)
    flat = z.ravel().copy()
    transform(flat)
    np.testing.assert_array_equal(flat.reshape(z.shape), reference.walsh_hadamard(z))


def test_the_twin_is_its_own_inverse():
    z = np.random.default_rng(1).integers(-9, 10, (16, 3)).astype(float)
    np.testing.assert_array_equal(reference.walsh_hadamard(reference.walsh_hadamard(z)), 16 * z)


@pytest.mark.parametrize("spc", [1, 2, 3, 4])
def test_chip_sums_are_running_sums_over_a_chip(spc):
    samples = np.random.default_rng(spc).integers(-9, 10, (12, 2)).astype(float)
    wrapped = np.concatenate([samples, samples[:4]])
    sums = np.empty(samples.size)
    hadamard.chip_sums(wrapped.ravel(), spc, sums)
    expected = sum(np.roll(samples, -q, axis=0) for q in range(spc))
    np.testing.assert_array_equal(sums.reshape(-1, 2), expected)


@pytest.mark.parametrize("spc", [1, 2, 3, 4])
def test_chips_of_captures_are_gathered_side_by_side(spc):
    rng = np.random.default_rng(spc)
    chips, chip = 7, 8 if spc == 3 else 2 * spc
    captures = hadamard.ROW // chip
    order = np.array([0, *rng.permutation(chips)])
    sums = rng.standard_normal((captures, chips, 2 * spc)).astype(np.float32)
    z = np.full((chips + 1, captures, chip), 9, np.float32)
    hadamard.gather(sums.ravel(), order, spc, chip, z.reshape(-1))
    assert not z[0].any()
    np.testing.assert_array_equal(z[1:, :, : 2 * spc], sums[:, order[1:]].swapaxes(0, 1))
    out = np.empty(2 * spc * chips)
    hadamard.unpermute(z.ravel(), hadamard.ROW, np.argsort(order[1:]) + 1, spc, 2.0, out)
    np.testing.assert_array_equal(out.reshape(chips, 2 * spc), 2 * sums[0])
