"""Sequences and paths that the kernel tests share."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest

from sounder.kernels import simd

# s[n + order] is the sum (mod 2) of s[n + tap]: one primitive polynomial an order.
TAPS = {
    7: (0, 1),
    8: (0, 2, 3, 4),
    9: (0, 4),
    10: (0, 3),
    11: (0, 2),
    12: (0, 1, 4, 6),
    13: (0, 1, 3, 4),
    14: (0, 1, 3, 5),
    15: (0, 1),
}

Chips = npt.NDArray[np.int8]


def make_sequence(order: int, taps: tuple[int, ...] | None = None) -> Chips:
    chips = [0] * (order - 1) + [1]
    for n in range((1 << order) - 1 - order):
        chips.append(sum(chips[n + tap] for tap in taps or TAPS[order]) % 2)
    return np.array(chips, np.int8)


@pytest.fixture(scope="session")
def m_sequence() -> Callable[..., Chips]:
    """Maker of m-sequences: order, and taps where the usual ones will not do."""
    return make_sequence


@pytest.fixture(params=["vector", "portable"])
def path(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Either way to compute; correlators made in the test take it."""
    monkeypatch.setenv("SOUNDER_PORTABLE_KERNELS", "1" if request.param == "portable" else "0")
    if request.param == "vector" and not simd.available():
        pytest.skip("the processor has no AVX-512")
    return request.param
