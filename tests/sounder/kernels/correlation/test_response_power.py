"""Median of a response, as it is found by counting."""

import numpy as np
import pytest

from sounder.kernels.correlation.response_power import median


@pytest.mark.parametrize("kind", ["noise", "few strong", "equal", "zeros"])
@pytest.mark.parametrize("size", [127, 254])
def test_median_is_exact_to_single_precision(size, kind):
    rng = np.random.default_rng(size)
    values = rng.normal(size=size)
    if kind == "few strong":
        values[:5] += 1e3 * rng.normal(size=5)
    values = {"equal": np.rint(values), "zeros": np.zeros(size)}.get(kind, values)
    values = (values - values.mean()).astype(np.float32)
    found = median(values, np.empty(size, np.int32))
    # steps of 2**-24 of the root mean square, cut off, and a rounding of the numbers
    np.testing.assert_allclose(found, np.median(values), atol=3 * 2**-24 * np.sqrt(np.mean(values**2)))
